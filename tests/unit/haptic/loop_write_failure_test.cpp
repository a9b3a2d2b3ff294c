// A device that does not take the force: what the loop does then, and what the hand feels when it takes it again.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "haptic_node/loop.hpp"
#include "rtbus/config/session.hpp"

namespace {

/// A tip that rests 1.5 mm inside the wall of drop.yaml; the test says what becomes of each write.
class StubbornDevice final : public drivers::Device {
 public:
  explicit StubbornDevice(const drivers::DeviceInfo& info) : info_(info) {}
  [[nodiscard]] const drivers::DeviceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] rtbus::Result<void, drivers::DeviceFault> start(std::uint64_t) override { return {}; }
  [[nodiscard]] drivers::IoStatus read(std::uint64_t now_ns,
                                       drivers::DeviceSample& out) noexcept RTBUS_NONBLOCKING override {
    out = {};
    out.position_m = {0.0, -0.0015, 0.0};
    out.time_ns = now_ns;
    return drivers::IoStatus::kOk;
  }
  [[nodiscard]] drivers::IoStatus write(std::uint64_t,
                                        const drivers::ForceCommand& command) noexcept RTBUS_NONBLOCKING override {
    asked_n = command.force_n[1];
    if (answer == drivers::IoStatus::kOk) taken_n = asked_n;
    return answer;
  }
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return 0; }
  void stop() noexcept override {}

  drivers::IoStatus answer = drivers::IoStatus::kOk;
  double asked_n = 0.0;  ///< By the last write.
  double taken_n = 0.0;  ///< By the last write that succeeded.

 private:
  drivers::DeviceInfo info_;
};

class NoPhysics final : public haptic::PhysicsLink {
 public:
  void send(const rtbus::DeviceState&, std::uint64_t) noexcept RTBUS_NONBLOCKING override {}
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyState>&) noexcept RTBUS_NONBLOCKING override { return false; }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::Heartbeat>&) noexcept RTBUS_NONBLOCKING override { return false; }
};

class WriteFailure : public testing::TestWithParam<drivers::IoStatus> {
 protected:
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
  StubbornDevice device_{config_.device->info()};
  NoPhysics link_;
  haptic::Loop loop_{config_, device_, link_, false};
  std::uint64_t now_ns_ = 1'000'000'000;
  std::vector<haptic::LoopEvent> events_;
};

TEST_P(WriteFailure, AsksForNothingAsLongAsItLasts) {
  run(500);
  const double pressed_n = device_.taken_n;
  ASSERT_NEAR(pressed_n, 0.3, 1e-3) << "K = 200 N/m, 1.5 mm deep: what a spring holds without having been pressed";

  device_.answer = GetParam();
  run(1);  // this one fails; the loop learns of it afterwards
  double most_n = 0.0;
  run(300, [&] { most_n = std::max(most_n, std::abs(device_.asked_n)); });
  EXPECT_EQ(most_n, 0.0) << "a device that may begin to listen at any moment must not hear an old force";
  EXPECT_EQ(count(haptic::LoopEvent::kDeviceLost), 1) << "said once, not every tick";
  EXPECT_GE(loop_.stats().device_lost, 299u);
}

TEST_P(WriteFailure, IsFollowedByARampAndNotByAStep) {
  run(500);
  const double pressed_n = device_.taken_n;
  device_.answer = GetParam();
  run(50);
  device_.answer = drivers::IoStatus::kOk;
  double before_n = 0.0, steepest_n = 0.0;
  int ticks_to_half = 0;
  bool half = false;
  run(500, [&] {
    steepest_n = std::max(steepest_n, device_.taken_n - before_n);
    before_n = device_.taken_n;
    half = half || device_.taken_n > 0.5 * pressed_n;
    if (!half) ++ticks_to_half;
  });
  EXPECT_NEAR(device_.taken_n, pressed_n, 0.01 * pressed_n) << "the force comes back by itself";
  EXPECT_GE(ticks_to_half, 50) << "over the ramp";
  EXPECT_LE(steepest_n, 0.03 * pressed_n) << "per tick";
  EXPECT_EQ(count(haptic::LoopEvent::kDeviceBack), 1);
}

TEST_P(WriteFailure, OfASingleWriteBeginsAnewToo) {
  run(500);
  const double pressed_n = device_.taken_n;
  device_.answer = GetParam();
  run(1);
  device_.answer = drivers::IoStatus::kOk;
  run(1);
  EXPECT_EQ(device_.taken_n, 0.0) << "what the device holds after a failed write is not known";
  run(500);
  EXPECT_NEAR(device_.taken_n, pressed_n, 0.01 * pressed_n);
}

INSTANTIATE_TEST_SUITE_P(Answers, WriteFailure, testing::Values(drivers::IoStatus::kLost, drivers::IoStatus::kTimeout),
                         [](const auto& each) { return each.param == drivers::IoStatus::kLost ? "Lost" : "Timeout"; });

}  // namespace
