#pragma once
/// @file velocity.hpp
/// Velocity from encoder positions.
#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"

namespace haptic {

struct VelocityConfig {
  bool adaptive = false;     ///< Adaptive window instead of the low-pass.
  double cutoff_hz = 100.0;  ///< Of the low-pass, > 0.
  double quantum_m = 0.0;    ///< Of the encoders, for the adaptive window.
  bool of_device = false;    ///< The device's own velocity is taken instead of an estimate.
};

/// Low-pass: backward difference over the real time between measurements, through a first-order low-pass. One encoder
/// step of 23 µm is 23 mm/s of noise at 1 kHz; the low-pass at 100 Hz leaves 9 mm/s of it and delays by 1.6 ms.
///
/// Adaptive window (F. Janabi-Sharifi, V. Hayward, C.-S. J. Chen, "Discrete-time adaptive windowing for velocity
/// estimation", IEEE Trans. Control Systems Technology 8(6), 2000; first order, end-fit): per axis the slope of the
/// longest line from the newest sample back that passes all samples between within one encoder step; at most kWindow of
/// them. Decision 0015 has the comparison.
class VelocityEstimator {
 public:
  static constexpr std::size_t kWindow = 16;

  explicit VelocityEstimator(const VelocityConfig& config) noexcept;
  /// A low-pass. @param cutoff_hz Its corner [Hz], > 0.
  explicit VelocityEstimator(double cutoff_hz) noexcept : VelocityEstimator(VelocityConfig{false, cutoff_hz, 0.0}) {}

  /// @param position_m New measurement. @param time_ns When it was made; the same time as before changes nothing.
  /// @returns the estimate [m/s]. @realtime Yes, bounded by kWindow².
  const Eigen::Vector3d& update(const Eigen::Vector3d& position_m, std::uint64_t time_ns) noexcept RTBUS_NONBLOCKING;

  /// A velocity that the device measured takes the estimate's place. @realtime Yes.
  void take(const Eigen::Vector3d& velocity_m_s) noexcept RTBUS_NONBLOCKING { velocity_m_s_ = velocity_m_s; }

  [[nodiscard]] const Eigen::Vector3d& velocity_m_s() const noexcept { return velocity_m_s_; }

  /// Forgets everything: the next update() gives zero. @realtime Yes.
  void reset() noexcept RTBUS_NONBLOCKING;

 private:
  struct Sample {
    std::uint64_t time_ns = 0;
    Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  };
  [[nodiscard]] const Sample& back(std::size_t n) const noexcept { return samples_[(newest_ + kWindow - n) % kWindow]; }
  [[nodiscard]] double window_velocity(int axis) const noexcept RTBUS_NONBLOCKING;

  VelocityConfig config_;
  double time_constant_s_;
  std::size_t kept_ = 0;    ///< Samples so far, at most kWindow.
  std::size_t newest_ = 0;  ///< Index of the newest.
  std::array<Sample, kWindow> samples_{};
  Eigen::Vector3d velocity_m_s_ = Eigen::Vector3d::Zero();
};

}  // namespace haptic
