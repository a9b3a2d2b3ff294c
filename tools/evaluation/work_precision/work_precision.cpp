#include "tools/evaluation/work_precision/work_precision.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/shared/method_settings.hpp"
#include "tools/evaluation/work_precision/precision_pile.hpp"
#include "tools/evaluation/work_precision/precision_stack.hpp"

namespace tools {

namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

PrecisionTrace without_samples(PrecisionTrace trace) {
  for (auto* values : {&trace.time_s, &trace.position_m, &trace.force_n}) std::vector<double>().swap(*values);
  return trace;
}

PrecisionRow measure(const PrecisionScene& scene, const PrecisionCell& cell, const Reference& reference) {
  PrecisionRow row{cell, {}, run_precisely(scene, cell)};
  row.error = error_of(row.trace, scene, reference);
  row.trace = without_samples(std::move(row.trace));
  return row;
}

/// Every method of the registry that this scene can have, at every rate of physics; then the loop's rate, the engine's
/// step and the solver's iterations, one at a time.
std::vector<PrecisionCell> cells_of(const PrecisionScene& scene, bool quick) {
  const std::vector<double> rates =
      quick ? std::vector<double>{18, 100, 1000} : std::vector<double>{5, 18, 43, 100, 250, 500, 1000};
  std::vector<PrecisionCell> cells;
  for (const haptic::MethodEntry& method : haptic::registered_methods()) {
    if (!method.needs_physics) {
      if (!scene.at_rest) continue;
      for (const double haptic_hz : {500.0, 1000.0, 2000.0, 4000.0, 10000.0}) {
        cells.push_back({std::string(method.name), 1000, haptic_hz});
      }
      continue;
    }
    for (const double rate : rates) cells.push_back({std::string(method.name), rate, 1000});
    if (method.name == "remote_virtual_coupling") {
      for (const double rate : rates) cells.push_back({kLeadingCoupling, rate, 1000});
    }
    if (method.server_force != haptic::ServerForce::kNone) continue;
    for (const double haptic_hz : {500.0, 2000.0, 4000.0, 10000.0}) {
      cells.push_back({std::string(method.name), 1000, haptic_hz});
    }
    for (const double engine_hz : scene.engine_hz) {
      cells.push_back({std::string(method.name), 100, 1000, engine_hz});
    }
    for (const int iterations : scene.iterations)
      cells.push_back({std::string(method.name), 100, 1000, 1000, iterations});
  }
  return cells;
}

Table table_of(const PrecisionScene& scene, const std::vector<PrecisionRow>& rows) {
  Table table{"work_precision_" + scene.name,
              {"method", "physics [Hz]", "engine [Hz]", "iterations", "haptics [Hz]", "force RMS [N]", "force peak [N]",
               "position RMS [mm]", "spurious [mJ]", "haptics [ns/tick]", "physics [ms/step]", "CPU [ms/s]",
               "heap [KiB]", "outcome"},
              {}};
  for (const PrecisionRow& row : rows) {
    table.rows.push_back({row.cell.method, row.cell.physics_hz, row.cell.engine_hz,
                          row.cell.solver_iterations > 0 ? Cell(static_cast<double>(row.cell.solver_iterations))
                                                         : Cell(std::string("own")),
                          row.cell.haptic_hz, row.error.force_rms_n, row.error.force_peak_n,
                          1e3 * row.error.position_rms_m, 1e3 * row.error.spurious_j, row.trace.cycle_ns,
                          row.trace.step_ms, 1e3 * row.trace.cpu_s_per_s, row.trace.heap_kib,
                          std::string(row.trace.diverged() ? "diverged" : "bounded")});
  }
  return table;
}

/// How fast the error falls with the period: log₂ of the ratio of neighbours, which differ by a factor of 2.
double order_of(double coarse, double fine) { return std::log2(coarse / fine); }

std::vector<std::string> fine_velocity(double haptic_hz) {
  // The velocity filter stays where it is when the rate goes up, unless told: then its delay would be what is left.
  char text[80];
  std::snprintf(text, sizeof text, "haptic.0.velocity_cutoff_hz=%g", std::min(5000.0, 0.5 * haptic_hz));
  return {text};
}

/// Convergence of a method to `reference` as the rate of its loop doubles. @returns order between the two finest.
double converge(const PrecisionScene& base, const PrecisionCell& cell, const Reference& reference, Table& table) {
  double order = kNothing, before = kNothing;
  for (const double rate : {1250.0, 2500.0, 5000.0, 10000.0}) {
    PrecisionScene scene = base;
    for (const std::string& text : fine_velocity(rate)) scene.assignments.push_back(text);
    PrecisionCell here = cell;
    here.haptic_hz = rate;
    const PrecisionTrace trace = run_precisely(scene, here);
    const PrecisionError error = error_of(trace, scene, reference);
    order = order_of(before, error.force_rms_n);
    before = error.force_rms_n;
    table.rows.push_back({base.name, cell.method, rate, error.force_rms_n, 1e3 * error.position_rms_m,
                          std::isfinite(order) ? Cell(order) : Cell(std::string("-"))});
  }
  return order;
}

/// The finest of a series of doubled rates, and how the differences between neighbours shrink.
PrecisionTrace converged(const PrecisionScene& scene, Experiment& experiment, Table& table) {
  PrecisionTrace finest;
  double before = kNothing, order = kNothing;
  for (const double rate : {1250.0, 2500.0, 5000.0, 10000.0}) {
    PrecisionTrace next = nearly_continuous(scene, rate);
    if (!finest.time_s.empty()) {
      const PrecisionError change = error_of(finest, scene, reference_of(next));
      order = order_of(before, change.force_rms_n);
      before = change.force_rms_n;
      table.rows.push_back({scene.name, std::string("reference: change to the next rate"), rate / 2, change.force_rms_n,
                            1e3 * change.position_rms_m, std::isfinite(order) ? Cell(order) : Cell(std::string("-"))});
    }
    finest = std::move(next);
  }
  experiment.check_at_least("work-precision." + scene.name + ".order",
                            scene.name + ": the reference loop converges, order", order, "1", 0.9);
  return finest;
}

/// Soft bodies have no limit to tend to: their links are the stiffer the shorter the step is, so that the step belongs
/// to the material, and the tool meets one node after the other. Steps stay at 1 ms; the loop without latency at the
/// finest rate is the reference, and how far neighbours in rate are from each other is how well it is known.
PrecisionTrace known_to(const PrecisionScene& base, Experiment& experiment, Table& table) {
  PrecisionTrace finest;
  double worst_n = 0.0;
  for (const double rate : {1000.0, 2000.0, 4000.0, 8000.0}) {
    PrecisionScene scene = base;
    for (const std::string& text : fine_velocity(rate)) scene.assignments.push_back(text);
    PrecisionTrace next = run_precisely(scene, {"remote_virtual_coupling", 1000, rate, 1000, 0, false});
    if (!finest.time_s.empty()) {
      const PrecisionError change = error_of(finest, scene, reference_of(next));
      worst_n = std::max(worst_n, change.force_rms_n);
      table.rows.push_back({base.name, std::string("reference, steps of 1 ms: change to the next rate"), rate / 2,
                            change.force_rms_n, 1e3 * change.position_rms_m, std::string("-")});
    }
    finest = std::move(next);
  }
  experiment.check_at_most("work-precision.soft.reference", "soft: the finest loops are apart by, RMS", 1e3 * worst_n,
                           "mN", 10.0);
  experiment.note(
      "soft: the length of a step is part of the material (config/README.md); engine rates other than 1000 Hz are off "
      "by "
      "that");
  return finest;
}

/// Why a method cannot have a scene; empty when it can. What a method refuses is left out of the comparison, and said.
std::string refusal(const PrecisionScene& scene, const haptic::MethodEntry& method) {
  if (!method.needs_contacts) return {};
  try {
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : assignments_of(scene, {std::string(method.name)})) {
      overrides.push_back(rtbus::config::parse_override(text));
    }
    auto session = rtbus::config::load_session(scene.session_file, overrides);
    (void)haptic::read_haptic_config(session, 0);
    return {};
  } catch (const rtbus::config::Error& error) {
    return error.what();
  }
}

