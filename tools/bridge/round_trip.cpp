// The program behind `rtbus bench bridge`: messages to and fro over DDS and over plain UDP, and what a running bridge
// costs. Prints one JSON document.
#include <arpa/inet.h>
#include <dds/dds.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include <ros2_messages.h>
#include "rtbus/clock.hpp"
#include "tools/bridge/messages.hpp"
#include "tools/bridge/participant.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/host/ask_kernel.hpp"

namespace {

using bridge::PoseStamped;

constexpr std::uint16_t kUdpPort = 47125;
constexpr std::uint64_t kPatience_ns = 50 * rtbus::kNsPerMs;
constexpr std::uint64_t kPeriod_ns = rtbus::kNsPerMs;
/// Bytes of a PoseStamped with this frame, encapsulation included.
constexpr std::size_t kUdpBytes = 84;
const std::string kFrame = "world";

struct Options {
  std::string network = "lo", peer;
  double seconds = 5.0;
  int pid = 0;
};

/// Sleeps until the reader has something.
class Waiter {
 public:
  Waiter(const bridge::Participant& participant, const bridge::DdsReader& reader)
      : set_(dds_create_waitset(participant.entity())) {
    dds_waitset_attach(set_, dds_create_readcondition(reader.entity(), DDS_ANY_STATE), 0);
  }
  bool wait(std::uint64_t patience_ns) {
    return dds_waitset_wait(set_, nullptr, 0, static_cast<dds_duration_t>(patience_ns)) > 0;
  }

