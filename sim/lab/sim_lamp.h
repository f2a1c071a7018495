#pragma once

/// The lamp of the simulated lab.

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include "drivers/lamp.h"
#include "sim/lab/sim_lab.h"

namespace eigenpose::sim {

/// Answers at once. The lab must outlive it.
class SimLamp final : public Lamp {
 public:
  SimLamp(SimLab& lab, std::string name) : lab_(lab), info_{std::move(name), "simulated"} {}
  SimLamp(const SimLamp&) = delete;
  SimLamp& operator=(const SimLamp&) = delete;
  ~SimLamp() override { lab_.set_lamp_level(0.0); }

  [[nodiscard]] const LampInfo& info() const override { return info_; }
  void set_level(double level, TimePoint) override {
    lab_.set_lamp_level(level);
    level_ = level;
  }
  [[nodiscard]] double level() const override { return level_; }
  [[nodiscard]] std::uint64_t interruptions() const override { return 0; }

 private:
  SimLab& lab_;
  LampInfo info_;
  double level_ = 0.0;
};

}  // namespace eigenpose::sim
