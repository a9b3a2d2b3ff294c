/// Minima of the distance to a surface of triangles: against a search over all triangles, and where they are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <set>
#include <vector>

#include <Eigen/Geometry>

#include "rtbus/shapes/surface.hpp"

namespace {

using Eigen::Vector3d;
using rtbus::shapes::Surface;
using rtbus::shapes::TrianglePart;

struct Triangles {
  std::vector<Vector3d> vertices_m;
  std::vector<std::array<std::uint32_t, 3>> triangles;

  void add(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const auto first = static_cast<std::uint32_t>(vertices_m.size());
    for (const Vector3d& each : {a, b, c}) vertices_m.push_back(each);  // each corner again: Surface joins them
    triangles.push_back({first, first + 1, first + 2});
  }
  void add_square(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
    add(a, b, c);
    add(a, c, d);
  }
};

/// A height field over a square of `size`, `n` cells along each side.
Triangles field(int n, double size, double (*height)(double, double)) {
  Triangles out;
  const auto at = [&](int i, int k) {
    const double x = size * (static_cast<double>(i) / n - 0.5), z = size * (static_cast<double>(k) / n - 0.5);
    return Vector3d(x, height(x, z), z);
  };
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < n; ++k) out.add_square(at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k));
  }
  return out;
}
double bumps(double x, double z) { return 0.002 * std::sin(300.0 * x) * std::cos(200.0 * z); }

double nearest_of_all(const Triangles& mesh, const Vector3d& p) {
  double out = std::numeric_limits<double>::infinity();
  for (const auto& each : mesh.triangles) {
    TrianglePart part;
    const std::array<Vector3d, 3> corner{mesh.vertices_m[each[0]], mesh.vertices_m[each[1]], mesh.vertices_m[each[2]]};
    out = std::min(out, (p - nearest_on_triangle(p, corner, part)).norm());
  }
  return out;
}

std::vector<Surface::Minimum> minima_of(const Surface& surface, const Vector3d& p, double reach_m,
                                        std::size_t room = 64) {
  std::vector<Surface::Minimum> out(room);
  out.resize(surface.minima(p, reach_m, out));
  return out;
}

double evenly(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

TEST(Triangle, ItsNearestPointIsNearerThanAThousandOthers) {
  std::mt19937 random(1);
  std::set<std::pair<int, int>> parts;
  for (int i = 0; i < 200; ++i) {
    std::array<Vector3d, 3> corner;
    for (Vector3d& each : corner) each = Vector3d::NullaryExpr([&] { return evenly(random, -1, 1); });
    const Vector3d p = Vector3d::NullaryExpr([&] { return evenly(random, -2, 2); });
    TrianglePart part;
    const Vector3d at = nearest_on_triangle(p, corner, part);
    parts.insert({part.kind, part.index});
    for (int k = 0; k < 1000; ++k) {
      double u = evenly(random, 0, 1), v = evenly(random, 0, 1);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const Vector3d other = corner[0] + u * (corner[1] - corner[0]) + v * (corner[2] - corner[0]);
      ASSERT_LE((p - at).norm(), (p - other).norm() + 1e-12);
    }
    if (part.kind == TrianglePart::kCorner) {
      EXPECT_EQ(at, corner[part.index]);
    }
    if (part.kind == TrianglePart::kEdge) {
      const Vector3d& from = corner[part.index];
      const Vector3d& to = corner[(part.index + 1u) % 3u];
      EXPECT_NEAR((at - from).cross(to - from).norm(), 0.0, 1e-12);
    }
  }
  EXPECT_EQ(parts.size(), 7U) << "face, three edges, three corners";
}

TEST(Surface, ItsNearestMinimumIsTheNearestOfAllTriangles) {
  const Triangles mesh = field(40, 0.1, &bumps);
  const Surface surface(mesh.vertices_m, mesh.triangles);
  EXPECT_EQ(surface.triangle_count(), 3200U);
  std::mt19937 random(2);
  for (int i = 0; i < 300; ++i) {
    const Vector3d p(evenly(random, -0.06, 0.06), evenly(random, -0.01, 0.01), evenly(random, -0.06, 0.06));
    const double truth = nearest_of_all(mesh, p);
    const auto found = minima_of(surface, p, truth + 1e-3);
    ASSERT_FALSE(found.empty());
    const auto nearest = std::min_element(found.begin(), found.end(),
                                          [](const auto& a, const auto& b) { return a.distance_m < b.distance_m; });
    EXPECT_NEAR(nearest->distance_m, truth, 1e-12);
    EXPECT_TRUE(minima_of(surface, p, 0.999 * truth).empty());
    for (const auto& each : found) {
      EXPECT_NEAR((p - each.point_m).norm(), each.distance_m, 1e-12);
      EXPECT_LT(nearest_of_all(mesh, each.point_m), 1e-12) << "on the surface";
    }
  }
}

/// On a triangle, which is convex, a minimum of the distance is the nearest point of all. So a point of the surface is
/// a minimum where it is the nearest point of each triangle that it is on. Nothing of neighbours, edges or corners is
/// asked. @returns how many different ones are within reach.
std::vector<Vector3d> minima_by_search(const Triangles& mesh, const Vector3d& p, double reach_m) {
  constexpr double kSame_m = 1e-10, kRounding_m = 1e-14;
  const auto nearest = [&](const std::array<std::uint32_t, 3>& each, const Vector3d& q) {
    TrianglePart part;
    return nearest_on_triangle(q, {mesh.vertices_m[each[0]], mesh.vertices_m[each[1]], mesh.vertices_m[each[2]]}, part);
  };
  std::vector<Vector3d> out;
  for (const auto& each : mesh.triangles) {
    const Vector3d at = nearest(each, p);
    const double distance_m = (p - at).norm();
    const auto same = [&](const Vector3d& other) { return (other - at).norm() < kSame_m; };
    if (distance_m >= reach_m || std::any_of(out.begin(), out.end(), same)) continue;
    const bool minimum = std::all_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& other) {
      return !same(nearest(other, at)) || (p - nearest(other, p)).norm() >= distance_m - kRounding_m;
    });
    if (minimum) out.push_back(at);
  }
  return out;
}

