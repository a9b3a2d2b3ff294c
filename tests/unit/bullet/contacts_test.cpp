/// What Bullet says about bodies behind the contacts, against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "rtbus/shapes/surface.hpp"
#include "tests/unit/bullet/scenes.hpp"

namespace {

using physics::BodyKind;
using physics::ContactSet;
using tests::body;
using tests::bullet;
using tests::Vector3d;

constexpr double kRadiusM = 0.005;
constexpr double kGravity = 9.81;

ContactSet ask(const physics::World& world, double radius_m = 0.002) {
  ContactSet out;
  world.contacts(0, radius_m, out);
  return out;
}

void run(physics::World& world, const Vector3d& target_m, int steps, double K = 200.0, double B = 6.0) {
  for (int i = 0; i < steps; ++i) {
    world.set_proxy_target(0, {target_m, Vector3d::Zero(), K, B});
    world.step(1e-3);
  }
}

/// A block on the floor, and the proxy in front of its face at z = 0.
struct BlockOnFloor {
  explicit BlockOnFloor(double mass_kg = 0.5) {
    scene = tests::floor_scene();
    scene.bodies.push_back(body("block", rtbus::shapes::Box{{0.03, 0.02, 0.02}}, {0, 0.02, -0.02}, mass_kg));
    scene.bodies[1].friction = 0.4;
    world = bullet(scene, 20);
    world->add_proxy({"haptic0", 0.1, kRadiusM, 0.0, {0, 0.02, kRadiusM + 0.001}});
  }
  rtbus::config::Scene scene;
  std::unique_ptr<physics::World> world;
};

// A cube pushed at its centre answers with its mass; off the centre it turns as well: 1/m + a²/I along the push, with
// I = m·e²/6.
TEST(BulletContacts, GiveTheEffectiveMassOfAFreeCube) {
  constexpr double kEdgeM = 0.02, kMassKg = 0.03;
  const double inertia = kMassKg * kEdgeM * kEdgeM / 6.0;
  for (const double off_m : {0.0, 0.006}) {
    rtbus::config::Scene scene;
    scene.file = "test.yaml";
    scene.gravity_m_s2.setZero();
    scene.bodies.push_back(
        body("cube", rtbus::shapes::Box{Vector3d::Constant(0.5 * kEdgeM)}, {0.1, 0.2, 0.3}, kMassKg));
    const auto world = bullet(scene);
    world->add_proxy({"haptic0", 0.1, kRadiusM, 0.0, {0.1 - 0.5 * kEdgeM - kRadiusM - 0.001, 0.2 + off_m, 0.3}});
    const ContactSet set = ask(*world);
    ASSERT_EQ(set.contacts.size(), 1U);
    const physics::Contact& contact = set.contacts[0];
    EXPECT_NEAR(contact.gap_m, 0.001, 1e-7);
    EXPECT_EQ(set.bodies[0].kind, BodyKind::kDynamic);
    EXPECT_NEAR(set.bodies[0].inverse_mass_per_kg, 1.0 / kMassKg, 1e-4);
    EXPECT_NEAR((set.bodies[0].centre_m - Vector3d(0.1, 0.2, 0.3)).norm(), 0.0, 1e-7);
    // r = (−e/2, off, 0): W = 1/m·1 + ((r·r)·1 − r·rᵀ)/I for a cube.
    const Vector3d r(-0.5 * kEdgeM, off_m, 0.0);
    const Eigen::Matrix3d expected = Eigen::Matrix3d::Identity() / kMassKg +
                                     (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose()) / inertia;
    EXPECT_NEAR((contact.inverse_mass_per_kg - expected).norm() / expected.norm(), 0.0, 1e-5) << off_m;
    EXPECT_NEAR(contact.inverse_mass_per_kg(0, 0), 1.0 / kMassKg + off_m * off_m / inertia, 1e-2) << off_m;

    // And Bullet moves it so: a push along x for a while gives the point that speed.
    world->set_proxy_target(0, {{0.2, 0.2 + off_m, 0.3}, Vector3d::Zero(), 50.0, 1.0});
    double impulse = 0.0;
    for (int i = 0; i < 30 && impulse < 1e-5; ++i) {
      world->step(1e-3);
      impulse -= world->proxy(0).contact_force_n.x() * 1e-3;
    }
    ASSERT_GT(impulse, 1e-5);
    const ContactSet after = ask(*world);
    ASSERT_EQ(after.contacts.size(), 1U);
    EXPECT_NEAR(after.contacts[0].surface_velocity_m_s.x() / (impulse * expected(0, 0)), 1.0, 0.02) << off_m;
  }
}

TEST(BulletContacts, GiveTheFrictionBoundOfABlockOnAFloor) {
  for (const double mass_kg : {0.1, 0.5}) {
    BlockOnFloor block(mass_kg);
    block.scene.deactivation.enabled = false;
    block.world = bullet(block.scene, 20);
    block.world->add_proxy({"haptic0", 0.1, kRadiusM, 0.0, {0, 0.02, kRadiusM + 0.001}});
    for (int i = 0; i < 300; ++i) block.world->step(1e-3);
    const ContactSet set = ask(*block.world);
    ASSERT_EQ(set.bodies.size(), 1U);
    const double bound_n = 0.5 * 0.4 * mass_kg * kGravity;
    EXPECT_NEAR(set.bodies[0].friction_bound_n, bound_n, 0.02 * bound_n) << mass_kg;
    EXPECT_NEAR(set.bodies[0].external_force_n.norm(), 0.0, 0.02 * mass_kg * kGravity) << "gravity against the floor";
    ASSERT_EQ(set.supports.size(), 1U);
    EXPECT_NEAR(set.supports[0].normal.y(), 1.0, 1e-6);
    EXPECT_NEAR(set.supports[0].normal_force_n, mass_kg * kGravity, 0.02 * mass_kg * kGravity);
    EXPECT_NEAR(set.supports[0].friction, 0.2, 1e-6);
    EXPECT_NEAR(set.supports[0].point_m.y(), 0.0, 1e-4);
  }
}

// A box that slides loses some of its four points for a step or two, at times all but one.
TEST(BulletContacts, TellThatABoxLiesFlatHoweverManyPointsCarry) {
  BlockOnFloor block;
  std::size_t told = 0;
  for (int i = 0; i < 400; ++i) {
    run(*block.world, {0, 0.015, kRadiusM - 0.002 - 1e-4 * i}, 1);
    for (const physics::Support& support : ask(*block.world).supports) {
      EXPECT_GE(support.points, 3U) << i;
      ++told;
    }
  }
  EXPECT_GT(told, 200U);
  EXPECT_LT(block.world->body_pose(1).position_m.z(), -0.03) << "it was pushed away";
}

// On an edge it is told by both ends, or it would roll and spin about the middle. So it is when it has hardly tipped.
TEST(BulletContacts, TellBothEndsOfAnEdge) {
  for (const double angle : {0.05, 3e-3}) {
    BlockOnFloor tilted;
    tilted.scene.bodies.back().q_WB = Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitX()));
    tilted.scene.bodies.back().p_WB.y() += 0.02 * std::sin(angle);
    tilted.world = bullet(tilted.scene, 20);
    tilted.world->add_proxy({"haptic0", 0.1, kRadiusM, 0.0, {0, 0.02, kRadiusM + 0.001}});
    std::vector<physics::Support> supports;
    for (int i = 0; i < 30 && (supports.empty() || supports[0].points != 2); ++i) {
      tilted.world->step(1e-3);
      supports = ask(*tilted.world).supports;
    }
    ASSERT_EQ(supports.size(), 2U) << angle;
    EXPECT_NEAR(std::abs(supports[0].point_m.x()), 0.03, 1e-4);
    EXPECT_NEAR(supports[0].point_m.x() + supports[1].point_m.x(), 0.0, 1e-4);
    EXPECT_NEAR(supports[0].point_m.z(), supports[1].point_m.z(), 1e-4);
    EXPECT_GT(supports[0].normal_force_n, 0.0);
    EXPECT_GT(supports[1].normal_force_n, 0.0);
  }
}

