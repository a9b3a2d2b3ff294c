#include "drivers/phantom/motor_protection.hpp"

#include <algorithm>
#include <cmath>

namespace drivers::phantom {
namespace {
constexpr double kFreeUpTo = 0.8;  // of continuous²
}

double MotorProtection::allowed_ma(int i) const noexcept RTBUS_NONBLOCKING {
  const double continuous2 = limits_.continuous_ma * limits_.continuous_ma;
  if (limits_.continuous_ma >= limits_.peak_ma) return limits_.peak_ma;
  const double used = heat_ma2_[i] / continuous2;
  const double fade = std::clamp((used - kFreeUpTo) / (1.0 - kFreeUpTo), 0.0, 1.0);
  return limits_.peak_ma + fade * (limits_.continuous_ma - limits_.peak_ma);
}

double MotorProtection::load() const noexcept RTBUS_NONBLOCKING {
  return heat_ma2_.maxCoeff() / (limits_.continuous_ma * limits_.continuous_ma);
}

Eigen::Vector3d MotorProtection::limit(const Eigen::Vector3d& base_ma, const Eigen::Vector3d& force_ma,
                                       bool& limited) const noexcept RTBUS_NONBLOCKING {
  limited = true;
  if (!base_ma.allFinite() || !force_ma.allFinite()) return Eigen::Vector3d::Zero();
  double base_share = 1.0;
  for (int i = 0; i < 3; ++i) {
    const double size_ma = std::abs(base_ma[i]);
    if (size_ma > allowed_ma(i)) base_share = std::min(base_share, allowed_ma(i) / size_ma);
  }
  if (base_share < 1.0) return base_share * base_ma;
  double share = 1.0;
  for (int i = 0; i < 3; ++i) {
    if (force_ma[i] == 0.0) continue;
    // Room on the side the force pushes to.
    const double room_ma = allowed_ma(i) - std::copysign(1.0, force_ma[i]) * base_ma[i];
    share = std::min(share, room_ma / std::abs(force_ma[i]));
  }
  limited = share < 1.0;
  return base_ma + share * force_ma;
}

void MotorProtection::flowed(const Eigen::Vector3d& currents_ma, double dt_s) noexcept RTBUS_NONBLOCKING {
  if (!(dt_s > 0.0) || !currents_ma.allFinite()) return;
  const double gone = -std::expm1(-dt_s / limits_.time_constant_s);
  heat_ma2_ += gone * (currents_ma.cwiseAbs2() - heat_ma2_);
}

}  // namespace drivers::phantom
