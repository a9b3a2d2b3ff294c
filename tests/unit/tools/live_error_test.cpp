#include "tools/cli/run/live_error.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "haptic_node/rendering/registry.hpp"
#include "haptic_node/safety.hpp"

namespace tools {
namespace {

constexpr double kStiffness_n_per_m = 200.0;
constexpr double kDamping_n_s_per_m = 0.5;
constexpr double kSpeed_m_s = 0.1;
constexpr std::uint64_t kStart_ns = 1'000'000'000;

/// A proxy that moves along x with kSpeed_m_s, seen at `time_ns`.
double proxy_x(std::uint64_t time_ns) {
  return kSpeed_m_s * static_cast<double>(static_cast<std::int64_t>(time_ns - kStart_ns)) * 1e-9;
}

LiveError make_live_error(const haptic::MappingConfig& mapping = {}) {
  return LiveError(
      mapping,
      [](const haptic::Mapping& own) {
        return haptic::find_method("remote_virtual_coupling")->make({kStiffness_n_per_m, kDamping_n_s_per_m, own, {}});
      },
      1e-3);
}

rtbus::ProxyState proxy_at(std::uint64_t time_ns, double step_s = 0.02) {
  rtbus::ProxyState proxy;
  proxy.position_m = {proxy_x(time_ns), 0.0, 0.0};
  proxy.velocity_m_s = {kSpeed_m_s, 0.0, 0.0};
  proxy.step_s = step_s;
  proxy.device_sequence = 1;
  proxy.device_time_ns = time_ns;
  proxy.mapping_epoch = 1;
  return proxy;
}

/// A tick of a still tip at the origin that used the proxy of `used_ns`.
rtbus::Telemetry tick_at(std::uint64_t time_ns, std::uint64_t used_ns) {
  rtbus::Telemetry tick;
  tick.device_time_ns = time_ns;
  tick.proxy_position_m = {proxy_x(used_ns), 0.0, 0.0};
  tick.proxy_velocity_m_s = {kSpeed_m_s, 0.0, 0.0};
  tick.rendered_force_n = {kStiffness_n_per_m * proxy_x(used_ns) + kDamping_n_s_per_m * kSpeed_m_s, 0.0, 0.0};
  tick.proxy_sequence = 1;
  return tick;
}

TEST(LiveError, IsZeroWhenTheProxyOfTheTickItselfWasUsed) {
  LiveError error = make_live_error();
  error.add_proxy(proxy_at(kStart_ns));
  for (std::uint64_t ms = 1; ms < 20; ++ms)
    error.add_tick(tick_at(kStart_ns + ms * rtbus::kNsPerMs, kStart_ns + ms * rtbus::kNsPerMs));
  error.add_proxy(proxy_at(kStart_ns + 20 * rtbus::kNsPerMs));
  EXPECT_EQ(error.compared(), 19u);
  EXPECT_NEAR(error.force_n().peak, 0.0, 1e-12);
  EXPECT_NEAR(error.position_m().peak, 0.0, 1e-15);
}

TEST(LiveError, OfAConstantDelayIsStiffnessTimesSpeedTimesDelay) {
  LiveError error = make_live_error();
  for (std::uint64_t ms = 0; ms <= 200; ++ms) {
    const std::uint64_t now_ns = kStart_ns + ms * rtbus::kNsPerMs;
    if (ms >= 5) error.add_tick(tick_at(now_ns, now_ns - 5 * rtbus::kNsPerMs));
    if (ms % 20 == 0) error.add_proxy(proxy_at(now_ns));
  }
  const double expected_n = kStiffness_n_per_m * kSpeed_m_s * 5e-3;
  EXPECT_EQ(error.compared(), 195u);  // the tick of the last proxy has no later one yet
  EXPECT_NEAR(error.force_n().rms(), expected_n, 1e-9);
  EXPECT_NEAR(error.force_n().peak, expected_n, 1e-9);
  EXPECT_NEAR(error.position_m().rms(), kSpeed_m_s * 5e-3, 1e-12);
}

TEST(LiveError, OfAHeldProxyIsASawtooth) {
  // Steps every 20 ms, each proxy used from its own instant to the next: the delay grows from 0 to 19 ms.
  LiveError error = make_live_error();
  for (std::uint64_t ms = 0; ms <= 400; ++ms) {
    const std::uint64_t now_ns = kStart_ns + ms * rtbus::kNsPerMs;
    if (ms % 20 == 0) error.add_proxy(proxy_at(now_ns));
    error.add_tick(tick_at(now_ns, now_ns - (ms % 20) * rtbus::kNsPerMs));
  }
  const double unit_n = kStiffness_n_per_m * kSpeed_m_s * 1e-3;
  EXPECT_NEAR(error.force_n().peak, 19.0 * unit_n, 1e-9);
  EXPECT_NEAR(error.force_n().rms(), unit_n * std::sqrt(19.0 * 39.0 / 6.0), 1e-9);  // mean of n² over n = 0…19
}

TEST(LiveError, IsMeasuredAtTheDeviceWhateverTheScale) {
  // World = 10 × device: the same motion of the proxy at the device, ten times as far in the world.
  haptic::MappingConfig mapping;
  mapping.position_scale = 10.0;
  mapping.force_scale = 0.1;
  mapping.offset_m = {0.0, 0.3, 0.0};
  LiveError error = make_live_error(mapping);
  const auto in_world = [](rtbus::ProxyState proxy) {
    proxy.position_m = {10.0 * proxy.position_m[0], 0.3, 0.0};
    proxy.velocity_m_s[0] *= 10.0;
    return proxy;
  };
  error.add_proxy(in_world(proxy_at(kStart_ns)));
  error.add_tick(tick_at(kStart_ns + 10 * rtbus::kNsPerMs, kStart_ns + 6 * rtbus::kNsPerMs));
  error.add_proxy(in_world(proxy_at(kStart_ns + 20 * rtbus::kNsPerMs)));
  ASSERT_EQ(error.compared(), 1u);
  EXPECT_NEAR(error.force_n().peak, kStiffness_n_per_m * kSpeed_m_s * 4e-3, 1e-9);
}

TEST(LiveError, DropsTicksWithoutAProxyOnBothSides) {
  LiveError error = make_live_error();
  error.add_tick(tick_at(kStart_ns - 5 * rtbus::kNsPerMs, kStart_ns - 5 * rtbus::kNsPerMs));  // before the first proxy
  error.add_proxy(proxy_at(kStart_ns));
  error.add_proxy(proxy_at(kStart_ns + 20 * rtbus::kNsPerMs));
  error.add_tick(tick_at(kStart_ns + 25 * rtbus::kNsPerMs, kStart_ns + 20 * rtbus::kNsPerMs));  // after the last
  EXPECT_EQ(error.compared(), 0u);
  EXPECT_EQ(error.dropped(), 2u);
}

TEST(LiveError, DoesNotBridgeTheTimeInWhichPhysicsWasAway) {
  LiveError error = make_live_error();
  error.add_proxy(proxy_at(kStart_ns));
  error.add_tick(tick_at(kStart_ns + 500 * rtbus::kNsPerMs, kStart_ns));
  error.add_proxy(proxy_at(kStart_ns + 1000 * rtbus::kNsPerMs));
  EXPECT_EQ(error.compared(), 0u);
  // A declared period of a second makes the same distance an ordinary step.
  error.add_tick(tick_at(kStart_ns + 1500 * rtbus::kNsPerMs, kStart_ns + 1000 * rtbus::kNsPerMs));
  error.add_proxy(proxy_at(kStart_ns + 2000 * rtbus::kNsPerMs, 1.0));
  EXPECT_EQ(error.compared(), 1u);
}

TEST(LiveError, IgnoresTicksInWhichNoLawWasFollowed) {
  LiveError error = make_live_error();
  error.add_proxy(proxy_at(kStart_ns));
  rtbus::Telemetry tick = tick_at(kStart_ns + 10 * rtbus::kNsPerMs, kStart_ns);
  tick.safety = haptic::kDisabled;
  error.add_tick(tick);
  tick.safety = haptic::kDeviceLost;
  error.add_tick(tick);
  tick.safety = 0;
  tick.proxy_sequence = 0;
  error.add_tick(tick);
  error.add_proxy(proxy_at(kStart_ns + 20 * rtbus::kNsPerMs));
  EXPECT_EQ(error.compared(), 0u);
  EXPECT_EQ(error.dropped(), 3u);
}

TEST(LiveError, IgnoresAnswersToARebasedMapping) {
  LiveError error = make_live_error();
  error.add_proxy(proxy_at(kStart_ns));
  error.add_tick(tick_at(kStart_ns + 10 * rtbus::kNsPerMs, kStart_ns));
  rtbus::ProxyState rebased = proxy_at(kStart_ns + 20 * rtbus::kNsPerMs);
  rebased.mapping_epoch = 2;
  error.add_proxy(rebased);
  EXPECT_EQ(error.compared(), 0u);
}

TEST(LiveError, TakesTheNewerOfTwoAnswersToOneSample) {
  LiveError error = make_live_error();
  rtbus::ProxyState early = proxy_at(kStart_ns);
  early.position_m[0] = 1.0;  // physics at twice the rate of the device: a first, coarser answer
  error.add_proxy(early);
  error.add_proxy(proxy_at(kStart_ns));
  error.add_tick(tick_at(kStart_ns + 5 * rtbus::kNsPerMs, kStart_ns + 5 * rtbus::kNsPerMs));
  error.add_proxy(proxy_at(kStart_ns + 20 * rtbus::kNsPerMs));
  ASSERT_EQ(error.compared(), 1u);
  EXPECT_NEAR(error.force_n().peak, 0.0, 1e-12);
}

TEST(LiveError, StaysBoundedWhenPhysicsNeverAnswers) {
  LiveError error = make_live_error();
  constexpr std::uint64_t kTicks = 200'000;
  for (std::uint64_t i = 0; i < kTicks; ++i) error.add_tick(tick_at(kStart_ns + i * rtbus::kNsPerMs, kStart_ns));
  EXPECT_EQ(error.dropped(), kTicks);
}

}  // namespace
}  // namespace tools
