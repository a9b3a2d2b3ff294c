/// The realtime path allocates nothing and takes no lock: thousands of cycles of the real loop, with the real device
/// simulation and the real bus, while the session's own engine answers on the other end, for every method that the
/// session allows.
#include "tests/support/no_alloc.hpp"

#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "haptic_node/bus_link.hpp"
#include "haptic_node/loop.hpp"
#include "haptic_node/rendering/registry.hpp"
#include "physics_node/engine_registry.hpp"
#include "physics_node/stepper.hpp"
#include "rtbus/event_log.hpp"
#include "rtbus/pacer.hpp"

#if !defined(RTBUS_SANITIZED)
namespace {

TEST(RealtimeTrap, CatchesAllocations) {
  void* (*volatile allocate)(std::size_t) = &::operator new;  // volatile: the compiler may not pair and drop them
  void (*volatile release)(void*) = &::operator delete;
  void* (*volatile allocate_aligned)(std::size_t, std::align_val_t) = &::operator new;
  tests::Caught caught;
  void* aligned = nullptr;
  {
    tests::RealtimeTrap trap(caught);
    release(allocate(24));
    aligned = allocate_aligned(64, std::align_val_t{64});
    std::vector<int> growing;
    growing.reserve(100);
  }
  EXPECT_EQ(caught.allocations, 5u);
  EXPECT_NE(caught.where().find("malloc"), std::string::npos) << caught.where();
  ::operator delete (aligned, std::align_val_t{64});
  EXPECT_EQ(caught.allocations, 5u) << "nothing is counted beyond the trap's life";
}

TEST(RealtimeTrap, CatchesLocks) {
  std::mutex mutex;
  tests::Caught caught;
  {
    tests::RealtimeTrap trap(caught);
    const std::lock_guard lock(mutex);
  }
  EXPECT_EQ(caught.locks, 1u);
  EXPECT_EQ(caught.allocations, 0u);
}

/// While one lives, CLOCK_MONOTONIC of this process stands still between two calls of set().
class SimulatedClock {
 public:
  SimulatedClock() = default;
  ~SimulatedClock() { now_ns_ = 0; }
  SimulatedClock(const SimulatedClock&) = delete;
  SimulatedClock& operator=(const SimulatedClock&) = delete;
  static void set(std::uint64_t now_ns) { now_ns_ = now_ns; }
  /// 0: the kernel's clock.
  static std::uint64_t now_ns() { return now_ns_; }

