#pragma once

/// A connection to a Unix socket that blocks, but never longer than its deadline, in the form that Beast's
/// synchronous calls take.

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <optional>

#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <boost/system/error_code.hpp>
#include <boost/system/system_error.hpp>

namespace eigenpose {

/// One connection. One thread at a time, but for `cancel`.
class LocalStream {
 public:
  /// @throws FileError when nobody answers on `socket`, or when this user may not use it.
  explicit LocalStream(const std::filesystem::path& socket);
  LocalStream(const LocalStream&) = delete;
  LocalStream& operator=(const LocalStream&) = delete;
  ~LocalStream();

  /// Reading and writing fail with std::errc::timed_out once `timeout` from now is over.
  void expires_after(std::chrono::milliseconds timeout);
  void expires_never() { deadline_.reset(); }
  /// Ends the read under way and every later one with std::errc::operation_canceled. Thread-safe.
  void cancel() noexcept;

  /// Reads what there is into the first buffer that has room.
  template <typename Buffers>
  std::size_t read_some(const Buffers& buffers, boost::system::error_code& error) {
    for (auto at = boost::asio::buffer_sequence_begin(buffers);
         at != boost::asio::buffer_sequence_end(buffers); ++at) {
      const boost::asio::mutable_buffer buffer = *at;
      if (buffer.size() > 0) return read_bytes(buffer.data(), buffer.size(), error);
    }
    error = {};
    return 0;
  }
  /// Writes of the first buffer that is not empty what the socket takes.
  template <typename Buffers>
  std::size_t write_some(const Buffers& buffers, boost::system::error_code& error) {
    for (auto at = boost::asio::buffer_sequence_begin(buffers);
         at != boost::asio::buffer_sequence_end(buffers); ++at) {
      const boost::asio::const_buffer buffer = *at;
      if (buffer.size() > 0) return write_bytes(buffer.data(), buffer.size(), error);
    }
    error = {};
    return 0;
  }
  /// As Beast asks for them: the same, throwing boost::system::system_error.
  template <typename Buffers>
  std::size_t read_some(const Buffers& buffers) {
    boost::system::error_code error;
    const std::size_t count = read_some(buffers, error);
    if (error) throw boost::system::system_error(error);
    return count;
  }
  template <typename Buffers>
  std::size_t write_some(const Buffers& buffers) {
    boost::system::error_code error;
    const std::size_t count = write_some(buffers, error);
    if (error) throw boost::system::system_error(error);
    return count;
  }

 private:
  std::size_t read_bytes(void* data, std::size_t size, boost::system::error_code& error);
  std::size_t write_bytes(const void* data, std::size_t size, boost::system::error_code& error);
  /// Waits for `events` of the socket, the deadline, or `cancel`. @return false with `error` set for the
  /// latter two.
  bool wait_for(short events, boost::system::error_code& error) const;

  int socket_ = -1;
  int wake_ = -1;  ///< an eventfd, readable once cancelled
  std::optional<std::chrono::steady_clock::time_point> deadline_;
};

}  // namespace eigenpose
