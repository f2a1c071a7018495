#include "daemon/cli/service_client.h"

#include <cstdio>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/printable.h"
#include "daemon/cli/command.h"
#include "daemon/cli/console.h"

namespace eigenpose::cli {
namespace {

/// What of learning's result a person has to know.
void warn_of_left_out(const nlohmann::json& details) {
  for (const nlohmann::json& detail : details) {
    const std::string reason = printable(detail.at("reason").get<std::string>());
    if (detail.at("whole_object").get<bool>())
      std::fprintf(stderr, "warning: left out %s: %s\n", detail.at("object").get<std::string>().c_str(),
                   reason.c_str());
    else
      std::fprintf(stderr, "warning: left out %zu views of %s, the first: %s\n",
                   detail.at("views").get<std::size_t>(), detail.at("object").get<std::string>().c_str(),
                   reason.c_str());
  }
}

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
                       const std::stop_token& stop) {
  const ApiClient client = commanding_client(options);
  const nlohmann::json job = client.post(target, body);
  ConsoleProgress progress;
  return client.wait_for_job(job.at("id").get<std::string>(), progress.callback(), stop);
}

int learn_at_service(const ServiceOptions& options, const nlohmann::json& body, const std::stop_token& stop) {
  const nlohmann::json job = run_job(options, "/v1/learn", body, stop);
  if (options.json) {
    std::printf("%s\n", job.dump(2).c_str());
    return exit_done;
  }
  const nlohmann::json& result = job.at("result");
  warn_of_left_out(result.at("left_out_details"));
  std::printf("learned %zu objects from %zu views in %.1f s; the service watches with them now\n",
              result.at("objects").get<std::size_t>(), result.at("views").get<std::size_t>(),
              result.at("seconds").get<double>());
  return exit_done;
}

}  // namespace eigenpose::cli
