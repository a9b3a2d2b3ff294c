/// The world of local_contact between two answers of physics: what an answer changes, and how.
#include "haptic_node/rendering/local_world.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "rtbus/clock.hpp"
#include "tests/unit/haptic/held_world.hpp"

namespace {

using Eigen::Vector3d;
using haptic::LocalSpring;
using haptic::LocalWorld;
using rtbus::ProxyContacts;

constexpr double kStepS = 1e-3, kStiffness = 500.0, kDamping = 0.5;
constexpr double kPhysicsS = 0.05;
/// A wall at x = 0 whose material fills x < 0, before the proxy at `proxy_x_m`.
ProxyContacts wall(double proxy_x_m, std::uint64_t sample_ns) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.device_time_ns = sample_ns;
  out.step_s = kPhysicsS;
  out.contacts = out.bodies = 1;
  out.contact_normal[0] = {1, 0, 0};
  out.contact_gap_m[0] = proxy_x_m;
  return out;
}

/// The same, but a body of 0.1 kg in free space that moves along x.
ProxyContacts body(double x_m, double velocity_m_s, std::uint64_t sample_ns) {
  ProxyContacts out = wall(0.0, sample_ns);
  out.body_kind[0] = 2;
  out.body_inverse_mass_per_kg[0] = 10.0;
  out.body_centre_m[0] = {x_m - 0.01, 0, 0};
  out.contact_point_m[0] = {x_m, 0, 0};
  out.body_velocity_m_s[0] = {velocity_m_s, 0, 0};
  return out;
}

/// The same on a floor below it, on which it stands on a patch, with a friction that stops it with 5 m/s².
ProxyContacts standing(double x_m, double velocity_m_s, std::uint64_t sample_ns) {
  constexpr double kWeight_n = 0.1 * 10.0;
  ProxyContacts out = body(x_m, velocity_m_s, sample_ns);
  out.supports = 1;
  out.support_normal[0] = {0, 1, 0};
  out.support_point_m[0] = {x_m - 0.01, -0.01, 0};
  out.support_force_n[0] = kWeight_n;
  out.support_friction[0] = 0.5;
  out.support_points[0] = 4;
  out.body_friction_bound_n[0] = 0.5 * kWeight_n;
  return out;
}

struct LocalWorldTest : testing::Test, tests::HeldWorld {
  LocalWorldTest() : HeldWorld(kStiffness, kDamping) {}
};

TEST_F(LocalWorldTest, HasNoForceInFreeAirHoweverTheHandMoves) {
  reset({0.01, 0, 0});
  world->take(wall(0.01, now_ns), now_ns);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(tick(0.01 + 0.005 * std::sin(0.1 * i), 0.3 * std::cos(0.1 * i)), 0.0);
}