TEST(Surface, ItsMinimaAreThoseOfASearchOverAllTriangles) {
  Triangles creased = field(12, 0.05, [](double x, double z) { return 0.4 * std::abs(x) - 0.6 * std::abs(z - 0.004); });
  creased.add({-0.02, 0.004, 0}, {0.02, 0.004, 0.001}, {0, 0.02, 0.01});  // open, and through the others
  std::mt19937 random(12);
  std::size_t minima = 0, several = 0;
  for (const Triangles& mesh : {field(16, 0.05, &bumps), creased}) {
    const Surface surface(mesh.vertices_m, mesh.triangles);
    for (int i = 0; i < 250; ++i) {
      const Vector3d p(evenly(random, -0.03, 0.03), evenly(random, -0.01, 0.015), evenly(random, -0.03, 0.03));
      const double reach_m = nearest_of_all(mesh, p) + evenly(random, 1e-4, 4e-3);
      const auto truth = minima_by_search(mesh, p, reach_m);
      const auto found = minima_of(surface, p, reach_m);
      ASSERT_EQ(found.size(), truth.size()) << "at " << p.transpose() << " within " << reach_m;
      for (const Vector3d& each : truth) {
        EXPECT_TRUE(std::any_of(found.begin(), found.end(), [&](const auto& one) {
          return (one.point_m - each).norm() < 1e-9;
        })) << each.transpose();
      }
      minima += found.size();
      several += found.size() > 1 ? 1 : 0;
    }
  }
  EXPECT_GT(minima, 500U);
  EXPECT_GT(several, 50U) << "creases and bumps within reach";
}

// A ball that rests on a smooth surface touches it at one place, however fine its triangles are.
TEST(Surface, SmoothOnesHaveOneMinimumAtABall) {
  for (const int n : {20, 80, 320}) {
    const Triangles mesh = field(n, 0.1, [](double x, double z) { return 0.5 * (x * x + z * z); });
    const Surface surface(mesh.vertices_m, mesh.triangles);
    std::mt19937 random(3);
    std::size_t minima = 0, most = 0;
    constexpr int kPlaces = 100;
    for (int i = 0; i < kPlaces; ++i) {
      Vector3d p(evenly(random, -0.03, 0.03), 0.02, evenly(random, -0.03, 0.03));
      const auto nearest_m = [&] {
        double out = std::numeric_limits<double>::infinity();
        for (const auto& each : minima_of(surface, p, 0.05)) out = std::min(out, each.distance_m);
        return out;
      };
      p.y() += 0.005 - nearest_m();
      const std::size_t found = minima_of(surface, p, nearest_m() + 0.2e-3).size();
      minima += found;
      most = std::max(most, found);
    }
    EXPECT_LT(static_cast<double>(minima) / kPlaces, 1.2) << n;
    EXPECT_LE(most, 3U) << n;
  }
}

TEST(Surface, AGrooveHasTwoMinimaAndARidgeOne) {
  Triangles groove;
  const double w = 0.02;
  groove.add_square({-w, w, -w}, {-w, w, w}, {0, 0, w}, {0, 0, -w});
  groove.add_square({0, 0, -w}, {0, 0, w}, {w, w, w}, {w, w, -w});
  const auto in_groove = minima_of(Surface(groove.vertices_m, groove.triangles), {0, 0.01, 0.001}, 0.01);
  ASSERT_EQ(in_groove.size(), 2U);
  EXPECT_NEAR(in_groove[0].distance_m, 0.01 / std::numbers::sqrt2, 1e-12);
  EXPECT_NEAR((in_groove[0].point_m - in_groove[1].point_m).norm(), 0.01, 1e-12);
  // From below it is a ridge, and the edge is what is touched.
  const auto at_ridge = minima_of(Surface(groove.vertices_m, groove.triangles), {0.001, -0.01, 0.001}, 0.02);
  ASSERT_EQ(at_ridge.size(), 1U);
  EXPECT_NEAR((at_ridge[0].point_m - Vector3d(0, 0, 0.001)).norm(), 0.0, 1e-12);
}

