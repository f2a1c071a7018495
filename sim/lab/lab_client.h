#pragma once

/// The other end of a LabServer.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sim/lab/sim_lab.h"

namespace eigenpose::sim {

/// One connection. One thread at a time. Every call throws eigenpose::Error when the lab is not reached, does
/// not answer within five seconds or refuses; the text says why.
class LabClient {
 public:
  explicit LabClient(const std::filesystem::path& socket);
  LabClient(const LabClient&) = delete;
  LabClient& operator=(const LabClient&) = delete;
  ~LabClient();

  [[nodiscard]] std::vector<CatalogEntry> objects();
  /// @param by_hand a hand comes, lets go and leaves; the call returns when it starts. @return the object's
  /// id.
  std::uint64_t place(const std::string& object, Angle yaw = {}, double x_mm = 0.0, double y_mm = 0.0,
                      bool by_hand = false);
  void remove(std::uint64_t id, bool by_hand = false);
  void clear();
  void hand(bool in);
  void set_lamp_level(double level);
  void set_camera_faults(const CameraFaults& faults);
  [[nodiscard]] Truth truth();
  /// Any request as a line of JSON; the answer's line when the lab did it.
  std::string request(const std::string& line);

 private:
  class Connection;
  std::unique_ptr<Connection> connection_;
};

}  // namespace eigenpose::sim
