#include "tools/evaluation/bench/bench_bridge.hpp"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/pacer.hpp"
#include "rtbus/topic.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/run_program.hpp"

namespace tools {

namespace {

using nlohmann::json;

constexpr double kMostCpu = 0.30;           // of a core
constexpr double kLeastPoses_hz = 950.0;    // of 1000
constexpr double kMostOverUdp_us = 200.0;   // distributed systems of this kind add 50 to 200 us each way
constexpr std::uint32_t kBodiesEvery = 10;  // hand samples

/// In a network of its own: the bridge, and who receives from it. Arguments: folder, session file, session, seconds.
constexpr const char* kCostScript = R"sh(set -eu
ip link set lo up
"$1/rtbus_bridge" bridge "$2" --set "session=$3" --set bridge.network=lo \
  --set 'bridge.publish={pose: {rate_hz: 1000}, tf: {rate_hz: 100}}' >/dev/null &
bridge=$!
trap 'kill $bridge; wait $bridge || true' EXIT
"$1/dds_round_trip" listen --network lo --pid $bridge --seconds "$4"
)sh";

/// Two networks joined by a cable. Arguments: folder, seconds. (Cyclone DDS ends its threads by messages to its own
/// address, which take the loopback.)
constexpr const char* kRoundTripScript = R"sh(set -eu
unshare --net sleep infinity &
other=$!
trap 'kill $other ${echo:-} 2>/dev/null; wait || true' EXIT
while [ "$(readlink /proc/$other/ns/net)" = "$(readlink /proc/self/ns/net)" ]; do sleep 0.01; done
ip link add near type veth peer name far netns $other
ip addr add 10.77.0.1/24 dev near
ip link set lo up
ip link set near up
nsenter --target $other --net sh -c 'ip addr add 10.77.0.2/24 dev far; ip link set lo up; ip link set far up'
nsenter --target $other --net "$1/dds_round_trip" echo --network far &
echo=$!
"$1/dds_round_trip" ping --network near --peer 10.77.0.2 --seconds "$2"
)sh";

/// Runs a script of ours in a new network. @returns the JSON document in its last line; none: it failed, and a note
/// says how.
std::optional<json> run_in_network(const char* script, const std::vector<std::string>& arguments,
                                   Experiment& experiment) {
  std::vector<std::string> words;
  if (::geteuid() != 0) words = {"--user", "--map-root-user"};
  words.insert(words.end(), {"--net", "bash", "-c", script, "bash"});
  words.insert(words.end(), arguments.begin(), arguments.end());
  const ProgramOutcome outcome = run_program("unshare", experiment.folder(), words);
  const std::size_t end = outcome.output.find_last_not_of('\n');
  const std::size_t begin = end == std::string::npos ? 0 : outcome.output.rfind('\n', end) + 1;
  json found = json::parse(outcome.output.substr(begin), nullptr, false);
  if (outcome.status == 0 && found.is_object()) return found;
  experiment.note("no figures: " + outcome.complaint());
  return std::nullopt;
}

/// Writes the topics of a hand at 1 kHz and of its bodies at 100 Hz while it lives.
class Feeder {
 public:
  Feeder(const std::string& name, std::size_t bodies) : bodies_(bodies) {
    session_.name = name;
    device_.emplace(make<rtbus::DeviceState>("haptic0.device_state"));
    poses_.emplace(make<rtbus::BodyPoses>("physics.body_poses"));
    thread_ = std::thread([this] { run(); });
  }
  ~Feeder() {
    ends_ = true;
    thread_.join();
  }
  Feeder(const Feeder&) = delete;
  Feeder& operator=(const Feeder&) = delete;

 private:
  template <class T>
  rtbus::Writer<T> make(const std::string& topic) {
    auto made = rtbus::Writer<T>::create(session_, topic);
    if (!made) throw std::runtime_error("topic " + topic + ": " + rtbus::to_string(made.error()));
    return std::move(*made);
  }

  void run() {
    rtbus::Pacer pacer(rtbus::monotonic_ns(), rtbus::kNsPerMs);
    for (std::uint32_t tick = 0; !ends_; ++tick) {
      rtbus::sleep_until(pacer.due_ns());
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      rtbus::DeviceState device;
      device.position_m[0] = 1e-6 * tick;
      device.sample_time_ns = now_ns;
      device_->publish(device, now_ns);
      if (tick % kBodiesEvery == 0) publish_bodies(tick, now_ns);
      (void)pacer.advance(rtbus::monotonic_ns());
    }
  }