TEST(BulletContacts, TellFrictionAndTheHandApartWhileABlockIsPushed) {
  BlockOnFloor block;
  run(*block.world, {0, 0.015, kRadiusM - 0.002}, 500);  // 2 mm · 200 N/m: below the bound, it sticks
  // Sticking friction changes sign and size from step to step in Bullet; its mean is what holds.
  constexpr int kSteps = 400;
  double hand_n = 0.0, friction_n = 0.0, external_n = 0.0, bound_n = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    run(*block.world, {0, 0.015, kRadiusM - 0.002}, 1);
    const ContactSet set = ask(*block.world);
    ASSERT_EQ(set.bodies.size(), 1U);
    EXPECT_NEAR((set.bodies[0].proxy_force_n + block.world->proxy(0).contact_force_n).norm(), 0.0, 1e-3) << "third law";
    hand_n += set.bodies[0].proxy_force_n.z() / kSteps;
    friction_n += set.bodies[0].friction_force_n.z() / kSteps;
    external_n += set.bodies[0].external_force_n.z() / kSteps;
    bound_n += set.bodies[0].friction_bound_n / kSteps;
  }
  EXPECT_NEAR(hand_n, -0.4, 0.08);  // the block gives way by some tenths of a millimetre before it holds
  EXPECT_NEAR(friction_n, -hand_n, 0.05) << "the floor holds against it";
  EXPECT_NEAR(external_n, 0.0, 0.01) << "and that is not counted twice";
  EXPECT_NEAR(bound_n, 0.2 * 0.5 * kGravity, 0.02);
}

