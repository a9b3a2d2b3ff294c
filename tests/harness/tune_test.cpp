// What `rtbus tune` advises, and on which formulas.
#include <gtest/gtest.h>

#include <cmath>

#include "tools/evaluation/tune/tune_search.hpp"

namespace {

TEST(Tune, TheoryIsThatOfItsSources) {
  tools::DeviceFigures device;
  device.viscous_n_s_per_m = 0.3;
  device.coulomb_n = 0.06;
  device.quantum_m = 23e-6;
  // K < 2(b − |B|)/T; K ≤ min(2b/T, 2f_c/Δ); K < (b + B)/(T/2 + t_d).
  const tools::TheoryLimits limits = tools::theory_limits(device, 0.05, 1000.0, 0.5e-3);
  EXPECT_DOUBLE_EQ(limits.passivity_n_per_m, 500.0);
  EXPECT_DOUBLE_EQ(limits.friction_n_per_m, 600.0);
  EXPECT_DOUBLE_EQ(limits.linear_n_per_m, 350.0);
  EXPECT_DOUBLE_EQ(tools::theory_limits(device, 0.4, 1000.0, 0.0).passivity_n_per_m, 0.0);
  EXPECT_NEAR(tools::theory_limits(device, 0.0, 10000.0, 0.0).friction_n_per_m, 2 * 0.06 / 23e-6, 1e-6);
}

TEST(Tune, AdvisesLessForSlowerPhysicsAndPredictsTheDrag) {
  tools::TuneQuestion question;
  question.wall_file = std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml";
  question.device_file = std::string(RTBUS_SOURCE_DIR) + "/config/devices/sim_phantom_desktop.yaml";
  question.method = "remote_virtual_coupling";
  double before_n_per_m = 1e9;
  for (const double physics_hz : {500.0, 18.0}) {
    question.physics_hz = physics_hz;
    const tools::TuneAnswer answer = tools::search_gains(question, [](double) { return true; });
    EXPECT_EQ(answer.device.model, "phantom_desktop");
    EXPECT_GT(answer.stiffness_n_per_m, 0.0) << physics_hz;
    EXPECT_LE(answer.stiffness_n_per_m, before_n_per_m);
    EXPECT_LE(answer.stiffness_n_per_m, tools::kTuneMargin * answer.device.max_stiffness_n_per_m * 1.0001);
    EXPECT_NEAR(answer.air.drag_n_s_per_m / answer.air.predicted_drag_n_s_per_m, 1.0, 0.25) << physics_hz;
    before_n_per_m = answer.stiffness_n_per_m;
  }
}

TEST(Tune, EndsWhenSomebodyInterrupts) {
  tools::TuneQuestion question;
  question.wall_file = std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml";
  question.device_file = std::string(RTBUS_SOURCE_DIR) + "/config/devices/sim_falcon.yaml";
  question.method = "direct";
  const tools::TuneAnswer answer = tools::search_gains(question, [](double) { return false; });
  EXPECT_TRUE(answer.rows.empty());
  EXPECT_EQ(answer.stiffness_n_per_m, 0.0);
}

}  // namespace
