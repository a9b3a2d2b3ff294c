// A live session whose segments somebody damages: none of its processes ends, hangs or grows, the force stays within
// its limit, and five seconds later everything is as before.
//
// RTBUS_SCRIBBLE_S: seconds of damage to each process [2]; the test of the label soak takes 20.
#include "tests/scribbler/scribbler.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>

#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/process.hpp"

namespace tests {
namespace {

namespace fs = std::filesystem;
using rtbus::kNsPerS;
using rtbus::Reader;
using rtbus::ReadStatus;
using rtbus::Stamped;

constexpr double kRecovery_s = 5.0;
constexpr double kSameForce = 0.02;
constexpr double kLeastWritesPerS = 1e4;  ///< Of damage_s().
/// The supervisor keeps what its report draws: some 20 MiB after a minute of 1 kHz.
constexpr std::size_t kMostGrowth_bytes = 64u << 20;

double damage_s() {
  const char* const text = std::getenv("RTBUS_SCRIBBLE_S");
  return text != nullptr ? std::atof(text) : 2.0;
}

std::size_t resident_bytes(pid_t pid) {
  std::ifstream in("/proc/" + std::to_string(pid) + "/statm");
  std::size_t size = 0, resident = 0;
  in >> size >> resident;
  return resident * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

/// Processes that `parent` has started.
std::vector<pid_t> children_of(pid_t parent) {
  std::vector<pid_t> out;
  std::ifstream in("/proc/" + std::to_string(parent) + "/task/" + std::to_string(parent) + "/children");
  for (pid_t pid = 0; in >> pid;) out.push_back(pid);
  std::sort(out.begin(), out.end());
  return out;
}

class ScribbledSession : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    session_.name = "scribble-" + std::to_string(::getpid());
    folder_ = fs::path(testing::TempDir()) / session_.name;
    fs::create_directories(folder_);
    std::vector<std::string> run = {"run",        std::string(RTBUS_SOURCE_DIR) + "/config/" + GetParam(),
                                    "--set",      "session=" + session_.name,
                                    "--report",   (folder_ / "report.json").string(),
                                    "--no-plots", "--quiet"};
    run.insert(run.end(), {"--set", "haptic.0.device=" + device_file()});
    start("run", run);
    ASSERT_TRUE(eventually(30.0, [this] { return steady_force_n() > 0.1; })) << said("run");
    // The hand takes half a second to its place.
    rtbus::sleep_until(rtbus::monotonic_ns() + 3 * kNsPerS);
    start("echo", {"echo", "haptic0.telemetry", "--json", "-s", session_.name});
    start("hz", {"hz", "physics.proxy_state.haptic0", "-s", session_.name});
    start("top", {"top", "--json", "-s", session_.name});
    start("stream", {"stream", "--plotjuggler", "udp://127.0.0.1:9", "-s", session_.name});
    start("plot", {"plot", "--live", "3600", "--signals", "haptic0.telemetry.force_n", "-s", session_.name, "-o",
                   (folder_ / "plot.svg").string()});
#if RTBUS_WITH_HDF5
    start("record", {"record", (folder_ / "record.h5").string(), "-s", session_.name});
#endif
    rtbus::sleep_until(rtbus::monotonic_ns() + kNsPerS);
    nodes_ = children_of(programs_.at("run").pid());
    ASSERT_GE(nodes_.size(), 2u);
    before_n_ = steady_force_n();
    ASSERT_GT(before_n_, 0.1);
    for (const pid_t pid : all_pids()) before_bytes_[pid] = resident_bytes(pid);
  }
  void TearDown() override {
    programs_.clear();
    (void)rtbus::remove_dead(session_.name);
    fs::remove_all(folder_);
  }

