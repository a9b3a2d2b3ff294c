#include "drivers/falcon/falcon_kinematics.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "drivers/falcon/motor_commands.hpp"

namespace drivers::falcon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

const Kinematics kDefault(geometries()[0]);

Vector3d position_mm(const Kinematics& kinematics, const Counts& counts) {
  const auto x = kinematics.position_m(kinematics.angles_rad(counts));
  return x ? Vector3d(1e3 * *x) : Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
}

Vector3d degrees(const Vector3d& position_mm) {
  const auto angles = kDefault.inverse_rad(1e-3 * position_mm);
  return angles ? Vector3d(*angles * 180.0 / std::numbers::pi) : Vector3d::Constant(-999.0);
}

TEST(FalconKinematics, GivesThePublishedPositions) {
  struct Vector {
    Counts counts;
    Vector3d mm;
    double digits;
  };
  const std::vector<Vector> vectors{
      {{0, 0, 0}, {0, 0, 134.60243}, 1e-5},
      {{100, 0, 0}, {1.24958, -4.14548, 136.09762}, 1e-5},
      {{0, 100, 0}, {-4.21488, 0.99057, 136.09762}, 1e-5},
      {{0, 0, 100}, {2.96530, 3.15491, 136.09762}, 1e-5},
      {{300, -200, 100}, {14.52759, -11.57851, 136.14778}, 1e-5},
      {{-600, 450, -150}, {-30.98556, 21.41251, 122.95397}, 1e-5},
      {{500, 500, 500}, {0, 0, 156.86047}, 1e-5},
      {{-500, -500, -500}, {0, 0, 110.75450}, 1e-5},
      {{1000, 1000, 1000}, {0, 0, 173.60325}, 1e-5},
      {{-1000, -1000, -1000}, {0, 0, 89.61060}, 1e-5},
      {{1600, 1600, 1600}, {0, 0, 182.91}, 1e-2},
      {{-1600, -1600, -1600}, {0, 0, 71.73}, 1e-2},
  };
  for (const Vector& v : vectors) {
    EXPECT_LE((position_mm(kDefault, v.counts) - v.mm).cwiseAbs().maxCoeff(), v.digits)
        << v.counts[0] << " " << v.counts[1] << " " << v.counts[2] << ": "
        << position_mm(kDefault, v.counts).transpose();
  }
}

TEST(FalconKinematics, OtherGeometriesGiveTheirPublishedPositions) {
  Geometry moved = geometries()[0];
  moved.lateral_m = 0.001;
  EXPECT_LE((position_mm(Kinematics(moved), {300, -200, 100}) - Vector3d(13.99, -12.34, 136.15)).cwiseAbs().maxCoeff(),
            0.0051);
  const Kinematics other(geometries()[1]);
  EXPECT_LE((position_mm(other, {300, -200, 100}) - Vector3d(15.07, -13.44, 139.76)).cwiseAbs().maxCoeff(), 0.0051);
}

TEST(FalconKinematics, OneCountIsTheDocumentedAngle) {
  EXPECT_NEAR(geometries()[0].rad_per_count() * 180.0 / std::numbers::pi, 0.0364347, 1e-7);
  EXPECT_NEAR(geometries()[1].rad_per_count() * 180.0 / std::numbers::pi, 0.0369094, 1e-7);
}

TEST(FalconKinematics, InverseGivesThePublishedAngles) {
  const std::vector<std::pair<Vector3d, Vector3d>> vectors{
      {{0, 0, 110}, {16.18796, 16.18796, 16.18796}},    {{0, 0, 125}, {27.70929, 27.70929, 27.70929}},
      {{20, 10, 130}, {31.57734, 23.14768, 45.13367}},  {{-30, 30, 100}, {-13.24819, 41.34320, 19.19857}},
      {{10, -20, 120}, {39.17160, 16.74209, 21.33937}},
  };
  for (const auto& [mm, expected] : vectors) {
    EXPECT_LE((degrees(mm) - expected).cwiseAbs().maxCoeff(), 1e-5) << mm.transpose();
  }
}

