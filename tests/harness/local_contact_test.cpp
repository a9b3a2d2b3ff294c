/// The method local_contact under the simulated clock: a simulated Desktop, physics one full period late (throttled).
/// Compared with the converged loop: the same method at 10 kHz on both sides without latency.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/support/temporary_file.hpp"
#include "tools/cli/still/still_frame.hpp"
#include "tools/evaluation/drop/fall.hpp"
#include "tools/evaluation/local_contact/two_hands.hpp"
#include "tools/evaluation/shared/force_profile.hpp"
#include "tools/evaluation/work_precision/work_precision.hpp"
#include "tools/harness/harness.hpp"

namespace {

using rtbus::Telemetry;
using tools::Harness;

using Settings = std::vector<std::string>;

std::string config(const char* file) { return std::string(RTBUS_SOURCE_DIR) + "/config/" + file; }

Harness harness_of(const char* file, const Settings& assignments) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto settings = rtbus::config::load_session(config(file), overrides);
  return Harness(settings, {});
}

std::vector<Telemetry> record(const char* file, double duration_s, const Settings& assignments) {
  Harness harness = harness_of(file, assignments);
  std::vector<Telemetry> ticks;
  harness.run(duration_s, [&](const Telemetry& tick) { ticks.push_back(tick); });
  return ticks;
}

