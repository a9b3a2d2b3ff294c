// A session on two machines (namespaces with a network and a /dev/shm each, joined by net_relay): a wall and a free
// block over real DDS, peers that do not belong there, and a link that is cut. tools/network/two_machines starts this
// program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/network_messages.hpp"
#include "rtbus/order_client.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/process.hpp"
#include "tests/support/temporary_file.hpp"

namespace {

using tests::Child;
using tests::eventually;

constexpr double kRoundTrip_s = 0.1;  // that the link is meant for; the relay's is shorter
constexpr double kLoss_s = 0.2 + 0.5 * kRoundTrip_s, kFade_s = 0.040;  // haptic::across_network, docs/safety.md
constexpr double kZero_s = kLoss_s + kFade_s + 0.010;                  // and a few ticks

std::string text_of(const std::string& file) {
  std::ostringstream out;
  out << std::ifstream(file).rdbuf();
  return out.str();
}

/// Words of a variable that two_machines sets.
std::vector<std::string> words_of(const char* variable) {
  std::istringstream words(std::getenv(variable) != nullptr ? std::getenv(variable) : "");
  std::vector<std::string> out;
  for (std::string word; words >> word;) out.push_back(word);
  return out;
}

void tell_relay(const std::string& order) { std::ofstream(std::getenv("RTBUS_RELAY")) << order << std::endl; }

constexpr double kStiffness_n_per_m = 200.0, kQuantum_m = 23e-6;  // config/wall.yaml, phantom_desktop

double vertical_n(const rtbus::Telemetry& tick) { return tick.force_n[1]; }
double norm_n(const rtbus::Telemetry& tick) {
  return std::sqrt(tick.force_n[0] * tick.force_n[0] + tick.force_n[1] * tick.force_n[1] +
                   tick.force_n[2] * tick.force_n[2]);
}

/// Whether the machine itself stood in the way: a thread of ordinary priority, as those of DDS are, waits a millisecond
/// at a time.
class Witness {
 public:
  Witness()
      : thread_([this] {
          while (!end_.load()) {
            const std::uint64_t due_ns = rtbus::monotonic_ns() + rtbus::kNsPerMs;
            rtbus::sleep_until(due_ns);
            const std::uint64_t late_ns = rtbus::monotonic_ns() - due_ns;
            if (late_ns > worst_ns_.load()) worst_ns_.store(late_ns);
          }
        }) {}
  ~Witness() {
    end_.store(true);
    thread_.join();
  }
  Witness(const Witness&) = delete;
  Witness& operator=(const Witness&) = delete;
  /// Largest delay since the last call.
  std::uint64_t take_worst_ns() { return worst_ns_.exchange(0); }

 private:
  std::atomic<bool> end_{false};
  std::atomic<std::uint64_t> worst_ns_{0};
  std::thread thread_;
};
/// From such a delay of the loop on, the device lets its force go (force_timeout_ms). Answers pass through several
/// threads, and count for 250 ms.
constexpr std::uint64_t kLoopPause_ns = 20 * rtbus::kNsPerMs, kThreadPause_ns = 50 * rtbus::kNsPerMs;

/// Growth of the force is taken over so long: in a tick it is the noise of encoder and jitter.
constexpr std::uint64_t kFelt_ns = 20 * rtbus::kNsPerMs;

constexpr double kDamping_n_s_per_m = 1.15;  // a fifth of critical (decision 0011), as the haptic node says
constexpr double kRamp_s = 0.1, kWayOut_m_s = 0.1;

/// A proxy that is put onto a hand inside the wall goes out at v = kWayOut_m_s, while the ramp of T = kRamp_s lets the
/// force grow: F = (K v t + B v) t/T until it is whole. @returns how much it grows in its last 20 ms, for a hand that
/// does not give way.
double steepest_return_n(double whole_n) {
  const auto force_n = [](double t) {
    return (kStiffness_n_per_m * t + kDamping_n_s_per_m) * kWayOut_m_s * t / kRamp_s;
  };
  double t_s = 0.0;
  while (force_n(t_s) < whole_n) t_s += 1e-3;
  return whole_n - force_n(t_s - rtbus::seconds_between(0, kFelt_ns));
}

class LinkSession : public testing::Test {
 protected:
  void SetUp() override {
    if (words_of("RTBUS_THERE").empty()) GTEST_SKIP() << "SKIPPED: tools/network/two_machines starts this program";
    bus_.name = "link" + std::to_string(getpid()) + "_" + std::to_string(++runs_);
  }
  void TearDown() override {
    here_.reset();
    there_.reset();
    EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
  }

