#pragma once
/// @file velocity.hpp
/// Velocity from encoder positions.
#include <cstdint>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"

namespace haptic {

/// Backward difference over the real time between measurements, through a first-order low-pass. One encoder step of
/// 23 µm is 23 mm/s of noise at 1 kHz; the low-pass at 100 Hz leaves 9 mm/s of it and delays by 1.6 ms.
class VelocityEstimator {
 public:
  /// @param cutoff_hz Corner of the low-pass [Hz], > 0.
  explicit VelocityEstimator(double cutoff_hz) noexcept;

  /// @param position_m New measurement. @param time_ns When it was made; the same time as before changes nothing.
  /// @returns the estimate [m/s]. @realtime Yes.
  const Eigen::Vector3d& update(const Eigen::Vector3d& position_m, std::uint64_t time_ns) noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] const Eigen::Vector3d& velocity_m_s() const noexcept { return velocity_m_s_; }

  /// Forgets everything: the next update() gives zero. @realtime Yes.
  void reset() noexcept RTBUS_NONBLOCKING;

 private:
  double time_constant_s_;
  bool primed_ = false;
  std::uint64_t time_ns_ = 0;
  Eigen::Vector3d position_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s_ = Eigen::Vector3d::Zero();
};

}  // namespace haptic