TEST(FalconKinematics, JacobianIsThePublishedOne) {
  const Vector3d x(0.010, -0.020, 0.120);
  const auto j = kDefault.jacobian(x, kDefault.inverse_rad(x).value());
  ASSERT_TRUE(j);
  Matrix3d expected;
  expected << .01929227, -.05242118, .03953978, -.06637222, .01151626, .04137206, .01065246, .03279433, .02938922;
  EXPECT_LE((*j - expected).cwiseAbs().maxCoeff(), 1e-8);
  const Vector3d torque = j->transpose() * Vector3d(1, 2, -3);
  EXPECT_LE((torque - Vector3d(-0.14540956, -0.12777163, 0.03411622)).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(FalconKinematics, TorquesAtTheCentreAreThePublishedOnes) {
  const Vector3d angles = kDefault.angles_rad({0, 0, 0});
  const auto j = kDefault.jacobian(kDefault.position_m(angles).value(), angles);
  ASSERT_TRUE(j);
  const auto torque = [&](const Vector3d& force) { return Vector3d(j->transpose() * force); };
  EXPECT_LE((torque({0, 0, -5}) - Vector3d::Constant(-0.124692)).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LE((torque({2, 0, 0}) - Vector3d(0.038609, -0.130151, 0.091542)).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LE((torque({0, 3, 0}) - Vector3d(-0.191991, 0.045842, 0.146150)).cwiseAbs().maxCoeff(), 1e-6);
}

class EveryGeometry : public testing::TestWithParam<std::size_t> {
 protected:
  Kinematics kinematics_{geometries()[GetParam()]};
};

TEST_P(EveryGeometry, ForwardAndInverseAgreeOverTheWorkspace) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> side(-0.04, 0.04);
  double worst_m = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const Vector3d x(side(random), side(random), 0.120 + 0.875 * side(random));
    const auto angles = kinematics_.inverse_rad(x);
    ASSERT_TRUE(angles) << x.transpose();
    const auto back = kinematics_.position_m(*angles);
    ASSERT_TRUE(back) << x.transpose();
    worst_m = std::max(worst_m, (*back - x).norm());
  }
  EXPECT_LE(worst_m, 1e-9);
}

TEST_P(EveryGeometry, JacobianMatchesFiniteDifferences) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> side(-0.038, 0.038);
  double worst = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const Vector3d x(side(random), side(random), 0.120 + 0.875 * side(random));
    const Vector3d angles = kinematics_.inverse_rad(x).value();
    const auto j = kinematics_.jacobian(x, angles);
    ASSERT_TRUE(j);
    constexpr double kStepRad = 1e-5;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d step = kStepRad * Vector3d::Unit(axis);
      const auto ahead = kinematics_.position_m(angles + step);
      const auto behind = kinematics_.position_m(angles - step);
      ASSERT_TRUE(ahead && behind);
      worst = std::max(worst, ((*ahead - *behind) / (2 * kStepRad) - j->col(axis)).cwiseAbs().maxCoeff());
    }
  }
  EXPECT_LE(worst, 1e-6);
}

