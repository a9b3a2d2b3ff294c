/// The small contact problem of local_contact, against closed forms.
#include "haptic_node/rendering/contact_solver.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "haptic_node/rendering/body_motion.hpp"
#include "haptic_node/rendering/contact_subspace.hpp"

namespace {

using Eigen::Vector3d;
using haptic::SolverBody;
using haptic::SolverContact;

constexpr double kMassKg = 0.1, kStepS = 1e-3, kGravity = 9.81, kTolerance_m_s = 1e-6;

int solve_contacts(SolverBody* bodies, SolverContact* contacts, std::size_t count, int most, double tolerance_m_s) {
  haptic::prepare_contacts(bodies, contacts, count);
  return haptic::relax_contacts(bodies, contacts, count, most, tolerance_m_s);
}

SolverBody block(const Vector3d& velocity_m_s) {
  SolverBody body;
  body.velocity_m_s = velocity_m_s - Vector3d(0, kGravity * kStepS, 0);  // gravity of this step is in it
  body.inverse_mass_per_kg = 1.0 / kMassKg;
  return body;
}

SolverContact floor_of(double friction) {
  SolverContact contact;
  contact.friction = friction;
  return contact;
}

TEST(ContactSolver, HoldsAWeightAndStopsAnImpact) {
  SolverBody bodies[1] = {block({0, -0.3, 0})};
  SolverContact contacts[1] = {floor_of(0.0)};
  solve_contacts(bodies, contacts, 1, 12, kTolerance_m_s);
  EXPECT_NEAR(bodies[0].velocity_m_s.y(), 0.0, 1e-9);
  EXPECT_NEAR(contacts[0].normal_n_s, kMassKg * (0.3 + kGravity * kStepS), 1e-12);
}

TEST(ContactSolver, LetsGoAndClosesAGap) {
  SolverBody bodies[1] = {block({0, 0.3, 0})};
  SolverContact contacts[1] = {floor_of(0.5)};
  contacts[0].impulse_n_s = Vector3d(0.01, 0.2, 0);  // of the step before: must not pull
  solve_contacts(bodies, contacts, 1, 12, kTolerance_m_s);
  EXPECT_NEAR(contacts[0].impulse_n_s.norm(), 0.0, 1e-12);
  EXPECT_NEAR(bodies[0].velocity_m_s.y(), 0.3 - kGravity * kStepS, 1e-12);

  bodies[0] = block({0, -0.3, 0});
  contacts[0] = floor_of(0.0);
  contacts[0].closing_m_s = 0.1;  // a gap of 0.1 mm
  solve_contacts(bodies, contacts, 1, 12, kTolerance_m_s);
  EXPECT_NEAR(bodies[0].velocity_m_s.y(), -0.1, 1e-9);
}

TEST(ContactSolver, FrictionSticksUpToTheConeAndSlidesBeyond) {
  constexpr double kFriction = 0.4;
  const double weight_n_s = kMassKg * kGravity * kStepS;
  for (const double speed : {0.5, 2.0}) {  // of what the cone can stop in a step
    const double v = speed * kFriction * kGravity * kStepS;
    SolverBody bodies[1] = {block({v * 0.6, 0, v * 0.8})};
    SolverContact contacts[1] = {floor_of(kFriction)};
    solve_contacts(bodies, contacts, 1, 12, kTolerance_m_s);
    const double left = std::max(0.0, v - kFriction * kGravity * kStepS);
    EXPECT_NEAR(std::hypot(bodies[0].velocity_m_s.x(), bodies[0].velocity_m_s.z()), left, 1e-9);
    EXPECT_NEAR(bodies[0].velocity_m_s.x(), 0.6 * left, 1e-9) << "against the slip";
    const Vector3d tangential = contacts[0].impulse_n_s - Vector3d(0, contacts[0].normal_n_s, 0);
    EXPECT_LE(tangential.norm(), kFriction * weight_n_s * (1 + 1e-9));
  }
}

// The proxy (light, pulled) pushes a block (heavy) off a wall behind it: nothing moves, the wall gets the push.
TEST(ContactSolver, PassesAPushThroughABody) {
  SolverBody bodies[2];
  bodies[0].inverse_mass_per_kg = 1.0 / 0.001;
  bodies[0].velocity_m_s = Vector3d(0, 0, -2.0);
  bodies[1].inverse_mass_per_kg = 1.0 / kMassKg;
  SolverContact contacts[2];
  contacts[0].b = 1;
  contacts[0].normal = Vector3d::UnitZ();
  contacts[1].a = 1;
  contacts[1].normal = Vector3d::UnitZ();
  solve_contacts(bodies, contacts, 2, 12, kTolerance_m_s);
  EXPECT_NEAR(bodies[0].velocity_m_s.z(), 0.0, 1e-8);
  EXPECT_NEAR(bodies[1].velocity_m_s.z(), 0.0, 1e-8);
  EXPECT_NEAR(contacts[0].normal_n_s, 0.002, 1e-10);
  EXPECT_NEAR(contacts[1].normal_n_s, 0.002, 1e-10);
}

// Two supports that come at a body from both sides cannot both be obeyed: impulses stay finite all the same.
TEST(ContactSolver, SoftSupportsThatContradictEachOtherStayBounded) {
  SolverBody body;
  body.inverse_mass_per_kg = 1.0 / kMassKg;
  SolverContact contacts[2];
  for (int step = 0; step < 2000; ++step) {
    for (int i = 0; i < 2; ++i) {
      const Vector3d warm = contacts[i].impulse_n_s;
      contacts[i] = SolverContact{};
      contacts[i].impulse_n_s = warm;
      contacts[i].normal = (i == 0 ? 1.0 : -1.0) * Vector3d::UnitY();
      contacts[i].surface_velocity_m_s = contacts[i].normal * 1e-3;
      contacts[i].softness_per_kg = 0.02 / kMassKg;
    }
    SolverBody bodies[1] = {body};
    solve_contacts(bodies, contacts, 2, 12, kTolerance_m_s);
    ASSERT_LT(contacts[0].normal_n_s, 0.1) << step;
  }
  // 1 mm/s from either side: each gives way by that, 0.02/m per newton second.
  EXPECT_NEAR(contacts[0].normal_n_s, 1e-3 * kMassKg / 0.02, 1e-4);
}

/// A block on four corners.
struct FourCorners {
  SolverBody body = block({0, 0, 0});
  SolverContact corners[4];

