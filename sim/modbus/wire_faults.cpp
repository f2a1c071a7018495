#include "sim/modbus/wire_faults.h"

#include <stdexcept>
#include <string>

namespace eigenpose::sim {

void FaultPlan::add(const WireFault& fault, int times, int skip) {
  constexpr int most = 1'000'000;
  if (times < 0 || skip < 0 || times > most || skip > most) {
    throw std::invalid_argument("planned faults are counted from 0 to a million, not " +
                                std::to_string(times) + " after " + std::to_string(skip));
  }
  const std::lock_guard lock(mutex_);
  planned_.insert(planned_.end(), static_cast<std::size_t>(skip), WireFault{});
  planned_.insert(planned_.end(), static_cast<std::size_t>(times), fault);
}

void FaultPlan::at_random(double rate, std::uint64_t seed, std::vector<WireFault> faults) {
  if (!(rate >= 0.0 && rate <= 1.0) || (rate > 0.0 && faults.empty())) {
    throw std::invalid_argument("random faults need a rate within 0 … 1 and at least one kind");
  }
  const std::lock_guard lock(mutex_);
  rate_ = rate;
  chance_.emplace(seed);
  choices_ = std::move(faults);
}

void FaultPlan::clear() {
  const std::lock_guard lock(mutex_);
  planned_.clear();
  rate_ = 0.0;
}

WireFault FaultPlan::next() {
  const std::lock_guard lock(mutex_);
  WireFault fault;
  if (!planned_.empty()) {
    fault = planned_.front();
    planned_.pop_front();
  } else if (rate_ > 0.0 && chance_->uniform() < rate_) {
    fault = choices_[chance_->next() % choices_.size()];
  }
  if (fault.kind != WireFaultKind::none) ++count_;
  return fault;
}

std::uint64_t FaultPlan::count() const {
  const std::lock_guard lock(mutex_);
  return count_;
}

}  // namespace eigenpose::sim
