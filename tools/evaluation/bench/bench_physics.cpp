#include "tools/evaluation/bench/bench_physics.hpp"

#include <time.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <vector>

#include "haptic_node/node_config.hpp"
#include "physics_node/engine_registry.hpp"
#include "physics_node/node_config.hpp"
#include "physics_node/stepper.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/config/vector3.hpp"

namespace tools {

namespace {

constexpr double kSettle_s = 0.1;     // contacts are made, nothing sleeps yet
constexpr double kPatience_s = 20.0;  // simulated, until all sleep
constexpr double kStroke_m = 0.06;    // of the hand
constexpr double kAsleepRatio = 5.0;

double thread_cpu_ms() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) * 1e3 + static_cast<double>(time.tv_nsec) * 1e-6;
}

struct Cost {
  double p50_ms = 0.0, p99_ms = 0.0;
  std::size_t awake = 0, contacts = 0;  ///< After the last step.
};

Cost cost_of(std::vector<double> steps_ms, const physics::World& world) {
  std::sort(steps_ms.begin(), steps_ms.end());
  const auto at = [&](double share) { return steps_ms[static_cast<std::size_t>(share * double(steps_ms.size() - 1))]; };
  return {at(0.50), at(0.99), world.awake_bodies(), world.solved_contacts()};
}

/// One session's world and proxy, as its physics node has them.
class Bench {
 public:
  Bench(const std::string& file, const std::vector<std::string>& assignments, bool may_sleep) {
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
    rtbus::config::SessionConfig session = rtbus::config::load_session(file, overrides);
    centre_m_ = haptic::read_haptic_config(session, 0).mapping.offset_m;
    physics::NodeConfig config = physics::read_node_config(session);
    if (!may_sleep) config.scene.deactivation.enabled = false;
    physics_ = config.physics;
    stepper_ = std::make_unique<physics::Stepper>(
        physics::make_world(physics_.engine, config.scene, physics_.engine_settings()),
        std::vector<physics::ProxyConfig>{config.proxies[0]}, physics_.parts_per_step());
    hand_.enabled = 1;
    place_hand(0.0);
  }

  [[nodiscard]] const physics::PhysicsConfig& physics() const noexcept { return physics_; }
  [[nodiscard]] const physics::World& world() const noexcept { return stepper_->world(); }

  void run(double seconds) {
    for (double t = 0.0; t < seconds; t += physics_.step_s()) stepper_->step(physics_.step_s());
  }

  /// Until all sleep. @returns false when that does not come.
  bool fall_asleep() {
    for (double t = 0.0; t < kPatience_s; t += physics_.step_s()) {
      stepper_->step(physics_.step_s());
      if (world().awake_bodies() == 0) return true;
    }
    return false;
  }

  Cost measure(int steps, bool push) {
    std::vector<double> steps_ms;
    hand_.target_velocity_m_s[2] = push ? -kStroke_m / (steps * physics_.step_s()) : 0.0;
    for (int i = 0; i < steps; ++i) {
      if (push) place_hand((i + 1.0) / steps);
      const double before_ms = thread_cpu_ms();
      stepper_->step(physics_.step_s());
      steps_ms.push_back(thread_cpu_ms() - before_ms);
    }
    return cost_of(std::move(steps_ms), world());
  }

 private:
  void place_hand(double done) {
    hand_.target_position_m = {centre_m_.x(), centre_m_.y(), centre_m_.z() + (0.5 - done) * kStroke_m};
    stepper_->set_device(0, hand_, ++sequence_);
  }

  physics::PhysicsConfig physics_;
  std::unique_ptr<physics::Stepper> stepper_;
  Eigen::Vector3d centre_m_ = Eigen::Vector3d::Zero();
  rtbus::DeviceState hand_;
  std::uint64_t sequence_ = 0;
};

}  // namespace

void bench_physics(const BenchPhysicsOptions& options, Experiment& experiment) {
  Table table{
      "step_time", {"session", "state", "period [ms]", "p50 [ms]", "p99 [ms]", "awake bodies", "contact points"}, {}};
  for (const std::string& file : options.session_files) {
    const std::string name = std::filesystem::path(file).stem().string();
    const auto add = [&](const char* state, double period_ms, const Cost& cost) {
      table.rows.push_back(
          {name, std::string(state), period_ms, cost.p50_ms, cost.p99_ms, double(cost.awake), double(cost.contacts)});
    };
    Bench restless(file, options.assignments, false);
    const double period_ms = restless.physics().step_s() * 1e3;
    restless.run(kSettle_s);
    const Cost awake = restless.measure(options.steps, false);
    add("awake", period_ms, awake);

    Bench quiet(file, options.assignments, true);
    const bool sleeps = quiet.fall_asleep();
    const Cost asleep = quiet.measure(options.steps, false);
    add(sleeps ? "asleep" : "not asleep", period_ms, asleep);
    // The push wakes what it touches, and what that touches.
    const Cost pushed = quiet.measure(options.steps, true);
    add("pushed", period_ms, pushed);

    experiment.check_at_least(name + ".asleep_ratio", name + ": step time awake over asleep",
                              awake.p50_ms / asleep.p50_ms, "", kAsleepRatio);
    experiment.check_at_most(name + ".awake_p99", name + ": step awake, p99", awake.p99_ms, "ms", period_ms);
    experiment.check_at_most(name + ".pushed_p99", name + ": step while pushed, p99", pushed.p99_ms, "ms", period_ms);
  }
  experiment.add_table(std::move(table));
  experiment.note("CPU time of the stepping thread, one core; other work on the machine still costs caches and clock");
}

}  // namespace tools
