/// Whole sessions under the simulated clock: loop, ladder, physics and device as the nodes run them.
#include "tools/harness/harness.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "physics_node/frame_publisher.hpp"

namespace {

using rtbus::Telemetry;
using rtbus::config::Override;
using tools::Harness;
using tools::HarnessOptions;

rtbus::config::SessionConfig session(const std::string& file, const std::vector<std::string>& assignments = {}) {
  std::vector<Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  return rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/" + file, overrides);
}

std::vector<Telemetry> record(const std::string& file, double duration_s,
                              const std::vector<std::string>& assignments = {}, const HarnessOptions& options = {}) {
  auto settings = session(file, assignments);
  Harness harness(settings, options);
  std::vector<Telemetry> ticks;
  harness.run(duration_s, [&](const Telemetry& tick) { ticks.push_back(tick); });
  return ticks;
}

double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

TEST(Harness, GivesTwoBitIdenticalRuns) {
  for (const char* file : {"wall.yaml", "drop.yaml", "sphere.yaml"}) {
    std::uint64_t hash[2] = {};
    for (std::uint64_t& each : hash) {
      auto settings = session(file);
      Harness harness(settings, {});
      harness.run(3.0, {});
      each = harness.hash();
    }
    EXPECT_EQ(hash[0], hash[1]) << file;
  }
}

#if RTBUS_WITH_BULLET
// Body poses only read the world: whoever looks changes no bit of the force, also while cubes are pushed.
TEST(Harness, GivesTheSameForceWithAndWithoutAnObserverOfBodies) {
  rtbus::Session bus;
  bus.name = "harness-poses-" + std::to_string(::getpid());
  std::uint64_t hash[2] = {}, frames = 0;
  double force_n = 0.0;
  for (const bool observed : {false, true}) {
    auto settings = session("stack_125.yaml", {"haptic.0.device=devices/sim_phantom_desktop_push_z.yaml"});
    Harness harness(settings, {});
    auto poses = physics::PosePublisher::create(bus, harness.stepper()->world().bodies());
    ASSERT_TRUE(poses.has_value());
    auto reader = rtbus::Reader<rtbus::BodyPoses>::open(bus, "physics.body_poses", {.presence = observed});
    ASSERT_TRUE(reader.has_value());
    for (double t = 0.0; t < 2.4; t += 0.02) {  // the tip meets the stack after 2 s
      harness.run(0.02, [&](const Telemetry& tick) { force_n = std::max(force_n, norm(tick.force_n)); });
      (*poses)->maintain();
      (*poses)->publish_if_due(*harness.stepper(), static_cast<std::uint64_t>((1.0 + harness.now_s()) * 1e9));
    }
    hash[observed ? 1 : 0] = harness.hash();
    rtbus::Stamped<rtbus::BodyPoses> sample;
    if (reader->read_latest(sample) == rtbus::ReadStatus::kFresh) frames = sample.value.frame;
    EXPECT_EQ(frames > 0, observed);
  }
  EXPECT_GT(frames, 40u);  // 2.4 s at a frame every 40 ms, the first multiple of 20 ms above 1/30 s
  EXPECT_LT(frames, 75u);
  EXPECT_GT(force_n, 0.5);
  EXPECT_EQ(hash[0], hash[1]);
}
#endif

TEST(Harness, SeesAnyChangeOfAGain) {
  std::uint64_t hash[2] = {};
  for (int i = 0; i < 2; ++i) {
    auto settings =
        session("wall.yaml", {"haptic.0.coupling.stiffness_n_per_m=" + std::string(i == 0 ? "200" : "200.0001")});
    Harness harness(settings, {});
    harness.run(3.0, {});
    hash[i] = harness.hash();
  }
  EXPECT_NE(hash[0], hash[1]);
}

TEST(Harness, GivesTheSameRunInOnePieceOrInMany) {
  auto first = session("wall.yaml");
  Harness whole(first, {});
  whole.run(2.0, {});
  auto second = session("wall.yaml");
  Harness pieces(second, {});
  for (int i = 0; i < 20; ++i) pieces.run(0.1, {});
  EXPECT_EQ(whole.hash(), pieces.hash());
}

// Paper, Fig. 8: direct rendering, K = 200 N/m, B = 0.02 N·s/m, from 20 mm: bounces about 0.7 s, rests near −2 mm.
TEST(Drop, SettlesAsPublishedWithDirectRendering) {
  const double release_s = 1.0;
  const auto ticks = record("drop.yaml", 5.0);
  double rest_m = 0.0;
  for (std::size_t i = ticks.size() - 500; i < ticks.size(); ++i) rest_m += ticks[i].position_m[1] / 500.0;
  double settled_s = 0.0;
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    if (std::abs(ticks[i].position_m[1] - rest_m) > 0.2e-3) settled_s = static_cast<double>(i + 1) * 1e-3 - release_s;
  }
  EXPECT_NEAR(settled_s, 0.70, 0.15 * 0.70);
  // Weight over stiffness, give or take what friction holds: 0.402 N/200 N/m = 2.01 mm, ±0.06 N/200 N/m = ±0.30 mm.
  EXPECT_NEAR(rest_m, -2.01e-3, 0.30e-3 + 23e-6);
}

