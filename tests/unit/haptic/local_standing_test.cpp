/// Contacts of local_contact on static bodies whose true shape it knows, between two answers of physics.
#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

namespace {

using Eigen::Vector3d;
using haptic::LocalWorld;
using rtbus::ProxyContacts;

constexpr double kStepS = 1e-3, kStiffness = 500.0;
constexpr std::uint64_t kBegin_ns = 1000 * rtbus::kNsPerMs;

/// An answer that has one contact, on a static body, the first of the scene; the next answer is a second away.
ProxyContacts names_body_0(double proxy_radius_m, std::uint64_t sample_ns) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.device_time_ns = sample_ns;
  out.step_s = 1.0;
  out.contacts = out.bodies = 1;
  out.contact_normal[0] = {0, 1, 0};
  out.proxy_radius_m = proxy_radius_m;
  return out;
}

/// A cube of 20 mm around the origin, as the hull of its corners or as twelve triangles.
rtbus::shapes::StandingShape cube_of(bool triangles) {
  rtbus::shapes::Hull corners;
  for (int i = 0; i < 8; ++i) {
    corners.points_m.emplace_back((i & 1) != 0 ? 0.01 : -0.01, (i & 2) != 0 ? 0.01 : -0.01,
                                  (i & 4) != 0 ? 0.01 : -0.01);
  }
  rtbus::shapes::StandingShape out;
  if (triangles) {
    out.shape = std::make_shared<const rtbus::shapes::Surface>(corners.points_m,
                                                               std::vector<std::array<std::uint32_t, 3>>{{0, 1, 3},
                                                                                                         {0, 3, 2},
                                                                                                         {4, 5, 7},
                                                                                                         {4, 7, 6},
                                                                                                         {0, 1, 5},
                                                                                                         {0, 5, 4},
                                                                                                         {2, 3, 7},
                                                                                                         {2, 7, 6},
                                                                                                         {0, 2, 6},
                                                                                                         {0, 6, 4},
                                                                                                         {1, 3, 7},
                                                                                                         {1, 7, 5}});
  } else {
    out.shape = corners;
  }
  return out;
}

class KnownShape : public testing::TestWithParam<bool> {};

// One answer tells the top of the cube as a plane, and no other comes.
TEST_P(KnownShape, IsFollowedAroundItsEdgeWithoutNewsOfIt) {
  const auto world = std::make_unique<LocalWorld>(std::vector{cube_of(GetParam())});
  std::uint64_t now_ns = kBegin_ns;
  constexpr double kRadius_m = 0.004;
  world->reset({0, 0.0142, 0});
  ProxyContacts top = names_body_0(kRadius_m, now_ns);
  top.contact_point_m[0] = {0, 0.01, 0};
  world->take(top, now_ns);
  // Around the corner from above, 2 mm deep: along the top, then down the side.
  for (int i = 0; i <= 400; ++i) {
    const double along_m = 1e-4 * i;
    const Vector3d hand = along_m < 0.012 ? Vector3d(along_m, 0.012, 0) : Vector3d(0.012, 0.012 - (along_m - 0.012), 0);
    now_ns += rtbus::kNsPerMs;
    world->advance({hand, Vector3d::Zero(), kStiffness, 0.0}, now_ns, kStepS);
    const Vector3d outside = (world->position_m().cwiseAbs() - Vector3d::Constant(0.01)).cwiseMax(0.0);
    ASSERT_NEAR(outside.norm(), kRadius_m, 5e-6) << "hand at " << hand.transpose();
    if (hand.y() < -0.005) break;
  }
  EXPECT_NEAR(world->position_m().x(), 0.014, 5e-6) << "beside the cube";
}
INSTANTIATE_TEST_SUITE_P(As, KnownShape, testing::Bool(),
                         [](const auto& each) { return each.param ? "Triangles" : "Hull"; });

// A closed box of triangles around the proxy; the hand is thrown about outside of it, without any damping: the free way
// of a tick is tens of millimetres long.
TEST(KnownSurface, HoldsHoweverFarTheHandIsBehindThem) {
  const auto world = std::make_unique<LocalWorld>(std::vector{cube_of(true)});
  std::uint64_t now_ns = kBegin_ns;
  constexpr double kRadius_m = 0.002;
  world->reset({0, 0, 0});
  ProxyContacts named = names_body_0(kRadius_m, now_ns);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> even(-0.08, 0.08);
  Vector3d hand = Vector3d::Zero();
  double largest_way_m = 0.0;
  for (int i = 0; i < 20000; ++i) {
    if (i % 200 == 0) {
      named.device_time_ns = now_ns;
      world->take(named, now_ns);
    }
    if (i % 7 == 0) hand = {even(random), even(random), even(random)};
    const Vector3d before = world->position_m();
    now_ns += rtbus::kNsPerMs;
    world->advance({hand, Vector3d::Zero(), kStiffness, 0.0}, now_ns, kStepS);
    largest_way_m = std::max(largest_way_m, (world->position_m() - before).norm());
    ASSERT_LE(world->position_m().cwiseAbs().maxCoeff(), 0.01 - kRadius_m + 1e-9) << "tick " << i;
    const Vector3d force_n = world->impulse_n_s() / kStepS;
    ASSERT_LE(force_n.norm(), kStiffness * (hand - before).norm() + 1e-9);
  }
  EXPECT_GT(largest_way_m, 0.002) << "it moved";
}

// The hand goes into a groove of triangles: both sides push, and the force is that of the spring.
TEST(KnownSurface, OfAGroovePushesFromBothSides) {
  constexpr double kSide_m = 0.05, kRadius_m = 0.005;
  const std::vector<Vector3d> vertices_m{
      {-kSide_m, kSide_m, -kSide_m}, {-kSide_m, kSide_m, kSide_m}, {0, 0, -kSide_m}, {0, 0, kSide_m},
      {kSide_m, kSide_m, -kSide_m},  {kSide_m, kSide_m, kSide_m}};
  rtbus::shapes::StandingShape groove;
  groove.shape = std::make_shared<const rtbus::shapes::Surface>(
      vertices_m, std::vector<std::array<std::uint32_t, 3>>{{0, 1, 3}, {0, 3, 2}, {2, 3, 5}, {2, 5, 4}});
  const auto world = std::make_unique<LocalWorld>(std::vector{groove});
  std::uint64_t now_ns = kBegin_ns;
  world->reset({0, 0.02, 0});
  ProxyContacts named = names_body_0(kRadius_m, now_ns);
  world->take(named, now_ns);
  Vector3d force_n = Vector3d::Zero();
  for (int i = 0; i < 500; ++i) {
    now_ns += rtbus::kNsPerMs;
    world->advance({Vector3d(0.0002, 0.02 - 4e-5 * i, 0), Vector3d::Zero(), kStiffness, 0.0}, now_ns, kStepS);
    force_n = world->impulse_n_s() / kStepS;
  }
  const Vector3d bottom(0, kRadius_m * std::numbers::sqrt2, 0), hand(0.0002, 0.02 - 4e-5 * 499, 0);
  EXPECT_LT((world->position_m() - bottom).norm(), 1e-6);
  EXPECT_LT((force_n - kStiffness * (bottom - hand)).norm(), 2e-3);
}

}  // namespace
