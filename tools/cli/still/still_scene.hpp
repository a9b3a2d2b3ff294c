#pragma once
/// @file still_scene.hpp
/// A frame as text for POV-Ray, which renders it: shapes, light, hands, force arrows. And what such a picture has to be
/// told once for all frames of a run, so that they can be laid side by side.
#include <span>
#include <string>
#include <vector>

#include "rtbus/config/scene.hpp"
#include "tools/cli/still/still_camera.hpp"
#include "tools/cli/still/still_frame.hpp"

namespace tools {

struct Rgb {
  double r = 0.0, g = 0.0, b = 0.0;  ///< sRGB, 0…1.
};

inline constexpr Rgb kProxyColour{0.13, 0.40, 0.72};
inline constexpr Rgb kForceColour{0.72, 0.07, 0.15};

/// Common to all frames.
struct StillLayout {
  Camera camera;
  double radius_m = 0.0;     ///< Of what the picture shows.
  double n_per_cm = 1.0;     ///< Newtons at the device per centimetre of arrow in the world.
  double moved_max_m = 0.0;  ///< Bodies this far from their start, and farther, have the last colour; 0: none.
  double grid_m = 0.01;      ///< Squares of the ground.
};
[[nodiscard]] StillLayout lay_out(const rtbus::config::Scene& scene, std::span<const StillFrame> frames,
                                  const StillView& view, int width_px, int height_px);

/// 1, 2 or 5 times a power of ten, not below `value` > 0.
[[nodiscard]] double round_up_nicely(double value);

/// Colour of a body that has moved by `share` (0…1) of moved_max_m.
[[nodiscard]] Rgb moved_colour(double share);

/// Where the arrow of a hand's force ends.
[[nodiscard]] Eigen::Vector3d arrow_tip(const StillHand& hand, const StillLayout& layout);
/// The radius the proxy is drawn with: its own, or what can be seen.
[[nodiscard]] double drawn_radius_m(const StillHand& hand, const StillLayout& layout);

/// The file for `povray`.
[[nodiscard]] std::string pov_text(const rtbus::config::Scene& scene, const StillFrame& frame,
                                   const StillLayout& layout);

}  // namespace tools
