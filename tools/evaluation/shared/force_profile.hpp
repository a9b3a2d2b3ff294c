#pragma once
/// @file force_profile.hpp
/// How rough a force feels, in two figures: what changes from one millisecond to the next, and what vibrates faster
/// than a hand can move. He & Choi (2013) compare force profiles by eye (Figs 15, 16, 18, 19); these are their numbers.
#include <span>

namespace tools {

/// Of one force component over time.
struct Roughness {
  double increment_rms_n = 0.0;      ///< RMS of the changes over 1 ms [N].
  double power_above_30hz_n2 = 0.0;  ///< Mean square of what lies above 30 Hz [N²]; its root is an RMS in N.
  double mean_n = 0.0;
  double rms_n = 0.0;  ///< With the mean.
};

/// Faster than this a hand does not move on purpose; it feels it as vibration.
inline constexpr double kVibration_hz = 30.0;

/// Pure. The spectrum is that of the samples and their mirror image (discrete cosine transform), so that a profile
/// which ends elsewhere than it began has no jump at its ends that would count as vibration; all components together
/// have the variance of the samples (Parseval).
/// @param force_n Evenly spaced samples [N]; fewer than two give zeros, and their mean.
/// @param rate_hz Of the samples; at least 1000, a change is taken over the whole number of samples nearest to 1 ms.
[[nodiscard]] Roughness roughness(std::span<const double> force_n, double rate_hz);

}  // namespace tools
