/// What the corners of a contact bear of a load, against the balance of a plate on its legs.
#include "haptic_node/rendering/load_shares.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <initializer_list>
#include <numeric>

#include <Eigen/Geometry>

namespace load_shares_test {

using Eigen::Vector2d;
using Eigen::Vector3d;
using rtbus::shapes::FacePoints;

/// Frame of a plate that leans.
const Eigen::Quaterniond kLeans(Eigen::AngleAxisd(0.4, Vector3d(1, 2, -1).normalized()));
const Vector3d kThere_m(0.3, -0.1, 0.2);

Vector3d at(const Vector2d& of_plate_m, double height_m = 0.0) {
  return kThere_m + kLeans * Vector3d(of_plate_m.x(), height_m, of_plate_m.y());
}

FacePoints plate(std::initializer_list<Vector2d> legs_m) {
  FacePoints out;
  out.normal = kLeans * Vector3d::UnitY();
  for (const Vector2d& leg : legs_m) out.point_m[out.count++] = at(leg);
  return out;
}

const FacePoints kTable = plate({{0.03, 0.02}, {0.03, -0.02}, {-0.03, -0.02}, {-0.03, 0.02}});

/// Along the plate.
Vector3d centre_of(const FacePoints& legs, const std::array<double, 4>& shares) {
  Vector3d out = Vector3d::Zero();
  for (std::size_t i = 0; i < legs.count; ++i) out += shares[i] * legs.point_m[i];
  return out;
}

TEST(LoadShares, CarryTheLoadWhereItIs) {
  for (const double x : {-1.0, -0.7, 0.0, 0.4, 1.0}) {
    for (const double z : {-1.0, -0.2, 0.0, 0.9, 1.0}) {
      const Vector2d load_m(0.03 * x, 0.02 * z);
      const auto shares = haptic::load_shares(kTable, at(load_m, 0.05));
      EXPECT_NEAR(std::accumulate(shares.begin(), shares.end(), 0.0), 1.0, 1e-12);
      for (const double share : shares) EXPECT_GE(share, 0.0) << x << ' ' << z;
      EXPECT_LT((centre_of(kTable, shares) - at(load_m)).norm(), 1e-7) << x << ' ' << z;
    }
  }
}

TEST(LoadShares, AreEqualInTheMiddleAndAllAtACorner) {
  const auto middle = haptic::load_shares(kTable, at({0, 0}));
  for (const double share : middle) EXPECT_NEAR(share, 0.25, 1e-12);
  const auto corner = haptic::load_shares(kTable, at({-0.03, -0.02}));
  EXPECT_NEAR(corner[2], 1.0, 1e-6);
}

TEST(LoadShares, OfALoadBesideAllAreOnThatSide) {
  const auto shares = haptic::load_shares(kTable, at({0.05, 0.0}));
  EXPECT_NEAR(shares[0], 0.5, 1e-6);
  EXPECT_NEAR(shares[1], 0.5, 1e-6);
  const auto corner = haptic::load_shares(kTable, at({0.05, 0.05}));
  EXPECT_NEAR(corner[0], 1.0, 1e-6);
}

TEST(LoadShares, OfAnEdgeOrAPointAreItsOwn) {
  const FacePoints edge = plate({{0.03, 0.02}, {0.03, -0.02}});
  const auto shares = haptic::load_shares(edge, at({0.03, 0.01}));
  EXPECT_NEAR(shares[0], 0.75, 1e-6);
  EXPECT_NEAR(shares[1], 0.25, 1e-6);
  EXPECT_NEAR(haptic::load_shares(edge, at({0.01, 0.01}))[0], 0.75, 1e-6) << "beside the edge";
  EXPECT_EQ(haptic::load_shares(plate({{0.03, 0.02}}), at({0, 0}))[0], 1.0);
}

}  // namespace load_shares_test
