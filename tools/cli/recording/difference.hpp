#pragma once
/// @file difference.hpp
/// How far one recorded signal is from another over time.
#include <cstddef>
#include <vector>

namespace tools {

/// A field of a recording over time: one row per sample, all elements of the field in it.
struct Track {
  std::vector<double> time_s;  ///< Rising.
  std::vector<double> value;   ///< time_s.size() × elements.
  std::size_t elements = 1;
};

/// Of B − REF, taken at the times of REF that both have; of a field of several elements its Euclidean norm.
struct Difference {
  std::size_t samples = 0;  ///< Compared; 0: they have no time in common.
  double from_s = 0.0, to_s = 0.0;
  double rms = 0.0;
  double peak = 0.0, peak_s = 0.0;                   ///< Largest, and when.
  double jump_per_ms = 0.0, jump_s = 0.0;            ///< Largest change within 1 ms, and when it ended.
  double reference_rms = 0.0, reference_peak = 0.0;  ///< Of REF itself, to judge the others by.
  std::vector<double> time_s, value;                 ///< The difference; `value` as in Track.
};

/// B is interpolated linearly between its samples. Where a gap of B is longer than 50 ms, nothing is compared.
[[nodiscard]] Difference compare(const Track& reference, const Track& b);

}  // namespace tools
