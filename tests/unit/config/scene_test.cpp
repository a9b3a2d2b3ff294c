#include "rtbus/config/scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
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

TEST(Scene, ReadsBodiesThatMove) {
  const Scene scene = read(R"(schema: scene/1
deactivation: {after_s: 0.2, linear_m_s: 0.01}
bodies:
  - {name: pill, type: dynamic, mass_kg: 0.02, shape: {capsule: {radius_m: 0.01, length_m: 0.05}}, friction: 0.4,
     restitution: 0.3, linear_damping_per_s: 0.1, angular_damping_per_s: 2, asleep: true}
  - {name: tin, type: dynamic, mass_kg: 0.3, shape: {cylinder: {radius_m: 0.03, length_m: 0.1}}}
)");
  EXPECT_TRUE(scene.deactivation.enabled);
  EXPECT_EQ(scene.deactivation.after_s, 0.2);
  EXPECT_EQ(scene.deactivation.linear_m_s, 0.01);
  EXPECT_FALSE(scene.deactivation.angular_rad_s.has_value());
  ASSERT_EQ(scene.bodies.size(), 2U);
  const Body& pill = scene.bodies[0];
  EXPECT_EQ(pill.type, BodyType::kDynamic);
  EXPECT_EQ(pill.mass_kg, 0.02);
  EXPECT_EQ(pill.restitution, 0.3);
  EXPECT_EQ(pill.linear_damping_per_s, 0.1);
  EXPECT_EQ(pill.angular_damping_per_s, 2.0);
  EXPECT_TRUE(pill.asleep);
  EXPECT_EQ(std::get<Capsule>(pill.shape).length_m, 0.05);
  EXPECT_EQ(std::get<Cylinder>(scene.bodies[1].shape).radius_m, 0.03);
  EXPECT_EQ(name_of(scene.bodies[1].shape), "cylinder");
}

TEST(Scene, ReadsBodiesThatMoveByThemselves) {
  const Scene scene = read(R"(schema: scene/1
bodies:
  - {name: lift, type: kinematic, shape: {box: {size_m: [0.1, 0.02, 0.1]}}, position_m: [0, 0.01, 0],
     motion: {sinusoid: {travel_m: [0, 0.04, 0], frequency_hz: 0.5, start_s: 1}}}
  - {name: cart, type: kinematic, shape: {sphere: {radius_m: 0.01}}, position_m: [1, 0, 0],
     motion: {waypoints: {points: [{time_s: 1, position_m: [1.2, 0, 0]}, {time_s: 3, position_m: [1, 0, 0]}], repeat: true}},
     grid: {count: [1, 1, 2], spacing_m: [0, 0, 5]}}
  - {name: turntable, type: kinematic, shape: {cylinder: {radius_m: 0.1, length_m: 0.01}},
     motion: {spin: {axis: [0, 2, 0], rate_rad_s: 3}}}
)");
  ASSERT_EQ(scene.bodies.size(), 4U);
  EXPECT_TRUE(scene.static_shapes().empty()) << "direct must not take them for walls";
  const auto at = [&scene](std::size_t i, double t) {
    return pose_at(*scene.bodies[i].motion, scene.bodies[i].p_WB, scene.bodies[i].q_WB, t);
  };
  EXPECT_EQ(at(0, 1.0).p_WB, Eigen::Vector3d(0, 0.01, 0));
  EXPECT_NEAR(at(0, 2.0).p_WB.y(), 0.05, 1e-15);
  EXPECT_NEAR(at(0, 1.5).p_WB.y(), 0.03, 1e-15);
  EXPECT_NEAR(at(1, 0.5).p_WB.x(), 1.1, 1e-15);
  EXPECT_NEAR(at(1, 1.0).p_WB.x(), 1.2, 1e-15);
  EXPECT_NEAR(at(1, 3.5).p_WB.x(), 1.1, 1e-12);
  EXPECT_NEAR(at(2, 0.5).p_WB.z(), 5.0, 1e-15) << "a grid moves as a whole";
  // The ramp of 0.5 s costs half of itself.
  const Eigen::Vector3d turned = at(3, 0.75).q_WB * Eigen::Vector3d::UnitX();
  EXPECT_NEAR((turned - Eigen::Vector3d(std::cos(1.5), 0, -std::sin(1.5))).norm(), 0.0, 1e-12);
  // From rest: no motion starts with a jump of speed.
  for (std::size_t i = 0; i < 4; ++i) {
    const double start_s = i == 0 ? 1.0 : 0.0;
    EXPECT_LT((at(i, start_s + 1e-6).p_WB - at(i, start_s).p_WB).norm(), 1e-11) << i;
  }
}

