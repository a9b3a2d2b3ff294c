#include "rtbus/shapes/shapes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace rtbus::shapes {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

const Vector3d kHalfSize_m(0.03, 0.05, 0.02);

/// Points in and around a shape of a few centimetres; the same in every run and library.
class Points {
 public:
  Vector3d next(double half_width_m = 0.1) {
    const auto draw = [this] { return static_cast<double>(random_()) / 4294967295.0 * 2.0 - 1.0; };
    const double x = draw();
    const double y = draw();
    return half_width_m * Vector3d(x, y, draw());
  }

 private:
  std::mt19937 random_{7};
};

/// What all shapes promise for a point that has one nearest surface point.
template <class AnyShape>
void expect_consistent(const AnyShape& shape, const Vector3d& p) {
  const SurfacePoint s = nearest_surface(shape, p);
  EXPECT_NEAR(s.normal.norm(), 1.0, 1e-12);
  EXPECT_NEAR(nearest_surface(shape, s.point_m).distance_m, 0.0, 1e-15);
  EXPECT_NEAR((p - (s.point_m + s.distance_m * s.normal)).norm(), 0.0, 1e-14);
}

/// The normal is the gradient of the distance, by central differences.
template <class AnyShape>
void expect_gradient_is_normal(const AnyShape& shape, const Vector3d& p) {
  constexpr double kStep_m = 1e-6;
  Vector3d gradient;
  for (int i = 0; i < 3; ++i) {
    const Vector3d step = kStep_m * Vector3d::Unit(i);
    gradient[i] =
        (nearest_surface(shape, p + step).distance_m - nearest_surface(shape, p - step).distance_m) / (2 * kStep_m);
  }
  EXPECT_NEAR((gradient - nearest_surface(shape, p).normal).norm(), 0.0, 1e-4) << p.transpose();
}

/// Two faces are equally near within the step of the differences: the gradient jumps there.
bool near_medial_surface(const Vector3d& p) {
  Vector3d depth = p.cwiseAbs() - kHalfSize_m;
  if ((depth.array() > 0.0).any()) {
    return (depth.array().abs() < 1e-4).any();  // the Voronoi planes of faces and edges outside are smooth but curved
  }
  std::sort(depth.data(), depth.data() + 3);
  return depth[2] - depth[1] < 1e-5 || p.cwiseAbs().minCoeff() < 1e-5;
}

TEST(Plane, MeasuresHeightAboveItself) {
  const SurfacePoint above = nearest_surface(Plane{}, Vector3d(1.0, 0.25, -2.0));
  EXPECT_EQ(above.distance_m, 0.25);
  EXPECT_EQ(above.normal, Vector3d::UnitY());
  EXPECT_EQ(above.point_m, Vector3d(1.0, 0.0, -2.0));
  EXPECT_EQ(nearest_surface(Plane{}, Vector3d(0.0, -0.5, 0.0)).distance_m, -0.5);
}

TEST(Sphere, MeasuresAlongTheRadiusInsideAndOutside) {
  const Sphere sphere{0.05};
  EXPECT_DOUBLE_EQ(nearest_surface(sphere, Vector3d(0.0, 0.0, 0.08)).distance_m, 0.03);
  EXPECT_DOUBLE_EQ(nearest_surface(sphere, Vector3d(-0.01, 0.0, 0.0)).distance_m, -0.04);
  EXPECT_EQ(nearest_surface(sphere, Vector3d(-0.01, 0.0, 0.0)).normal, Vector3d(-Vector3d::UnitX()));
}

TEST(Sphere, AtItsCentrePointsUp) {
  const SurfacePoint s = nearest_surface(Sphere{0.05}, Vector3d::Zero());
  EXPECT_EQ(s.normal, Vector3d::UnitY());
  EXPECT_EQ(s.distance_m, -0.05);
  EXPECT_EQ(s.point_m, Vector3d(0.0, 0.05, 0.0));
}

