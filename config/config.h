#pragma once

/// The configuration of eigenposed as plain values, and the code that reads and checks it.
///
/// config/eigenposed.toml explains every key. A file that is read here is consistent: names are unique,
/// simulated devices have a [sim] section. Whether the axes can follow a plan is the rig's to check.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/workspace.h"

namespace eigenpose {

/// [daemon]
struct DaemonOptions {
  std::filesystem::path runtime_dir = "/run/eigenpose";    ///< the sockets
  std::filesystem::path state_dir = "/var/lib/eigenpose";  ///< image sets and the model
  std::string log_level = "info";                          ///< "debug", "info", "warning", "error"
};

/// [api]
struct ApiOptions {
  unsigned results_mode = 0666;  ///< file mode of results.sock
  unsigned control_mode = 0660;  ///< file mode of control.sock
  std::string results_group;     ///< group that owns the socket; empty: the daemon's own
  std::string control_group;
  int max_connections = 64;  ///< on each socket
  int max_body_kib = 64;     ///< of a request
  std::chrono::milliseconds request_timeout{
      10'000};             ///< for a request to arrive, and for an answer to be taken
  int event_buffer = 256;  ///< results that a slow client may lag behind before it loses some
};

/// [camera]
struct CameraOptions {
  std::string name = "camera";
  std::string driver;            ///< "v4l2", "simulated", "replay"
  std::string serial;            ///< v4l2: USB serial number; empty: does not matter
  std::string bus_path;          ///< v4l2: the socket it is plugged into; empty: does not matter
  std::filesystem::path device;  ///< v4l2: /dev/video0; empty: does not matter
  std::optional<int> input;      ///< v4l2: of a device that has several; none: the one that is chosen
  bool color = true;             ///< v4l2: false reads grey only
  bool lock_automatics = true;   ///< v4l2: automatic exposure, gain, white balance and focus are turned off
  std::string format = "auto";   ///< v4l2: "YUYV", "NV12", "GREY", "MJPG", or "auto"
  int width = 640;               ///< pixels
  int height = 480;              ///< pixels
  double frames_per_second = 30.0;
  double exposure_ms = 10.0;  ///< simulated only; a real camera has it among `controls`
  std::vector<std::pair<std::string, std::int64_t>> controls;  ///< v4l2 controls by name
  std::filesystem::path folder;                                ///< replay: COIL-named images
  double degrees_per_index = 5.0;                              ///< replay
};

/// [[axis]]
struct AxisOptions {
  Dof dof;               ///< name, unit, range, periodic
  std::string driver;    ///< "modbus", "apt"
  std::string endpoint;  ///< "tcp://HOST:PORT", "rtu:/dev/ttyUSB0:115200:8E1", "usb:SERIAL", "simulated"
  std::filesystem::path profile;            ///< modbus: register description; empty: Oriental Motor AZ
  int station = 1;                          ///< modbus: the drive's address on the bus
  std::string stage;                        ///< apt: "PRM1-Z8", …: gears and encoder
  double home_offset = 0.0;                 ///< the axis's zero, counted from the home position, in the unit
  std::optional<double> steps_per_unit;     ///< gears included; the profile's own if not given
  bool reversed = false;                    ///< the drive counts up where the axis counts down
  std::optional<double> speed;              ///< unit per second; the profile's own if not given
  std::optional<double> arrival_tolerance;  ///< in the unit; the profile's own if not given
  std::chrono::milliseconds settle{200};    ///< vibration dies out after arrival
  std::chrono::milliseconds move_timeout{30'000};
};

/// [[lamp]]
struct LampOptions {
  std::string name;
  std::string driver;             ///< "dmx", "modbus", "simulated"
  std::string endpoint;           ///< dmx: "usb:SERIAL"; modbus: as for an axis
  std::filesystem::path profile;  ///< modbus: register description
  int station = 1;                ///< modbus: 1…247
  int channel = 1;                ///< dmx: 1…512
  double level = 1.0;             ///< 0…1, set at the start
};

/// [[plan.axis]]: either `at`, or the three others.
struct PlanAxisOptions {
  std::string axis;
  std::vector<double> at;  ///< in the axis's unit
  bool spaced = false;     ///< `from`, `to` and `count` are given
  double from = 0.0;
  double to = 0.0;
  int count = 0;
};

/// [[plan]]
struct PlanOptions {
  std::string name;
  std::vector<PlanAxisOptions> axes;
  std::string place;  ///< "FILE:LINE", for messages
};

/// [learn]
struct LearnOptions {
  int components = 20;           ///< K
  std::optional<double> energy;  ///< if set, the smallest K that keeps this share, at most `components`
  int size = 64;                 ///< side of an appearance, pixels
  bool color = true;
  std::string type;                 ///< an image type or a sum of them; empty: brightness, in colour or grey
  double false_rejection = 0.001;   ///< share of views of known objects that may be called unknown
  double false_acceptance = 0.005;  ///< share of views of unknown objects that may get a name
};

/// [watch]
struct WatchOptions {
  bool enabled = true;
  std::chrono::milliseconds settle{300};  ///< the picture must be still for this long before it is looked at
  std::optional<double> threshold;        ///< grey levels; how much a still picture may flicker
};

/// [sim]: the simulated lab in the place of a real one.
struct SimOptions {
  std::uint64_t seed = 1;
  double speed_factor = 1.0;  ///< how much faster than a real table the simulated one turns
};

struct Config {
  std::filesystem::path file;  ///< where it was read
  DaemonOptions daemon;
  ApiOptions api;
  std::optional<CameraOptions> camera;
  std::vector<AxisOptions> axes;
  std::vector<LampOptions> lamps;
  std::vector<PlanOptions> plans;
  LearnOptions learn;
  WatchOptions watch;
  std::optional<SimOptions> sim;

  [[nodiscard]] std::vector<Dof> dofs() const;  ///< of all axes, in the order of the file
  [[nodiscard]] std::filesystem::path image_sets() const { return daemon.state_dir / "sets"; }
  [[nodiscard]] std::filesystem::path model_file() const { return daemon.state_dir / "model.h5"; }
  [[nodiscard]] std::filesystem::path results_socket() const { return daemon.runtime_dir / "results.sock"; }
  [[nodiscard]] std::filesystem::path control_socket() const { return daemon.runtime_dir / "control.sock"; }
  [[nodiscard]] std::filesystem::path lab_socket() const { return daemon.runtime_dir / "lab.sock"; }
};

/// Reads and checks a configuration file. Relative paths in it start at the file's own folder.
/// @throws ConfigError "FILE:LINE: what: what is allowed".
Config read_config(const std::filesystem::path& file);

/// The same from text. @param name stands for the file, in messages and for relative paths.
Config parse_config(std::string_view text, const std::filesystem::path& name);

}  // namespace eigenpose
