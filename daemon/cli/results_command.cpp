/// `eigenpose results`: what the service sees, once or as it happens.

#include <cstdio>
#include <memory>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/printable.h"
#include "daemon/cli/console.h"
#include "daemon/cli/outcome_text.h"
#include "daemon/cli/service_client.h"
#include "daemon/cli/service_commands.h"

namespace eigenpose::cli {
namespace {

using nlohmann::json;

struct ResultsOptions {
  ServiceOptions service;
  bool follow = false;
  int count = 0;  ///< end after so many; 0: never
};

void print(const json& result) {
  std::string line = result.at("time").get<std::string>() + "  ";
  if (result.at("state") == "changing")
    line += "something moves";
  else if (result.at("outcomes").empty())
    line += "the table is empty";
  else
    for (std::size_t i = 0; i < result.at("outcomes").size(); ++i)
      line += (i > 0 ? "; " : "") + outcome_text(result.at("outcomes")[i]);
  std::printf("%s\n", line.c_str());
  flush_output();
}

/// What happened to the camera goes to stderr: stdout is for results.
void report_camera(const ApiEvent& event) {
  if (event.name == "camera_lost")
    std::fprintf(stderr, "eigenpose: the service has lost the camera: %s\n",
                 printable(json::parse(event.data).at("error").get<std::string>()).c_str());
  else if (event.name == "camera_found")
    std::fprintf(stderr, "eigenpose: the service has found the camera\n");
}

int run_results(const ResultsOptions& options, const std::stop_token& stop) {
  const ApiClient client = reading_client(options.service);
  if (!options.follow) {
    const json result = client.get("/v1/results/latest");
    if (options.service.json)
      std::printf("%s\n", result.dump(2).c_str());
    else
      print(result);
    if (!result.value("current", true))
      std::fprintf(stderr,
                   "eigenpose: this result is not current: an acquisition runs, the camera is lost, or what "
                   "stands there now was not recognised; 'eigenpose status' says which\n");
    return exit_done;
  }
  int printed = 0;
  client.follow(
      "/v1/results",
      [&](const ApiEvent& event) {
        if (event.name == "lost") {
          std::fprintf(
              stderr, "eigenpose: %llu results were lost: this reader is too slow for the stream\n",
              static_cast<unsigned long long>(json::parse(event.data).at("lost").get<std::uint64_t>()));
          return true;
        }
        if (event.name != "result") {
          report_camera(event);
          return true;
        }
        if (options.service.json) {
          std::printf("%s\n", event.data.c_str());
          flush_output();
        } else {
          print(json::parse(event.data));
        }
        return options.count == 0 || ++printed < options.count;
      },
      stop);
  if (stop.stop_requested()) return exit_interrupted;
  if (options.count > 0 && printed >= options.count) return exit_done;
  throw Error("eigenposed has ended the stream; 'eigenpose status' says whether it is running");
}

}  // namespace

void add_results_command(CLI::App& app, CommandLine& line) {
  const auto options = std::make_shared<ResultsOptions>();
  CLI::App* command = app.add_subcommand("results", "What the service sees on the table");
  auto* follow = command->add_flag("--follow", options->follow, "Go on: print each new result as it comes");
  command->add_option("--count", options->count, "With --follow: end after this number of results")
      ->needs(follow)
      ->check(CLI::Range(1, 1'000'000'000));
  add_service_options(*command, options->service);
  command->footer("Examples:\n  eigenpose results\n  eigenpose results --follow --json | jq .outcomes");
  command->callback(
      [options, &line] { line.action = [options, &line] { return run_results(*options, line.stop); }; });
}

}  // namespace eigenpose::cli