TEST(Sphere, KeepsUnitNormalsHoweverNearTheCentre) {
  for (double r = 1.0; r > 0.0; r *= 0.1) {  // down through the subnormal numbers
    EXPECT_NEAR(nearest_surface(Sphere{0.05}, r * Vector3d(1.0, -2.0, 0.5)).normal.norm(), 1.0, 1e-12) << r;
  }
}

TEST(Capsule, IsABallThatGoesAlongItsAxis) {
  const Capsule capsule{0.02, 0.1};
  Points points;
  for (int i = 0; i < 1000; ++i) {
    const Vector3d p = points.next();
    double nearest_m = std::numeric_limits<double>::infinity();
    for (int step = 0; step <= 600; ++step) {
      const Vector3d centre(0.0, -0.03 + 1e-4 * step, 0.0);
      nearest_m = std::min(nearest_m, nearest_surface(Sphere{capsule.radius_m}, p - centre).distance_m);
    }
    EXPECT_NEAR(nearest_surface(capsule, p).distance_m, nearest_m, 2e-6) << p.transpose();
    expect_consistent(capsule, p);
    expect_gradient_is_normal(capsule, p);
  }
  EXPECT_EQ(nearest_surface(capsule, Vector3d(0, 0.01, 0)).normal, Vector3d::UnitX()) << "on the axis";
  EXPECT_DOUBLE_EQ(nearest_surface(capsule, Vector3d(0, 0.06, 0)).distance_m, 0.01);
}