  [[nodiscard]] std::vector<std::string> run_command(const std::string& config, const std::string& only,
                                                     const std::vector<std::string>& more) const {
    std::vector<std::string> words{std::string(RTBUS_BINARY_DIR) + "/rtbus",
                                   "run",
                                   std::string(RTBUS_SOURCE_DIR) + "/config/" + config,
                                   "--only",
                                   only,
                                   "--no-bare-loop",
                                   "--no-plots"};
    for (const std::string& set : {"session=" + bus_.name, std::string("network.machines.physics=10.77.0.2"),
                                   std::string("network.machines.haptic0=10.77.0.1"), std::string("haptic.0.link=dds"),
                                   std::string("haptic.0.link_round_trip_ms=100")}) {
      words.insert(words.end(), {"--set", set});
    }
    for (const std::string& set : more) words.insert(words.end(), {"--set", set});
    return words;
  }
  /// On the other machine.
  [[nodiscard]] Child there(std::vector<std::string> words, const std::string& log) const {
    std::vector<std::string> command = words_of("RTBUS_THERE");
    command.insert(command.end(), words.begin(), words.end());
    return Child(command, log);
  }

  /// A hand that is held stays at its place while there is no force. One that nobody holds falls 60 mm into the wall
  /// then, and also while the machine holds up the loop: it is lifted out of there at 0.7 mm/s (decision 0016).
  const std::vector<std::string> kHeld_{"haptic.0.device=devices/sim_phantom_desktop_push.yaml"};