Settings with(Settings all, const Settings& more) {
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

std::string text(const char* key, double value) {
  char out[160];
  std::snprintf(out, sizeof out, "%s=%.9g", key, value);
  return out;
}

double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

/// A hand moves the tip along x at `speed_m_s` at height `y_m`, from the left to the right.
Settings stroke(double y_m, double speed_m_s, double stiffness_n_per_m) {
  char device[400];
  std::snprintf(device, sizeof device,
                "haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, "
                "start_m: [-0.06, %g, 0], direction: [1, 0, 0], distance_m: 0.12, speed_m_s: %g, start_s: 1.0, "
                "impedance: firm}}",
                y_m, speed_m_s);
  return {device, "haptic.0.method=local_contact", text("haptic.0.coupling.stiffness_n_per_m", stiffness_n_per_m),
          "physics.throttle_hz=18"};
}

TEST(LocalContact, FreeAirHasNoDrag) {
  const auto ticks = record("wall.yaml", 2.0, stroke(0.02, 0.2, 500));
  double fastest_m_s = 0.0, largest_n = 0.0;
  for (const Telemetry& tick : ticks) {
    fastest_m_s = std::max(fastest_m_s, tick.velocity_m_s[0]);
    largest_n = std::max(largest_n, norm(tick.rendered_force_n));
  }
  EXPECT_GT(fastest_m_s, 0.18);
  EXPECT_LE(largest_n, 1e-9) << "0.02 N is the bar; nothing is what a proxy without mass gives";
}

TEST(LocalContact, SlidesAlongASurfaceWithoutRipple) {
  for (const double friction : {0.0, 0.3}) {
    auto settings = stroke(-0.003, 0.1, 500);
    settings.push_back(text("haptic.0.proxy.friction", friction));
    settings.push_back("scene.bodies.0.friction=1");
    const auto ticks = record("wall.yaml", 2.2, settings);
    double low_n = 1e9, high_n = -1e9, drag_n = 0.0, normal_n = 0.0;
    std::size_t count = 0;
    for (std::size_t i = 1400; i < 2000; ++i) {  // the middle 60 mm
      const double normal = ticks[i].rendered_force_n[1];
      // Beyond friction: the normal force, and along the way what the cone does not explain.
      const double along = ticks[i].rendered_force_n[0] + friction * normal;
      low_n = std::min({low_n, along});
      high_n = std::max({high_n, along});
      drag_n -= ticks[i].rendered_force_n[0];
      normal_n += normal;
      ++count;
    }
    ASSERT_GT(normal_n / static_cast<double>(count), 0.5);
    EXPECT_LE(high_n - low_n, 0.05) << friction;
    EXPECT_NEAR(drag_n / normal_n, friction, 0.02);
  }
}

// Nobody holds the tip; it falls on a wall of 2000 N/m. At 18 Hz physics is told of the wall only once or twice on the
// way.
TEST(LocalContact, SettlesOnAStiffWallLikeDirect) {
  tools::FallSetup setup;
  setup.session_file = config("wall.yaml");
  setup.duration_s = 4.0;
  const Settings wall = {"haptic.0.coupling.stiffness_n_per_m=2000", "haptic.0.coupling.damping_n_s_per_m=2",
                         "haptic.0.device.limits.max_stiffness_n_per_m=2000"};
  tools::FallLimits limits;
  setup.assignments = with(wall, {"haptic.0.method=direct"});
  const tools::FallFigures direct = judge_fall(fall_in_harness(setup, {}), limits);
  ASSERT_EQ(direct.outcome, tools::Outcome::kSettled);
  for (const char* physics : {"null", "100", "18", "5"}) {
    setup.assignments = with(wall, {"haptic.0.method=local_contact", std::string("physics.throttle_hz=") + physics});
    const tools::FallFigures local = judge_fall(fall_in_harness(setup, {}), limits);
    EXPECT_EQ(local.outcome, tools::Outcome::kSettled) << physics;
    EXPECT_LE(local.settling_s, 1.2 * direct.settling_s) << physics;
    EXPECT_NEAR(local.rest_m, direct.rest_m, 0.1e-3) << physics;
  }
}

TEST(LocalContact, WorksAtEveryRateOfTheLoop) {
  for (const double rate_hz : {1000.0, 2000.0, 4000.0, 10000.0}) {
    for (const double physics_hz : {5.0, 43.0}) {
      const auto ticks = record("wall.yaml", 3.5,
                                {"haptic.0.method=local_contact", text("haptic.0.rate_hz", rate_hz),
                                 text("physics.throttle_hz", physics_hz)});
      EXPECT_NEAR(ticks.back().position_m[1], -2.01e-3, 0.35e-3) << rate_hz << " Hz, physics " << physics_hz;
      EXPECT_LT(norm(ticks.back().velocity_m_s), 1e-3) << rate_hz << " Hz, physics " << physics_hz;
    }
  }
}

#if RTBUS_WITH_BULLET
constexpr double kPush_s = 4.0;

Settings block(const char* method, double stiffness_n_per_m) {
  return {std::string("haptic.0.method=") + method, "scene.bodies.1.mass_kg=0.1",
          text("haptic.0.coupling.stiffness_n_per_m", stiffness_n_per_m)};
}

/// Forces along the push, once a millisecond, since the hand began to move.
std::vector<double> push_block(const Settings& settings) {
  Harness harness = harness_of("free_block.yaml", settings);
  const double rate_hz = harness.config().rate_hz;
  const auto every = static_cast<std::uint64_t>(std::llround(rate_hz / 1000.0));
  std::vector<double> force_n;
  harness.run(kPush_s, [&](const Telemetry& tick) {
    if (static_cast<double>(tick.tick) > rate_hz && tick.tick % every == 0) force_n.push_back(tick.force_n[2]);
  });
  return force_n;
}

double rms_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  const std::size_t count = std::min(a.size(), b.size());
  for (std::size_t i = 0; i < count; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(count));
}

class FreeBlock : public testing::TestWithParam<double> {};