 private:
  dds_entity_t set_;
};

struct Ends {
  bridge::Participant participant;
  bridge::DdsWriter writer;
  bridge::DdsReader reader;
};

rtbus::Result<Ends, std::string> open_ends(const std::string& network, const char* to, const char* from) {
  auto participant = bridge::Participant::open(0, network);
  if (!participant) return rtbus::Failure{participant.error()};
  auto writer = participant->writer(to, bridge::kPoseStamped, {.reliable = false});
  auto reader = participant->reader(from, bridge::kPoseStamped, false);
  if (!writer) return rtbus::Failure{writer.error()};
  if (!reader) return rtbus::Failure{reader.error()};
  return Ends{std::move(*participant), *writer, *reader};
}

class Udp {
 public:
  Udp() : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    const timeval patience{0, static_cast<suseconds_t>(kPatience_ns / rtbus::kNsPerUs)};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  ~Udp() { ::close(socket_); }
  Udp(const Udp&) = delete;
  Udp& operator=(const Udp&) = delete;
  bool listen() const {
    const sockaddr_in any = address("0.0.0.0");
    return ::bind(socket_, reinterpret_cast<const sockaddr*>(&any), sizeof any) == 0;
  }
  /// Sends back one datagram if one comes in time.
  void echo() const {
    std::array<std::uint8_t, 2048> bytes{};
    sockaddr_in from{};
    socklen_t length = sizeof from;
    const ssize_t got = ::recvfrom(socket_, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&from), &length);
    if (got > 0) {
      ::sendto(socket_, bytes.data(), static_cast<std::size_t>(got), 0, reinterpret_cast<const sockaddr*>(&from),
               length);
    }
  }
  bool ping(const std::string& peer, std::uint32_t number) const {
    std::array<std::uint8_t, kUdpBytes> bytes{};
    std::memcpy(bytes.data(), &number, sizeof number);
    const sockaddr_in to = address(peer);
    ::sendto(socket_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    std::uint32_t answered = number + 1;
    while (answered != number) {
      if (::recv(socket_, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) return false;
      std::memcpy(&answered, bytes.data(), sizeof answered);
    }
    return true;
  }

 private:
  static sockaddr_in address(const std::string& host) {
    sockaddr_in out{};
    out.sin_family = AF_INET;
    out.sin_port = htons(kUdpPort);
    ::inet_pton(AF_INET, host.c_str(), &out.sin_addr);
    return out;
  }
  int socket_;
};

int failed(const std::string& why) {
  std::fprintf(stderr, "dds_round_trip: %s\n", why.c_str());
  return tools::kExitFailed;
}

int echo(const Options& options) {
  auto ends = open_ends(options.network, "/pong", "/ping");
  if (!ends) return failed(ends.error());
  Udp udp;
  if (!udp.listen()) return failed("UDP port " + std::to_string(kUdpPort) + " is taken");
  std::thread datagrams([&] {
    while (!tools::interrupted()) udp.echo();
  });
  Waiter waiter(ends->participant, ends->reader);
  while (!tools::interrupted()) {
    if (!waiter.wait(kPatience_ns)) continue;
    ends->reader.drain<PoseStamped>([&](const PoseStamped& message, std::uint64_t) { ends->writer.write(&message); });
  }
  datagrams.join();
  return tools::kExitFine;
}

bool ping_dds(Ends& ends, Waiter& waiter, std::uint32_t number) {
  const PoseStamped message = bridge::pose_of(bridge::header_of({0, number}, kFrame), {1, 2, 3}, {1, 0, 0, 0});
  const std::uint64_t end_ns = rtbus::monotonic_ns() + kPatience_ns;
  ends.writer.write(&message);
  bool answered = false;
  while (!answered) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (now_ns >= end_ns || !waiter.wait(end_ns - now_ns)) return false;
    ends.reader.drain<PoseStamped>(
        [&](const PoseStamped& back, std::uint64_t) { answered = answered || back.header.stamp.nanosec == number; });
  }
  return true;
}

nlohmann::json figures(std::vector<double> half_us, std::uint64_t lost) {
  std::sort(half_us.begin(), half_us.end());
  const auto at = [&](double share) {
    return half_us.empty() ? 0.0 : half_us[static_cast<std::size_t>(share * static_cast<double>(half_us.size() - 1))];
  };
  return {{"answers", half_us.size()}, {"lost", lost}, {"p50_us", at(0.5)}, {"p99_us", at(0.99)}, {"max_us", at(1.0)}};
}

/// A message a millisecond, by turns over DDS and over UDP, so that both meet the same machine.
int ping(const Options& options) {
  auto ends = open_ends(options.network, "/ping", "/pong");
  if (!ends) return failed(ends.error());
  Waiter waiter(ends->participant, ends->reader);
  const Udp udp;
  std::uint32_t number = 0;
  const std::uint64_t patience_end_ns = rtbus::monotonic_ns() + 20 * rtbus::kNsPerS;
  while (!ping_dds(*ends, waiter, ++number)) {
    if (rtbus::monotonic_ns() > patience_end_ns || tools::interrupted()) return failed("the other end was not found");
  }
  std::vector<double> dds_us, udp_us;
  std::uint64_t dds_lost = 0, udp_lost = 0;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + rtbus::ns_of(options.seconds);
  for (std::uint64_t due_ns = rtbus::monotonic_ns(); due_ns < end_ns && !tools::interrupted();) {
    rtbus::sleep_until(due_ns);
    const std::uint64_t began_ns = rtbus::monotonic_ns();
    const bool over_dds = ++number % 2 == 0;
    const bool answered = over_dds ? ping_dds(*ends, waiter, number) : udp.ping(options.peer, number);
    const double half_us = static_cast<double>(rtbus::monotonic_ns() - began_ns) / 2e3;
    if (answered) (over_dds ? dds_us : udp_us).push_back(half_us);
    if (!answered) ++(over_dds ? dds_lost : udp_lost);
    due_ns = std::max(due_ns + kPeriod_ns, rtbus::monotonic_ns());
  }
  const nlohmann::json out{{"dds", figures(std::move(dds_us), dds_lost)},
                           {"udp", figures(std::move(udp_us), udp_lost)}};
  std::printf("%s\n", out.dump().c_str());
  return tools::kExitFine;
}

/// Receives what a bridge sends, and asks what its process used meanwhile.
int listen(const Options& options) {
  auto participant = bridge::Participant::open(0, options.network);
  if (!participant) return failed(participant.error());
  auto poses = participant->reader("/haptic0/pose", bridge::kPoseStamped, true);
  auto frames = participant->reader("/tf", bridge::kTfMessage, true);
  if (!poses || !frames) return failed("no reader");
  std::uint64_t pose_count = 0, frame_count = 0, transform_count = 0;
  const auto take = [&] {
    poses->drain<PoseStamped>([&](const PoseStamped&, std::uint64_t) { ++pose_count; });
    frames->drain<tf2_msgs_msg_dds__TFMessage_>([&](const tf2_msgs_msg_dds__TFMessage_& message, std::uint64_t) {
      ++frame_count;
      transform_count += message.transforms._length;
    });
  };
  const auto until = [&](std::uint64_t end_ns, const auto& done) {
    while (rtbus::monotonic_ns() < end_ns && !done() && !tools::interrupted()) {
      take();
      rtbus::sleep_until(rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs);
    }
  };
  until(rtbus::monotonic_ns() + 20 * rtbus::kNsPerS, [&] { return pose_count > 0 && frame_count > 0; });
  if (pose_count == 0 || frame_count == 0) return failed("nothing comes from the bridge");
  pose_count = frame_count = transform_count = 0;
  const auto before = tools::ask_process(options.pid);
  const std::uint64_t began_ns = rtbus::monotonic_ns();
  until(began_ns + rtbus::ns_of(options.seconds), [] { return false; });
  const auto after = tools::ask_process(options.pid);
  const double took_s = rtbus::seconds_between(began_ns, rtbus::monotonic_ns());
  if (!before || !after) return failed("the bridge has ended");
  const nlohmann::json out{{"poses_hz", static_cast<double>(pose_count) / took_s},
                           {"frames_hz", static_cast<double>(frame_count) / took_s},
                           {"transforms_hz", static_cast<double>(transform_count) / took_s},
                           {"cpu_share", (after->cpu_s - before->cpu_s) / took_s},
                           {"threads", after->threads},
                           {"rss_mib", static_cast<double>(after->rss_bytes) / (1024.0 * 1024.0)}};
  std::printf("%s\n", out.dump().c_str());
  return tools::kExitFine;
}

template <int (*run)(const Options&)>
tools::Action add(rtbus::Command command) {
  const auto options = std::make_shared<Options>();
  command.option("--network", options->network, "Interface");
  command.option("--peer", options->peer, "Of ping: numeric address of the other end");
  command.option("--seconds", options->seconds, "How long").range(0.1, 3600.0);
  command.option("--pid", options->pid, "Of listen: the bridge's process");
  return [options] { return run(*options); };
}

constexpr tools::CommandEntry kCommands[] = {{"echo", "Send back what comes", &add<&echo>},
                                             {"ping", "Half a round trip, DDS and UDP by turns", &add<&ping>},
                                             {"listen", "Receive what a bridge sends", &add<&listen>}};

}  // namespace

int main(int argc, char** argv) { return tools::run_commands(kCommands, "", argc, argv); }
