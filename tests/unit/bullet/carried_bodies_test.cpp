/// What a body carries is told as one with it, where all of them would be a pile.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "tests/unit/bullet/scenes.hpp"

namespace carried_bodies_test {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using physics::ContactSet;
using tests::body;
using tests::bullet;

constexpr double kGravity = 9.81, kRadius_m = 0.005, kTray_kg = 0.4;
const Vector3d kTray_m(0.16, 0.03, 0.08), kItem_m(0.03, 0.03, 0.03);

/// A tray on the floor, with eight boxes on it, and a proxy before its side.
struct Tray {
  std::unique_ptr<physics::World> world;
  ContactSet told;

  explicit Tray(double item_kg, const Vector3d& proxy_m = {0, 0.015, 0.04 + kRadius_m + 0.001}) {
    rtbus::config::Scene scene = tests::floor_scene();
    scene.deactivation.enabled = false;
    scene.bodies.push_back(body("tray", rtbus::shapes::Box{0.5 * kTray_m}, {0, 0.015, 0}, kTray_kg));
    for (int i = 0; i < 8; ++i) {
      scene.bodies.push_back(body("item" + std::to_string(i), rtbus::shapes::Box{0.5 * kItem_m}, item_m(i), item_kg));
    }
    world = bullet(scene, 30);
    world->add_proxy({"haptic0", 0.1, kRadius_m, 0.0, proxy_m});
    for (int i = 0; i < 500; ++i) world->step(1e-3);
    world->contacts(0, 0.002, told);
  }
  static Vector3d item_m(int i) { return {-0.06 + 0.04 * (i % 4), 0.045, -0.02 + 0.04 * (i / 4)}; }
};

Matrix3d of_box(const Vector3d& size_m, double mass_kg, const Vector3d& from_m) {
  const Vector3d square = size_m.cwiseProduct(size_m);
  const Vector3d own(square.y() + square.z(), square.x() + square.z(), square.x() + square.y());
  return mass_kg / 12.0 * Matrix3d(own.asDiagonal()) +
         mass_kg * (from_m.squaredNorm() * Matrix3d::Identity() - from_m * from_m.transpose());
}

TEST(BulletCarried, AreToldAsOneWithTheTray) {
  for (const double item_kg : {0.1, 0.02}) {
    SCOPED_TRACE(item_kg);
    const Tray tray(item_kg);
    const ContactSet& told = tray.told;
    ASSERT_EQ(told.bodies.size(), 1U);
    const physics::BodyBehind& as_one = told.bodies[0];
    const double all_kg = kTray_kg + 8.0 * item_kg;
    EXPECT_NEAR(1.0 / as_one.inverse_mass_per_kg, all_kg, 1e-6);

    const Vector3d centre_m(0, 0.015 + 0.03 * 8.0 * item_kg / all_kg, 0);
    EXPECT_LT((as_one.centre_m - centre_m).norm(), 0.1e-3);
    EXPECT_LT((as_one.centre_m + as_one.own_from_centre_m - tray.world->body_pose(1).position_m).norm(), 1e-9);
    Matrix3d inertia = of_box(kTray_m, kTray_kg, Vector3d(0, 0.015, 0) - centre_m);
    for (int i = 0; i < 8; ++i) inertia += of_box(kItem_m, item_kg, Tray::item_m(i) - centre_m);
    EXPECT_LT((as_one.inverse_inertia_per_kg_m2.inverse() - inertia).norm(), 0.01 * inertia.norm());

    double borne_n = 0.0;
    for (const physics::Support& support : told.supports) {
      EXPECT_EQ(support.holder, 0U);
      EXPECT_EQ(support.inverse_mass_per_kg, 0.0) << "the floor";
      borne_n += support.normal_force_n;
    }
    EXPECT_NEAR(borne_n, all_kg * kGravity, 0.02 * all_kg * kGravity);
    EXPECT_LT(as_one.external_force_n.norm(), 0.02 * all_kg * kGravity);
    EXPECT_LT(as_one.external_torque_n_m.norm(), 0.02 * all_kg * kGravity * 0.03);
  }
}

// A hand that pushes one of them may push it off: it is a body of its own then, unless it is light beside the rest.
TEST(BulletCarried, AreNotWhatAHandPushes) {
  for (const double item_kg : {0.2, 0.02}) {
    SCOPED_TRACE(item_kg);
    Tray tray(item_kg);
    tray.world->place_proxy(0, {0, 0.015, 0.046}, Vector3d::Zero());
    tray.world->apply_hand_force(0, 2, {0, -0.1, 0}, Vector3d::Zero());
    tray.world->step(1e-3);
    tray.world->contacts(0, 0.002, tray.told);
    const bool light = item_kg == 0.02;
    ASSERT_EQ(tray.told.bodies.size(), light ? 1U : 2U);
    EXPECT_NEAR(1.0 / tray.told.bodies[0].inverse_mass_per_kg, kTray_kg + (light ? 8 : 7) * item_kg, 1e-6);
    if (light) continue;
    EXPECT_EQ(tray.told.bodies[1].body, 2U);
    EXPECT_NEAR(1.0 / tray.told.bodies[1].inverse_mass_per_kg, item_kg, 1e-6);
    const auto on_tray = std::find_if(tray.told.supports.begin(), tray.told.supports.end(),
                                      [](const physics::Support& each) { return each.holder > 0; });
    EXPECT_NE(on_tray, tray.told.supports.end());
  }
}

// What lies on two touches both: it is in the way of neither alone.
TEST(BulletCarried, AreNotWhatLiesOnTwo) {
  rtbus::config::Scene scene = tests::floor_scene();
  scene.deactivation.enabled = false;
  for (const double x_m : {-0.04, 0.04}) {
    scene.bodies.push_back(
        body(x_m < 0 ? "left" : "right", rtbus::shapes::Box{{0.02, 0.02, 0.02}}, {x_m, 0.02, 0}, 0.02));
  }
  scene.bodies.push_back(body("plank", rtbus::shapes::Box{{0.06, 0.01, 0.02}}, {0, 0.05, 0}, 0.4));
  const auto world = bullet(scene, 30);
  world->add_proxy({"haptic0", 0.1, kRadius_m, 0.0, {-0.04, 0.02, 0.02 + kRadius_m + 0.001}});
  for (int i = 0; i < 300; ++i) world->step(1e-3);
  ContactSet told;
  world->contacts(0, 0.002, told);
  ASSERT_EQ(told.bodies.size(), 1U);
  EXPECT_NEAR(1.0 / told.bodies[0].inverse_mass_per_kg, 0.02, 1e-6);
}

// A light box on a heavy tray is held by something that goes as it goes.
TEST(BulletCarried, AreHeldByWhatIsMuchHeavier) {
  for (const double item_kg : {0.1, 0.02}) {
    const Tray tray(item_kg, Tray::item_m(1) + Vector3d(0, 0.015 + kRadius_m + 0.001, 0));
    ASSERT_EQ(tray.told.bodies.size(), 1U);
    ASSERT_FALSE(tray.told.supports.empty());
    for (const physics::Support& support : tray.told.supports) {
      EXPECT_NEAR(support.inverse_mass_per_kg, item_kg == 0.02 ? 0.0 : 1.0 / kTray_kg, 1e-9);
    }
  }
}

/// The way of a body in 4 s under 80 % of the friction bound of all, 8 mm above its centre.
double creeps_m(physics::World& world, double all_kg) {
  const std::size_t proxy = world.add_proxy({"haptic0", 0.1, kRadius_m, 0.0, {0, 0.5, 0}});
  world.place_proxy(proxy, {0, 0.5, 0}, Vector3d::Zero());
  for (int i = 0; i < 300; ++i) world.step(1e-3);
  const Vector3d force_n(0, 0, -0.8 * 0.25 * all_kg * kGravity);
  Vector3d began_m = Vector3d::Zero();
  for (int i = 0; i < 4700; ++i) {
    if (i == 700) began_m = world.body_pose(1).position_m;
    world.apply_hand_force(proxy, 1, force_n, Vector3d(0, 0.008, 0).cross(force_n));
    world.step(1e-3);
  }
  return (world.body_pose(1).position_m - began_m).norm();
}

// With the hand's moment as Bullet takes it these crept by 4.7 and 3.0 mm, and the light box flew off.
TEST(BulletCarried, AreHeldWithTheirCarrierUnderAHand) {
  for (const auto& [low_kg, high_kg, most_m] : {std::array{0.4, 0.02, 1e-6}, std::array{0.02, 0.4, 0.1e-3}}) {
    rtbus::config::Scene scene = tests::floor_scene();
    scene.deactivation.enabled = false;
    scene.bodies.push_back(body("low", rtbus::shapes::Box{{0.02, 0.015, 0.02}}, {0, 0.015, 0}, low_kg));
    scene.bodies.push_back(body("high", rtbus::shapes::Box{{0.02, 0.015, 0.02}}, {0, 0.045, 0}, high_kg));
    EXPECT_LT(creeps_m(*bullet(scene), low_kg + high_kg), most_m) << low_kg;
  }
  EXPECT_LT(creeps_m(*Tray(0.05).world, kTray_kg + 8 * 0.05), 0.2e-3) << "friction of a pile creeps a little";
}

}  // namespace carried_bodies_test
