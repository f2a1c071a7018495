#include "config/config.h"

#include <algorithm>
#include <limits>
#include <set>

#include <fmt/format.h>

#include "config/device_conflicts.h"
#include "config/toml_table.h"
#include "core/base/error.h"
#include "drivers/modbus/endpoint.h"
#include "drivers/usb/apt_stage.h"

namespace eigenpose {
namespace {

using std::chrono::milliseconds;

constexpr double no_limit = 1e9;  ///< for positions: any machine ends before

milliseconds read_ms(const TomlTable& table, std::string_view key, milliseconds fallback, std::int64_t lower,
                     std::int64_t upper) {
  return milliseconds(table.integer(key, fallback.count(), lower, upper));
}

std::filesystem::path read_path(const TomlTable& table, std::string_view key, const std::string& fallback,
                                const std::filesystem::path& base) {
  const std::filesystem::path path = table.text(key, fallback);
  return path.empty() || path.is_absolute() ? path : (base / path).lexically_normal();
}

unsigned read_mode(const TomlTable& table, std::string_view key, const std::string& fallback) {
  const std::string text = table.text(key, fallback);
  const bool octal = text.size() == 4 && text[0] == '0' &&
                     std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '7'; });
  if (!octal) table.fail(key, fmt::format("\"{}\" is no file mode; allowed: \"0600\" to \"0777\"", text));
  const unsigned mode = static_cast<unsigned>(std::stoul(text, nullptr, 8));
  if ((mode & 0600U) != 0600U)
    table.fail(key, "the owner needs to read and write; allowed: \"0600\" to \"0777\"");
  return mode;
}

std::string read_name(const TomlTable& table, std::string_view key,
                      std::optional<std::string> fallback = {}) {
  std::string name = table.text(key, std::move(fallback));
  const bool fits = !name.empty() && name.size() <= 32 && name[0] >= 'a' && name[0] <= 'z' &&
                    std::all_of(name.begin(), name.end(), [](char c) {
                      return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
                    });
  if (!fits)
    table.fail(key,
               fmt::format("\"{}\" is no name; allowed: a small letter, then up to 31 of a-z, 0-9, _", name));
  return name;
}

DaemonOptions read_daemon(const TomlTable& table, const std::filesystem::path& base) {
  DaemonOptions options;
  options.runtime_dir = read_path(table, "runtime_dir", options.runtime_dir, base);
  options.state_dir = read_path(table, "state_dir", options.state_dir, base);
  options.log_level = table.choice("log_level", options.log_level, {"debug", "info", "warning", "error"});
  table.finish();
  return options;
}

