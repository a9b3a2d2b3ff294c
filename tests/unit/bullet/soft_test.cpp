/// Soft bodies in the engine bullet: rest, touch, return, extremes, and what maps their library.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "physics_node/frame_publisher.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/closed_surface.hpp"
#include "tests/unit/bullet/scenes.hpp"

namespace tests {
namespace {

using physics::ProxyParameters;
using physics::ProxyTarget;
using physics::World;
using rtbus::config::Scene;
using rtbus::config::SoftBody;

constexpr double kStep_s = 1e-3;
constexpr double kGravity_m_s2 = 9.81;

SoftBody soft_body(const std::string& name, std::shared_ptr<const rtbus::config::TriangleMesh> mesh,
                   const Vector3d& at_m) {
  SoftBody body;
  body.name = name;
  body.mesh = std::move(mesh);
  body.closed = true;
  body.p_WB = at_m;
  body.mass_kg = 0.1;
  body.pose_matching_hz = 20.0;
  body.bulk_modulus_pa = 5000.0;
  body.damping_per_s = 4.0;
  return body;
}

std::shared_ptr<const rtbus::config::TriangleMesh> ball(std::size_t nodes = 200) {
  return std::make_shared<const rtbus::config::TriangleMesh>(rtbus::config::make_ball(nodes, 0.04));
}

/// Balls of 80 mm on the floor, 120 mm apart.
Scene soft_scene(int bodies, std::size_t nodes = 200) {
  Scene scene = floor_scene();
  const auto mesh = ball(nodes);
  for (int i = 0; i < bodies; ++i) {
    scene.soft_bodies.push_back(soft_body("ball_" + std::to_string(i), mesh, Vector3d(0.12 * i, 0.041, 0)));
  }
  return scene;
}

std::vector<Vector3d> nodes_of(const World& world, const Scene& scene, std::size_t body) {
  std::size_t first = 0;
  for (std::size_t i = 0; i < body; ++i) first += scene.soft_bodies[i].mesh->vertices_m.size();
  std::vector<Vector3d> out;
  for (std::size_t i = 0; i < scene.soft_bodies[body].mesh->vertices_m.size(); ++i) {
    out.push_back(world.soft_node(first + i));
  }
  return out;
}

double volume_share(const World& world, const Scene& scene, std::size_t body) {
  rtbus::config::TriangleMesh now = *scene.soft_bodies[body].mesh;
  const double before_m3 = enclosed_volume_m3(now);
  now.vertices_m = nodes_of(world, scene, body);
  return enclosed_volume_m3(now) / before_m3;
}

Vector3d middle_of(const std::vector<Vector3d>& nodes) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& node : nodes) sum += node;
  return sum / static_cast<double>(nodes.size());
}

/// Largest distance of a node of one list from the same of the other.
double apart(const std::vector<Vector3d>& a, const std::vector<Vector3d>& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).norm());
  return most;
}

void steps(World& world, double duration_s, double h = kStep_s) {
  for (int i = 0; i < static_cast<int>(std::lround(duration_s / h)); ++i) world.step(h);
}

ProxyTarget target(const Vector3d& at_m, double stiffness_n_per_m = 300.0) {
  ProxyTarget out;
  out.position_m = at_m;
  out.stiffness_n_per_m = stiffness_n_per_m;
  out.damping_n_s_per_m = 1.4 * std::sqrt(stiffness_n_per_m * 0.1);
  return out;
}

ProxyParameters tool(const Vector3d& at_m, double radius_m = 0.01) {
  ProxyParameters out;
  out.device = "haptic0";
  out.radius_m = radius_m;
  out.friction = 1.0;
  out.position_m = at_m;
  return out;
}