TEST(BulletContacts, KeepTheBoundOfASleepingBlockAndEstimateThatOfOneThatNeverWoke) {
  BlockOnFloor block;
  block.world = bullet(block.scene);
  block.world->add_proxy(
      {"haptic0", 0.1, kRadiusM, 0.0, {0, 0.02, kRadiusM + 0.02}});  // within 10 mm it keeps it awake
  for (int i = 0; i < 2000 && block.world->awake_bodies() > 0; ++i) block.world->step(1e-3);
  ASSERT_EQ(block.world->awake_bodies(), 0U);
  const ContactSet slept = ask(*block.world, 0.03);
  ASSERT_EQ(slept.bodies.size(), 2U);  // the floor is nearer
  ASSERT_EQ(slept.bodies[1].body, 1U);
  EXPECT_NEAR(slept.bodies[1].friction_bound_n, 0.2 * 0.5 * kGravity, 0.05);
  EXPECT_EQ(slept.bodies[1].external_force_n.norm(), 0.0);

  block.scene.bodies[1].asleep = true;
  block.world = bullet(block.scene);
  block.world->add_proxy({"haptic0", 0.1, kRadiusM, 0.0, {0, 0.02, kRadiusM + 0.001}});
  EXPECT_NEAR(ask(*block.world).bodies.at(0).friction_bound_n, 0.4 * 0.4 * 0.5 * kGravity, 1e-4);
}

TEST(BulletContacts, GiveTheVelocityOfATurningSurface) {
  rtbus::config::Scene scene = tests::floor_scene();
  rtbus::config::Body table = body("table", rtbus::config::Cylinder{0.1, 0.02}, {0.5, 0.05, 0});
  table.type = rtbus::config::BodyType::kKinematic;
  table.motion = rtbus::config::SpinMotion{Vector3d::UnitY(), 3.0, 0.1, 0.0};
  scene.bodies.push_back(table);
  const auto world = bullet(scene);
  const Vector3d at(0.55, 0.06 + kRadiusM + 0.001, 0);
  world->add_proxy({"haptic0", 0.1, kRadiusM, 0.5, at});
  run(*world, at, 400);
  const ContactSet set = ask(*world);
  ASSERT_EQ(set.contacts.size(), 1U);
  EXPECT_NEAR(set.contacts[0].gap_m, 0.001, 1e-6);
  EXPECT_NEAR((set.contacts[0].surface_velocity_m_s - Vector3d(0, 0, -3.0 * 0.05)).norm(), 0.0, 1e-3);
  EXPECT_EQ(set.bodies[0].kind, BodyKind::kKinematic);
  EXPECT_EQ(set.contacts[0].inverse_mass_per_kg.norm(), 0.0);
}

