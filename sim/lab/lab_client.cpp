#include "sim/lab/lab_client.h"

#include <cerrno>
#include <chrono>
#include <cstring>

#include <nlohmann/json.hpp>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "core/base/error.h"
#include "sim/lab/descriptor.h"

namespace eigenpose::sim {
namespace {

using Json = nlohmann::json;
constexpr auto patience = std::chrono::seconds(5);

}  // namespace

class LabClient::Connection {
 public:
  explicit Connection(const std::filesystem::path& path) : path_(path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string text = path.string();
    if (text.size() >= sizeof address.sun_path) fail("the path is too long for a socket");
    std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
    socket_ = Descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (!socket_ || ::connect(socket_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
      fail(std::string("no simulated lab answers (") + std::strerror(errno) +
           "); is the daemon running with a simulated rig?");
    }
  }

  std::string exchange(const std::string& line) {
    const std::string message = line + "\n";
    std::size_t sent = 0;
    while (sent < message.size()) {
      const auto count = ::send(socket_.get(), message.data() + sent, message.size() - sent, MSG_NOSIGNAL);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) fail("the simulated lab has gone away");
      sent += static_cast<std::size_t>(count);
    }
    const auto until = std::chrono::steady_clock::now() + patience;
    for (;;) {
      const std::size_t end = received_.find('\n');
      if (end != std::string::npos) {
        const std::string answer = received_.substr(0, end);
        received_.erase(0, end + 1);
        return answer;
      }
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(until - std::chrono::steady_clock::now());
      pollfd polled{socket_.get(), POLLIN, 0};
      if (left.count() <= 0 || ::poll(&polled, 1, static_cast<int>(left.count())) == 0)
        fail("no answer within 5 s");
      char chunk[4096];
      const auto count = ::recv(socket_.get(), chunk, sizeof chunk, 0);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) fail("the simulated lab has gone away");
      received_.append(chunk, static_cast<std::size_t>(count));
    }
  }

  Json ask(const Json& request) {
    const Json answer = Json::parse(exchange(request.dump()), nullptr, false);
    if (answer.is_discarded() || !answer.is_object()) fail("the answer is no JSON object");
    if (!answer.value("ok", false)) fail(answer.value("error", "refused without a reason"));
    return answer;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error("lab control " + path_.string() + ": " + what);
  }

 private:
  std::filesystem::path path_;
  Descriptor socket_;
  std::string received_;
};

LabClient::LabClient(const std::filesystem::path& socket)
    : connection_(std::make_unique<Connection>(socket)) {}
LabClient::~LabClient() = default;

std::vector<CatalogEntry> LabClient::objects() {
  std::vector<CatalogEntry> entries;
  const Json answer = connection_->ask({{"do", "objects"}});
  for (const Json& object : answer.at("objects")) {
    entries.push_back({object.value("name", ""), object.value("symmetric", false),
                       object.value("held_out", false), object.value("recorded", false)});
  }
  return entries;
}

std::uint64_t LabClient::place(const std::string& object, Angle yaw, double x_mm, double y_mm, bool by_hand) {
  return connection_
      ->ask({{"do", "place"},
             {"object", object},
             {"yaw_deg", yaw.degrees()},
             {"x_mm", x_mm},
             {"y_mm", y_mm},
             {"hand", by_hand}})
      .value("id", std::uint64_t{0});
}

void LabClient::remove(std::uint64_t id, bool by_hand) {
  connection_->ask({{"do", "remove"}, {"id", id}, {"hand", by_hand}});
}
void LabClient::clear() {
  connection_->ask({{"do", "clear"}});
}
void LabClient::hand(bool in) {
  connection_->ask({{"do", "hand"}, {"in", in}});
}
void LabClient::set_lamp_level(double level) {
  connection_->ask({{"do", "lamp"}, {"level", level}});
}

void LabClient::set_camera_faults(const CameraFaults& faults) {
  connection_->ask({{"do", "camera_faults"},
                    {"stalled", faults.stalled},
                    {"lost", faults.lost},
                    {"extra_noise", faults.extra_noise},
                    {"damaged_fraction", faults.damaged_fraction}});
}

Truth LabClient::truth() {
  const Json answer = connection_->ask({{"do", "truth"}});
  Truth truth;
  truth.time = TimePoint(
      std::chrono::duration_cast<Duration>(std::chrono::duration<double>(answer.value("time_s", 0.0))));
  truth.table = degrees(answer.value("table_deg", 0.0));
  truth.arm_azimuth = degrees(answer.value("arm_azimuth_deg", 0.0));
  truth.arm_elevation = degrees(answer.value("arm_elevation_deg", 0.0));
  truth.lamp_level = answer.value("lamp_level", 1.0);
  truth.moving = answer.value("moving", false);
  truth.hand_in_view = answer.value("hand_in_view", false);
  for (const Json& object : answer.at("objects")) {
    truth.objects.push_back({object.value("id", std::uint64_t{0}), object.value("name", ""),
                             degrees(object.value("angle_deg", 0.0)), degrees(object.value("yaw_deg", 0.0)),
                             object.value("x_mm", 0.0), object.value("y_mm", 0.0),
                             object.value("symmetric", false), object.value("held_out", false),
                             object.value("carried", false)});
  }
  return truth;
}

std::string LabClient::request(const std::string& line) {
  const std::string text = connection_->exchange(line);
  const Json answer = Json::parse(text, nullptr, false);
  if (answer.is_discarded() || !answer.value("ok", false)) {
    connection_->fail(answer.is_object() ? answer.value("error", text) : text);
  }
  return text;
}

}  // namespace eigenpose::sim