TEST(Cylinder, MeasuresToSideCapAndRim) {
  const Cylinder cylinder{0.03, 0.04};
  EXPECT_DOUBLE_EQ(nearest_surface(cylinder, Vector3d(0.05, 0.01, 0)).distance_m, 0.02);
  EXPECT_DOUBLE_EQ(nearest_surface(cylinder, Vector3d(0.01, -0.05, 0)).distance_m, 0.03);
  EXPECT_EQ(nearest_surface(cylinder, Vector3d(0.01, -0.05, 0)).normal, Vector3d(0, -1, 0));
  const SurfacePoint rim = nearest_surface(cylinder, Vector3d(0, 0.024, 0.033));
  EXPECT_NEAR(rim.distance_m, 0.005, 1e-15);
  EXPECT_NEAR((rim.point_m - Vector3d(0, 0.02, 0.03)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((rim.normal - Vector3d(0, 0.8, 0.6)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(nearest_surface(cylinder, Vector3d(0.028, 0, 0)).distance_m, -0.002, 1e-15);
  EXPECT_NEAR(nearest_surface(cylinder, Vector3d(0.01, 0.019, 0)).distance_m, -0.001, 1e-15);
  Points points;
  for (int i = 0; i < 1000; ++i) {
    const Vector3d p = points.next(0.06);
    expect_consistent(cylinder, p);
    const double beside = std::hypot(p.x(), p.z()) - 0.03, beyond = std::abs(p.y()) - 0.02;
    const bool inside = beside < 0.0 && beyond < 0.0;
    if (std::hypot(p.x(), p.z()) < 1e-3 || std::abs(beside) < 1e-4 || std::abs(beyond) < 1e-4) continue;
    if (!inside || std::abs(beside - beyond) > 1e-4) expect_gradient_is_normal(cylinder, p);
  }
}

TEST(Box, MeasuresToFaceEdgeAndCornerOutside) {
  const Box box{kHalfSize_m};
  const SurfacePoint face = nearest_surface(box, Vector3d(0.01, 0.07, 0.01));
  EXPECT_DOUBLE_EQ(face.distance_m, 0.02);
  EXPECT_EQ(face.normal, Vector3d::UnitY());
  const SurfacePoint edge = nearest_surface(box, Vector3d(0.03 + 0.003, 0.0, -0.02 - 0.004));
  EXPECT_NEAR(edge.distance_m, 0.005, 1e-15);
  EXPECT_NEAR((edge.normal - Vector3d(0.6, 0.0, -0.8)).norm(), 0.0, 1e-12);
  const SurfacePoint corner = nearest_surface(box, kHalfSize_m + Vector3d(0.001, 0.002, 0.002));
  EXPECT_NEAR(corner.distance_m, 0.003, 1e-15);
  EXPECT_EQ(corner.point_m, kHalfSize_m);
}

TEST(Box, TakesTheNearestFaceInside) {
  const SurfacePoint s = nearest_surface(Box{kHalfSize_m}, Vector3d(0.0, -0.045, 0.01));
  EXPECT_NEAR(s.distance_m, -0.005, 1e-15);
  EXPECT_EQ(s.normal, Vector3d(-Vector3d::UnitY()));
  EXPECT_EQ(s.point_m, Vector3d(0.0, -0.05, 0.01));
}

TEST(Box, LetsTheLowerAxisWinATie) {
  const Box cube{Vector3d::Constant(0.02)};
  EXPECT_EQ(nearest_surface(cube, Vector3d::Zero()).normal, Vector3d::UnitX());
  EXPECT_EQ(nearest_surface(cube, Vector3d(0.0, 0.01, 0.01)).normal, Vector3d::UnitY());
  EXPECT_EQ(nearest_surface(cube, Vector3d(0.01, -0.01, 0.01)).normal, Vector3d::UnitX());
}

TEST(Box, HasAUnitNormalExactlyOnFaceEdgeAndCorner) {
  const Box box{kHalfSize_m};
  for (const Vector3d& p : {Vector3d(0.03, 0.01, 0.0), Vector3d(-0.03, 0.05, 0.0), Vector3d(0.03, -0.05, 0.02)}) {
    const SurfacePoint s = nearest_surface(box, p);
    EXPECT_EQ(s.distance_m, 0.0);
    EXPECT_EQ(s.normal.norm(), 1.0);
    EXPECT_EQ(s.point_m, p);
    EXPECT_GT(s.normal.dot(p), 0.0);
  }
}

TEST(Box, KeepsUnitNormalsHoweverNearAnEdge) {
  for (double gap = 1e-3; gap > 0.0; gap *= 0.1) {
    const Box box{Vector3d::Zero()};  // no size: no rounding of a sum swallows the gap
    EXPECT_NEAR(nearest_surface(box, gap * Vector3d(1.0, 1.0, 0.0)).normal.norm(), 1.0, 1e-12) << gap;
  }
}

TEST(Box, AgreesWithBruteForceOverItsSurface) {
  const Box box{kHalfSize_m};
  Points points;
  constexpr int kGrid = 60;
  for (int n = 0; n < 60; ++n) {
    const Vector3d p = points.next(0.08);
    double nearest_m = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      for (int i = 0; i <= kGrid; ++i) {
        for (int j = 0; j <= kGrid; ++j) {
          Vector3d q;
          q[(axis + 1) % 3] = kHalfSize_m[(axis + 1) % 3] * (2.0 * i / kGrid - 1.0);
          q[(axis + 2) % 3] = kHalfSize_m[(axis + 2) % 3] * (2.0 * j / kGrid - 1.0);
          for (const double side : {-1.0, 1.0}) {
            q[axis] = side * kHalfSize_m[axis];
            nearest_m = std::min(nearest_m, (p - q).norm());
          }
        }
      }
    }
    const bool inside = (p.cwiseAbs().array() < kHalfSize_m.array()).all();
    const double distance_m = nearest_surface(box, p).distance_m;
    EXPECT_EQ(distance_m < 0.0, inside);
    // The sampled minimum is never below the true one, and above it by less than half a cell's diagonal.
    const double cell_m = 2.0 * kHalfSize_m.maxCoeff() / kGrid;
    EXPECT_LE(std::abs(distance_m), nearest_m + 1e-15);
    EXPECT_GE(std::abs(distance_m), nearest_m - 0.71 * cell_m);
  }
}

TEST(Box, IsSymmetricUnderReflections) {
  const Box box{kHalfSize_m};
  Points points;
  for (int n = 0; n < 500; ++n) {
    const Vector3d p = points.next();
    const SurfacePoint s = nearest_surface(box, p);
    for (int axis = 0; axis < 3; ++axis) {
      Vector3d mirror = Vector3d::Ones();
      mirror[axis] = -1.0;
      const SurfacePoint m = nearest_surface(box, p.cwiseProduct(mirror));
      EXPECT_EQ(m.distance_m, s.distance_m);
      EXPECT_EQ(m.normal, s.normal.cwiseProduct(mirror));
    }
  }
}

TEST(Shapes, ReturnPointAndNormalThatLeadBackToTheQuery) {
  Points points;
  for (int n = 0; n < 1000; ++n) {
    const Vector3d p = points.next();
    expect_consistent(Plane{}, p);
    expect_consistent(Sphere{0.04}, p);
    expect_consistent(Box{kHalfSize_m}, p);
  }
}

TEST(Shapes, HaveTheGradientOfTheDistanceAsNormal) {
  Points points;
  int checked = 0;
  for (int n = 0; n < 1000; ++n) {
    const Vector3d p = points.next();
    expect_gradient_is_normal(Plane{}, p);
    if (p.norm() > 0.005) {
      expect_gradient_is_normal(Sphere{0.04}, p);
    }
    if (!near_medial_surface(p)) {
      expect_gradient_is_normal(Box{kHalfSize_m}, p);
      ++checked;
    }
  }
  EXPECT_GT(checked, 900);
}

TEST(Shapes, ChangeDistanceNoFasterThanThePointMoves) {
  Points points;
  for (int n = 0; n < 1000; ++n) {
    const Vector3d a = points.next();
    const Vector3d b = a + points.next(0.002);
    for (const Shape& shape : {Shape(Plane{}), Shape(Sphere{0.04}), Shape(Box{kHalfSize_m})}) {
      const double change_m = nearest_surface(shape, b).distance_m - nearest_surface(shape, a).distance_m;
      EXPECT_LE(std::abs(change_m), (b - a).norm() + 1e-15);
    }
  }
}

TEST(PlacedShape, MovesWithItsPose) {
  // A wall turned by 90° about z faces −x.
  const PlacedShape wall{Plane{}, Quaterniond(std::sqrt(0.5), 0.0, 0.0, std::sqrt(0.5)), Vector3d(0.1, 0.0, 0.0), 0.0};
  const SurfacePoint s = nearest_surface(wall, Vector3d(0.07, 5.0, -3.0));
  EXPECT_NEAR(s.distance_m, 0.03, 1e-15);
  EXPECT_NEAR((s.normal - Vector3d(-1.0, 0.0, 0.0)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((s.point_m - Vector3d(0.1, 5.0, -3.0)).norm(), 0.0, 1e-14);
}

TEST(PlacedShape, GivesTheSameDistanceInEveryFrame) {
  Points points;
  for (int n = 0; n < 300; ++n) {
    const Vector3d axis = points.next();
    const Quaterniond q(Eigen::AngleAxisd(30.0 * axis.x(), axis.normalized()));
    const Vector3d origin = points.next();
    const Vector3d p = points.next();
    const SurfacePoint in_body = nearest_surface(Box{kHalfSize_m}, p);
    const SurfacePoint in_world = nearest_surface(PlacedShape{Box{kHalfSize_m}, q, origin, 0.0}, q * p + origin);
    EXPECT_NEAR(in_world.distance_m, in_body.distance_m, 1e-14);
    EXPECT_NEAR((in_world.normal - q * in_body.normal).norm(), 0.0, 1e-9);
    EXPECT_NEAR((in_world.point_m - (q * in_body.point_m + origin)).norm(), 0.0, 1e-14);
  }
}

}  // namespace
}  // namespace rtbus::shapes
