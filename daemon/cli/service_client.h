#pragma once

/// What the commands that talk to a running eigenposed have in common.

#include <filesystem>
#include <stop_token>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "daemon/api/client/api_client.h"

namespace CLI {
class App;
}

namespace eigenpose::cli {

/// --socket and --json.
struct ServiceOptions {
  std::filesystem::path socket = "/run/eigenpose";  ///< a socket, or the folder that holds the service's two
  bool json = false;                                ///< print what the service says, as it is
};

/// Adds both options to a command. `options` must outlive the parsing and the command.
void add_service_options(CLI::App& command, ServiceOptions& options);

/// A client for looking: on results.sock, unless a socket itself is named.
ApiClient reading_client(const ServiceOptions& options);
/// A client for commanding: on control.sock, unless a socket itself is named.
ApiClient commanding_client(const ServiceOptions& options);

/// Posts a job, shows its progress until it ends, and cancels it on `stop`. @return the job.
nlohmann::json run_job(const ServiceOptions& options, std::string_view target, const nlohmann::json& body,
                       const std::stop_token& stop);

/// `eigenpose learn` without a folder: the running service learns what it has acquired and swaps the model
/// in.
/// @param body of the request: components, objects. @return the exit code.
int learn_at_service(const ServiceOptions& options, const nlohmann::json& body, const std::stop_token& stop);

}  // namespace eigenpose::cli