TEST_F(LocalWorldTest, HoldsTheProxyAtTheWallAndThePushIsTheSpring) {
  reset({0.002, 0, 0});
  world->take(wall(0.002, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i <= 50; ++i) force_n = tick(0.002 - 1e-4 * i);
  EXPECT_NEAR(world->position_m().x(), 0.0, 1e-9);
  EXPECT_NEAR(force_n, kStiffness * 0.003, 1e-6);
  ASSERT_EQ(world->hand_impulses().entries().size(), 1U);
  EXPECT_NEAR(world->hand_impulses().entries()[0].impulse_n_s.x(), -force_n * kStepS, 1e-12)
      << "what it does to the wall";
}

// A ball of 50 mm around the origin, told once with the contact at its side; the hand goes on around it, 2 mm inside.
TEST_F(LocalWorldTest, RollsTheContactAroundABallUntilTheNextAnswer) {
  constexpr double kRadius_m = 0.05, kDepth_m = 0.002, kReach_m = kRadius_m - kDepth_m;
  ProxyContacts ball = wall(0.0, now_ns);
  ball.contact_point_m[0] = {kRadius_m, 0, 0};
  ball.contact_curvature_per_m[0] = 1.0 / kRadius_m;
  reset({kRadius_m, 0, 0});
  world->take(ball, now_ns);
  for (int i = 0; i <= 40; ++i) tick(kRadius_m - kDepth_m * i / 40);
  for (int i = 0; i <= 40; ++i) {
    const double angle = 0.005 * i;  // 0.2 rad: 10 mm on the surface
    const Vector3d tip(kReach_m * std::cos(angle), kReach_m * std::sin(angle), 0);
    now_ns += rtbus::kNsPerMs;
    world->advance({tip, Vector3d::Zero(), kStiffness, 0.0}, now_ns, kStepS);
    const Vector3d force_n = world->impulse_n_s() / kStepS;
    EXPECT_NEAR(world->position_m().norm(), kRadius_m, 2e-5) << "on the ball, not on its first tangent plane";
    EXPECT_NEAR(force_n.norm(), kStiffness * kDepth_m, 0.01);
    EXPECT_NEAR(force_n.normalized().dot(tip.normalized()), 1.0, 1e-3) << "away from the middle";
  }
}

TEST_F(LocalWorldTest, GivesABodyWhatTheHandFeels) {
  reset({0, 0, 0});
  world->take(body(0.0, 0.0, now_ns), now_ns);
  double given_n_s = 0.0, felt_n_s = 0.0;
  for (int i = 0; i < 40; ++i) {
    felt_n_s += tick(-1e-4 * i) * kStepS;
    for (const auto& push : world->hand_impulses().entries()) given_n_s -= push.impulse_n_s.x();
  }
  EXPECT_GT(felt_n_s, 0.002);
  EXPECT_NEAR(given_n_s, felt_n_s, 1e-12);
}

// Another hand turns the body that this one touches at its side: the surface comes along.
TEST_F(LocalWorldTest, TurnsABodyByTheTorqueOfOthers) {
  constexpr double kTorque_n_m = 1e-3, kInertia_kg_m2 = 1e-4;
  reset({0.001, 0, 0});
  ProxyContacts answer = body(0.0, 0.0, now_ns);
  answer.body_centre_m[0] = {-0.01, -0.02, 0};  // the proxy is at the height of its upper edge
  answer.body_inverse_inertia_per_kg_m2[0] = {1 / kInertia_kg_m2, 0, 0, 1 / kInertia_kg_m2, 0, 1 / kInertia_kg_m2};
  answer.body_external_force_n[0] = {1e-9, 0, 0};  // held by nothing
  answer.body_external_torque_n_m[0] = {0, 0, -kTorque_n_m};
  world->take(answer, now_ns);
  for (int i = 0; i < 40; ++i) EXPECT_EQ(tick(0.002), 0.0);
  // α·t²/2: in 40 ms at 10 rad/s² it turns by 8 mrad, which brings the face 0.16 mm nearer.
  double force_n = 0.0;
  for (int i = 0; i < 12; ++i) force_n = std::max(force_n, tick(0.05e-3));
  EXPECT_GT(force_n, 0.02) << "a face that had stayed at 0 would not be met";
}

// In a pile that falls in, the supports of a cube may find no place in the message. It cannot be moved then, and must
// not carry the hand away with the speed that it had when it was told of.
// On a spring of 500 N/m without damping 0.1 kg swing for ever. A hand that rests has some damping of its own.
TEST_F(LocalWorldTest, ABodySwingsOutUnderAHandThatRests) {
  const auto swing_n = [this](double hand_m_s, double resting_damping_n_s_per_m) {
    reset({0, 0, 0});
    ProxyContacts answer = body(0.0, -0.02, now_ns);
    answer.step_s = 2.0;
    answer.body_external_force_n[0] = {1.0, 0, 0};  // pressed to the hand
    world->take(answer, now_ns);
    double least_n = 1e9, most_n = 0.0;
    for (int i = 0; i < 2000; ++i) {
      now_ns += rtbus::kNsPerMs;
      world->advance(
          {{-kStepS * hand_m_s * i, 0, 0}, {-hand_m_s, 0, 0}, kStiffness, 0.0, 1.0, resting_damping_n_s_per_m}, now_ns,
          kStepS);
      if (i < 800) continue;
      least_n = std::min(least_n, world->impulse_n_s().x() / kStepS);
      most_n = std::max(most_n, world->impulse_n_s().x() / kStepS);
    }
    return most_n - least_n;
  };
  EXPECT_GT(swing_n(0.0, 0.0), 0.1);
  EXPECT_LT(swing_n(0.0, 0.5), 0.05);
  EXPECT_GT(swing_n(0.01, 0.5), 0.1) << "one that moves has what the session gives";
}

TEST_F(LocalWorldTest, ABodyWithoutItsSupportsDoesNotCarryTheHandAway) {
  reset({0, 0, 0});
  ProxyContacts answer = body(0.0, 0.35, now_ns);
  answer.bodies = 2;
  answer.contact_body[0] = 1;
  answer.body_index[1] = 1;
  answer.body_kind[1] = answer.body_kind[0];
  answer.body_inverse_mass_per_kg[1] = answer.body_inverse_mass_per_kg[0];
  answer.body_centre_m[1] = answer.body_centre_m[0];
  answer.body_velocity_m_s[1] = answer.body_velocity_m_s[0];
  answer.body_centre_m[0] = {-1, 0, 0};
  answer.body_velocity_m_s[0] = {0, 0, 0};
  answer.supports = answer.supports_overflow = 1;
  answer.support_normal[0] = {0, 1, 0};
  answer.support_points[0] = 4;
  answer.support_force_n[0] = 1.0;
  world->take(answer, now_ns);
  for (int i = 0; i < 40; ++i) tick(0.0);
  EXPECT_LT(world->position_m().x(), 0.001) << "0.35 m/s would be 14 mm";
}

// An answer that is long under way says what a plate did then. What it was taken to have risen too far by, it gives
// back when that is put right; what an answer lifts the hand by is nobody's work.
TEST_F(LocalWorldTest, GivesNoWorkForAPlateThatAnAnswerPutsElsewhere) {
  const auto plate = [&](double x_m, double velocity_m_s) {
    ProxyContacts answer = body(x_m, velocity_m_s, now_ns);
    answer.body_kind[0] = 1;
    answer.body_inverse_mass_per_kg[0] = 0.0;
    return answer;
  };
  reset({0, 0, 0});
  world->take(plate(0.0, 0.0), now_ns);
  double work_j = 0.0;
  const auto wait = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) {
      (void)tick(-2e-3);
      work_j += world->work_j();
    }
  };
  wait(40);
  EXPECT_NEAR(work_j, 0.0, 1e-12);
  world->take(plate(0.0, 0.02), now_ns);  // it rises, as far as is known …
  wait(40);
  const double risen_j = work_j;
  EXPECT_GT(risen_j, 0.5e-3);
  world->take(plate(0.0, 0.0), now_ns);  // … and has never done so
  wait(150);
  EXPECT_LT(work_j, 0.35 * risen_j) << "the rise is given back";
  const double before_j = work_j;
  world->take(plate(0.5e-3, 0.0), now_ns);
  wait(150);
  EXPECT_NEAR(work_j, before_j, 1e-9) << "it has not moved: it was told to be elsewhere";
  world->take(plate(0.0, 0.0), now_ns);
  wait(150);
  EXPECT_NEAR(work_j, before_j, 1e-6) << "and back";
}

