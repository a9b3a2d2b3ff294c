/// What a hand feels when its device was away for a second in mid-push: the hand is deep in the wall by then, and the
/// ladder lets the force come back.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "haptic_node/node_config.hpp"
#include "haptic_node/safety.hpp"
#include "haptic_node/velocity.hpp"

namespace device_return {

using Eigen::Vector3d;

constexpr double kDt_s = 1e-3;
/// What one encoder step may make of the damper, or of the allowance of the energy limit.
constexpr double kNoise_n = 0.05;

/// A tip in a hand that goes 6 mm into a wall at y = 0: config/devices/virtual_omega.yaml.
class PushedTip {
 public:
  explicit PushedTip(double starts_s) : starts_s_(starts_s) {}
  [[nodiscard]] double measured_m() const { return std::round(y_m_ / kQuantum_m) * kQuantum_m; }
  void advance(double force_n, double now_s) {
    constexpr double h = 1e-4;
    for (int i = 0; i < 10; ++i) {
      const double way_m = std::clamp(0.05 * (now_s + i * h - starts_s_), 0.0, 0.018);
      const double hand_m_s = way_m > 0.0 && way_m < 0.018 ? -0.05 : 0.0;
      const double pull_n = force_n + kHand_n_per_m * (0.012 - way_m - y_m_) + kHand_n_s_per_m * hand_m_s;
      const double momentum = kMass_kg * v_m_s_ + h * pull_n;
      const double held = std::abs(momentum) <= h * kCoulomb_n ? 0.0 : 1.0 - h * kCoulomb_n / std::abs(momentum);
      v_m_s_ = held * momentum / (kMass_kg + h * (0.3 + kHand_n_s_per_m) + h * h * kHand_n_per_m);
      y_m_ += h * v_m_s_;
    }
  }

 private:
  static constexpr double kQuantum_m = 10e-6, kMass_kg = 0.15 + 0.08, kCoulomb_n = 0.05;
  static constexpr double kHand_n_per_m = 300.0, kHand_n_s_per_m = 3.0;
  double starts_s_;
  double y_m_ = 0.012, v_m_s_ = 0.0;
};

struct Return {
  double growth_n = 0.0;  ///< Most in one tick, from the loss on.
  double end_n = 0.0;
};

Return lose_for_a_second(const haptic::HapticConfig& config, double at_s) {
  const double stiffness_n_per_m = config.stiffness_n_per_m, damping_n_s_per_m = config.damping_n_s_per_m;
  haptic::SafetyLadder ladder(config.safety);
  haptic::VelocityEstimator velocity(config.velocity);
  PushedTip tip(0.1);
  Return out;
  for (int tick = 0; tick < 4000; ++tick) {
    const double now_s = tick * kDt_s;
    const bool lost = now_s > at_s && now_s < at_s + 1.0;
    haptic::SafetyInput input;
    input.now_ns = input.sample_time_ns = 1'000'000'000 + static_cast<std::uint64_t>(tick) * 1'000'000;
    input.dt_s = kDt_s;
    input.position_m.y() = tip.measured_m();
    input.enabled = input.device_ok = !lost;
    input.link_alive = true;
    if (lost) velocity.reset();
    if (!lost) input.velocity_m_s = velocity.update(input.position_m, input.sample_time_ns);
    if (const double depth_m = -input.position_m.y(); depth_m > 0.0) {
      input.force_n.y() = std::max(0.0, stiffness_n_per_m * depth_m - damping_n_s_per_m * input.velocity_m_s.y());
    }
    const double force_n = ladder.apply(input).force_n.y();
    if (lost) ladder.not_sent();
    const double felt_n = lost ? 0.0 : force_n;
    if (now_s > at_s) out.growth_n = std::max(out.growth_n, felt_n - out.end_n);
    out.end_n = felt_n;
    tip.advance(felt_n, now_s);
  }
  return out;
}

// Where the hand has not supplied the energy of the wall, its limit holds the force back. What it lets through to a
// hand that moves must not rattle with the estimate of the speed.
TEST(ReturnOfADevice, GrowsByTheRampAndNotByTheNoiseOfTheEncoders) {
  auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/wall_virtual_omega.yaml");
  const haptic::HapticConfig config = haptic::read_haptic_config(session, 0);
  const double whole_n = config.stiffness_n_per_m * 0.006;
  for (int phase = 0; phase < 20; ++phase) {
    const Return felt = lose_for_a_second(config, 0.34 + 0.006 * phase + 0.00037 * (phase % 3));
    EXPECT_LE(felt.growth_n, whole_n * kDt_s / config.safety.start_ramp_s + kNoise_n) << "phase " << phase;
    EXPECT_GT(felt.end_n, 0.7) << "it is whole again, phase " << phase;
  }
}

}  // namespace device_return