// The rounded edge of a cylinder, the skin of a hull, the faces of a mesh: at the gap that is told Bullet itself
// touches.
TEST(BulletContacts, AgreeWithWhereBulletStopsTheProxy) {
  auto points = std::make_shared<rtbus::config::TriangleMesh>();
  points->vertices_m = {{0.03, 0, 0.03}, {0.03, 0, -0.03}, {-0.03, 0, 0.03}, {-0.03, 0, -0.03}, {0, 0.04, 0}};
  points->triangles = {{0, 1, 4}, {1, 3, 4}, {3, 2, 4}, {2, 0, 4}};
  struct Case {
    const char* name;
    rtbus::config::BodyShape shape;
    Vector3d from, towards;
  };
  for (const Case& c : {Case{"box edge", rtbus::shapes::Box{{0.03, 0.02, 0.02}}, {-0.05, 0.04, 0}, {0.5, -0.5, 0}},
                        Case{"cylinder side", rtbus::config::Cylinder{0.03, 0.04}, {0.06, 0.01, 0}, {-0.5, 0, 0}},
                        Case{"cylinder rim", rtbus::config::Cylinder{0.03, 0.04}, {0.05, 0.04, 0}, {-0.5, -0.5, 0}},
                        Case{"capsule", rtbus::config::Capsule{0.01, 0.06}, {0.04, 0.01, 0}, {-0.5, 0, 0}},
                        Case{"hull", rtbus::config::ConvexHull{points}, {0.01, 0.06, 0.002}, {0, -1, 0}},
                        Case{"mesh", rtbus::config::Mesh{points}, {0.03, 0.05, 0.002}, {-0.3, -0.5, 0}}}) {
    rtbus::config::Scene scene;
    scene.file = "test.yaml";
    scene.bodies.push_back(body("body", c.shape));
    scene.bodies[0].friction = 2.0;
    const auto world = bullet(scene, 20);
    world->add_proxy({"haptic0", 0.1, kRadiusM, 2.0, c.from});
    run(*world, c.from + 0.1 * c.towards.normalized(), 1000, 30.0, 2.0);
    ASSERT_GT(world->proxy(0).contacts, 0U) << c.name;
    const ContactSet set = ask(*world);
    ASSERT_GE(set.contacts.size(), 1U) << c.name;
    EXPECT_NEAR(set.contacts[0].gap_m, 0.0, 2e-5) << c.name;
    EXPECT_GT(set.contacts[0].normal.dot(world->proxy(0).contact_force_n.normalized()), 0.4) << c.name;
  }
}

// A rough surface has many faces within reach. What the proxy can touch is where the distance has a minimum.
TEST(BulletContacts, OfAFineMeshLeaveRoomForWhatIsBehindThem) {
  constexpr int kCells = 40;
  constexpr double kCell_m = 1e-3;
  auto rough = std::make_shared<rtbus::config::TriangleMesh>();
  for (int i = 0; i <= kCells; ++i) {
    for (int k = 0; k <= kCells; ++k) {
      const double x = kCell_m * (i - 0.5 * kCells), z = kCell_m * (k - 0.5 * kCells);
      rough->vertices_m.emplace_back(x, 3e-4 * std::sin(900.0 * x) * std::cos(700.0 * z), z);
    }
  }
  const auto at = [](int i, int k) { return static_cast<std::uint32_t>(i * (kCells + 1) + k); };
  for (int i = 0; i < kCells; ++i) {
    for (int k = 0; k < kCells; ++k) {
      rough->triangles.push_back({at(i, k), at(i, k + 1), at(i + 1, k)});
      rough->triangles.push_back({at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)});
    }
  }
  rtbus::config::Scene scene;
  scene.file = "test.yaml";
  scene.bodies.push_back(body("rough", rtbus::config::Mesh{rough}));
  scene.bodies.push_back(body("ball", rtbus::shapes::Sphere{0.01}, {0, 0.03, 0}, 0.1));
  const auto world = bullet(scene, 20);
  const Vector3d proxy_m(0, kRadiusM + 0.001, 0);
  world->add_proxy({"haptic0", 0.1, kRadiusM, 0.0, proxy_m});
  const ContactSet set = ask(*world, 0.012);
  ASSERT_EQ(set.bodies.size(), 2U) << "the ball, 9 mm away, is crowded out";
  EXPECT_EQ(set.contacts_overflow, 0U);
  EXPECT_LE(set.contacts.size(), 9U);

  double nearest_m = 1.0;
  for (const auto& [a, b, c] : rough->triangles) {
    rtbus::shapes::TrianglePart part;
    const auto& v = rough->vertices_m;
    nearest_m =
        std::min(nearest_m, (proxy_m - rtbus::shapes::nearest_on_triangle(proxy_m, {v[a], v[b], v[c]}, part)).norm());
  }
  EXPECT_NEAR(set.contacts[0].gap_m, nearest_m - kRadiusM, 1e-7);
}

