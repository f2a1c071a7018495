#include "sim/lab/lab_server.h"

#include <cerrno>
#include <cstring>
#include <list>
#include <string>
#include <thread>
#include <vector>

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/base/error.h"
#include "sim/lab/descriptor.h"
#include "sim/lab/lab_requests.h"

namespace eigenpose::sim {
namespace {

constexpr std::size_t longest_line = 64 * 1024;

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = path.string();
  if (text.empty() || text.size() >= sizeof address.sun_path) {
    throw Error("lab control: the socket path \"" + text + "\" is empty or longer than " +
                std::to_string(sizeof address.sun_path - 1) + " characters; choose a shorter one");
  }
  std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
  return address;
}

bool somebody_answers(const sockaddr_un& address) {
  const Descriptor probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  return probe && ::connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

Descriptor listening_socket(const std::filesystem::path& path) {
  const sockaddr_un address = address_of(path);
  const std::string where = "lab control: " + path.string() + ": ";
  if (somebody_answers(address))
    throw Error(where + "another simulated lab is running on it; stop it or choose another path");
  struct stat status {};
  if (::lstat(path.c_str(), &status) == 0) {
    if (!S_ISSOCK(status.st_mode))
      throw Error(where + "exists and is no socket; remove it or choose another path");
    ::unlink(path.c_str());  // left by one that was killed
  }
  Descriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket || ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::chmod(path.c_str(), S_IRUSR | S_IWUSR) != 0 || ::listen(socket.get(), 8) != 0) {
    throw Error(where + "cannot listen: " + std::strerror(errno) +
                "; check that the folder exists and is yours");
  }
  return socket;
}

}  // namespace

class LabServer::Worker {
 public:
  Worker(SimLab& lab, std::filesystem::path path, SimModbusServer* modbus)
      : lab_(lab),
        modbus_(modbus),
        path_(std::move(path)),
        wake_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
        listener_(listening_socket(path_)) {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  ~Worker() {
    thread_.request_stop();
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(wake_.get(), &one, sizeof one);
    thread_.join();
    ::unlink(path_.c_str());
  }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  struct Client {
    Descriptor socket;
    std::string received;
    std::string waiting;  ///< answers not sent yet
    bool gone = false;
  };

  void run(const std::stop_token& stop) {
    std::vector<pollfd> polled;
    while (!stop.stop_requested()) {
      polled.assign({{wake_.get(), POLLIN, 0}, {listener_.get(), POLLIN, 0}});
      for (const Client& client : clients_) {
        const bool full = client.waiting.size() > longest_line;  // one who does not read is not listened to
        const int events = (full ? 0 : POLLIN) | (client.waiting.empty() ? 0 : POLLOUT);
        polled.push_back({client.socket.get(), static_cast<short>(events), 0});
      }
      if (::poll(polled.data(), polled.size(), -1) < 0 && errno != EINTR) return;
      std::size_t index = 2;
      for (Client& client : clients_) {
        const short events = polled[index++].revents;
        if ((events & (POLLIN | POLLHUP | POLLERR)) != 0) receive(client);
        if (!client.waiting.empty()) send(client);
      }
      std::erase_if(clients_, [](const Client& client) { return client.gone; });
      for (;;) {
        Descriptor socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
        if (!socket) break;
        clients_.push_back({std::move(socket), {}, {}, false});
      }
    }
  }

  void receive(Client& client) {
    char chunk[4096];
    const auto count = ::recv(client.socket.get(), chunk, sizeof chunk, 0);
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR)) client.gone = true;
    if (count <= 0) return;
    client.received.append(chunk, static_cast<std::size_t>(count));
    for (std::size_t end; (end = client.received.find('\n')) != std::string::npos;) {
      const std::string line = client.received.substr(0, end);
      client.received.erase(0, end + 1);
      if (!line.empty()) client.waiting += obey_lab_request(lab_, modbus_, line) + "\n";
    }
    if (client.received.size() > longest_line) client.gone = true;
  }

  static void send(Client& client) {
    const auto sent = ::send(client.socket.get(), client.waiting.data(), client.waiting.size(), MSG_NOSIGNAL);
    if (sent > 0) client.waiting.erase(0, static_cast<std::size_t>(sent));
    if (sent < 0 && errno != EAGAIN && errno != EINTR) client.gone = true;
  }

  SimLab& lab_;
  SimModbusServer* modbus_;
  std::filesystem::path path_;
  Descriptor wake_;
  Descriptor listener_;
  std::list<Client> clients_;  // of the thread
  std::jthread thread_;
};

LabServer::LabServer(SimLab& lab, std::filesystem::path socket, SimModbusServer* modbus)
    : worker_(std::make_unique<Worker>(lab, std::move(socket), modbus)) {}
LabServer::~LabServer() = default;
const std::filesystem::path& LabServer::socket() const {
  return worker_->path();
}

}  // namespace eigenpose::sim
