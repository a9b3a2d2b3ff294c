#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "physics_node/engine_registry.hpp"
#include "physics_node/node_config.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/evaluation/shared/follow_session.hpp"
#include "tools/evaluation/stack/stack.hpp"

namespace tools {

namespace {

constexpr int kTries = 3;

/// A stack beyond the paper's, of the largest one's cubes. Even numbers: the push goes into the middle of a cube.
struct LargerStack {
  int wide, high, deep;
};
constexpr LargerStack kLarger[] = {{10, 10, 10}, {20, 10, 10}, {20, 10, 25}};

/// How far the cubes of a session move in the first second without a hand [mm].
double unrest_mm(const std::string& file, const std::vector<std::string>& assignments) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  rtbus::config::SessionConfig session = rtbus::config::load_session(file, overrides);
  const physics::NodeConfig config = physics::read_node_config(session);
  const auto world = physics::make_world(config.physics.engine, config.scene, config.physics.engine_settings());
  const double h = config.physics.step_s() / config.physics.parts_per_step();
  for (double t = 0.0; t < 1.0 && !interrupted(); t += h) world->step(h);
  double moved_m = 0.0;
  for (std::size_t i = 0; i < world->bodies(); ++i) {
    moved_m = std::max(moved_m, (world->body_pose(i).position_m - config.scene.bodies[i].p_WB).norm());
  }
  return moved_m * 1e3;
}

}  // namespace

std::vector<StackRun> run_stacks(const StackOptions& options, const std::vector<StackPair>& pairs,
                                 Experiment& experiment) {
  RunProgress progress(::isatty(STDERR_FILENO) == 1, false);
  const auto cells = stack_cells();
  std::vector<StackRun> runs;
  int paused = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (!in_real_processes(options, cells[i])) continue;
    for (const char* method : {"interpolation", "remote_virtual_coupling"}) {
      const bool remote = std::string(method) == "remote_virtual_coupling";
      if (options.quick && !cells[i].compared && !remote) continue;
      const double hand = remote && cells[i].compared ? pairs[i].hand_remote_n_per_m : kStackHand_n_per_m;
      const PushSetup setup = stack_setup(options, cells[i], method, hand, options.push_s());
      for (int attempt = 1; attempt <= kTries; ++attempt) {
        if (interrupted()) return runs;
        char text[120];
        std::snprintf(text, sizeof text, "%s %s, real processes", cells[i].id, method);
        progress.show_share(0.4 + 0.5 * static_cast<double>(i) / static_cast<double>(cells.size()), text);
        auto push = push_for_real(setup);
        if (!push) break;
        StackRun run{&cells[i], method, std::move(*push), {}, false};
        run.figures = judge_push(run.push.trace, setup.gap_mm);
        run.counted = run.push.worst_pause_ms <= kMachinePause_ms;
        if (!run.counted) ++paused;
        runs.push_back(std::move(run));
        if (runs.back().counted) break;
      }
    }
  }
  progress.clear();
  experiment.note(std::to_string(paused) + " real run(s) not counted: the machine paused for more than 5 ms");
  return runs;
}

Table larger_stacks(const StackOptions& options) {
  Table table{"stack_larger",
              {"cubes", "moved within 1 s of rest [mm]", "simulation [Hz]", "of real time", "step p50 [ms]", "p99 [ms]",
               "haptic [Hz]", "bare loop [Hz]", "late, p99.9 [us]", "bare, p99.9 [us]", "worst pause [ms]"},
              {}};
  for (const LargerStack& size : kLarger) {
    if (interrupted()) break;
    const int cubes = size.wide * size.high * size.deep;
    const StackCell cell{"", 500, false, 0.0, 0.0, 800.0, false};
    PushSetup setup = stack_setup(options, cell, "remote_virtual_coupling", kStackHand_n_per_m, options.push_s());
    char text[120];
    std::snprintf(text, sizeof text, "scene.bodies.cube.grid.count=[%d, %d, %d]", size.wide, size.high, size.deep);
    setup.assignments.emplace_back(text);
    std::snprintf(text, sizeof text, "scene.bodies.cube.position_m=[%g, 0.01, -0.01]", -0.0105 * (size.wide - 1));
    setup.assignments.emplace_back(text);
    const double moved_mm = unrest_mm(setup.session_file, setup.assignments);
    const auto push = push_for_real(setup);
    if (!push) continue;
    table.rows.push_back({static_cast<double>(cubes), moved_mm, push->simulation_hz, push->real_time_factor,
                          push->step_p50_ms, push->step_p99_ms, push->haptic_hz, push->bare_hz, push->wakeup_p999_us,
                          push->bare.wakeup_p999_us, push->worst_pause_ms});
  }
  return table;
}

}  // namespace tools
