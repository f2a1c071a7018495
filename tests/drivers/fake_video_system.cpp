#include "tests/drivers/fake_video_system.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <deque>

#include <linux/videodev2.h>
#include <poll.h>

namespace eigenpose::test {
namespace {

template <std::size_t length>
void put_text(std::uint8_t (&field)[length], const std::string& text) {
  std::memset(field, 0, length);
  std::memcpy(field, text.data(), std::min(text.size(), length - 1));
}

bool is_woken(const WakeUp& wake_up, std::chrono::milliseconds wait) {
  pollfd one{wake_up.descriptor(), POLLIN, 0};
  return poll(&one, 1, static_cast<int>(wait.count())) > 0;
}

}  // namespace

FakeCamera usual_camera() {
  FakeCamera camera;
  camera.modes = {{V4L2_PIX_FMT_YUYV, 640, 480, {30, 15}}};
  camera.controls = {
      {V4L2_CID_BRIGHTNESS, "Brightness", 0, 255, 128},
      {V4L2_CID_AUTO_WHITE_BALANCE, "White Balance, Automatic", 0, 1, 1, V4L2_CTRL_TYPE_BOOLEAN},
      {V4L2_CID_AUTOGAIN, "Gain, Automatic", 0, 1, 1, V4L2_CTRL_TYPE_BOOLEAN},
      {V4L2_CID_GAIN, "Gain", 0, 100, 17},
      {V4L2_CID_WHITE_BALANCE_TEMPERATURE, "White Balance Temperature", 2800, 6500, 4000},
      {V4L2_CID_EXPOSURE_AUTO, "Auto Exposure", 0, 3, V4L2_EXPOSURE_APERTURE_PRIORITY, V4L2_CTRL_TYPE_MENU},
      {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 1, 5000, 156},
      {V4L2_CID_FOCUS_AUTO, "Focus, Automatic Continuous", 0, 1, 1, V4L2_CTRL_TYPE_BOOLEAN}};
  return camera;
}

/// Everything the camera is at the moment. The clock is read through `now`, which also lets scripted things
/// happen.
struct FakeVideoSystem::State {
  FakeCamera camera;
  const Clock& clock;
  ManualClock* manual;  ///< the same clock if it can be moved
  mutable std::recursive_mutex mutex;
  // All below: guarded by mutex.
  bool plugged = true;
  bool stalled = false;
  int damaged = 0;
  int truncated = 0;
  int frames_made = 0;
  int open_devices = 0;
  int mapped = 0;
  std::uint32_t sequence = 0;
  std::map<unsigned long, std::pair<int, int>> failures;
  std::multimap<TimePoint, std::function<void()>> script;
  Device* streaming = nullptr;

  State(FakeCamera c, const Clock& k, ManualClock* m)
      : camera(std::move(c)), clock(k), manual(m), sequence(camera.first_sequence) {}

  TimePoint now() {
    const TimePoint time = clock.now();
    const std::lock_guard lock(mutex);
    while (!script.empty() && script.begin()->first <= time) {
      const auto action = std::move(script.begin()->second);
      script.erase(script.begin());
      action();
    }
    return time;
  }

  /// Lets time pass until `until` or the next scripted moment. @return true if woken.
  bool pass(TimePoint until, const WakeUp& wake_up) {
    {
      const std::lock_guard lock(mutex);
      if (!script.empty()) until = std::min(until, std::max(script.begin()->first, clock.now()));
    }
    if (manual != nullptr) {
      if (is_woken(wake_up, std::chrono::milliseconds(0))) return true;
      const Duration step = until - manual->now();
      if (step > Duration::zero()) manual->advance(step);
      return false;
    }
    // In short steps, since another thread may unplug us meanwhile.
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - clock.now());
    return is_woken(wake_up, std::clamp(left, std::chrono::milliseconds(0), std::chrono::milliseconds(10)));
  }
};

class FakeVideoSystem::Device final : public VideoDevice {
 public:
  explicit Device(std::shared_ptr<State> state) : state_(std::move(state)) {
    const std::lock_guard lock(state_->mutex);
    ++state_->open_devices;
    mode_ = state_->camera.modes.front();
  }

  ~Device() override {
    const std::lock_guard lock(state_->mutex);
    --state_->open_devices;
    if (state_->streaming == this) state_->streaming = nullptr;
  }

