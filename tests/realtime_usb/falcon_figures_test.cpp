// Figures of the Falcon's whole path on this machine: a wall of 400 N/m held through libusb and the virtual Falcon,
// loop at SCHED_FIFO 80 where granted. Seconds: RTBUS_SOAK_S, default 60.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "rtbus/histogram.hpp"
#include "rtbus/realtime.hpp"
#include "tests/support/falcon_desk.hpp"

namespace {

using namespace tests;

void measure(bool event_character) {
  const char* const text = std::getenv("RTBUS_SOAK_S");
  const double seconds = text != nullptr ? std::atof(text) : 60.0;
  VirtualFalconSettings settings = held({0, 0.015, 0});
  settings.arm.hand = {simulated::SinusoidMotion{{0, 0.0, 0}, {0, 0.006, 0}, 0.5, 0.5}, {700.0, 6.0, 0.15, 20.0}};
  settings.arm.mechanics.start_position_m = {0, 0, 0};
  Desk desk(settings, event_character);
  ASSERT_TRUE(desk.device->start(rtbus::monotonic_ns()));
  const auto grant = rtbus::enter_realtime({});
  constexpr double kWall = 400.0;
  const auto wall = [](const DeviceSample& s) { return Vec3{0, std::max(0.0, -kWall * s.position_m[1]), 0}; };
  (void)desk.loop(200, wall);

  const auto before = desk.device->figures();
  const std::uint64_t start_ns = rtbus::monotonic_ns();
  double peak_n = 0.0;
  double sum_wrong = 0.0;
  double sum = 0.0;
  int looked = 0;
  while (rtbus::seconds_between(start_ns, rtbus::monotonic_ns()) < seconds) {
    ASSERT_EQ(desk.loop(97, wall), 97);
    // The force that acts at the arm now, against the law at where the tip really is.
    Vector3d acts;
    double y_m = 0.0;
    desk.port->locked([&] {
      desk.falcon.arm().advance_to(rtbus::monotonic_ns());
      acts = desk.falcon.arm().mechanics().applied_force_n();
      y_m = desk.falcon.arm().mechanics().position_m().y();
    });
    const double direct_n = std::max(0.0, -kWall * y_m);
    sum_wrong += (acts - Vector3d(0, direct_n, 0)).squaredNorm();
    sum += direct_n * direct_n;
    peak_n = std::max(peak_n, direct_n);
    ++looked;
  }
  const double wall_s = rtbus::seconds_between(start_ns, rtbus::monotonic_ns());
  const auto after = desk.device->figures();
  const auto& wire = desk.device->sample_to_wire();
  const auto& period = desk.device->sample_period();
  const auto us = [](std::uint64_t ns) { return static_cast<double>(ns) * 1e-3; };
  std::printf("event character %s, SCHED_FIFO %s, %.1f s\n", event_character ? "on" : "off",
              grant.fifo ? "granted" : "not granted", wall_s);
  std::printf("  exchanges/s      %.1f\n",
              static_cast<double>(after.protocol.exchanges - before.protocol.exchanges) / wall_s);
  std::printf("  sample to wire   p50 %.0f us, p99 %.0f us, max %.0f us (%llu)\n", us(wire.percentile(0.5)),
              us(wire.percentile(0.99)), us(wire.max()), static_cast<unsigned long long>(wire.count()));
  std::printf("  sample period    p50 %.0f us, p99 %.0f us, max %.0f us\n", us(period.percentile(0.5)),
              us(period.percentile(0.99)), us(period.max()));
  std::printf("  lost frames      %llu, late forces %llu, timed out %llu, bad frames %llu, line errors %llu\n",
              static_cast<unsigned long long>(after.protocol.lost_frames - before.protocol.lost_frames),
              static_cast<unsigned long long>(after.late_forces - before.late_forces),
              static_cast<unsigned long long>(after.timed_out - before.timed_out),
              static_cast<unsigned long long>(after.protocol.bad_frames - before.protocol.bad_frames),
              static_cast<unsigned long long>(after.protocol.line_errors - before.protocol.line_errors));
  std::printf("  force at the arm against the law at the true position, RMS: %.4f N of %.4f N (%.2f %%), %d looks\n",
              std::sqrt(sum_wrong / looked), std::sqrt(sum / looked), 100.0 * std::sqrt(sum_wrong / sum), looked);
  EXPECT_EQ(after.protocol.bad_frames, 0U);
  EXPECT_EQ(after.losses, 0U);
  EXPECT_GT(peak_n, 1.0);
}

TEST(FalconFigures, LatencyTimer) { measure(false); }
TEST(FalconFigures, EventCharacter) { measure(true); }

}  // namespace
