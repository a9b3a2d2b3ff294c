// The arms against the published configuration's vectors, and forward against inverse, analytic against numeric.
#include "drivers/phantom/phantom_kinematics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace drivers::phantom {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

const Model& model(ModelId id) { return *find_model(static_cast<int>(id)); }

struct Vector {
  ModelId id;
  Counts counts;
  Vector3d angles_rad;
  Vector3d maker_mm;     // x to the user, y right, z up
  Matrix3d currents_ma;  // rows: motors; columns: 1 N along x, y, z
  double currents_tolerance;
};

Matrix3d columns(const Vector3d& x, const Vector3d& y, const Vector3d& z) {
  Matrix3d out;
  out << x, y, z;
  return out;
}

const Vector kVectors[] = {
    {ModelId::kWoody,
     {0, 0, 0},
     {0, 0, 1.570796},
     {25, 0, 205},
     columns({0, -659.588, 0}, {591.216, 0, 0}, {0, 0, -788.288}),
     1e-3},
    {ModelId::kWoody,
     {1000, 0, 0},
     {.196350, 0, 1.570796},
     {20.2924, 47.7971, 205},
     columns({-115, -646, 0}, {579, -128, 0}, {0, 0, -788}),
     1.0},
    {ModelId::kWoody,
     {0, 1000, 0},
     {0, -.261799, 1.570796},
     {-28.0579, 0, 198.0148},
     columns({0, -637, 0}, {463, 0, 0}, {0, -170, -788}),
     1.0},
    {ModelId::kWoody,
     {0, 0, 1000},
     {0, 0, 1.308997},
     {16.6518, 0, 141.5893},
     columns({0, -659, -204}, {571, 0, 0}, {0, 0, -761}),
     1.0},
    {ModelId::kWoody,
     {-2500, -1500, 700},
     {-.490874, .392699, 1.387537},
     {61.6394, -150.5394, 144.7476},
     columns({363, -537, -126}, {679, 287, 67}, {0, 252, -775}),
     1.0},
    {ModelId::kVintage,
     {0, 0, 0},
     {0, 1.570796, 0},
     {0, 0, -15},
     columns({0, 0, -621.601}, {-655.271, 0, 0}, {0, -765.901, 0}),
     1e-3},
    {ModelId::kVintage,
     {1000, 0, 0},
     {-.174533, 1.570796, 0},
     {-2.0965, -23.9634, -15},
     columns({-113.787, 0, -612.157}, {-645.316, 0, 107.940}, {0, -765.901, 0}),
     1e-3},
    {ModelId::kVintage,
     {0, -1000, 0},
     {0, 1.366797, 0},
     {-2.8615, 0, 12.9571},
     columns({0, 155.162, -621.601}, {-641.683, 0, 0}, {0, -750.019, 0}),
     1e-3},
    {ModelId::kVintage,
     {0, 0, -1000},
     {0, 1.570796, .204000},
     {22.6898, 0, -12.6776},
     columns({0, 0, -608.711}, {-763.010, 0, 0}, {0, -765.901, -125.929}),
     1e-3},
    {ModelId::kVintage,
     {500, -800, -600},
     {-.087266, 1.407597, .122400},
     {11.2707, -13.0595, 8.2596},
     columns({-62.011, 123.967, -614.602}, {-708.788, -10.846, 53.771}, {0, -755.724, -75.894}),
     1e-3},
};

Vector3d maker_of(const Vector3d& d) { return {d.z(), d.x(), d.y()}; }

TEST(Kinematics, SerialVectors) {
  for (const Vector& v : kVectors) {
    const Kinematics arm(model(v.id));
    const JointAngles q = arm.angles(v.counts);
    EXPECT_LT((q - v.angles_rad).cwiseAbs().maxCoeff(), 1e-6);
    ArmPose pose;
    ASSERT_TRUE(arm.forward(q, pose));
    EXPECT_LT((maker_of(pose.position_m) * 1e3 - v.maker_mm).cwiseAbs().maxCoeff(), 1e-4);
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d f_maker = Vector3d::Unit(axis);
      const Vector3d force(f_maker.y(), f_maker.z(), f_maker.x());
      const Vector3d ma = arm.currents_ma(pose.jacobian_m.transpose() * force);
      EXPECT_LT((ma - v.currents_ma.col(axis)).cwiseAbs().maxCoeff(), v.currents_tolerance)
          << v.counts[0] << "," << v.counts[1] << "," << v.counts[2] << " axis " << axis;
    }
  }
}

