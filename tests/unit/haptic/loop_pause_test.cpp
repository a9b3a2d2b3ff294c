// A loop that stood for longer than the device holds a force: it begins the force anew, says so once, and counts it.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "haptic_node/loop.hpp"
#include "rtbus/config/session.hpp"
#include "tests/support/held_device.hpp"

namespace {

/// A tip that rests 1.5 mm inside the wall of drop.yaml.
class LoopPause : public testing::Test {
 protected:
  LoopPause() { device_.sample.position_m = {0.0, -0.0015, 0.0}; }
  static constexpr std::uint64_t kPeriod_ns = 1'000'000;
  void cycle(std::uint64_t after_ns = kPeriod_ns) {
    now_ns_ += after_ns;
    loop_.cycle(now_ns_, now_ns_);
    for (auto event = loop_.take_event(); event != haptic::LoopEvent::kNone; event = loop_.take_event()) {
      if (event == haptic::LoopEvent::kPaused) pauses_ns_.push_back(loop_.last_pause_ns());
    }
  }
  void run(int cycles) {
    for (int i = 0; i < cycles; ++i) cycle();
  }

  rtbus::config::SessionConfig session_ =
      rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/drop.yaml");
  haptic::HapticConfig config_ = haptic::read_haptic_config(session_, 0);
  tests::HeldDevice device_{config_.device->info()};
  tests::SilentPhysics link_;
  haptic::Loop loop_{config_, device_, link_, false};
  const std::uint64_t holds_ns_ = static_cast<std::uint64_t>(device_.info().force_timeout_s * 1e9);
  std::uint64_t now_ns_ = 1'000'000'000;
  std::vector<std::uint64_t> pauses_ns_;  ///< As told.
};

TEST_F(LoopPause, LongerThanTheDeviceHoldsAForceIsToldAndCounted) {
  run(500);
  const double pressed_n = device_.taken_n[1];
  ASSERT_GT(pressed_n, 0.2);
  ASSERT_TRUE(pauses_ns_.empty());
  cycle(holds_ns_ + 5'000'000);
  EXPECT_LT(device_.taken_n[1], 0.05 * pressed_n) << "the force begins anew";
  run(500);
  EXPECT_EQ(pauses_ns_, std::vector<std::uint64_t>{holds_ns_ + 5'000'000}) << "told once, with its length";
  EXPECT_EQ(loop_.stats().pauses, 1u);
  EXPECT_EQ(loop_.stats().losses, 0u) << "physics is not to blame";
}

TEST_F(LoopPause, WithinWhatTheDeviceHoldsIsAnOverrunAlone) {
  run(500);
  const double pressed_n = device_.taken_n[1];
  cycle(holds_ns_);
  EXPECT_NEAR(device_.taken_n[1], pressed_n, 0.05 * pressed_n);
  EXPECT_TRUE(pauses_ns_.empty());
  EXPECT_EQ(loop_.stats().pauses, 0u);
}

TEST_F(LoopPause, WithoutForcesHasNoForceToBeginAnew) {
  rtbus::Orders stop{};
  stop.estop = 1;
  loop_.order(stop);
  run(100);
  cycle(holds_ns_ + 5'000'000);
  EXPECT_TRUE(pauses_ns_.empty());
  EXPECT_EQ(loop_.stats().pauses, 0u);
}

}  // namespace
