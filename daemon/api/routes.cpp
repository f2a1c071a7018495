#include "daemon/api/routes.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <memory>
#include <set>
#include <string_view>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "core/base/json.h"
#include "core/base/object_name.h"
#include "daemon/api/errors.h"
#include "daemon/api/frame_jpeg.h"
#include "daemon/api/json.h"

namespace eigenpose {
namespace {

using nlohmann::json;

/// What the routes share, for as long as the application lives.
struct Offer {
  explicit Offer(const ApiSources& from) : sources(from) {}

  const ApiSources sources;
  FrameJpeg frames;
};

/// One request, and what stood in the place of {id}.
struct Call {
  Offer& offer;
  const Request& request;
  std::string id;

  [[nodiscard]] Service& service() const { return offer.sources.service; }
};

struct Route {
  std::string_view method;
  std::string_view path;  ///< may end in "/{id}"
  Lane lane;              ///< other lanes than read need the control socket
  std::string_view key;   ///< the one that the query may have; empty: none
  Answer (*act)(const Call& call);
};

[[noreturn]] void refuse(const std::string& what, const std::string& hint) {
  throw ServiceError(Fault::invalid_request, what, hint);
}

Response reply(const json& body, int status = 200) {
  // Names of files and devices may hold anything; JSON must stay valid.
  return {status, "application/json", body.dump(-1, ' ', false, json::error_handler_t::replace) + "\n", {}};
}

/// Where a stream continues that has seen the event `id`, "RUN-NUMBER" or a number of this run. Those of
/// another run of the service are all unseen.
std::uint64_t continue_after(const EventLog& log, const std::string& id) {
  const std::size_t mark = id.rfind('-');
  const bool has_run = mark != std::string::npos;
  const std::string text = has_run ? id.substr(mark + 1) : id;
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || error != std::errc() || end != text.data() + text.size() || mark == 0)
    refuse("\"" + id + "\" is not the id of an event", "give the id of the last event you have seen");
  return has_run && id.substr(0, mark) != log.run() ? 0 : number;
}

/// curl sends a form's type with --data unless another is given; the body is JSON all the same.
void check_content_type(const std::string& content_type) {
  std::string text;
  for (const char c : content_type)
    if (c != ' ' && c != '\t' && c != '"')
      text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  static const std::set<std::string> readable = {"", "application/json", "application/json;charset=utf-8",
                                                 "application/x-www-form-urlencoded"};
  if (readable.contains(text)) return;
  throw UnsupportedMediaType("the body is of type \"" + content_type + "\"",
                             "send application/json in UTF-8");
}

/// What `read` makes of the body, a JSON object with no other keys than these. Only here a fault of JSON is
/// the client's.
template <typename Read>
auto from_body(const Request& request, const std::vector<std::string_view>& allowed, const Read& read) {
  check_content_type(request.content_type);
  try {
    const json body = request.body.empty() ? json::object() : parse_json(request.body);
    json_only_keys(body, allowed);
    return read(body);
  } catch (const JsonError& error) {
    refuse(std::string("the body cannot be used: ") + error.what(), "see the description of the API");
  }
}

std::string object_name(const json& value, std::string_view key) {
  std::string name = json_text(value, key);
  try {
    check_object_name(name);
  } catch (const std::invalid_argument& wrong) {
    refuse(wrong.what(), "choose another name");
  }
  return name;
}

Answer get_status(const Call& call) {
  return reply(status_json(call.offer.sources));
}

Answer get_objects(const Call& call) {
  return reply(objects_json(call.service()));
}

Answer get_latest(const Call& call) {
  const ApiSources& sources = call.offer.sources;
  const auto event = sources.results->latest("result");
  if (!event)
    throw ServiceError(Fault::not_found, "there is no result yet",
                       "results come once a model is learned and the camera runs");
  const Service& service = sources.service;
  // Refused when it is too old: the scene may have changed. An acquisition has the camera to itself.
  if (!service.watcher().status().paused) (void)service.newest_frame();
  json result = json::parse(*event->data);
  const std::chrono::duration<double> seen(result.at("exposure_monotonic_s").get<double>());
  const Duration age = service.age_of(TimePoint(std::chrono::duration_cast<Duration>(seen)));
  result["age_s"] = std::chrono::duration<double>(age).count();
  result["current"] = service.is_current(result.at("frame_sequence").get<std::uint64_t>());
  return reply(result);
}

Answer get_results(const Call& call) {
  const auto& results = call.offer.sources.results;
  const auto given = call.request.query.find("after");
  const std::string& after = given != call.request.query.end() ? given->second : call.request.last_event_id;
  const bool begins_now = after.empty() && given == call.request.query.end();
  return EventStream{results, begins_now ? results->last_sequence() : continue_after(*results, after)};
}

Answer get_frame(const Call& call) {
  const NewestFrame newest = call.service().newest_frame();
  Response response{200, "image/jpeg", *call.offer.frames.of(newest.frame), {}};
  response.headers["X-Frame-Sequence"] = std::to_string(newest.frame.sequence);
  response.headers["X-Frame-Age-Ms"] =
      std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(newest.age).count());
  return response;
}