TEST(Wall, IsStableAndRestsWhereTheSpringBalancesTheWeight) {
  for (const char* throttle : {"null", "100", "43", "18"}) {
    const auto ticks = record("wall.yaml", 8.0, {std::string("physics.throttle_hz=") + throttle});
    for (const Telemetry& tick : ticks) ASSERT_LE(norm(tick.force_n), 7.9 + 1e-9) << throttle;
    const double rest_m = ticks.back().position_m[1];
    EXPECT_NEAR(rest_m, -2.01e-3, 0.35e-3) << throttle << " Hz";
    EXPECT_LT(norm(ticks.back().velocity_m_s), 1e-3) << throttle << " Hz";
  }
}

TEST(Wall, FeelsTheSameAtEveryPositionScale) {
  // Gains are at the device, masses in the world: a proxy that is as heavy as felt (m/s²) makes the world's scale
  // vanish.
  std::vector<double> peak_n;
  for (const double scale : {0.1, 1.0, 10.0}) {
    const auto ticks = record("wall.yaml", 5.0,
                              {"haptic.0.mapping.position_scale=" + std::to_string(scale),
                               "haptic.0.proxy.mass_kg=" + std::to_string(0.1 / (scale * scale))});
    EXPECT_NEAR(ticks.back().position_m[1], -2.01e-3, 0.35e-3) << scale;
    peak_n.push_back(0.0);
    for (const Telemetry& tick : ticks) peak_n.back() = std::max(peak_n.back(), norm(tick.force_n));
  }
  EXPECT_NEAR(peak_n[0], peak_n[1], 1e-6);
  EXPECT_NEAR(peak_n[2], peak_n[1], 1e-6);
}

TEST(Loss, FadesWithin100MsAndComesBackSlowly) {
  HarnessOptions options;
  options.physics_dies_s = 4.0;
  options.physics_returns_s = 6.0;
  const auto ticks = record("wall.yaml", 8.0, {}, options);
  std::size_t declared = 0;
  double last_n = 0.0;
  for (std::size_t i = 3999; i < ticks.size(); ++i) {
    const double t = static_cast<double>(i + 1) * 1e-3;
    if (declared == 0 && t < 6.0 && (ticks[i].safety & haptic::kStale) != 0) declared = i;
    const double force_n = norm(ticks[i].force_n);
    if (t > 4.1 && t < 6.0) {
      ASSERT_EQ(force_n, 0.0) << t << " s";
    }
    // Back: the tip has sunk by then and the spring holds all it can, 7.9 N; the 100 ms ramp gives 0.08 N per tick of
    // it, and what the gate has opened follows the spring itself.
    if (t >= 6.0) {
      ASSERT_LT(force_n - last_n, 0.15) << t << " s";
    }
    last_n = force_n;
  }
  ASSERT_GT(declared, 0u);
  const double declared_s = static_cast<double>(declared + 1) * 1e-3 - 4.0;
  EXPECT_GT(declared_s, 0.034);
  EXPECT_LE(declared_s, 0.060);
  EXPECT_EQ(norm(ticks[declared + 40].force_n), 0.0);
  EXPECT_NEAR(ticks.back().force_n[1], 0.402, 0.07) << "the tip rests on the wall again";
}

#if RTBUS_WITH_BULLET
class BulletSession : public testing::TestWithParam<const char*> {};

// Two runs of each shipped session, bit for bit, and the hand does what the session is for: it meets a body.
TEST_P(BulletSession, RunsTwiceInTheSameWayAndTouches) {
  std::uint64_t hash[2] = {};
  double peak_n = 0.0;
  for (std::uint64_t& each : hash) {
    auto settings = session(std::string(GetParam()) + ".yaml", {"haptic.0.method=remote_virtual_coupling"});
    Harness harness(settings, {});
    harness.run(7.0, [&peak_n](const Telemetry& tick) { peak_n = std::max(peak_n, norm(tick.force_n)); });
    each = harness.hash();
  }
  EXPECT_EQ(hash[0], hash[1]);
  EXPECT_GT(peak_n, 0.05);
  EXPECT_LE(peak_n, 7.9 + 1e-9);
}

