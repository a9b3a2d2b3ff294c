#include "rtbus/shapes/face_points.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace rtbus::shapes {
namespace {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

const Box kBox{Vector3d(0.03, 0.02, 0.01)};
const PlacedShape kFloor{Plane{}, Quaterniond::Identity(), Vector3d::Zero()};
const PlacedShape kTable{Box{Vector3d(0.1, 0.05, 0.05)}, Quaterniond::Identity(), Vector3d(0.0, -0.05, 0.0)};

FacePoints points_of(const Quaterniond& q_WB, const Vector3d& p_WB, const PlacedShape& holder,
                     const Vector3d& toward = Vector3d::UnitY()) {
  FacePoints out;
  EXPECT_TRUE(face_points(kBox, q_WB, p_WB, holder, toward, out));
  return out;
}

/// Whether `out` has a point within 1 nm of there.
bool has_point(const FacePoints& out, const Vector3d& there_m) {
  return std::any_of(out.point_m.begin(), out.point_m.begin() + static_cast<std::ptrdiff_t>(out.count),
                     [&](const Vector3d& point_m) { return (point_m - there_m).norm() < 1e-9; });
}

TEST(FacePoints, OfABoxOnAFloorAreItsFourLowCorners) {
  const FacePoints out = points_of(Quaterniond::Identity(), Vector3d(0.5, 0.021, 0.2), kFloor);
  ASSERT_EQ(out.count, 4u);
  EXPECT_EQ(out.normal, Vector3d::UnitY());
  for (const double x : {-0.03, 0.03}) {
    for (const double z : {-0.01, 0.01}) EXPECT_TRUE(has_point(out, Vector3d(0.5 + x, 0.001, 0.2 + z))) << x << z;
  }
  for (const double gap_m : out.gap_m) EXPECT_NEAR(gap_m, 0.001, 1e-15);
}

TEST(FacePoints, OfATiltedBoxHaveTheirOwnGaps) {
  const double tilt_rad = 0.1;
  const Quaterniond q_WB(AngleAxisd(tilt_rad, Vector3d::UnitZ()));
  const FacePoints out = points_of(q_WB, Vector3d(0.0, 0.03, 0.0), kFloor);
  ASSERT_EQ(out.count, 4u);
  for (std::size_t i = 0; i < out.count; ++i) {
    const Vector3d in_box = q_WB.conjugate() * (out.point_m[i] - Vector3d(0.0, 0.03, 0.0));
    EXPECT_NEAR(std::abs(in_box.x()), 0.03, 1e-12);
    EXPECT_NEAR(out.gap_m[i], 0.03 - 0.02 * std::cos(tilt_rad) + in_box.x() * std::sin(tilt_rad), 1e-12);
  }
}

TEST(FacePoints, TheLowestCornersAreThoseOfTheFaceThatLooksDown) {
  // Turned by more than 45 degrees it lies on another face.
  const Quaterniond q_WB(AngleAxisd(1.0, Vector3d::UnitZ()));
  const FacePoints out = points_of(q_WB, Vector3d(0.0, 0.05, 0.0), kFloor);
  double lowest_m = std::numeric_limits<double>::infinity();
  for (const double x : {-0.03, 0.03}) {
    for (const double y : {-0.02, 0.02}) {
      lowest_m = std::min(lowest_m, 0.05 + (q_WB * Vector3d(x, y, 0.0)).y());
    }
  }
  ASSERT_EQ(out.count, 4u);
  EXPECT_NEAR(*std::min_element(out.gap_m.begin(), out.gap_m.end()), lowest_m, 1e-12);
}

TEST(FacePoints, EndAtTheEdgesOfTheFaceBelow) {
  // Two thirds of the box are beyond the edge of the table at x = 0.1 m.
  const FacePoints out = points_of(Quaterniond::Identity(), Vector3d(0.11, 0.02, 0.0), kTable);
  ASSERT_EQ(out.count, 4u);
  for (const double z : {-0.01, 0.01}) {
    EXPECT_TRUE(has_point(out, Vector3d(0.08, 0.0, z)));
    EXPECT_TRUE(has_point(out, Vector3d(0.1, 0.0, z)));
  }
}

TEST(FacePoints, AreNoneBesideTheFaceBelow) {
  EXPECT_EQ(points_of(Quaterniond::Identity(), Vector3d(0.14, 0.02, 0.0), kTable).count, 0u);
}

TEST(FacePoints, OfALongBoxAcrossATableAreWhereItsEdgesCrossThoseOfTheTable) {
  const PlacedShape narrow{Box{Vector3d(0.01, 0.05, 0.2)}, Quaterniond::Identity(), Vector3d(0.0, -0.05, 0.0)};
  const FacePoints out = points_of(Quaterniond::Identity(), Vector3d(0.0, 0.02, 0.0), narrow);
  ASSERT_EQ(out.count, 4u);
  for (const double x : {-0.01, 0.01}) {
    for (const double z : {-0.01, 0.01}) EXPECT_TRUE(has_point(out, Vector3d(x, 0.0, z)));
  }
}

TEST(FacePoints, OnTheSideOfABoxLookSideways) {
  const FacePoints out = points_of(Quaterniond::Identity(), Vector3d(0.13, -0.05, 0.0), kTable, Vector3d::UnitX());
  ASSERT_EQ(out.count, 4u);
  EXPECT_NEAR((out.normal - Vector3d::UnitX()).norm(), 0.0, 1e-12);
  for (std::size_t i = 0; i < out.count; ++i) EXPECT_NEAR(out.gap_m[i], 0.0, 1e-12);
}

TEST(FacePoints, AreNoneOfAFaceThatLooksAnotherWay) {
  FacePoints out;
  const Vector3d oblique = Vector3d(1.0, 1.0, 0.0).normalized();
  EXPECT_FALSE(face_points(kBox, Quaterniond::Identity(), Vector3d(0.0, 0.02, 0.0), kFloor, oblique, out));
  const PlacedShape ball{Sphere{0.1}, Quaterniond::Identity(), Vector3d(0.0, -0.1, 0.0)};
  EXPECT_FALSE(face_points(kBox, Quaterniond::Identity(), Vector3d(0.0, 0.02, 0.0), ball, Vector3d::UnitY(), out));
  EXPECT_EQ(out.count, 0u);
}

// Against every point of a grid on the lower face: a grid point above the table has no smaller gap than the corners
// span, and where a grid point is above the table there are corners.
TEST(FacePoints, SpanTheAreaThatBothFacesShare) {
  std::mt19937 random(11);
  const auto draw = [&random](double half) {
    return half * (static_cast<double>(random()) / 4294967295.0 * 2.0 - 1.0);
  };
  for (int turn = 0; turn < 2000; ++turn) {
    const double x = draw(0.14), z = draw(0.08), yaw_rad = draw(3.1), roll_rad = draw(0.2), pitch_rad = draw(0.2);
    const Quaterniond q_WB = Quaterniond(AngleAxisd(yaw_rad, Vector3d::UnitY())) *
                             AngleAxisd(roll_rad, Vector3d::UnitX()) * AngleAxisd(pitch_rad, Vector3d::UnitZ());
    const Vector3d p_WB(x, 0.03, z);
    const FacePoints out = points_of(q_WB, p_WB, kTable);
    ASSERT_LE(out.count, FacePoints::kMost);
    Vector3d middle_m = Vector3d::Zero();
    for (std::size_t i = 0; i < out.count; ++i) {
      const Vector3d in_box = q_WB.conjugate() * (out.point_m[i] - p_WB);
      EXPECT_NEAR(in_box.y(), -0.02, 1e-12);
      EXPECT_LE(std::abs(in_box.x()), 0.03 + 1e-12);
      EXPECT_LE(std::abs(in_box.z()), 0.01 + 1e-12);
      EXPECT_LE(std::abs(out.point_m[i].x()), 0.1 + 1e-12);
      EXPECT_LE(std::abs(out.point_m[i].z()), 0.05 + 1e-12);
      EXPECT_NEAR(out.gap_m[i], out.point_m[i].y(), 1e-12);
      middle_m += out.point_m[i] / static_cast<double>(out.count);
    }
    int above = 0;
    double lowest_m = std::numeric_limits<double>::infinity();
    for (int i = -10; i <= 10; ++i) {
      for (int k = -10; k <= 10; ++k) {
        const Vector3d point_m = p_WB + q_WB * Vector3d(0.003 * i, -0.02, 0.001 * k);
        if (std::abs(point_m.x()) > 0.1 || std::abs(point_m.z()) > 0.05) continue;
        ++above;
        lowest_m = std::min(lowest_m, point_m.y());
      }
    }
    if (above == 0) continue;
    ASSERT_GE(out.count, 3u) << turn;
    // Of up to eight corners four are kept: those miss the lowest one by less than the tilt over an edge's length.
    const double nearest_m =
        *std::min_element(out.gap_m.begin(), out.gap_m.begin() + static_cast<std::ptrdiff_t>(out.count));
    EXPECT_LE(nearest_m, lowest_m + 0.005) << turn;
  }
}

}  // namespace
}  // namespace rtbus::shapes
