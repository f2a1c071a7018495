#pragma once

/// What may go wrong between a Modbus server and its client.

#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <vector>

#include "core/base/clock.h"
#include "sim/lab/chance.h"

namespace eigenpose::sim {

enum class WireFaultKind {
  none,
  silence,            ///< the request is carried out, no answer comes
  loss,               ///< the request is never seen
  late,               ///< the answer comes after `delay`
  partial,            ///< only the first half of the answer comes
  wrong_unit,         ///< the answer names another unit
  wrong_transaction,  ///< TCP only: the answer names another transaction
  bad_crc,            ///< serial lines only
  exception,          ///< `exception_code` instead of carrying out the request
  close_connection,   ///< TCP only: closed instead of an answer
  death,              ///< the server goes away altogether and stays away
};

struct WireFault {
  WireFaultKind kind = WireFaultKind::none;
  Duration delay = std::chrono::milliseconds(300);
  std::uint8_t exception_code = 4;
};

/// Which fault each request meets: planned ones first, then by chance. Thread-safe.
class FaultPlan {
 public:
  /// After `skip` further requests without planned fault, the next `times` requests meet `fault`.
  void add(const WireFault& fault, int times = 1, int skip = 0);
  /// From now on each request not planned for meets one of `faults` with probability `rate`; 0 ends it.
  void at_random(double rate, std::uint64_t seed, std::vector<WireFault> faults);
  /// Nothing goes wrong any more.
  void clear();
  /// For the request at hand.
  WireFault next();
  /// How many requests met a fault so far.
  [[nodiscard]] std::uint64_t count() const;

 private:
  mutable std::mutex mutex_;
  std::deque<WireFault> planned_;   ///< guarded by mutex_
  double rate_ = 0.0;               ///< guarded by mutex_
  std::optional<Chance> chance_;    ///< guarded by mutex_
  std::vector<WireFault> choices_;  ///< guarded by mutex_
  std::uint64_t count_ = 0;         ///< guarded by mutex_
};

}  // namespace eigenpose::sim