TEST(Soft, FiveBodiesComeToRestAndStayThere) {
  const Scene scene = soft_scene(5);
  const auto world = bullet(scene);
  EXPECT_EQ(world->soft_nodes(), 5U * 200U);
  EXPECT_EQ(world->bodies(), 1U);  // rigid ones alone
  steps(*world, 2.0);
  std::vector<std::vector<Vector3d>> settled;
  for (std::size_t i = 0; i < 5; ++i) settled.push_back(nodes_of(*world, scene, i));
  steps(*world, 2.0);
  for (std::size_t i = 0; i < 5; ++i) {
    const auto nodes = nodes_of(*world, scene, i);
    for (const Vector3d& node : nodes) {
      ASSERT_TRUE(node.allFinite());
      EXPECT_GT(node.y(), 0.0);  // less than a margin into the floor
      EXPECT_LT((node - scene.soft_bodies[i].p_WB).norm(), 0.05);
    }
    EXPECT_GT(volume_share(*world, scene, i), 0.9);
    EXPECT_LT(volume_share(*world, scene, i), 1.1);
    EXPECT_LT((middle_of(nodes) - middle_of(settled[i])).norm(), 0.1e-3) << "drifts";
    EXPECT_LT(apart(nodes, settled[i]), 1e-3);
  }
  EXPECT_EQ(world->recoveries(), 0U);
}

/// A tool as large as a table carries a body by itself: what it gets from it is its weight.
TEST(Soft, WeighsWhatItWeighs) {
  Scene scene;
  scene.file = "test.yaml";
  scene.soft_bodies.push_back(soft_body("jelly", ball(), Vector3d(0, 0.541, 0)));
  const auto world = bullet(scene);
  const Vector3d under(0, 0.0, 0);
  world->add_proxy(tool(under, 0.5));
  double sum_n = 0.0, sum_y_m = 0.0;
  int counted = 0;
  for (int i = 0; i < 1500; ++i) {
    world->set_proxy_target(0, target(under, 2000.0));
    world->step(kStep_s);
    if (i < 1000) continue;
    sum_n += world->proxy(0).contact_force_n.y();
    sum_y_m += world->proxy(0).position_m.y();
    ++counted;
  }
  const double weight_n = 0.1 * kGravity_m_s2;
  EXPECT_NEAR(sum_n / counted, -weight_n, 0.03 * weight_n);
  EXPECT_NEAR(sum_y_m / counted, -weight_n / 2000.0, 0.05 * weight_n / 2000.0);  // the spring says the same
}

TEST(Soft, PushesBackAndComesBackWhenLetGo) {
  const Scene scene = soft_scene(1);
  const auto world = bullet(scene);
  steps(*world, 1.5);
  const auto before = nodes_of(*world, scene, 0);
  double top_m = 0.0;
  for (const Vector3d& node : before) top_m = std::max(top_m, node.y());
  const Vector3d above(0, top_m + 0.02, 0), pressed(0, top_m, 0);  // 10 mm radius: as much into it
  world->add_proxy(tool(above));
  double force_n = 0.0;
  for (int i = 0; i < 1500; ++i) {
    const double share = std::clamp(i / 500.0, 0.0, 1.0);
    world->set_proxy_target(0, target(above + share * (pressed - above)));
    world->step(kStep_s);
    force_n = world->proxy(0).contact_force_n.y();
  }
  double coupling_n = 0.0;
  for (int i = 0; i < 200; ++i) {
    world->set_proxy_target(0, target(pressed));
    world->step(kStep_s);
    coupling_n += world->proxy(0).coupling_force_n.y() / 200.0;
  }
  EXPECT_LT(coupling_n, -0.2) << "nothing to feel";
  EXPECT_GT(coupling_n, -3.0) << "as hard as a stone";
  EXPECT_GT(force_n, 0.0);
  EXPECT_GT(world->proxy(0).contacts, 0U);
  EXPECT_GT(apart(nodes_of(*world, scene, 0), before), 3e-3) << "does not yield";
  for (int i = 0; i < 2000; ++i) {
    world->set_proxy_target(0, target(above));
    world->step(kStep_s);
  }
  EXPECT_LT(world->proxy(0).contact_force_n.norm(), 1e-9);
  const auto after = nodes_of(*world, scene, 0);
  double dent_m = 0.0;  // it may have been rolled aside
  for (std::size_t i = 0; i < after.size(); ++i) {
    dent_m = std::max(dent_m, std::abs((after[i] - middle_of(after)).norm() - (before[i] - middle_of(before)).norm()));
  }
  EXPECT_LT(dent_m, 2e-3) << "stays dented";
}