  /// Both machines, until forces act here.
  void start(const std::string& config, const std::vector<std::string>& more = {}) {
    there_ = std::make_unique<Child>(there(run_command(config, "physics", more), there_log()));
    here_ = std::make_unique<Child>(run_command(config, "haptic0", more), here_log());
    ASSERT_TRUE(eventually(60.0, [&] {
      auto opened = rtbus::Reader<rtbus::Telemetry>::open(bus_, "haptic0.telemetry", {.presence = true});
      if (opened && !ticks_) ticks_.emplace(std::move(*opened));
      auto stats = rtbus::Reader<rtbus::NetworkStats>::open(bus_, "link.stats.haptic0");
      if (stats && !stats_) stats_.emplace(std::move(*stats));
      auto beats = rtbus::Reader<rtbus::Heartbeat>::open(bus_, "physics.heartbeat");
      if (beats && !beats_) beats_.emplace(std::move(*beats));
      return ticks_ && stats_ && beats_;
    })) << logs();
    ASSERT_TRUE(eventually(60.0, [&] {
      follow();
      return newest_.gate == 1.0;
    })) << logs();
  }
  int finish(std::unique_ptr<Child>& child) {
    const int status = child->end(SIGINT);
    child.reset();
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  /// What happened since the last call.
  struct Ticks {
    double least_n = 1e9, most_n = -1e9;  ///< Vertical.
    double growth_n = 0.0;                ///< Largest growth of the force within kFelt_ns.
    double late_s = 0.0;                  ///< Latest wake-up of the loop.
    [[nodiscard]] double spread_n() const { return most_n - least_n; }
    void add(const Ticks& more) {
      least_n = std::min(least_n, more.least_n);
      most_n = std::max(most_n, more.most_n);
      growth_n = std::max(growth_n, more.growth_n);
      late_s = std::max(late_s, more.late_s);
    }
  };
  Ticks follow() {
    Ticks out;
    rtbus::Stamped<rtbus::Telemetry> tick;
    while (ticks_->read_next(tick) == rtbus::ReadStatus::kFresh) {
      newest_ = tick.value;
      out.least_n = std::min(out.least_n, vertical_n(newest_));
      out.most_n = std::max(out.most_n, vertical_n(newest_));
      out.late_s = std::max(out.late_s, 1e-6 * newest_.wakeup_us);
      lately_.emplace_back(newest_.due_ns, norm_n(newest_));
      while (lately_.front().first + kFelt_ns < newest_.due_ns) lately_.pop_front();
      for (const auto& [due_ns, force_n] : lately_) out.growth_n = std::max(out.growth_n, norm_n(newest_) - force_n);
    }
    return out;
  }
  [[nodiscard]] rtbus::NetworkStats stats() {
    rtbus::Stamped<rtbus::NetworkStats> sample;
    if (stats_->read_latest(sample) == rtbus::ReadStatus::kFresh) newest_stats_ = sample.value;
    return newest_stats_;
  }
  /// Until the hand has come to the wall, rests there, and feels the whole force of its spring. @returns what happened
  /// meanwhile.
  Ticks follow_to_rest() {
    Ticks out;
    std::uint64_t looked_ns = rtbus::monotonic_ns();
    Ticks lately;
    std::ostringstream windows;  // for whoever reads why it did not rest
    EXPECT_TRUE(eventually(
        60.0,
        [&] {
          const Ticks now = follow();
          out.add(now);
          lately.add(now);
          if (rtbus::monotonic_ns() < looked_ns + 300 * rtbus::kNsPerMs) return false;
          looked_ns = rtbus::monotonic_ns();
          windows << "tick " << newest_.tick << ": " << lately.least_n << " to " << lately.most_n << " N, hand at "
                  << newest_.position_m[1] << " m, proxy at " << newest_.proxy_position_m[1] << " m, gate "
                  << newest_.gate << ", safety " << newest_.safety << ", answer " << newest_.proxy_sequence << "\n";
          const double spring_n = kStiffness_n_per_m * (newest_.proxy_position_m[1] - newest_.position_m[1]);
          return std::exchange(lately, {}).spread_n() < 0.01 && vertical_n(newest_) > std::max(0.05, spring_n - 0.02);
        }))
        << windows.str() << logs();
    return out;
  }
  /// Runs a stranger on the other machine to its end. @returns how much the force here changed meanwhile; where the
  /// machine paused, once more.
  double bear_stranger(const std::vector<std::string>& options, double seconds) {
    std::vector<std::string> words{std::string(RTBUS_BINARY_DIR) + "/stranger",
                                   "--own",
                                   "10.77.0.2",
                                   "--other",
                                   "10.77.0.1",
                                   "--session",
                                   bus_.name,
                                   "--seconds",
                                   std::to_string(seconds)};
    words.insert(words.end(), options.begin(), options.end());
    for (int left = 5;; --left) {
      (void)follow();
      (void)witness_.take_worst_ns();
      Child stranger = there(words, folder_.path().string() + "/stranger");
      Ticks felt;
      int status = -1;
      EXPECT_TRUE(eventually(60.0, [&] {
        felt.add(follow());
        return stranger.has_ended(status);
      }));
      EXPECT_EQ(status, 0) << text_of(folder_.path().string() + "/stranger");
      const bool paused = witness_.take_worst_ns() > kThreadPause_ns || rtbus::ns_of(felt.late_s) > kLoopPause_ns;
      if (!paused || left == 0) return felt.spread_n();
      ++paused_;
      (void)follow_to_rest();
    }
  }

  /// Follows until the force is zero. @returns how long after the last heartbeat of process `old_pid`, less what the
  /// loop itself was late; of any process when `old_pid` is 0.
  double seconds_to_zero(std::uint64_t old_pid) {
    std::uint64_t silent_ns = 0, zero_ns = 0;
    double late_s = 0.0;
    EXPECT_TRUE(eventually(30.0, [&] {
      rtbus::Stamped<rtbus::Heartbeat> beat;
      if (beats_->read_latest(beat) == rtbus::ReadStatus::kFresh && (old_pid == 0 || beat.value.pid == old_pid)) {
        silent_ns = beat.stamp_ns;
      }
      rtbus::Stamped<rtbus::Telemetry> tick;
      while (zero_ns == 0 && ticks_->read_next(tick) == rtbus::ReadStatus::kFresh) {
        newest_ = tick.value;
        late_s = std::max(late_s, 1e-6 * newest_.wakeup_us);
        if (norm_n(tick.value) == 0.0) zero_ns = tick.stamp_ns;
      }
      return zero_ns != 0;
    })) << logs();
    return rtbus::seconds_between(silent_ns, zero_ns) - late_s;
  }
  /// Kills the program of that name below `rtbus run`.
  static void kill_below(pid_t run, const std::string& program) {
    const std::string base = "/proc/" + std::to_string(run);
    std::istringstream children(text_of(base + "/task/" + std::to_string(run) + "/children"));
    int killed = 0;
    for (pid_t child = 0; children >> child;) {
      std::error_code ignored;
      const auto file = std::filesystem::read_symlink("/proc/" + std::to_string(child) + "/exe", ignored);
      if (file.filename() == program) killed += ::kill(child, SIGKILL) == 0 ? 1 : 0;
    }
    EXPECT_EQ(killed, 1) << program;
  }
  /// The force comes back as after a cut: softer than at the first touch, and through its ramp.
  void expect_soft_return(const Ticks& first, double rest_n) {
    const Ticks soft = follow_to_rest();
    EXPECT_EQ(newest_.gate, 1.0);
    EXPECT_LE(soft.most_n, first.most_n + kStiffness_n_per_m * kQuantum_m);  // to an encoder step
    EXPECT_LE(soft.growth_n, steepest_return_n(rest_n));
  }

  [[nodiscard]] std::string here_log() const { return folder_.path().string() + "/here"; }
  [[nodiscard]] std::string there_log() const { return folder_.path().string() + "/there"; }
  [[nodiscard]] std::string logs() const { return "here:\n" + text_of(here_log()) + "there:\n" + text_of(there_log()); }

  static inline int runs_ = 0;
  rtbus::Session bus_;
  tests::TemporaryFolder folder_;
  std::unique_ptr<Child> here_, there_;
  std::optional<rtbus::Reader<rtbus::Telemetry>> ticks_;
  std::optional<rtbus::Reader<rtbus::NetworkStats>> stats_;
  std::optional<rtbus::Reader<rtbus::Heartbeat>> beats_;
  rtbus::Telemetry newest_;
  Witness witness_;
  int paused_ = 0;                                       ///< Strangers that came again because the machine paused.
  std::deque<std::pair<std::uint64_t, double>> lately_;  ///< When each tick was due, and its force.
  rtbus::NetworkStats newest_stats_;
};

TEST_F(LinkSession, AWallOverTheLinkAndWhenItIsCutZeroForceAndASoftReturn) {
  start("wall.yaml", kHeld_);
  const Ticks first = follow_to_rest();
  const double rest_n = vertical_n(newest_);
  // The hand's own stamps came back: ages are those of the round trip, whatever the other clock says.
  EXPECT_GT(newest_.proxy_age_ns, rtbus::ns_of(0.020));
  EXPECT_LT(newest_.proxy_age_ns, rtbus::ns_of(0.5));
  EXPECT_EQ(stats().connected, 1u);
  EXPECT_GT(stats().round_trip_s, 0.025);

  // Zero force within the promise, counted from the last heartbeat that came.
  tell_relay("cut");
  const double zero_s = seconds_to_zero(0);
  EXPECT_LE(zero_s, kZero_s);

  // Nothing for 5 s, then a force that grows and does not jump.
  const std::uint64_t back_ns = rtbus::monotonic_ns() + 5 * rtbus::kNsPerS;
  while (rtbus::monotonic_ns() < back_ns) {
    const Ticks away = follow();
    EXPECT_LE(away.most_n, 0.0);
    EXPECT_GE(away.least_n, away.most_n > -1e9 ? 0.0 : 1e9);
    usleep(100000);
  }
  tell_relay("restore");
  expect_soft_return(first, rest_n);
  EXPECT_EQ(finish(here_), 0) << logs();
  EXPECT_EQ(finish(there_), 0) << logs();
}

TEST_F(LinkSession, PhysicsAloneOrALinkAloneStartedAnewIsACutAndASoftReturn) {
  start("wall.yaml", kHeld_);
  const Ticks first = follow_to_rest();
  const double rest_n = vertical_n(newest_);

  rtbus::Stamped<rtbus::Heartbeat> beat;
  ASSERT_TRUE(eventually(10.0, [&] { return beats_->read_latest(beat) == rtbus::ReadStatus::kFresh; }));
  const std::uint64_t old_pid = beat.value.pid;
  kill_below(there_->pid(), "physics_node");
  EXPECT_LE(seconds_to_zero(old_pid), kZero_s);
  expect_soft_return(first, rest_n);
  ASSERT_TRUE(eventually(10.0, [&] { return beats_->read_latest(beat) == rtbus::ReadStatus::kFresh; }));
  EXPECT_NE(beat.value.pid, old_pid);

  kill_below(there_->pid(), "rtbus_link");
  EXPECT_LE(seconds_to_zero(0), kZero_s);
  expect_soft_return(first, rest_n);

  kill_below(here_->pid(), "rtbus_link");
  EXPECT_LE(seconds_to_zero(0), kZero_s);
  beats_.reset();  // its topics are others now
  stats_.reset();
  expect_soft_return(first, rest_n);
  EXPECT_EQ(finish(here_), 0) << logs();
  EXPECT_EQ(finish(there_), 0) << logs();
}

TEST_F(LinkSession, StrangersAreRefusedWithAReasonAndNothingIsFelt) {
  start("wall.yaml", kHeld_);
  (void)follow_to_rest();
  EXPECT_LT(bear_stranger({"--foreign-version"}, 1.0), 0.02);
  EXPECT_LT(bear_stranger({"--foreign-layout"}, 1.0), 0.02);
  EXPECT_LT(bear_stranger({"--foreign-session"}, 1.0), 0.02);
  EXPECT_LT(bear_stranger({}, 1.5), 0.02);  // a second physics
  EXPECT_LT(bear_stranger({"--flood"}, 1.5), 0.02);
  EXPECT_LT(bear_stranger({"--noise"}, 1.5), 0.02);
  // Of the peer that is known, the session's own physics: they came before.
  const std::uint64_t late = stats().late;
  EXPECT_LT(bear_stranger({"--replay", "--flood"}, 1.5), 0.02);
  std::fputs(text_of(folder_.path().string() + "/stranger").c_str(), stdout);
  EXPECT_TRUE(eventually(10.0, [&] { return stats().late > late + 1000; }))
      << text_of(folder_.path().string() + "/stranger");
  EXPECT_EQ(newest_.gate, 1.0);
  EXPECT_TRUE(eventually(10.0, [&] { return stats().refused > 100; }));
  EXPECT_EQ(stats().connected, 1u);
  const std::string said = text_of(here_log());
  const auto times = [&](const std::string& words) {
    std::size_t count = 0;
    for (std::size_t at = said.find(words); at != std::string::npos; at = said.find(words, at + 1)) ++count;
    return count;
  };
  EXPECT_EQ(times("it speaks version 2 of the link"), 1u) << said;
  EXPECT_EQ(times("its messages have another layout"), 1u) << said;
  EXPECT_EQ(times("it claims physics, for which another peer"), 1u) << said;
  EXPECT_EQ(times("it belongs to session '" + bus_.name + "x'"), 1u) << said;
  EXPECT_LE(times("is lost"), static_cast<std::size_t>(paused_)) << said;
  EXPECT_EQ(finish(here_), 0) << logs();
  EXPECT_EQ(finish(there_), 0) << logs();
}

TEST_F(LinkSession, AFreeBlockIsPushedAndAnEstopThereStopsTheHandHere) {
  start("free_block.yaml");
  double most_n = 0.0;
  EXPECT_TRUE(eventually(30.0, [&] {
    follow();
    most_n = std::max(most_n, norm_n(newest_));
    return most_n > 0.05;
  })) << logs();
  // Where the block is, as the other machine says.
  const auto block_z_m = [&] {
    const std::string out = folder_.path().string() + "/bodies";
    Child echo = there({std::string(RTBUS_BINARY_DIR) + "/rtbus", "echo", "physics.body_poses", "--session", bus_.name,
                        "-n", "1", "--json"},
                       out);
    echo.wait();
    std::string line = text_of(out);  // beside what it says on stderr
    line.erase(0, std::min(line.find('{'), line.size()));
    line.resize(std::min(line.find('\n'), line.size()));
    const nlohmann::json sample = nlohmann::json::parse(line, nullptr, false);
    double least = 0.0;  // of all bodies: only the block moves, along -z
    if (sample.is_object() && sample.contains("position_m")) {
      const nlohmann::json& xyz = sample["position_m"];  // of one body after the other
      for (std::size_t at = 2; at < xyz.size(); at += 3) least = std::min(least, xyz[at].get<double>());
    }
    return least;
  };
  constexpr double kStarts_m = -0.02;  // config/scenes/free_block.yaml
  EXPECT_TRUE(eventually(20.0, [&] { return block_z_m() < kStarts_m - 0.005; })) << logs();
  EXPECT_EQ(stats().left_out, 0u);

  Child stop = there({std::string(RTBUS_BINARY_DIR) + "/rtbus", "estop", "--session", bus_.name},
                     folder_.path().string() + "/estop");
  EXPECT_EQ(stop.wait(), 0) << text_of(folder_.path().string() + "/estop");
  EXPECT_TRUE(eventually(10.0, [&] {
    follow();
    return norm_n(newest_) == 0.0 && newest_.gate == 0.0;
  })) << logs();
  EXPECT_EQ(finish(here_), 0) << logs();
  EXPECT_EQ(finish(there_), 0) << logs();
}

TEST_F(LinkSession, ABodyIsMovedByOrdersFromTheMachineOfTheHand) {
  start("moving_plate.yaml", {"scene.bodies.1.motion={target: {max_speed_m_s: 0.2, reach_m: 0.02}}"});
  const auto plate_y_m = [&] {
    const std::string out = folder_.path().string() + "/bodies";
    Child echo = there({std::string(RTBUS_BINARY_DIR) + "/rtbus", "echo", "physics.body_poses", "--session", bus_.name,
                        "-n", "1", "--json"},
                       out);
    echo.wait();
    std::string line = text_of(out);
    line.erase(0, std::min(line.find('{'), line.size()));
    line.resize(std::min(line.find('\n'), line.size()));
    const nlohmann::json sample = nlohmann::json::parse(line, nullptr, false);
    return sample.is_object() && sample.contains("position_m") ? sample["position_m"][1 * 3 + 1].get<double>() : 1.0;
  };
  const auto order = [&](const std::string& text) {
    const auto answer = rtbus::send_order_text(bus_.name, text, 5.0);
    return answer ? *answer : answer.error().sentence;
  };
  constexpr double kStarts_m = -0.01;  // config/scenes/moving_plate.yaml
  EXPECT_NEAR(plate_y_m(), kStarts_m, 1e-6);
  // The newest wins, and each ends by itself.
  EXPECT_THAT(order(R"({"order": "target", "body": "plate", "velocity_m_s": [0, -0.001, 0], "for_s": 1})"),
              testing::HasSubstr("\"ok\":true"));
  EXPECT_THAT(order(R"({"order": "target", "body": "plate", "velocity_m_s": [0, 0.01, 0], "for_s": 0.5})"),
              testing::HasSubstr("\"ok\":true"));
  double before_m = 1.0;
  EXPECT_TRUE(eventually(20.0, [&] {  // until it rests
    const double y_m = plate_y_m();
    return y_m > kStarts_m + 1e-4 && std::exchange(before_m, y_m) == y_m;
  })) << logs();
  // 0.5 s at 0.01 m/s, less where physics is late, more where the end was told late.
  EXPECT_GT(before_m, kStarts_m + 0.001);
  EXPECT_LT(before_m, kStarts_m + 0.0065);
  EXPECT_THAT(order(R"({"order": "target", "body": "plate", "position_m": [0, -0.02, 0], "for_s": 1})"),
              testing::HasSubstr("\"ok\":true"));
  EXPECT_TRUE(eventually(20.0, [&] { return std::abs(plate_y_m() + 0.02) < 1e-6; })) << logs();
  EXPECT_EQ(finish(here_), 0) << logs();
  EXPECT_EQ(finish(there_), 0) << logs();
}

#if RTBUS_WITH_HDF5
constexpr double kUptime_s = 100000.0;  // by which the other machine's clock is ahead; two_machines is told the same

class LinkClocks : public LinkSession {};

// Both machines are one kernel's, so the difference of their clocks is known exactly.
TEST_F(LinkClocks, TwoRecordingsComeOntoOneClockWithinTheBound) {
  start("wall.yaml");
  const std::string folder = folder_.path().string();
  const auto record = [&](const std::string& file) {
    return std::vector<std::string>{
        std::string(RTBUS_BINARY_DIR) + "/rtbus", "record", folder + file, "--session", bus_.name, "--duration", "2"};
  };
  Child recorder_there = there(record("/there.h5"), folder + "/record_there");
  Child recorder_here(record("/here.h5"), folder + "/record_here");
  EXPECT_EQ(recorder_there.wait(), 0) << text_of(folder + "/record_there");
  EXPECT_EQ(recorder_here.wait(), 0) << text_of(folder + "/record_here");
  EXPECT_EQ(finish(here_), 0) << logs();
  EXPECT_EQ(finish(there_), 0) << logs();

  Child merge({std::string(RTBUS_BINARY_DIR) + "/rtbus", "export", "--merge", folder + "/here.h5", folder + "/there.h5",
               "-o", folder + "/merged"},
              folder + "/merge");
  EXPECT_EQ(merge.wait(), 0);
  const std::string said = text_of(folder + "/merge");
  double begin_s = 0.0, end_s = 0.0, error_s = 0.0;
  const std::size_t at = said.find("less ");
  ASSERT_NE(at, std::string::npos) << said;
  ASSERT_EQ(std::sscanf(said.c_str() + at, "less %lf s at its beginning and %lf s at its end, off by at most %lf s",
                        &begin_s, &end_s, &error_s),
            3)
      << said;
  EXPECT_GT(error_s, 0.010);  // 40 ms there and back: no better is possible
  EXPECT_LT(error_s, 0.030);
  EXPECT_NEAR(begin_s, kUptime_s, error_s);
  EXPECT_NEAR(end_s, kUptime_s, error_s);

  // An answer came here after it was made there, on the one clock too.
  const auto first_stamp_s = [&](const std::string& file) {
    std::istringstream lines(text_of(folder + "/merged/" + file));
    std::string line;
    std::getline(lines, line);
    std::getline(lines, line);
    unsigned long long sequence = 0, stamp_ns = 0;
    EXPECT_EQ(std::sscanf(line.c_str(), "%llu,%llu", &sequence, &stamp_ns), 2) << file << ": " << line;
    return 1e-9 * static_cast<double>(stamp_ns);
  };
  EXPECT_NEAR(first_stamp_s("first/physics.proxy_state.haptic0.csv"),
              first_stamp_s("second/physics.proxy_state.haptic0.csv"), 60.0);

  // Without the link's statistics nobody knows, and recordings of another session do not belong here.
  Child alone({std::string(RTBUS_BINARY_DIR) + "/rtbus", "export", "--merge", folder + "/here.h5"}, folder + "/alone");
  const int status = alone.wait();
  EXPECT_EQ(WEXITSTATUS(status), 2);
  EXPECT_THAT(text_of(folder + "/alone"), testing::HasSubstr("takes two recordings"));
}
#endif

}  // namespace
