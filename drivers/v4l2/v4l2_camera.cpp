#include "drivers/v4l2/v4l2_camera.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include <linux/videodev2.h>

#include "core/base/error.h"
#include "drivers/v4l2/buffer_stream.h"

namespace eigenpose {
namespace {

std::string describe(const CameraSelector& selector) {
  std::string text;
  const auto add = [&](const char* what, const std::string& value) {
    if (!value.empty()) text += std::string(text.empty() ? "" : ", ") + what + " '" + value + "'";
  };
  add("serial", selector.serial);
  add("bus path", selector.bus_path);
  add("name", selector.name);
  add("node", selector.node);
  return text.empty() ? "any camera" : text;
}

std::string describe(const std::vector<VideoNode>& nodes) {
  std::string text;
  for (const VideoNode& node : nodes) {
    text += (text.empty() ? "" : "; ") + node.path + " (" + node.name;
    if (!node.serial.empty()) text += ", serial " + node.serial;
    text += ", bus path " + (node.bus_info.empty() ? node.port : node.bus_info) + ")";
  }
  return text.empty() ? "no video device is there" : "there are: " + text;
}

/// Sizes, format and range of what the driver granted.
v4l2_format set_format(VideoDevice& device, const std::string& name, const CaptureMode& mode) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = static_cast<std::uint32_t>(mode.width);
  format.fmt.pix.height = static_cast<std::uint32_t>(mode.height);
  format.fmt.pix.pixelformat = mode.fourcc;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  if (const int error = device.control(VIDIOC_S_FMT, &format); error != 0) {
    throw_device_error(name, "setting " + to_string(mode), error);
  }
  const auto granted = pixel_format_from_fourcc(format.fmt.pix.pixelformat);
  if (!granted || *granted != mode.format) {
    throw DeviceError(name, "setting " + to_string(mode),
                      "the camera made it " + text_of_fourcc(format.fmt.pix.pixelformat) +
                          "; list another format in the camera's formats");
  }
  if (format.fmt.pix.field == V4L2_FIELD_ALTERNATE) {
    throw DeviceError(name, "setting " + to_string(mode),
                      "the camera sends half pictures (alternating fields)");
  }
  return format;
}

BufferLayout layout_of(const v4l2_pix_format& granted, PixelFormat format) {
  BufferLayout layout;
  layout.format = format;
  layout.width = static_cast<int>(granted.width);
  layout.height = static_cast<int>(granted.height);
  layout.stride = granted.bytesperline;
  if (layout.stride == 0) layout.stride = granted.width * (format == PixelFormat::yuyv ? 2U : 1U);
  // V4L2's default: grey sensors and JPEG use all values, other luma 16 … 235.
  const bool full = granted.quantization == V4L2_QUANTIZATION_FULL_RANGE ||
                    (granted.quantization == V4L2_QUANTIZATION_DEFAULT &&
                     (format == PixelFormat::grey || granted.colorspace == V4L2_COLORSPACE_JPEG));
  layout.range = full ? LumaRange::full : LumaRange::limited;
  return layout;
}

/// The rate the driver grants; what it enumerated if it does not say, 30 if nobody does.
double set_rate(VideoDevice& device, double wanted) {
  constexpr double usual = 30.0;
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  auto& interval = parameters.parm.capture.timeperframe;
  interval.numerator = 1000;
  interval.denominator = static_cast<std::uint32_t>(std::lround((wanted > 0.0 ? wanted : usual) * 1000.0));
  const int error = device.control(VIDIOC_S_PARM, &parameters);
  if (error == 0 && interval.numerator > 0 && interval.denominator > 0) {
    return static_cast<double>(interval.denominator) / interval.numerator;
  }
  return wanted > 0.0 ? wanted : usual;
}

}  // namespace

bool is_meant(const VideoNode& node, CameraSelector selector) {
  // The bus_info of a node that cannot be opened is not known, so a bus path cannot rule it out.
  if (node.open_error != 0) selector.bus_path.clear();
  return (selector.serial.empty() || selector.serial == node.serial) &&
         (selector.bus_path.empty() || selector.bus_path == node.bus_info ||
          selector.bus_path == node.port) &&
         (selector.name.empty() || selector.name == node.name) &&
         (selector.node.empty() || selector.node == node.path);
}