TEST(Scene, UnrollsAGridAndNamesItsBodies) {
  const Scene scene = read(R"(schema: scene/1
bodies:
  - {name: cube, type: dynamic, mass_kg: 0.02, shape: {box: {size_m: [0.02, 0.02, 0.02]}}, position_m: [1, 2, 3],
     grid: {count: [2, 3, 4], spacing_m: [0.1, 0.2, -0.3]}}
)");
  ASSERT_EQ(scene.bodies.size(), 24U);
  EXPECT_EQ(scene.bodies.front().name, "cube_0_0_0");
  EXPECT_EQ(scene.bodies.front().p_WB, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(scene.bodies.back().name, "cube_1_2_3");
  EXPECT_NEAR((scene.bodies.back().p_WB - Eigen::Vector3d(1.1, 2.4, 2.1)).norm(), 0.0, 1e-15);
}

TEST(Scene, ReadsObjFilesWithPolygonsAndCountsFromTheEnd) {
  const tests::TemporaryFolder folder;
  folder.write("cube.obj",
               "o cube\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1 1.0\nv 1 -1 1\r\nv 1 1 1\n v -1 1 1\n"
               "vn 0 0 1\nf 4 3 2 1\nf 5//1 6//1 7//1 8//1\nf -8 -7 -3\n");
  Map map =
      load(folder.write("scene.yaml",
                        "schema: scene/1\nbodies:\n  - {name: hull, type: dynamic, mass_kg: 1, shape: {convex_hull: "
                        "{file: cube.obj, metres_per_unit: 0.01}}}\n  - {name: hill, type: static, shape: {mesh: "
                        "{file: cube.obj}}}\n"));
  const Scene scene = read_scene(map);
  const TriangleMesh& points = *std::get<ConvexHull>(scene.bodies.at(0).shape).points;
  ASSERT_EQ(points.vertices_m.size(), 8U);
  EXPECT_EQ(points.vertices_m[7], Eigen::Vector3d(-0.01, 0.01, 0.01));
  const TriangleMesh& surface = *std::get<Mesh>(scene.bodies.at(1).shape).surface;
  ASSERT_EQ(surface.triangles.size(), 5U);  // two quadrilaterals and a triangle
  EXPECT_EQ(surface.triangles[1], (std::array<std::uint32_t, 3>{3, 1, 0}));
  EXPECT_EQ(surface.triangles[4], (std::array<std::uint32_t, 3>{0, 1, 5}));
  EXPECT_TRUE(scene.static_shapes().empty()) << "direct knows neither hulls nor meshes";
}

/// A file in memory: megabytes need not go to a disk.
class MemoryFile {
 public:
  explicit MemoryFile(const std::string& text) : file_(memfd_create("obj", 0)) {
    EXPECT_EQ(::write(file_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile() { ::close(file_); }
  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }

 private:
  int file_;
};

// A grid of a million triangles, whose faces are squares.
TEST(Scene, ReadsAMeshOfAMillionTriangles) {
  constexpr std::size_t kCells = 708;
  std::string grid;
  for (std::size_t i = 0; i <= kCells; ++i) {
    for (std::size_t k = 0; k <= kCells; ++k) grid += "v " + std::to_string(i) + " 0 " + std::to_string(k) + '\n';
  }
  for (std::size_t i = 0; i < kCells; ++i) {
    for (std::size_t k = 1; k <= kCells; ++k) {
      const std::size_t a = i * (kCells + 1) + k, d = a + kCells + 1;
      for (const std::size_t corner : {a, a + 1, d + 1, d}) grid += (corner == a ? "f " : " ") + std::to_string(corner);
      grid += '\n';
    }
  }
  const MemoryFile file(grid);
  const auto mesh = rtbus::config::read_obj(file.path(), 1e-3);
  EXPECT_EQ(mesh.triangles.size(), 2 * kCells * kCells);
  EXPECT_NEAR(mesh.extents_m().x(), 1e-3 * static_cast<double>(kCells), 1e-12);
}

// What is beyond what a mesh may have is refused where it begins.
TEST(Scene, RefusesMeshesOfMoreThanItHolds) {
  std::string fan = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nf";
  for (int i = 0; i < 2'000'003; ++i) fan += i % 2 == 0 ? " 1" : " 3";
  const MemoryFile many(fan);
  EXPECT_THAT([&] { (void)rtbus::config::read_obj(many.path(), 1.0); },
              testing::ThrowsMessage<rtbus::config::Error>(testing::HasSubstr(":5: more than 2000000 triangles")));
  std::string points;
  for (int i = 0; i <= 1'000'000; ++i) points += "v 0 0 0\n";
  const MemoryFile full(points);
  EXPECT_THAT([&] { (void)rtbus::config::read_obj(full.path(), 1.0); },
              testing::ThrowsMessage<rtbus::config::Error>(testing::HasSubstr(":1000001: more than 1000000 vertices")));
}

TEST(Scene, HasAHashOfWhatContactsAreFoundWith) {
  const tests::TemporaryFolder folder;
  const std::string cube = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nf 1 2 3\nf 1 3 4\n";
  const auto hash_of = [&](const std::string& obj, const std::string& box, const std::string& more) {
    folder.write("cube.obj", obj);
    Map map =
        load(folder.write("scene.yaml",
                          "schema: scene/1\nbodies:\n"
                          "  - {name: hill, type: static, shape: {mesh: {file: cube.obj}}" +
                              more +
                              "}\n"
                              "  - {name: stone, type: dynamic, mass_kg: 1, shape: {convex_hull: {file: cube.obj}}}\n"
                              "  - {name: box, " +
                              box + "}\n"));
    return read_scene(map).shape_hash();
  };
  const std::string box = "type: dynamic, mass_kg: 1, shape: {box: {size_m: [1, 2, 3]}}, position_m: [0, 5, 0]";
  const std::uint64_t hash = hash_of(cube, box, "");
  EXPECT_NE(hash, 0U);
  EXPECT_EQ(hash_of(cube, box, ", position_m: [0, -0.0, 0]"), hash) << "the same once more";
  EXPECT_EQ(hash_of(cube,
                    "type: dynamic, mass_kg: 2, shape: {box: {size_m: [1, 2, 3]}}, position_m: [0, 6, 0], "
                    "friction: 1",
                    ", friction: 1"),
            hash)
      << "answers tell masses, friction and where bodies are";
  const std::string vertex = "v 0 0 0\nv 1 0 0\nv 1 1 0.001\nv 0 1 1\nf 1 2 3\nf 1 3 4\n";
  const std::string turned = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nf 1 2 4\nf 1 3 4\n";
  EXPECT_NE(hash_of(vertex, box, ""), hash);
  EXPECT_NE(hash_of(turned, box, ""), hash);
  EXPECT_NE(hash_of(cube, box, ", position_m: [0, 0.001, 0]"), hash);
  EXPECT_NE(hash_of(cube, box, ", orientation_wxyz: [1, 0.01, 0, 0]"), hash);
  EXPECT_NE(
      hash_of(cube, "type: dynamic, mass_kg: 1, shape: {box: {size_m: [1, 2, 3.001]}}, position_m: [0, 5, 0]", ""),
      hash);
  EXPECT_NE(hash_of(cube, "type: static, shape: {box: {size_m: [1, 2, 3]}}, position_m: [0, 5, 0]", ""), hash);
}

TEST(BodyMotion, OfATargetIsWithinSpeedRateAndReach) {
  const rtbus::config::TargetMotion motion{0.5, 1.0, 0.2};
  const rtbus::config::PlacedAt home;
  const auto far = step_toward(motion, home.p_WB, home, {{3, 0, 4}, Eigen::Quaterniond::Identity()}, 0.1);
  EXPECT_NEAR((far.p_WB - Eigen::Vector3d(0.03, 0, 0.04)).norm(), 0.0, 1e-12);
  const auto end = step_toward(motion, home.p_WB, home, {{3, 0, 4}, Eigen::Quaterniond::Identity()}, 100.0);
  EXPECT_NEAR((end.p_WB - Eigen::Vector3d(0.12, 0, 0.16)).norm(), 0.0, 1e-12);
  // The short way round, whatever sign the quaternion has.
  for (const double sign : {1.0, -1.0}) {
    Eigen::Quaterniond wanted(Eigen::AngleAxisd(-0.3, Eigen::Vector3d::UnitX()));
    wanted.coeffs() *= sign;
    const auto turned = step_toward(motion, home.p_WB, home, {{0, 0, 0}, wanted}, 0.1);
    EXPECT_NEAR(turned.q_WB.angularDistance(wanted), 0.2, 1e-9) << sign;
    EXPECT_NEAR(step_toward(motion, home.p_WB, home, {{0, 0, 0}, wanted}, 10.0).q_WB.angularDistance(wanted), 0.0,
                1e-7);
  }
}

}  // namespace
}  // namespace rtbus::config
