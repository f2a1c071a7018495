#pragma once

/// A way to end a wait in poll() from another thread.

namespace eigenpose {

/// Owns an eventfd. `wake` may be called by any thread; everything else by the owner.
class WakeUp {
 public:
  /// @throws std::system_error when the process has no file descriptor left.
  WakeUp();
  ~WakeUp();
  WakeUp(const WakeUp&) = delete;
  WakeUp& operator=(const WakeUp&) = delete;

  void wake() noexcept;
  void reset() noexcept;
  /// Readable while woken.
  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

}  // namespace eigenpose