ApiOptions read_api(const TomlTable& table) {
  ApiOptions options;
  options.results_mode = read_mode(table, "results_mode", "0666");
  options.control_mode = read_mode(table, "control_mode", "0660");
  options.results_group = table.text("results_group", "");
  options.control_group = table.text("control_group", "");
  options.max_connections =
      static_cast<int>(table.integer("max_connections", options.max_connections, 1, 1000));
  options.max_body_kib = static_cast<int>(table.integer("max_body_kib", options.max_body_kib, 1, 16384));
  options.request_timeout = read_ms(table, "request_timeout_ms", options.request_timeout, 100, 600'000);
  options.event_buffer = static_cast<int>(table.integer("event_buffer", options.event_buffer, 1, 100'000));
  table.finish();
  return options;
}

CameraOptions read_camera(const TomlTable& table, const std::filesystem::path& base) {
  CameraOptions options;
  options.name = read_name(table, "name", options.name);
  options.driver = table.choice("driver", std::nullopt, {"v4l2", "simulated", "replay"});
  if (options.driver == "v4l2") {
    options.serial = table.text("serial", "");
    options.bus_path = table.text("bus_path", "");
    options.device = table.text("device", "");
    if (table.has("input")) options.input = static_cast<int>(table.integer("input", std::nullopt, 0, 63));
    options.format = table.choice("format", options.format, {"auto", "YUYV", "NV12", "GREY", "MJPG"});
    options.color = table.flag("color", options.color);
    options.lock_automatics = table.flag("lock_automatics", options.lock_automatics);
    options.controls = table.integers("controls");
  }
  if (options.driver == "replay") {
    options.folder = read_path(table, "folder", "", base);
    if (options.folder.empty())
      table.fail("folder", "the replay camera needs a folder of images: folder = \"...\"");
    options.degrees_per_index = table.number("degrees_per_index", options.degrees_per_index, 0.001, 180);
  } else {
    options.width = static_cast<int>(table.integer("width", options.width, 64, 8192));
    options.height = static_cast<int>(table.integer("height", options.height, 64, 8192));
  }
  if (options.driver == "simulated")
    options.exposure_ms = table.number("exposure_ms", options.exposure_ms, 0, 1000);
  options.frames_per_second = table.number("frames_per_second", options.frames_per_second, 0.1, 1000);
  table.finish();
  return options;
}

/// Refuses an endpoint that the driver could not use.
void check_endpoint(const TomlTable& table, const std::string& driver, const std::string& endpoint) {
  constexpr std::string_view usb = "usb:";
  if (driver == "modbus") {
    try {
      (void)parse_modbus_endpoint(endpoint);
    } catch (const std::invalid_argument& error) {
      table.fail("endpoint", error.what());
    }
  } else if (!endpoint.starts_with(usb) || endpoint.size() == usb.size()) {
    table.fail("endpoint", fmt::format("\"{}\" names no device on USB; allowed: \"usb:SERIAL\"", endpoint));
  }
}

/// Unit and range. An axis that closes on itself has a range of its own.
void read_range(const TomlTable& table, Dof& dof) {
  dof.unit = table.choice("unit", "deg", {"deg", "mm"});
  dof.periodic = table.flag("periodic", dof.unit == "deg");
  if (dof.periodic && dof.unit != "deg") table.fail("periodic", "only an axis in deg closes on itself");
  const bool needs_range = !dof.periodic;
  dof.lower = table.number("lower", needs_range ? std::nullopt : std::optional(0.0), -no_limit, no_limit);
  dof.upper = table.number("upper", needs_range ? std::nullopt : std::optional(dof.lower + 360.0), -no_limit,
                           no_limit);
  if (!(dof.lower < dof.upper))
    table.fail("upper", fmt::format("{} is not above lower = {}", dof.upper, dof.lower));
  if (dof.periodic && dof.upper - dof.lower != 360.0)
    table.fail("upper", fmt::format("a periodic axis spans 360 deg, not {}", dof.upper - dof.lower));
}

AxisOptions read_axis(const TomlTable& table, const std::filesystem::path& base) {
  AxisOptions options;
  Dof& dof = options.dof;
  dof.name = read_name(table, "name");
  options.driver = table.choice("driver", std::nullopt, {"modbus", "apt"});
  options.endpoint = table.text("endpoint");
  if (options.endpoint != "simulated") check_endpoint(table, options.driver, options.endpoint);
  if (options.driver == "modbus") {
    options.profile = read_path(table, "profile", "", base);
    options.station = static_cast<int>(table.integer("station", options.station, 1, 247));
    if (table.has("steps_per_unit"))
      options.steps_per_unit = table.number("steps_per_unit", std::nullopt, 1e-3, 1e7);
  } else {
    options.stage = table.text("stage");
    try {
      apt_stage(options.stage);
    } catch (const std::invalid_argument& error) {
      table.fail("stage", error.what());
    }
  }
  read_range(table, dof);
  options.home_offset = table.number("home_offset", 0.0, -no_limit, no_limit);
  options.reversed = table.flag("reversed", false);
  if (table.has("speed")) options.speed = table.number("speed", std::nullopt, 1e-6, 1e6);
  if (table.has("arrival_tolerance"))
    options.arrival_tolerance = table.number("arrival_tolerance", std::nullopt, 1e-6, 10.0);
  options.settle = read_ms(table, "settle_ms", options.settle, 0, 60'000);
  options.move_timeout = read_ms(table, "move_timeout_ms", options.move_timeout, 100, 3'600'000);
  table.finish();
  return options;
}

LampOptions read_lamp(const TomlTable& table, const std::filesystem::path& base) {
  LampOptions options;
  options.name = read_name(table, "name");
  options.driver = table.choice("driver", std::nullopt, {"dmx", "modbus", "simulated"});
  if (options.driver != "simulated") {
    options.endpoint = table.text("endpoint");
    check_endpoint(table, options.driver, options.endpoint);
  }
  if (options.driver == "dmx")
    options.channel = static_cast<int>(table.integer("channel", options.channel, 1, 512));
  if (options.driver == "modbus") {
    options.profile = read_path(table, "profile", "", base);
    if (options.profile.empty())
      table.fail("profile", "a file that says which register dims the lamp is needed");
    options.station = static_cast<int>(table.integer("station", options.station, 1, 247));
  }
  options.level = table.number("level", options.level, 0.0, 1.0);
  table.finish();
  return options;
}

PlanOptions read_plan(const TomlTable& table) {
  PlanOptions plan;
  plan.name = read_name(table, "name");
  plan.place = table.place();
  for (const TomlTable& row : table.tables("axis")) {
    PlanAxisOptions axis;
    axis.axis = row.text("axis");
    axis.at = row.numbers("at");
    axis.spaced = row.has("from") || row.has("to") || row.has("count");
    if (row.has("at") == axis.spaced) row.fail("axis", "give either at = [...] or from, to and count");
    if (axis.spaced) {
      axis.from = row.number("from", std::nullopt, -no_limit, no_limit);
      axis.to = row.number("to", std::nullopt, -no_limit, no_limit);
      axis.count = static_cast<int>(row.integer("count", std::nullopt, 1, 100'000));
    }
    row.finish();
    plan.axes.push_back(std::move(axis));
  }
  table.finish();
  return plan;
}

LearnOptions read_learn(const TomlTable& table) {
  LearnOptions options;
  options.components = static_cast<int>(table.integer("components", options.components, 1, 1024));
  if (table.has("energy")) options.energy = table.number("energy", std::nullopt, 0.01, 1.0);
  options.size = static_cast<int>(table.integer("size", options.size, 8, 256));
  options.color = table.flag("color", options.color);
  options.type = table.text("type", "");
  options.false_rejection = table.number("false_rejection", options.false_rejection, 0.0, 0.5);
  options.false_acceptance = table.number("false_acceptance", options.false_acceptance, 0.0, 1.0);
  table.finish();
  return options;
}

WatchOptions read_watch(const TomlTable& table) {
  WatchOptions options;
  options.enabled = table.flag("enabled", options.enabled);
  options.settle = read_ms(table, "settle_ms", options.settle, 0, 60'000);
  if (table.has("threshold")) options.threshold = table.number("threshold", std::nullopt, 0.5, 255.0);
  table.finish();
  return options;
}

SimOptions read_sim(const TomlTable& table) {
  SimOptions options;
  options.seed = static_cast<std::uint64_t>(table.integer("seed", static_cast<std::int64_t>(options.seed), 0,
                                                          std::numeric_limits<std::int64_t>::max()));
  options.speed_factor = table.number("speed_factor", options.speed_factor, 0.01, 1000.0);
  table.finish();
  return options;
}

/// Refuses the second of two tables with one name.
template <typename Options, typename NameOf>
void refuse_twins(const std::vector<TomlTable>& tables, const std::vector<Options>& options, NameOf name_of) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < options.size(); ++i)
    if (!names.insert(name_of(options[i])).second)
      tables[i].fail("name",
                     fmt::format("\"{}\" is there already: give each its own name", name_of(options[i])));
}

/// What simulated devices need, so that a real rig never runs on a lab that is not there.
void refuse_simulated_without_lab(const TomlTable& root, const Config& config) {
  if (config.sim) return;
  const std::string what = "the simulated lab is needed for this: add a [sim] section";
  if (config.camera && config.camera->driver != "v4l2") root.table("camera")->fail("driver", what);
  for (std::size_t i = 0; i < config.axes.size(); ++i)
    if (config.axes[i].endpoint == "simulated") root.tables("axis")[i].fail("endpoint", what);
  for (std::size_t i = 0; i < config.lamps.size(); ++i)
    if (config.lamps[i].driver == "simulated") root.tables("lamp")[i].fail("driver", what);
}

Config read(const TomlTable& root, const std::filesystem::path& file) {
  Config config;
  config.file = file;
  const std::filesystem::path base = file.parent_path();
  if (const auto table = root.table("daemon")) config.daemon = read_daemon(*table, base);
  if (const auto table = root.table("api")) config.api = read_api(*table);
  if (const auto table = root.table("camera")) config.camera = read_camera(*table, base);
  const std::vector<TomlTable> axes = root.tables("axis");
  for (const TomlTable& table : axes) config.axes.push_back(read_axis(table, base));
  refuse_twins(axes, config.axes, [](const AxisOptions& axis) { return axis.dof.name; });
  const std::vector<TomlTable> lamps = root.tables("lamp");
  for (const TomlTable& table : lamps) config.lamps.push_back(read_lamp(table, base));
  refuse_twins(lamps, config.lamps, [](const LampOptions& lamp) { return lamp.name; });
  const std::vector<TomlTable> plans = root.tables("plan");
  for (const TomlTable& table : plans) config.plans.push_back(read_plan(table));
  refuse_twins(plans, config.plans, [](const PlanOptions& plan) { return plan.name; });
  if (const auto table = root.table("learn")) config.learn = read_learn(*table);
  if (const auto table = root.table("watch")) config.watch = read_watch(*table);
  if (const auto table = root.table("sim")) config.sim = read_sim(*table);
  root.finish();
  refuse_simulated_without_lab(root, config);
  refuse_device_conflicts(root, config);
  return config;
}

}  // namespace

std::vector<Dof> Config::dofs() const {
  std::vector<Dof> result;
  for (const AxisOptions& axis : axes) result.push_back(axis.dof);
  return result;
}

Config read_config(const std::filesystem::path& file) {
  const std::filesystem::path absolute = std::filesystem::absolute(file);
  return read(TomlTable::read_file(absolute), absolute);
}

Config parse_config(std::string_view text, const std::filesystem::path& name) {
  return read(TomlTable::parse(text, name.string()), name);
}

}  // namespace eigenpose
