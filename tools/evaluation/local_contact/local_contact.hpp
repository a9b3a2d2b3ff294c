#pragma once
/// @file local_contact.hpp
/// `rtbus evaluate local-contact`: what the method `local_contact` promises, one figure and one row of checks for each
/// claim, method beside method on the same axes. All under the simulated clock; each answer of physics comes one full
/// period late.
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/evaluation/shared/experiment.hpp"
#include "tools/evaluation/shared/method_settings.hpp"
#include "tools/evaluation/shared/panels.hpp"
#include "tools/evaluation/work_precision/work_precision.hpp"

namespace tools {

struct LocalContactOptions {
  std::string config_folder;             ///< Where wall.yaml and its sisters are.
  std::vector<std::string> assignments;  ///< After the experiment's own, so that they win.
  bool quick = false;                    ///< Fewer rates.
};

inline constexpr const char* kLocalContact = "local_contact";
inline constexpr const char* kRemoteCoupling = "remote_virtual_coupling";
inline constexpr const char* kForceInterpolation = "interpolation";
/// With it, in each table.
inline constexpr const char* kAllCompared[] = {kLocalContact, kRemoteCoupling, kLeadingCoupling, kForceInterpolation};

/// Runs all claims, draws and checks them. Throws rtbus::config::Error.
void evaluate_local_contact(const LocalContactOptions& options, Experiment& experiment);

/// The claims, each with its table, its figure and its checks.
/// a: a free block with friction, pushed. f: the same at every rate of loop and physics.
void claim_block(const LocalContactOptions& options, Experiment& experiment, RunProgress& progress);
void claim_rates(const LocalContactOptions& options, Experiment& experiment, RunProgress& progress);
/// b: nothing in free air. c: no ripple along a surface. d: a stiff wall settles as with `direct`.
void claim_free_air(const LocalContactOptions& options, Experiment& experiment);
void claim_sliding(const LocalContactOptions& options, Experiment& experiment);
void claim_wall(const LocalContactOptions& options, Experiment& experiment);
/// e: piles and soft bodies, rough at equal mean force. g: Newton's third law.
void claim_rough(const LocalContactOptions& options, Experiment& experiment, RunProgress& progress);
void claim_third_law(const LocalContactOptions& options, Experiment& experiment);
/// h: edges, hulls and meshes are felt where they are.
void claim_shapes(const LocalContactOptions& options, Experiment& experiment);
/// j: free bodies turn, tip, roll, slide off a table and stand in stacks under the hand.
void claim_free_bodies(const LocalContactOptions& options, Experiment& experiment);
/// i: two hands at one body feel each other.
void claim_two_hands(const LocalContactOptions& options, Experiment& experiment);

/// l: what friction holds stands under a hand.
void claim_friction(const LocalContactOptions& options, Experiment& experiment);
/// k: what yields, soft bodies and very light ones, bears the hand as it does in physics.
void claim_yields(const LocalContactOptions& options, Experiment& experiment);

/// Writes bumps of 1 mm on a square of 50 mm, y up, in 2·cells² triangles, as an OBJ file in metres. @returns `file`.
std::filesystem::path write_bumps(const std::filesystem::path& file, int cells);

/// One run, every cycle of it. `--set` of the user comes last.
[[nodiscard]] std::vector<rtbus::Telemetry> record_hand(const LocalContactOptions& options, const std::string& session,
                                                        const std::vector<std::string>& assignments, double duration_s);

[[nodiscard]] inline double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

/// A line of a figure: the name is the method's unless another is given.
[[nodiscard]] PanelLine method_line(const std::string& method, const std::string& name = {});
/// The line of the truth: the method itself, both loops at 10 kHz, no latency.
[[nodiscard]] PanelLine converged_line();

}  // namespace tools