TEST_F(LocalWorldTest, BooksTheWorkOfWhatMovesByItselfAlone) {
  for (const std::uint32_t kind : {1U, 2U}) {
    reset({0, 0, 0});
    ProxyContacts answer = body(0.0, 0.02, now_ns);
    answer.body_kind[0] = kind;
    if (kind == 1U) answer.body_inverse_mass_per_kg[0] = 0.0;
    world->take(answer, now_ns);
    double work_j = 0.0, expected_j = 0.0;
    for (int i = 0; i < 30; ++i) {
      const double force_n = tick(-1e-3);
      work_j += world->work_j();
      expected_j += force_n * 0.02 * kStepS;
    }
    EXPECT_GT(expected_j, 0.0);
    EXPECT_NEAR(work_j, kind == 1U ? expected_j : 0.0, 1e-12);
  }
}

// The answer to a sample of 50 ms ago says that the body was 1 mm nearer than the local world had it then. The one
// after it, to a sample from before that was known, says the same: there is nothing left to correct.
TEST_F(LocalWorldTest, CorrectsOnceWhatTwoAnswersSay) {
  reset({0.05, 0, 0});
  const auto surface = [this] {  // where the proxy meets the body
    double x_m = world->position_m().x();
    LocalWorld copy = *world;
    std::uint64_t ns = now_ns;
    for (; x_m > -0.05; x_m -= 1e-5) {
      ns += rtbus::kNsPerMs;
      copy.advance({{x_m, 0, 0}, Vector3d::Zero(), kStiffness, kDamping}, ns, kStepS);
      if (copy.impulse_n_s().x() > 0.0) return x_m;
    }
    return -1.0;
  };
  world->take(body(0.0, 0.0, now_ns), now_ns);
  for (int i = 0; i < 60; ++i) tick(0.05);
  world->take(body(0.0, 0.0, now_ns - 50 * rtbus::kNsPerMs), now_ns);
  for (int i = 0; i < 60; ++i) tick(0.05);
  EXPECT_NEAR(surface(), 0.0, 5e-5);
  world->take(body(0.001, 0.0, now_ns - 50 * rtbus::kNsPerMs), now_ns);
  for (int i = 0; i < 40; ++i) tick(0.05);
  EXPECT_NEAR(surface(), 0.001, 5e-5);
  world->take(body(0.001, 0.0, now_ns - 50 * rtbus::kNsPerMs), now_ns);
  for (int i = 0; i < 60; ++i) tick(0.05);
  EXPECT_NEAR(surface(), 0.001, 5e-5) << "counted twice";
}

