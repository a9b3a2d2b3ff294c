#pragma once
/// @file stack.hpp
/// The scene that both programs step, and how they are told its size.
#include <cstdlib>

namespace overhead {

inline constexpr double kEdge_m = 0.02, kGap_m = 1e-4, kMass_kg = 0.02, kFriction = 0.5;
inline constexpr double kStep_s = 1e-3;
inline constexpr int kIterations = 10;
inline constexpr int kWarmUpSteps = 50;  ///< Contacts are made, buffers have grown, nothing sleeps yet.
/// The tool hangs in the air in front of the stack, on its spring.
inline constexpr double kProxyMass_kg = 0.1, kProxyRadius_m = 0.005, kStiffness_n_per_m = 300.0,
                        kDamping_n_s_per_m = 6.0;
inline constexpr double kProxyHeight_m = 0.05, kProxyDistance_m = 0.03;

struct Size {
  int wide = 5, high = 5, deep = 5, steps = 20;
};

/// PROGRAM CUBES STEPS: 125 and 500 as in the paper.
inline Size size_of(int argc, char** argv) {
  Size size;
  if (argc > 1 && std::atoi(argv[1]) == 500) size.wide = size.high = 10;
  if (argc > 2) size.steps = std::atoi(argv[2]);
  return size;
}

}  // namespace overhead
