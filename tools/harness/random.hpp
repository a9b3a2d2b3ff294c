#pragma once
/// @file random.hpp
/// Random numbers that are the same everywhere: the distributions of <random> differ between standard libraries, and a
/// case of a sweep has to repeat bit by bit.
#include <cmath>
#include <cstdint>

namespace tools {

/// SplitMix64 (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators, OOPSLA 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed = 1) noexcept : state_(seed) {}

  std::uint64_t next() noexcept {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }
  /// Even in [0, 1).
  double fraction() noexcept { return static_cast<double>(next() >> 11) * 0x1p-53; }
  double between(double low, double high) noexcept { return low + (high - low) * fraction(); }
  /// Even on a logarithmic scale; 0 < low < high.
  double log_between(double low, double high) noexcept { return low * std::pow(high / low, fraction()); }
  /// 0…count − 1.
  int below(int count) noexcept { return static_cast<int>(fraction() * count); }
  bool chance(double share) noexcept { return fraction() < share; }

 private:
  std::uint64_t state_;
};

}  // namespace tools
