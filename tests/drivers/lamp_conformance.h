#pragma once

/// What every lamp must do, whatever it is driven by. Used like axis_conformance.h.

#include <chrono>
#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

#include "core/base/clock.h"
#include "drivers/lamp.h"

namespace eigenpose {

/// A driver and a lamp that the test sees from outside. The lamp is dark at first.
class LampRig {
 public:
  virtual ~LampRig() = default;
  [[nodiscard]] virtual Lamp& lamp() = 0;
  /// Destroys the driver's object; the lamp lives on.
  virtual void discard_lamp() = 0;
  /// How bright it really is, 0 … 1.
  [[nodiscard]] virtual double truth() = 0;
  virtual void silence(bool silent) = 0;
  virtual void unplug() = 0;
  virtual void plug_in() = 0;
};

struct LampRigCase {
  std::string name;
  std::function<std::unique_ptr<LampRig>()> make;
};

inline std::ostream& operator<<(std::ostream& stream, const LampRigCase& rig) {
  return stream << rig.name;
}

inline std::string lamp_rig_name(const testing::TestParamInfo<LampRigCase>& info) {
  return info.param.name;
}

class LampConformance : public testing::TestWithParam<LampRigCase> {
 protected:
  void SetUp() override { rig_ = GetParam().make(); }
  Lamp& lamp() { return rig_->lamp(); }
  LampRig& rig() { return *rig_; }
  static TimePoint soon() { return std::chrono::steady_clock::now() + std::chrono::seconds(20); }

 private:
  std::unique_ptr<LampRig> rig_;
};

}  // namespace eigenpose
