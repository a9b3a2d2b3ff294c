// stranger: a peer that should be refused, or that only makes noise. For the tests of the link.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/command_line/command_line.hpp"
#include "tools/link/packet.hpp"
#include "tools/link/wire.hpp"

namespace {

constexpr std::uint64_t kLife = 0x5742a36e6a1dull;

/// Datagrams of noise to the ports of DDS (RTPS 9.6.1.1) at `address`.
void send_noise(const std::string& address, int domain, std::uint64_t duration_ns) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  std::mt19937 random(7);
  std::vector<std::uint8_t> bytes(1400);
  std::uint64_t sent = 0;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + duration_ns;
  while (rtbus::monotonic_ns() < end_ns) {
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    const bool begins_well = sent % 2 == 0;  // the head of RTPS, then noise
    if (begins_well)
      bytes.assign({'R', 'T', 'P', 'S', 2, 1, 1, 16}), bytes.resize(1400, static_cast<std::uint8_t>(random()));
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * domain + 10 + static_cast<int>(sent % 6)));
    inet_pton(AF_INET, address.c_str(), &to.sin_addr);
    (void)::sendto(fd, bytes.data(), 16 + random() % 1384, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    ++sent;
  }
  ::close(fd);
  std::printf("stranger: %llu datagrams\n", static_cast<unsigned long long>(sent));
}

}  // namespace

int main(int argc, char** argv) {
  rtbus::CommandLine line("stranger", "A peer that a link should refuse.");
  rtbus::Command root = line.root();
  std::string own, other, session, hand = "haptic0";
  int domain = 77;
  double seconds = 2.0;
  bool noise = false, flood = false, foreign_version = false, foreign_layout = false, foreign_session = false;
  bool replay = false;
  root.option("--own", own, "Its address").required();
  root.option("--other", other, "The address that it speaks to").required();
  root.option("--session", session, "What it says it belongs to").required();
  root.option("--seconds", seconds, "How long");
  root.flag("--noise", noise, "Datagrams of noise");
  root.flag("--flood", flood, "Packets without a pause instead of one in a millisecond");
  root.flag("--foreign-version", foreign_version, "Of another version");
  root.flag("--foreign-layout", foreign_layout, "With other messages");
  root.flag("--foreign-session", foreign_session, "Of another session");
  root.flag("--replay", replay, "Valid packets of the physics that speaks there, which came before");
  if (const std::optional<int> status = line.parse(argc, argv)) return *status;
  const auto duration_ns = rtbus::ns_of(seconds);
  if (noise) {
    send_noise(other, domain, duration_ns);
    return 0;
  }
  // The physics whose packets it repeats runs on its own machine.
  auto wire = link_dds::Wire::open(domain, own, replay ? std::vector{other, own} : std::vector{other});
  if (!wire) {
    std::fprintf(stderr, "%s\n", wire.error().c_str());
    return 1;
  }
  link_dds::PeerHello hello;
  hello.version = foreign_version ? link_dds::kVersion + 1 : link_dds::kVersion;
  hello.layout = foreign_layout ? 1 : link_dds::layout();
  hello.life = kLife + (foreign_version ? 1 : 0) + (foreign_layout ? 2 : 0) + (foreign_session ? 4 : 0);
  hello.supervisor = hello.life;
  hello.session = foreign_session ? session + "x" : session;
  hello.nodes = {"physics"};
  auto stream = wire->writer("rtbus_link/" + session + "/" + hand + "/answer", false);
  if (!stream) return 1;
  if (replay) {
    hello.nodes.clear();
    hello.life = 0;
    const std::uint64_t patience_ns = rtbus::monotonic_ns() + 20 * rtbus::kNsPerS;
    while (hello.life == 0 && rtbus::monotonic_ns() < patience_ns) {
      wire->hear([&](const link_dds::PeerHello& heard) {
        if (heard.session == session && !heard.leaving && heard.nodes == std::vector<std::string>{"physics"}) {
          hello.life = heard.life;
        }
      });
      rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs);
    }
    if (hello.life == 0) {
      std::fprintf(stderr, "no physics says hello\n");
      return 1;
    }
  }
  // An answer that would be felt: physics that lives, and a proxy 0.1 m beside the hand.
  link_dds::Answer answer;
  answer.beat.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
  answer.beat.pid = 1;
  answer.proxy.emplace().position_m = {0.1, 0.1, 0.1};
  answer.proxy->device_sequence = 1;
  link_dds::Bytes good, bad(700, 0xa5);
  (void)link_dds::pack_answer(answer, good);
  const std::uint64_t end_ns = rtbus::monotonic_ns() + duration_ns;
  std::uint64_t greet_ns = 0, sequence = 1;
  const std::uint64_t began_ns = rtbus::monotonic_ns();
  for (; rtbus::monotonic_ns() < end_ns; ++sequence) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (replay) {
      stream->send({hello.life, 1, now_ns, 0, 0}, good);
      if (!flood) rtbus::sleep_until(now_ns + rtbus::kNsPerMs);
      continue;
    }
    if (now_ns >= greet_ns) {
      wire->greet(hello);
      greet_ns = now_ns + rtbus::kNsPerS / 5;
    }
    stream->send({hello.life, sequence, now_ns, 0, 0}, sequence % 2 == 0 ? good : bad);
    if (!flood) rtbus::sleep_until(now_ns + rtbus::kNsPerMs);
  }
  std::printf("stranger: %.0f packets/s\n",
              static_cast<double>(sequence - 1) / rtbus::seconds_between(began_ns, rtbus::monotonic_ns()));
  return 0;
}
