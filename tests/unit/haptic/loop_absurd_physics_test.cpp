// A physics that says absurd things, or answers a hand of long ago: the hand feels nothing of it, and everything again
// once it talks sense.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "haptic_node/loop.hpp"
#include "rtbus/config/session.hpp"
#include "tests/support/held_device.hpp"

namespace {

constexpr std::uint64_t kPeriod_ns = 1'000'000;

/// Answers a sample in every cycle with the proxy that the test wants: the last one, or one of `lag_ns` ago.
class TalkingPhysics final : public haptic::PhysicsLink {
 public:
  void send(const rtbus::DeviceState& state, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING override {
    proxy_.stamp_ns = now_ns;
    ++proxy_.sequence;
    proxy_.value.device_sequence = proxy_.sequence;
    sample_time_ns_ = state.sample_time_ns;
    proxy_.value.mapping_epoch = state.mapping_epoch;
    proxy_.value.step_s = 1e-3;
    ++proxy_.value.step_index;
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyState>& out) noexcept RTBUS_NONBLOCKING override {
    if (silent || proxy_.sequence == 0) return false;
    out = proxy_;
    out.value.device_time_ns = sample_time_ns_ - lag_ns;
    out.value.mapping_epoch ^= epoch_bits;
    out.value.position_m = position_m;
    out.value.hand_force_n = hand_force_n;
    out.value.coupling_work_j = coupling_work_j;
    return true;
  }
  /// There is nothing near the tool.
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyContacts>& out) noexcept RTBUS_NONBLOCKING override {
    if (silent || proxy_.sequence == 0) return false;
    out = {};
    out.sequence = proxy_.sequence;
    out.stamp_ns = proxy_.stamp_ns;
    out.value.device_sequence = proxy_.value.device_sequence;
    out.value.device_time_ns = sample_time_ns_ - contacts_lag_ns;
    out.value.mapping_epoch = proxy_.value.mapping_epoch;
    out.value.shape_hash = shape_hash;
    return true;
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::Heartbeat>& out) noexcept RTBUS_NONBLOCKING override {
    if (silent || proxy_.sequence == 0) return false;
    out.stamp_ns = proxy_.stamp_ns;
    out.value.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
    out.value.work_period_ns = step_ns;
    return true;
  }

  rtbus::Vec3 position_m{};
  rtbus::Vec3 hand_force_n{};
  double coupling_work_j = 0.0;
  bool silent = false;
  std::uint64_t lag_ns = 0, contacts_lag_ns = 0;
  std::uint32_t epoch_bits = 0;        ///< Wrong ones.
  std::uint64_t shape_hash = 0;        ///< Of its scene.
  std::uint64_t step_ns = kPeriod_ns;  ///< That it declares.

 private:
  std::uint64_t sample_time_ns_ = 0;
  rtbus::Stamped<rtbus::ProxyState> proxy_{};
};

class AbsurdPhysics : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override { link_.shape_hash = config_.shape_hash; }
  void talk_sense() {
    link_.position_m = {0.0, 0.001, 0.0};  // 1 mm above the hand
    link_.hand_force_n = {0.0, 0.2, 0.0};
  }
  void run(int cycles) {
    for (int i = 0; i < cycles; ++i) {
      now_ns_ += kPeriod_ns;
      loop_.cycle(now_ns_, now_ns_);
      most_n_ = std::max(most_n_, std::abs(device_.taken_n[1]));
      finite_ = finite_ && std::isfinite(device_.taken_n[1]);
      steepest_n_ = std::max(steepest_n_, std::abs(device_.taken_n[1] - std::exchange(last_n_, device_.taken_n[1])));
    }
  }

  rtbus::config::SessionConfig session_ =
      rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml",
                                  {rtbus::config::parse_override(std::string("haptic.0.method=") + GetParam())});
  haptic::HapticConfig config_ = haptic::read_haptic_config(session_, 0);
  tests::HeldDevice device_{config_.device->info()};
  TalkingPhysics link_;
  haptic::Loop loop_{config_, device_, link_, false};
  std::uint64_t now_ns_ = 1'000'000'000;
  double most_n_ = 0.0;
  double last_n_ = 0.0, steepest_n_ = 0.0;  ///< Of all cycles: its largest change in one.
  bool finite_ = true;
};