const VideoNode& find_camera(const std::vector<VideoNode>& nodes, const CameraSelector& selector,
                             const std::string& device_name) {
  const std::string operation = "looking for " + describe(selector);
  const VideoNode* found = nullptr;
  const VideoNode* forbidden = nullptr;
  for (const VideoNode& node : nodes) {
    if (!is_meant(node, selector)) continue;
    if (node.open_error != 0) forbidden = &node;
    if (node.open_error != 0 || !node.can_capture) continue;
    if (found != nullptr && found->port != node.port) {
      throw DeviceError(device_name, operation,
                        "several fit; give its serial or bus path; " + describe(nodes));
    }
    if (found == nullptr) found = &node;
  }
  if (found != nullptr) return *found;
  if (forbidden != nullptr)
    throw_device_error(device_name, "opening " + forbidden->path, forbidden->open_error);
  throw DeviceLost(device_name, operation, "not found; " + describe(nodes));
}

/// An open, streaming device.
struct V4l2Camera::Session {
  std::unique_ptr<VideoDevice> device;
  std::unique_ptr<PixelDecoder> decoder;
  std::unique_ptr<BufferStream> stream;
  int width = 0;
  int height = 0;
  Duration interval{};
};

/// A good frame not handed out yet; its buffer is ours until given back.
struct V4l2Camera::Candidate {
  FilledBuffer buffer;
  std::uint64_t number = 0;
};

V4l2Camera::V4l2Camera(V4l2CameraOptions options, VideoSystem& system, const Clock& clock)
    : options_(std::move(options)), system_(system), clock_(clock) {
  if (options_.mode.width <= 0 || options_.mode.height <= 0 || !(options_.mode.frames_per_second > 0.0)) {
    throw std::invalid_argument(
        "camera mode " + std::to_string(options_.mode.width) + "x" + std::to_string(options_.mode.height) +
        " at " + std::to_string(options_.mode.frames_per_second) + " fps: all must be positive");
  }
  session_ = open_session();
}

V4l2Camera::~V4l2Camera() = default;

std::unique_ptr<V4l2Camera::Session> V4l2Camera::open_session() {
  const std::string& name = options_.name;
  OpeningReport report;
  report.node = find_camera(system_.nodes(), options_.selector, name);

  auto session = std::make_unique<Session>();
  int error = 0;
  session->device = system_.open(report.node.path, error);
  if (session->device == nullptr) throw_device_error(name, "opening " + report.node.path, error);
  VideoDevice& device = *session->device;
  choose_input(device);
  set_mode(*session, report);

  CameraControls controls(device);
  set_controls(controls, report);
  session->stream = std::make_unique<BufferStream>(device, name, options_.buffers, clock_);
  FrameTiming timing;
  timing.interval = session->interval;
  timing.exposure = controls.locked_exposure();
  timing.internal_frames = options_.internal_frames;
  ledger_.restart(timing, clock_.now());
  waited_ = {};

  const bool first = info_.width == 0;
  describe_session(*session, report, controls);
  if (first) remember_controls(controls);
  report_ = std::move(report);
  note_opening();
  return session;
}

void V4l2Camera::choose_input(VideoDevice& device) const {
  if (!options_.input) return;
  int input = *options_.input;
  if (const int refused = device.control(VIDIOC_S_INPUT, &input); refused != 0)
    throw_device_error(options_.name, "choosing input " + std::to_string(*options_.input), refused);
}

void V4l2Camera::set_mode(Session& session, OpeningReport& report) const {
  const std::string& name = options_.name;
  VideoDevice& device = *session.device;
  const auto best = best_mode(offered_modes(device, options_.mode), options_.mode);
  if (!best) {
    throw DeviceError(
        name, "choosing a mode",
        options_.mode.color
            ? "it offers none of YUYV, NV12, MJPG that is asked for; a grey camera needs color = false"
            : "it offers none of GREY, YUYV, NV12, MJPG that is asked for");
  }
  report.requested = *best;
  const v4l2_format format = set_format(device, name, *best);
  report.granted = *best;
  report.granted.fourcc = format.fmt.pix.pixelformat;
  report.granted.width = session.width = static_cast<int>(format.fmt.pix.width);
  report.granted.height = session.height = static_cast<int>(format.fmt.pix.height);
  const bool first = info_.width == 0;
  if (!first && (session.width != info_.width || session.height != info_.height)) {
    throw DeviceError(name, "opening " + report.node.path,
                      "another camera: it grants " + to_string(report.granted) + ", before it was " +
                          std::to_string(info_.width) + "x" + std::to_string(info_.height));
  }
  report.granted.frames_per_second = set_rate(device, best->frames_per_second);
  session.interval = std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(1.0 / report.granted.frames_per_second));
  session.decoder = std::make_unique<PixelDecoder>(
      layout_of(format.fmt.pix, best->format), options_.mode.color ? PictureKind::color : PictureKind::grey);
}