  /// A hand that pushes 5 mm into the wall and stays. Without dry friction there is one force at rest; with the model's
  /// own 0.06 N, the tip may rest anywhere within it, also without damage.
  [[nodiscard]] std::string device_file() const {
    std::string file = (folder_ / "device.yaml").string();
    std::ofstream(file) << "schema: device/1\ndriver: simulated\nmodel: phantom_desktop\n"
                        << (std::string(GetParam()) == "wall_own_plant.yaml" ? "process: own\n" : "")
                        << "mechanics: {coulomb_n: 0}\n"
                        << "hand: {type: push, impedance: normal, start_m: [0, 0.020, 0], direction: [0, -1, 0], "
                        << "distance_m: 0.025, speed_m_s: 0.05, start_s: 1.0}\n";
    return file;
  }
  void start(const std::string& name, std::vector<std::string> words) {
    words.insert(words.begin(), std::string(RTBUS_BINARY_DIR) + "/rtbus");
    programs_.emplace(name, Child(words, (folder_ / (name + ".txt")).string()));
  }
  [[nodiscard]] std::string said(const std::string& name) const {
    std::ifstream in(folder_ / (name + ".txt"));
    std::string text(std::istreambuf_iterator<char>(in), {});
    return text.size() < 4000 ? text : text.substr(text.size() - 4000);
  }
  [[nodiscard]] std::vector<pid_t> all_pids() const {
    std::vector<pid_t> out = nodes_;
    for (const auto& [name, program] : programs_) out.push_back(program.pid());
    return out;
  }

  /// Median force at the device over a second, so that a pause of the machine, which ends in a ramp, is not in it; 0
  /// when the telemetry does not come.
  [[nodiscard]] double steady_force_n() const {
    auto reader = Reader<rtbus::Telemetry>::open(session_, "haptic0.telemetry", {.presence = true});
    if (!reader) return 0.0;
    Stamped<rtbus::Telemetry> tick;
    std::vector<double> force_n;
    for (const std::uint64_t end_ns = rtbus::monotonic_ns() + kNsPerS; rtbus::monotonic_ns() < end_ns;) {
      while (reader->read_next(tick) == ReadStatus::kFresh) {
        const rtbus::Vec3& f = tick.value.force_n;
        force_n.push_back(std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
      }
      rtbus::sleep_until(rtbus::monotonic_ns() + 5 * rtbus::kNsPerMs);
    }
    if (force_n.size() < 100) return 0.0;
    const auto middle = force_n.begin() + static_cast<std::ptrdiff_t>(force_n.size() / 2);
    std::nth_element(force_n.begin(), middle, force_n.end());
    return *middle;
  }

  /// What the loop did last, for whoever has to find out why the force is another one.
  [[nodiscard]] std::string last_cycle() const {
    auto reader = Reader<rtbus::Telemetry>::open(session_, "haptic0.telemetry", {.presence = true});
    Stamped<rtbus::Telemetry> tick;
    if (!reader || !eventually(1.0, [&] { return reader->read_latest(tick) == ReadStatus::kFresh; }))
      return "no telemetry";
    std::ostringstream text;
    const rtbus::Telemetry& t = tick.value;
    for (int i = 0; i < 3; ++i) {
      text << "axis " << i << ": device " << t.position_m[i] << " m, proxy " << t.proxy_position_m[i] << " m, rendered "
           << t.rendered_force_n[i] << " N, sent " << t.force_n[i] << " N; ";
    }
    text << "safety " << t.safety << ", gate " << t.gate << ", observed " << t.energy_observed_j << " J, proxy age "
         << static_cast<double>(t.proxy_age_ns) * 1e-6 << " ms";
    return text.str();
  }

  template <class T>
  [[nodiscard]] std::optional<T> newest(const std::string& topic) const {
    Stamped<T> sample;
    const bool there = eventually(3.0, [&] {
      auto reader = Reader<T>::open(session_, topic);
      return reader && reader->read_latest(sample) == ReadStatus::kFresh;
    });
    return there ? std::optional<T>(sample.value) : std::nullopt;
  }

  /// Everybody is there, the same as before, and no larger than it may be.
  void expect_all_well(const std::string& after) {
    for (auto& [name, program] : programs_) {
      int status = 0;
      EXPECT_FALSE(program.has_ended(status))
          << name << " ended after " << after << ", status " << status << ": " << said(name);
    }
    if (programs_.at("run").pid() <= 0) return;
    EXPECT_EQ(children_of(programs_.at("run").pid()), nodes_) << "a node ended after " << after << ": " << said("run");
    for (const auto& [pid, bytes] : before_bytes_) {
      EXPECT_LT(resident_bytes(pid), bytes + kMostGrowth_bytes) << "pid " << pid << " after " << after;
    }
  }
  void expect_the_force_of_before(const std::string& after) {
    rtbus::sleep_until(rtbus::monotonic_ns() + static_cast<std::uint64_t>(kRecovery_s * 1e9));
    const double now_n = steady_force_n();
    std::printf("%s: %.3f N, before %.3f N\n", after.c_str(), now_n, before_n_);
    EXPECT_NEAR(now_n, before_n_, kSameForce * before_n_) << after << ": " << last_cycle();
    // What left for the device since the loop began, as the loop itself counted it.
    const auto stats = newest<rtbus::LoopStats>("haptic0.loop_stats");
    const auto info = newest<rtbus::NodeInfo>("haptic0.node_info");
    ASSERT_TRUE(stats && info) << after;
    EXPECT_LE(stats->force_peak_n, info->force_limit_n * (1.0 + 1e-9)) << after;
  }
  /// Each command ends in order when it is asked to.
  void expect_orderly_ends() {
    for (auto& [name, program] : programs_) {
      if (name == "run") continue;
      expect_end_of(name, program);
    }
    expect_end_of("run", programs_.at("run"));
    EXPECT_THAT(segments_of(session_.name), testing::IsEmpty());
    EXPECT_TRUE(fs::exists(folder_ / "report.json"));
  }

  rtbus::Session session_;
  fs::path folder_;
  std::map<std::string, Child> programs_;
  std::vector<pid_t> nodes_;
  std::map<pid_t, std::size_t> before_bytes_;
  double before_n_ = 0.0;

 private:
  void expect_end_of(const std::string& name, Child& program) {
    program.signal(SIGINT);
    int status = 0;
    const bool ended = eventually(20.0, [&] { return program.has_ended(status); });
    EXPECT_TRUE(ended) << name << " hangs: " << said(name);
    if (ended) {
      EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) <= 1) << name << ", status " << status << ": " << said(name);
    }
  }
};