TEST(Soft, IsFeltSofterThanAStoneAndStifferWithItsBulkModulus) {
  std::vector<double> force_n;
  for (const double bulk_pa : {0.0, 5000.0, 50000.0}) {
    Scene scene = soft_scene(1);
    scene.soft_bodies[0].bulk_modulus_pa = bulk_pa;
    const auto world = bullet(scene);
    const Vector3d above(0, 0.1, 0), pressed(0, 0.075, 0);
    world->add_proxy(tool(above));
    double sum_n = 0.0;
    for (int i = 0; i < 1500; ++i) {
      world->set_proxy_target(0, target(above + std::clamp(i / 1000.0, 0.0, 1.0) * (pressed - above)));
      world->step(kStep_s);
      if (i >= 1300) sum_n += world->proxy(0).coupling_force_n.norm() / 200.0;
    }
    force_n.push_back(sum_n);
  }
  EXPECT_GT(force_n[1], force_n[0]);
  EXPECT_GT(force_n[2], force_n[1]);
}

TEST(Soft, MeetsRigidBodiesOfEveryShape) {
  for (const rtbus::config::BodyShape& shape : {rtbus::config::BodyShape(rtbus::shapes::Box{Vector3d(0.1, 0.05, 0.1)}),
                                                rtbus::config::BodyShape(rtbus::config::Cylinder{0.1, 0.1}),
                                                rtbus::config::BodyShape(rtbus::shapes::Sphere{0.05}),
                                                rtbus::config::BodyShape(rtbus::config::Capsule{0.05, 0.2})}) {
    Scene scene = floor_scene();
    rtbus::config::Body stand = body("stand", shape, Vector3d(0, 0.05, 0));
    if (std::holds_alternative<rtbus::config::Capsule>(shape))
      stand.q_WB = Eigen::Quaterniond(0.7071, 0.7071, 0, 0).normalized();
    stand.friction = 1.0;
    scene.bodies.push_back(stand);
    scene.soft_bodies.push_back(soft_body("jelly", ball(), Vector3d(0, 0.145, 0)));
    const auto world = bullet(scene);
    steps(*world, 0.4);
    const double height_m = middle_of(nodes_of(*world, scene, 0)).y();
    EXPECT_GT(height_m, 0.125) << name_of(shape);
    EXPECT_LT(height_m, 0.145) << name_of(shape);
  }
}

TEST(Soft, CarriesAndIsCarriedByBodiesThatMove) {
  Scene scene = soft_scene(1);
  scene.soft_bodies[0].bulk_modulus_pa = 20000.0;
  scene.bodies.push_back(body("lid", rtbus::shapes::Box{Vector3d(0.05, 0.005, 0.05)}, Vector3d(0, 0.095, 0), 0.05));
  const auto world = bullet(scene);
  steps(*world, 0.3);  // later it slides off
  EXPECT_GT(world->body_pose(1).position_m.y(), 0.06) << "fell through";
  EXPECT_LT(world->body_pose(1).position_m.y(), 0.095);
}

/// Two balls dropped onto each other do not become one.
TEST(Soft, BodiesKeepApart) {
  for (const int clusters : {0, 12}) {
    Scene scene = soft_scene(1);
    scene.soft_bodies.push_back(soft_body("upper", scene.soft_bodies[0].mesh, Vector3d(0.003, 0.128, 0)));
    for (SoftBody& each : scene.soft_bodies) each.clusters = clusters;
    const auto world = bullet(scene);
    steps(*world, 0.4);
    const double gap_m = middle_of(nodes_of(*world, scene, 1)).y() - middle_of(nodes_of(*world, scene, 0)).y();
    EXPECT_GT(gap_m, 0.055) << clusters << " clusters";
    EXPECT_EQ(world->recoveries(), 0U);
  }
}