// The hand rests on a plate that rises by 10 mm: at every tick the method's force follows from where hand and proxy
// are, the proxy goes with the plate, and the hand, which has a grip of its own, feels it come and go.
TEST(MovingPlate, LiftsTheProxyAndTheForceFollowsTheLaw) {
  auto settings = session("moving_plate.yaml", {"haptic.0.method=remote_virtual_coupling"});
  Harness harness(settings, {});
  double lowest_n = 1e9, highest_n = 0.0;
  harness.run(3.9, {});  // start-up, and one stroke of the plate
  harness.run(4.0, [&](const Telemetry& tick) {
    const double t = static_cast<double>(tick.tick) * 1e-3;
    const double plate_m = 0.005 * (1.0 - std::cos(2.0 * M_PI * 0.5 * (t - 2.0)));
    // The mapping's offset is the proxy's radius: in D the proxy touches where the plate's face is.
    ASSERT_NEAR(tick.proxy_position_m[1], plate_m, 2e-4) << t;
    const double method_n = 300.0 * (tick.proxy_position_m[1] - tick.position_m[1]) +
                            0.5 * (tick.proxy_velocity_m_s[1] - tick.velocity_m_s[1]);
    ASSERT_NEAR(tick.rendered_force_n[1], method_n, 1e-9) << t;
    lowest_n = std::min(lowest_n, tick.force_n[1]);
    highest_n = std::max(highest_n, tick.force_n[1]);
  });
  EXPECT_GT(lowest_n, 0.2);
  EXPECT_GT(highest_n - lowest_n, 0.8) << "10 mm against springs of 300 N/m in series";
}

// Both hands hold the block up: each force is what its own method says, the vertical parts carry the weight, the
// horizontal ones squeeze and are equal.
TEST(TwoHands, LiftTheBlockEachWithItsOwnForce) {
  auto settings = session("two_hands.yaml");
  Harness harness(settings, {});
  ASSERT_EQ(harness.hands(), 2u);
  Telemetry last[2];
  double sum[2][2] = {};  // of the force on the block along x and y, mean of the last second
  harness.run_all(6.0, {});
  harness.run_all(1.0, [&](std::size_t hand, const Telemetry& tick) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      ASSERT_NEAR(tick.rendered_force_n[a],
                  300.0 * (tick.proxy_position_m[a] - tick.position_m[a]) +
                      0.5 * (tick.proxy_velocity_m_s[a] - tick.velocity_m_s[a]),
                  1e-9);
    }
    for (std::size_t a = 0; a < 2; ++a) sum[hand][a] -= tick.rendered_force_n[a] * 1e-3;
    last[hand] = tick;
  });
  const auto block = harness.stepper()->world().body_pose(1);
  EXPECT_GT(block.position_m.y(), 0.02 + 0.010) << "it hangs in the air";
  EXPECT_GT(sum[0][0], 1.0) << "squeezed";
  EXPECT_NEAR(sum[0][0], -sum[1][0], 0.02 * sum[0][0]);
  EXPECT_NEAR(sum[0][1] + sum[1][1], 0.1 * 9.81, 0.02) << "each newton of its weight is felt";
  EXPECT_LT(norm(last[0].velocity_m_s), 2e-3);
}

TEST(TwoHands, TheOtherGoesOnWhenOneIsKilledAndTheDeadHandLetsGo) {
  for (const char* throttle : {"null", "100"}) {
    auto settings = session("two_hands.yaml", {std::string("physics.throttle_hz=") + throttle});
    Harness harness(settings, {});
    harness.run_all(6.0, {});
    ASSERT_GT(harness.stepper()->world().body_pose(1).position_m.y(), 0.03) << throttle;
    harness.kill(0);
    std::size_t ticks = 0;
    double before_n = -1.0, largest_step_n = 0.0;
    harness.run_all(2.0, [&](std::size_t hand, const Telemetry& tick) {
      ASSERT_EQ(hand, 1u);
      ++ticks;
      const double force_n = norm(tick.force_n);
      if (before_n >= 0.0) largest_step_n = std::max(largest_step_n, std::abs(force_n - before_n));
      before_n = force_n;
    });
    EXPECT_EQ(ticks, 2000u) << throttle;
    EXPECT_LT(largest_step_n, 0.5) << throttle;
    EXPECT_NEAR(harness.stepper()->world().body_pose(1).position_m.y(), 0.02, 2e-3) << "the block has fallen";
    EXPECT_EQ(harness.stepper()->answer(0).coupling_force_n, (rtbus::Vec3{0, 0, 0}));
    EXPECT_EQ(harness.stepper()->answer(0).contact_force_n, (rtbus::Vec3{0, 0, 0}));
  }
}

