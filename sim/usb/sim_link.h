#pragma once

/// A cable in the same process between a driver and a simulated controller, on which bytes can be lost,
/// damaged or delayed, and which can be pulled out.

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/clock.h"
#include "drivers/usb/byte_link.h"
#include "sim/lab/chance.h"

namespace eigenpose::sim {

/// The device's end. Thread-safe.
class ByteDevice {
 public:
  virtual ~ByteDevice() = default;
  /// Takes what the host sends. @return what the device answers.
  virtual std::vector<std::uint8_t> receive(std::span<const std::uint8_t> bytes) = 0;
  /// What the device says by itself.
  virtual std::vector<std::uint8_t> spontaneous() { return {}; }

 protected:
  ByteDevice() = default;
  ByteDevice(const ByteDevice&) = default;
  ByteDevice& operator=(const ByteDevice&) = default;
};

/// Shares of what is sent in one piece, 0…1.
struct CableFaults {
  double lost_from_host = 0.0;
  double lost_to_host = 0.0;
  double cut_to_host = 0.0;      ///< only the first half arrives
  double damaged_to_host = 0.0;  ///< one bit is turned
  double delayed_to_host = 0.0;  ///< by `delay`
  Duration delay = std::chrono::milliseconds(20);
};

/// The cable, and what may be done to it from outside. Thread-safe. Outlives its links.
class Cable {
 public:
  /// @param device and clock outlive the cable.
  Cable(ByteDevice& device, const Clock& clock, std::uint64_t seed = 1);

  void unplug();
  void plug_in();
  [[nodiscard]] bool plugged_in() const;
  /// The device hears nothing and says nothing.
  void silence(bool silent);
  void set_faults(const CableFaults& faults);
  /// How often the link was opened.
  [[nodiscard]] int openings() const;

 private:
  friend class SimLink;
  struct Packet {
    TimePoint due;
    std::vector<std::uint8_t> bytes;
  };

  bool open();
  bool send(std::span<const std::uint8_t> bytes, int opening);
  /// Nothing when unplugged since `opening`.
  std::optional<std::size_t> take(std::span<std::uint8_t> buffer, int opening);
  void discard();
  void carry_to_host(std::vector<std::uint8_t> bytes);

  ByteDevice& device_;
  const Clock& clock_;
  mutable std::mutex mutex_;
  Chance chance_;               ///< guarded by mutex_
  CableFaults faults_;          ///< guarded by mutex_
  std::deque<Packet> to_host_;  ///< guarded by mutex_
  bool plugged_in_ = true;      ///< guarded by mutex_
  bool silent_ = false;         ///< guarded by mutex_
  int openings_ = 0;            ///< guarded by mutex_
};

/// The driver's end.
class SimLink final : public ByteLink {
 public:
  SimLink(Cable& cable, const Clock& clock, std::string name = "simulated link");
  void write(std::span<const std::uint8_t> bytes, TimePoint deadline) override;
  std::size_t read(std::span<std::uint8_t> buffer, TimePoint deadline) override;
  void discard_input() override;
  void reopen(TimePoint deadline) override;
  [[nodiscard]] const std::string& description() const override { return name_; }

 private:
  [[noreturn]] void lost(const std::string& operation) const;

  Cable& cable_;
  const Clock& clock_;
  std::string name_;
  int opening_ = 0;  ///< number of the opening this link works with; 0: none yet
};

}  // namespace eigenpose::sim