  void lose() { gone_ = true; }
  void break_stream() { broken_ = true; }

  int control(unsigned long request, void* argument) override {
    const TimePoint now = state_->now();
    const std::lock_guard lock(state_->mutex);
    if (gone_) return ENODEV;
    if (auto failure = state_->failures.find(request); failure != state_->failures.end()) {
      const int error = failure->second.first;
      if (--failure->second.second == 0) state_->failures.erase(failure);
      return error;
    }
    make_frames(now);
    switch (request) {
      case VIDIOC_QUERYCAP:
        return 0;
      case VIDIOC_ENUM_FMT:
        return enumerate_formats(*static_cast<v4l2_fmtdesc*>(argument));
      case VIDIOC_ENUM_FRAMESIZES:
        return enumerate_sizes(*static_cast<v4l2_frmsizeenum*>(argument));
      case VIDIOC_ENUM_FRAMEINTERVALS:
        return enumerate_intervals(*static_cast<v4l2_frmivalenum*>(argument));
      case VIDIOC_S_FMT:
        return set_format(static_cast<v4l2_format*>(argument)->fmt.pix);
      case VIDIOC_S_PARM:
        return set_rate(static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe);
      case VIDIOC_S_INPUT:
        return *static_cast<int*>(argument) == 0 ? 0 : EINVAL;
      case VIDIOC_QUERY_EXT_CTRL:
        return query_control(*static_cast<v4l2_query_ext_ctrl*>(argument));
      case VIDIOC_G_EXT_CTRLS:
      case VIDIOC_S_EXT_CTRLS:
        return exchange_control(request == VIDIOC_S_EXT_CTRLS,
                                *static_cast<v4l2_ext_controls*>(argument)->controls);
      case VIDIOC_REQBUFS:
        return request_buffers(*static_cast<v4l2_requestbuffers*>(argument));
      case VIDIOC_QUERYBUF:
        return query_buffer(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_QBUF:
        return queue(static_cast<v4l2_buffer*>(argument)->index);
      case VIDIOC_DQBUF:
        return dequeue(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_STREAMON:
        if (state_->streaming != nullptr && state_->streaming != this) return EBUSY;
        state_->streaming = this;
        next_frame_ = now + interval_;
        return 0;
      case VIDIOC_STREAMOFF:
        if (state_->streaming == this) state_->streaming = nullptr;
        broken_ = false;
        queued_.clear();
        filled_.clear();
        return 0;
      default:
        return ENOTTY;
    }
  }

  std::uint8_t* map(std::size_t length, std::int64_t offset) override {
    const std::lock_guard lock(state_->mutex);
    ++state_->mapped;
    auto& memory = memory_.at(static_cast<std::size_t>(offset) / 4096);
    return memory->size() == length ? memory->data() : nullptr;
  }

  void unmap(std::uint8_t*, std::size_t) override {
    const std::lock_guard lock(state_->mutex);
    --state_->mapped;
  }

  Readiness wait(TimePoint deadline, const WakeUp& wake_up) override {
    for (;;) {
      const TimePoint now = state_->now();
      TimePoint until = deadline;
      {
        const std::lock_guard lock(state_->mutex);
        make_frames(now);
        if (gone_ || broken_ || !filled_.empty()) return Readiness::ready;
        if (!state_->stalled && state_->streaming == this) until = std::min(until, next_frame_);
      }
      if (now >= deadline) return Readiness::timeout;
      if (state_->pass(until, wake_up)) return Readiness::woken;
    }
  }

 private:
  struct Filled {
    std::uint32_t index;
    std::uint32_t sequence;
    TimePoint stamp;
    bool damaged;
    std::size_t bytes;
  };

  /// The camera takes its pictures whether anybody looks or not.
  void make_frames(TimePoint now) {
    if (state_->streaming != this) return;
    if (state_->stalled || broken_) {
      next_frame_ = std::max(next_frame_, now + interval_);
      return;
    }
    for (; next_frame_ <= now; next_frame_ += interval_) {
      const std::uint32_t sequence = state_->sequence;
      state_->sequence += state_->camera.sequence_step;
      ++state_->frames_made;
      if (queued_.empty()) continue;
      const std::uint32_t index = queued_.front();
      queued_.pop_front();
      auto& memory = *memory_[index];
      Filled filled{index, sequence, next_frame_, state_->damaged > 0, memory.size()};
      if (state_->damaged > 0) --state_->damaged;
      if (mode_.fourcc == V4L2_PIX_FMT_MJPEG) {
        filled.bytes = std::min(memory.size(), state_->camera.jpeg.size());
        std::copy_n(state_->camera.jpeg.begin(), filled.bytes, memory.begin());
      } else if (state_->camera.fills_frames) {
        std::fill(memory.begin(), memory.end(), static_cast<std::uint8_t>(16 + sequence % 200));
      }
      if (state_->truncated > 0) {
        --state_->truncated;
        filled.bytes /= 2;
      }
      filled_.push_back(filled);
    }
  }

  [[nodiscard]] std::size_t image_bytes() const {
    const auto pixels = static_cast<std::size_t>(mode_.width) * static_cast<std::size_t>(mode_.height);
    return mode_.fourcc == V4L2_PIX_FMT_GREY   ? pixels
           : mode_.fourcc == V4L2_PIX_FMT_NV12 ? pixels * 3 / 2
                                               : pixels * 2;
  }

  int enumerate_formats(v4l2_fmtdesc& description) const {
    std::vector<std::uint32_t> formats;
    for (const FakeMode& mode : state_->camera.modes) {
      if (std::find(formats.begin(), formats.end(), mode.fourcc) == formats.end())
        formats.push_back(mode.fourcc);
    }
    if (description.index >= formats.size()) return EINVAL;
    description.pixelformat = formats[description.index];
    return 0;
  }

  int enumerate_sizes(v4l2_frmsizeenum& size) const {
    std::uint32_t index = 0;
    for (const FakeMode& mode : state_->camera.modes) {
      if (mode.fourcc != size.pixel_format || index++ != size.index) continue;
      size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
      size.discrete.width = static_cast<std::uint32_t>(mode.width);
      size.discrete.height = static_cast<std::uint32_t>(mode.height);
      return 0;
    }
    return EINVAL;
  }

  int enumerate_intervals(v4l2_frmivalenum& interval) const {
    for (const FakeMode& mode : state_->camera.modes) {
      if (mode.fourcc != interval.pixel_format || mode.width != static_cast<int>(interval.width)) continue;
      if (interval.index >= mode.rates.size()) return EINVAL;
      interval.type = V4L2_FRMIVAL_TYPE_DISCRETE;
      interval.discrete = {1, static_cast<std::uint32_t>(mode.rates[interval.index])};
      return 0;
    }
    return EINVAL;
  }

  int set_format(v4l2_pix_format& pixels) {
    for (const FakeMode& mode : state_->camera.modes) {
      if (mode.fourcc == pixels.pixelformat && mode.width == static_cast<int>(pixels.width)) mode_ = mode;
    }
    pixels.pixelformat = mode_.fourcc;
    pixels.width = static_cast<std::uint32_t>(mode_.width);
    pixels.height = static_cast<std::uint32_t>(mode_.height);
    pixels.bytesperline = pixels.width * (mode_.fourcc == V4L2_PIX_FMT_YUYV ? 2U : 1U);
    pixels.sizeimage = static_cast<std::uint32_t>(image_bytes());
    pixels.field = V4L2_FIELD_NONE;
    return 0;
  }

  int set_rate(v4l2_fract& time_per_frame) {
    int nearest = mode_.rates.front();
    const double wanted = static_cast<double>(time_per_frame.denominator) / time_per_frame.numerator;
    for (const int rate : mode_.rates) {
      if (std::abs(rate - wanted) < std::abs(nearest - wanted)) nearest = rate;
    }
    time_per_frame = {1, static_cast<std::uint32_t>(nearest)};
    interval_ = std::chrono::nanoseconds(1'000'000'000 / nearest);
    return 0;
  }

  int query_control(v4l2_query_ext_ctrl& query) const {
    const bool next = (query.id & V4L2_CTRL_FLAG_NEXT_CTRL) != 0;
    const std::uint32_t id = query.id & V4L2_CTRL_ID_MASK;
    const FakeControl* found = nullptr;
    for (const FakeControl& control : state_->camera.controls) {
      if (next ? control.id > id && (found == nullptr || control.id < found->id) : control.id == id)
        found = &control;
    }
    if (found == nullptr) return EINVAL;
    query = {};
    query.id = found->id;
    query.type = found->type;
    query.flags = found->flags;
    query.minimum = found->minimum;
    query.maximum = found->maximum;
    query.step = 1;
    std::memcpy(query.name, found->title.data(), std::min(found->title.size(), sizeof query.name - 1));
    return 0;
  }

  int exchange_control(bool set, v4l2_ext_control& exchange) {
    for (FakeControl& control : state_->camera.controls) {
      if (control.id != exchange.id) continue;
      if (!set) {
        exchange.value = static_cast<std::int32_t>(control.value);
        return 0;
      }
      if (exchange.value < control.minimum || exchange.value > control.maximum) return ERANGE;
      if (is_held_by_automatic(control.id)) return EBUSY;
      control.value = exchange.value;
      return 0;
    }
    return EINVAL;
  }

  /// As real cameras do: a value cannot be set while its automatic is on.
  [[nodiscard]] bool is_held_by_automatic(std::uint32_t id) const {
    const auto value_of = [this](std::uint32_t automatic) {
      for (const FakeControl& control : state_->camera.controls) {
        if (control.id == automatic) return control.value;
      }
      return std::int64_t{0};
    };
    switch (id) {
      case V4L2_CID_GAIN:
        return value_of(V4L2_CID_AUTOGAIN) != 0;
      case V4L2_CID_WHITE_BALANCE_TEMPERATURE:
        return value_of(V4L2_CID_AUTO_WHITE_BALANCE) != 0;
      case V4L2_CID_EXPOSURE_ABSOLUTE:
        return value_of(V4L2_CID_EXPOSURE_AUTO) == V4L2_EXPOSURE_APERTURE_PRIORITY;
      default:
        return false;
    }
  }

  int request_buffers(v4l2_requestbuffers& request) {
    queued_.clear();
    filled_.clear();
    memory_.clear();
    if (request.count == 0) return 0;
    request.count = std::clamp(request.count, state_->camera.least_buffers, state_->camera.most_buffers);
    for (std::uint32_t i = 0; i < request.count; ++i) {
      memory_.push_back(std::make_unique<std::vector<std::uint8_t>>(image_bytes()));
    }
    return 0;
  }

  int query_buffer(v4l2_buffer& buffer) const {
    if (buffer.index >= memory_.size()) return EINVAL;
    buffer.length = static_cast<std::uint32_t>(image_bytes());
    buffer.m.offset = buffer.index * 4096;
    return 0;
  }

  int queue(std::uint32_t index) {
    if (index >= memory_.size() || std::find(queued_.begin(), queued_.end(), index) != queued_.end())
      return EINVAL;
    queued_.push_back(index);
    return 0;
  }

  int dequeue(v4l2_buffer& buffer) {
    if (broken_) return EIO;
    if (state_->streaming != this) return EINVAL;
    if (filled_.empty()) return EAGAIN;
    const Filled filled = filled_.front();
    filled_.pop_front();
    buffer.index = filled.index;
    buffer.sequence = filled.sequence;
    buffer.bytesused = static_cast<std::uint32_t>(filled.bytes);
    buffer.flags = filled.damaged ? static_cast<std::uint32_t>(V4L2_BUF_FLAG_ERROR) : 0U;
    TimePoint stamp = filled.stamp;
    switch (state_->camera.stamp) {
      case FakeStamp::end_of_frame:
        buffer.flags |= V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        break;
      case FakeStamp::start_of_frame:
        buffer.flags |= V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
        stamp -= interval_;
        break;
      case FakeStamp::unknown:
        break;
      case FakeStamp::nonsense:
        buffer.flags |= V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        stamp = TimePoint(std::chrono::seconds(2147483632));
        break;
    }
    const auto microseconds =
        std::chrono::duration_cast<std::chrono::microseconds>(stamp.time_since_epoch()).count();
    buffer.timestamp.tv_sec = microseconds / 1'000'000;
    buffer.timestamp.tv_usec = microseconds % 1'000'000;
    return 0;
  }

  std::shared_ptr<State> state_;
  FakeMode mode_;
  Duration interval_ = std::chrono::milliseconds(33);
  TimePoint next_frame_{};
  bool gone_ = false;
  bool broken_ = false;
  std::vector<std::unique_ptr<std::vector<std::uint8_t>>> memory_;
  std::deque<std::uint32_t> queued_;
  std::deque<Filled> filled_;
};

FakeVideoSystem::FakeVideoSystem(FakeCamera camera, ManualClock& clock)
    : state_(std::make_shared<State>(std::move(camera), clock, &clock)) {}

FakeVideoSystem::FakeVideoSystem(FakeCamera camera, const SteadyClock& clock)
    : state_(std::make_shared<State>(std::move(camera), clock, nullptr)) {}

FakeVideoSystem::~FakeVideoSystem() = default;

std::vector<VideoNode> FakeVideoSystem::nodes() {
  state_->now();
  const std::lock_guard lock(state_->mutex);
  if (!state_->plugged) return {};
  return {state_->camera.node};
}

std::unique_ptr<VideoDevice> FakeVideoSystem::open(const std::string& path, int& error) {
  const std::lock_guard lock(state_->mutex);
  error = state_->plugged && path == state_->camera.node.path ? 0 : ENOENT;
  if (error != 0) return nullptr;
  return std::make_unique<Device>(state_);
}

void FakeVideoSystem::wait_for_change(TimePoint deadline, const WakeUp& wake_up) {
  state_->pass(std::min(deadline, state_->now() + std::chrono::milliseconds(100)), wake_up);
}

void FakeVideoSystem::unplug() {
  const std::lock_guard lock(state_->mutex);
  state_->plugged = false;
  if (state_->streaming != nullptr) state_->streaming->lose();
}

void FakeVideoSystem::plug_in() {
  const std::lock_guard lock(state_->mutex);
  state_->plugged = true;
  state_->sequence = state_->camera.first_sequence;
}

void FakeVideoSystem::stall(bool stalled) {
  const std::lock_guard lock(state_->mutex);
  state_->stalled = stalled;
}

void FakeVideoSystem::damage(int frames) {
  const std::lock_guard lock(state_->mutex);
  state_->damaged = frames;
}

void FakeVideoSystem::truncate(int frames) {
  const std::lock_guard lock(state_->mutex);
  state_->truncated = frames;
}

void FakeVideoSystem::fail(unsigned long request, int error, int times) {
  const std::lock_guard lock(state_->mutex);
  state_->failures[request] = {error, times};
}

void FakeVideoSystem::break_stream() {
  const std::lock_guard lock(state_->mutex);
  if (state_->streaming != nullptr) state_->streaming->break_stream();
}

void FakeVideoSystem::set_sequence(std::uint32_t next) {
  const std::lock_guard lock(state_->mutex);
  state_->sequence = next;
}

void FakeVideoSystem::rename_node(const std::string& path) {
  const std::lock_guard lock(state_->mutex);
  state_->camera.node.path = path;
}

void FakeVideoSystem::replace_modes(std::vector<FakeMode> modes) {
  const std::lock_guard lock(state_->mutex);
  state_->camera.modes = std::move(modes);
}

void FakeVideoSystem::at(TimePoint when, std::function<void()> action) {
  const std::lock_guard lock(state_->mutex);
  state_->script.emplace(when, std::move(action));
}

std::int64_t FakeVideoSystem::control_value(std::uint32_t id) const {
  const std::lock_guard lock(state_->mutex);
  for (const FakeControl& control : state_->camera.controls) {
    if (control.id == id) return control.value;
  }
  return -1;
}

void FakeVideoSystem::set_control_value(std::uint32_t id, std::int64_t value) {
  const std::lock_guard lock(state_->mutex);
  for (FakeControl& control : state_->camera.controls) {
    if (control.id == id) control.value = value;
  }
}

int FakeVideoSystem::open_devices() const {
  const std::lock_guard lock(state_->mutex);
  return state_->open_devices;
}

int FakeVideoSystem::mapped_buffers() const {
  const std::lock_guard lock(state_->mutex);
  return state_->mapped;
}

int FakeVideoSystem::frames_made() const {
  const std::lock_guard lock(state_->mutex);
  return state_->frames_made;
}

}  // namespace eigenpose::test
