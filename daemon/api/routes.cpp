#include "daemon/api/routes.h"

#include <algorithm>
#include <charconv>
#include <string_view>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "daemon/api/errors.h"
#include "daemon/api/json.h"

namespace eigenpose {
namespace {

using nlohmann::json;

constexpr int jpeg_quality = 85;

/// A route's code is given the request and what stood in the place of {id}.
using Act = Answer (*)(const ApiSources& sources, const Request& request, const std::string& id);

struct Route {
  std::string_view method;
  std::string_view path;  ///< may end in "/{id}"
  Access needs;
  Act act;
};

Response reply(const json& body, int status = 200) {
  // Names of files and devices may hold anything; JSON must stay valid.
  return {status, "application/json", body.dump(-1, ' ', false, json::error_handler_t::replace) + "\n", {}};
}

std::uint64_t sequence_number(const std::string& text, std::uint64_t fallback) {
  if (text.empty()) return fallback;
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size())
    throw ServiceError(Fault::invalid_request, "\"" + text + "\" is not a sequence number",
                       "give the id of the last event you have seen");
  return number;
}

[[noreturn]] void refuse_json(const json::exception& error) {
  throw ServiceError(Fault::invalid_request,
                     std::string("the body is not the JSON this needs: ") + error.what(),
                     "see the API's description");
}

json parsed(const std::string& body) {
  try {
    return body.empty() ? json::object() : json::parse(body);
  } catch (const json::exception& error) {
    refuse_json(error);
  }
}

/// The body as an object with no other keys than these.
json body_object(const Request& request, std::initializer_list<std::string_view> allowed) {
  const json body = parsed(request.body);
  if (!body.is_object())
    throw ServiceError(Fault::invalid_request, "the body is not a JSON object", "send {\"key\": value}");
  for (const auto& [key, value] : body.items())
    if (std::find(allowed.begin(), allowed.end(), key) == allowed.end())
      throw ServiceError(Fault::invalid_request, "unknown key \"" + key + "\"",
                         fmt::format("allowed: {}", fmt::join(allowed, ", ")));
  return body;
}

Answer get_status(const ApiSources& sources, const Request&, const std::string&) {
  return reply(status_json(sources));
}

Answer get_objects(const ApiSources& sources, const Request&, const std::string&) {
  return reply(objects_json(sources.service));
}

Answer get_latest(const ApiSources& sources, const Request&, const std::string&) {
  const auto event = sources.results->latest();
  if (!event)
    throw ServiceError(Fault::not_found, "there is no result yet",
                       "results come once a model is learned and the camera runs");
  return Response{200, "application/json", *event->data + "\n", {}};
}

Answer get_results(const ApiSources& sources, const Request& request, const std::string&) {
  const auto given = request.query.find("after");
  const std::string& after = given != request.query.end() ? given->second : request.last_event_id;
  return EventStream{sources.results, "result", sequence_number(after, sources.results->last_sequence())};
}

Answer get_frame(const ApiSources& sources, const Request&, const std::string&) {
  cv::Mat image = sources.service.newest_frame().frame.image;
  // JPEG has 8 bits; a 16-bit camera keeps its upper ones.
  if (image.depth() == CV_16U) image.convertTo(image, CV_8U, 1.0 / 256.0);
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality});
  return Response{200, "image/jpeg", std::string(bytes.begin(), bytes.end()), {}};
}

Answer get_jobs(const ApiSources& sources, const Request&, const std::string&) {
  json jobs = json::array();
  for (const JobStatus& job : sources.service.jobs().list()) jobs.push_back(to_json(job));
  return reply({{"jobs", std::move(jobs)}});
}

JobStatus job_or_404(const std::optional<JobStatus>& job, const std::string& id) {
  if (!job) throw ServiceError(Fault::not_found, "there is no job \"" + id + "\"", "GET /v1/jobs lists them");
  return *job;
}

Answer get_job(const ApiSources& sources, const Request&, const std::string& id) {
  return reply(to_json(job_or_404(sources.service.jobs().find(id), id)));
}

Answer cancel_job(const ApiSources& sources, const Request&, const std::string& id) {
  return reply(to_json(job_or_404(sources.service.jobs().cancel(id), id)), 202);
}