TEST_P(AbsurdPhysics, IsForgottenWhenItTalksSense) {
  talk_sense();
  run(2000);
  const double sensible_n = device_.taken_n[1];
  ASSERT_GT(sensible_n, 0.1);
  most_n_ = 0.0;

  // Each of these is a number; what a method would make of the two, one after the other, is none.
  constexpr double kHuge = std::numeric_limits<double>::max();
  for (const double absurd : {kHuge, -kHuge}) {
    link_.position_m[1] = link_.hand_force_n[1] = absurd;
    run(3);
  }
  EXPECT_TRUE(finite_);
  EXPECT_LE(most_n_, sensible_n * (1.0 + 1e-9)) << "nothing of it may reach the hand";
  EXPECT_GT(loop_.stats().stale_ticks, 0u) << "as good as no answer";

  talk_sense();
  run(2000);
  EXPECT_NEAR(device_.taken_n[1], sensible_n, 1e-3 * sensible_n);
}

TEST_P(AbsurdPhysics, GivesTheHandNoEnergyThatNoWorldHas) {
  talk_sense();
  run(2000);
  const double sensible_n = device_.taken_n[1];
  most_n_ = 0.0;
  for (const double absurd_j : {1e12, std::numeric_limits<double>::infinity(), -1e12, 0.0}) {
    link_.coupling_work_j = absurd_j;
    run(3);
  }
  EXPECT_TRUE(finite_);
  EXPECT_LE(most_n_, sensible_n * (1.0 + 1e-9));
  run(100);
  EXPECT_NEAR(device_.taken_n[1], sensible_n, 1e-3 * sensible_n);
}

// Found by writing random bytes into the topics: a hole of one cycle is a click.
TEST_P(AbsurdPhysics, MakesNoHoleOfOneCycle) {
  talk_sense();
  run(2000);
  const double sensible_n = device_.taken_n[1];
  ASSERT_GT(sensible_n, 0.1);
  for (const bool answers_another_mapping : {true, false}) {
    steepest_n_ = 0.0;
    if (answers_another_mapping) {
      link_.epoch_bits = 0xff;
    } else {
      link_.lag_ns = 0 - std::uint64_t{5} * kPeriod_ns;  // a hand that is yet to come
    }
    run(1);
    link_.epoch_bits = 0;
    link_.lag_ns = 0;
    run(2000);
    EXPECT_LE(steepest_n_, 0.05 * sensible_n) << "fades in 40 ms, and comes back by a ramp";
    EXPECT_NEAR(device_.taken_n[1], sensible_n, 1e-3 * sensible_n);
  }
  EXPECT_EQ(loop_.stats().losses, 2u);
}

// Found by writing random bytes into the topics: a wall stayed soft for a hand that rests in it.
TEST_P(AbsurdPhysics, OwesNothingAfterALoss) {
  link_.position_m = {0.0, 0.004, 0.0};
  link_.hand_force_n = {0.0, 0.8, 0.0};
  link_.coupling_work_j = 1.7e-3;  // the world has pushed the proxy 4 mm out of the wall
  run(2000);
  const double sensible_n = device_.taken_n[1];
  ASSERT_GT(sensible_n, 0.7);
  for (const double damaged_j : {0.9, 0.1}) {  // a world could mean each, alone
    link_.coupling_work_j = damaged_j;
    run(1);
  }
  link_.epoch_bits = 0xff;  // and this is damage for sure: physics counts as lost
  run(100);
  link_.epoch_bits = 0;
  link_.position_m = {0.0, 1e-5, 0.0};  // the hand is out of the wall for a moment, then as before
  link_.coupling_work_j = 0.0;
  run(200);
  link_.silent = true;
  run(200);
  link_.silent = false;
  link_.position_m = {0.0, 0.004, 0.0};
  link_.coupling_work_j = 1.7e-3;
  run(2000);
  EXPECT_NEAR(device_.taken_n[1], sensible_n, 1e-3 * sensible_n);
  EXPECT_EQ(loop_.stats().losses, 2u);
}