/// A proxy in front of the lowest of some boxes on each other.
ContactSet stacked(const std::vector<double>& masses_kg) {
  constexpr double kEdge_m = 0.04;
  rtbus::config::Scene scene = tests::floor_scene();
  scene.deactivation.enabled = false;
  for (std::size_t i = 0; i < masses_kg.size(); ++i) {
    scene.bodies.push_back(body("box" + std::to_string(i), rtbus::shapes::Box{Vector3d::Constant(0.5 * kEdge_m)},
                                {0, (static_cast<double>(i) + 0.5) * kEdge_m, -0.5 * kEdge_m}, masses_kg[i]));
  }
  const auto world = bullet(scene, 30);
  world->add_proxy({"haptic0", 0.1, kRadiusM, 0.0, {0, 0.5 * kEdge_m, kRadiusM + 0.001}});
  for (int i = 0; i < 500; ++i) world->step(1e-3);
  return ask(*world);
}

// What the near body carries is told though it is out of reach, and where both touch is told once.
TEST(BulletContacts, TellAFewBodiesTogether) {
  const ContactSet set = stacked({0.2, 0.1, 0.3});
  ASSERT_EQ(set.contacts.size(), 1U);
  ASSERT_EQ(set.bodies.size(), 3U);
  EXPECT_EQ(set.bodies[0].body, 1U);
  ASSERT_EQ(set.supports.size(), 3U);
  std::vector<double> borne_kg(4, 0.0);
  for (const physics::Support& support : set.supports) {
    const bool on_floor = support.holder == 0;
    const double up = support.normal.y();
    EXPECT_NEAR(std::abs(up), 1.0, 1e-4);
    const std::uint32_t upper = up > 0.0 ? support.row : support.holder - 1;
    const std::uint32_t body = set.bodies[upper].body;
    EXPECT_EQ(on_floor, body == 1U);
    borne_kg[body] = support.normal_force_n / kGravity;
  }
  EXPECT_NEAR(borne_kg[1], 0.6, 0.02);
  EXPECT_NEAR(borne_kg[2], 0.4, 0.02);
  EXPECT_NEAR(borne_kg[3], 0.3, 0.02);
}

// More of them, or of unequal masses, are a pile, of which the near one is told alone.
TEST(BulletContacts, TellOfAPileWhatIsNear) {
  for (const std::vector<double>& masses_kg :
       {std::vector<double>(physics::kMostTogether + 1, 0.1), std::vector<double>{0.02, 0.3}}) {
    const ContactSet set = stacked(masses_kg);
    EXPECT_EQ(set.bodies.size(), 1U) << masses_kg.size();
    for (const physics::Support& support : set.supports) EXPECT_EQ(support.holder, 0U) << masses_kg.size();
  }
}