/// Whatever the keys allow: positions, forces and volumes stay numbers, and the tool's force is what its spring can
/// give.
TEST(Soft, StaysFiniteAtTheEndsOfEveryRange) {
  const auto set = [](auto change) {
    Scene scene = soft_scene(1, 60);
    change(scene.soft_bodies[0]);
    return scene;
  };
  const std::vector<Scene> scenes{
      set([](SoftBody& b) { b.bulk_modulus_pa = 1e9; }),
      set([](SoftBody& b) { b.pressure_pa = 1e6; }),
      set([](SoftBody& b) { b.pose_matching_hz = 1000.0; }),
      set([](SoftBody& b) { b.linear_stiffness = 1.0, b.bending_stiffness = 1.0, b.position_iterations = 50; }),
      set([](SoftBody& b) { b.linear_stiffness = 1e-3, b.pose_matching_hz = 0.0, b.bulk_modulus_pa = 0.0; }),
      set([](SoftBody& b) { b.mass_kg = 1e-6; }),
      set([](SoftBody& b) { b.mass_kg = 1e4; }),
      set([](SoftBody& b) { b.damping_per_s = 1000.0; }),
      set([](SoftBody& b) { b.contact_hardness = 1.0, b.margin_m = 0.02, b.friction = 2.0; }),
      set([](SoftBody& b) { b.velocity_iterations = 20, b.pose_matching_hz = 0.0; }),
  };
  for (std::size_t which = 0; which < scenes.size(); ++which) {
    for (const double h : {1e-4, 1e-3, 2e-2}) {
      for (const double stiffness_n_per_m : {300.0, 1e6}) {
        const auto world = bullet(scenes[which]);
        world->add_proxy(tool(Vector3d(0, 0.1, 0)));
        for (int i = 0; i < 150; ++i) {
          const double y_m = 0.06 + 0.03 * std::cos(0.2 * i);
          world->set_proxy_target(0, target(Vector3d(0.01, y_m, 0), stiffness_n_per_m));
          world->step(h);
          const physics::ProxyReadout proxy = world->proxy(0);
          ASSERT_TRUE(proxy.position_m.allFinite() && proxy.coupling_force_n.allFinite() &&
                      proxy.contact_force_n.allFinite())
              << which << " at " << h << " s, " << stiffness_n_per_m << " N/m, step " << i;
          for (std::size_t node = 0; node < world->soft_nodes(); ++node) {
            ASSERT_TRUE(world->soft_node(node).allFinite()) << which << " at " << h << " s, step " << i;
          }
        }
      }
    }
  }
}

TEST(Soft, PutsBackWhatTurnedInsideOut) {
  Scene scene = soft_scene(1);
  SoftBody& body = scene.soft_bodies[0];
  body.pose_matching_hz = 0.0, body.bulk_modulus_pa = 0.0, body.linear_stiffness = 1e-3;
  scene.gravity_m_s2 *= 10.0;  // a skin that holds nothing: it folds flat
  const auto world = bullet(scene);
  for (int i = 0; i < 4000 && world->recoveries() == 0; ++i) world->step(kStep_s);
  ASSERT_GT(world->recoveries(), 0U);
  EXPECT_LT(apart(nodes_of(*world, scene, 0), nodes_of(*bullet(scene), scene, 0)), 1e-9);
}

TEST(Soft, RepeatsBitForBit) {
  std::vector<std::vector<Vector3d>> runs;
  for (int run = 0; run < 2; ++run) {
    const Scene scene = soft_scene(2);
    const auto world = bullet(scene);
    world->add_proxy(tool(Vector3d(0, 0.1, 0)));
    for (int i = 0; i < 400; ++i) {
      world->set_proxy_target(0, target(Vector3d(0.01, 0.1 - 1e-4 * i, 0)));
      world->step(kStep_s);
    }
    runs.push_back(nodes_of(*world, scene, 0));
    runs.back().push_back(world->proxy(0).position_m);
  }
  for (std::size_t i = 0; i < runs[0].size(); ++i) EXPECT_EQ(runs[0][i], runs[1][i]);
}