Answer get_jobs(const Call& call) {
  json jobs = json::array();
  for (const JobStatus& job : call.service().jobs().list()) jobs.push_back(to_json(job));
  return reply({{"jobs", std::move(jobs)}});
}

JobStatus found(const std::optional<JobStatus>& job, const std::string& id) {
  if (!job) throw ServiceError(Fault::not_found, "there is no job \"" + id + "\"", "GET /v1/jobs lists them");
  return *job;
}

Answer get_job(const Call& call) {
  return reply(to_json(found(call.service().jobs().find(call.id), call.id)));
}

/// Only jobs of that kind are found below its path.
void check_is_acquisition(const Call& call) {
  if (found(call.service().jobs().find(call.id), call.id).kind != JobKind::acquire)
    throw ServiceError(Fault::not_found, "job \"" + call.id + "\" is no acquisition",
                       "ask for /v1/jobs/" + call.id);
}

Answer get_acquisition(const Call& call) {
  check_is_acquisition(call);
  return get_job(call);
}

Answer cancel_job(const Call& call) {
  const JobStatus job = found(call.service().jobs().find(call.id), call.id);
  if (job.state != JobState::running)
    throw ServiceError(Fault::conflict,
                       fmt::format("job {} has ended already: it is {}", call.id, job_state_name(job.state)),
                       "there is nothing left to cancel");
  return reply(to_json(found(call.service().jobs().cancel(call.id), call.id)), 202);
}

Answer cancel_acquisition(const Call& call) {
  check_is_acquisition(call);
  return cancel_job(call);
}

Response started(const JobStatus& job) {
  Response response = reply(to_json(job), 202);
  response.headers["Location"] = "/v1/jobs/" + job.id;
  return response;
}

/// A plan that stands in the request itself: {"axes": [{"axis": "table", "from": 0, "to": 360, "count":
/// 36}]}.
PlanRequest plan_from(const json& given) {
  json_only_keys(given, {"axes"});
  const json& rows = json_member(given, "axes");
  if (!rows.is_array()) throw JsonError("\"axes\" is no array");
  PlanRequest plan{"request", {}};
  for (const json& row : rows) {
    PlanAxisRequest axis{json_text(json_member(row, "axis"), "axis"), {}, {}};
    if (row.contains("at")) {
      json_only_keys(row, {"axis", "at"});
      axis.positions = json_numbers(row.at("at"), "at");
    } else {
      json_only_keys(row, {"axis", "from", "to", "count"});
      const auto count = json_integer(json_member(row, "count"), "count", 1, max_plan_views);
      axis.spacing = Spacing{json_number(json_member(row, "from"), "from"),
                             json_number(json_member(row, "to"), "to"), static_cast<int>(count)};
    }
    plan.axes.push_back(std::move(axis));
  }
  return plan;
}

struct AcquisitionBody {
  std::string object;
  std::variant<std::string, PlanRequest> plan;  ///< the name of one, or one of its own
};

Answer post_acquisition(const Call& call) {
  const auto body = from_body(call.request, {"object", "plan"}, [](const json& given) {
    AcquisitionBody result{object_name(json_member(given, "object"), "object"), "default"};
    if (!given.contains("plan")) return result;
    const json& plan = given.at("plan");
    if (plan.is_string())
      result.plan = plan.get<std::string>();
    else
      result.plan = plan_from(plan);
    return result;
  });
  return started(
      std::visit([&](const auto& plan) { return call.service().acquire(body.object, plan); }, body.plan));
}