// A box that is pushed meets the next one before an answer can tell that it did.
TEST(BulletContacts, TellABoxThatIsNearTheOne) {
  for (const double gap_m : {0.005, 0.02}) {
    BlockOnFloor block;
    block.scene.bodies.push_back(body("next", rtbus::shapes::Box{{0.03, 0.02, 0.02}}, {0, 0.02, -0.06 - gap_m}, 0.5));
    block.world = bullet(block.scene, 20);
    block.world->add_proxy({"haptic0", 0.1, kRadiusM, 0.0, {0, 0.02, kRadiusM + 0.001}});
    block.world->step(1e-3);
    const ContactSet set = ask(*block.world);
    const auto near = std::find_if(set.supports.begin(), set.supports.end(),
                                   [](const physics::Support& support) { return support.holder > 0; });
    ASSERT_EQ(near != set.supports.end(), gap_m < physics::kNearTogether_m) << gap_m;
    EXPECT_EQ(set.bodies.size(), near != set.supports.end() ? 2U : 1U);
    if (near == set.supports.end()) continue;
    EXPECT_EQ(near->points, 0U);
    EXPECT_EQ(near->normal_force_n, 0.0);
    EXPECT_EQ(set.bodies[near->row].body + set.bodies[near->holder - 1].body, 3U);
  }
}

TEST(BulletContacts, LeaveAStackBitIdentical) {
  const auto scene = tests::stack_scene(4, 4, 4, 0.02, 0.0001);
  std::vector<physics::BodyPose> poses[2];
  for (int asked = 0; asked < 2; ++asked) {
    const auto world = bullet(scene);
    world->add_proxy({"haptic0", 0.1, kRadiusM, 1.0, {0.03, 0.03, 0.1}});
    ContactSet set;
    std::size_t seen = 0;
    for (int i = 0; i < 1000; ++i) {
      world->set_proxy_target(0, {{0.03, 0.03, 0.1 - 1e-4 * i}, {0, 0, -0.1}, 500.0, 5.0});
      world->step(1e-3);
      if (asked == 0) continue;
      world->contacts(0, 0.01, set);
      seen = std::max(seen, set.supports.size());
    }
    EXPECT_EQ(seen > 2U, asked == 1) << "nothing was asked about";
    for (std::size_t i = 0; i < world->bodies(); ++i) poses[asked].push_back(world->body_pose(i));
  }
  for (std::size_t i = 0; i < poses[0].size(); ++i) {
    ASSERT_EQ(poses[0][i].position_m, poses[1][i].position_m) << i;
    ASSERT_EQ(poses[0][i].orientation.coeffs(), poses[1][i].orientation.coeffs()) << i;
  }
}

TEST(BulletKinematic, CarriesTheProxyAtItsSpeedWithTheForceOfTheSpring) {
  rtbus::config::Scene scene;
  scene.file = "test.yaml";
  rtbus::config::Body plate = body("plate", rtbus::shapes::Box{{0.05, 0.01, 0.05}}, {0, -0.01, 0});
  plate.type = rtbus::config::BodyType::kKinematic;
  plate.motion = rtbus::config::WaypointMotion{{1.0, 2.0}, {{0, 0.01, 0}, {0, -0.01, 0}}, true};
  scene.bodies.push_back(plate);
  const auto world = bullet(scene, 20);
  const Vector3d hand(0, kRadiusM - 0.001, 0);
  world->add_proxy({"haptic0", 0.1, kRadiusM, 1.0, {0, kRadiusM, 0}});
  double highest_m = 0.0;
  for (int i = 1; i <= 2000; ++i) {
    run(*world, hand, 1);
    const double face_m = world->body_pose(0).position_m.y() + 0.01;
    const auto exact = rtbus::config::pose_at(*plate.motion, plate.p_WB, plate.q_WB, i * 1e-3);
    ASSERT_NEAR(face_m, exact.p_WB.y() + 0.01, 1e-7) << i;
    const double proxy_m = world->proxy(0).position_m.y() - kRadiusM;
    ASSERT_NEAR(proxy_m, face_m, 5e-5) << i << ": neither ahead of the plate nor in it";
    // The spring to the hand, 1 mm below the plate's lowest place, and the damper against a hand at rest.
    const double v = world->proxy(0).velocity_m_s.y();
    ASSERT_NEAR(-world->proxy(0).coupling_force_n.y(), 200.0 * (proxy_m + 0.001) + 6.0 * v, 1e-3) << i;
    highest_m = std::max(highest_m, proxy_m);
  }
  EXPECT_NEAR(highest_m, 0.02, 1e-4);
}