// Told to stand on one point it begins to roll when it is pushed. Told that it stands on a patch it slides, and
// friction stops it within 50 ms; it would roll on for ever.
TEST_F(LocalWorldTest, ABodyOnAPatchDoesNotRollOn) {
  const auto on_floor = [](std::uint32_t points, std::uint64_t sample_ns) {
    ProxyContacts out = body(0.0, 0.0, sample_ns);
    out.body_inverse_inertia_per_kg_m2[0] = {4e4, 0, 0, 4e4, 0, 4e4};
    out.body_external_force_n[0] = {0, 0, 0};
    out.supports = 1;
    out.support_point_m[0] = {-0.01, -0.02, 0};
    out.support_normal[0] = {0, 1, 0};
    out.support_force_n[0] = 0.1 * 9.81;
    out.support_friction[0] = 0.1;
    out.support_points[0] = points;
    return out;
  };
  for (const std::uint32_t points : {1U, 4U}) {
    reset({0, 0, 0});
    world->take(on_floor(1, now_ns), now_ns);
    for (int i = 0; i < 20; ++i) tick(-1e-4 * i, -0.1);  // pushed to the left, lightly
    // The next answer knows nothing of the push yet.
    world->take(on_floor(points, now_ns - 19 * rtbus::kNsPerMs), now_ns);
    for (int i = 0; i < 60; ++i) tick(0.05);
    // Where is it after that, and where 50 ms later?
    const auto surface = [this] {
      double x_m = 0.0;
      LocalWorld copy = *world;
      std::uint64_t ns = now_ns;
      for (; x_m > -0.05; x_m -= 1e-4) {
        ns += 1000;
        copy.advance({{x_m, 0, 0}, Vector3d::Zero(), 1.0, 0.0}, ns, 1e-6);
        if (copy.impulse_n_s().x() > 0.0) break;
      }
      return x_m;
    };
    const double before_m = surface();
    for (int i = 0; i < 20; ++i) tick(0.05);
    const double went_m = before_m - surface();
    if (points == 1)
      EXPECT_GT(went_m, 1e-3) << "it rolls";
    else
      EXPECT_LT(went_m, 2e-4) << "it stands";
  }
}

