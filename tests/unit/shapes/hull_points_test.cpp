/// Where a hull lies on a face: against the corners of a box, and what tips on an edge.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rtbus/shapes/hull_points.hpp"

namespace hull_points_test {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using rtbus::shapes::Face;
using rtbus::shapes::face_towards;
using rtbus::shapes::FacePoints;
using rtbus::shapes::Hull;
using rtbus::shapes::PlacedShape;
using rtbus::shapes::Plane;

const Vector3d kHalf_m(0.03, 0.01, 0.02);

Hull box_hull(const Vector3d& origin_m) {
  Hull out;
  for (int i = 0; i < 8; ++i) {
    const Vector3d sign((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
    out.points_m.emplace_back(sign.cwiseProduct(kHalf_m) - origin_m);
  }
  out.points_m.emplace_back(0.5 * (out.points_m[0] + out.points_m[5]));  // in the middle of the lower face
  return out;
}

FacePoints points_of(const Quaterniond& q_WB, double height_m) {
  const Vector3d origin_m(0.004, -0.002, 0.001);
  FacePoints out;
  PlacedShape plane{Plane{}};
  plane.p_WB = {0.3, -0.1, 0.2};
  plane.q_WB = Quaterniond(AngleAxisd(0.3, Vector3d::UnitX()));
  const Vector3d centre_m = plane.p_WB + plane.q_WB * Vector3d(0.05, height_m, 0.02);
  hull_points(box_hull(origin_m), plane.q_WB * q_WB, centre_m + plane.q_WB * (q_WB * origin_m),
              *face_towards(plane, centre_m), out);
  EXPECT_NEAR((out.normal - plane.q_WB * Vector3d::UnitY()).norm(), 0.0, 1e-12);
  for (std::size_t i = 0; i < out.count; ++i) {
    EXPECT_NEAR(out.normal.dot(out.point_m[i] - plane.p_WB), out.gap_m[i], 1e-12);
    for (std::size_t k = 0; k < i; ++k) EXPECT_GT((out.point_m[i] - out.point_m[k]).norm(), 1e-6) << "twice";
  }
  return out;
}

TEST(HullPoints, OfAFaceAreItsCornersHoweverItIsTurned) {
  for (int i = 0; i < 20; ++i) {
    const FacePoints found = points_of(Quaterniond(AngleAxisd(0.31 * i, Vector3d::UnitY())), kHalf_m.y() + 1e-4);
    ASSERT_EQ(found.count, 4U);
    Vector3d sum = Vector3d::Zero();
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_NEAR(found.gap_m[k], 1e-4, 1e-12);
      sum += found.point_m[k] / 4.0;
    }
    double area = 0.0;  // two triangles whatever the order: the largest one twice
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        area = std::max(area, (found.point_m[a] - sum).cross(found.point_m[b] - sum).norm());
      }
    }
    EXPECT_NEAR(area, 2.0 * kHalf_m.x() * kHalf_m.z(), 1e-9) << "all four corners, not the middle";
  }
}

TEST(HullPoints, OfWhatStandsOnAnEdgeAreItsEnds) {
  const double tilt = 0.2;
  const FacePoints found = points_of(Quaterniond(AngleAxisd(tilt, Vector3d::UnitZ())),
                                     kHalf_m.x() * std::sin(tilt) + kHalf_m.y() * std::cos(tilt));
  ASSERT_EQ(found.count, 2U);
  EXPECT_NEAR(found.gap_m[0], 0.0, 1e-12);
  EXPECT_NEAR(found.gap_m[1], 0.0, 1e-12);
  EXPECT_NEAR((found.point_m[0] - found.point_m[1]).norm(), 2.0 * kHalf_m.z(), 1e-12);
}

// What rocks by a tenth of a millimetre keeps its four corners, each with its own gap.
TEST(HullPoints, OfWhatTipsALittleStayTheCorners) {
  const FacePoints found = points_of(Quaterniond(AngleAxisd(0.002, Vector3d::UnitZ())), kHalf_m.y());
  ASSERT_EQ(found.count, 4U);
  const auto [least, most] = std::minmax_element(found.gap_m.begin(), found.gap_m.end());
  EXPECT_NEAR(*most - *least, 2.0 * kHalf_m.x() * std::sin(0.002), 1e-12);
}

// Which of many is the lowest one is noise: a hull that slid on a ring of points had another one in each step, and
// rocked.
TEST(HullPoints, OfWhatLiesOnManyStayTheSameFour) {
  Hull ring;
  for (int i = 0; i < 26; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 26.0;
    ring.points_m.emplace_back(0.02 * std::cos(angle), 0.0, 0.02 * std::sin(angle));
  }
  ring.points_m.emplace_back(0.0, 0.03, 0.0);
  const Face floor;
  FacePoints level, leans, tips;
  hull_points(ring, Quaterniond::Identity(), Vector3d::Zero(), floor, level);
  ASSERT_EQ(level.count, 4U);
  for (int i = 0; i < 26; ++i) {
    const double angle = 2.0 * std::numbers::pi * (i + 0.3) / 26.0;
    const Vector3d about(std::cos(angle), 0.0, std::sin(angle));
    hull_points(ring, Quaterniond(AngleAxisd(1e-6, about)), Vector3d::Zero(), floor, leans);
    ASSERT_EQ(leans.count, 4U);
    for (const Vector3d& point_m : leans.point_m) {
      const auto is_it = [&](const Vector3d& other_m) { return (point_m - other_m).norm() < 1e-6; };
      EXPECT_TRUE(std::any_of(level.point_m.begin(), level.point_m.end(), is_it)) << i;
    }
    hull_points(ring, Quaterniond(AngleAxisd(1e-3, about)), Vector3d::Zero(), floor, tips);
    const double least_m = *std::min_element(tips.gap_m.begin(), tips.gap_m.end());
    EXPECT_LT(least_m, 1e-6 - 0.02 * std::sin(1e-3) * std::cos(std::numbers::pi / 26.0)) << "it tips over the lowest";
  }
}

TEST(HullPoints, AreNoneOfAnEmptyHull) {
  FacePoints out;
  out.count = 3;
  hull_points(Hull{}, Quaterniond::Identity(), Vector3d::Zero(), Face{}, out);
  EXPECT_EQ(out.count, 0U);
}

}  // namespace hull_points_test