void V4l2Camera::set_controls(CameraControls& controls, OpeningReport& report) const {
  const bool first = info_.width == 0;
  if (options_.lock_automatics) report.controls = controls.lock_automatics();
  const auto wanted = controls.apply(first ? options_.controls : locked_controls_);
  report.controls.insert(report.controls.end(), wanted.begin(), wanted.end());
  for (const ControlResult& result : wanted) {
    if (first && (!result.granted || !result.problem.empty())) {
      throw DeviceError(options_.name, "setting " + result.name + " = " + std::to_string(result.requested),
                        result.problem);
    }
  }
}

void V4l2Camera::describe_session(const Session& session, const OpeningReport& report,
                                  const CameraControls& controls) {
  info_.name = options_.name;
  info_.model = report.node.name;
  info_.serial = report.node.serial;
  info_.format = name_of(report.granted.format);
  info_.width = session.width;
  info_.height = session.height;
  info_.frames_per_second = report.granted.frames_per_second;
  info_.controls = controls.snapshot();
}

void V4l2Camera::remember_controls(const CameraControls& controls) {
  for (const ControlInfo& control : controls.list()) {
    const auto value = info_.controls.find(control.name);
    if (control.settable && value != info_.controls.end() &&
        (options_.controls.contains(control.name) ||
         (options_.lock_automatics && is_picture_control(control.id)))) {
      locked_controls_.insert(*value);
    }
  }
}

void V4l2Camera::note_opening() const {
  note("camera=" + options_.name + " opened=" + report_.node.path + " model=\"" + info_.model +
       "\" serial=" + info_.serial + " asked=\"" + to_string(report_.requested) + "\" granted=\"" +
       to_string(report_.granted) + "\"");
  for (const ControlResult& result : report_.controls) {
    if (!result.problem.empty()) {
      note("camera=" + options_.name + " control=" + result.name +
           " asked=" + std::to_string(result.requested) + " problem=\"" + result.problem + "\"");
    }
  }
}

void V4l2Camera::reopen(TimePoint deadline, const std::stop_token& stop) {
  for (;;) {
    std::string cause;
    try {
      session_ = open_session();
      note("camera=" + options_.name + " found=" + report_.node.path);
      return;
    } catch (const DeviceError& error) {
      cause = error.what();
    }
    if (stop.stop_requested()) throw Interrupted();
    if (clock_.now() >= deadline) throw DeviceLost(options_.name, "waiting for its return", cause);
    system_.wait_for_change(deadline, wake_up_);
  }
}

Frame V4l2Camera::next_frame(TimePoint deadline, std::stop_token stop) {
  wake_up_.reset();
  const std::stop_callback wake_on_stop(stop, [this] { wake_up_.wake(); });
  for (bool restarted = false;; restarted = true) {
    if (stop.stop_requested()) throw Interrupted();
    if (session_ == nullptr) reopen(deadline, stop);
    try {
      return frame_from_session(deadline, stop);
    } catch (const DeviceLost& lost) {
      session_.reset();
      count(&CameraStatistics::times_lost);
      note("camera=" + options_.name + " lost=\"" + lost.what() + "\"");
      throw;
    } catch (const DeviceTimeout&) {
      throw;
    } catch (const DeviceError& broken) {
      session_.reset();
      note("camera=" + options_.name + " broken=\"" + broken.what() + "\"");
      if (!restarted) continue;
      count(&CameraStatistics::times_lost);
      throw DeviceLost(options_.name, "streaming",
                       std::string("broke again after a new start: ") + broken.what());
    }
  }
}

void V4l2Camera::set_aside(std::optional<Candidate>& newest) {
  if (!newest) return;
  count(&CameraStatistics::frames_dropped);
  session_->stream->give_back(newest->buffer.index);
  newest.reset();
}