  FourCorners() {
    body.inverse_inertia_per_kg_m2 = Eigen::Matrix3d::Identity() / 2e-5;
    for (int i = 0; i < 4; ++i) {
      corners[i] = floor_of(0.1);
      corners[i].from_a_m = Vector3d(i % 2 == 0 ? 0.02 : -0.02, -0.02, i < 2 ? 0.02 : -0.02);
      corners[i].softness_per_kg = 0.02 / kMassKg;
      corners[i].expected_n_s = 0.25 * kMassKg * kGravity * kStepS;
    }
  }
  /// @returns the sweeps made.
  int solve(double tolerance_m_s, int most) { return solve_contacts(&body, corners, 4, most, tolerance_m_s); }
};

// Four corners on one plane bear a push beside the middle: how they share it is open, how the body moves is not. The
// sweeps of a tick move the body as the solution to the last digit does.
TEST(ContactSolver, FourCornersMoveABodyAsTheConvergedSolutionDoes) {
  FourCorners asked;
  asked.body.velocity_m_s.x() = 0.05;
  asked.body.angular_velocity_rad_s = Vector3d(0.2, 0, -0.3);
  FourCorners exact = asked;
  asked.solve(haptic::kTolerance_m_s, 12);
  EXPECT_GT(exact.solve(1e-12, 10'000), 50);
  EXPECT_LT((asked.body.velocity_m_s - exact.body.velocity_m_s).norm(), 1e-4);
  EXPECT_LT((asked.body.angular_velocity_rad_s - exact.body.angular_velocity_rad_s).norm() * 0.02, 1e-4);
}

// A tick begins with the impulses of the one before.
TEST(ContactSolver, ABlockThatStandsTakesOneSweepInATick) {
  FourCorners stands;
  int sweeps = 0;
  for (int i = 0; i < 20; ++i) {
    stands.body.velocity_m_s = Vector3d(0, -kGravity * kStepS, 0);
    stands.body.angular_velocity_rad_s.setZero();
    sweeps = stands.solve(haptic::kTolerance_m_s, 12);
  }
  EXPECT_EQ(sweeps, 1);
  EXPECT_LT(stands.body.velocity_m_s.norm(), 2.0 * haptic::kTolerance_m_s);
}

// 0.2 g under 1.3 N, 650 times its weight, beside its middle and with a push to a side below what lets it slide: from
// the impulses of nothing it stands after four sweeps and one linear problem.
TEST(ContactSolver, HoldsAloneWhatIsPressedByManyTimesItsWeight) {
  constexpr double kLightKg = 2e-4;
  FourCorners pressed;
  for (SolverContact& corner : pressed.corners) corner.friction = 1.0;
  pressed.body.inverse_mass_per_kg = 1.0 / kLightKg;
  pressed.body.inverse_inertia_per_kg_m2 = Vector3d(3e7, 1.5e7, 1.5e7).asDiagonal();
  const Vector3d push_n_s = kStepS * Vector3d(0.1, -1.3, 0.05), at_m(2e-3, 0.02, 3e-3);
  pressed.body.velocity_m_s = push_n_s / kLightKg;
  pressed.body.angular_velocity_rad_s = pressed.body.inverse_inertia_per_kg_m2 * at_m.cross(push_n_s);
  FourCorners swept = pressed, exact = pressed;
  const auto solve = [](FourCorners& each, auto relax, int sweeps) {
    haptic::prepare_contacts(&each.body, each.corners, 4);
    return relax(&each.body, each.corners, 4, sweeps, haptic::kTolerance_m_s);
  };
  solve(swept, haptic::relax_contacts, 4);
  EXPECT_LE(solve(pressed, haptic::relax_alone, 4), 8);
  solve(exact, haptic::relax_contacts, 100'000);
  const auto off_m_s = [&exact](const FourCorners& each) {
    return std::max((each.body.velocity_m_s - exact.body.velocity_m_s).norm(),
                    0.02 * (each.body.angular_velocity_rad_s - exact.body.angular_velocity_rad_s).norm());
  };
  std::printf("off the solution after 4 sweeps: %.2e m/s, alone %.2e m/s\n", off_m_s(swept), off_m_s(pressed));
  EXPECT_GT(off_m_s(swept), 0.02);
  EXPECT_LT(off_m_s(pressed), 1e-4);
}

/// Blocks on each other, on four corners each, which begin from nothing.
template <std::size_t kBlocks>
struct Stack {
  static constexpr std::size_t kCorners = 4 * kBlocks;
  std::array<SolverBody, kBlocks> bodies;
  std::array<SolverContact, kCorners> corners;

  Stack() {
    fall();
    for (std::size_t k = 0; k < kBlocks; ++k) {
      for (std::size_t i = 0; i < 4; ++i) {
        SolverContact& corner = corners[4 * k + i];
        corner = floor_of(0.3);
        corner.a = static_cast<int>(k);
        corner.from_a_m = Vector3d(i % 2 == 0 ? 0.02 : -0.02, -0.02, i < 2 ? 0.02 : -0.02);
        if (k == 0) continue;
        corner.b = static_cast<int>(k) - 1;
        corner.from_b_m = corner.from_a_m + Vector3d(0, 0.04, 0);
      }
    }
    haptic::prepare_contacts(bodies.data(), corners.data(), kCorners);
  }
  /// All stood, and a step of gravity has passed.
  void fall() {
    for (SolverBody& body : bodies) {
      body = block(Vector3d::Zero());
      body.inverse_inertia_per_kg_m2 = Eigen::Matrix3d::Identity() / 2e-5;
    }
  }
  /// By sweeps alone. @returns whether they have come to an end.
  bool sweep(int most) { return haptic::relax_contacts(bodies.data(), corners.data(), kCorners, most, 1e-14) < most; }
  void solve_together(int sweeps) { haptic::relax_together(bodies.data(), corners.data(), kCorners, sweeps, 1e-12); }
  /// The largest velocity by which a block differs.
  [[nodiscard]] double off_m_s(const Stack& other) const {
    double worst = 0.0;
    for (std::size_t k = 0; k < kBlocks; ++k) {
      worst = std::max({worst, (bodies[k].velocity_m_s - other.bodies[k].velocity_m_s).norm(),
                        0.02 * (bodies[k].angular_velocity_rad_s - other.bodies[k].angular_velocity_rad_s).norm()});
    }
    return worst;
  }
};

// One sweep after the other brings a stack to rest slowly. The block in the middle slides.
TEST(ContactSolver, GoesOnAlongItsWaysWhereBodiesPushEachOther) {
  constexpr int kSweeps = 24;
  Stack<3> exact;
  exact.bodies[1].velocity_m_s.x() = 0.02;
  Stack<3> plain = exact, together = exact;
  EXPECT_TRUE(exact.sweep(100'000));
  plain.sweep(kSweeps);
  together.solve_together(kSweeps);
  std::printf("off the solution after %d sweeps: %.2e m/s, along their ways %.2e m/s\n", kSweeps, plain.off_m_s(exact),
              together.off_m_s(exact));
  EXPECT_LT(together.off_m_s(exact), 0.1 * plain.off_m_s(exact));
  EXPECT_LT(together.off_m_s(exact), 1e-4);
}

// A stack of five that stands is pushed at its top, below what tips it or lets it slide: one linear problem has that.
TEST(ContactSolver, SolvesAtOnceWhatSticks) {
  constexpr int kSweeps = 12;
  constexpr double kPush_m_s = 1e-3;  // 0.1 N for a millisecond
  Stack<5> exact;
  EXPECT_TRUE(exact.sweep(1'000'000));
  exact.fall();
  exact.bodies.back().velocity_m_s.x() = kPush_m_s;
  Stack<5> plain = exact, together = exact;
  EXPECT_TRUE(exact.sweep(1'000'000));
  plain.sweep(kSweeps);
  together.solve_together(kSweeps);
  std::printf("off the solution after %d sweeps: %.2e m/s, at once %.2e m/s\n", kSweeps, plain.off_m_s(exact),
              together.off_m_s(exact));
  EXPECT_LT(exact.bodies.back().velocity_m_s.norm(), 0.01 * kPush_m_s) << "it stands";
  EXPECT_LT(together.off_m_s(exact), 0.2 * plain.off_m_s(exact));
}

// A body on a patch turns about one axis alone: the inverse of its inertia has no inverse, however it is turned.
TEST(ContactSolver, SolvesAtOnceWhatTurnsAboutOneAxisAlone) {
  constexpr std::size_t kBlocks = 5;
  const Vector3d axis = Vector3d(0.02, 1.0, -0.01).normalized();
  std::array<SolverBody, kBlocks> bodies;
  std::array<SolverContact, kBlocks> patches;
  for (std::size_t k = 0; k < kBlocks; ++k) {
    bodies[k] = block(Vector3d::Zero());
    bodies[k].inverse_inertia_per_kg_m2 = axis * axis.transpose() / 2e-5;
    patches[k] = floor_of(0.5);
    patches[k].normal = axis;
    patches[k].torsion_radius_m = 0.02;
    patches[k].a = static_cast<int>(k);
    patches[k].b = k > 0 ? static_cast<int>(k) - 1 : SolverContact::kFixed;
    patches[k].impulse_n_s = static_cast<double>(kBlocks - k) * kMassKg * kGravity * kStepS * Vector3d::UnitY();
  }
  bodies.back().velocity_m_s += Vector3d(1e-3, 0, 0);
  bodies.back().angular_velocity_rad_s = 0.02 * axis;
  haptic::prepare_contacts(bodies.data(), patches.data(), kBlocks);
  haptic::relax_contacts(bodies.data(), patches.data(), kBlocks, 1, 0.0);
  const auto fastest_m_s = [&bodies] {
    double out = 0.0;
    for (const SolverBody& body : bodies) {
      out = std::max({out, body.velocity_m_s.norm(), 0.02 * body.angular_velocity_rad_s.norm()});
    }
    return out;
  };
  const double after_a_sweep_m_s = fastest_m_s();
  ASSERT_TRUE(haptic::solve_what_sticks(bodies.data(), patches.data(), kBlocks));
  std::printf("they go at %.2e m/s after a sweep, then at %.2e m/s\n", after_a_sweep_m_s, fastest_m_s());
  EXPECT_LT(fastest_m_s(), 0.05 * after_a_sweep_m_s);
}

// Friction acts against the slip of each of its points: the faster a patch slides, the less of that is for its spin.
TEST(ContactSolver, APatchThatSlidesHardlyResistsSpin) {
  constexpr double kFriction = 0.4, kRadius_m = 0.02, kInertia_kg_m2 = 2e-5;
  const double bound_n_s = kFriction * kMassKg * kGravity * kStepS;
  for (const double spin_rad_s : {0.5, 5.0, 50.0}) {
    SolverBody bodies[1] = {block({0.1, 0, 0})};
    bodies[0].angular_velocity_rad_s = Vector3d(0, spin_rad_s, 0);
    bodies[0].inverse_inertia_per_kg_m2 = Eigen::Matrix3d::Identity() / kInertia_kg_m2;
    SolverContact contacts[1] = {floor_of(kFriction)};
    contacts[0].torsion_radius_m = kRadius_m;
    solve_contacts(bodies, contacts, 1, 1000, 1e-12);
    const double slides_n_s = -contacts[0].impulse_n_s.x(), spins_n_s = -contacts[0].torsion_n_m_s / kRadius_m;
    EXPECT_NEAR(std::hypot(slides_n_s, spins_n_s), bound_n_s, 1e-6 * bound_n_s) << spin_rad_s;
    const double slip_m_s = bodies[0].velocity_m_s.x(), rim_m_s = kRadius_m * bodies[0].angular_velocity_rad_s.y();
    EXPECT_NEAR(spins_n_s * slip_m_s, slides_n_s * rim_m_s, 1e-3 * bound_n_s * std::hypot(slip_m_s, rim_m_s))
        << spin_rad_s;
  }
}

TEST(ContactSolver, APatchResistsSpin) {
  SolverBody body = block({0, 0, 0});
  body.inverse_inertia_per_kg_m2 = Eigen::Matrix3d::Identity() / 1e-5;
  body.angular_velocity_rad_s = Vector3d(0, 0.5, 0);
  SolverBody bodies[1] = {body};
  SolverContact contacts[1] = {floor_of(0.4)};
  contacts[0].torsion_radius_m = 0.01;
  solve_contacts(bodies, contacts, 1, 12, kTolerance_m_s);
  // Bound: μ·N·radius in a step.
  const double stopped = 0.4 * kMassKg * kGravity * kStepS * 0.01 / 1e-5;
  EXPECT_NEAR(bodies[0].angular_velocity_rad_s.y(), 0.5 - stopped, 1e-6);
}

}  // namespace
