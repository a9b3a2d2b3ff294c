// A wall through each stand-in, and through the simulated device with the same mechanics and hand: the contact must
// feel the same. The simulated device runs in stepped time, the stand-ins in real time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "rtbus/realtime.hpp"
#include "tests/support/bare_loops.hpp"
#include "tests/unit/vendor/desk.hpp"

namespace drivers {
namespace {

constexpr double kStiffness_n_per_m = 400.0;
/// A tip of 0.1 kg that a hand pushes 6 mm into a wall at y = 0 with 50 mm/s, from 6 mm above.
constexpr const char* kMechanics =
    "mechanics: {mass_kg: 0.1, viscous_n_s_per_m: 0.3, coulomb_n: 0.05, gravity_m_s2: [0, 0, 0], position_quantum_m: "
    "1e-5";
constexpr const char* kHand =
    "hand: {type: push, impedance: normal, start_m: [0, 0.006, 0], direction: [0, -1, 0], distance_m: 0.012, "
    "speed_m_s: 0.05, start_s: 0.2}";

double wall_n(const Vec3& position_m) { return kStiffness_n_per_m * std::max(0.0, -position_m[1]); }

/// Forces of one push: the largest, and the one that is held at its end [N].
struct Push {
  double peak_n = 0.0;
  double held_n = 0.0;
  void add(double force_n) {
    peak_n = std::max(peak_n, force_n);
    held_n = force_n;
  }
};

Push through_simulated() {
  const auto config = tests::parse_device(std::string("{schema: device/1, driver: simulated, ") + kMechanics +
                                          ", max_force_n: 8, force_step_n: 0}, " + kHand + "}");
  auto opened = config->open({});
  EXPECT_TRUE(opened);
  Device& device = **opened;
  std::uint64_t now_ns = rtbus::kNsPerS;
  EXPECT_TRUE(device.start(now_ns));
  Push out;
  for (int i = 0; i < 1500; ++i) {
    now_ns += rtbus::kNsPerMs;
    DeviceSample sample;
    EXPECT_NE(device.read(now_ns, sample), IoStatus::kLost);
    const double force_n = wall_n(sample.position_m);
    EXPECT_EQ(device.write(now_ns, {{0.0, force_n, 0.0}}), IoStatus::kOk);
    out.add(force_n);
  }
  return out;
}

Push through(const std::string& driver, const std::string& unit) {
  tests::Desk desk("{schema: device/1, driver: " + driver + ", virtual: {" + unit + kMechanics + "}, " + kHand + "}}");
  EXPECT_EQ(desk.start(), "");
  // Like a node's loop, where that is permitted.
  const rtbus::ThreadScheduling ordinary;
  (void)rtbus::enter_realtime({.priority = 80, .lock_memory = false, .hold_dma_latency = false});
  Push out;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + 2 * rtbus::kNsPerS;
  while (rtbus::monotonic_ns() < end_ns) {
    (void)desk.cycle([&](const DeviceSample& sample) {
      out.add(wall_n(sample.position_m));
      return Vec3{0.0, wall_n(sample.position_m), 0.0};
    });
  }
  ordinary.restore();
  return out;
}

struct StandIn {
  const char* name;
  const char* driver;
  const char* unit;
};

class SameWall : public testing::TestWithParam<StandIn> {};

TEST_P(SameWall, FirstContactIsWithinTwoPercentOfTheSimulatedDevices) {
  for (const DriverEntry& driver : registered_drivers()) {
    if (driver.name == GetParam().name && !driver_present(driver)) GTEST_SKIP() << "not in this build";
  }
#if defined(__SANITIZE_THREAD__)
  // The service's answers come late then, and a force that is late by itself is larger.
  GTEST_SKIP() << "a figure of real time: ThreadSanitizer makes every exchange several times as long";
#endif
  const Push simulated = through_simulated();
  ASSERT_GT(simulated.peak_n, 0.5);
  double worst = 1.0;
  std::string machine;
  // A pause holds the loop up in the middle of the contact. Shorter ones come every second, and do not spoil it.
  constexpr double kLate_ms = 5.0;
  const auto judged = tests::judge_when_quiet(tests::BareScheduling::kOrdinary, kLate_ms, 5, machine, [&] {
    const Push felt = through(GetParam().driver, GetParam().unit);
    worst = std::max(std::abs(felt.peak_n / simulated.peak_n - 1.0), std::abs(felt.held_n / simulated.held_n - 1.0));
    std::printf("%s: largest %.4f N, held %.4f N; simulated %.4f N, %.4f N\n", GetParam().name, felt.peak_n,
                felt.held_n, simulated.peak_n, simulated.held_n);
    return worst <= 0.02 || HasFailure();
  });
  if (judged == tests::Judged::kPaused) GTEST_SKIP() << 100.0 * worst << " % off; " << machine;
#if defined(__SANITIZE_ADDRESS__)
  if (worst > 0.02) {
    std::printf("NOT CHECKED: %s was %.1f %% off, with AddressSanitizer in every exchange\n", GetParam().name,
                100.0 * worst);
    GTEST_SKIP() << "a figure of real time, and AddressSanitizer made every exchange late";
  }
#endif
  EXPECT_LE(worst, 0.02);
}

INSTANTIATE_TEST_SUITE_P(StandIns, SameWall,
                         testing::Values(StandIn{"force_dimension", "force_dimension, model: omega3", ""},
                                         StandIn{"openhaptics", "openhaptics, model: touch", "ramp_s: 0.02, "},
                                         StandIn{"haply", "haply, model: inverse3", ""}),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace drivers
