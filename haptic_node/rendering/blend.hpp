#pragma once
/// @file blend.hpp
/// How what an answer changes is brought in: not at once.
#include <algorithm>
#include <cmath>

namespace haptic::blend {

inline constexpr double kSteps = 0.3, kLeast_s = 0.01;  ///< Of a step of physics, but no faster than kLeast_s.
/// What an answer moves in a pile is a prediction put right: it is blended in over this many steps instead.
inline constexpr double kPileSteps = 2.4;
/// So it is with what rocks on an edge, over no less than this.
inline constexpr double kRockLeast_s = 0.03;
/// Over a network, with a body that the hand pushes: over so many ages of the answer. Jitter makes the world take the
/// hand's impulses unevenly, so a body is now a little ahead and now a little behind; what the hand does about it comes
/// back a round trip later.
inline constexpr double kNetworkAges = 3.0;
inline constexpr double kRecovery_m_s = 0.2;  ///< A surface does not come at the hand faster than this by blending.
/// Contacts that the proxy cannot reach in a step, with this to spare, are left out of it.
inline constexpr double kReach_m = 0.2e-3;

/// What is brought in within a step, as a share of what is left.
[[nodiscard]] inline double share_of(double blend_s, double h) noexcept { return -std::expm1(-h / blend_s); }

}  // namespace haptic::blend
