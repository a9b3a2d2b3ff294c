// net_relay: a network between two interfaces of this namespace, as bad as asked for. It takes whole Ethernet frames
// from one (AF_PACKET), keeps them for a while, and gives them to the other. Neither end knows. Needs no netem, and no
// root in a user namespace of its own. tools/network/two_machines sets everything up around it.
#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <optional>
#include <queue>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/command_line/command_line.hpp"
#include "rtbus/histogram.hpp"
#include "rtbus/realtime.hpp"

namespace {

constexpr std::size_t kLongestFrame = 65536 + 64;  // with segmentation left to the hardware that a veth has not got
/// What PACKET_VNET_HDR puts before a frame: struct virtio_net_hdr, whose header file is none for C++.
constexpr std::size_t kVnetHead_bytes = 10;
constexpr std::size_t kMostFrames = 65536;  // under way in one direction: a flood is cut off there

struct Options {
  std::string here, there;
  double round_trip_ms = 0.0;
  double jitter = 0.0;       ///< Share of the delay of each way, to both sides of it.
  double there_share = 0.5;  ///< Of the round trip, on the way from here to there.
  double loss = 0.0;
  double burst = 1.0;  ///< Mean number of frames lost in a row.
  bool in_order = false;
  std::uint64_t seed = 1;
  std::string report, control;
};

std::atomic<bool> ended{false};
void on_signal(int) { ended.store(true); }

using Frame = std::vector<std::uint8_t>;

/// One way.
class Way {
 public:
  Way(int from, int to, const Options& options, double delay_s, std::uint64_t seed)
      : from_(from), to_(to), options_(options), delay_s_(delay_s), random_(seed) {}