TEST(BulletKinematic, GoesWhereAnOrderSendsItWithinItsSpeedAndReach) {
  rtbus::config::Scene scene;
  scene.file = "test.yaml";
  rtbus::config::Body plate = body("plate", rtbus::shapes::Box{{0.05, 0.01, 0.05}}, {0, -0.01, 0});
  plate.type = rtbus::config::BodyType::kKinematic;
  plate.motion = rtbus::config::TargetMotion{0.1, 2.0, 0.03};
  scene.bodies.push_back(plate);
  scene.bodies.push_back(body("floor", rtbus::shapes::Plane{}, {0, -0.5, 0}));
  const auto world = bullet(scene, 20);
  const auto step = [&](int steps) {
    for (int i = 0; i < steps; ++i) world->step(1e-3);
    return world->body_pose(0);
  };
  EXPECT_EQ(step(100).position_m, plate.p_WB) << "without an order it stays";

  physics::BodyTarget target;
  target.kind = physics::BodyTarget::Kind::kPose;
  target.pose = {{0, 0.01, 0}, Eigen::Quaterniond(Eigen::AngleAxisd(-0.5, Vector3d::UnitY()))};
  world->set_body_target(0, target);
  world->set_body_target(1, target);
  EXPECT_NEAR(step(100).position_m.y(), 0.0, 1e-7) << "0.1 m/s";
  EXPECT_NEAR(world->body_pose(0).orientation.angularDistance(Eigen::Quaterniond::Identity()), 0.2, 1e-5) << "2 rad/s";
  EXPECT_NEAR(step(500).position_m.y(), 0.01, 1e-7) << "there, and no farther";
  EXPECT_NEAR(world->body_pose(0).orientation.angularDistance(target.pose.orientation), 0.0, 1e-5);
  EXPECT_EQ(world->body_pose(1).position_m.y(), -0.5) << "not a body that orders move";

  target.pose.position_m = {0, 5.0, 0};
  world->set_body_target(0, target);
  EXPECT_NEAR(step(1000).position_m.y(), -0.01 + 0.03, 1e-7) << "the reach";

  target.kind = physics::BodyTarget::Kind::kTwist;
  target.velocity_m_s = {0, -0.02, 0};
  world->set_body_target(0, target);
  EXPECT_NEAR(step(500).position_m.y(), 0.01, 1e-7);
  target.kind = physics::BodyTarget::Kind::kStay;
  world->set_body_target(0, target);
  EXPECT_NEAR(step(500).position_m.y(), 0.01, 1e-7);
}

TEST(BulletKinematic, WakesWhatSleepsOnItAndCarriesItAlongByFriction) {
  rtbus::config::Scene scene;
  scene.file = "test.yaml";
  rtbus::config::Body plate = body("plate", rtbus::shapes::Box{{0.2, 0.01, 0.2}}, {0, -0.01, 0});
  plate.friction = 1.0;
  plate.type = rtbus::config::BodyType::kKinematic;
  plate.motion = rtbus::config::WaypointMotion{{2.0, 3.0}, {{0, -0.01, 0}, {0.1, -0.01, 0}}, false};
  scene.bodies = {plate, body("cube", rtbus::shapes::Box{Vector3d::Constant(0.01)}, {0, 0.01, 0}, 0.02)};
  scene.bodies[1].friction = 1.0;
  const auto world = bullet(scene);
  for (int i = 0; i < 1900; ++i) world->step(1e-3);
  EXPECT_EQ(world->awake_bodies(), 0U) << "a plate that stands lets it sleep";
  for (int i = 0; i < 2500; ++i) world->step(1e-3);
  EXPECT_NEAR(world->body_pose(1).position_m.x(), 0.1, 1e-3);
  EXPECT_EQ(world->awake_bodies(), 0U) << "and again at the end";
}

}  // namespace
