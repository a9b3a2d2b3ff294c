// Products round on each processor as on every other: a scene without moving bodies gives the same bits everywhere.
#include <gtest/gtest.h>

#include <Eigen/Core>

namespace {

/// a² rounded is not a². What multiplies and adds in one go sees the difference.
constexpr double kA = 1.0 + 0x1p-30;
constexpr double kSquare = kA * kA;

TEST(Rounding, EigenFusesNoProductWithASum) {
  Eigen::Matrix2d two;
  two << -kSquare, kA, -kSquare, kA;
  EXPECT_EQ((two * Eigen::Vector2d(1.0, kA)).eval(), Eigen::Vector2d::Zero());
  Eigen::Matrix4d four = Eigen::Matrix4d::Zero();
  four.col(1).setConstant(-kSquare);
  four.col(3).setConstant(kA);
  EXPECT_EQ((four * Eigen::Vector4d(0.0, 1.0, 0.0, kA)).eval(), Eigen::Vector4d::Zero());
  const Eigen::VectorXd row = Eigen::Vector4d(-kSquare, -kSquare, kA, kA), column = Eigen::Vector4d(1.0, 1.0, kA, kA);
  EXPECT_EQ(row.dot(column), 0.0);
  const Eigen::MatrixXd wide = row.transpose().replicate(8, 1);
  EXPECT_EQ((wide * column).eval(), Eigen::VectorXd::Zero(8));
}

}  // namespace