/// The finest loop of a session. Whether it is a truth depends on the scene: a pile never converges.
PrecisionTrace finest_of(const PrecisionScene& scene, Experiment& experiment, Table& table,
                         const char* method = "remote_virtual_coupling") {
  PrecisionTrace finest;
  double change_n = kNothing;
  for (const double rate : {2500.0, 5000.0, 10000.0}) {
    PrecisionTrace next = nearly_continuous(scene, rate, method);
    if (!finest.time_s.empty()) {
      const PrecisionError change = error_of(finest, scene, reference_of(next));
      change_n = change.force_rms_n;
      table.rows.push_back({scene.name, std::string("reference: change to the next rate"), rate / 2, change_n,
                            1e3 * change.position_rms_m, std::string("-")});
    }
    finest = std::move(next);
  }
  experiment.note(
      formatted("%s: the reference is known to %.3g N RMS (the loop at 5 kHz beside that at 10 kHz); "
                "smaller errors in the table mean nothing",
                scene.name.c_str(), change_n));
  return finest;
}

void compare(const PrecisionScene& scene, const Reference& reference, const WorkPrecisionOptions& options,
             Experiment& experiment, RunProgress& progress) {
  const LoadMeter meter;
  std::vector<PrecisionRow> rows;
  std::vector<PrecisionCell> cells = cells_of(scene, options.quick);
  for (const haptic::MethodEntry& method : haptic::registered_methods()) {
    const std::string why = refusal(scene, method);
    if (why.empty()) continue;
    std::erase_if(cells, [&](const PrecisionCell& cell) { return cell.method == method.name; });
    experiment.note(scene.name + " without " + std::string(method.name) + ": " + why);
  }
  for (const PrecisionCell& cell : cells) {
    if (interrupted()) return;
    progress.show_share(static_cast<double>(rows.size()) / static_cast<double>(cells.size()), scene.name);
    rows.push_back(measure(scene, cell, reference));
  }
  experiment.add_table(table_of(scene, rows));
  draw_precision(experiment, scene.name, "physics answers one full period late", rows);
  double slowest_ns = 0.0;
  for (const PrecisionRow& row : rows) slowest_ns = std::max(slowest_ns, row.trace.cycle_ns);
  experiment.check_at_most("work-precision." + scene.name + ".cycle", scene.name + ": dearest haptic cycle, median",
                           1e-3 * slowest_ns, "us", 10.0, meter.read());
}

}  // namespace

