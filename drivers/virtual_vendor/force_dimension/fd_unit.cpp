#include "drivers/virtual_vendor/force_dimension/fd_unit.hpp"

#include <algorithm>

namespace drivers::virtual_vendor::force_dimension {
namespace {

using Eigen::Vector3d;

// Maker's frame: x to the user, y right, z up. D: x right, y up, z to the user.
Vector3d from_d(const Vector3d& d) { return {d.z(), d.x(), d.y()}; }
Vector3d to_d(const Vector3d& fd) { return {fd.y(), fd.z(), fd.x()}; }

/// Weight that the host carries ends soon when forces stop: own choice.
constexpr std::uint64_t kGravityActsNs = 100'000'000;
/// A user presses the force button again so long after the program has said that forces are off.
constexpr std::uint64_t kPressedAgainNs = 500'000'000;
/// Not calibrated: the position is off by this.
const Vector3d kWrongBy_m{0.02, -0.03, 0.05};

}  // namespace

void FdUnit::force_off(ForceOff cause) noexcept {
  if (!force_on_) return;
  force_on_ = false;
  cause_ = cause;
  (void)unit_.mechanics().set_force(Vector3d::Zero(), simulated::Mechanics::kNever);
}

void FdUnit::advance_to(std::uint64_t now_ns) {
  unit_.advance_to(now_ns);
  if (force_on_ && watchdog_ns_ != 0 && now_ns > last_force_ns_ + watchdog_ns_) force_off(ForceOff::kWatchdog);
  if (unit_.mechanics().velocity_m_s().norm() > settings_.brake_speed_m_s) force_off(ForceOff::kVelocity);
  const double t_s = unit_.age_s(now_ns);
  if (settings_.lose_calibration_at_s >= 0.0 && t_s > settings_.lose_calibration_at_s && calibrated_) {
    calibrated_ = false;
    settings_.lose_calibration_at_s = -1.0;
    force_off(ForceOff::kSoftware);
  }
  if (settings_.force_button_at_s < 0.0) return;
  if (button_presses_ == 0 && t_s > settings_.force_button_at_s && force_on_) {  // a press on forces that act
    button_presses_ = 1;
    force_off(ForceOff::kButton);
  } else if (button_presses_ == 1 && press_told_ns_ != 0 && now_ns > press_told_ns_ + kPressedAgainNs) {
    button_presses_ = 2;
    force_on_ = true;
    cause_ = ForceOff::kNone;
    last_force_ns_ = now_ns;
  }
}

Vector3d FdUnit::position(std::uint64_t now_ns) {
  advance_to(now_ns);
  return from_d(unit_.mechanics().measure(now_ns)) + (calibrated_ ? Vector3d::Zero() : kWrongBy_m);
}

Vector3d FdUnit::velocity() noexcept { return from_d(unit_.mechanics().velocity_m_s()); }

int FdUnit::set_force(const Vector3d& force_n, std::uint64_t now_ns) {
  advance_to(now_ns);
  if (!calibrated_) return -1;
  last_force_ns_ = now_ns;
  const double norm_n = force_n.norm();
  const bool too_much = norm_n > max_force_n;
  if (regulating || brakes || !force_on_) return too_much ? 2 : 0;  // taken without a word, and without effect
  Vector3d acting_n = too_much ? Vector3d(force_n * (max_force_n / norm_n)) : force_n;
  std::uint64_t until_ns = watchdog_ns_ != 0 ? now_ns + watchdog_ns_ : simulated::Mechanics::kNever;
  Vector3d in_d = to_d(acting_n);
  const simulated::MechanicsParameters& m = unit_.mechanics().parameters();
  if (gravity && m.gravity_m_s2 != Vector3d::Zero()) {
    in_d -= m.mass_kg * m.gravity_m_s2;
    until_ns = std::min(until_ns, now_ns + kGravityActsNs);
  }
  (void)unit_.mechanics().set_force(in_d, until_ns);
  return too_much ? 2 : 0;
}

void FdUnit::cause_told(std::uint64_t now_ns) noexcept {
  if (button_presses_ == 1 && press_told_ns_ == 0) press_told_ns_ = now_ns;
}

void FdUnit::enable_force(bool on, std::uint64_t now_ns) {
  advance_to(now_ns);
  if (!on) {
    force_off(ForceOff::kSoftware);
    return;
  }
  force_on_ = true;
  cause_ = ForceOff::kNone;
  last_force_ns_ = now_ns;
  if (calibrated_) unit_.begin(now_ns);
}

double FdUnit::blocks_us(std::uint64_t now_ns) noexcept {
  const double t_s = unit_.age_s(now_ns);
  const bool hangs = settings_.block_at_s >= 0.0 && t_s > settings_.block_at_s && !has_blocked_;
  has_blocked_ = t_s >= 0.0 && (has_blocked_ || hangs);
  return settings_.unit.call_us + unit_.late_us(now_ns) + (hangs ? 1e6 * settings_.block_s : 0.0);
}

void FdUnit::auto_init(std::uint64_t now_ns) {
  unit_.advance_to(now_ns);
  unit_.mechanics().place(unit_.mechanics().parameters().start_position_m, Vector3d::Zero());
  calibrated_ = true;
  regulating = true;
}

}  // namespace drivers::virtual_vendor::force_dimension