 private:
  inline static std::atomic<std::uint64_t> now_ns_{0};
};

/// A session, and what is changed in it so that the hand soon touches something.
struct SessionCase {
  std::string name;
  const char* file;
  int ticks;
  bool touches_fixed_body;  ///< Else only what moves, which a method without physics does not know.
  std::vector<std::string> settings;
  std::vector<std::string> left_out;   ///< Methods that it cannot have.
  std::vector<std::string> unchanged;  ///< Methods that would show nothing new in it.
};

#if RTBUS_WITH_BULLET
std::string shown_mesh(const char* name) { return std::string(RTBUS_SOURCE_DIR) + "/config/scenes/meshes/" + name; }

/// A tip that goes down onto a hill of 64 triangles.
std::vector<std::string> on_a_mesh() {
  return {
      "scene={schema: scene/1, gravity_m_s2: [0, -9.81, 0], bodies: [{name: hill, type: static, friction: 0.5, "
      "shape: {mesh: {file: " +
          shown_mesh("hill.obj") + "}}}]}",
      "haptic.0.mapping={offset_m: [0, 0, 0]}",
      "haptic.0.device.hand={type: push, start_m: [0, 0.03, 0], direction: [0.2, -1, 0.1], distance_m: 0.02, "
      "speed_m_s: 0.05, start_s: 0.1}"};
}

/// A tip that pushes a free hull of six corners along the floor.
std::vector<std::string> at_a_hull() {
  return {
      "scene={schema: scene/1, gravity_m_s2: [0, -9.81, 0], bodies: [{name: floor, type: static, friction: 0.5, "
      "shape: {plane: {}}}, {name: gem, type: dynamic, mass_kg: 0.1, friction: 0.5, shape: {convex_hull: {file: " +
          shown_mesh("wedge.obj") + ", metres_per_unit: 0.001}}}]}",
      "haptic.0.mapping={offset_m: [0.015, 0.008, 0]}",
      "haptic.0.device.hand={type: push, start_m: [0, 0, 0.03], direction: [0, 0, -1], distance_m: 0.03, "
      "speed_m_s: 0.05, start_s: 0.1}"};
}

/// A tip that presses a pyramid of six boxes from above: with the proxy 42 unknowns, where Eigen works in blocks.
std::vector<std::string> on_a_pyramid() {
  std::string bodies = "{name: floor, type: static, friction: 0.5, shape: {plane: {}}}";
  for (int level = 0; level < 3; ++level) {
    for (int i = 0; i < 3 - level; ++i) {
      bodies += ", {name: box" + std::to_string(3 * level + i) +
                ", type: dynamic, mass_kg: 0.1, friction: 0.7, shape: {box: {size_m: [0.04, 0.03, 0.04]}}, "
                "position_m: [0, " +
                std::to_string(0.015 + 0.03 * level) + ", " + std::to_string(-0.041 * i - 0.0205 * level) + "]}";
    }
  }
  return {"scene={schema: scene/1, gravity_m_s2: [0, -9.81, 0], bodies: [" + bodies + "]}",
          "haptic.0.mapping={offset_m: [0, 0.1, -0.041]}",
          "haptic.0.device.hand={type: push, start_m: [0, 0, 0], direction: [0.1, -1, 0], distance_m: 0.015, "
          "speed_m_s: 0.05, start_s: 0.1}"};
}

/// Methods that do not look at a shape in the loop beyond what the other sessions show.
std::vector<std::string> shapeless() { return {"virtual_coupling", "interpolation", "interpolation_predicted"}; }
#endif

std::vector<SessionCase> sessions() {
  std::vector<SessionCase> out{
      {"wall", "wall.yaml", 10'000, true, {}, {}, {}},
      {"no_physics",
       "drop.yaml",
       10'000,
       true,
       {},
       {"remote_virtual_coupling", "local_contact", "interpolation", "interpolation_predicted"},
       {}},
      {"paper", "drop_paper.yaml", 10'000, true, {}, {"local_contact"}, {}},
  };
#if RTBUS_WITH_BULLET
  const std::vector<std::string> push{"haptic.0.device.hand.start_m=[0, 0, 0.008]", "haptic.0.device.hand.start_s=0.1",
                                      "haptic.0.device.hand.speed_m_s=0.02"};
  for (SessionCase each : {SessionCase{"free_block", "free_block.yaml", 2000, false, push, {}, {}},
                           SessionCase{"stack_125", "stack_125.yaml", 1500, false, push, {}, {}},
                           SessionCase{"soft", "soft.yaml", 2500, false, {}, {}, {}},
                           SessionCase{"two_hands", "two_hands.yaml", 2500, false, {}, {}, {}},
                           SessionCase{"mesh", "free_block.yaml", 1500, true, on_a_mesh(), {"direct"}, shapeless()},
                           SessionCase{"hull", "free_block.yaml", 1500, false, at_a_hull(), {}, shapeless()},
                           SessionCase{"pyramid", "free_block.yaml", 1500, false, on_a_pyramid(), {}, shapeless()}}) {
    out.push_back(each);
    // Results that cover many ticks and come late take other ways through a method; without physics there are none.
    each.name += "_physics_50_hz";
    each.settings.emplace_back("physics.throttle_hz=50");
    out.push_back(each);
  }
#endif
#if RTBUS_WITH_USB
  out.push_back(
      {"usb", "wall_virtual_phantom.yaml", 2500, true, {"physics={engine: analytic, rate_hz: 1000}"}, {}, {}});
#endif
  const std::vector<std::string> soon{"physics={engine: analytic, rate_hz: 1000}",
                                      "haptic.0.device.virtual.hand.start_s=0.1",
                                      "haptic.0.device.virtual.hand.speed_m_s=0.1"};
  // A driver does not know the method: one without physics and one with.
  const std::vector<std::string> others{"virtual_coupling", "local_contact", "interpolation",
                                        "interpolation_predicted"};
  out.push_back({"force_dimension", "wall_virtual_omega.yaml", 700, true, soon, {}, others});
  out.push_back({"openhaptics", "wall_virtual_touch.yaml", 700, true, soon, {}, others});
#if RTBUS_WITH_HAPLY
  out.push_back({"haply", "wall_virtual_inverse3.yaml", 700, true, soon, {}, others});
#endif
  return out;
}

struct Run {
  SessionCase session;
  std::string method;
};
void PrintTo(const Run& run, std::ostream* out) { *out << run.session.name << ' ' << run.method; }

rtbus::config::SessionConfig load(const SessionCase& session, const std::string& method) {
  std::vector<rtbus::config::Override> overrides{
      rtbus::config::parse_override("session=noalloc" + std::to_string(getpid()))};
  for (const std::string& text : session.settings) overrides.push_back(rtbus::config::parse_override(text));
  const std::string file = std::string(RTBUS_SOURCE_DIR) + "/config/" + session.file;
  auto out = rtbus::config::load_session(file, overrides);
  if (method.empty()) return out;
  for (const auto& entry : out.haptic) {
    overrides.push_back(rtbus::config::parse_override("haptic." + entry.name + ".method=" + method));
  }
  return rtbus::config::load_session(file, overrides);
}

/// One haptic node without its threads.
class Hand {
 public:
  Hand(rtbus::config::SessionConfig& session, std::size_t index)
      : config_(haptic::read_haptic_config(session, index)),
        device_(*config_.device->open({.session = session.session, .node_name = config_.name})),
        telemetry_(*rtbus::Publication<rtbus::Telemetry>::create(session.session, config_.name + ".telemetry")),
        link_(*rtbus::Publication<rtbus::DeviceState>::create(session.session, config_.name + ".device_state"),
              session.session, config_.name, needs_physics(), haptic::find_method(config_.method)->needs_contacts,
              config_.wire, config_.other_hands),
        loop_(config_, *device_, link_, true) {}
  ~Hand() { device_->stop(); }

  [[nodiscard]] const haptic::HapticConfig& config() const { return config_; }
  [[nodiscard]] bool needs_physics() const { return haptic::find_method(config_.method)->needs_physics; }
  [[nodiscard]] double peak_n() const { return peak_n_; }
  [[nodiscard]] std::uint64_t renewals() const { return telemetry_.renewals() + link_.device_state().renewals(); }

  void start(std::uint64_t now_ns) {
    const auto started = device_->start(now_ns);
    ASSERT_TRUE(started) << started.error().message;
    started_ns_ = last_ns_ = now_ns;
    pacer_.emplace(now_ns, config_.period_ns());
  }

  /// What the node's housekeeping does.
  void maintain() {
    link_.maintain();
    telemetry_.maintain();
    device_->maintain();
  }

  /// One round of Node::run_timer(), without the sleep.
  void cycle_on_timer(tests::Caught& caught) {
    const std::uint64_t now_ns = pacer_->due_ns();
    tests::RealtimeTrap trap(caught);
    loop_.cycle(now_ns, now_ns);
    after_cycle(now_ns);
    pacer_->advance(now_ns);
    loop_.count_schedule(pacer_->due(), pacer_->overruns());
  }

  /// One round of Node::run_device().
  void cycle_on_device(tests::Caught& caught) {
    tests::RealtimeTrap trap(caught);
    const auto waited = device_->wait_sample(last_ns_ + 2 * config_.period_ns());
    if (waited == drivers::IoStatus::kLost) rtbus::sleep_until(last_ns_ + config_.period_ns());
    last_ns_ = rtbus::monotonic_ns();
    loop_.cycle(0, last_ns_);
    after_cycle(last_ns_);
    ++served_;
    loop_.count_schedule(std::max(served_, (last_ns_ - started_ns_) / config_.period_ns()), 0);
  }

  [[nodiscard]] std::uint64_t now_ns() const { return paced_by_device() ? rtbus::monotonic_ns() : pacer_->due_ns(); }
  [[nodiscard]] bool paced_by_device() const { return config_.clock == haptic::LoopClock::kDevice; }

 private:
  void after_cycle(std::uint64_t now_ns) {
    telemetry_.publish(loop_.telemetry(), now_ns);
    while (loop_.take_event() != haptic::LoopEvent::kNone) events_.push(now_ns, 1);
    const rtbus::Vec3& force_n = loop_.telemetry().force_n;
    peak_n_ = std::max(peak_n_, std::hypot(force_n[0], force_n[1], force_n[2]));
  }

  haptic::HapticConfig config_;
  std::unique_ptr<drivers::Device> device_;
  rtbus::Publication<rtbus::Telemetry> telemetry_;
  haptic::BusLink link_;
  haptic::Loop loop_;
  rtbus::EventLog events_;
  std::optional<rtbus::Pacer> pacer_;
  std::uint64_t started_ns_ = 0, last_ns_ = 0, served_ = 0;
  double peak_n_ = 0.0;
};

/// The other end, in the same thread between two cycles: the engine of the session, at its rate.
class Physics {
 public:
  explicit Physics(rtbus::config::SessionConfig& session)
      : config_(physics::read_node_config(session)),
        stepper_(physics::make_world(config_.physics.engine, config_.scene, config_.physics.engine_settings()),
                 config_.proxies, config_.physics.parts_per_step(), config_.shape_hash()),
        beat_(*rtbus::Writer<rtbus::Heartbeat>::create(session.session, "physics.heartbeat")) {
    for (const physics::ProxyConfig& proxy : config_.proxies) {
      const std::string& name = proxy.device;
      hands_.push_back(
          std::make_unique<rtbus::Subscription<rtbus::DeviceState>>(session.session, name + ".device_state"));
      proxies_.push_back(*rtbus::Writer<rtbus::ProxyState>::create(session.session, "physics.proxy_state." + name));
      contacts_.push_back(*rtbus::Writer<rtbus::ProxyContacts>::create(session.session, "physics.contacts." + name));
    }
  }

  void maintain() {
    for (const auto& hand : hands_) hand->maintain();
  }

  /// Beats, and takes the step that is due, if one is. A throttled result is held until the period is over.
  void advance_to(std::uint64_t now_ns) {
    rtbus::Heartbeat alive;
    alive.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
    beat_.publish(alive, now_ns);
    if (now_ns < due_ns_) return;
    const bool throttled = config_.physics.throttle_hz.has_value();
    if (throttled && stepper_.steps() > 0) publish(now_ns);
    for (std::size_t i = 0; i < hands_.size(); ++i) {
      rtbus::Stamped<rtbus::DeviceState> seen;
      if (hands_[i]->read_latest(seen) == rtbus::ReadStatus::kFresh) stepper_.set_device(i, seen.value, seen.sequence);
    }
    stepper_.step(config_.physics.step_s());
    if (!throttled) publish(now_ns);
    const auto period_ns = static_cast<std::uint64_t>(std::llround(config_.physics.step_s() * 1e9));
    due_ns_ = (due_ns_ == 0 ? now_ns : due_ns_) + period_ns;
  }

 private:
  void publish(std::uint64_t now_ns) {
    for (std::size_t i = 0; i < hands_.size(); ++i) {
      proxies_[i].publish(stepper_.answer(i), now_ns);
      if (!stepper_.wants_contacts(i)) continue;
      stepper_.contacts(i, 0.0, around_);
      contacts_[i].publish(around_, now_ns);
    }
  }

  physics::NodeConfig config_;
  physics::Stepper stepper_;
  rtbus::Writer<rtbus::Heartbeat> beat_;
  std::vector<std::unique_ptr<rtbus::Subscription<rtbus::DeviceState>>> hands_;
  std::vector<rtbus::Writer<rtbus::ProxyState>> proxies_;
  std::vector<rtbus::Writer<rtbus::ProxyContacts>> contacts_;
  rtbus::ProxyContacts around_;
  std::uint64_t due_ns_ = 0;
};

class LoopOnTheBus : public testing::TestWithParam<Run> {};

TEST_P(LoopOnTheBus, NeitherAllocatesNorLocks) {
  const SessionCase& session = GetParam().session;
  auto settings = load(session, GetParam().method);
  std::vector<std::unique_ptr<Hand>> hands;
  for (std::size_t i = 0; i < settings.haptic.size(); ++i) hands.push_back(std::make_unique<Hand>(settings, i));
  std::optional<Physics> physics;
  if (hands.front()->needs_physics()) physics.emplace(settings);
  for (const auto& hand : hands) hand->maintain();
  if (physics) physics->maintain();
  // Readers refuse stamps of the future, and the loop gives no force when it is late: a tick takes a period by the
  // clock of this process too, however slow the engine is.
  const bool simulated_time = !hands.front()->paced_by_device();
  const std::uint64_t start_ns = rtbus::monotonic_ns();
  for (const auto& hand : hands) ASSERT_NO_FATAL_FAILURE(hand->start(start_ns));
  const SimulatedClock clock;

  tests::Caught caught;
  for (int tick = 0; tick < session.ticks; ++tick) {
    if (simulated_time) SimulatedClock::set(hands.front()->now_ns());
    if (physics) physics->advance_to(hands.front()->now_ns());
    // Somebody deletes the topics: housekeeping makes them anew, the loop writes old and new ones, then lets go.
    if (tick == session.ticks / 3) {
      for (const auto& hand : hands) {
        for (const char* subject : {".device_state", ".telemetry"}) {
          const std::string name = rtbus::segment_name(settings.session.name, hand->config().name + subject);
          ASSERT_EQ(unlink(("/dev/shm/" + name).c_str()), 0);
        }
      }
    }
    const bool house = tick > session.ticks / 4 && tick % 20 == 0;
    if (house && physics) physics->maintain();
    for (const auto& hand : hands) {
      if (house) hand->maintain();
      hand->paced_by_device() ? hand->cycle_on_device(caught) : hand->cycle_on_timer(caught);
    }
  }
  EXPECT_EQ(caught.allocations, 0u) << caught.where();
  EXPECT_EQ(caught.locks, 0u) << caught.where();
  for (const auto& hand : hands) {
    EXPECT_EQ(hand->renewals(), 2u);
    if (!physics && !session.touches_fixed_body) continue;
    EXPECT_GT(hand->peak_n(), 0.1) << "the run must have touched something, else it proves little";
  }
}

// Nothing is left out that a session would take.
TEST(LoopOnTheBusLeavesOut, OnlyMethodsThatTheSessionRefuses) {
  for (const SessionCase& session : sessions()) {
    for (const std::string& method : session.left_out) {
      auto settings = load(session, method);
      EXPECT_THROW((void)haptic::read_haptic_config(settings, 0), rtbus::config::Error) << session.name << method;
    }
  }
}

std::vector<Run> runs() {
  std::vector<Run> out;
  for (const SessionCase& session : sessions()) {
    for (const haptic::MethodEntry& method : haptic::registered_methods()) {
      const auto has = [&](const auto& names) {
        return std::find(names.begin(), names.end(), method.name) != names.end();
      };
      if (has(session.left_out) || has(session.unchanged)) continue;
      const bool slow = session.name.ends_with("50_hz");
      if (method.needs_physics || !slow) out.push_back({session, std::string(method.name)});
    }
  }
  return out;
}

INSTANTIATE_TEST_SUITE_P(Sessions, LoopOnTheBus, testing::ValuesIn(runs()),
                         [](const auto& run) { return run.param.session.name + "_" + run.param.method; });

}  // namespace
// Before the C library's: this program exports its symbols.
extern "C" int clock_gettime(clockid_t clock, timespec* out) noexcept {
  const std::uint64_t now_ns = SimulatedClock::now_ns();
  if (clock != CLOCK_MONOTONIC || now_ns == 0) return static_cast<int>(syscall(SYS_clock_gettime, clock, out));
  out->tv_sec = static_cast<time_t>(now_ns / rtbus::kNsPerS);
  out->tv_nsec = static_cast<long>(now_ns % rtbus::kNsPerS);
  return 0;
}
#endif
