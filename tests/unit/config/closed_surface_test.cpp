#include "rtbus/config/closed_surface.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace rtbus::config {
namespace {

using Eigen::Vector3d;

/// Every face looks away from a point inside.
bool looks_outwards(const TriangleMesh& mesh, const Vector3d& inside) {
  for (const auto& t : mesh.triangles) {
    const Vector3d a = mesh.vertices_m[t[0]], b = mesh.vertices_m[t[1]], c = mesh.vertices_m[t[2]];
    if ((b - a).cross(c - a).dot((a + b + c) / 3.0 - inside) <= 0.0) return false;
  }
  return true;
}

TEST(ClosedSurface, RabbitHasTheCountsOfThePaper) {
  const TriangleMesh mesh = make_rabbit(453, 0.11);
  EXPECT_EQ(mesh.vertices_m.size(), 453U);
  EXPECT_EQ(edges_of(mesh).size(), 1353U);
  EXPECT_EQ(mesh.triangles.size(), 902U);
  EXPECT_EQ(skin_fault(mesh), "");
  EXPECT_EQ(closed_fault(mesh), "");
  EXPECT_GT(enclosed_volume_m3(mesh), 0.0);
}

TEST(ClosedSurface, RabbitSitsOnAFlatBaseAtItsOrigin) {
  const TriangleMesh mesh = make_rabbit(453, 0.11);
  double low_m = 1.0, high_m = -1.0;
  int on_floor = 0;
  for (const Vector3d& vertex : mesh.vertices_m) {
    low_m = std::min(low_m, vertex.y());
    high_m = std::max(high_m, vertex.y());
    if (vertex.y() < 1e-9) ++on_floor;
  }
  EXPECT_NEAR(low_m, 0.0, 1e-12);
  EXPECT_NEAR(high_m, 0.11, 1e-12);
  EXPECT_GT(on_floor, 30);
}

TEST(ClosedSurface, StarsOfEverySizeObeyEuler) {
  for (const std::size_t nodes : {4U, 5U, 20U, 100U, 1000U}) {
    const TriangleMesh mesh = make_ball(nodes, 0.05);
    EXPECT_EQ(edges_of(mesh).size(), 3 * nodes - 6) << nodes;
    EXPECT_EQ(mesh.triangles.size(), 2 * nodes - 4) << nodes;
    EXPECT_EQ(closed_fault(mesh), "") << nodes;
    EXPECT_TRUE(looks_outwards(mesh, Vector3d::Zero())) << nodes;
  }
}

TEST(ClosedSurface, BallEnclosesWhatABallDoes) {
  const double exact_m3 = 4.0 / 3.0 * std::numbers::pi * std::pow(0.05, 3);
  const double coarse_m3 = enclosed_volume_m3(make_ball(200, 0.05)),
               fine_m3 = enclosed_volume_m3(make_ball(2000, 0.05));
  EXPECT_LT(fine_m3, exact_m3);  // inscribed
  EXPECT_NEAR(fine_m3 / exact_m3, 1.0, 0.01);
  EXPECT_LT(exact_m3 - fine_m3, 0.15 * (exact_m3 - coarse_m3));  // error of second order in the edges
}

TEST(ClosedSurface, NamesWhatIsOpenInsideOutOrLoose) {
  TriangleMesh open = make_ball(20, 0.05);
  open.triangles.pop_back();
  EXPECT_NE(closed_fault(open).find("belongs to one face only"), std::string::npos);
  TriangleMesh inward = make_ball(20, 0.05);
  for (auto& t : inward.triangles) std::swap(t[1], t[2]);
  EXPECT_NE(closed_fault(inward).find("inwards"), std::string::npos);
  EXPECT_LT(enclosed_volume_m3(inward), 0.0);
  TriangleMesh turned = make_ball(20, 0.05);
  std::swap(turned.triangles[3][1], turned.triangles[3][2]);
  EXPECT_NE(closed_fault(turned).find("the same way round"), std::string::npos);
  TriangleMesh loose = make_ball(20, 0.05);
  loose.vertices_m.push_back(Vector3d::Zero());
  EXPECT_EQ(skin_fault(loose), "vertex 21 belongs to no face");
  TriangleMesh pinched = make_ball(20, 0.05);
  pinched.vertices_m[pinched.triangles[0][0]] = pinched.vertices_m[pinched.triangles[0][1]];
  EXPECT_NE(skin_fault(pinched).find("has no length"), std::string::npos);
}

}  // namespace
}  // namespace rtbus::config