bool V4l2Camera::drain(std::optional<Candidate>& newest) {
  BufferStream& stream = *session_->stream;
  const unsigned all = stream.with_driver();
  unsigned taken = 0;
  // A driver that fills faster than we take must not hold us here.
  for (; taken < 2 * stream.buffers(); ++taken) {
    const auto buffer = stream.take();
    if (!buffer) break;
    waited_ = {};
    const std::uint64_t number = ledger_.number(buffer->sequence, clock_.now());
    count(&CameraStatistics::frames_dropped, number - last_number_ - 1);
    last_number_ = number;
    if (buffer->damaged) {
      count_damaged(FrameFault::marked_by_device);
      stream.give_back(buffer->index);
      continue;
    }
    set_aside(newest);
    newest = Candidate{*buffer, number};
  }
  empty_wakes_ = taken == 0 ? empty_wakes_ + 1 : 0;
  return taken >= all;
}

std::optional<Frame> V4l2Camera::decode(std::optional<Candidate>& newest) {
  Frame frame;
  frame.image = pool_.picture(session_->height, session_->width, session_->decoder->picture_type());
  const FrameFault fault = session_->decoder->decode(newest->buffer.bytes, frame.image);
  frame.sequence = newest->number;
  frame.exposure_start = ledger_.exposure_start(newest->buffer, clock_.now());
  session_->stream->give_back(newest->buffer.index);
  newest.reset();
  if (fault != FrameFault::none) {
    count_damaged(fault);
    return std::nullopt;
  }
  count(&CameraStatistics::frames_taken);
  return frame;
}

Frame V4l2Camera::frame_from_session(TimePoint deadline, const std::stop_token& stop) {
  // Far more wakes without a frame than any driver needs: it says "ready" and gives nothing, as a broken one
  // does.
  constexpr unsigned most_empty_wakes = 1000;
  std::optional<Candidate> newest;
  empty_wakes_ = 0;
  const CameraStatistics before_call = statistics();
  const bool starved = drain(newest);
  // Was every buffer full, then the driver has been throwing frames away since: these are old, a new one is
  // near.
  TimePoint patience = starved && newest ? clock_.now() + 2 * session_->interval : TimePoint::min();
  for (;;) {
    TimePoint now = clock_.now();
    if (newest && (now >= patience || now >= deadline)) {
      if (auto frame = decode(newest)) return *std::move(frame);
      continue;
    }
    if (now >= deadline) {
      const std::string damage = damage_since(before_call);
      throw DeviceTimeout(
          options_.name, "waiting for a frame",
          damage.empty() ? "none came in time" : "none that could be used came in time (" + damage + ")");
    }
    const TimePoint stalled = now + options_.stall_after - waited_;
    session_->device->wait(std::min({deadline, stalled, newest ? patience : TimePoint::max()}), wake_up_);
    if (stop.stop_requested()) {
      set_aside(newest);
      throw Interrupted();
    }
    const bool waited_for_fresh = newest.has_value();
    const std::uint64_t before = last_number_;
    waited_ += clock_.now() - now;
    drain(newest);
    if (waited_for_fresh && last_number_ != before) patience = TimePoint::min();
    if (!newest && waited_ >= options_.stall_after) {
      throw DeviceLost(options_.name, "waiting for a frame",
                       "the stream has stalled; check cable, trigger and USB bandwidth");
    }
    if (empty_wakes_ > most_empty_wakes) {
      throw DeviceError(options_.name, "taking a frame", "the driver says there is one and gives none");
    }
  }
}

CameraStatistics V4l2Camera::statistics() const {
  const std::lock_guard lock(mutex_);
  return statistics_;
}

void V4l2Camera::count(std::uint64_t CameraStatistics::*what, std::uint64_t by) {
  const std::lock_guard lock(mutex_);
  statistics_.*what += by;
}

void V4l2Camera::count_damaged(FrameFault fault) {
  const std::lock_guard lock(mutex_);
  ++statistics_.frames_damaged;
  ++statistics_.damaged_by.at(static_cast<std::size_t>(fault));
}

std::string V4l2Camera::damage_since(const CameraStatistics& before) const {
  const CameraStatistics now = statistics();
  std::string reasons;
  for (std::size_t i = 0; i < frame_fault_count; ++i)
    if (const std::uint64_t count = now.damaged_by.at(i) - before.damaged_by.at(i); count > 0)
      reasons += (reasons.empty() ? "" : ", ") + std::to_string(count) + " " +
                 std::string(name_of(static_cast<FrameFault>(i)));
  return reasons;
}

void V4l2Camera::note(const std::string& text) const {
  if (options_.log) options_.log(text);
}

}  // namespace eigenpose