Response started(const JobStatus& job) {
  Response response = reply(to_json(job), 202);
  response.headers["Location"] = "/v1/jobs/" + job.id;
  return response;
}

/// A plan that stands in the request itself: {"axes": [{"axis": "table", "from": 0, "to": 360, "count":
/// 36}]}.
PlanRequest plan_from(const json& given) {
  PlanRequest plan{"request", {}};
  for (const json& row : given.at("axes")) {
    PlanAxisRequest axis{row.at("axis").get<std::string>(), {}, {}};
    if (row.contains("at"))
      axis.positions = row.at("at").get<std::vector<double>>();
    else
      axis.spacing =
          Spacing{row.at("from").get<double>(), row.at("to").get<double>(), row.at("count").get<int>()};
    plan.axes.push_back(std::move(axis));
  }
  return plan;
}

struct AcquisitionBody {
  std::string object;
  std::variant<std::string, PlanRequest> plan;  ///< the name of one, or one of its own
};

AcquisitionBody acquisition_body(const Request& request) {
  const json body = body_object(request, {"object", "plan"});
  try {
    AcquisitionBody result{body.at("object").get<std::string>(), "default"};
    if (body.contains("plan")) {
      const json& plan = body.at("plan");
      if (plan.is_string())
        result.plan = plan.get<std::string>();
      else
        result.plan = plan_from(plan);
    }
    return result;
  } catch (const json::exception& error) {
    refuse_json(error);
  }
}

Answer post_acquisition(const ApiSources& sources, const Request& request, const std::string&) {
  const AcquisitionBody body = acquisition_body(request);
  return started(
      std::visit([&](const auto& plan) { return sources.service.acquire(body.object, plan); }, body.plan));
}

LearnRequest learn_body(const Request& request) {
  const json body = body_object(request, {"components", "objects"});
  try {
    LearnRequest learn;
    if (body.contains("components")) learn.components = body.at("components").get<int>();
    if (body.contains("objects")) learn.objects = body.at("objects").get<std::vector<std::string>>();
    return learn;
  } catch (const json::exception& error) {
    refuse_json(error);
  }
}

Answer post_learn(const ApiSources& sources, const Request& request, const std::string&) {
  return started(sources.service.learn(learn_body(request)));
}

/// Everything the API offers.
constexpr Route routes[] = {
    {"GET", "/v1/status", Access::read, get_status},
    {"GET", "/v1/objects", Access::read, get_objects},
    {"GET", "/v1/results/latest", Access::read, get_latest},
    {"GET", "/v1/results", Access::read, get_results},
    {"GET", "/v1/frame.jpg", Access::read, get_frame},
    {"GET", "/v1/jobs", Access::read, get_jobs},
    {"GET", "/v1/jobs/{id}", Access::read, get_job},
    {"DELETE", "/v1/jobs/{id}", Access::control, cancel_job},
    {"POST", "/v1/acquisitions", Access::control, post_acquisition},
    {"GET", "/v1/acquisitions/{id}", Access::read, get_job},
    {"DELETE", "/v1/acquisitions/{id}", Access::control, cancel_job},
    {"POST", "/v1/learn", Access::control, post_learn},
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

Answer answer(const ApiSources& sources, const Request& request) {
  std::vector<std::string_view> methods;
  for (const Route& route : routes) {
    std::string id;
    if (!matches(route.path, request.path, id)) continue;
    if (route.method != request.method) {
      methods.push_back(route.method);
      continue;
    }
    if (route.needs == Access::control && request.access != Access::control)
      return error_response(403, "this socket is for reading", "commands go to control.sock beside it");
    return route.act(sources, request, id);
  }
  if (methods.empty())
    throw ServiceError(Fault::not_found, "there is no " + request.path, "GET /v1/status is a good start");
  Response refused = error_response(405, request.method + " is not for " + request.path,
                                    fmt::format("allowed: {}", fmt::join(methods, ", ")));
  refused.headers["Allow"] = fmt::format("{}", fmt::join(methods, ", "));
  return refused;
}

}  // namespace

Handler make_handler(ApiSources sources) {
  return [sources = std::move(sources)](const Request& request) -> Answer {
    try {
      return answer(sources, request);
    } catch (...) {
      return error_response(std::current_exception());
    }
  };
}

}  // namespace eigenpose
