#pragma once
/// @file two_hands.hpp
/// Two hands squeeze the block of config/two_hands.yaml, lift it and carry it to and fro.
#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace tools {

struct TwoHandsSetup {
  std::string config_folder;             ///< Where two_hands.yaml is.
  std::string folder;                    ///< Where the hands' ways are written.
  std::vector<std::string> assignments;  ///< For both: `haptic.*.` stands for either hand.
  double duration_s = 14.0;
  double kill_s = -1.0;  ///< When the left node is killed; negative: never.
};

/// Once a millisecond.
struct TwoHandsRun {
  static constexpr double kCarried_s = 4.5;  ///< From then on the block hangs between the hands.
  std::vector<double> time_s;
  std::array<std::vector<Eigen::Vector3d>, 2> force_n;  ///< On the left and the right hand; zero once it is killed.
  std::vector<double> height_m;                         ///< Of the block's centre.
};

[[nodiscard]] TwoHandsRun carry_block(const TwoHandsSetup& setup);

/// Of one hand's force against the truth's, from `from_s` to `until_s`.
struct CarryError {
  double rms_n = 0.0, peak_n = 0.0;
};
[[nodiscard]] CarryError carry_error(const TwoHandsRun& felt, const TwoHandsRun& truth, std::size_t hand, double from_s,
                                     double until_s);

/// The method itself with both loops and physics at 10 kHz.
[[nodiscard]] std::vector<std::string> converged_carry();
/// `method`, its results one full period late.
[[nodiscard]] std::vector<std::string> late_carry(const std::string& method, double physics_hz);

}  // namespace tools