TEST(Soft, SaysWhatAStepCannotCarryAndWhatFallsThrough) {
  Scene scene = soft_scene(1);
  scene.soft_bodies[0].bulk_modulus_pa = 1e7;
  scene.soft_bodies[0].pose_matching_hz = 500.0;
  const auto world = bullet(scene);
  world->add_proxy(tool(Vector3d(0, 0.1, 0), 0.001));
  std::string all;
  for (const std::string& warning : world->warnings(kStep_s)) all += warning + "\n";
  EXPECT_NE(all.find("soft body ball_0: bulk_modulus_pa"), std::string::npos) << all;
  EXPECT_NE(all.find("a tool of 1 mm falls between nodes"), std::string::npos) << all;
  const Scene fine = soft_scene(1);
  const auto calm = bullet(fine);
  calm->add_proxy(tool(Vector3d(0, 0.1, 0)));
  EXPECT_TRUE(calm->warnings(kStep_s).empty());
}

bool mapped(const std::string& library) {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    if (line.find(library) != std::string::npos) return true;
  }
  return false;
}

/// In a process of its own, for a module is never unloaded.
[[noreturn]] void make_and_exit(const Scene& scene, bool expect_soft) {
  const auto world = bullet(scene);
  std::exit(mapped("libBulletSoftBody") == expect_soft && mapped("libphysics_bullet_soft") == expect_soft ? 0 : 1);
}

TEST(Soft, ItsLibraryIsMappedOnlyForASceneThatHasSome) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(make_and_exit(stack_scene(1, 2, 1, 0.02, 0.0), false), testing::ExitedWithCode(0), "");
  EXPECT_EXIT(make_and_exit(soft_scene(1), true), testing::ExitedWithCode(0), "");
}

TEST(Soft, ItsNodesArePublishedInFramesWhileSomebodyLooks) {
  const Scene scene = soft_scene(2);
  physics::Stepper stepper(physics::make_world("bullet", scene), {}, 1);
  const std::size_t nodes = stepper.world().soft_nodes();
  ASSERT_GT(nodes, rtbus::SoftNodes::kNodes);  // a frame is two samples
  rtbus::Session session;
  session.name = "soft-nodes-" + std::to_string(::getpid());
  auto publisher = physics::SoftNodePublisher::create(session, nodes);
  ASSERT_TRUE(publisher.has_value());
  (*publisher)->maintain();
  (*publisher)->publish_if_due(stepper, rtbus::kNsPerS);  // nobody looks: this frame is none
  auto reader = rtbus::Reader<rtbus::SoftNodes>::open(session, "physics.soft_nodes", {.presence = true});
  ASSERT_TRUE(reader.has_value());
  (*publisher)->maintain();
  (*publisher)->publish_if_due(stepper, 2 * rtbus::kNsPerS);
  rtbus::Stamped<rtbus::SoftNodes> sample;
  std::size_t seen = 0;
  while (reader->read_next(sample) == rtbus::ReadStatus::kFresh) {
    EXPECT_EQ(sample.value.frame, 1U);
    EXPECT_EQ(sample.value.nodes, nodes);
    EXPECT_EQ(sample.value.first_node, seen);
    for (std::uint32_t i = 0; i < rtbus::SoftNodes::kNodes; ++i) {
      const Vector3d at = i < sample.value.count ? stepper.world().soft_node(seen + i) : Vector3d::Zero();
      for (int axis = 0; axis < 3; ++axis) ASSERT_NEAR(1e-6 * sample.value.position_um[i][axis], at[axis], 0.6e-6);
    }
    seen += sample.value.count;
  }
  EXPECT_EQ(seen, nodes);
}

TEST(Soft, TheAnalyticEngineRefusesIt) {
  try {
    (void)physics::make_world("analytic", soft_scene(1));
    FAIL() << "accepted";
  } catch (const rtbus::config::Error& error) {
    EXPECT_STREQ(error.what(),
                 "test.yaml: body ball_0 is soft, which physics.engine = analytic cannot do; write engine: bullet");
  }
}

}  // namespace
}  // namespace tests