TEST(Kinematics, FiveBarVectors) {
  const Kinematics arm(model(ModelId::kPolhem));
  ArmPose pose;
  JointAngles q = arm.angles({0, 0, 0});
  EXPECT_LT((q - Vector3d(2.102250, 2.178168, 4.162030)).cwiseAbs().maxCoeff(), 1e-6);
  ASSERT_TRUE(arm.forward(q, pose));
  EXPECT_NEAR(pose.elevation_rad, -.528351, 1e-6);
  EXPECT_LT((maker_of(pose.position_m) * 1e3 - Vector3d(-222.6413, 30.8593, 37.0523)).cwiseAbs().maxCoeff(), 1e-4);
  q = arm.angles({-8312, 0, 0});
  ASSERT_TRUE(arm.forward(q, pose));
  EXPECT_NEAR(q[0], 0.0, 1e-12);
  EXPECT_LT((maker_of(pose.position_m) * 1e3 - Vector3d(-168.7034, 0, 37.0523)).cwiseAbs().maxCoeff(), 1e-4);
  q = arm.angles({-8312, 2000, 0});
  ASSERT_TRUE(arm.forward(q, pose));
  EXPECT_NEAR(q[1], 1.757916, 1e-6);
  EXPECT_NEAR(pose.elevation_rad, -.171389, 1e-6);
  EXPECT_LT((maker_of(pose.position_m) * 1e3 - Vector3d(-89.3113, 0, 107.3116)).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(Kinematics, ImpossiblePoseIsAnErrorAndChangesNothing) {
  const Kinematics arm(model(ModelId::kPolhem));
  ArmPose pose;
  pose.position_m = {1, 2, 3};
  EXPECT_FALSE(arm.forward(arm.angles({-8312, 0, -4000}), pose));
  EXPECT_EQ(pose.position_m, Vector3d(1, 2, 3));
}

TEST(Kinematics, TransmissionVectors) {
  // Rad per count: Woody 1.96e-4, 2.62e-4; Vintage 1.75e-4, 2.04e-4; Polhem 2.53e-4, 2.10e-4.
  const auto quantum = [](ModelId id) {
    const Kinematics arm(model(id));
    return (arm.angles({1, 1, 1}) - arm.angles({0, 0, 0})).cwiseAbs().eval();
  };
  EXPECT_LT((quantum(ModelId::kWoody) - Vector3d(1.96e-4, 2.62e-4, 2.62e-4)).cwiseAbs().maxCoeff(), 6e-7);
  EXPECT_LT((quantum(ModelId::kVintage) - Vector3d(1.75e-4, 2.04e-4, 2.04e-4)).cwiseAbs().maxCoeff(), 6e-7);
  EXPECT_LT((quantum(ModelId::kPolhem) - Vector3d(2.53e-4, 2.10e-4, 2.10e-4)).cwiseAbs().maxCoeff(), 6e-7);
}

class EveryArm : public testing::TestWithParam<ModelId> {
 protected:
  Kinematics arm_{model(GetParam())};
};

TEST_P(EveryArm, InverseThenForwardIsThePointOverTheWorkspace) {
  const DeviceInfo& limits = arm_.model().limits;
  int reached = 0;
  int asked = 0;
  constexpr int kSteps = 20;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      for (int k = 0; k <= kSteps; ++k) {
        Vector3d p;
        const int at[] = {i, j, k};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const double low = limits.workspace_min_m[axis];
          p[static_cast<int>(axis)] = low + (limits.workspace_max_m[axis] - low) * at[axis] / kSteps;
        }
        ++asked;
        JointAngles q;
        ASSERT_TRUE(arm_.inverse(p, q)) << p.transpose();
        ArmPose pose;
        ASSERT_TRUE(arm_.forward(q, pose)) << p.transpose();
        ASSERT_LE((pose.position_m - p).norm(), 1e-9) << p.transpose();
        ++reached;
      }
    }
  }
  EXPECT_EQ(reached, asked);
}