// Each method against its own converged loop, which is kinder to the one that has a proxy with mass.
TEST_P(FreeBlock, IsFeltFiveTimesBetterThanByARemoteSpring) {
  const double stiffness = GetParam();
  const Settings converged = {"haptic.0.rate_hz=10000", "physics.rate_hz=10000"};
  const auto local_true = push_block(with(block("local_contact", stiffness), converged));
  const auto remote_true = push_block(with(block("remote_virtual_coupling", stiffness), converged));
  EXPECT_LT(rms_difference(local_true, remote_true), 0.05) << "both converge to nearly the same";
  for (const char* physics : {"100", "43", "18"}) {
    const Settings slow = {std::string("physics.throttle_hz=") + physics};
    const double local_n = rms_difference(push_block(with(block("local_contact", stiffness), slow)), local_true);
    const double remote_n =
        rms_difference(push_block(with(block("remote_virtual_coupling", stiffness), slow)), remote_true);
    std::printf("K %g N/m, physics %s Hz: local_contact %.4f N, remote_virtual_coupling %.4f N\n", stiffness, physics,
                local_n, remote_n);
    EXPECT_LE(local_n, remote_n / 5.0) << physics;
    EXPECT_LE(local_n, stiffness > 700 ? 0.6 : 0.25) << physics;
  }
}

// The last 30 mm of the push, its end and the hand's way back. A box that slides loses points of its manifold now and
// then; taken for an edge or a point it rolled on in the haptic loop, unbraked, and was met again with up to 1.5 N.
TEST_P(FreeBlock, SlidesOnAndStopsByFrictionAtTheEndOfThePush) {
  tools::WorkPrecisionOptions options;
  options.block_file = config("free_block.yaml");
  options.assignments = {text("haptic.0.coupling.stiffness_n_per_m", GetParam())};
  tools::PrecisionScene scene = tools::block_scene(options);
  const tools::PrecisionTrace converged = tools::nearly_continuous(scene, 10000.0);
  scene.from_s = 1.25;
  for (const double physics_hz : {43.0, 18.0}) {
    const tools::PrecisionTrace trace = run_precisely(scene, {"local_contact", physics_hz});
    const tools::PrecisionError error = error_of(trace, scene, reference_of(converged));
    EXPECT_LE(error.force_peak_n, 0.05) << physics_hz;
  }
}

INSTANTIATE_TEST_SUITE_P(Stiffness, FreeBlock, testing::Values(500.0, 1000.0),
                         [](const auto& row) { return "K" + std::to_string(static_cast<int>(row.param)); });

// Newton's third law: what the hand had felt by the sample that the last step answers, and what the world had received
// by then.
TEST(LocalContact, GivesTheWorldWhatTheHandFelt) {
  for (const double scale : {1.0, 0.5}) {
    for (const char* physics : {"null", "100", "18", "5"}) {
      auto settings = block("local_contact", 500);
      settings.push_back(std::string("physics.throttle_hz=") + physics);
      settings.push_back(text("haptic.0.mapping.position_scale", scale));
      Harness harness = harness_of("free_block.yaml", settings);
      rtbus::Vec3 sum{}, felt{}, given{};
      harness.observe_steps([&](const rtbus::ProxyState& step) {
        for (std::size_t a = 0; a < 3; ++a) given[a] -= step.contact_force_n[a] * step.step_s * scale;
        felt = sum;
      });
      harness.run(4.5, [&](const Telemetry& tick) {
        for (std::size_t a = 0; a < 3; ++a) sum[a] -= tick.force_n[a] * 1e-3;
      });
      ASSERT_GT(norm(felt), 0.03) << physics << " Hz, scale " << scale;
      const rtbus::Vec3 difference{felt[0] - given[0], felt[1] - given[1], felt[2] - given[2]};
      EXPECT_LE(norm(difference), 0.02 * norm(felt)) << physics << " Hz, scale " << scale;
    }
  }
}

/// A firm hand pushes 125 cubes about; forces along the push from when it has met them.
tools::Roughness push_pile(int start, const Settings& settings) {
  Harness harness =
      harness_of("stack_125.yaml", with({"haptic.0.method=local_contact", "haptic.0.device.hand.speed_m_s=0.01",
                                         text("haptic.0.device.hand.start_s", 0.3 + 0.0037 * start),
                                         "haptic.0.device.mechanics.position_quantum_m=0"},
                                        settings));
  std::vector<double> force_n;
  harness.run(3.2, [&](const Telemetry& tick) {
    if (tick.tick > 1500) force_n.push_back(tick.force_n[2]);
  });
  return tools::roughness(force_n, 1000.0);
}

