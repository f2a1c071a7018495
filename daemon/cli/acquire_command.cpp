/// `eigenpose acquire`: has the service take a learning set of the object on the table.

#include <cstdio>
#include <memory>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "daemon/cli/service_client.h"
#include "daemon/cli/service_commands.h"

namespace eigenpose::cli {
namespace {

struct AcquireOptions {
  ServiceOptions service;
  std::string object;
  std::string plan = "default";
};

int run_acquire(const AcquireOptions& options, const std::stop_token& stop) {
  const nlohmann::json job = run_job(options.service, "/v1/acquisitions",
                                     {{"object", options.object}, {"plan", options.plan}}, stop);
  if (options.service.json) {
    std::printf("%s\n", job.dump(2).c_str());
    return exit_done;
  }
  const nlohmann::json& result = job.at("result");
  std::printf("%s: %zu views in %s\n", options.object.c_str(), result.at("views").get<std::size_t>(),
              result.at("folder").get<std::string>().c_str());
  return exit_done;
}

}  // namespace

void add_acquire_command(CLI::App& app, CommandLine& line) {
  const auto options = std::make_shared<AcquireOptions>();
  CLI::App* command =
      app.add_subcommand("acquire", "Have the service take all views of the object on the table");
  command->add_option("OBJECT", options->object, "Its name: letters, digits, _ . -")->required();
  command->add_option("--plan", options->plan, "A [[plan]] of the service's configuration")
      ->capture_default_str();
  add_service_options(*command, options->service);
  command->footer(
      "Put the object on the turntable first. Ctrl-C stops the table; what was taken is kept, and the same "
      "command "
      "continues there.\n\nExample: eigenpose acquire mug --plan lights");
  command->callback([options, &line] {
    line.action = [options, &line] {
      const DevicesInHand in_hand(line);  // the service's: it must hear that the table is to stop
      return run_acquire(*options, line.stop);
    };
  });
}

}  // namespace eigenpose::cli