TEST_P(EveryArm, CountsAndAnglesAreInverse) {
  const Vector3d counts = arm_.counts(arm_.angles({1234, -567, 8901}));
  EXPECT_LT((counts - Vector3d(1234, -567, 8901)).norm(), 1e-8);
}

TEST_P(EveryArm, JacobianIsTheDerivative) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> in(-0.08, 0.08);
  int checked = 0;
  for (int i = 0; i < 5000; ++i) {
    JointAngles q;
    ArmPose pose;
    if (!arm_.inverse({in(random), in(random), in(random)}, q) || !arm_.forward(q, pose)) continue;
    constexpr double kStep = 1e-6;
    Matrix3d numeric;
    bool inside = true;
    for (int joint = 0; joint < 3; ++joint) {
      ArmPose plus, minus;
      inside = inside && arm_.forward(q + kStep * Vector3d::Unit(joint), plus) &&
               arm_.forward(q - kStep * Vector3d::Unit(joint), minus);
      numeric.col(joint) = (plus.position_m - minus.position_m) / (2.0 * kStep);
    }
    if (!inside) continue;
    ++checked;
    ASSERT_LE((numeric - pose.jacobian_m).cwiseAbs().maxCoeff(), 1e-6);
  }
  EXPECT_GT(checked, 4000);
}

TEST_P(EveryArm, CurrentsAndTorquesAreInverse) {
  const Vector3d torques(0.01, -0.02, 0.03);
  EXPECT_LT((arm_.torques_n_m(arm_.currents_ma(torques)) - torques).norm(), 1e-15);
}

TEST_P(EveryArm, NoCounterGivesNaN) {
  std::mt19937 random(4);
  constexpr std::int32_t kLow = std::numeric_limits<std::int32_t>::min();
  constexpr std::int32_t kHigh = std::numeric_limits<std::int32_t>::max();
  std::uniform_int_distribution<std::int32_t> any(kLow, kHigh);
  std::uniform_int_distribution<std::int32_t> near(-20000, 20000);
  const std::int32_t special[] = {kLow, kLow + 1, -1, 0, 1, kHigh - 1, kHigh};
  int possible = 0;
  for (int i = 0; i < 200000; ++i) {
    Counts counts{}, gimbal{};
    for (std::size_t k = 0; k < 3; ++k) {
      counts[k] = i % 3 == 0 ? any(random) : i % 3 == 1 ? near(random) : special[random() % std::size(special)];
      gimbal[k] = i % 2 == 0 ? any(random) : special[random() % std::size(special)];
    }
    const JointAngles q = arm_.angles(counts);
    ASSERT_TRUE(q.allFinite());
    ArmPose pose;
    if (arm_.forward(q, pose)) {
      ++possible;
      ASSERT_TRUE(pose.position_m.allFinite() && pose.jacobian_m.allFinite());
    }
    const Quat o = arm_.orientation(q[0], pose.elevation_rad, arm_.gimbal_angles(gimbal));
    double norm = 0.0;
    for (const double c : o) norm += c * c;
    ASSERT_NEAR(norm, 1.0, 1e-12);
    ASSERT_TRUE(arm_.gravity_torques_n_m(q).allFinite());
  }
  EXPECT_GT(possible, 1000);
}

TEST_P(EveryArm, NoPointGivesNaN) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> in(-0.8, 0.8);
  for (int i = 0; i < 100000; ++i) {
    JointAngles q;
    if (arm_.inverse({in(random), in(random), in(random)}, q)) {
      ASSERT_TRUE(q.allFinite());
    }
  }
  JointAngles q;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(arm_.inverse({nan, 0, 0}, q));
  EXPECT_FALSE(arm_.inverse({1e300, 1e300, 1e300}, q));
}

