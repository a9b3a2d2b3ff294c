/// Bodies that move, whose true shape local_contact knows: met where they are by now, on one answer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Geometry>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"
#include "tests/unit/haptic/held_world.hpp"

namespace moving_shape_test {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using rtbus::array_of;
using rtbus::ProxyContacts;
using rtbus::shapes::KnownShape;

constexpr double kRadius_m = 0.004, kStiffness = 500.0;
const Vector3d kHalf_m(0.02, 0.01, 0.015);

rtbus::shapes::Hull corners(const Quaterniond& q, const Vector3d& p) {
  rtbus::shapes::Hull out;
  for (int i = 0; i < 8; ++i) {
    const Vector3d sign((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
    out.points_m.emplace_back(p + q * sign.cwiseProduct(kHalf_m));
  }
  return out;
}

double distance_m(const KnownShape& known, const Vector3d& p_B) {
  if (const auto* box = std::get_if<rtbus::shapes::Box>(&known.shape)) return nearest_surface(*box, p_B).distance_m;
  if (const auto* rod = std::get_if<rtbus::shapes::Capsule>(&known.shape)) return nearest_surface(*rod, p_B).distance_m;
  if (const auto* can = std::get_if<rtbus::shapes::Cylinder>(&known.shape)) {
    return nearest_surface(*can, p_B).distance_m;
  }
  rtbus::shapes::NearestFeature cold;
  Vector3d at = p_B;
  (void)nearest_point(std::get<rtbus::shapes::Hull>(known.shape), p_B, cold, at);
  return (p_B - at).norm();
}

/// What an answer says of one body.
struct Told {
  Vector3d centre_m, velocity_m_s, rate_rad_s;
  Quaterniond q_WB = Quaterniond::Identity();
  Vector3d origin_B_m = Vector3d::Zero();  ///< Of the body's frame from the centre, in its axes.
  double mass_kg = 0.0;                    ///< 0: it moves by itself.
};

ProxyContacts answer_of(const Told& told, const Vector3d& point_m, const Vector3d& normal, std::uint64_t sample_ns) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.device_time_ns = sample_ns;
  out.step_s = 1.0;
  out.proxy_radius_m = kRadius_m;
  out.contacts = out.bodies = 1;
  out.contact_point_m[0] = array_of(point_m);
  out.contact_normal[0] = array_of(normal);
  out.body_kind[0] = told.mass_kg > 0.0 ? 2 : 1;
  out.body_centre_m[0] = array_of(told.centre_m);
  out.body_velocity_m_s[0] = array_of(told.velocity_m_s);
  out.body_angular_velocity_rad_s[0] = array_of(told.rate_rad_s);
  out.body_orientation_wxyz[0] = {told.q_WB.w(), told.q_WB.x(), told.q_WB.y(), told.q_WB.z()};
  out.body_origin_from_centre_m[0] = array_of(Vector3d(told.q_WB * told.origin_B_m));
  if (told.mass_kg <= 0.0) return out;
  out.body_inverse_mass_per_kg[0] = 1.0 / told.mass_kg;
  const Vector3d square = 4.0 * kHalf_m.cwiseAbs2();
  const Vector3d inertia =
      told.mass_kg / 12.0 * Vector3d(square.y() + square.z(), square.x() + square.z(), square.x() + square.y());
  const Eigen::Matrix3d inverse = inertia.cwiseInverse().asDiagonal();
  out.body_inverse_inertia_per_kg_m2[0] = {inverse(0, 0), 0, 0, inverse(1, 1), 0, inverse(2, 2)};
  return out;
}

struct Case {
  std::string name;
  KnownShape known;
};
void PrintTo(const Case& each, std::ostream* out) { *out << each.name; }

std::vector<Case> cases() {
  std::vector<Case> out{{"Box", {rtbus::shapes::Box{kHalf_m}, 0, false}},
                        {"Capsule", {rtbus::shapes::Capsule{0.01, 0.05}, 0, false}},
                        {"Cylinder", {rtbus::shapes::Cylinder{0.015, 0.03}, 0, false}},
                        {"Hull", {corners(Quaterniond::Identity(), {0.001, -0.002, 0.001}), 0, false}}};
  out.back().known.body = 0;
  return out;
}

class MovingShape : public testing::TestWithParam<Case> {};

// A tumbling body that moves by itself, told once, 80 ms ago: the proxy touches it where it is, or is away from it.
TEST_P(MovingShape, IsTouchedWhereItIsNow) {
  tests::HeldWorld held(kStiffness, 0.5, std::vector{GetParam().known});
  constexpr double kAge_s = 0.08;
  Told told;
  told.centre_m = {0.01, 0.02, -0.01};
  told.velocity_m_s = {0.01, 0.02, 0.0};
  told.rate_rad_s = {1.0, -0.5, 3.0};
  told.q_WB = Quaterniond(AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()));
  told.origin_B_m = {0.003, -0.002, 0.001};
  const auto gap_m = [&](const Vector3d& p_W, double t_s) {
    const double rate = told.rate_rad_s.norm();
    const Quaterniond q_WB = Quaterniond(AngleAxisd(rate * t_s, told.rate_rad_s / rate)) * told.q_WB;
    const Vector3d origin_m = told.centre_m + t_s * told.velocity_m_s + q_WB * told.origin_B_m;
    return distance_m(GetParam().known, q_WB.conjugate() * (p_W - origin_m)) - kRadius_m;
  };
  Vector3d proxy_m = told.centre_m + Vector3d(0, 0.05, 0);
  while (gap_m(proxy_m, kAge_s) > 0.0) proxy_m.y() -= 1e-6;
  held.reset(proxy_m);
  (void)held.tick(proxy_m);
  const std::uint64_t began_ns = held.now_ns - static_cast<std::uint64_t>(kAge_s * 1e9);
  // As physics would tell it of then: some plane of the body.
  held.world->take(answer_of(told, proxy_m - Vector3d(0, kRadius_m, 0), Vector3d::UnitY(), began_ns), held.now_ns);
  int touched = 0;
  for (int i = 1; i <= 600; ++i) {
    const bool touches = !held.tick(Vector3d(proxy_m - Vector3d(0, 0.002, 0))).isZero(0.0);
    const double apart_m = gap_m(held.world->position_m(), kAge_s + 1e-3 * i);
    if (i < 5) continue;  // what a tick without friction slides along an edge
    ASSERT_GE(apart_m, -2e-5) << "tick " << i;
    // What slides off a rim goes straight for a tick.
    const bool slides = held.world->velocity_m_s().norm() > 0.1;
    if (!touches || slides) continue;
    ++touched;
    ASSERT_LE(apart_m, 2e-5) << "tick " << i;
  }
  EXPECT_GT(touched, 200);
}
INSTANTIATE_TEST_SUITE_P(Driven, MovingShape, testing::ValuesIn(cases()),
                         [](const auto& each) { return each.param.name; });

/// Pushes a spinning block of 0.5 kg in the air, off its middle. @returns the forces on the hand.
std::vector<Vector3d> push(const KnownShape& known, const Quaterniond& q_BF, const Vector3d& origin_F_m) {
  tests::HeldWorld held(kStiffness, 0.5, std::vector{known});
  Told told;
  told.centre_m.setZero();
  told.velocity_m_s = {0, 0.01, 0};
  told.rate_rad_s = {0.5, 0.0, 2.0};
  told.q_WB = q_BF;
  told.origin_B_m = origin_F_m;
  told.mass_kg = 0.5;
  held.reset({0.015, 0.0145, 0.004});
  held.world->take(answer_of(told, {0.015, 0.01, 0.004}, Vector3d::UnitY(), held.now_ns), held.now_ns);
  std::vector<Vector3d> out;
  for (int i = 0; i < 400; ++i) {
    out.push_back(held.tick(Vector3d(0.015, 0.014 - 4e-5 * i, 0.004), Vector3d(0, -0.04, 0)));
    held.world->felt(held.world->impulse_n_s());
  }
  return out;
}

// The hull has its own frame, turned and away from the centre of mass.
TEST(MovingHull, OfTheCornersOfABoxIsPushedLikeTheBox) {
  const KnownShape box{rtbus::shapes::Box{kHalf_m}, 0, false};
  const Quaterniond q_BF(AngleAxisd(1.1, Vector3d(2, -1, 1).normalized()));
  const Vector3d centre_F_m(0.004, 0.007, -0.002);
  const KnownShape hull{corners(q_BF.conjugate(), centre_F_m), 0, false};
  const auto truth = push(box, Quaterniond::Identity(), Vector3d::Zero());
  const auto felt = push(hull, q_BF, -centre_F_m);
  double largest_n = 0.0, apart_n = 0.0;
  Vector3d least = Vector3d::Constant(1.0), most = -least;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    largest_n = std::max(largest_n, truth[i].norm());
    apart_n = std::max(apart_n, (truth[i] - felt[i]).norm());
    if (truth[i].norm() < 0.1) continue;
    least = least.cwiseMin(truth[i].normalized());
    most = most.cwiseMax(truth[i].normalized());
  }
  EXPECT_GT(largest_n, 0.3);
  EXPECT_GT((most - least).maxCoeff(), 0.3) << "it turns under the hand";
  EXPECT_LE(apart_n, 1e-6);
}

// It is a plane as it is told where its orientation is not: an engine that does not know it says so.
TEST(MovingHull, WithoutAnOrientationIsThePlaneThatIsTold) {
  const KnownShape hull{corners(Quaterniond::Identity(), Vector3d::Zero()), 0, false};
  tests::HeldWorld held(kStiffness, 0.5, std::vector{hull});
  Told told;
  told.centre_m = told.velocity_m_s = told.rate_rad_s = Vector3d::Zero();
  ProxyContacts answer = answer_of(told, {0, 0.01, 0}, Vector3d::UnitY(), held.now_ns);
  answer.body_orientation_wxyz[0] = {};
  held.reset({0.018, 0.0141, 0});
  held.world->take(answer, held.now_ns);
  for (int i = 0; i < 300; ++i) (void)held.tick(Vector3d(0.018 + 1e-4 * i, 0.012, 0));
  EXPECT_NEAR(held.world->position_m().y(), 0.01 + kRadius_m, 1e-6) << "20 mm beyond the hull's edge";
}

}  // namespace moving_shape_test
