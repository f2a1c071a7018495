#include "daemon/api/descriptor_budget.h"

#include <algorithm>
#include <string>

#include <sys/resource.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

/// Standard streams, log, sockets, event loop, camera, drives, lamps, history, and the files of a job that
/// learns while another acquires. The simulated lab with its own servers takes 30.
constexpr int kept_for_devices_and_files = 40;
constexpr int least_clients = 8;
constexpr int highest_limit = 4096;

}  // namespace

DescriptorBudget share_descriptors(int limit, int wanted) {
  const int left = limit - kept_for_devices_and_files;
  if (left < least_clients)
    throw ConfigError("the process may open " + std::to_string(limit) + " files, and needs " +
                      std::to_string(kept_for_devices_and_files + least_clients) +
                      ": raise LimitNOFILE in the unit, or ulimit -n in a shell");
  DescriptorBudget budget;
  budget.limit = limit;
  budget.commanders = std::min(wanted, std::max(least_clients / 2, left / 4));
  budget.readers = std::min(wanted, left - budget.commanders);
  return budget;
}

int raise_descriptor_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return highest_limit;
  const rlim_t wanted = std::min<rlim_t>(limit.rlim_max, highest_limit);
  if (limit.rlim_cur < wanted) {
    rlimit raised = limit;
    raised.rlim_cur = wanted;
    if (::setrlimit(RLIMIT_NOFILE, &raised) == 0) limit = raised;
  }
  return static_cast<int>(std::min<rlim_t>(limit.rlim_cur, 1'000'000));
}

}  // namespace eigenpose