  /// Takes what has come. @param cut Nothing passes.
  void take(bool cut) {
    std::array<std::uint8_t, kLongestFrame> buffer;
    for (int i = 0; i < 256; ++i) {
      const ssize_t got = ::recv(from_, buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (got <= static_cast<ssize_t>(kVnetHead_bytes + sizeof(ethhdr))) return;
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      const bool ip = is_ip(buffer.data());
      // Address resolution is delayed and cut, and not lost: its repeats come once a second.
      const bool lost = cut || (ip && loses());
      const double share = std::uniform_real_distribution<double>(-1.0, 1.0)(random_);
      if (ip) ++frames_;
      if (lost || waiting_.size() >= kMostFrames) {
        if (ip) ++(cut ? cut_ : lost_);
        continue;
      }
      std::uint64_t due_ns = now_ns + rtbus::ns_of(delay_s_ * (1.0 + options_.jitter * share));
      if (options_.in_order) due_ns = std::max(due_ns, last_due_ns_);
      last_due_ns_ = due_ns;
      waiting_.push({due_ns, now_ns, ++number_, ip, {buffer.begin(), buffer.begin() + got}});
    }
  }

  /// Gives out what is due. @returns when the next is; UINT64_MAX: nothing waits.
  std::uint64_t give() {
    while (!waiting_.empty()) {
      const Held& next = waiting_.top();
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      if (next.due_ns > now_ns) return next.due_ns;
      (void)::send(to_, next.frame.data(), next.frame.size(), MSG_DONTWAIT);
      if (next.ip) {
        const double delay_s = rtbus::seconds_between(next.came_ns, now_ns);
        ++given_;
        sum_s_ += delay_s;
        square_sum_s2_ += delay_s * delay_s;
        delay_ns_.record(now_ns - next.came_ns);
        late_ns_.record(now_ns - next.due_ns);
        if (next.number < newest_) ++reordered_;
        newest_ = std::max(newest_, next.number);
      }
      waiting_.pop();
    }
    return UINT64_MAX;
  }

  [[nodiscard]] double mean_s() const { return given_ == 0 ? 0.0 : sum_s_ / static_cast<double>(given_); }
  [[nodiscard]] double deviation_s() const {
    if (given_ == 0) return 0.0;
    const double mean = mean_s();
    return std::sqrt(std::max(0.0, square_sum_s2_ / static_cast<double>(given_) - mean * mean));
  }
  [[nodiscard]] double loss() const {
    const std::uint64_t uncut = frames_ - cut_;
    return uncut == 0 ? 0.0 : static_cast<double>(lost_) / static_cast<double>(uncut);
  }
  void report(std::ostream& out) const {
    out << "{\"frames\": " << frames_ << ", \"lost\": " << lost_ << ", \"cut\": " << cut_ << ", \"loss\": " << loss()
        << ", \"reordered\": " << reordered_ << ", \"delay_mean_ms\": " << 1e3 * mean_s()
        << ", \"delay_deviation_ms\": " << 1e3 * deviation_s()
        << ", \"delay_p50_ms\": " << 1e-6 * static_cast<double>(delay_ns_.percentile(0.5))
        << ", \"delay_p99_ms\": " << 1e-6 * static_cast<double>(delay_ns_.percentile(0.99))
        << ", \"late_p50_us\": " << 1e-3 * static_cast<double>(late_ns_.percentile(0.5))
        << ", \"late_p99_us\": " << 1e-3 * static_cast<double>(late_ns_.percentile(0.99)) << "}";
  }

 private:
  struct Held {
    std::uint64_t due_ns, came_ns, number;
    bool ip;
    Frame frame;
    bool operator<(const Held& other) const {
      return due_ns != other.due_ns ? due_ns > other.due_ns : number > other.number;
    }
  };
  static bool is_ip(const std::uint8_t* packet) {
    ethhdr head;
    std::memcpy(&head, packet + kVnetHead_bytes, sizeof head);
    return ntohs(head.h_proto) == ETH_P_IP;
  }
  /// Gilbert and Elliott: all is lost while it is bad; independent with bursts of one frame.
  bool loses() {
    const double draw = std::uniform_real_distribution<double>(0.0, 1.0)(random_);
    if (options_.burst <= 1.0) return draw < options_.loss;
    const double leave = 1.0 / options_.burst;
    bad_ = bad_ ? draw >= leave : draw < options_.loss * leave / (1.0 - options_.loss);
    return bad_;
  }

  int from_, to_;
  const Options& options_;
  double delay_s_;
  std::mt19937_64 random_;
  bool bad_ = false;
  std::priority_queue<Held> waiting_;
  std::uint64_t number_ = 0, newest_ = 0, last_due_ns_ = 0;
  std::uint64_t frames_ = 0, lost_ = 0, cut_ = 0, given_ = 0, reordered_ = 0;
  double sum_s_ = 0.0, square_sum_s2_ = 0.0;
  rtbus::Histogram delay_ns_, late_ns_;
};

/// Frames of an interface as the kernel has them: with the note that a checksum is still to be computed.
std::optional<int> open_interface(const std::string& name) {
  const int fd = ::socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, htons(ETH_P_ALL));
  const int on = 1, buffer = 8 << 20;
  sockaddr_ll address{};
  address.sll_family = AF_PACKET;
  address.sll_protocol = htons(ETH_P_ALL);
  address.sll_ifindex = static_cast<int>(::if_nametoindex(name.c_str()));
  packet_mreq all{};
  all.mr_ifindex = address.sll_ifindex;
  all.mr_type = PACKET_MR_PROMISC;
  if (fd < 0 || address.sll_ifindex == 0 || ::setsockopt(fd, SOL_PACKET, PACKET_VNET_HDR, &on, sizeof on) != 0 ||
      ::setsockopt(fd, SOL_PACKET, PACKET_IGNORE_OUTGOING, &on, sizeof on) != 0 ||
      ::setsockopt(fd, SOL_PACKET, PACKET_ADD_MEMBERSHIP, &all, sizeof all) != 0 ||
      ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    std::fprintf(stderr, "net_relay: interface %s: %s; tools/network/two_machines makes the interfaces\n", name.c_str(),
                 std::strerror(errno));
    return std::nullopt;
  }
  (void)::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer);
  return fd;
}

class Relay {
 public:
  Relay(Options options, int here, int there)
      : options_(std::move(options)),
        fds_{pollfd{here, POLLIN, 0}, pollfd{there, POLLIN, 0}, pollfd{-1, POLLIN, 0}},
        forth_(here, there, options_, 1e-3 * options_.round_trip_ms * options_.there_share, options_.seed),
        back_(there, here, options_, 1e-3 * options_.round_trip_ms * (1.0 - options_.there_share),
              options_.seed ^ 0x9e3779b97f4a7c15ULL) {}

