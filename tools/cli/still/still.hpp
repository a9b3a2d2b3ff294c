#pragma once
/// @file still.hpp
/// Rendered stills: POV-Ray draws the bodies, gnuplot writes caption, legend and scales over them.
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "rtbus/config/scene.hpp"
#include "tools/cli/still/still_camera.hpp"
#include "tools/cli/still/still_frame.hpp"

namespace tools {

struct StillOptions {
  StillView view;
  int width_px = 1600, height_px = 1000;
};

struct StillsOutcome {
  std::vector<std::string> files;  ///< One PNG per frame that could be drawn.
  std::string problem;             ///< Why some are missing; empty when none is.
};

/// Draws every frame as `<stem>.png` into `folder`, all from one camera and with one set of scales. What it was drawn
/// from stays beside it: `<stem>.pov`, `<stem>.gp`. Takes some seconds per frame.
[[nodiscard]] StillsOutcome draw_stills(const std::filesystem::path& folder, const rtbus::config::Scene& scene,
                                        std::span<const StillFrame> frames, const StillOptions& options);

}  // namespace tools
