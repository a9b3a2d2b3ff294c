// A physics that says absurd things: the hand feels nothing of them, and everything again once it talks sense.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "haptic_node/loop.hpp"
#include "rtbus/config/session.hpp"

namespace {

constexpr std::uint64_t kPeriod_ns = 1'000'000;

class RestingDevice final : public drivers::Device {
 public:
  explicit RestingDevice(const drivers::DeviceInfo& info) : info_(info) {}
  [[nodiscard]] const drivers::DeviceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] rtbus::Result<void, drivers::DeviceFault> start(std::uint64_t) override { return {}; }
  [[nodiscard]] drivers::IoStatus read(std::uint64_t now_ns,
                                       drivers::DeviceSample& out) noexcept RTBUS_NONBLOCKING override {
    out = {};
    out.time_ns = now_ns;
    return drivers::IoStatus::kOk;
  }
  [[nodiscard]] drivers::IoStatus write(std::uint64_t,
                                        const drivers::ForceCommand& command) noexcept RTBUS_NONBLOCKING override {
    force_n = command.force_n;
    return drivers::IoStatus::kOk;
  }
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return 0; }
  void stop() noexcept override {}

  std::array<double, 3> force_n{};

 private:
  drivers::DeviceInfo info_;
};

/// Answers the last sample in every cycle with the proxy that the test wants.
class TalkingPhysics final : public haptic::PhysicsLink {
 public:
  void send(const rtbus::DeviceState& state, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING override {
    proxy_.stamp_ns = now_ns;
    ++proxy_.sequence;
    proxy_.value.device_sequence = proxy_.sequence;
    proxy_.value.device_time_ns = state.sample_time_ns;
    proxy_.value.mapping_epoch = state.mapping_epoch;
    proxy_.value.step_s = 1e-3;
    ++proxy_.value.step_index;
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyState>& out) noexcept RTBUS_NONBLOCKING override {
    if (proxy_.sequence == 0) return false;
    out = proxy_;
    out.value.position_m = position_m;
    out.value.hand_force_n = hand_force_n;
    return true;
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::Heartbeat>& out) noexcept RTBUS_NONBLOCKING override {
    if (proxy_.sequence == 0) return false;
    out.stamp_ns = proxy_.stamp_ns;
    out.value.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
    out.value.work_period_ns = kPeriod_ns;
    return true;
  }

  rtbus::Vec3 position_m{};
  rtbus::Vec3 hand_force_n{};

 private:
  rtbus::Stamped<rtbus::ProxyState> proxy_{};
};

class AbsurdPhysics : public testing::TestWithParam<const char*> {
 protected:
  void talk_sense() {
    link_.position_m = {0.0, 0.001, 0.0};  // 1 mm above the hand
    link_.hand_force_n = {0.0, 0.2, 0.0};
  }
  void run(int cycles) {
    for (int i = 0; i < cycles; ++i) {
      now_ns_ += kPeriod_ns;
      loop_.cycle(now_ns_, now_ns_);
      most_n_ = std::max(most_n_, std::abs(device_.force_n[1]));
      finite_ = finite_ && std::isfinite(device_.force_n[1]);
    }
  }

  rtbus::config::SessionConfig session_ =
      rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml",
                                  {rtbus::config::parse_override(std::string("haptic.0.method=") + GetParam())});
  haptic::HapticConfig config_ = haptic::read_haptic_config(session_, 0);
  RestingDevice device_{config_.device->info()};
  TalkingPhysics link_;
  haptic::Loop loop_{config_, device_, link_, false};
  std::uint64_t now_ns_ = 1'000'000'000;
  double most_n_ = 0.0;
  bool finite_ = true;
};

TEST_P(AbsurdPhysics, IsForgottenWhenItTalksSense) {
  talk_sense();
  run(2000);
  const double sensible_n = device_.force_n[1];
  ASSERT_GT(sensible_n, 0.1);
  most_n_ = 0.0;

  // Each of these is a number; what a law would make of the two, one after the other, is none.
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
  EXPECT_NEAR(device_.force_n[1], sensible_n, 1e-3 * sensible_n);
}

INSTANTIATE_TEST_SUITE_P(Methods, AbsurdPhysics,
                         testing::Values("remote_virtual_coupling", "interpolation", "interpolation_predicted"),
                         [](const auto& each) { return std::string(each.param); });

}  // namespace