  bool open_control() {
    if (options_.control.empty()) return true;
    fds_[2].fd = ::open(options_.control.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (fds_[2].fd >= 0) return true;
    std::fprintf(stderr, "net_relay: --control %s: %s; make it with mkfifo\n", options_.control.c_str(),
                 std::strerror(errno));
    return false;
  }

  void serve() {
    while (!ended.load()) {
      const std::uint64_t next_ns = std::min(forth_.give(), back_.give());
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      const std::uint64_t wait_ns = next_ns <= now_ns ? 0 : std::min(next_ns - now_ns, 50 * rtbus::kNsPerMs);
      const timespec wait{static_cast<time_t>(wait_ns / rtbus::kNsPerS), static_cast<long>(wait_ns % rtbus::kNsPerS)};
      if (::ppoll(fds_.data(), fds_.size(), &wait, nullptr) < 0) continue;
      if (fds_[0].revents != 0) forth_.take(cut_);
      if (fds_[1].revents != 0) back_.take(cut_);
      if (fds_[2].revents != 0) obey();
    }
  }

  /// The link as it was.
  bool report() const {
    std::ostringstream text;
    text << "{\"schema\": \"rtbus-net-relay/1\", \"seed\": " << options_.seed
         << ", \"round_trip_ms\": " << 1e3 * (forth_.mean_s() + back_.mean_s())
         << ", \"jitter_ms\": " << 1e3 * std::hypot(forth_.deviation_s(), back_.deviation_s()) << ",\n \"forth\": ";
    forth_.report(text);
    text << ",\n \"back\": ";
    back_.report(text);
    text << "}\n";
    if (options_.report.empty()) return true;
    const std::string draft = options_.report + ".new";  // who reads it while it is written reads the one before
    std::ofstream out(draft);
    out << text.str();
    out.close();
    if (out && std::rename(draft.c_str(), options_.report.c_str()) == 0) return true;
    std::fprintf(stderr, "net_relay: cannot write %s\n", options_.report.c_str());
    return false;
  }

 private:
  /// "cut", "restore", "loss 0.1", "report": a line each.
  void obey() {
    char buffer[512];
    const ssize_t got = ::read(fds_[2].fd, buffer, sizeof buffer);
    std::istringstream lines(std::string(buffer, got > 0 ? static_cast<std::size_t>(got) : 0));
    for (std::string line; std::getline(lines, line);) {
      double value = 0.0;
      if (line == "cut" || line == "restore") {
        cut_ = line == "cut";
      } else if (line == "report") {
        (void)report();
      } else if (std::sscanf(line.c_str(), "loss %lf", &value) == 1 && value >= 0.0 && value < 1.0) {
        options_.loss = value;
      } else {
        std::fprintf(stderr, "net_relay: '%s' is no order; there are cut, restore, loss SHARE and report\n",
                     line.c_str());
      }
    }
  }

  Options options_;
  std::array<pollfd, 3> fds_;
  bool cut_ = false;
  Way forth_, back_;
};

}  // namespace

int main(int argc, char** argv) {
  rtbus::CommandLine line("net_relay", "A network between two interfaces, with delay, jitter, loss and reordering.");
  rtbus::Command root = line.root();
  Options options;
  root.option("HERE", options.here, "Interface of this namespace").required();
  root.option("THERE", options.there, "Another one").required();
  root.option("--round-trip-ms", options.round_trip_ms, "Delay of both ways together").range(0.0, 10000.0);
  root.option("--jitter", options.jitter, "Each frame's delay varies by this share, to both sides").range(0.0, 1.0);
  root.option("--there-share", options.there_share, "Share of the round trip that the way from HERE to THERE has")
      .range(0.0, 1.0);
  root.option("--loss", options.loss, "Share of frames that never come").range(0.0, 0.99);
  root.option("--burst", options.burst, "Mean number of frames lost in a row").range(1.0, 1000.0);
  root.flag("--in-order", options.in_order, "No frame overtakes another");
  root.option("--seed", options.seed, "Of what is drawn").show_default();
  root.option("--report", options.report, "Write the link as it was into this file (JSON) at the end");
  root.option("--control", options.control, "Named pipe for orders: cut, restore, loss SHARE, report");
  if (const std::optional<int> status = line.parse(argc, argv)) return *status;

  const std::optional<int> here = open_interface(options.here);
  const std::optional<int> there = here ? open_interface(options.there) : std::nullopt;
  if (!here || !there) return 1;
  struct sigaction action {};
  action.sa_handler = on_signal;
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) ::sigaction(number, &action, nullptr);
  (void)rtbus::prefer_on_time();
  const auto relay = std::make_unique<Relay>(std::move(options), *here, *there);
  if (!relay->open_control()) return 1;
  std::puts("net_relay: ready");  // who started it waits for this
  std::fflush(stdout);
  relay->serve();
  return relay->report() ? 0 : 1;
}
