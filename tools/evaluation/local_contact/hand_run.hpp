#pragma once
/// @file hand_run.hpp
/// A hand that does the same under several methods, and how far apart what it feels is. Simulated clock.
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "physics_node/engine/world.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"

namespace tools {

struct HandRun {
  std::vector<double> time_s;
  std::vector<Eigen::Vector3d> force_n;  ///< On the hand, once a millisecond.
  physics::BodyPose last;                ///< Of the body that was watched, at the end.
  double cycle_us = 0.0, cycle_p99_us = 0.0;
};

/// @param session_file Path. @param settings As for --set; those of the user come last. @param body Watched: its place
/// in the scene. @param knows_shapes As HarnessOptions::knows_shapes.
[[nodiscard]] HandRun run_hand(const LocalContactOptions& options, const std::string& session_file,
                               const std::vector<std::string>& settings, double duration_s,
                               std::optional<std::size_t> body = std::nullopt, bool knows_shapes = true);

struct HandError {
  double rms_n = 0.0, peak_n = 0.0;
  double change_n = 0.0;  ///< Largest change of what was felt within 1 ms.
};

/// While either is felt, from `from_s` on.
[[nodiscard]] HandError hand_error(const HandRun& felt, const HandRun& truth, double from_s);

[[nodiscard]] double largest_force_n(const HandRun& run);

/// |force| over time, from `from_s` on.
[[nodiscard]] PanelLine hand_line(const HandRun& run, PanelLine line, double from_s);

}  // namespace tools