TEST_P(AbsurdPhysics, IsNotFeltWhileItAnswersAHandOfTwoSecondsAgo) {
  talk_sense();
  run(3000);
  const double sensible_n = device_.taken_n[1];
  ASSERT_GT(sensible_n, 0.1);
  ASSERT_EQ(loop_.stats().losses, 0u);
  most_n_ = 0.0;
  link_.lag_ns = 2'000'000'000;
  run(1);
  EXPECT_EQ(loop_.take_event(), haptic::LoopEvent::kLinkLags);
  run(45);
  EXPECT_EQ(device_.taken_n[1], 0.0) << "faded in 40 ms";
  EXPECT_LE(most_n_, sensible_n * (1.0 + 1e-9));
  most_n_ = 0.0;
  run(3000);
  EXPECT_EQ(most_n_, 0.0);
  EXPECT_EQ(loop_.stats().losses, 1u);

  link_.lag_ns = 0;
  run(2000);
  EXPECT_NEAR(device_.taken_n[1], sensible_n, 1e-3 * sensible_n);
}

TEST_P(AbsurdPhysics, IsNotFeltWithItsFirstAnswerAfterALoss) {
  talk_sense();
  run(3000);
  ASSERT_GT(device_.taken_n[1], 0.1);
  link_.silent = true;
  run(300);
  ASSERT_EQ(device_.taken_n[1], 0.0);
  ASSERT_EQ(loop_.stats().losses, 1u);
  // It is there again with an answer to a hand from before the loss.
  link_.silent = false;
  link_.lag_ns = 250'000'000;
  most_n_ = 0.0;
  run(1);
  EXPECT_EQ(loop_.take_event(), haptic::LoopEvent::kLinkAlive);
  run(200);
  EXPECT_EQ(most_n_, 0.0);
  link_.lag_ns = 0;
  run(1000);
  EXPECT_GT(device_.taken_n[1], 0.1);
}

TEST_P(AbsurdPhysics, IsFeltWhenItIsSlowOrFarAway) {
  talk_sense();
  run(2000);
  link_.lag_ns = 450'000'000;  // a link that delays
  run(1000);
  EXPECT_GT(device_.taken_n[1], 0.1);
  link_.step_ns = 200'000'000;  // 5 steps a second
  link_.lag_ns = 900'000'000;
  run(1000);
  EXPECT_GT(device_.taken_n[1], 0.1);
  EXPECT_EQ(loop_.stats().losses, 0u);
}

INSTANTIATE_TEST_SUITE_P(Methods, AbsurdPhysics,
                         testing::Values("remote_virtual_coupling", "interpolation", "interpolation_predicted"),
                         [](const auto& each) { return std::string(each.param); });

class ContactsOfLongAgo : public AbsurdPhysics {};

TEST_P(ContactsOfLongAgo, AreALossEvenBesideAProxyOfNow) {
  run(3000);
  ASSERT_EQ(loop_.stats().losses, 0u);
  link_.contacts_lag_ns = 2'000'000'000;
  run(1000);
  EXPECT_EQ(loop_.stats().losses, 1u);
  link_.contacts_lag_ns = 0;
  run(1000);
  EXPECT_EQ(loop_.stats().losses, 1u);
  EXPECT_EQ(loop_.telemetry().gate, 1.0);
}

// The loop would find contacts on shapes that are not there. Other methods know no shapes.
class OtherScene : public AbsurdPhysics {
 protected:
  /// @returns how often that happened in so many cycles.
  int events(int cycles, haptic::LoopEvent wanted) {
    int out = 0;
    for (int i = 0; i < cycles; ++i) {
      run(1);
      for (auto event = loop_.take_event(); event != haptic::LoopEvent::kNone; event = loop_.take_event()) {
        out += event == wanted ? 1 : 0;
      }
    }
    return out;
  }
};

TEST_P(OtherScene, IsSaidOnceAndGivesNoForceUntilItIsTheSame) {
  ASSERT_NE(config_.shape_hash, 0U);
  run(2000);
  ASSERT_EQ(loop_.telemetry().gate, 1.0);
  link_.shape_hash ^= 1;
  EXPECT_EQ(events(1000, haptic::LoopEvent::kOtherScene), 1);
  EXPECT_EQ(loop_.telemetry().gate, 0.0);
  link_.shape_hash ^= 1;
  EXPECT_EQ(events(1000, haptic::LoopEvent::kLinkAlive), 1);
  EXPECT_EQ(loop_.telemetry().gate, 1.0);
}

INSTANTIATE_TEST_SUITE_P(Methods, OtherScene, testing::Values("local_contact"),
                         [](const auto& each) { return std::string(each.param); });

INSTANTIATE_TEST_SUITE_P(Methods, ContactsOfLongAgo, testing::Values("local_contact"),
                         [](const auto& each) { return std::string(each.param); });

}  // namespace
