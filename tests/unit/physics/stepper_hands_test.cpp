/// Two hands that press one body between them: what a step gives it of each.
#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "physics_node/stepper.hpp"
#include "rtbus/clock.hpp"

namespace {

using Eigen::Vector3d;
using physics::Stepper;

constexpr double kLong_s = 0.010, kHand_n = 0.5;
constexpr std::uint64_t kMs = rtbus::kNsPerMs;

/// What each hand gave the body in the last step, and the moment of it about the body's centre of mass.
struct Given {
  std::array<double, 2> n_s{};
  Vector3d angular_n_m_s = Vector3d::Zero();
  Vector3d own_from_centre_m = Vector3d::Zero();  ///< As contacts() tell it.
};

/// One body, which stands on its side.
class PushedWorld final : public physics::World {
 public:
  explicit PushedWorld(Given& given) : given_(given) {}
  std::size_t add_proxy(const physics::ProxyParameters&) override { return proxies_++; }
  void reset_proxy(std::size_t, const Vector3d&) override {}
  void release_proxy(std::size_t) override {}
  void place_proxy(std::size_t, const Vector3d&, const Vector3d&) override {}
  void apply_hand_force(std::size_t proxy, std::size_t, const Vector3d& force_n, const Vector3d& torque_n_m) override {
    push_n_[proxy] += force_n.x();
    torque_n_m_ += torque_n_m;
  }
  void set_proxy_target(std::size_t, const physics::ProxyTarget&) override {}
  void step(double step_s) override {
    for (std::size_t i = 0; i < push_n_.size(); ++i) given_.n_s[i] = push_n_[i] * step_s;
    given_.angular_n_m_s = step_s * torque_n_m_;
    push_n_ = {};
    torque_n_m_.setZero();
  }
  [[nodiscard]] physics::ProxyReadout proxy(std::size_t) const override { return {}; }
  void contacts(std::size_t, double, physics::ContactSet& out) const override {
    out = {};
    out.bodies.emplace_back().kind = physics::BodyKind::kDynamic;
    out.bodies[0].own_from_centre_m = given_.own_from_centre_m;
  }
  [[nodiscard]] std::size_t bodies() const noexcept override { return 1; }
  [[nodiscard]] physics::BodyPose body_pose(std::size_t) const override {
    return {Vector3d::Zero(), Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitX(), Vector3d::UnitY())};
  }
  [[nodiscard]] std::size_t awake_bodies() const noexcept override { return 1; }
  [[nodiscard]] std::size_t solved_contacts() const noexcept override { return 0; }
  [[nodiscard]] std::vector<std::string> warnings(double) const override { return {}; }

 private:
  Given& given_;
  std::array<double, 2> push_n_{};
  Vector3d torque_n_m_ = Vector3d::Zero();
  std::size_t proxies_ = 0;
};

class TwoHandsAtOneBody : public testing::Test {
 protected:
  static std::vector<physics::ProxyConfig> hands() {
    std::vector<physics::ProxyConfig> out(2);
    out[0].device = "left";
    out[1].device = "right";
    return out;
  }
  /// A hand that has pushed for so long, told in its sample of then.
  static rtbus::DeviceState pushed_until(std::size_t hand, std::uint64_t time_ms) {
    rtbus::DeviceState out;
    out.enabled = 1;
    out.wants = rtbus::kOwnsProxy;
    out.sample_time_ns = 1000 * kMs + time_ms * kMs;
    out.hand_impulse_generation[0] = 1;
    out.hand_impulse_n_s[0] = {(hand == 0 ? kHand_n : -kHand_n) * 1e-3 * static_cast<double>(time_ms), 0, 0};
    return out;
  }
  /// Each hand tells every two milliseconds, and its last sample.
  void step(std::uint64_t left_ms, std::uint64_t right_ms) {
    tell(0, left_ms);
    tell(1, right_ms);
    stepper_.step(kLong_s);
  }
  void tell(std::size_t hand, std::uint64_t until_ms) {
    while (told_ms_[hand] < until_ms) {
      ++told_ms_[hand];
      const bool tells = told_ms_[hand] < until_ms && told_ms_[hand] % 2 == 0;
      if (tells) stepper_.hear(hand, pushed_until(hand, told_ms_[hand]));
    }
    stepper_.set_device(hand, pushed_until(hand, until_ms), ++sequence_);
  }

  std::array<std::uint64_t, 2> told_ms_{};
  Given given_;
  Stepper stepper_{std::make_unique<PushedWorld>(given_), hands(), 1};
  std::uint64_t sequence_ = 0;
};