  void publish_bodies(std::uint32_t tick, std::uint64_t now_ns) {
    rtbus::BodyPoses sample;
    sample.frame = 1 + tick / kBodiesEvery;
    sample.step_index = tick + 1;
    sample.bodies = static_cast<std::uint32_t>(bodies_);
    for (auto& each : sample.orientation_wxyz) each = {1, 0, 0, 0};
    for (auto& each : sample.position_m) each = {0, 1e-6 * tick, 0};
    for (std::size_t first = 0; first < bodies_; first += rtbus::BodyPoses::kBodies) {
      sample.first_body = static_cast<std::uint32_t>(first);
      sample.count = static_cast<std::uint32_t>(std::min<std::size_t>(rtbus::BodyPoses::kBodies, bodies_ - first));
      for (std::size_t i = sample.count; i < rtbus::BodyPoses::kBodies; ++i) {
        sample.position_m[i] = {};
        sample.orientation_wxyz[i] = {};
      }
      poses_->publish(sample, now_ns);
    }
  }

  rtbus::Session session_;
  std::size_t bodies_;
  std::optional<rtbus::Writer<rtbus::DeviceState>> device_;
  std::optional<rtbus::Writer<rtbus::BodyPoses>> poses_;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

void measure_cost(const BenchBridgeOptions& options, const std::string& folder, Experiment& experiment) {
  const std::size_t bodies = rtbus::config::load_session(options.session_file).scene.bodies.size();
  const std::string session = "benchbridge" + std::to_string(::getpid());
  LoadMeter meter;
  const Feeder feeder(session, bodies);
  const auto found = run_in_network(
      kCostScript,
      {folder, std::filesystem::absolute(options.session_file).string(), session, formatted("%g", options.seconds)},
      experiment);
  if (!found) {
    experiment.check_at_least("cost.ran", "The bridge ran and was heard", 0.0, "", 1.0);
    return;
  }
  const MachineLoad load = meter.read();
  const auto figure = [&](const char* key) { return found->value(key, 0.0); };
  experiment.add_table(
      {"bridge_cost",
       {"poses [1/s]", "/tf messages [1/s]", "transforms [1/s]", "CPU [% of a core]", "threads", "memory [MiB]"},
       {{figure("poses_hz"), figure("frames_hz"), figure("transforms_hz"), 100.0 * figure("cpu_share"),
         figure("threads"), figure("rss_mib")}}});
  experiment.check_at_least("cost.poses", "Poses of the hand that arrive, of 1000 a second", figure("poses_hz"), "1/s",
                            kLeastPoses_hz, load);
  experiment.check_at_most("cost.cpu", "CPU of the bridge, share of a core", figure("cpu_share"), "", kMostCpu, load);
}

void measure_round_trip(const BenchBridgeOptions& options, const std::string& folder, Experiment& experiment) {
  LoadMeter meter;
  const auto found = run_in_network(kRoundTripScript, {folder, formatted("%g", options.seconds)}, experiment);
  if (!found) {
    experiment.check_at_least("round_trip.ran", "Both ends of the cable ran", 0.0, "", 1.0);
    return;
  }
  const MachineLoad load = meter.read();
  Table table{"half_round_trip", {"over", "answers", "lost", "p50 [us]", "p99 [us]", "largest [us]"}, {}};
  const auto figure = [&](const char* way, const char* key) { return (*found)[way].value(key, 0.0); };
  for (const auto& [way, name] : {std::pair{"dds", "DDS (PoseStamped)"}, std::pair{"udp", "UDP, as many bytes"}}) {
    table.rows.push_back({std::string(name), figure(way, "answers"), figure(way, "lost"), figure(way, "p50_us"),
                          figure(way, "p99_us"), figure(way, "max_us")});
  }
  experiment.add_table(std::move(table));
  experiment.check_at_most("round_trip.over_udp", "Half a round trip, median: DDS over UDP",
                           figure("dds", "p50_us") - figure("udp", "p50_us"), "us", kMostOverUdp_us, load);
}

}  // namespace

void bench_bridge(const BenchBridgeOptions& options, Experiment& experiment) {
  const std::string folder = folder_of_this_program();
  for (const char* program : {"rtbus_bridge", "dds_round_trip"}) {
    if (::access((folder + "/" + program).c_str(), X_OK) == 0) continue;
    experiment.note("SKIPPED: " + folder + "/" + program +
                    " is not there; install rtbus-bridge, or build with cyclonedds-dev");
    return;
  }
  const bool user = ::geteuid() != 0;
  const std::vector<std::string> probe =
      user ? std::vector<std::string>{"--user", "--map-root-user", "--net", "ip", "link"}
           : std::vector<std::string>{"--net", "ip", "link"};
  if (const ProgramOutcome outcome = run_program("unshare", experiment.folder(), probe); outcome.status != 0) {
    experiment.note("SKIPPED: no network namespaces here (" + outcome.complaint() + "); be root, and install iproute2");
    return;
  }
  measure_cost(options, folder, experiment);
  measure_round_trip(options, folder, experiment);
}

}  // namespace tools