TEST_P(EveryGeometry, IsFiniteForEveryEncoderValue) {
  std::vector<std::int32_t> extremes{-32768, -32767, -5000, -2700, -1750, -1600, -1,
                                     0,      1,      1600,  1750,  2700,  5000,  32767};
  std::mt19937 random(3);
  std::uniform_int_distribution<std::int32_t> any(-32768, 32767);
  std::uniform_int_distribution<std::int32_t> near(-3000, 3000);
  std::vector<Counts> all;
  for (const auto a : extremes) {
    for (const auto b : extremes) {
      for (const auto c : extremes) all.push_back({a, b, c});
    }
  }
  for (int i = 0; i < 200'000; ++i) {
    all.push_back({any(random), any(random), any(random)});
    all.push_back({near(random), near(random), near(random)});
  }
  std::size_t reached = 0;
  for (const Counts& counts : all) {
    const Vector3d angles = kinematics_.angles_rad(counts);
    const auto x = kinematics_.position_m(angles);
    if (!x) continue;
    ++reached;
    ASSERT_TRUE(x->allFinite());
    ASSERT_LE(x->norm(), 0.3);
    if (const auto j = kinematics_.jacobian(*x, angles)) {
      ASSERT_TRUE(j->allFinite());
      const MotorCommands commands = commands_for_force(kinematics_, *x, angles, {3, -4, 5}, kGainMartinHillier);
      for (const auto count : commands.count) ASSERT_LE(std::abs(count), 4095);
    }
  }
  EXPECT_GT(reached, 10'000U);
}

TEST_P(EveryGeometry, ReachesEverythingWithinTheUsefulEncoderRange) {
  std::mt19937 random(4);
  std::uniform_int_distribution<std::int32_t> level(-1200, 1200);
  std::uniform_int_distribution<std::int32_t> apart(-200, 200);
  for (int i = 0; i < 20000; ++i) {
    const std::int32_t n = level(random);
    const Counts counts{n + apart(random), n + apart(random), n + apart(random)};
    ASSERT_TRUE(kinematics_.position_m(kinematics_.angles_rad(counts)))
        << counts[0] << " " << counts[1] << " " << counts[2];
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, EveryGeometry, testing::Range<std::size_t>(0, geometries().size()),
                         [](const auto& row) { return std::string(geometries()[row.param].name); });

std::array<std::int16_t, 3> commands(const Counts& counts, const Vector3d& force_n, double gain) {
  const Vector3d angles = kDefault.angles_rad(counts);
  return commands_for_force(kDefault, kDefault.position_m(angles).value(), angles, force_n, gain).count;
}

TEST(FalconMotorCommands, AreThePublishedOnes) {
  struct Vector {
    Counts counts;
    Vector3d force_n;
    std::array<int, 3> libnifalcon;
    std::array<int, 3> martin_hillier;
  };
  const std::vector<Vector> vectors{
      {{0, 0, 0}, {0, 0, -5}, {1247, 1247, 1247}, {825, 825, 825}},
      {{0, 0, 0}, {2, 0, 0}, {-386, 1302, -915}, {-255, 861, -606}},
      {{0, 0, 0}, {0, 3, 0}, {1920, -458, -1461}, {1270, -303, -967}},
      {{300, -200, 100}, {1, 2, -3}, {1665, 1340, -773}, {1102, 887, -511}},
  };
  for (const Vector& v : vectors) {
    const auto lnf = commands(v.counts, v.force_n, kGainLibnifalcon);
    const auto mh = commands(v.counts, v.force_n, kGainMartinHillier);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(lnf[i], v.libnifalcon[i], 1);  // the source truncates
      EXPECT_NEAR(mh[i], v.martin_hillier[i], 1);
    }
  }
}

TEST(FalconMotorCommands, SaturationKeepsTheDirection) {
  const Vector3d angles = kDefault.angles_rad({200, -100, 50});
  const Vector3d x = kDefault.position_m(angles).value();
  const Vector3d force_n(30, 40, -20);
  const MotorCommands limited = commands_for_force(kDefault, x, angles, force_n, kGainMartinHillier);
  EXPECT_TRUE(limited.limited);
  int largest = 0;
  for (const auto count : limited.count) largest = std::max(largest, std::abs(count));
  EXPECT_EQ(largest, 4095);
  const Vector3d made = force_of_commands(kDefault, x, angles, limited.count, kGainMartinHillier);
  EXPECT_LT(made.norm(), force_n.norm());
  EXPECT_GT(made.normalized().dot(force_n.normalized()), 1.0 - 1e-6);
}

TEST(FalconMotorCommands, RefuseWhatIsNotFinite) {
  const Vector3d angles = kDefault.angles_rad({0, 0, 0});
  const Vector3d x = kDefault.position_m(angles).value();
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e308}) {
    const MotorCommands out = commands_for_force(kDefault, x, angles, {0, bad, 1}, kGainMartinHillier);
    EXPECT_TRUE(out.limited);
    if (!std::isfinite(bad)) {
      EXPECT_EQ(out.count, (std::array<std::int16_t, 3>{0, 0, 0}));
    }
  }
}

TEST(FalconMotorCommands, AndBackGiveTheForce) {
  const Vector3d angles = kDefault.angles_rad({300, -200, 100});
  const Vector3d x = kDefault.position_m(angles).value();
  const Vector3d force_n(1.5, -2.0, 3.0);
  const MotorCommands out = commands_for_force(kDefault, x, angles, force_n, kGainMartinHillier);
  EXPECT_FALSE(out.limited);
  const Vector3d made = force_of_commands(kDefault, x, angles, out.count, kGainMartinHillier);
  EXPECT_LE((made - force_n).norm(), 0.01);  // half a count is about 2 mN
}

}  // namespace
}  // namespace drivers::falcon