TEST_F(TwoHandsAtOneBody, PushItEquallyLongWhenTheLastSampleOfOneIsLost) {
  step(0, 0);
  step(10, 10);
  EXPECT_NEAR(given_.n_s[0], 10e-3 * kHand_n, 1e-9);
  EXPECT_NEAR(given_.n_s[1], -10e-3 * kHand_n, 1e-9);
  step(20, 19);
  EXPECT_NEAR(given_.n_s[0], 9e-3 * kHand_n, 1e-6);
  EXPECT_NEAR(given_.n_s[0] + given_.n_s[1], 0.0, 1e-6);
  double left_n_s = 0.0;
  for (std::uint64_t i = 3; i < 10; ++i) {
    step(10 * i, 10 * i);
    EXPECT_NEAR(given_.n_s[0] + given_.n_s[1], 0.0, 1e-6) << i;
    left_n_s += given_.n_s[0];
  }
  EXPECT_NEAR(left_n_s, 70e-3 * kHand_n, 1e-3 * kHand_n) << "what waited is given later, but for a tick at most";
}

// A box that is all but tipped over rocks under blows. Samples of a steady push that get lost after a first gap are
// none.
TEST_F(TwoHandsAtOneBody, PushEvenlyThoughTwoSamplesInARowAreLost) {
  constexpr double kShort_s = 1e-3;
  std::uint64_t heard_ms = 0;
  double least_n_s = 1.0, most_n_s = 0.0, sum_n_s = 0.0;
  constexpr std::uint64_t kFrom_ms = 100, kTo_ms = 1000;
  for (std::uint64_t ms = 1; ms <= kTo_ms; ++ms) {
    const bool lost = ms % 100 == 0 || ms % 100 == 1 || ms % 53 == 0;
    if (!lost) heard_ms = ms;
    for (std::size_t hand = 0; hand < 2; ++hand) stepper_.set_device(hand, pushed_until(hand, heard_ms), heard_ms);
    stepper_.step(kShort_s);
    if (ms < kFrom_ms + 10) continue;
    least_n_s = std::min(least_n_s, given_.n_s[0]);
    most_n_s = std::max(most_n_s, given_.n_s[0]);
    sum_n_s += given_.n_s[0];
  }
  EXPECT_GT(least_n_s, 0.85 * kShort_s * kHand_n);
  EXPECT_LT(most_n_s, 1.15 * kShort_s * kHand_n);
  EXPECT_NEAR(sum_n_s, 1e-3 * kHand_n * (kTo_ms - kFrom_ms - 9), 3e-3 * kHand_n) << "nothing is lost";
}

TEST_F(TwoHandsAtOneBody, DoNotWaitForOneThatHasEnded) {
  step(0, 0);
  step(10, 10);
  step(20, 10);
  EXPECT_NEAR(given_.n_s[0], 10e-3 * kHand_n, 1e-6);
  EXPECT_EQ(given_.n_s[1], 0.0);
}

// Meanwhile what they hold falls.
TEST_F(TwoHandsAtOneBody, WaitTwoTicksForOneThatHasEnded) {
  constexpr double kShort_s = 1e-3;
  constexpr std::uint64_t kEnds_ms = 100;
  int waited = 0;
  for (std::uint64_t ms = 1; ms <= kEnds_ms + 20; ++ms) {
    tell(0, ms);
    tell(1, std::min(ms, kEnds_ms));
    stepper_.step(kShort_s);
    if (ms > kEnds_ms && given_.n_s[0] < 0.5 * kShort_s * kHand_n) ++waited;
  }
  EXPECT_EQ(waited, 2);
}

// Its pause was no gap between samples.
TEST_F(TwoHandsAtOneBody, WaitTwoTicksAlsoForOneThatHadPaused) {
  constexpr double kShort_s = 1e-3;
  constexpr std::uint64_t kPauses_ms = 50, kBack_ms = 5000, kEnds_ms = 5100;
  int waited = 0;
  for (std::uint64_t ms = 1; ms <= kEnds_ms + 20; ++ms) {
    tell(0, ms);
    if (ms == kPauses_ms) stepper_.release(1);
    if (ms == kBack_ms) told_ms_[1] = ms - 1;
    if (ms < kPauses_ms || ms >= kBack_ms) tell(1, std::min(ms, kEnds_ms));
    stepper_.step(kShort_s);
    if (ms > kEnds_ms && given_.n_s[0] < 0.5 * kShort_s * kHand_n) ++waited;
  }
  EXPECT_EQ(waited, 2);
}

// The hand knows a body and what it carries as one, by their centre of mass.
TEST_F(TwoHandsAtOneBody, PushItAboutTheCentreThatWasToldLast) {
  given_.own_from_centre_m = {0, -0.02, 0.01};
  step(0, 0);
  rtbus::ProxyContacts told;
  stepper_.contacts(0, 0.01, told);
  step(10, 0);
  const Vector3d push_n_s(given_.n_s[0], 0, 0);
  ASSERT_NEAR(push_n_s.x(), kHand_n * kLong_s, 1e-9);
  EXPECT_LT((given_.angular_n_m_s + given_.own_from_centre_m.cross(push_n_s)).norm(), 1e-9);
}

}  // namespace
