// A time-domain passivity controller at the far end of the network, as a prototype: what it would do to the cases that
// the lag of the set-point calms (decision 0021).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/eigen.hpp"
#include "tools/evaluation/network/network.hpp"
#include "tools/harness/forwarding_world.hpp"
#include "tools/harness/harness.hpp"

namespace {

using Eigen::Vector3d;

const std::string kWall = std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml";

/// What both ends know of the energy.
struct Channel {
  std::vector<double> from_hand_j;  ///< Sum that the hand has put in, per tick of 1 ms.
  double way_s = 0.0;               ///< Until the far end knows.
  bool acts = false;
  double least_j = 0.0;     ///< W_r, see below.
  double farthest_m = 0.0;  ///< Of the target from where the hand wants it.
};

/// Admittance form (J.-H. Ryu, J. Artigas, C. Preusche, Mechatronics 20(7), 2010): the far spring's target moves less
/// where the channel would give more than the hand has supplied, W_r = E_in,h(t − T) − E_out,r + E_diss < 0. What it
/// was held back by is given back while W_r > 0.
class FarEnd final : public tools::ForwardingWorld {
 public:
  FarEnd(std::unique_ptr<physics::World> world, Channel& channel)
      : ForwardingWorld(std::move(world)), channel_(channel) {}

  void reset_proxy(std::size_t proxy, const Vector3d& position_m) override {
    ForwardingWorld::reset_proxy(proxy, position_m);
    held_back_m_.setZero();
    primed_ = false;
  }
  void set_proxy_target(std::size_t proxy, const physics::ProxyTarget& target) override {
    wanted_m_ = target.position_m;
    physics::ProxyTarget held = target;
    held.position_m += held_back_m_;
    ForwardingWorld::set_proxy_target(proxy, held);
  }
  void step(double step_s) override {
    ForwardingWorld::step(step_s);
    now_s_ += step_s;
    const Vector3d force_n = proxy(0).coupling_force_n;
    if (primed_) control(force_n, step_s);
    channel_.farthest_m = std::max(channel_.farthest_m, held_back_m_.norm());
    target_m_ = wanted_m_ + held_back_m_;
    primed_ = true;
  }

 private:
  static constexpr double kReturn_m_s = 0.05;
  static constexpr double kLeastForce_n = 1e-3;

  void control(const Vector3d& force_n, double step_s) {
    given_j_ += std::max(0.0, force_n.dot(wanted_m_ + held_back_m_ - target_m_));
    const auto tick = static_cast<std::size_t>(std::max(0.0, 1e3 * (now_s_ - channel_.way_s)));
    const auto& told = channel_.from_hand_j;
    const double supplied_j = told.empty() ? 0.0 : told[std::min(tick, told.size() - 1)];
    const double left_j = supplied_j - given_j_ + dissipated_j_;
    channel_.least_j = std::min(channel_.least_j, left_j);
    if (!channel_.acts || force_n.norm() < kLeastForce_n) return;
    Vector3d way_m = Vector3d::Zero();
    if (left_j < 0.0) {
      way_m = left_j / force_n.squaredNorm() * force_n;
    } else if (!held_back_m_.isZero(0.0)) {
      way_m = -held_back_m_ * std::min(1.0, kReturn_m_s * step_s / held_back_m_.norm());
      if (const double cost_j = way_m.dot(force_n); cost_j > left_j) way_m *= left_j / cost_j;
    }
    held_back_m_ += way_m;
    dissipated_j_ -= way_m.dot(force_n);
  }

  Channel& channel_;
  bool primed_ = false;
  double now_s_ = 0.0, given_j_ = 0.0, dissipated_j_ = 0.0;
  Vector3d wanted_m_ = Vector3d::Zero(), target_m_ = Vector3d::Zero(), held_back_m_ = Vector3d::Zero();
};

/// Of the force at the end, peak to peak: the median window of the last quarter.
double swing_n(std::uint64_t seed, bool lag, Channel& channel) {
  const tools::StabilityCase each = tools::draw_network_case(seed);
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments_of(each)) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(kWall, overrides);
  tools::HarnessOptions options = link_of(each);
  options.echo_lag = lag;
  channel.way_s = each.network.out_share * each.network.round_trip_s;
  options.around_world = [&channel](std::unique_ptr<physics::World> world) -> std::unique_ptr<physics::World> {
    return std::make_unique<FarEnd>(std::move(world), channel);
  };
  tools::Harness harness(session, options);
  const double window_s = 2.0 * each.longest_round_trip_s();
  double from_s = each.end_s(), low_n = 1e9, high_n = -1e9, supplied_j = 0.0;
  Vector3d tip_m = Vector3d::Zero(), force_n = Vector3d::Zero();
  std::vector<double> windows_n;
  harness.run(each.end_s() + 20.0 * each.longest_round_trip_s(), [&](const rtbus::Telemetry& tick) {
    const Vector3d now_m = rtbus::vector_of(tick.position_m);
    if (!channel.from_hand_j.empty()) supplied_j += std::max(0.0, -force_n.dot(now_m - tip_m));
    channel.from_hand_j.push_back(supplied_j);
    tip_m = now_m;
    force_n = rtbus::vector_of(tick.force_n);
    if (harness.now_s() < each.end_s()) return;
    low_n = std::min(low_n, force_n.y());
    high_n = std::max(high_n, force_n.y());
    if (harness.now_s() - from_s < window_s) return;
    windows_n.push_back(high_n - low_n);
    from_s = harness.now_s();
    low_n = 1e9;
    high_n = -1e9;
  });
  const auto late = windows_n.end() - static_cast<long>(windows_n.size() / 4);
  std::sort(late, windows_n.end());
  return *(late + (windows_n.end() - late) / 2);
}

// Three of the four echoes never take more than the hand has put in: there is nothing for a controller to act on. The
// lag more than halves each.
TEST(FarEnd, HasNothingToActOnInAnEcho) {
  for (const std::uint64_t seed : {500u, 1432u, 8532u}) {
    Channel without, with;
    without.acts = true;
    const double swings_n = swing_n(seed, false, without);
    EXPECT_GT(swings_n, 0.1) << seed;
    EXPECT_GT(without.least_j, -1e-6) << seed;
    EXPECT_LT(without.farthest_m, 1e-6) << seed;
    EXPECT_LT(swing_n(seed, true, with), 0.5 * swings_n) << seed;
  }
}

// In the fourth it acts, moves the proxy away from the hand, and does not calm it.
TEST(FarEnd, ActsInTheFourthAndDoesNotCalmIt) {
  Channel observes, acts, lags;
  acts.acts = true;
  EXPECT_GT(swing_n(6901, false, observes), 1.0);
  EXPECT_LT(observes.least_j, -10e-3);
  EXPECT_GT(swing_n(6901, false, acts), 1.0);
  EXPECT_GT(acts.least_j, -1e-3);
  EXPECT_GT(acts.farthest_m, 0.2e-3);
  EXPECT_LT(swing_n(6901, true, lags), 0.2);
}

}  // namespace