struct Victim {
  const char* name;
  std::vector<std::string> topics;  ///< Ends of the names of what it reads; empty: all.
};

TEST_P(ScribbledSession, SurvivesRandomWrites) {
  const Victim victims[] = {
      {"haptic_node", {".proxy_state.haptic0", "physics.heartbeat", ".contacts.haptic0", ".plant_state"}},
      {"physics_node", {".device_state"}},
      {"supervisor and commands", {".telemetry", "_stats", ".node_info", ".heartbeat", ".proxy_state.haptic0"}},
      {"everybody", {}}};
  std::uint64_t seed = 1;
  for (const Victim& victim : victims) {
    const auto chooses = [&](const std::string& topic) {
      return victim.topics.empty() || std::any_of(victim.topics.begin(), victim.topics.end(),
                                                  [&](const std::string& end) { return topic.ends_with(end); });
    };
    Scribbler scribbler(session_.name, chooses, seed++);
    rtbus::sleep_until(rtbus::monotonic_ns() + static_cast<std::uint64_t>(damage_s() * 1e9));
    // A busy machine writes less often: it goes on until as much is damaged as on a quiet one.
    const auto least = static_cast<std::uint64_t>(kLeastWritesPerS * damage_s());
    EXPECT_TRUE(eventually(20.0 * damage_s(), [&] { return scribbler.live_writes() >= least; })) << victim.name;
    scribbler.stop();
    std::printf("%s: %llu writes into %zu live segments, %.0f a second\n", victim.name,
                static_cast<unsigned long long>(scribbler.live_writes()), scribbler.segments(),
                scribbler.live_writes_per_s());
    ASSERT_NO_FATAL_FAILURE(expect_all_well(victim.name));
    ASSERT_NO_FATAL_FAILURE(expect_the_force_of_before(victim.name));
    if (HasFailure()) break;
  }
  expect_orderly_ends();
}

TEST_P(ScribbledSession, SurvivesTheLossOfAllPages) {
  for (int round = 0; round < 3; ++round) {
    for (const std::string& name : segments_of(session_.name)) (void)::truncate(("/dev/shm/" + name).c_str(), 0);
    rtbus::sleep_until(rtbus::monotonic_ns() + kNsPerS);
    expect_all_well("truncate");
  }
  ASSERT_NO_FATAL_FAILURE(expect_the_force_of_before("truncate"));
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(session_.name)) {
    EXPECT_EQ(topic.problem, "") << topic.topic;
    EXPECT_TRUE(topic.writer_alive) << topic.topic;
  }
  expect_orderly_ends();
}

INSTANTIATE_TEST_SUITE_P(Of, ScribbledSession, testing::Values("wall.yaml", "wall_own_plant.yaml"),
                         [](const auto& session) { return fs::path(session.param).stem().string(); });

}  // namespace
}  // namespace tests
