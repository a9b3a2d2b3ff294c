/// The nearest point of a hull: against the closed form of a box, against a search over all directions, warm and cold.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "rtbus/shapes/hull.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace {

using Eigen::Vector3d;
using rtbus::shapes::Hull;
using rtbus::shapes::NearestFeature;

Hull corners_of(const Vector3d& half) {
  Hull out;
  for (int i = 0; i < 8; ++i) {
    out.points_m.emplace_back((i & 1 ? 1 : -1) * half.x(), (i & 2 ? 1 : -1) * half.y(), (i & 4 ? 1 : -1) * half.z());
  }
  return out;
}

Hull random_hull(std::mt19937& random, int points) {
  std::normal_distribution<double> normal;
  Hull out;
  for (int i = 0; i < points; ++i) {
    Vector3d at(normal(random), normal(random), normal(random));
    if (i % 3 != 0) at.normalize();  // the others are inside, or stick out
    out.points_m.push_back(0.02 * at);
  }
  out.points_m.push_back(out.points_m.front());  // twice
  return out;
}

Vector3d random_point(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> even(-size, size);
  return {even(random), even(random), even(random)};
}

/// No point of the hull lies nearer: all lie behind the plane through `at` across the way there. That is the optimality
/// condition of a convex set, so nothing else needs to be searched.
double beyond_plane_m(const Hull& hull, const Vector3d& p, const Vector3d& at) {
  const Vector3d normal = (p - at).normalized();
  double out = -std::numeric_limits<double>::infinity();
  for (const Vector3d& point : hull.points_m) out = std::max(out, normal.dot(point - at));
  return out;
}

TEST(Hull, OfEightCornersIsTheBox) {
  std::mt19937 random(1);
  const Vector3d half(0.03, 0.01, 0.02);
  const Hull hull = corners_of(half);
  NearestFeature feature;
  int outside = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vector3d p = random_point(random, 0.06);
    const auto truth = nearest_surface(rtbus::shapes::Shape(rtbus::shapes::Box{half}), p);
    Vector3d found;
    const bool is_outside = nearest_point(hull, p, feature, found);
    ASSERT_EQ(is_outside, truth.distance_m > 0.0) << p.transpose();
    if (!is_outside) continue;
    ++outside;
    ASSERT_LE((found - truth.point_m).norm(), 1e-12) << p.transpose();
  }
  EXPECT_GT(outside, 15000);
}

TEST(Hull, IsNearestByTheConditionOfOptimalityWarmAndCold) {
  std::mt19937 random(2);
  for (const int points : {4, 5, 12, 32, 200}) {
    const Hull hull = random_hull(random, points);
    NearestFeature warm;
    Vector3d p = random_point(random, 0.08);
    for (int i = 0; i < 3000; ++i) {
      p = i % 50 == 0 ? random_point(random, 0.08) : Vector3d(p + random_point(random, 1e-4));
      NearestFeature cold;
      Vector3d from_warm, from_cold;
      const bool outside = nearest_point(hull, p, cold, from_cold);
      ASSERT_EQ(nearest_point(hull, p, warm, from_warm), outside);
      if (!outside) continue;
      ASSERT_LE(beyond_plane_m(hull, p, from_cold), 1e-11) << points << " points, query " << i;
      ASSERT_LE((from_warm - from_cold).norm(), 1e-9) << points << " points, query " << i;
    }
  }
}

TEST(Hull, FlatThinAndTinyOnesAreNoTrouble) {
  const Hull flat{{{0, 0, 0}, {0.01, 0, 0}, {0, 0.01, 0}, {0.01, 0.01, 0}, {0.005, 0.005, 0}}};
  const Hull line{{{0, 0, 0}, {0.01, 0, 0}, {0.005, 0, 0}}};
  const Hull point{{{0.001, 0.002, 0.003}, {0.001, 0.002, 0.003}}};
  NearestFeature feature;
  Vector3d at;
  ASSERT_TRUE(nearest_point(flat, {0.004, 0.007, 0.002}, feature, at));
  EXPECT_LE((at - Vector3d(0.004, 0.007, 0)).norm(), 1e-15);
  ASSERT_TRUE(nearest_point(line, {0.02, 0.01, 0}, feature, at));
  EXPECT_LE((at - Vector3d(0.01, 0, 0)).norm(), 1e-15);
  ASSERT_TRUE(nearest_point(point, {1, 1, 1}, feature, at));
  EXPECT_LE((at - point.points_m[0]).norm(), 1e-15);
  EXPECT_FALSE(nearest_point(Hull{}, {0, 0, 0}, feature, at));
}

}  // namespace
