#pragma once

/// What is wired to the serial side of QEMU's FTDI chip: the guest's second serial port, and a device that
/// answers there.

#include <thread>

#include "sim/usb/sim_link.h"

namespace eigenpose::test {

/// Serves on a thread of its own from construction to destruction. The device must outlive it.
class FarEnd {
 public:
  /// @throws std::runtime_error when the guest has no such port: it is run with --ftdi.
  explicit FarEnd(sim::ByteDevice& device);
  FarEnd(const FarEnd&) = delete;
  FarEnd& operator=(const FarEnd&) = delete;
  ~FarEnd();

 private:
  void serve(const std::stop_token& stop);

  sim::ByteDevice& device_;
  int port_;
  std::jthread thread_;
};

/// Says back what it hears.
class Echo final : public sim::ByteDevice {
 public:
  std::vector<std::uint8_t> receive(std::span<const std::uint8_t> bytes) override {
    return {bytes.begin(), bytes.end()};
  }
};

/// Carries bytes between the chip and a terminal that somebody else serves.
class Terminal final : public sim::ByteDevice {
 public:
  /// @throws std::runtime_error when it cannot be opened.
  explicit Terminal(const std::string& path);
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  ~Terminal() override;
  std::vector<std::uint8_t> receive(std::span<const std::uint8_t> bytes) override;
  std::vector<std::uint8_t> spontaneous() override;

 private:
  int port_;
};

}  // namespace eigenpose::test
