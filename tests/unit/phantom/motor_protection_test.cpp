// The heat budget against the RE25's own figures: 2.18 Ω (+0.39 %/K), 3.1 K/W winding to housing with 12 s, 14 K/W
// housing to air with 612 s, at most 100 °C, in air of 25 °C.
#include "drivers/phantom/motor_protection.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace drivers::phantom {
namespace {

using Eigen::Vector3d;

class Winding {
 public:
  void heat(double current_a, double dt_s) {
    const double power_w = current_a * current_a * 2.18 * (1.0 + 0.0039 * (winding_ - 25.0));
    const double to_housing_w = (winding_ - housing_) / 3.1;
    winding_ += dt_s * (power_w - to_housing_w) / (12.0 / 3.1);
    housing_ += dt_s * (to_housing_w - (housing_ - 25.0) / 14.0) / (612.0 / 14.0);
  }
  [[nodiscard]] double celsius() const { return winding_; }

 private:
  double winding_ = 25.0;
  double housing_ = 25.0;
};

TEST(MotorProtection, ThermalFiguresAgreeWithTheContinuousCurrent) {
  Winding winding;
  for (int i = 0; i < 2 * 3600 * 100; ++i) winding.heat(1.24, 0.01);
  EXPECT_NEAR(winding.celsius(), 100.0, 1.5);
}

TEST(MotorProtection, SixAmperesForTwoHoursStayBelowTheWindingsLimit) {
  MotorProtection protection(MotorLimits{});
  Winding winding;
  double hottest = 0.0;
  double first_s = 0.0;
  double last_ma = 0.0;
  for (int i = 0; i < 2 * 3600 * 1000; ++i) {
    bool limited = false;
    const Vector3d ma = protection.limit(Vector3d::Zero(), {5999.0, 0.0, 0.0}, limited);
    protection.flowed(ma, 1e-3);
    winding.heat(ma[0] * 1e-3, 1e-3);
    hottest = std::max(hottest, winding.celsius());
    if (!limited) first_s += 1e-3;
    last_ma = ma[0];
  }
  EXPECT_LT(hottest, 101.5);
  EXPECT_NEAR(last_ma, 1240.0, 5.0);
  // 0.8·1.24² = 6²·(1 − e^(−t/12 s)): the full peak is there for 0.42 s.
  EXPECT_NEAR(first_s, 0.417, 0.01);
}

TEST(MotorProtection, WithoutItTheWindingBurnsWithinSeconds) {
  Winding winding;
  double seconds = 0.0;
  while (winding.celsius() < 100.0) {
    winding.heat(5.999, 1e-3);
    seconds += 1e-3;
  }
  EXPECT_LT(seconds, 10.0);
}

TEST(MotorProtection, ContinuousCurrentFlowsForEverUncut) {
  MotorProtection protection(MotorLimits{});
  for (int i = 0; i < 600 * 1000; ++i) {
    bool limited = false;
    const Vector3d ma = protection.limit(Vector3d::Zero(), {1239.0, -500.0, 0.0}, limited);
    ASSERT_FALSE(limited) << i;
    protection.flowed(ma, 1e-3);
  }
  EXPECT_LE(protection.load(), 1.0);
}

TEST(MotorProtection, RestCoolsAndThePeakComesBack) {
  MotorProtection protection(MotorLimits{});
  protection.flowed({5999.0, 0.0, 0.0}, 1.0);
  EXPECT_LT(protection.allowed_ma(0), 1300.0);
  EXPECT_EQ(protection.allowed_ma(1), 5999.0);
  protection.flowed(Vector3d::Zero(), 30.0);
  EXPECT_EQ(protection.allowed_ma(0), 5999.0);
}

TEST(MotorProtection, ClampKeepsTheDirectionOfTheForce) {
  const MotorProtection protection(MotorLimits{});
  bool limited = false;
  const Vector3d wanted(12000.0, -3000.0, 600.0);
  const Vector3d ma = protection.limit(Vector3d::Zero(), wanted, limited);
  EXPECT_TRUE(limited);
  EXPECT_NEAR(ma[0], 5999.0, 1e-9);
  EXPECT_NEAR(ma.normalized().dot(wanted.normalized()), 1.0, 1e-12);
}

TEST(MotorProtection, WeightIsCarriedFirstAndTheForceGetsTheRest) {
  const MotorProtection protection(MotorLimits{});
  bool limited = false;
  const Vector3d base(0.0, 2000.0, 0.0);
  const Vector3d ma = protection.limit(base, {1000.0, 8000.0, 0.0}, limited);
  EXPECT_TRUE(limited);
  EXPECT_NEAR(ma[1], 5999.0, 1e-9);
  EXPECT_NEAR(ma[0] / 1000.0, (ma[1] - 2000.0) / 8000.0, 1e-12);
  const Vector3d against = protection.limit(base, {0.0, -7000.0, 0.0}, limited);  // 2000 − 7000 is well inside
  EXPECT_FALSE(limited);
  EXPECT_NEAR(against[1], -5000.0, 1e-9);
  const Vector3d too_heavy = protection.limit({0.0, 9000.0, 300.0}, {100.0, 0.0, 0.0}, limited);
  EXPECT_TRUE(limited);
  EXPECT_NEAR(too_heavy[1], 5999.0, 1e-9);
  EXPECT_EQ(too_heavy[0], 0.0);
}

TEST(MotorProtection, NonFiniteIsZero) {
  const MotorProtection protection(MotorLimits{});
  bool limited = false;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(protection.limit(Vector3d::Zero(), {nan, 1.0, 1.0}, limited), Vector3d::Zero());
  EXPECT_TRUE(limited);
}

}  // namespace
}  // namespace drivers::phantom
