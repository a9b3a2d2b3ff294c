#include "drivers/virtual_vendor/openhaptics/hd_unit.hpp"

#include <algorithm>

#include "rtbus/clock.hpp"

namespace drivers::virtual_vendor::openhaptics {
namespace {

using Eigen::Vector3d;

constexpr std::uint64_t kForceCutNs = 100 * rtbus::kNsPerMs;
const Vector3d kWrongBy_mm{40.0, 25.0, -30.0};

}  // namespace

void HdUnit::scheduler_started(std::uint64_t now_ns) {
  ramp_from_ns_ = now_ns;
  ticks_ = 0;
  unit_.advance_to(now_ns);
}

void HdUnit::begin_tick(std::uint64_t now_ns) {
  ++ticks_;
  frames_in_tick_ = 0;
  unit_.advance_to(now_ns);
  if (!unit_.plugged_in(now_ns)) {
    errors_.push(0x0302, -28, handle);
    (void)unit_.mechanics().set_force(Vector3d::Zero(), simulated::Mechanics::kNever);
    return;
  }
  frozen_m_ = unit_.mechanics().measure(now_ns);
  if (unit_.mechanics().velocity_m_s().norm() > settings_.too_fast_m_s && now_ns > no_force_until_ns_) {
    errors_.push(0x0203, 0, handle);
    no_force_until_ns_ = now_ns + kForceCutNs;
    ramp_from_ns_ = no_force_until_ns_;
  }
  const double t_s = unit_.age_s(now_ns);
  if (settings_.warm_at_s >= 0.0 && t_s > settings_.warm_at_s && !warm_) {
    warm_ = true;
    errors_.push(0x0200, 0, handle);
  }
  if (settings_.uncalibrate_at_s >= 0.0 && t_s > settings_.uncalibrate_at_s && !uncalibrated_) {
    uncalibrated_ = true;
    calibration_ = Calibration::kNeedsInkwell;
  }
}

void HdUnit::begin_frame() {
  if (frame_depth_ == 0) {
    if (frames_in_tick_ > 0) errors_.push(0x0400, 0, handle);  // one frame per tick
    force_set_ = false;
    ++frames_in_tick_;
  }
  ++frame_depth_;
}

void HdUnit::end_frame(std::uint64_t now_ns) {
  if (frame_depth_ == 0) {
    errors_.push(0x0401, 0, handle);
    return;
  }
  if (--frame_depth_ > 0) return;
  Vector3d force_n = force_set_ ? frame_force_n_ : Vector3d(Vector3d::Zero());
  const bool acts =
      force_output && calibration_ == Calibration::kDone && now_ns >= no_force_until_ns_ && unit_.plugged_in(now_ns);
  if (!acts) force_n.setZero();
  if (settings_.ramp_s > 0.0) {
    force_n *= std::clamp(rtbus::seconds_between(std::min(ramp_from_ns_, now_ns), now_ns) / settings_.ramp_s, 0.0, 1.0);
  }
  if (warm_) force_n *= 0.5;
  (void)unit_.mechanics().set_force(force_n, simulated::Mechanics::kNever);
}

void HdUnit::set_force(const Vector3d& force_n) {
  if (frame_depth_ == 0) {
    errors_.push(0x0402, 0, handle);
    return;
  }
  frame_force_n_ = force_n;
  force_set_ = true;
}

Vector3d HdUnit::position_mm(std::uint64_t now_ns) {
  (void)now_ns;
  const bool wrong = ticks_ <= settings_.wrong_ticks || calibration_ != Calibration::kDone;
  return 1e3 * frozen_m_ + centre_mm() + (wrong ? kWrongBy_mm : Vector3d(Vector3d::Zero()));
}

bool HdUnit::docked(std::uint64_t now_ns) const noexcept {
  const double t_s = unit_.age_s(now_ns);
  return settings_.docked_at_s >= 0.0 && t_s > settings_.docked_at_s && t_s < settings_.docked_at_s + 1.0;
}

std::uint32_t HdUnit::check_calibration(std::uint64_t now_ns) noexcept {
  // The device remembers that the stylus has been in its inkwell, whenever it is asked.
  const bool was_docked = settings_.docked_at_s >= 0.0 && unit_.age_s(now_ns) > settings_.docked_at_s;
  if (calibration_ == Calibration::kNeedsInkwell && was_docked) calibration_ = Calibration::kNeedsUpdate;
  // Before the scheduler has run for a while nobody knows.
  if (ticks_ < settings_.wrong_ticks) return 0x5002;
  return calibration_ == Calibration::kDone ? 0x5000 : calibration_ == Calibration::kNeedsUpdate ? 0x5001 : 0x5002;
}

void HdUnit::update_calibration() noexcept {
  if (calibration_ == Calibration::kNeedsUpdate) calibration_ = Calibration::kDone;
}

bool HdUnit::ticks_stop(std::uint64_t now_ns) const noexcept {
  return settings_.stop_ticks_at_s >= 0.0 && unit_.age_s(now_ns) > settings_.stop_ticks_at_s;
}

}  // namespace drivers::virtual_vendor::openhaptics
