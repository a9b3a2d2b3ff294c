#include "rtbus/shapes/face_points.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace rtbus::shapes {
namespace {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

const Box kBox{Vector3d(0.03, 0.02, 0.01)};
const PlacedShape kFloor{Plane{}, Quaterniond::Identity(), Vector3d::Zero()};
const PlacedShape kTable{Box{Vector3d(0.1, 0.05, 0.05)}, Quaterniond::Identity(), Vector3d(0.0, -0.05, 0.0)};

FacePoints points_of(const Quaterniond& q_WB, const Vector3d& p_WB, const PlacedShape& holder) {
  FacePoints out;
  EXPECT_TRUE(face_points(kBox, q_WB, p_WB, holder, out));
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

TEST(FacePoints, BesideTheTableAreAsFarAsItsSide) {
  const FacePoints out = points_of(Quaterniond::Identity(), Vector3d(0.14, 0.02, 0.0), kTable);
  EXPECT_EQ(out.normal, Vector3d::UnitX());
  for (std::size_t i = 0; i < out.count; ++i) EXPECT_NEAR(out.gap_m[i], 0.01, 1e-12);
  // Nothing of it is before that side.
  EXPECT_EQ(points_of(Quaterniond::Identity(), Vector3d(0.14, 0.03, 0.0), kTable).count, 0u);
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
  const FacePoints out = points_of(Quaterniond::Identity(), Vector3d(0.13, -0.05, 0.0), kTable);
  ASSERT_EQ(out.count, 4u);
  EXPECT_NEAR((out.normal - Vector3d::UnitX()).norm(), 0.0, 1e-12);
  for (std::size_t i = 0; i < out.count; ++i) EXPECT_NEAR(out.gap_m[i], 0.0, 1e-12);
}

TEST(FacePoints, AreNoneOnABall) {
  FacePoints out;
  const PlacedShape ball{Sphere{0.1}, Quaterniond::Identity(), Vector3d(0.0, -0.1, 0.0)};
  EXPECT_FALSE(face_points(kBox, Quaterniond::Identity(), Vector3d(0.0, 0.02, 0.0), ball, out));
  EXPECT_EQ(out.count, 0u);
}

TEST(FacePoints, OfABoxThatTipsOverAnEdgeAreTheEndsOfThatEdge) {
  // Its lower face leads through the edge of the table at x = 0.1 m, and ends beyond it, below the table's face.
  const double tilt_rad = 0.3;
  const Quaterniond q_WB(AngleAxisd(-tilt_rad, Vector3d::UnitZ()));
  const Vector3d edge_m(0.1, 0.0, 0.0), along = q_WB * Vector3d::UnitX(), up = q_WB * Vector3d::UnitY();
  const FacePoints out = points_of(q_WB, edge_m + 0.01 * along + 0.02 * up, kTable);
  EXPECT_NEAR((out.normal - up).norm(), 0.0, 1e-12);
  for (const double z : {-0.01, 0.01}) EXPECT_TRUE(has_point(out, Vector3d(0.1, 0.0, z)));
  int touching = 0;
  for (std::size_t i = 0; i < out.count; ++i) {
    EXPECT_GE(out.gap_m[i], -1e-12);
    touching += out.gap_m[i] < 1e-9 ? 1 : 0;
  }
  EXPECT_EQ(touching, 2);
}

TEST(FacePoints, WhereTwoEdgesCrossAreOne) {
  // An edge of the box points at the edge of the table at x = 0.1 m, across it.
  const Vector3d out_of_table = Vector3d(1.0, 1.0, 0.0).normalized(), across = Vector3d(1.0, -1.0, 0.0).normalized();
  const Vector3d to_edge(0.03, 0.02, 0.0);
  Eigen::Matrix3d in_box, in_world;
  in_box << to_edge.normalized(), Vector3d::UnitZ().cross(to_edge.normalized()), Vector3d::UnitZ();
  in_world << -out_of_table, across.cross(-out_of_table), across;
  const Quaterniond q_WB(Eigen::Matrix3d(in_world * in_box.transpose()));
  const Vector3d edge_m(0.1, 0.0, 0.02);
  for (const double gap_m : {-0.0005, 0.0005}) {
    const Vector3d there_m = edge_m + gap_m * out_of_table;
    const FacePoints out = points_of(q_WB, there_m + to_edge.norm() * out_of_table + 0.004 * across, kTable);
    ASSERT_EQ(out.count, 1u);
    EXPECT_NEAR((out.normal - out_of_table).norm(), 0.0, 1e-12);
    EXPECT_NEAR(out.gap_m[0], gap_m, 1e-12);
    EXPECT_TRUE(has_point(out, there_m));
  }
}

/// The eight corners.
std::array<Vector3d, 8> corners_of(const Vector3d& half_m, const Quaterniond& q_WB, const Vector3d& p_WB) {
  std::array<Vector3d, 8> out;
  for (std::size_t i = 0; i < 8; ++i) {
    const Vector3d sign((i & 1) != 0 ? 1.0 : -1.0, (i & 2) != 0 ? 1.0 : -1.0, (i & 4) != 0 ? 1.0 : -1.0);
    out[i] = p_WB + q_WB * Vector3d(sign.cwiseProduct(half_m));
  }
  return out;
}

// The normal is, within 18 degrees, the way along which the two are farthest apart, of all faces and all pairs of
// edges; the points are the box's and their gaps are to the table along it.
TEST(FacePoints, LieInTheWayAlongWhichTheTwoAreFarthestApart) {
  std::mt19937 random(7);
  const auto draw = [&random](double half) {
    return half * (static_cast<double>(random()) / 4294967295.0 * 2.0 - 1.0);
  };
  const auto& table = std::get<Box>(kTable.shape);
  int kinds[3] = {};
  for (int turn = 0; turn < 5000; ++turn) {
    const Quaterniond q_WB = Quaterniond(draw(1.0), draw(1.0), draw(1.0), draw(1.0)).normalized();
    const Vector3d p_WB(draw(0.14), 0.02 + draw(0.02), draw(0.08));
    const FacePoints out = points_of(q_WB, p_WB, kTable);
    const auto held = corners_of(kBox.half_size_m, q_WB, p_WB);
    const auto holder = corners_of(table.half_size_m, kTable.q_WB, kTable.p_WB);
    const auto apart_m = [&](const Vector3d& way) {
      double low_m = std::numeric_limits<double>::infinity(), high_m = -low_m;
      for (std::size_t i = 0; i < 8; ++i) {
        low_m = std::min(low_m, way.dot(held[i]));
        high_m = std::max(high_m, way.dot(holder[i]));
      }
      return low_m - high_m;
    };
    const double best_m = apart_m(out.normal);
    std::vector<Vector3d> ways;
    for (int i = 0; i < 3; ++i) {
      ways.emplace_back(Vector3d::Unit(i));
      ways.emplace_back(q_WB * Vector3d(Vector3d::Unit(i)));
      for (int k = 0; k < 3; ++k) ways.emplace_back(Vector3d::Unit(k).cross(q_WB * Vector3d(Vector3d::Unit(i))));
    }
    Vector3d best = out.normal;
    for (const Vector3d& way : ways) {
      if (way.norm() < 0.05) continue;
      for (const double sign : {-1.0, 1.0}) {
        const Vector3d unit = sign * way.normalized();
        if (apart_m(unit) > apart_m(best)) best = unit;
      }
    }
    EXPECT_TRUE(apart_m(best) <= best_m + 2.1e-5 || best.dot(out.normal) > 0.95) << turn;
    for (std::size_t i = 0; i < out.count; ++i) {
      EXPECT_GE(out.gap_m[i], best_m - 1e-12) << turn;
      const Vector3d in_box = q_WB.conjugate() * (out.point_m[i] - p_WB);
      EXPECT_LE((in_box.cwiseAbs() - kBox.half_size_m).maxCoeff(), 1e-9) << turn;
    }
    const double off_axis =
        std::min(1.0 - out.normal.cwiseAbs().maxCoeff(), 1.0 - (q_WB.conjugate() * out.normal).cwiseAbs().maxCoeff());
    if (out.count > 0) ++kinds[off_axis > 1e-9 ? 2 : (out.normal.cwiseAbs().maxCoeff() < 1.0 - 1e-9 ? 1 : 0)];
  }
  for (const int count : kinds) EXPECT_GT(count, 100) << "faces of the table, of the box, and crossing edges";
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
    if (out.normal != Vector3d::UnitY()) continue;
    for (std::size_t i = 0; i < out.count; ++i) {
      const Vector3d in_box = q_WB.conjugate() * (out.point_m[i] - p_WB);
      EXPECT_NEAR(in_box.y(), -0.02, 1e-12);
      EXPECT_LE(std::abs(in_box.x()), 0.03 + 1e-12);
      EXPECT_LE(std::abs(in_box.z()), 0.01 + 1e-12);
      EXPECT_LE(std::abs(out.point_m[i].x()), 0.1 + 1e-12);
      EXPECT_LE(std::abs(out.point_m[i].z()), 0.05 + 1e-12);
      EXPECT_NEAR(out.gap_m[i], out.point_m[i].y(), 1e-12);
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

const Cylinder kCan{0.02, 0.06};

FacePoints rim_of(const Quaterniond& q_WB, const Vector3d& p_WB, const PlacedShape& holder, const Vector3d& way_W) {
  FacePoints out;
  EXPECT_TRUE(face_points(kCan, q_WB, p_WB, holder, way_W, out));
  return out;
}

TEST(RimPoints, OfACylinderThatStandsBeginWhereItWouldTip) {
  const FacePoints out =
      rim_of(Quaterniond::Identity(), Vector3d(0.5, 0.031, 0.2), kFloor, Vector3d(0.003, 0.2, 0.004));
  ASSERT_EQ(out.count, 4u);
  EXPECT_EQ(out.normal, Vector3d::UnitY());
  for (const Vector3d& way :
       {Vector3d(0.6, 0, 0.8), Vector3d(-0.6, 0, -0.8), Vector3d(0.8, 0, -0.6), Vector3d(-0.8, 0, 0.6)}) {
    EXPECT_TRUE(has_point(out, Vector3d(0.5, 0.001, 0.2) + 0.02 * way)) << way.transpose();
  }
  for (const double gap_m : out.gap_m) EXPECT_NEAR(gap_m, 0.001, 1e-15);
}

TEST(RimPoints, OfACylinderThatLeansHaveTheLowestOne) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int i = 0; i < 200; ++i) {
    const Vector3d about = Vector3d(any(random), any(random), any(random)).normalized();
    Quaterniond q_WB(AngleAxisd(1.2 * any(random), about));
    if (i % 2 == 1) q_WB = q_WB * Quaterniond(AngleAxisd(std::numbers::pi, Vector3d::UnitX()));  // upside down
    const Vector3d axis = q_WB * Vector3d(Vector3d::UnitY());
    if (std::hypot(axis.x(), axis.z()) < 0.01) continue;
    const FacePoints out = rim_of(q_WB, Vector3d(0.0, 0.1, 0.0), kFloor, Vector3d::Zero());
    ASSERT_EQ(out.count, 4u);
    const double lowest_m = 0.1 - 0.03 * std::abs(axis.y()) - 0.02 * std::hypot(axis.x(), axis.z());
    EXPECT_NEAR(*std::min_element(out.gap_m.begin(), out.gap_m.end()), lowest_m, 1e-12);
    for (std::size_t k = 0; k < out.count; ++k) {
      const Vector3d in_can = q_WB.conjugate() * (out.point_m[k] - Vector3d(0.0, 0.1, 0.0));
      EXPECT_NEAR(std::hypot(in_can.x(), in_can.z()), 0.02, 1e-12);
      EXPECT_NEAR(std::abs(in_can.y()), 0.03, 1e-12);
      EXPECT_NEAR(out.gap_m[k], out.point_m[k].y(), 1e-12);
    }
  }
}

// However it is turned, it must hold out as far as the table does, or it would tip too early.
TEST(RimPoints, EndAtTheEdgeOfTheTable) {
  for (const double beyond_m : {0.0005, 0.003, 0.01, 0.02, 0.03, 0.039}) {
    for (const double turned_rad : {0.0, 0.3, 1.0, 2.5}) {
      const Vector3d centre_m(0.1 - 0.02 + beyond_m, 0.03, 0.01);
      const FacePoints out =
          rim_of(Quaterniond::Identity(), centre_m, kTable, Vector3d(std::cos(turned_rad), 0.0, std::sin(turned_rad)));
      ASSERT_GT(out.count, 0u) << beyond_m;
      double farthest_m = -1.0, nearest_m = 1.0;
      for (std::size_t k = 0; k < out.count; ++k) {
        farthest_m = std::max(farthest_m, out.point_m[k].x());
        nearest_m = std::min(nearest_m, out.point_m[k].x());
        EXPECT_LE(std::hypot(out.point_m[k].x() - centre_m.x(), out.point_m[k].z() - centre_m.z()), 0.02 + 1e-12);
        EXPECT_NEAR(out.gap_m[k], 0.0, 1e-15);
      }
      const double edge_m = std::min(0.1, centre_m.x() + 0.02);
      EXPECT_LE(farthest_m, 0.1 + 1e-12);
      EXPECT_NEAR(farthest_m, edge_m, 0.0016) << "of eight corners, beyond " << beyond_m << " turned " << turned_rad;
      EXPECT_LT(nearest_m, centre_m.x() - 0.012);
    }
  }
  EXPECT_EQ(rim_of(Quaterniond::Identity(), Vector3d(0.13, 0.03, 0.0), kTable, Vector3d::Zero()).count, 0u);
}

TEST(FaceTowards, IsTheFaceOfABoxThatAPointIsFarthestBeyond) {
  const PlacedShape box{Box{{0.2, 0.05, 0.1}}, Quaterniond(AngleAxisd(0.4, Vector3d::UnitY())),
                        Vector3d(0.3, -0.05, 0.0)};
  struct Place {
    Vector3d from_centre, normal;  // in the frame of the box
    bool is_under;
  };
  for (const Place& each :
       {Place{{0.19, 0.06, 0.0}, Vector3d::UnitY(), true}, Place{{0.21, 0.10, 0.0}, Vector3d::UnitY(), false},
        Place{{-0.25, 0.06, 0.02}, -Vector3d::UnitX(), false}, Place{{0.0, 0.01, -0.14}, -Vector3d::UnitZ(), true}}) {
    const Vector3d point_m = box.p_WB + box.q_WB * each.from_centre;
    const auto face = face_towards(box, point_m);
    ASSERT_TRUE(face);
    EXPECT_NEAR((face->normal - box.q_WB * each.normal).norm(), 0.0, 1e-12);
    EXPECT_EQ(face->is_under(point_m), each.is_under) << each.from_centre.transpose();
  }
  EXPECT_FALSE(face_towards(PlacedShape{Sphere{0.1}}, Vector3d::UnitY()));
  EXPECT_TRUE(face_towards(PlacedShape{Plane{}}, Vector3d::UnitY())->is_under({1e3, 1.0, -1e3}));
}

}  // namespace
}  // namespace rtbus::shapes
