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
#include <fstream>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/angle.h"
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
  bool stranger = false;
};

struct Tally {
  unsigned known = 0, known_right = 0;
  unsigned strangers = 0, strangers_right = 0;
  unsigned empty = 0, empty_right = 0;
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

/// The catalogue in a fresh random order: what is learned, and what stays strange.
void choose_objects(const std::vector<sim::CatalogEntry>& catalogue, unsigned count, std::mt19937& random,
                    std::vector<std::string>& learned, std::vector<std::string>& strangers) {
  for (const auto& object : catalogue) (object.stranger ? strangers : learned).push_back(object.name);
  std::shuffle(learned.begin(), learned.end(), random);
  if (learned.size() > count) learned.resize(count);
  if (learned.empty() || strangers.empty())
    throw Error("the lab's catalogue needs objects to learn and strangers; it has too few");
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

std::vector<Placement> plan(const Options& options, const std::vector<std::string>& learned,
                            const std::vector<std::string>& strangers, std::mt19937& random) {
  std::uniform_real_distribution<double> yaw(0.0, 360.0);
  std::uniform_real_distribution<double> offset(-10.0, 10.0);
  std::vector<Placement> placements;
  for (unsigned i = 0; i < options.placements; ++i) {
    Placement placement;
    // One placement in nine is a stranger, one in twelve an empty table; the others go round the learned
    // objects.
    if (i % 9 == 4) {
      placement.stranger = true;
      placement.object = strangers[(i / 9) % strangers.size()];
    } else if (i % 12 != 7) {
      placement.object = learned[i % learned.size()];
    }
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

/// Puts one thing on the table, asks what it is, prints the answer beside the truth, counts it.
void show(ApiClient& api, sim::LabClient& lab, const Placement& placement, unsigned number,
          const json& objects, Tally& tally) {
  lab.clear();
  if (!placement.object.empty()) lab.place(placement.object, placement.yaw, placement.x_mm, placement.y_mm);
  const json result = settled_result(api, monotonic_seconds());
  const json& outcomes = result.at("outcomes");

  std::string said = "nothing";
  std::string detail;
  bool right = false;
  if (outcomes.size() > 1) {
    said = std::to_string(outcomes.size()) + " things";
  } else if (outcomes.size() == 1) {
    const json& outcome = outcomes[0];
    const bool recognized = outcome.at("verdict") == "recognized";
    said = recognized ? outcome.at("object").get<std::string>() : outcome.at("verdict").get<std::string>();
  }

  if (placement.object.empty()) {
    ++tally.empty;
    right = outcomes.empty();
    tally.empty_right += right;
    std::printf("  %3u  %-14s %8s   %-14s %8s %8s  %s\n", number, "(empty table)", "", said.c_str(), "", "",
                mark(right));
  } else if (placement.stranger) {
    ++tally.strangers;
    right = said == "unknown";
    tally.strangers_right += right;
    std::printf("  %3u  %-14s %7.1f\u00b0   %-14s %8s %8s  %s\n", number, (placement.object + "*").c_str(),
                placement.yaw.degrees(), said.c_str(), "", "", mark(right));
  } else {
    ++tally.known;
    right = said == placement.object;
    tally.known_right += right;
    std::string pose = "";
    std::string error = "";
    if (right && !is_observable(objects, placement.object)) {
      pose = "any";
      if (std::find(tally.without_pose.begin(), tally.without_pose.end(), placement.object) ==
          tally.without_pose.end())
        tally.without_pose.push_back(placement.object);
    } else if (right) {
      const Angle seen = degrees(outcomes[0].at("q").at(0).get<double>());
      const double difference = std::abs(circular_difference(seen, placement.yaw).degrees());
      tally.pose_errors_deg.push_back(difference);
      char text[32];
      std::snprintf(text, sizeof text, "%.1f\u00b0", seen.degrees());
      pose = text;
      std::snprintf(text, sizeof text, "%.2f\u00b0", difference);
      error = text;
    }
    // A degree sign is two bytes and one column wide.
    const int wide = pose == "any" || pose.empty() ? 8 : 9;
    std::printf("  %3u  %-14s %7.1f\u00b0   %-14s %*s %*s  %s\n", number, placement.object.c_str(),
                placement.yaw.degrees(), said.c_str(), wide, pose.c_str(), error.empty() ? 8 : 9,
                error.c_str(), mark(right));
  }
  std::fflush(stdout);
}

void save_picture(ApiClient& api, const std::string& folder, unsigned number) {
  char name[32];
  std::snprintf(name, sizeof name, "/%03u.jpg", number);
  const std::string jpeg = api.get_bytes("/v1/frame.jpg");
  std::ofstream(folder + name, std::ios::binary)
      .write(jpeg.data(), static_cast<std::streamsize>(jpeg.size()));
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
    std::printf("   left out        %s: its pose cannot be seen\n", name.c_str());
  std::printf("   strangers       %u of %u unknown\n", tally.strangers_right, tally.strangers);
  std::printf("   empty table     %u of %u seen as empty\n", tally.empty_right, tally.empty);

  // Only what is symmetric in truth may go without a pose.
  bool honest = true;
  for (const std::string& name : tally.without_pose)
    if (std::find(symmetric_learned.begin(), symmetric_learned.end(), name) == symmetric_learned.end()) {
      honest = false;
      std::printf("   WRONG           %s has a pose that can be seen, and the model says it has none\n",
                  name.c_str());
    }
  return honest && tally.known_right == tally.known && tally.strangers_right == tally.strangers &&
         tally.empty_right == tally.empty && !errors.empty() && mean < 1.0;
}

int run(const Options& options) {
  ApiClient api(options.runtime_dir + "/control.sock");
  wait_for_daemon(api);
  sim::LabClient lab(options.runtime_dir + "/lab.sock");
  std::mt19937 random(options.seed);

  std::vector<std::string> learned;
  std::vector<std::string> strangers;
  const auto catalogue = lab.objects();
  choose_objects(catalogue, options.objects, random, learned, strangers);
  std::vector<std::string> symmetric;
  for (const auto& object : catalogue)
    if (object.symmetric) symmetric.push_back(object.name);

  std::printf("\n1. Acquire: the daemon turns the table through Modbus and takes %zu image sets\n",
              learned.size());
  acquire(api, lab, learned);
  std::printf("\n2. Learn: the views become manifolds in one eigenspace\n");
  learn(api);
  std::printf("\n3. Watch: %u placements at random poses; * marks a stranger that was never learned\n\n",
              options.placements);
  std::printf("    #  placed            truth   said               pose    error\n");
  const json objects = api.get("/v1/objects");
  Tally tally;
  unsigned number = 0;
  for (const Placement& placement : plan(options, learned, strangers, random)) {
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
