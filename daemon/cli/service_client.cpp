#include "daemon/cli/service_client.h"

#include <cstdio>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "daemon/cli/command.h"
#include "daemon/cli/console.h"

namespace eigenpose::cli {
namespace {

ApiClient client_on(const ServiceOptions& options, const char* name) {
  std::error_code ignored;
  const bool folder = std::filesystem::is_directory(options.socket, ignored);
  return ApiClient(folder || options.socket == ServiceOptions{}.socket ? options.socket / name
                                                                       : options.socket);
}

}  // namespace

void add_service_options(CLI::App& command, ServiceOptions& options) {
  command
      .add_option("--socket", options.socket, "Socket of eigenposed, or the folder that holds its sockets")
      ->envname("EIGENPOSE_SOCKET")
      ->capture_default_str()
      ->type_name("PATH");
  command.add_flag("--json", options.json, "Print JSON");
}

ApiClient reading_client(const ServiceOptions& options) {
  return client_on(options, "results.sock");
}

ApiClient commanding_client(const ServiceOptions& options) {
  return client_on(options, "control.sock");
}

nlohmann::json run_job(const ServiceOptions& options, std::string_view target, const nlohmann::json& body,
                       std::stop_token stop) {
  const ApiClient client = commanding_client(options);
  const nlohmann::json job = client.post(target, body);
  ConsoleProgress progress;
  return client.wait_for_job(job.at("id").get<std::string>(), progress.callback(), std::move(stop));
}

int learn_at_service(const ServiceOptions& options, const nlohmann::json& body, std::stop_token stop) {
  const nlohmann::json job = run_job(options, "/v1/learn", body, std::move(stop));
  if (options.json) {
    std::printf("%s\n", job.dump(2).c_str());
    return exit_done;
  }
  const nlohmann::json& result = job.at("result");
  std::printf("learned %zu objects from %zu views in %.1f s; the service watches with them now\n",
              result.at("objects").get<std::size_t>(), result.at("views").get<std::size_t>(),
              result.at("seconds").get<double>());
  return exit_done;
}

}  // namespace eigenpose::cli
