/// The world of local_contact between two answers of physics: what an answer changes, and how.
#include "haptic_node/rendering/local_world.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

namespace {

using Eigen::Vector3d;
using haptic::LocalSpring;
using haptic::LocalWorld;
using rtbus::ProxyContacts;

constexpr double kStepS = 1e-3, kStiffness = 500.0, kDamping = 0.5;
constexpr double kPhysicsS = 0.05;
constexpr std::uint64_t kMs = 1'000'000;

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

struct LocalWorldTest : testing::Test {
  std::unique_ptr<LocalWorld> world = std::make_unique<LocalWorld>();
  std::uint64_t now_ns = 1000 * kMs;

  /// One tick with the hand at `x_m`; the force on it.
  double tick(double x_m, double velocity_m_s = 0.0) {
    now_ns += kMs;
    world->advance({{x_m, 0, 0}, {velocity_m_s, 0, 0}, kStiffness, kDamping}, now_ns, kStepS);
    return world->impulse_n_s().x() / kStepS;
  }
};

TEST_F(LocalWorldTest, HasNoForceInFreeAirHoweverTheHandMoves) {
  world->reset({0.01, 0, 0});
  world->take(wall(0.01, now_ns), now_ns);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(tick(0.01 + 0.005 * std::sin(0.1 * i), 0.3 * std::cos(0.1 * i)), 0.0);
}

TEST_F(LocalWorldTest, HoldsTheProxyAtTheWallAndThePushIsTheSpring) {
  world->reset({0.002, 0, 0});
  world->take(wall(0.002, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i <= 50; ++i) force_n = tick(0.002 - 1e-4 * i);
  EXPECT_NEAR(world->position_m().x(), 0.0, 1e-9);
  EXPECT_NEAR(force_n, kStiffness * 0.003, 1e-6);
  ASSERT_EQ(world->pushes().size(), 1U);
  EXPECT_NEAR(world->pushes()[0].impulse_n_s.x(), -force_n * kStepS, 1e-12) << "what it does to the wall";
}

// A ball of 50 mm around the origin, told once with the contact at its side; the hand goes on around it, 2 mm inside.
TEST_F(LocalWorldTest, RollsTheContactAroundABallUntilTheNextAnswer) {
  constexpr double kRadius_m = 0.05, kDepth_m = 0.002, kReach_m = kRadius_m - kDepth_m;
  ProxyContacts ball = wall(0.0, now_ns);
  ball.contact_point_m[0] = {kRadius_m, 0, 0};
  ball.contact_curvature_per_m[0] = 1.0 / kRadius_m;
  world->reset({kRadius_m, 0, 0});
  world->take(ball, now_ns);
  for (int i = 0; i <= 40; ++i) tick(kRadius_m - kDepth_m * i / 40);
  for (int i = 0; i <= 40; ++i) {
    const double angle = 0.005 * i;  // 0.2 rad: 10 mm on the surface
    const Vector3d tip(kReach_m * std::cos(angle), kReach_m * std::sin(angle), 0);
    now_ns += kMs;
    world->advance({tip, Vector3d::Zero(), kStiffness, 0.0}, now_ns, kStepS);
    const Vector3d force_n = world->impulse_n_s() / kStepS;
    EXPECT_NEAR(world->position_m().norm(), kRadius_m, 2e-5) << "on the ball, not on its first tangent plane";
    EXPECT_NEAR(force_n.norm(), kStiffness * kDepth_m, 0.01);
    EXPECT_NEAR(force_n.normalized().dot(tip.normalized()), 1.0, 1e-3) << "away from the middle";
  }
}

TEST_F(LocalWorldTest, GivesABodyWhatTheHandFeels) {
  world->reset({0, 0, 0});
  world->take(body(0.0, 0.0, now_ns), now_ns);
  double given_n_s = 0.0, felt_n_s = 0.0;
  for (int i = 0; i < 40; ++i) {
    felt_n_s += tick(-1e-4 * i) * kStepS;
    for (const auto& push : world->pushes()) given_n_s -= push.impulse_n_s.x();
  }
  EXPECT_GT(felt_n_s, 0.002);
  EXPECT_NEAR(given_n_s, felt_n_s, 1e-12);
}

// Another hand turns the body that this one touches at its side: the surface comes along.
TEST_F(LocalWorldTest, TurnsABodyByTheTorqueOfOthers) {
  constexpr double kTorque_n_m = 1e-3, kInertia_kg_m2 = 1e-4;
  world->reset({0.001, 0, 0});
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

TEST_F(LocalWorldTest, BooksTheWorkOfWhatMovesByItselfAlone) {
  for (const std::uint32_t kind : {1U, 2U}) {
    world->reset({0, 0, 0});
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
  world->reset({0.05, 0, 0});
  const auto surface = [this] {  // where the proxy meets the body
    double x_m = world->position_m().x();
    LocalWorld copy = *world;
    std::uint64_t ns = now_ns;
    for (; x_m > -0.05; x_m -= 1e-5) {
      ns += kMs;
      copy.advance({{x_m, 0, 0}, Vector3d::Zero(), kStiffness, kDamping}, ns, kStepS);
      if (copy.impulse_n_s().x() > 0.0) return x_m;
    }
    return -1.0;
  };
  world->take(body(0.0, 0.0, now_ns), now_ns);
  for (int i = 0; i < 60; ++i) tick(0.05);
  world->take(body(0.0, 0.0, now_ns - 50 * kMs), now_ns);
  for (int i = 0; i < 60; ++i) tick(0.05);
  EXPECT_NEAR(surface(), 0.0, 5e-5);
  world->take(body(0.001, 0.0, now_ns - 50 * kMs), now_ns);
  for (int i = 0; i < 40; ++i) tick(0.05);
  EXPECT_NEAR(surface(), 0.001, 5e-5);
  world->take(body(0.001, 0.0, now_ns - 50 * kMs), now_ns);
  for (int i = 0; i < 60; ++i) tick(0.05);
  EXPECT_NEAR(surface(), 0.001, 5e-5) << "counted twice";
}

TEST_F(LocalWorldTest, MovesASurfaceThatIsFeltWithoutAJump) {
  world->reset({0.0, 0, 0});
  world->take(wall(0.0, now_ns), now_ns);
  double force_n = 0.0;
  for (int i = 0; i < 100; ++i) force_n = tick(-0.002);
  ASSERT_NEAR(force_n, kStiffness * 0.002, 1e-6);
  ProxyContacts moved = wall(0.0, now_ns - 1 * kMs);
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
  world->reset({0.0, 0, 0});
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

// A plate that comes at 0.1 m/s, and then no answer any more: it goes on for a period and a half and then stops.
TEST_F(LocalWorldTest, BrakesWithoutNews) {
  world->reset({0.5, 0, 0});
  ProxyContacts plate = body(0.0, 0.1, now_ns);
  plate.body_kind[0] = 1;
  plate.body_inverse_mass_per_kg[0] = 0.0;
  world->take(plate, now_ns);
  const double good_s = 1.5 * kPhysicsS + 3e-3;
  double force_n = 0.0;
  // The hand waits 1 mm beyond where the plate stops if it brakes as it says.
  const double stop_m = 0.1 * (good_s + LocalWorld::kBrake_s);
  for (int i = 0; i < 1000; ++i) force_n = std::max(force_n, tick(stop_m + 0.001));
  EXPECT_EQ(force_n, 0.0);
  for (int i = 0; i < 1000; ++i) force_n = std::max(force_n, tick(stop_m + 0.001 - 1e-5 * std::min(i, 200)));
  EXPECT_NEAR(force_n, kStiffness * 0.001, 0.1) << "and stands there";
}

}  // namespace
