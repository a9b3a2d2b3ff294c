// Observers and the viewer: killed, flooded, many.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <memory>

#include "tools/cli/common/find_config.hpp"
#include "tools/evaluation/faults/fault_session.hpp"

namespace tools {

namespace {

constexpr int kObservers = 200;
constexpr int kKilledObservers = 5;
constexpr double kReads_s = 0.4;
constexpr double kObserverEnd_s = 10.0;
constexpr double kViewerStart_s = 15.0;
constexpr double kFlood_s = 2.0;
constexpr int kVisitors = 64;

void kill_observers(FaultSession& cell) {
  for (int i = 0; i < kKilledObservers; ++i) {
    const pid_t observer = cell.start_tool({"echo", "haptic0.telemetry", "--json", "--session", cell.name()});
    if (observer == 0) return;
    cell.follow(kReads_s);
    cell.signal(observer, SIGKILL);
    if (!cell.follow_until(kObserverEnd_s, [&] { return cell.tool_end().has_value(); }))
      return cell.fail("an observer stayed");
  }
}

void observe_by_many(FaultSession& cell) {
  using Ticks = rtbus::Subscription<rtbus::Telemetry>;
  std::vector<std::unique_ptr<Ticks>> all;
  for (int i = 0; i < kObservers; ++i) {
    all.push_back(std::make_unique<Ticks>(cell.session(), "haptic0.telemetry", rtbus::ReaderOptions{.presence = true}));
  }
  std::vector<std::uint64_t> seen(all.size(), 0);
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(2e9);
  (void)cell.follow_until(kObserverEnd_s, [&] {
    rtbus::Stamped<rtbus::Telemetry> tick;
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i]->maintain();
      if (all[i]->read_latest(tick) == rtbus::ReadStatus::kFresh) ++seen[i];
    }
    return rtbus::monotonic_ns() > end_ns;
  });
  for (const std::uint64_t samples : seen) {
    if (samples == 0) return cell.fail("an observer saw nothing");
  }
}

std::string viewer() { return folder_of_this_program() + "/rtbus_view"; }

std::string why_no_viewer() {
  std::error_code none;
  return std::filesystem::exists(viewer(), none) ? "" : viewer() + " is not built";
}

/// @returns a connection to the viewer; −1: nobody listens.
int visit(std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (fd >= 0 && ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 &&
      errno != EINPROGRESS) {
    ::close(fd);
    return -1;
  }
  return fd;
}

std::uint16_t port_of(const FaultSession& cell) {
  return static_cast<std::uint16_t>(20000 + (::getpid() * 7 + static_cast<int>(cell.name().size())) % 20000);
}

/// @returns the viewer; 0: it did not come.
pid_t start_viewer(FaultSession& cell) {
  const std::uint16_t port = port_of(cell);
  const pid_t pid = cell.start_tool({viewer(), "view", "--session", cell.name(), "--port", std::to_string(port)}, true);
  if (pid == 0) return 0;
  const auto listens = [&] {
    const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const bool taken = ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ::close(fd);
    return taken || cell.tool_end().has_value();
  };
  if (!cell.follow_until(kViewerStart_s, listens) || cell.tool_end()) {
    std::string words = "the viewer did not start";
    if (cell.tool_end()) {
      for (const std::string& line : cell.tool_end()->last_words) words += "\n  " + line;
    }
    cell.fail(words);
    return 0;
  }
  cell.mark_fault();
  return pid;
}

void kill_viewer(FaultSession& cell) {
  const pid_t pid = start_viewer(cell);
  if (pid == 0) return;
  cell.follow(FaultSession::kHold_s);
  cell.signal(pid, SIGKILL);
}

/// Connections that send what is no request as fast as it is taken, and read nothing.
void flood_viewer(FaultSession& cell) {
  const pid_t pid = start_viewer(cell);
  if (pid == 0) return;
  const std::string noise(16384, '\xa5');
  std::vector<int> visitors(kVisitors, -1);
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(kFlood_s * 1e9);
  (void)cell.follow_until(2.0 * kFlood_s, [&] {
    for (int& fd : visitors) {
      if (fd < 0) fd = visit(port_of(cell));
      if (fd < 0) continue;
      if (::send(fd, noise.data(), noise.size(), MSG_NOSIGNAL | MSG_DONTWAIT) < 0 && errno != EAGAIN) {
        ::close(fd);
        fd = -1;
      }
    }
    return rtbus::monotonic_ns() > end_ns;
  });
  for (const int fd : visitors) {
    if (fd >= 0) ::close(fd);
  }
  if (cell.tool_end()) cell.fail("the viewer " + cell.tool_end()->how());
  cell.signal(pid, SIGTERM);
}

}  // namespace

std::vector<FaultRow> observer_faults() {
  std::vector<FaultRow> out;
  out.push_back({.name = "observer_killed",
                 .what = "SIGKILL to five observers in mid-read, one after the other",
                 .feels = Feels::kNothing,
                 .happen = &kill_observers});
  out.push_back({.name = "observers_200",
                 .what = "two hundred observers of the telemetry at once",
                 .feels = Feels::kNothing,
                 .alone = true,
                 .happen = &observe_by_many});
  out.push_back({.name = "viewer_killed",
                 .what = "SIGKILL to `rtbus view`",
                 .feels = Feels::kNothing,
                 .why_not = &why_no_viewer,
                 .happen = &kill_viewer});
  out.push_back({.name = "viewer_flooded",
                 .what = "64 connections send nonsense to `rtbus view` and read nothing",
                 .feels = Feels::kNothing,
                 .alone = true,
                 .why_not = &why_no_viewer,
                 .happen = &flood_viewer});
  return out;
}

}  // namespace tools