Answer post_learn(const Call& call) {
  const auto learn = from_body(call.request, {"components", "objects"}, [](const json& given) {
    LearnRequest request;
    if (given.contains("components"))
      request.components = static_cast<int>(json_integer(given.at("components"), "components", 1, 1024));
    if (!given.contains("objects")) return request;
    const json& objects = given.at("objects");
    if (!objects.is_array() || objects.empty()) throw JsonError("\"objects\" is no array with names in it");
    for (const json& object : objects) request.objects.push_back(object_name(object, "objects"));
    const std::set<std::string> different(request.objects.begin(), request.objects.end());
    if (different.size() < request.objects.size()) throw JsonError("\"objects\" names one twice");
    return request;
  });
  return started(call.service().learn(learn));
}

/// Everything the API offers.
constexpr Route routes[] = {
    {"GET", "/v1/status", Lane::read, "", get_status},
    {"GET", "/v1/objects", Lane::read, "", get_objects},
    {"GET", "/v1/results/latest", Lane::read, "", get_latest},
    {"GET", "/v1/results", Lane::read, "after", get_results},
    {"GET", "/v1/frame.jpg", Lane::read, "", get_frame},
    {"GET", "/v1/jobs", Lane::read, "", get_jobs},
    {"GET", "/v1/jobs/{id}", Lane::read, "", get_job},
    {"DELETE", "/v1/jobs/{id}", Lane::stop, "", cancel_job},
    {"POST", "/v1/acquisitions", Lane::command, "", post_acquisition},
    {"GET", "/v1/acquisitions/{id}", Lane::read, "", get_acquisition},
    {"DELETE", "/v1/acquisitions/{id}", Lane::stop, "", cancel_acquisition},
    {"POST", "/v1/learn", Lane::command, "", post_learn},
};

/// Whether `path` is what the route's path stands for; fills `id`.
bool matches(std::string_view pattern, std::string_view path, std::string& id) {
  constexpr std::string_view place = "{id}";
  if (!pattern.ends_with(place)) return pattern == path;
  pattern.remove_suffix(place.size());
  if (!path.starts_with(pattern) || path.size() == pattern.size()) return false;
  id = path.substr(pattern.size());
  return id.find('/') == std::string::npos;
}

/// The route of that method and path; null if there is none. Fills `id`.
const Route* find_route(const Request& request, std::string& id) {
  for (const Route& route : routes)
    if (route.method == request.method && matches(route.path, request.path, id)) return &route;
  return nullptr;
}

/// What the path, or with "*" the server, can be asked: "GET, HEAD, OPTIONS". Empty when there is no such
/// path.
std::string allowed_methods(std::string_view path) {
  std::set<std::string_view> methods;
  std::string id;
  for (const Route& route : routes)
    if (path == "*" || matches(route.path, path, id)) methods.insert(route.method);
  if (methods.empty()) return "";
  if (methods.contains("GET")) methods.insert("HEAD");
  methods.insert("OPTIONS");
  return fmt::format("{}", fmt::join(methods, ", "));
}

/// The answer where there is no route.
Response refuse_route(const Request& request) {
  const std::string allowed = allowed_methods(request.path);
  if (allowed.empty())
    return error_response(404, "there is no " + request.path, "GET /v1/status is a good start");
  if (request.method == "OPTIONS") return {204, "", "", {{"Allow", allowed}}};
  Response refused =
      error_response(405, request.method + " is not for " + request.path, "allowed: " + allowed);
  refused.headers["Allow"] = allowed;
  return refused;
}

Answer answer(Offer& offer, const Request& request) {
  Call call{offer, request, {}};
  const Route* route = find_route(request, call.id);
  if (route == nullptr) return refuse_route(request);
  if (route->lane != Lane::read && request.access != Access::control)
    return error_response(403, "this socket is for reading", "commands go to control.sock beside it");
  for (const auto& [key, value] : request.query)
    if (key != route->key)
      refuse("the query has an unknown key \"" + key + "\"",
             route->key.empty() ? "this path takes no query" : "allowed: " + std::string(route->key));
  return route->act(call);
}

}  // namespace

Application make_application(const ApiSources& sources) {
  const auto offer = std::make_shared<Offer>(sources);
  Application application;
  application.answer = [offer](const Request& request) -> Answer {
    try {
      return answer(*offer, request);
    } catch (...) {
      return error_response(std::current_exception());
    }
  };
  application.lane = [](const Request& request) {
    std::string id;
    const Route* route = find_route(request, id);
    return route == nullptr ? Lane::read : route->lane;
  };
  return application;
}

}  // namespace eigenpose
