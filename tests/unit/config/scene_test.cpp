#include "rtbus/config/scene.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/temporary_file.hpp"

namespace rtbus::config {
namespace {

Scene read(const std::string& text) {
  const tests::TemporaryFolder folder;
  Map map = load(folder.write("table.yaml", text));
  return read_scene(map);
}

TEST(Scene, HasDefaultsForEverythingButItsSchema) {
  const Scene scene = read("schema: scene/1");
  EXPECT_EQ(scene.gravity_m_s2, Eigen::Vector3d(0.0, -9.81, 0.0));
  EXPECT_TRUE(scene.bodies.empty());
  EXPECT_TRUE(scene.static_shapes().empty());
  EXPECT_EQ(scene.name, "table");
}

TEST(Scene, ReadsEveryShape) {
  const Scene scene = read(R"(schema: scene/1
name: three
gravity_m_s2: [0, 0, -1.62]
bodies:
  - {name: floor, type: static, shape: {plane: {}}}
  - {name: ball, type: static, shape: {sphere: {radius_m: 0.02}}, position_m: [0.1, 0.2, 0.3], friction: 0.5}
  - {name: block, type: static, shape: {box: {size_m: [0.4, 0.02, 0.6]}}, friction: 2}
)");
  EXPECT_EQ(scene.name, "three");
  EXPECT_EQ(scene.gravity_m_s2.z(), -1.62);
  ASSERT_EQ(scene.bodies.size(), 3U);
  EXPECT_TRUE(std::holds_alternative<shapes::Plane>(scene.bodies[0].shape));
  EXPECT_EQ(std::get<shapes::Sphere>(scene.bodies[1].shape).radius_m, 0.02);
  EXPECT_EQ(std::get<shapes::Box>(scene.bodies[2].shape).half_size_m, Eigen::Vector3d(0.2, 0.01, 0.3));
  const auto placed = scene.static_shapes();
  ASSERT_EQ(placed.size(), 3U);
  EXPECT_EQ(placed[0].friction, 0.0);
  EXPECT_EQ(placed[1].p_WB, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(placed[1].friction, 0.5);
  EXPECT_EQ(placed[2].q_WB.coeffs(), Eigen::Quaterniond::Identity().coeffs());
}

TEST(Scene, NormalisesOrientationsAndTakesTheScalarFirst) {
  const Scene scene = read(R"(schema: scene/1
bodies: [{name: wall, type: static, shape: {plane: {}}, orientation_wxyz: [2, 0, 0, 2]}])");
  const Eigen::Quaterniond& q = scene.bodies.at(0).q_WB;
  EXPECT_NEAR(q.norm(), 1.0, 1e-15);
  // 90° about z turns the plane's normal from y to −x.
  EXPECT_NEAR((q * Eigen::Vector3d::UnitY() + Eigen::Vector3d::UnitX()).norm(), 0.0, 1e-15);
}

}  // namespace
}  // namespace rtbus::config
