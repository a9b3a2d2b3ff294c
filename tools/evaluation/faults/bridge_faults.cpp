// The bridge to ROS 2, as a part of the session: killed, and flooded with what is no DDS.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include "tools/cli/common/find_config.hpp"
#include "tools/evaluation/faults/fault_session.hpp"
#include "tools/evaluation/soak/process_watch.hpp"
#include "tools/harness/random.hpp"

namespace tools {

namespace {

constexpr double kBridgeStart_s = 15.0;
constexpr double kBridgeSpeaks_s = 0.5;
constexpr double kBridgeFlood_s = 2.0;
constexpr int kDatagramsPerLook = 200;  ///< 40 000 a second, as fast as the loopback takes them at most.
// DDS: a domain has its ports, RTPS 2.2, 9.6.1.1.
constexpr int kFirstPortOfDds = 7400, kPortsOfDomain = 250;
constexpr const char* kBridgeProgram = "rtbus_bridge";
const std::string kRtpsHeader("RTPS\x02\x01", 6);

std::string why_no_bridge() {
  const std::string program = folder_of_this_program() + "/" + kBridgeProgram;
  return ::access(program.c_str(), X_OK) == 0 ? "" : program + " is not built";
}

/// Of this cell alone, so that two bridges beside each other do not meet.
int domain_of(const FaultSession& cell) {
  const std::size_t number = std::hash<std::string>()(cell.name());
  return 1 + static_cast<int>(number % 200);
}

void add_bridge(RunCommand& command, const FaultSession& cell) {
  // With an order that it takes, so that it listens, too.
  const std::string domain = std::to_string(domain_of(cell));
  for (const std::string& each : {"bridge.domain=" + domain, std::string("bridge.orders.mark.per_s=5")}) {
    command.arguments.insert(command.arguments.end(), {"--set", each});
  }
}

/// Ports of the domain that somebody is bound to.
std::vector<std::uint16_t> ports_of(int domain) {
  const int first = kFirstPortOfDds + kPortsOfDomain * domain;
  std::vector<std::uint16_t> out;
  std::ifstream file("/proc/net/udp");
  std::string line;
  std::getline(file, line);  // what the columns are
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string number, local;
    fields >> number >> local;
    const std::size_t colon = local.find(':');
    if (colon == std::string::npos) continue;
    const int port = std::stoi(local.substr(colon + 1), nullptr, 16);
    if (port >= first && port < first + kPortsOfDomain) out.push_back(static_cast<std::uint16_t>(port));
  }
  return out;
}

/// The fault begins when the bridge is there and speaks. @returns its process; 0: it did not come.
pid_t await_bridge(FaultSession& cell) {
  pid_t pid = 0;
  const bool there = cell.follow_until(kBridgeStart_s, [&] {
    const auto uses = uses_below(cell.supervisor());
    const auto found = uses.find(kBridgeProgram);
    pid = found == uses.end() ? 0 : found->second.pid;
    return pid != 0 && !ports_of(domain_of(cell)).empty();
  });
  if (!there) {
    cell.fail("the bridge did not come");
    return 0;
  }
  cell.follow(kBridgeSpeaks_s);
  cell.mark_fault();
  return pid;
}

void kill_bridge(FaultSession& cell) {
  const pid_t pid = await_bridge(cell);
  if (pid == 0) return;
  cell.signal(pid, SIGKILL);
  const bool again = cell.follow_until(kBridgeStart_s, [&] {
    const auto uses = uses_below(cell.supervisor());
    const auto found = uses.find(kBridgeProgram);
    return found != uses.end() && found->second.pid != pid;
  });
  if (!again) cell.fail("the bridge was not started again");
}

/// Half of it is noise, half noise behind a header of RTPS.
void flood_bridge(FaultSession& cell) {
  const pid_t pid = await_bridge(cell);
  if (pid == 0) return;
  const std::vector<std::uint16_t> ports = ports_of(domain_of(cell));
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return cell.fail("no socket");
  Random random(1);
  std::string datagram(1400, '\0');
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(kBridgeFlood_s * 1e9);
  std::uint64_t sent = 0;
  (void)cell.follow_until(2.0 * kBridgeFlood_s, [&] {
    for (char& each : datagram) each = static_cast<char>(random.next());
    for (int i = 0; i < kDatagramsPerLook; ++i) {
      datagram[20 + random.next() % (datagram.size() - 20)] = static_cast<char>(random.next());
      datagram.replace(0, kRtpsHeader.size(), i % 2 != 0 ? kRtpsHeader : std::string(kRtpsHeader.size(), '\xa5'));
      sockaddr_in to{};
      to.sin_family = AF_INET;
      to.sin_port = htons(ports[random.next() % ports.size()]);
      to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      const std::size_t size = 20 + random.next() % (datagram.size() - 20);
      if (::sendto(fd, datagram.data(), size, MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&to), sizeof to) > 0) {
        ++sent;
      }
    }
    return rtbus::monotonic_ns() > end_ns;
  });
  ::close(fd);
  if (sent < 1000) cell.fail("the bridge was sent " + std::to_string(sent) + " datagrams only");
  const auto uses = uses_below(cell.supervisor());
  const auto found = uses.find(kBridgeProgram);
  if (found == uses.end() || found->second.pid != pid) cell.fail("the bridge did not live through the flood");
}

}  // namespace

std::vector<FaultRow> bridge_faults() {
  std::vector<FaultRow> out;
  out.push_back({.name = "bridge_killed",
                 .what = "SIGKILL to the bridge to ROS 2",
                 .feels = Feels::kNothing,
                 .restarts_least = 1,
                 .restarts_most = 1,
                 .why_not = &why_no_bridge,
                 .prepare = &add_bridge,
                 .happen = &kill_bridge});
  out.push_back({.name = "bridge_flooded",
                 .what = "the bridge to ROS 2 gets nonsense by UDP, half of it with the header of RTPS",
                 .feels = Feels::kNothing,
                 .alone = true,
                 .why_not = &why_no_bridge,
                 .prepare = &add_bridge,
                 .happen = &flood_bridge});
  return out;
}

}  // namespace tools