// What is there, felt at full rate without latency, is the measure: nothing honest is calmer. As a bare cube between
// supports the same pile is ten times as rough.
TEST(LocalContact, IsAsCalmInAPileAt18HzAsThePileIs) {
  constexpr int kStarts = 3;
  std::vector<double> slow, full;
  double slow_n = 0.0, full_n = 0.0;
  for (int start = 0; start < kStarts; ++start) {
    const tools::Roughness a = push_pile(start, {"physics.throttle_hz=18"});
    const tools::Roughness b = push_pile(start, {"physics.throttle_hz=null"});
    slow.push_back(1e3 * a.increment_rms_n);
    full.push_back(1e3 * b.increment_rms_n);
    slow_n += a.mean_n / kStarts;
    full_n += b.mean_n / kStarts;
    std::printf("start %d: 18 Hz %.2f mN per ms, mean %.3f N; full rate %.2f, %.3f\n", start, slow.back(), a.mean_n,
                full.back(), b.mean_n);
  }
  std::sort(slow.begin(), slow.end());
  std::sort(full.begin(), full.end());
  EXPECT_LE(slow[1], 2.0 * full[1]);
  EXPECT_NEAR(slow_n, full_n, 0.25 * full_n);
}

// A plate that lifts the hand does work on it that the hand has not put in. That is no energy out of nothing: the force
// is not cut, at the pace of physics of the paper's 125 and 500 cubes neither.
TEST(LocalContact, FeelsAPlateThatMovesByItselfInFull) {
  for (const double physics_hz : {1000.0, 100.0, 18.0}) {
    const auto ticks =
        record("moving_plate.yaml", 5.0, {"haptic.0.method=local_contact", text("physics.throttle_hz", physics_hz)});
    double low_n = 1e9, high_n = 0.0, cut_n = 0.0;
    for (std::size_t i = 2000; i < ticks.size(); ++i) {
      low_n = std::min(low_n, norm(ticks[i].force_n));
      high_n = std::max(high_n, norm(ticks[i].force_n));
      cut_n = std::max(cut_n, std::abs(norm(ticks[i].rendered_force_n) - norm(ticks[i].force_n)));
    }
    EXPECT_LT(low_n, 1.2) << "the plate is down";
    EXPECT_GT(high_n, 2.2) << "and up, at " << physics_hz << " Hz";
    EXPECT_LT(cut_n, physics_hz > 50.0 ? 0.02 : 0.3) << physics_hz << " Hz";
  }
}

// Two hands at one body are springs to each other, and feel each other in each tick.
TEST(LocalContact, TwoHandsCarryABlockAsInTheConvergedLoop) {
  const tests::TemporaryFolder folder;
  tools::TwoHandsSetup setup;
  setup.config_folder = std::string(RTBUS_SOURCE_DIR) + "/config";
  setup.folder = folder.path();
  setup.assignments = tools::converged_carry();
  const tools::TwoHandsRun truth = tools::carry_block(setup);
  for (const double physics_hz : {100.0, 43.0, 18.0}) {
    setup.assignments = tools::late_carry("local_contact", physics_hz);
    const tools::TwoHandsRun felt = tools::carry_block(setup);
    for (const std::size_t hand : {0U, 1U}) {
      const auto error = tools::carry_error(felt, truth, hand, tools::TwoHandsRun::kCarried_s, setup.duration_s);
      std::printf("two hands, hand %zu, %g Hz: RMS %.4f N, peak %.4f N\n", hand, physics_hz, error.rms_n, error.peak_n);
      EXPECT_LE(error.rms_n, 0.02) << physics_hz << " Hz, hand " << hand;
    }
    for (std::size_t i = 0; i < felt.time_s.size(); ++i) {
      if (felt.time_s[i] < tools::TwoHandsRun::kCarried_s) continue;
      ASSERT_GT(felt.height_m[i], 0.03) << "dropped after " << felt.time_s[i] << " s at " << physics_hz << " Hz";
    }
  }
}