TEST(Surface, OfAFlatCornerOfABoxTheCornerIsFound) {
  Triangles box;
  const double h = 0.01;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-h, h}) {
      std::array<Vector3d, 4> corner;
      const std::array<std::array<double, 2>, 4> uv{{{-h, -h}, {h, -h}, {h, h}, {-h, h}}};
      for (std::size_t i = 0; i < 4; ++i) {
        corner[i][axis] = side;
        corner[i][(axis + 1) % 3] = uv[i][0];
        corner[i][(axis + 2) % 3] = uv[i][1];
      }
      box.add_square(corner[0], corner[1], corner[2], corner[3]);
    }
  }
  const Surface surface(box.vertices_m, box.triangles);
  std::mt19937 random(4);
  for (int i = 0; i < 3000; ++i) {
    const Vector3d p = Vector3d::NullaryExpr([&] { return evenly(random, -0.02, 0.02); });
    const Vector3d clamped = p.cwiseMax(-h).cwiseMin(h);
    if (clamped == p) continue;  // inside: a surface has none
    auto found = minima_of(surface, p, (p - clamped).norm() + 1e-9);
    ASSERT_GE(found.size(), 1U) << p.transpose();
    EXPECT_NEAR((found[0].point_m - clamped).norm(), 0.0, 1e-9);
  }
}

TEST(Surface, FilesWithFaultsAreTouchedWhereTheyHaveArea) {
  Triangles mesh;
  mesh.add_square({-1, 0, -1}, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1});
  mesh.add({0, 0, 0}, {1, 0, 0}, {0.5, 0, 0});   // no area
  mesh.add({0, 0, 0}, {0, 0, 0}, {0, 0, 0});     // a point
  mesh.add({-1, 0, -1}, {-1, 0, 1}, {1, 0, 1});  // one of them twice
  mesh.add({-1, 0, -1}, {1, 0, 1}, {0, 1, 0});   // a third at one edge
  mesh.vertices_m.emplace_back(0, -5, 0);        // of no face
  const Surface surface(mesh.vertices_m, mesh.triangles);
  EXPECT_EQ(surface.triangle_count(), 4U);
  const auto below = minima_of(surface, {0.3, -0.01, 0.1}, 0.1);
  ASSERT_FALSE(below.empty());
  for (const auto& each : below) EXPECT_NEAR((each.point_m - Vector3d(0.3, 0, 0.1)).norm(), 0.0, 1e-12);
  EXPECT_EQ(Surface({}, {}).triangle_count(), 0U);
  EXPECT_TRUE(minima_of(Surface({}, {}), Vector3d::Zero(), 1.0).empty());
}

TEST(Surface, OfAMillionTrianglesIsMadeInSecondsAndAskedInMicroseconds) {
  constexpr int kCells = 708;  // 1 002 528 triangles
  std::vector<Vector3d> vertices_m;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (std::uint32_t i = 0; i <= kCells; ++i) {
    for (std::uint32_t k = 0; k <= kCells; ++k) {
      const double x = 0.05 * i / kCells - 0.025, z = 0.05 * k / kCells - 0.025;
      vertices_m.emplace_back(x, bumps(x, z), z);
      if (i == kCells || k == kCells) continue;
      const std::uint32_t a = i * (kCells + 1) + k, b = a + kCells + 1;
      triangles.push_back({a, a + 1, b + 1});
      triangles.push_back({a, b + 1, b});
    }
  }
  const Surface surface(vertices_m, triangles);
  EXPECT_EQ(surface.triangle_count(), 2U * kCells * kCells);
  std::mt19937 random(6);
  for (int i = 0; i < 1000; ++i) {
    const double x = evenly(random, -0.02, 0.02), z = evenly(random, -0.02, 0.02);
    const Vector3d p(x, bumps(x, z) + 2e-4, z);
    const auto found = minima_of(surface, p, 3e-4);
    ASSERT_FALSE(found.empty());
    for (const auto& each : found) ASSERT_NEAR(each.point_m.y(), bumps(each.point_m.x(), each.point_m.z()), 2e-7);
  }
}

TEST(Surface, KeepsTheNearestWhereThereIsNoRoomForAll) {
  Triangles mesh;
  for (int i = 0; i < 12; ++i) {  // ever farther, each a minimum of its own
    const double angle = 2.0 * std::numbers::pi * i / 12.0;
    const Vector3d out(std::cos(angle), 0, std::sin(angle)), across(-std::sin(angle), 0, std::cos(angle));
    const Vector3d at = (0.01 + 0.001 * i) * out;
    mesh.add(at - 0.001 * across, at + 0.001 * across, at + Vector3d(0, 0.001, 0));
  }
  const Surface surface(mesh.vertices_m, mesh.triangles);
  EXPECT_EQ(minima_of(surface, Vector3d::Zero(), 1.0).size(), 12U);
  const auto nearest = minima_of(surface, Vector3d::Zero(), 1.0, 5);
  ASSERT_EQ(nearest.size(), 5U);
  for (const auto& each : nearest) EXPECT_LT(each.distance_m, 0.0145);
}

}  // namespace
