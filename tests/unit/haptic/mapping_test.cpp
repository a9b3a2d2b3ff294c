#include "haptic_node/rendering/mapping.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace {

using haptic::Mapping;
using haptic::MappingConfig;

MappingConfig turned(double scale) {
  MappingConfig config;
  config.q_WD = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -0.5).normalized());
  config.offset_m = {0.3, -0.2, 1.1};
  config.position_scale = scale;
  config.force_scale = 1.0 / scale;
  return config;
}

class MappingScales : public testing::TestWithParam<double> {};

TEST_P(MappingScales, ThereAndBackIsTheIdentity) {
  const Mapping mapping(turned(GetParam()));
  const Eigen::Vector3d p(0.05, -0.02, 0.01);
  EXPECT_LT((mapping.position_to_device(mapping.position_to_world(p)) - p).norm(), 1e-13);
  EXPECT_LT((mapping.velocity_to_device(mapping.velocity_to_world(p)) - p).norm(), 1e-13);
}

TEST_P(MappingScales, ConservesPower) {
  const Mapping mapping(turned(GetParam()));
  const Eigen::Vector3d v_D(0.1, 0.4, -0.2);
  const Eigen::Vector3d f_W(1.0, -2.0, 0.5);
  const double power_W = f_W.dot(mapping.velocity_to_world(v_D));
  const double power_D = mapping.force_to_device(f_W).dot(v_D);
  EXPECT_NEAR(power_W, power_D, 1e-12 * std::abs(power_W));
}

TEST_P(MappingScales, RebasePutsTheDeviceWhereAskedAndCountsAnEpoch) {
  Mapping mapping(turned(GetParam()));
  const Eigen::Vector3d p_D(0.02, 0.03, -0.04);
  const Eigen::Vector3d p_W(-1.0, 0.5, 0.25);
  const auto before = mapping.epoch();
  mapping.rebase(p_D, p_W);
  EXPECT_LT((mapping.position_to_world(p_D) - p_W).norm(), 1e-13);
  EXPECT_EQ(mapping.epoch(), before + 1);
  // Only the offset moves: directions and scale stay.
  const Eigen::Vector3d step(0.001, 0.0, 0.0);
  EXPECT_NEAR((mapping.position_to_world(p_D + step) - p_W).norm(), GetParam() * 0.001, 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Scales, MappingScales, testing::Values(0.1, 1.0, 10.0));

TEST(Mapping, RotatesAxesAsTheQuaternionSays) {
  MappingConfig config;
  config.q_WD = Eigen::AngleAxisd(std::numbers::pi / 2.0, Eigen::Vector3d::UnitY());
  const Mapping mapping(config);
  // A quarter turn about y takes the device's z (towards the user) to the world's x.
  EXPECT_LT((mapping.position_to_world({0.0, 0.0, 1.0}) - Eigen::Vector3d::UnitX()).norm(), 1e-12);
}

}  // namespace
