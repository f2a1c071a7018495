/// The demo: an operator's morning and a passer-by's afternoon on the simulated lab, played against a running
/// daemon.
///
/// It acts only through doors that people have: the daemon's API sockets and the lab's control socket (hands
/// that put things on the table). The truth it prints comes from where it put the object, never from the
/// recogniser.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/angle.h"
#include "core/base/atomic_file.h"
#include "core/base/clock.h"
#include "core/base/error.h"
#include "daemon/api/client/api_client.h"
#include "daemon/cli/console.h"
#include "sim/lab/lab_client.h"

namespace eigenpose {
namespace {

using nlohmann::json;

struct Options {
  std::string runtime_dir = "/run/eigenpose";
  unsigned objects = 8;
  unsigned placements = 36;
  unsigned seed = 1;
  std::string pictures;
};

/// What is put on the table, and what the daemon must then say.
struct Placement {
  std::string object;  ///< empty: nothing
  Angle yaw;
  double x_mm = 0.0;
  double y_mm = 0.0;
  bool unknown = false;  ///< was never learned
  bool by_hand = false;  ///< a hand puts it down, instead of it being there at once
};

struct Tally {
  unsigned known = 0, known_right = 0;
  unsigned unknown = 0, unknown_right = 0;
  unsigned empty = 0, empty_right = 0;
  unsigned by_hand = 0, hand_wrong = 0;  ///< placements with a hand, and wrong results while it was there
  std::vector<double> pose_errors_deg;
  std::vector<std::string> without_pose;  ///< objects left out of the pose error, by name
};

double monotonic_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void wait_for_daemon(ApiClient& api) {
  for (int attempt = 0;; ++attempt) {
    try {
      (void)api.get("/v1/status");
      return;
    } catch (const Error&) {
      if (attempt >= 150) throw;
      SteadyClock().sleep_for(std::chrono::milliseconds(100));
    }
  }
}

/// What is learned, and what stays unknown.
struct Choice {
  std::vector<std::string> learned;
  std::vector<std::string> unknown;
};

/// The catalogue in a fresh random order.
Choice choose_objects(const std::vector<sim::CatalogEntry>& catalogue, unsigned count, std::mt19937& random) {
  Choice choice;
  for (const auto& object : catalogue)
    (object.held_out ? choice.unknown : choice.learned).push_back(object.name);
  std::shuffle(choice.learned.begin(), choice.learned.end(), random);
  if (choice.learned.size() > count) choice.learned.resize(count);
  if (choice.learned.empty() || choice.unknown.empty())
    throw Error("the lab's catalogue needs objects to learn and objects to leave out; it has too few");
  return choice;
}

void acquire(ApiClient& api, sim::LabClient& lab, const std::vector<std::string>& objects) {
  for (const std::string& object : objects) {
    lab.clear();
    lab.place(object, degrees(0), 0.0, 0.0);
    const auto begin = std::chrono::steady_clock::now();
    cli::ConsoleProgress progress;
    const json job = api.post("/v1/acquisitions", {{"object", object}});
    const json done = api.wait_for_job(job.at("id").get<std::string>(), progress.callback());
    progress.clear();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    std::printf("   %-14s %4d views  %5.1f s\n", object.c_str(), done.value("total", 0), seconds);
    std::fflush(stdout);
  }
  lab.clear();
}

void learn(ApiClient& api) {
  cli::ConsoleProgress progress;
  const auto begin = std::chrono::steady_clock::now();
  const json job = api.post("/v1/learn", json::object());
  (void)api.wait_for_job(job.at("id").get<std::string>(), progress.callback());
  progress.clear();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const json model = api.get("/v1/status").at("model");
  std::printf("   %d objects, %d views, %d dimensions  %.1f s\n", model.value("objects", 0),
              model.value("views", 0), model.value("components", 0), seconds);
}

std::vector<Placement> plan(const Options& options, const Choice& choice, std::mt19937& random) {
  std::uniform_real_distribution<double> yaw(0.0, 360.0);
  std::uniform_real_distribution<double> offset(-10.0, 10.0);
  std::vector<Placement> placements;
  for (unsigned i = 0; i < options.placements; ++i) {
    Placement placement;
    // One placement in nine is an unknown object, one in twelve an empty table; the others go round the
    // learned objects. A hand brings one in four.
    if (i % 9 == 4) {
      placement.unknown = true;
      placement.object = choice.unknown[(i / 9) % choice.unknown.size()];
    } else if (i % 12 != 7) {
      placement.object = choice.learned[i % choice.learned.size()];
    }
    placement.by_hand = i % 4 == 2 && !placement.object.empty();
    placement.yaw = degrees(yaw(random));
    placement.x_mm = offset(random);
    placement.y_mm = offset(random);
    placements.push_back(placement);
  }
  std::shuffle(placements.begin(), placements.end(), random);
  return placements;
}

/// What the daemon said last; an empty object while it has not looked at a picture since it learned.
json latest_result(ApiClient& api) {
  try {
    return api.get("/v1/results/latest");
  } catch (const ApiError& error) {
    if (error.status() != 404) throw;
    return json::object();
  }
}

/// The first settled result of a picture taken after `since` (monotonic seconds).
json settled_result(ApiClient& api, double since) {
  const double deadline = monotonic_seconds() + 20.0;
  while (monotonic_seconds() < deadline) {
    const json result = latest_result(api);
    if (result.value("state", "") == "settled" && result.value("exposure_monotonic_s", 0.0) > since)
      return result;
    SteadyClock().sleep_for(std::chrono::milliseconds(20));
  }
  throw Error("the daemon reported no settled picture within 20 s; see its log");
}

const char* mark(bool right) {
  return right ? "\u2713" : "\u2717 WRONG";
}

bool is_observable(const json& objects, const std::string& name) {
  for (const json& object : objects.at("objects"))
    if (object.at("name") == name && !object.at("learned").is_null())
      return object["learned"].value("pose_observable", true);
  return true;
}

/// How many regions of `result` are recognised as something else than `object`.
unsigned wrong_names(const json& result, const std::string& object) {
  unsigned wrong = 0;
  for (const json& outcome : result.value("outcomes", json::array()))
    wrong += outcome.at("verdict") == "recognized" && outcome.at("object") != object;
  return wrong;
}

/// Has a hand put the object down, and looks at every result until it has left the picture.
/// @return since when the picture is free of it, monotonic seconds.
double place_by_hand(ApiClient& api, sim::LabClient& lab, const Placement& placement, Tally& tally) {
  const double begin = monotonic_seconds();
  lab.place(placement.object, placement.yaw, placement.x_mm, placement.y_mm, true);
  ++tally.by_hand;
  double last_seen = begin;
  std::uint64_t sequence = 0;
  for (;;) {
    const double now = monotonic_seconds();
    const sim::Truth truth = lab.truth();
    if (!truth.hand_in_view && !truth.moving) return last_seen;
    last_seen = now;
    const json result = latest_result(api);
    const auto number = result.value("sequence", std::uint64_t{0});
    if (number != sequence && result.value("exposure_monotonic_s", 0.0) > begin)
      tally.hand_wrong += wrong_names(result, placement.unknown ? "" : placement.object);
    sequence = number;
    SteadyClock().sleep_for(std::chrono::milliseconds(10));
  }
}

/// What the daemon says in one word.
std::string word_of(const json& outcomes) {
  if (outcomes.empty()) return "nothing";
  if (outcomes.size() > 1) return std::to_string(outcomes.size()) + " things";
  const bool recognized = outcomes[0].at("verdict") == "recognized";
  return (recognized ? outcomes[0].at("object") : outcomes[0].at("verdict")).get<std::string>();
}

/// A line of the table. A degree sign is two bytes and one column wide.
void print_line(unsigned number, const std::string& placed, const std::string& truth, const std::string& said,
                const std::string& found, bool right) {
  const auto padded = [](const std::string& text) {
    const bool has_degree = text.find("\u00b0") != std::string::npos;
    return std::string(text.size() < 9 ? 8 - text.size() + (has_degree ? 1 : 0) : 0, ' ') + text;
  };
  std::printf("  %3u  %-15s %s   %-14s %s  %s\n", number, placed.c_str(), padded(truth).c_str(), said.c_str(),
              found.c_str(), mark(right));
  std::fflush(stdout);
}

std::string degree_text(const char* format, double value) {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

/// Pose and error of a known object, as two columns; counts them.
std::string judge_pose(const json& outcome, const Placement& placement, const json& objects, Tally& tally) {
  if (!is_observable(objects, placement.object) || outcome.at("q").at(0).is_null()) {
    auto& names = tally.without_pose;
    if (std::find(names.begin(), names.end(), placement.object) == names.end())
      names.push_back(placement.object);
    return "     any         ";
  }
  const Angle seen = degrees(outcome.at("q").at(0).get<double>());
  const double error = std::abs(circular_difference(seen, placement.yaw).degrees());
  tally.pose_errors_deg.push_back(error);
  return degree_text("%7.1f\u00b0", seen.degrees()) + " " + degree_text("%7.2f\u00b0", error);
}

/// Puts one thing on the table, asks what it is, prints the answer beside the truth, counts it.
void show(ApiClient& api, sim::LabClient& lab, const Placement& placement, unsigned number,
          const json& objects, Tally& tally) {
  lab.clear();
  double since = monotonic_seconds();
  if (placement.by_hand) {
    since = place_by_hand(api, lab, placement, tally);
  } else if (!placement.object.empty()) {
    lab.place(placement.object, placement.yaw, placement.x_mm, placement.y_mm);
    since = monotonic_seconds();
  }
  const json result = settled_result(api, since);
  const json& outcomes = result.at("outcomes");
  const std::string said = word_of(outcomes);
  const std::string nothing(17, ' ');
  if (placement.object.empty()) {
    const bool right = outcomes.empty();
    ++tally.empty;
    tally.empty_right += right;
    print_line(number, "(empty table)", "", said, nothing, right);
    return;
  }
  const std::string placed =
      placement.object + (placement.unknown ? "*" : "") + (placement.by_hand ? " +" : "");
  const std::string truth = degree_text("%.1f\u00b0", placement.yaw.degrees());
  const bool right = said == (placement.unknown ? "unknown" : placement.object);
  ++(placement.unknown ? tally.unknown : tally.known);
  (placement.unknown ? tally.unknown_right : tally.known_right) += right;
  const bool has_pose = right && !placement.unknown;
  print_line(number, placed, truth, said,
             has_pose ? judge_pose(outcomes[0], placement, objects, tally) : nothing, right);
}

void save_picture(ApiClient& api, const std::string& folder, unsigned number) {
  char name[32];
  std::snprintf(name, sizeof name, "/%03u.jpg", number);
  const std::string jpeg = api.get_bytes("/v1/frame.jpg");
  write_file_atomically(folder + name, jpeg);
}

bool report(Tally& tally, const std::vector<std::string>& symmetric_learned) {
  auto& errors = tally.pose_errors_deg;
  std::sort(errors.begin(), errors.end());
  double mean = 0.0;
  for (const double error : errors) mean += error / static_cast<double>(errors.size());
  std::printf("\n   known objects   %u of %u right\n", tally.known_right, tally.known);
  if (!errors.empty())
    std::printf(
        "   pose error      mean %.2f\u00b0, median %.2f\u00b0, largest %.2f\u00b0 over %zu placements\n",
        mean, errors[errors.size() / 2], errors.back(), errors.size());
  for (const std::string& name : tally.without_pose)
    std::printf("   left out        %s: its pose is not observable\n", name.c_str());
  std::printf("   unknown objects %u of %u reported as unknown\n", tally.unknown_right, tally.unknown);
  std::printf("   empty table     %u of %u seen as empty\n", tally.empty_right, tally.empty);
  std::printf("   a hand          %u placements, %u wrong results while it was in the picture\n",
              tally.by_hand, tally.hand_wrong);

  // Only what is symmetric in truth may go without a pose.
  bool honest = true;
  for (const std::string& name : tally.without_pose)
    if (std::find(symmetric_learned.begin(), symmetric_learned.end(), name) == symmetric_learned.end()) {
      honest = false;
      std::printf("   WRONG           %s has a pose that can be seen, and the model says it has none\n",
                  name.c_str());
    }
  return honest && tally.known_right == tally.known && tally.unknown_right == tally.unknown &&
         tally.empty_right == tally.empty && tally.hand_wrong == 0 && !errors.empty() && mean < 1.0;
}

int run(const Options& options) {
  ApiClient api(options.runtime_dir + "/control.sock");
  wait_for_daemon(api);
  sim::LabClient lab(options.runtime_dir + "/lab.sock");
  std::mt19937 random(options.seed);

  const auto catalogue = lab.objects();
  const Choice choice = choose_objects(catalogue, options.objects, random);
  std::vector<std::string> symmetric;
  for (const auto& object : catalogue)
    if (object.symmetric) symmetric.push_back(object.name);

  std::printf("\n1. Acquire: the daemon turns the table through Modbus and takes %zu image sets\n",
              choice.learned.size());
  acquire(api, lab, choice.learned);
  std::printf("\n2. Learn: the views become manifolds in one eigenspace\n");
  learn(api);
  std::printf(
      "\n3. Watch: %u placements at random poses; * marks an object that was never learned, + one that a\n"
      "   hand puts down\n\n",
      options.placements);
  std::printf("    #  placed             truth   said               pose    error\n");
  const json objects = api.get("/v1/objects");
  Tally tally;
  unsigned number = 0;
  for (const Placement& placement : plan(options, choice, random)) {
    show(api, lab, placement, ++number, objects, tally);
    if (!options.pictures.empty()) save_picture(api, options.pictures, number);
  }
  lab.clear();
  const bool right = report(tally, symmetric);
  std::printf("\n%s\n", right ? "All right." : "Not all was right.");
  return right ? 0 : 1;
}

}  // namespace
}  // namespace eigenpose

int main(int argc, char** argv) {
  eigenpose::Options options;
  CLI::App app{
      "Plays the main job against a daemon on the simulated lab, and compares every answer with the truth."};
  app.add_option("--runtime-dir", options.runtime_dir, "where the daemon's sockets are")
      ->capture_default_str();
  app.add_option("--objects", options.objects, "how many objects to learn")
      ->capture_default_str()
      ->check(CLI::Range(1, 100));
  app.add_option("--placements", options.placements, "how many placements to watch")
      ->capture_default_str()
      ->check(CLI::Range(1, 10000));
  app.add_option("--seed", options.seed, "chooses objects, poses and order")->capture_default_str();
  app.add_option("--pictures", options.pictures, "save the picture of every placement into this folder");
  CLI11_PARSE(app, argc, argv);
  try {
    return eigenpose::run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "eigenpose-demo: %s\n", error.what());
    return 1;
  }
}