INSTANTIATE_TEST_SUITE_P(Shipped, BulletSession,
                         testing::Values("stack_125", "stack_250", "stack_500", "free_block", "beads_mm", "mixed_sizes",
                                         "moving_plate", "two_hands"),
                         [](const auto& row) { return std::string(row.param); });
#endif

#if RTBUS_WITH_BULLET
/// Impulses along the push, second by second, both in the world's frame: what the hand felt, what the world received,
/// and how far the proxy went.
struct Push {
  std::array<double, 10> felt_n_s{}, given_n_s{}, way_m{};
};

/// As shipped the hand meets the stack at 4.3 s and pushes on until 16 s. A `fast` one, at 15 mm/s, meets it at
/// about 2.7 s and stops at 5.0 s.
Push push(std::vector<std::string> assignments, bool fast) {
  if (fast) {
    assignments.emplace_back("haptic.0.device=devices/sim_phantom_desktop_push_z.yaml");
    assignments.emplace_back("haptic.0.device.hand.speed_m_s=0.015");
  }
  auto settings = session("stack_125.yaml", assignments);
  Harness harness(settings, {});
  Push out;
  std::size_t second = 0;
  harness.observe_steps([&](const rtbus::ProxyState& step) {
    out.given_n_s[second] += -step.contact_force_n[2] * step.step_s;
    out.way_m[second] += -step.velocity_m_s[2] * step.step_s;
  });
  for (; second < (fast ? 5 : out.felt_n_s.size()); ++second) {
    harness.run(1.0, [&](const Telemetry& tick) { out.felt_n_s[second] += -tick.force_n[2] * 1e-3; });
    std::printf("second %zu: felt %.4f, given %.4f N s, way %.1f mm\n", second, out.felt_n_s[second],
                out.given_n_s[second], 1e3 * out.way_m[second]);
  }
  return out;
}

// Newton's third law: what the hand feels over each second of the push is what the world received in it, though the two
// ends of the coupling are two springs, at 1000 Hz and at 100 Hz.
TEST(Momentum, FeltByTheHandIsGivenToTheWorld) {
  for (const auto& settings : std::vector<std::vector<std::string>>{
           {"physics.rate_hz=100", "physics.substeps=10", "haptic.0.proxy.lead_steps=0.5"},
           {"physics.throttle_hz=100", "haptic.0.proxy.lead_steps=1.5"}}) {
    const Push pushed = push(settings, false);
    std::size_t seconds = 0;
    for (std::size_t second = 5; second < pushed.felt_n_s.size(); ++second) {
      if (std::abs(pushed.given_n_s[second]) < 0.2) continue;  // the columns give way: no push any more
      ++seconds;
      EXPECT_NEAR(pushed.felt_n_s[second] / pushed.given_n_s[second], 1.0, 0.05)
          << settings[0] << ", second " << second;
    }
    EXPECT_GE(seconds, 3U);
  }
}

// Without a lead the hand feels K·v·age more, age being what a throttled proxy has: one period until it
// is there, one more on which the set-point moves to it, 20 ms.
TEST(Momentum, MissesTheAgeOfTheProxyWithoutALead) {
  const Push plain = push({"physics.throttle_hz=100"}, true);
  const double drag_n_s = 300.0 * plain.way_m[3] * 0.020;
  EXPECT_GT(drag_n_s, 0.04);
  EXPECT_NEAR(plain.felt_n_s[3] - plain.given_n_s[3], -drag_n_s, 0.2 * drag_n_s);
}
#endif