PrecisionTrace nearly_continuous(const PrecisionScene& base, double rate_hz, const char* method) {
  PrecisionScene scene = base;
  for (const std::string& text : fine_velocity(rate_hz)) scene.assignments.push_back(text);
  scene.assignments.emplace_back("haptic.0.proxy.mass_kg=0.001");
  return run_precisely(scene, {method, rate_hz, rate_hz, rate_hz, 0, false});
}

std::vector<std::size_t> pareto_front(const std::vector<PrecisionRow>& rows) {
  std::vector<std::size_t> order(rows.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return rows[a].trace.cpu_s_per_s < rows[b].trace.cpu_s_per_s; });
  std::vector<std::size_t> front;
  double best = std::numeric_limits<double>::infinity();
  for (const std::size_t i : order) {
    if (rows[i].trace.diverged() || rows[i].error.force_rms_n >= best) continue;
    best = rows[i].error.force_rms_n;
    front.push_back(i);
  }
  return front;
}

void evaluate_work_precision(const WorkPrecisionOptions& options, Experiment& experiment) {
  RunProgress progress(::isatty(STDERR_FILENO) == 1, false);
  if (!options.own_file.empty()) {
    Table known{"convergence", {"scene", "what", "rate [Hz]", "force RMS [N]", "position RMS [mm]", "order"}, {}};
    const PrecisionScene scene = own_scene(options);
    const PrecisionTrace finest = finest_of(scene, experiment, known);
    compare(scene, reference_of(finest), options, experiment, progress);
    experiment.add_table(std::move(known));
    experiment.note(
        formatted("force and position along %c, the axis on which this hand feels most", "xyz"[scene.axis]));
    progress.clear();
    return;
  }
  Table orders{"convergence", {"scene", "what", "rate [Hz]", "force RMS [N]", "position RMS [mm]", "order"}, {}};
  for (const PrecisionScene& scene : {wall_scene(options), drop_scene(options)}) {
    const Reference exact = scene.name == "wall" ? wall_reference(scene) : drop_reference(scene);
    experiment.check_at_least("work-precision." + scene.name + ".order",
                              scene.name + ": direct converges to the closed form, order",
                              converge(scene, {"direct"}, exact, orders), "1", 0.9);
    compare(scene, exact, options, experiment, progress);
  }
  {
    // What stands in for a closed form elsewhere, held against one.
    const PrecisionScene scene = wall_scene(options);
    const PrecisionError error = error_of(nearly_continuous(scene, 10000.0), scene, wall_reference(scene));
    experiment.check_at_most("work-precision.wall.reference", "wall: the converged loop beside the closed form, RMS",
                             1e3 * error.force_rms_n, "mN", 5.0);
  }
  for (const PrecisionScene& scene : {sphere_scene(options), block_scene(options)}) {
    const PrecisionTrace finest = converged(scene, experiment, orders);
    compare(scene, reference_of(finest), options, experiment, progress);
  }
  if (!interrupted()) {
    const PrecisionScene scene = ridge_scene(options);
    const PrecisionTrace finest = finest_of(scene, experiment, orders, "local_contact");
    experiment.note(
        "ridge: Bullet rounds the edges of its boxes by its margin, 1.3 mm; the reference is local_contact, which "
        "knows the box, and which Edge.OfABoxIsFeltAsItsOffsetCurve holds against the closed form");
    compare(scene, reference_of(finest), options, experiment, progress);
  }
  if (!interrupted()) {
    const PrecisionScene scene = ball_scene(options);
    const PrecisionTrace finest = finest_of(scene, experiment, orders);
    compare(scene, reference_of(finest), options, experiment, progress);
  }
  {
    const PrecisionScene scene = soft_scene(options);
    const PrecisionTrace finest = known_to(scene, experiment, orders);
    compare(scene, reference_of(finest), options, experiment, progress);
  }
  experiment.add_table(std::move(orders));
  if (!interrupted()) {
    evaluate_precision_stack({options.stack_file, options.pile_files, options.assignments, options.quick}, experiment,
                             progress);
  }
  if (!interrupted()) {
    evaluate_precision_pile({options.pile_files, options.assignments, options.quick}, experiment, progress);
  }
  progress.clear();
  experiment.note("each result of physics reaches the loop one full period after the hand's sample that it answers");
  experiment.note(
      "force and position along the axis of the push, at the beginning of each cycle; spurious: energy that the hand "
      "received beyond the reference's; the device is simulated with 10 us and without quanta");
}

}  // namespace tools