TEST_F(LocalWorldTest, MovesASurfaceThatIsFeltWithoutAJump) {
  reset({0.0, 0, 0});
  world->take(wall(0.0, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i < 100; ++i) force_n = tick(-0.002);
  ASSERT_NEAR(force_n, kStiffness * 0.002, 1e-6);
  ProxyContacts moved = wall(0.0, now_ns - 1 * rtbus::kNsPerMs);
  moved.contact_point_m[0] = {0.003, 0, 0};  // the wall is 3 mm nearer than it was told
  world->take(moved, now_ns);
  for (int i = 0; i < 400; ++i) {
    const double next_n = tick(-0.002);
    // 0.2 m/s of the spring, and its damper.
    ASSERT_LE(std::abs(next_n - force_n), kStiffness * 0.2 * kStepS + kDamping * 0.2 + 1e-9) << i;
    force_n = next_n;
    if (i % 50 == 49) world->take(moved, now_ns);
  }
  EXPECT_NEAR(force_n, kStiffness * 0.005, 0.01) << "and gets there";
}

TEST_F(LocalWorldTest, AContactThatIsGoneRecedesAndIsForgotten) {
  reset({0.0, 0, 0});
  world->take(wall(0.0, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i < 100; ++i) force_n = tick(-0.002);
  ProxyContacts nothing = wall(0.0, now_ns);
  nothing.contacts = nothing.bodies = 0;
  world->take(nothing, now_ns);
  int ticks = 0;
  for (; ticks < 200 && force_n > 0.0; ++ticks) {
    const double next_n = tick(-0.002);
    ASSERT_GE(next_n, force_n - kStiffness * 0.2 * kStepS - kDamping * 0.2 - 1e-9);
    force_n = next_n;
  }
  EXPECT_GE(ticks, 8);
  EXPECT_LT(ticks, 100);
  EXPECT_EQ(force_n, 0.0);
}

// In a heap sixteen others can be nearer by the next answer. What is felt has a place still, and recedes.
TEST_F(LocalWorldTest, WhatIsFeltRecedesThoughSixteenOthersAreNamed) {
  const auto crowd = [this](std::uint32_t first, bool touched) {
    ProxyContacts out = wall(0.0, now_ns);
    out.contacts = out.bodies = rtbus::kContactSlots;
    for (std::uint32_t i = 0; i < rtbus::kContactSlots; ++i) {
      out.contact_body[i] = i;
      out.body_index[i] = first + i;
      out.contact_normal[i] = {1, 0, 0};
      out.contact_point_m[i] = {touched && i == 0 ? 0.0 : -0.05, 0, 0};
    }
    return out;
  };
  reset({0.0, 0, 0});
  world->take(crowd(0, true), now_ns);
  double force_n = 0.0;
  for (int i = 0; i < 100; ++i) force_n = tick(-0.002);
  ASSERT_NEAR(force_n, kStiffness * 0.002, 1e-6);
  world->take(crowd(100, false), now_ns);
  for (int i = 0; i < 50 && force_n > 0.0; ++i) {
    const double next_n = tick(-0.002);
    ASSERT_GE(next_n, force_n - kStiffness * 0.2 * kStepS - kDamping * 0.2 - 1e-9) << i;
    force_n = next_n;
  }
  EXPECT_EQ(force_n, 0.0);
}

// A block is pressed to the floor along x; the next answer knows nothing of it. What was felt goes away from the hand
// at the speed of every surface that goes, and not as a body that falls.
TEST_F(LocalWorldTest, WhatIsNotNamedAnyMoreHasNoWeight) {
  constexpr int kTicks = 15;
  reset({0, 0, 0});
  ProxyContacts block = standing(0.0, 0.0, now_ns);
  block.support_normal[0] = {1, 0, 0};
  block.support_point_m[0] = {-0.02, 0, 0};
  block.body_external_force_n[0] = {-block.support_force_n[0], 0, 0};
  world->take(block, now_ns);
  for (int i = 0; i < 50; ++i) tick(-0.004);
  ProxyContacts nothing = wall(0.0, now_ns);
  nothing.contacts = nothing.bodies = 0;
  world->take(nothing, now_ns);
  const double before_m = world->position_m().x();
  for (int i = 0; i < kTicks; ++i) tick(-0.01);
  const double way_m = before_m - world->position_m().x();
  EXPECT_NEAR(way_m, haptic::Tuning{}.recovery_m_s * kTicks * kStepS, 1e-5);
}

// The first answer after a reset comes in the same tick or later; in both a plate is where it is by now.
TEST_F(LocalWorldTest, AnAnswerRightAfterAResetIsAsOldAsItIs) {
  constexpr double kAge_s = 0.02, kSpeed_m_s = 0.1;
  reset({kSpeed_m_s * kAge_s + 1e-3, 0, 0});
  ProxyContacts plate = body(0.0, kSpeed_m_s, now_ns - static_cast<std::uint64_t>(1e9 * kAge_s));
  plate.body_kind[0] = 1;
  world->take(plate, now_ns);
  double force_n = 0.0;
  for (int i = 1; i < 10; ++i) {
    force_n = tick(kSpeed_m_s * kAge_s + 1e-3);
    EXPECT_EQ(force_n, 0.0) << "after " << i << " ms";
  }
  for (int i = 0; i < 10; ++i) force_n = tick(kSpeed_m_s * kAge_s + 1e-3);
  EXPECT_GT(force_n, 0.2);
}

// A plate that comes at 0.1 m/s, and then no answer any more: it goes on for two periods and then stops.
TEST_F(LocalWorldTest, BrakesWithoutNews) {
  reset({0.5, 0, 0});
  ProxyContacts plate = body(0.0, 0.1, now_ns);
  plate.body_kind[0] = 1;
  plate.body_inverse_mass_per_kg[0] = 0.0;
  world->take(plate, now_ns);
  const haptic::Tuning tuning;
  const double good_s = tuning.good_periods * kPhysicsS + tuning.good_besides_s;
  double force_n = 0.0;
  // The hand waits 1 mm beyond where the plate stops if it brakes as it says.
  const double stop_m = 0.1 * (good_s + tuning.blend_floor_s);
  for (int i = 0; i < 1000; ++i) force_n = std::max(force_n, tick(stop_m + 0.001));
  EXPECT_EQ(force_n, 0.0);
  for (int i = 0; i < 1000; ++i) force_n = std::max(force_n, tick(stop_m + 0.001 - 1e-5 * std::min(i, 200)));
  EXPECT_NEAR(force_n, kStiffness * 0.001, 0.1) << "and stands there";
}

// Pushed for 60 ms; the answer to the sample from before the push says that nothing has moved yet.
TEST_F(LocalWorldTest, GoesOnFromAnAnswerWithWhatItHasGivenSince) {
  reset({0, 0, 0});
  world->take(body(0.0, 0.0, now_ns), now_ns);
  const std::uint64_t before_ns = now_ns;
  double force_n = 0.0;
  for (int i = 0; i < 60; ++i) force_n = tick(-1e-4 * i, -0.1);
  const double proxy_m = world->position_m().x();
  ASSERT_LT(proxy_m, -0.003) << "it has moved";
  world->take(body(0.0, 0.0, before_ns), now_ns);
  EXPECT_NEAR(tick(-6e-3, -0.1), force_n, 0.02) << "no jump";
  double largest_n = 0.0;
  for (int i = 1; i < 40; ++i) largest_n = std::max(largest_n, tick(-6e-3 - 1e-4 * i, -0.1));
  EXPECT_LT(largest_n, force_n + 0.1) << "where it was";
}

// The ladder took all of it: physics has moved nothing, and there the body is, whatever it was taken to do meanwhile.
TEST_F(LocalWorldTest, CountsAsGivenWhatTheLadderLeft) {
  for (const bool in_vain : {true, false}) {
    const std::uint64_t before_ns = now_ns;
    reset({0, 0, 0});
    world->take(body(0.0, 0.0, before_ns), now_ns);
    for (int i = 0; i < 60; ++i) {
      tick(-1e-4 * i);
      if (in_vain) world->felt(Vector3d::Zero());
    }
    for (int i = 0; i < 60; ++i) tick(0.02);  // lets go
    world->take(body(0.0, 0.0, before_ns), now_ns);
    for (int i = 0; i < 20; ++i) tick(0.02);
    double touched_m = 0.02;
    while (touched_m > -0.1 && tick(touched_m) <= 0.0) touched_m -= 1e-4;
    if (in_vain) {
      EXPECT_NEAR(touched_m, 0.0, 2e-4);
    } else {
      EXPECT_LT(touched_m, -0.01) << "otherwise it would be on its way";
    }
  }
}

// An answer of 50 ms ago finds it at 20 mm/s, which friction ends within 4 ms; taken to last, it would be 1 mm.
TEST_F(LocalWorldTest, ASpeedThatFrictionEndsIsNotCarriedOn) {
  for (const double speed_m_s : {0.02, -0.02}) {
    reset({0.0, 0, 0});
    world->take(standing(0.0, 0.0, now_ns), now_ns);
    double force_n = 0.0;
    for (int i = 0; i < 60; ++i) force_n = tick(-5e-4);
    ASSERT_NEAR(force_n, kStiffness * 5e-4, 1e-3) << "it stands";
    world->take(standing(0.0, speed_m_s, now_ns - 50 * rtbus::kNsPerMs), now_ns);
    for (int i = 0; i < 40; ++i) {
      EXPECT_NEAR(tick(-5e-4), kStiffness * 5e-4, 0.06);
    }
    world->take(standing(0.0, 0.0, now_ns - 50 * rtbus::kNsPerMs), now_ns);
    for (int i = 0; i < 70; ++i) force_n = tick(-5e-4);
    EXPECT_NEAR(force_n, kStiffness * 5e-4, 2e-3) << "and the next answer finds nothing to put right";
  }
}

/// A body of 4 g at rest between the proxy and a wall behind it, which bears `force_n`.
ProxyContacts held_light(double force_n, std::uint64_t sample_ns) {
  ProxyContacts out = standing(0.0, 0.0, sample_ns);
  out.body_inverse_mass_per_kg[0] = 250.0;
  out.support_normal[0] = {1, 0, 0};
  out.support_point_m[0] = {-0.02, 0, 0};
  out.support_force_n[0] = force_n;
  out.body_external_force_n[0] = {force_n, 0, 0};
  return out;
}

// An answer has a body, lighter than the proxy in a tick, 0.1 mm deeper than it was felt. Under a hand that rests that
// is brought in slowly.
TEST(LocalWorldOfALightBody, IsPutRightSlowlyUnderAHandThatRests) {
  constexpr double kDeeper_m = 0.1e-3, kDepth_m = 0.5e-3, kMoreDamping = 5.0;
  const auto put_right = [](double hand_m_s) {
    tests::HeldWorld held(kStiffness, kMoreDamping);
    const Vector3d hand_m(-kDepth_m, 0, 0), hand(0, 0, hand_m_s);
    const auto answer = [&](double x_m) {
      ProxyContacts out = held_light(kStiffness * kDepth_m, held.now_ns);
      out.step_s = 5e-3;
      out.body_centre_m[0][0] += x_m;
      out.contact_point_m[0][0] += x_m;
      out.support_point_m[0][0] += x_m;
      return out;
    };
    held.reset({0, 0, 0});
    for (int i = 0; i < 40; ++i) {
      held.world->take(answer(0.0), held.now_ns);
      for (int k = 0; k < 5; ++k) held.tick(hand_m, hand);
    }
    const double before_m = held.world->position_m().x();
    for (int i = 0; i < 2; ++i) {
      held.world->take(answer(-kDeeper_m), held.now_ns);
      for (int k = 0; k < 5; ++k) held.tick(hand_m, hand);
    }
    return (before_m - held.world->position_m().x()) / kDeeper_m;
  };
  EXPECT_NEAR(put_right(0.0), 1.0 - std::exp(-10e-3 / haptic::Tuning{}.noise_s), 0.05);
  EXPECT_NEAR(put_right(0.02), 1.0 - std::exp(-10e-3 / haptic::Tuning{}.blend_floor_s), 0.05);
}

// The ladder leaves half of the force. What that gives the body is over with the next answer: its surface has not gone.
TEST_F(LocalWorldTest, WhatTheLadderGivesIsNoSpeedThatTheHandHasFelt) {
  stiffness_n_per_m = 15.0;
  damping_n_s_per_m = 1.3;
  const Vector3d hand_m(-0.03, 0, 0);
  const double pressed_n = stiffness_n_per_m * -hand_m.x(), left_n = 0.5 * pressed_n;
  reset({0, 0, 0});
  double farthest_m = 0.0, force_n = 0.0;
  for (int i = 0; i < 200; ++i) {
    const LocalSpring spring{hand_m, Vector3d::Zero(), stiffness_n_per_m, damping_n_s_per_m};
    if (i % 2 == 0) {
      world->foresee(spring, now_ns + rtbus::kNsPerMs, kTick_s);
      world->take(held_light(left_n, now_ns - 2 * rtbus::kNsPerMs), now_ns + rtbus::kNsPerMs);
    }
    force_n = tick(hand_m).x();
    world->felt(-0.5 * world->impulse_n_s());
    farthest_m = std::max(farthest_m, world->position_m().norm());
  }
  EXPECT_NEAR(force_n, pressed_n, 0.02);
  EXPECT_LT(farthest_m, 50e-6);
}

// A hand that presses with 0.4 N where it pressed with 0.2 N when an answer was made, which is as old as this.
TEST_F(LocalWorldTest, ALightBodyGivesWayNoFartherTheOlderAnAnswerIs) {
  constexpr double kTold_n = 0.2, kPressed_n = 0.4;
  for (const int age_ms : {10, 100, 300}) {
    const auto age_ns = static_cast<std::uint64_t>(age_ms) * rtbus::kNsPerMs;
    reset({0, 0, 0});
    world->take(held_light(kTold_n, now_ns - age_ns), now_ns);
    for (int i = 0; i < age_ms; ++i) tick(-kPressed_n / kStiffness);
    EXPECT_GT(world->position_m().x(), -35e-6) << age_ms << " ms in ticks";
    world->take(held_light(kTold_n, now_ns - age_ns), now_ns);
    for (int i = 0; i < 20; ++i) tick(-kPressed_n / kStiffness);
    EXPECT_GT(world->position_m().x(), -35e-6) << age_ms << " ms in a replay";
  }
}

TEST_F(LocalWorldTest, StandsOnItsFeetWithoutNews) {
  reset({0.0, 0, 0});
  world->take(standing(0.0, 0.0, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i < 500; ++i) force_n = tick(-5e-4);
  EXPECT_NEAR(force_n, kStiffness * 5e-4, 1e-3);
}

// Deep in a plate of 40 mm the nearer side changes with each answer: the way out does not.
TEST_F(LocalWorldTest, KeepsToTheWayOutOfABody) {
  const auto side = [this](double normal) {
    ProxyContacts out = wall(0.0, now_ns);
    out.contact_point_m[0] = {0.02 * normal, 0, 0};
    out.contact_normal[0] = {normal, 0, 0};
    return out;
  };
  reset({0.001, 0, 0});
  double before_m = 0.0;
  for (int answer = 0; answer < 8; ++answer) {
    world->take(side(answer % 2 == 0 ? 1.0 : -1.0), now_ns);
    for (int i = 0; i < 50; ++i) {
      before_m = world->position_m().x();
      tick(0.0);
      EXPECT_GE(world->position_m().x(), before_m - 1e-9) << answer;
    }
  }
  EXPECT_NEAR(world->position_m().x(), 0.02, 1e-3) << "and is out";
}

// In the middle of a box on a floor; the nearest side of the box is its lower one.
TEST_F(LocalWorldTest, IsNotPushedOutOfABodyIntoAnother) {
  ProxyContacts out = wall(0.0, now_ns);
  out.proxy_radius_m = 0.005;
  out.contacts = out.bodies = 2;
  out.body_index[1] = 1;
  out.contact_body[1] = 1;
  out.contact_normal[0] = {1, 0, 0};  // the floor, at 0
  out.contact_normal[1] = {-1, 0, 0};
  reset({0.006, 0, 0});
  world->take(out, now_ns);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(tick(0.006), 0.0);
  out.contacts = 1;
  out.contact_normal[0] = {-1, 0, 0};  // without the floor
  world->take(out, now_ns);
  double force_n = 0.0;
  for (int i = 0; i < 100; ++i) force_n = tick(0.006);
  EXPECT_LT(force_n, -0.1) << "it would be";
}

// A hand at rest on a stack that sways to and fro below it: what the answers say of that does not drag the proxy.
TEST_F(LocalWorldTest, DoesNotFollowAHeapAcrossItsNormal) {
  reset({0.0, 0, 0});
  ProxyContacts heap = standing(0.0, 0.0, now_ns);
  heap.support_inverse_mass_per_kg[0] = 10.0;
  heap.contact_friction[0] = 1.0;
  for (int answer = 0; answer < 20; ++answer) {
    heap.device_time_ns = now_ns - 50 * rtbus::kNsPerMs;
    heap.body_centre_m[0] = {-0.01, answer % 2 == 0 ? 1e-3 : -1e-3, 0};
    world->take(heap, now_ns);
    for (int i = 0; i < 50; ++i) {
      tick(-1e-3);
      EXPECT_NEAR(world->impulse_n_s().y() / kStepS, 0.0, 0.02);
    }
  }
  EXPECT_GT(world->impulse_n_s().x() / kStepS, 0.1) << "it is touched";
}

// A cube of a pile has turned by 0.1 rad, and slips: neither is a jump of the force, and in the end it is as told.
TEST_F(LocalWorldTest, ATurnOfAPileComesSlowly) {
  constexpr double kTurned_rad = 0.1;
  const Vector3d normal(std::cos(kTurned_rad), std::sin(kTurned_rad), 0.0);
  reset({0.0, 0, 0});
  ProxyContacts heap = standing(0.0, 0.0, now_ns);
  heap.support_inverse_mass_per_kg[0] = 10.0;
  const auto tell = [&](double x_m) {
    heap.device_time_ns = now_ns - 50 * rtbus::kNsPerMs;
    heap.body_centre_m[0] = {x_m - 0.01, 0, 0};
    heap.contact_point_m[0] = {x_m, 0, 0};
    world->take(heap, now_ns);
  };
  const auto force_n = [&] {
    tick(-2e-3);
    return Vector3d(world->impulse_n_s() / kStepS);
  };
  Vector3d before_n;
  for (int answer = 0; answer < 3; ++answer) {
    tell(0.0);
    for (int i = 0; i < 50; ++i) before_n = force_n();
  }
  ASSERT_GT(before_n.x(), 0.5);
  heap.contact_normal[0] = {normal.x(), normal.y(), 0.0};
  double largest_n = 0.0;
  for (int answer = 0; answer < 20; ++answer) {
    tell(-0.25e-3);  // where the hand holds it in the end, but for the first answer, before which it slipped
    for (int i = 0; i < 50; ++i) {
      const Vector3d now_n = force_n();
      largest_n = std::max(largest_n, (now_n - before_n).norm());
      before_n = now_n;
    }
  }
  EXPECT_LT(largest_n, 5e-3) << "the turn alone would be 0.1 rad of 0.9 N, the slip 5 mm/s of 0.5 N s/m";
  EXPECT_NEAR(std::atan2(before_n.y(), before_n.x()), kTurned_rad, 2e-3);
}

}  // namespace