TEST(Clutch, MovesTheHandWithoutMovingTheToolAndReturnsWithoutAKick) {
  // Button 0 is pressed from 1.0 to 2.0 s while the hand goes on with its sinusoid.
  const std::string device =
      "{schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: sinusoid, centre_m: [0, 0.02, 0], "
      "amplitude_m: [0.02, 0, 0], frequency_hz: 0.7, buttons: [{time_s: 1.0, button: 0, pressed: true}, "
      "{time_s: 2.0, button: 0, pressed: false}]}}";
  auto settings = session("wall.yaml", {"haptic.0.device=" + device, "haptic.0.mapping.clutch_button=0"});
  Harness harness(settings, {});
  rtbus::Vec3 held{};
  std::uint32_t epoch = 0;
  harness.run(1.5, {});
  held = harness.device_state().target_position_m;
  epoch = harness.device_state().mapping_epoch;
  EXPECT_EQ(harness.device_state().enabled, 0u);
  harness.run(0.499, [&](const Telemetry& tick) { EXPECT_EQ(norm(tick.force_n), 0.0); });
  EXPECT_EQ(harness.device_state().target_position_m, held) << "the tool waits";
  harness.run(0.010, [&](const Telemetry& tick) { EXPECT_LT(norm(tick.force_n), 0.05); });
  EXPECT_GT(harness.device_state().mapping_epoch, epoch);
  EXPECT_NEAR(harness.device_state().target_position_m[0], held[0], 2e-3) << "and goes on from where it was";
  harness.run(1.0, [&](const Telemetry& tick) { EXPECT_LT(norm(tick.force_n), 0.5) << "no spring was stretched"; });
}

// A hand rests in the wall while the enable button is let go and pressed again. The hand does not supply the energy of
// the spring then: the world does, when it pushes the proxy out. Half of its answers are lost.
TEST(Enable, AHandThatRestsInTheWallGetsTheWholeForceBack) {
  std::string buttons = "{time_s: 0.0, button: 0, pressed: true}";
  for (int i = 0; i < 4; ++i) {
    buttons += ", {time_s: " + std::to_string(2 + i) +
               ", button: 0, pressed: false}, {time_s: " + std::to_string(2.3 + i) + ", button: 0, pressed: true}";
  }
  const std::string device =
      "{schema: device/1, driver: simulated, model: phantom_desktop, mechanics: {coulomb_n: 0}, hand: {type: push, "
      "start_m: [0, 0.02, 0], direction: [0, -1, 0], distance_m: 0.025, speed_m_s: 0.05, impedance: normal, buttons: "
      "[" +
      buttons + "]}}";
  HarnessOptions options;
  options.lost_share = 0.5;
  auto settings = session("wall.yaml", {"haptic.0.device=" + device, "haptic.0.enable_button=0"});
  Harness harness(settings, options);
  double before_n = 0.0, now_n = 0.0;
  harness.run(1.95, [&](const Telemetry& tick) { before_n = norm(tick.force_n); });
  ASSERT_GT(before_n, 0.5);
  for (int i = 0; i < 4; ++i) {
    harness.run(0.2, {});
    harness.run(0.8, [&](const Telemetry& tick) { now_n = norm(tick.force_n); });
    EXPECT_NEAR(now_n, before_n, 0.02 * before_n) << "after beginning " << i;
  }
}

// The enable button is let go and pressed again within one step of slow physics, while the hand crosses the wall:
// physics never sees the hand disabled, but its proxy, left at the old side, must not pull.
TEST(Enable, BeginsAtZeroStoredEnergyEvenBetweenTwoPhysicsSteps) {
  const std::string device =
      "{schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, start_m: [0, 0.01, 0], "
      "direction: [0, -1, 0], distance_m: 0.02, speed_m_s: 0.4, start_s: 1.005, impedance: firm, buttons: ["
      "{time_s: 0.0, button: 0, pressed: true}, {time_s: 1.01, button: 0, pressed: false}, "
      "{time_s: 1.09, button: 0, pressed: true}]}}";
  auto settings =
      session("wall.yaml", {"haptic.0.device=" + device, "haptic.0.enable_button=0", "physics.throttle_hz=5"});
  Harness harness(settings, {});
  harness.run(1.05, {});
  ASSERT_EQ(harness.device_state().enabled, 0u);
  const std::uint32_t epoch = harness.device_state().mapping_epoch;
  harness.run(0.039, {});
  ASSERT_LT(harness.device_state().position_m[1], -0.003) << "the hand should be inside the wall by now";
  double peak_n = 0.0;
  harness.run(0.15, [&](const Telemetry& tick) { peak_n = std::max(peak_n, norm(tick.force_n)); });
  EXPECT_GT(harness.device_state().mapping_epoch, epoch);
  EXPECT_EQ(peak_n, 0.0) << "no answer to a sample of this enabling can have come yet";
}

}  // namespace
