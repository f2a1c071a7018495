/// `eigenpose results`: what the service sees, once or as it happens.

#include <cstdio>
#include <memory>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "daemon/cli/console.h"
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

std::string words(const json& outcome) {
  const std::string verdict = outcome.at("verdict").get<std::string>();
  std::string text = verdict == "recognized" ? outcome.at("object").get<std::string>() : verdict;
  if (verdict == "recognized") {
    char number[64];
    for (const auto& [key, value] : outcome.at("pose").items()) {
      std::snprintf(number, sizeof number, " %s %.1f", key.c_str(), value.get<double>());
      text += number;
    }
    std::snprintf(number, sizeof number, " (distance %.3f of %.3f)", outcome.at("distance").get<double>(),
                  outcome.at("rejection_distance").get<double>());
    text += number;
  }
  return text;
}

void print(const json& result) {
  std::string line = result.at("time").get<std::string>() + "  ";
  if (result.at("state") == "changing")
    line += "something moves";
  else if (result.at("outcomes").empty())
    line += "the table is empty";
  else
    for (std::size_t i = 0; i < result.at("outcomes").size(); ++i)
      line += (i > 0 ? "; " : "") + words(result.at("outcomes")[i]);
  std::printf("%s\n", line.c_str());
  flush_output();
}

int run_results(const ResultsOptions& options, const std::stop_token& stop) {
  const ApiClient client = reading_client(options.service);
  if (!options.follow) {
    const json result = client.get("/v1/results/latest");
    if (options.service.json)
      std::printf("%s\n", result.dump(2).c_str());
    else
      print(result);
    return exit_done;
  }
  int printed = 0;
  client.follow(
      "/v1/results",
      [&](const ApiEvent& event) {
        if (event.name == "lost") {
          warn("too slow for the stream: " + event.data);
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
  throw Error("eigenposed has ended the stream: is it stopping?");
}

}  // namespace

void add_results_command(CLI::App& app, CommandLine& line) {
  const auto options = std::make_shared<ResultsOptions>();
  CLI::App* command = app.add_subcommand("results", "What the service sees on the table");
  auto* follow = command->add_flag("--follow", options->follow, "Go on: print each new result as it comes");
  command->add_option("--count", options->count, "With --follow: end after so many results")
      ->check(CLI::Range(1, 1'000'000'000))
      ->needs(follow);
  add_service_options(*command, options->service);
  command->footer("Examples:\n  eigenpose results\n  eigenpose results --follow --json | jq .outcomes");
  command->callback(
      [options, &line] { line.action = [options, &line] { return run_results(*options, line.stop); }; });
}

}  // namespace eigenpose::cli
