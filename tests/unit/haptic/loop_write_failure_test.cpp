// A device that does not take the force: what the loop does then, and what the hand feels when it takes it again.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "haptic_node/loop.hpp"
#include "rtbus/config/session.hpp"
#include "tests/support/held_device.hpp"

namespace {

/// A tip that rests 1.5 mm inside the wall of drop.yaml; the test says what becomes of each write.
class WriteFailure : public testing::TestWithParam<drivers::IoStatus> {
 protected:
  WriteFailure() { device_.sample.position_m = {0.0, -0.0015, 0.0}; }
  static constexpr std::uint64_t kPeriod_ns = 1'000'000;
  void run(int cycles, const std::function<void()>& after_each = {}) {
    for (int i = 0; i < cycles; ++i) {
      now_ns_ += kPeriod_ns;
      loop_.cycle(now_ns_, now_ns_);
      for (haptic::LoopEvent event = loop_.take_event(); event != haptic::LoopEvent::kNone;
           event = loop_.take_event()) {
        events_.push_back(event);
      }
      if (after_each) after_each();
    }
  }
  [[nodiscard]] long count(haptic::LoopEvent event) const { return std::count(events_.begin(), events_.end(), event); }

  rtbus::config::SessionConfig session_ =
      rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/drop.yaml");
  haptic::HapticConfig config_ = haptic::read_haptic_config(session_, 0);
  tests::HeldDevice device_{config_.device->info()};
  tests::SilentPhysics link_;
  haptic::Loop loop_{config_, device_, link_, false};
  std::uint64_t now_ns_ = 1'000'000'000;
  std::vector<haptic::LoopEvent> events_;
};

TEST_P(WriteFailure, AsksForNothingAsLongAsItLasts) {
  run(500);
  const double pressed_n = device_.taken_n[1];
  ASSERT_NEAR(pressed_n, 0.3, 1e-3) << "K = 200 N/m, 1.5 mm deep: what a spring holds without having been pressed";

  device_.answer = GetParam();
  run(1);  // this one fails; the loop learns of it afterwards
  double most_n = 0.0;
  run(300, [&] { most_n = std::max(most_n, std::abs(device_.asked_n[1])); });
  EXPECT_EQ(most_n, 0.0) << "a device that may begin to listen at any moment must not hear an old force";
  EXPECT_EQ(count(haptic::LoopEvent::kDeviceLost), 1) << "said once, not every tick";
  EXPECT_GE(loop_.stats().device_lost, 299u);
}

TEST_P(WriteFailure, IsFollowedByARampAndNotByAStep) {
  run(500);
  const double pressed_n = device_.taken_n[1];
  device_.answer = GetParam();
  run(50);
  device_.answer = drivers::IoStatus::kOk;
  double before_n = 0.0, steepest_n = 0.0;
  int ticks_to_half = 0;
  bool half = false;
  run(500, [&] {
    steepest_n = std::max(steepest_n, device_.taken_n[1] - before_n);
    before_n = device_.taken_n[1];
    half = half || device_.taken_n[1] > 0.5 * pressed_n;
    if (!half) ++ticks_to_half;
  });
  EXPECT_NEAR(device_.taken_n[1], pressed_n, 0.01 * pressed_n) << "the force comes back by itself";
  EXPECT_GE(ticks_to_half, 100) << "over the start ramp of 200 ms";
  EXPECT_LE(steepest_n, 0.03 * pressed_n) << "per tick";
  EXPECT_EQ(count(haptic::LoopEvent::kDeviceBack), 1);
}

TEST_P(WriteFailure, OfASingleWriteBeginsAnewToo) {
  run(500);
  const double pressed_n = device_.taken_n[1];
  device_.answer = GetParam();
  run(1);
  device_.answer = drivers::IoStatus::kOk;
  run(1);
  EXPECT_EQ(device_.taken_n[1], 0.0) << "what the device holds after a failed write is not known";
  run(500);
  EXPECT_NEAR(device_.taken_n[1], pressed_n, 0.01 * pressed_n);
}

INSTANTIATE_TEST_SUITE_P(Answers, WriteFailure, testing::Values(drivers::IoStatus::kLost, drivers::IoStatus::kTimeout),
                         [](const auto& each) { return each.param == drivers::IoStatus::kLost ? "Lost" : "Timeout"; });

}  // namespace