// From the kill on: the block is pushed away, and lets go of the other hand about 27 ms later.
TEST(LocalContact, TheOtherHandFeelsThatOneIsKilledWithin3Ms) {
  constexpr std::size_t kKilled = 7999, kEarlyOrLate = 3;  // in samples of 1 ms
  constexpr double kTolerance_n = 0.02;
  const tests::TemporaryFolder folder;
  tools::TwoHandsSetup setup;
  setup.config_folder = std::string(RTBUS_SOURCE_DIR) + "/config";
  setup.folder = folder.path();
  setup.kill_s = 8.0;
  setup.duration_s = 8.1;  // then the block lies somewhere else
  setup.assignments = tools::converged_carry();
  const tools::TwoHandsRun truth = tools::carry_block(setup);
  EXPECT_GT(truth.force_n[1][kKilled].norm(), 1.0);
  EXPECT_EQ(truth.force_n[1].back().norm(), 0.0) << "nothing holds against it";
  for (const double physics_hz : {100.0, 43.0, 18.0}) {
    setup.assignments = tools::late_carry("local_contact", physics_hz);
    const tools::TwoHandsRun felt = tools::carry_block(setup);
    ASSERT_EQ(felt.force_n[1].size(), truth.force_n[1].size());
    double worst_n = 0.0;
    for (std::size_t i = kKilled; i < felt.force_n[1].size(); ++i) {
      double low_n = 1e9, high_n = 0.0;  // between them the true force goes through every value
      for (std::size_t k = i - kEarlyOrLate; k <= std::min(i + kEarlyOrLate, felt.force_n[1].size() - 1); ++k) {
        low_n = std::min(low_n, truth.force_n[1][k].norm());
        high_n = std::max(high_n, truth.force_n[1][k].norm());
      }
      const double felt_n = felt.force_n[1][i].norm();
      worst_n = std::max({worst_n, low_n - felt_n, felt_n - high_n});
    }
    const auto error = tools::carry_error(felt, truth, 1, setup.kill_s, setup.duration_s);
    std::printf("killed, %g Hz: at most %.4f N off; at the same time RMS %.4f N, peak %.4f N\n", physics_hz, worst_n,
                error.rms_n, error.peak_n);
    EXPECT_LE(worst_n, kTolerance_n) << physics_hz << " Hz";
  }
}

// Physics is told where the method has the proxy, not where the hand is. A picture shows both.
TEST(LocalContact, IsDrawnWithTheHandApartFromTheProxy) {
  const Settings settings{"haptic.0.method=local_contact", "haptic.0.mapping.position_scale=2"};
  Harness harness = harness_of("wall.yaml", settings);
  Telemetry tick;
  harness.run(4.0, [&tick](const Telemetry& now) { tick = now; });
  const auto session = rtbus::config::load_session(config("wall.yaml"));
  const tools::StillFrame frame = tools::frame_of(session.scene, harness, {&tick, 1});
  ASSERT_EQ(frame.hands.size(), 1U);
  EXPECT_GT(tick.rendered_force_n[1], 0.2);
  EXPECT_NEAR(frame.hands[0].proxy_m.y(), 0.0, 1e-6) << "on the wall";
  EXPECT_NEAR(frame.hands[0].target_m.y(), 2.0 * tick.position_m[1], 1e-9) << "in it";
}

TEST(LocalContact, RepeatsBitForBit) {
  std::uint64_t hash[2] = {};
  for (std::uint64_t& each : hash) {
    auto settings = block("local_contact", 500);
    settings.push_back("physics.throttle_hz=43");
    Harness harness = harness_of("free_block.yaml", settings);
    harness.run(3.0, {});
    each = harness.hash();
  }
  EXPECT_EQ(hash[0], hash[1]);
}
#endif

}  // namespace
