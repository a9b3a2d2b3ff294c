/// Free bodies that push each other in the world of local_contact, between two answers and when one is taken.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"
#include "tests/unit/haptic/held_world.hpp"

namespace free_group_test {
namespace {

using haptic::LocalWorld;
using rtbus::ProxyContacts;

constexpr double kStiffness = 500.0, kDamping = 0.5;

/// A body at rest in free space, whose face at x = 0 looks along +x.
ProxyContacts body(double mass_kg, std::uint64_t sample_ns) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.device_time_ns = sample_ns;
  out.step_s = 0.05;
  out.contacts = out.bodies = 1;
  out.contact_normal[0] = {1, 0, 0};
  out.body_kind[0] = 2;
  out.body_inverse_mass_per_kg[0] = 1.0 / mass_kg;
  out.body_centre_m[0] = {-0.01, 0, 0};
  return out;
}

/// One of 0.1 kg, and another one behind it that it pushes: nothing else holds them.
ProxyContacts pair_of(double far_kg, std::uint64_t sample_ns) {
  ProxyContacts out = body(0.1, sample_ns);
  out.bodies = 2;
  out.body_index[1] = 1;
  out.body_kind[1] = 2;
  out.body_inverse_mass_per_kg[1] = 1.0 / far_kg;
  out.body_centre_m[1] = {-0.03, 0, 0};
  out.supports = 1;
  out.support_holder[0] = 2;
  out.support_normal[0] = {1, 0, 0};
  out.support_point_m[0] = {-0.02, 0, 0};
  out.support_inverse_mass_per_kg[0] = 1.0 / far_kg;
  out.support_points[0] = 1;
  return out;
}

struct FreeGroup : testing::Test, tests::HeldWorld {
  FreeGroup() : HeldWorld(kStiffness, kDamping) {}
};

/// What a hand feels that goes into it by 1 mm in 10 ms, and stays: in each of 20 ms, of an answer of 30 ms before.
std::vector<double> pushed_n(tests::HeldWorld& test, ProxyContacts (*told)(double, std::uint64_t), double kg) {
  test.world = std::make_unique<LocalWorld>();
  test.reset({0, 0, 0});
  test.tick(0.0);
  test.world->take(told(kg, test.now_ns), test.now_ns);
  std::vector<double> out;
  for (int i = 0; i < 30; ++i) {
    if (i == 20) test.world->take(told(kg, test.now_ns - 20 * rtbus::kNsPerMs), test.now_ns);
    out.push_back(test.tick(-1e-4 * std::min(i, 10)));
  }
  return out;
}

// What is pushed and what that pushes are one mass, between two answers and when one is taken.
TEST_F(FreeGroup, FeelsABodyAndWhatItPushesAsOneMass) {
  const auto one = [](double kg, std::uint64_t sample_ns) { return body(0.1 + kg, sample_ns); };
  const std::vector<double> alone = pushed_n(*this, one, 0.0);
  const std::vector<double> both = pushed_n(*this, pair_of, 0.3), sum = pushed_n(*this, one, 0.3);
  for (std::size_t i = 0; i < both.size(); ++i) EXPECT_NEAR(both[i], sum[i], 2e-3) << i;
  EXPECT_GT(both[15], 1.2 * alone[15]);
}

// A body of a pile that bounces is one for an answer more. A box that stands near it goes on without it.
TEST_F(FreeGroup, GoesOnBesideOneOfAPileThatBounces) {
  using rtbus::shapes::Box;
  using rtbus::shapes::KnownShape;
  const Eigen::Vector3d half_m(0.01, 0.01, 0.01);
  const haptic::KnownShapes known(
      {KnownShape{Box{half_m}, 0, false}, KnownShape{Box{half_m}, 1, false},
       KnownShape{rtbus::shapes::Plane{}, 2, true, Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, -0.01, 0)}});
  const auto told = [this](bool piled) {
    ProxyContacts out = pair_of(0.1, now_ns);
    out.body_orientation_wxyz[0] = out.body_orientation_wxyz[1] = {1, 0, 0, 0};
    out.body_inverse_inertia_per_kg_m2[0] = out.body_inverse_inertia_per_kg_m2[1] = {1e5, 0, 0, 1e5, 0, 1e5};
    out.body_centre_m[1] = {-0.035, 0, 0};
    out.supports = 2;
    out.support_points[0] = piled ? 1 : 0;
    out.support_holder[0] = piled ? 0 : 2;
    out.support_body[0] = piled ? 1 : 0;
    out.support_normal[1] = {0, 1, 0};
    out.support_point_m[1] = {-0.01, -0.01, 0};
    out.support_points[1] = 4;
    return out;
  };
  const auto felt_n = [&](bool near) {
    world = std::make_unique<LocalWorld>(known);
    reset({0, 0, 0});
    world->take(told(true), now_ns);
    for (int i = 0; i < 20; ++i) tick(-5e-5 * i);
    std::vector<double> out;
    for (int answers = 0; answers < 3; ++answers) {
      ProxyContacts bounces = told(false);
      if (!near) bounces.support_body[0] = 1;  // it holds itself: nobody is near
      if (!near) bounces.support_holder[0] = 2;
      bounces.device_time_ns -= 20 * rtbus::kNsPerMs;
      bounces.body_velocity_m_s[0] = {0, 0, 0.1};  // so far that its corners are found anew on the way
      world->take(bounces, now_ns);
      for (int i = 0; i < 20; ++i) out.push_back(tick(-1e-3));
    }
    return out;
  };
  const std::vector<double> beside_n = felt_n(true), alone_n = felt_n(false);
  for (std::size_t i = 0; i < alone_n.size(); ++i) EXPECT_NEAR(beside_n[i], alone_n[i], 1e-3) << i;
  EXPECT_GT(*std::max_element(alone_n.begin(), alone_n.end()), 0.1);
}

}  // namespace
}  // namespace free_group_test