INSTANTIATE_TEST_SUITE_P(Models, EveryArm, testing::Values(ModelId::kPolhem, ModelId::kVintage, ModelId::kWoody),
                         [](const testing::TestParamInfo<ModelId>& id) { return std::string(model(id.param).key); });

TEST(Gravity, HoldsWhatTheEnergySays) {
  // τ = ∂V/∂q of V = m_b g l_b cos b + m_c g (L_b cos b − l_c cos c).
  const Kinematics arm(model(ModelId::kWoody));
  const auto energy_j = [](double b, double c) {
    return 9.81 * (0.170 * 0.051 * std::cos(b) + 0.110 * (0.205 * std::cos(b) - 0.091 * std::cos(c)));
  };
  for (double b = -1.0; b < 1.5; b += 0.3) {
    for (double c = 0.2; c < 2.0; c += 0.3) {
      const Vector3d torques = arm.gravity_torques_n_m({0.4, b, c});
      constexpr double kStep = 1e-6;
      EXPECT_NEAR(torques[1], (energy_j(b + kStep, c) - energy_j(b - kStep, c)) / (2 * kStep), 1e-8);
      EXPECT_NEAR(torques[2], (energy_j(b, c + kStep) - energy_j(b, c - kStep)) / (2 * kStep), 1e-8);
      EXPECT_EQ(torques[0], 0.0);
    }
  }
}

TEST(Orientation, PolhemVectors) {
  const Kinematics arm(model(ModelId::kPolhem));
  const auto check = [&](double a, double l, std::array<double, 3> g, Quat maker) {
    const Quat q = arm.orientation(a, l, g);
    // Maker's (w, x, y, z) are our (w, z, x, y).
    EXPECT_NEAR(q[0], maker[0], 1e-6);
    EXPECT_NEAR(q[3], maker[1], 1e-6);
    EXPECT_NEAR(q[1], maker[2], 1e-6);
    EXPECT_NEAR(q[2], maker[3], 1e-6);
  };
  check(.19635, -.5, {.1, .2, .3}, {.921588, .155074, .354414, .031922});
  check(-.5, .3, {-1, .7, 2}, {.726271, .456439, -.218941, -.465036});
}

TEST(Orientation, ZeroEverywhereIsTheIdentityAndYawTurnsAboutTheVertical) {
  const Kinematics arm(model(ModelId::kVintage));
  const Quat none = arm.orientation(0, 0, {0, 0, 0});
  EXPECT_NEAR(none[0], 1.0, 1e-15);
  const Quat yaw = arm.orientation(0.3, 0, {0, 0, 0});
  EXPECT_NEAR(yaw[2], std::sin(0.15), 1e-15);  // y of D is up
  // The first axis of a gimbal with encoders is vertical to the arm, of a magnetic one along it.
  EXPECT_NEAR(arm.orientation(0, 0, {0.3, 0, 0})[2], std::sin(0.15), 1e-15);
  const Kinematics polhem(model(ModelId::kPolhem));
  EXPECT_NEAR(polhem.orientation(0, 0, {0.3, 0, 0})[3], std::sin(0.15), 1e-15);
}

TEST(Orientation, SignNeverJumps) {
  const Kinematics arm(model(ModelId::kVintage));
  Quat before = arm.orientation(0, 0, {0, 0, 0});
  double largest = 0.0;
  int turned = 0;
  for (int n = 0; n < 4 * 2000; ++n) {
    const Quat raw = arm.orientation(0.1, -0.4, arm.gimbal_angles({n, n / 3, 2 * n}));
    const Quat q = continuous(raw, before);
    double step = 0.0;
    for (std::size_t i = 0; i < 4; ++i) step += (q[i] - before[i]) * (q[i] - before[i]);
    if (n > 0) largest = std::max(largest, std::sqrt(step));
    turned += q[0] * raw[0] + q[1] * raw[1] + q[2] * raw[2] + q[3] * raw[3] < 0.0;
    before = q;
  }
  EXPECT_LT(largest, 0.02);
  EXPECT_GT(turned, 0);  // without continuous() it would have jumped
}

}  // namespace
}  // namespace drivers::phantom
