#pragma once
/// @file work_precision.hpp
/// `rtbus evaluate work-precision`: error against run time, of each method, rate, step and iteration count.
#include <string>
#include <vector>

#include "tools/cli/common/run_progress.hpp"
#include "tools/evaluation/shared/experiment.hpp"
#include "tools/evaluation/work_precision/precision_run.hpp"

namespace tools {

struct WorkPrecisionOptions {
  std::string wall_file, sphere_file, block_file, stack_file, soft_file;  ///< Session files.
  std::vector<std::string> pile_files;                                    ///< Sessions of piles (precision_pile.hpp).
  std::vector<std::string> assignments;  ///< After the experiment's own, so that they win.
  std::string own_file;                  ///< A user's session: it alone is looked at; "": the experiment's own scenes.
  double seconds = 3.0;                  ///< Of the user's session.
  bool quick = false;
};

/// A cell with what came of it.
struct PrecisionRow {
  PrecisionCell cell;
  PrecisionError error;
  PrecisionTrace trace;  ///< Without its samples.
};

/// Scenes whose reference is known: `wall` and `drop` in closed form, `sphere` and `block` as the converged loop,
/// `ridge`, `ball` and `soft` as the finest loop. Adds tables, figures and checks. Throws rtbus::config::Error.
void evaluate_work_precision(const WorkPrecisionOptions& options, Experiment& experiment);

/// The scenes, with their gains and hands.
[[nodiscard]] PrecisionScene wall_scene(const WorkPrecisionOptions& options);
[[nodiscard]] PrecisionScene drop_scene(const WorkPrecisionOptions& options);
[[nodiscard]] PrecisionScene sphere_scene(const WorkPrecisionOptions& options);
[[nodiscard]] PrecisionScene block_scene(const WorkPrecisionOptions& options);
/// A tip strokes over the ridge of a box that stands on its edge.
[[nodiscard]] PrecisionScene ridge_scene(const WorkPrecisionOptions& options);
/// A tip strokes the top of a free ball, which rolls.
[[nodiscard]] PrecisionScene ball_scene(const WorkPrecisionOptions& options);
[[nodiscard]] PrecisionScene soft_scene(const WorkPrecisionOptions& options);

/// The user's session as it stands, along the axis on which its hand feels most. Throws rtbus::config::Error.
[[nodiscard]] PrecisionScene own_scene(const WorkPrecisionOptions& options);

/// The exact solutions of the first two.
[[nodiscard]] Reference wall_reference(const PrecisionScene& scene);
[[nodiscard]] Reference drop_reference(const PrecisionScene& scene);

/// The loop without latency and nearly without sampling: what `sphere` and `block` are measured against. A proxy of one
/// gram: the limit of all methods, whose proxies weigh what they weigh.
[[nodiscard]] PrecisionTrace nearly_continuous(const PrecisionScene& scene, double rate_hz,
                                               const char* method = "remote_virtual_coupling");

/// Writes NAME.tsv of a scene's rows and draws error over cost with the Pareto front into the experiment's folder.
/// @param what Of the title, after the scene.
void draw_precision(Experiment& experiment, const std::string& scene, const std::string& what,
                    const std::vector<PrecisionRow>& rows);

/// Indices of the rows that no other beats in both cost and error, by rising cost.
[[nodiscard]] std::vector<std::size_t> pareto_front(const std::vector<PrecisionRow>& rows);

}  // namespace tools
