/// Claim k of `rtbus evaluate local-contact`: soft bodies are felt as they are, and a bed of very light ones is calm.
#include <algorithm>
#include <cmath>
#include <span>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/local_contact/hand_run.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/shared/force_profile.hpp"
#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

constexpr double kPressed_s = 1.0;
/// Pressed in by then. Later the rabbit slides out from under a tool without friction; when is chance.
constexpr double kSoftRest_s = 1.9, kSoftEnd_s = 2.15;
constexpr double kBeadsEnd_s = 5.0, kBeadsRest_s = 3.0;
constexpr double kSoftError_n = 0.05;  ///< RMS: a body that creeps under the hand does not do so twice in the same way.
constexpr double kSoftRestShare = 0.03;  ///< Of the force that Bullet's own tool bears.
constexpr double kBeadsCalm_n = 0.02;    ///< RMS above 30 Hz.

std::string pressing_hand(const char* start_m, double distance_m, double speed_m_s = 0.03) {
  return formatted(
      "haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, "
      "start_m: %s, direction: [0, -1, 0], distance_m: %g, speed_m_s: %g, start_s: %g, impedance: light}}",
      start_m, distance_m, speed_m_s, kPressed_s);
}

double mean_n(const HandRun& run, double from_s) {
  Eigen::Vector3d sum_n = Eigen::Vector3d::Zero();
  double count = 0.0;
  for (std::size_t i = 0; i < run.time_s.size(); ++i) {
    if (run.time_s[i] < from_s) continue;
    sum_n += run.force_n[i];
    count += 1.0;
  }
  return (sum_n / std::max(count, 1.0)).norm();
}

double vibration_n(const HandRun& run, double from_s) {
  std::vector<double> up_n;
  for (std::size_t i = 0; i < run.time_s.size(); ++i) {
    if (run.time_s[i] >= from_s) up_n.push_back(run.force_n[i].y());
  }
  return std::sqrt(roughness(up_n, 1000.0).power_above_30hz_n2);
}

std::vector<std::string> with_rate(const char* method, double physics_hz) {
  std::vector<std::string> settings = method_settings(method);
  if (physics_hz > 0.0) settings.push_back(formatted("physics.throttle_hz=%g", physics_hz));
  return settings;
}

/// @param hand A device with it, that presses.
HandRun press_rabbit(const LocalContactOptions& options, const char* method, double physics_hz, const std::string& hand,
                     double end_s) {
  std::vector<std::string> settings = with_rate(method, physics_hz);
  settings.insert(settings.end(),
                  {hand, "haptic.0.mapping={offset_m: [0, 0.048, 0]}",
                   "haptic.0.coupling={stiffness_n_per_m: 300, damping_n_s_per_m: 0.5}", "physics.rate_hz=1000",
                   "haptic.0.proxy={mass_kg: 0.1, radius_m: 0.007, friction: 0}"});
  return run_hand(options, options.config_folder + "/soft.yaml", settings, end_s);
}

/// What a rabbit bears at rest depends on how fast it was pressed. No checks.
Table press_rabbit_at_speeds(const LocalContactOptions& options) {
  constexpr double kDepth_m = 0.006, kRest_s = 2.5, kEnd_s = 3.0;
  Table table{"local_contact_rabbit_speeds",
              {"pressed at [m/s]", "Bullet's own tool [N]", "no latency, over that", "100 Hz", "43 Hz", "18 Hz"},
              {}};
  for (const double speed_m_s : {0.01, 0.015, 0.02, 0.03, 0.04, 0.06}) {
    if (interrupted() || options.quick) break;
    const std::string hand = pressing_hand("[-0.01, 0.006, 0]", 0.006 + kDepth_m, speed_m_s);
    const auto rest_n = [&](const char* method, double physics_hz) {
      return mean_n(press_rabbit(options, method, physics_hz, hand, kEnd_s), kRest_s);
    };
    const double own_n = rest_n(kRemoteCoupling, 0.0);
    table.rows.push_back({speed_m_s, own_n, rest_n(kLocalContact, 0.0) / own_n, rest_n(kLocalContact, 100.0) / own_n,
                          rest_n(kLocalContact, 43.0) / own_n, rest_n(kLocalContact, 18.0) / own_n});
  }
  return table;
}

/// A rabbit is pressed and held, without friction, with which it creeps as it likes. Truth of the
/// motion: the method without latency. Truth of the rest: Bullet's own tool without latency, a body on the same spring.
Panel press_soft(const LocalContactOptions& options, double depth_m, Table& table, Experiment& experiment) {
  const std::string id = formatted("local-contact.yields.soft_%gmm", 1e3 * depth_m);
  const std::string what = formatted("soft rabbit pressed by %g mm", 1e3 * depth_m);
  const auto press = [&](const char* method, double physics_hz) {
    return press_rabbit(options, method, physics_hz, pressing_hand("[-0.01, 0.006, 0]", 0.006 + depth_m), kSoftEnd_s);
  };
  const HandRun truth = press(kLocalContact, 0.0), own = press(kRemoteCoupling, 0.0);
  const double own_n = mean_n(own, kSoftRest_s);
  Panel panel{what + ", physics 18 Hz", "time [s]", "force [N]", {}, {}};
  panel.lines.push_back(hand_line(own, {"Bullet's own tool, no latency", "lc rgb 'black'", {}, {}, false}, kPressed_s));
  const auto add_row = [&](double physics_hz, const std::string& method, const HandRun& felt) {
    const HandError error = hand_error(felt, truth, kPressed_s);
    table.rows.push_back({what, physics_hz, method, error.rms_n, error.peak_n, mean_n(felt, kSoftRest_s),
                          vibration_n(felt, kSoftRest_s)});
    return error;
  };
  add_row(1000.0, std::string(kRemoteCoupling) + ", no latency", own);
  add_row(1000.0, std::string(kLocalContact) + ", no latency", truth);
  experiment.check_between(id + ".rest", what + ", no latency: force at rest over that of Bullet's own tool",
                           mean_n(truth, kSoftRest_s) / own_n, "1", 1.0 - kSoftRestShare, 1.0 + kSoftRestShare);
  for (const double physics_hz : {100.0, 43.0, 18.0}) {
    if (interrupted() || (options.quick && physics_hz != 18.0)) continue;
    for (const char* const method : kAllCompared) {
      const HandRun felt = press(method, physics_hz);
      const HandError error = add_row(physics_hz, method, felt);
      if (physics_hz == 18.0) panel.lines.push_back(hand_line(felt, method_line(method), kPressed_s));
      if (std::string(method) != kLocalContact) continue;
      const std::string at = formatted(".%ghz", physics_hz), where = what + formatted(", physics %g Hz", physics_hz);
      experiment.check_at_most(id + at, where + ": force error, RMS", error.rms_n, "N", kSoftError_n);
      experiment.check_between(id + at + ".rest", where + ": force at rest over that of Bullet's own tool",
                               mean_n(felt, kSoftRest_s) / own_n, "1", 1.0 - kSoftRestShare, 1.0 + kSoftRestShare);
    }
  }
  return panel;
}

/// A tip pokes into beads of 10 mg and stays there.
Panel press_beads(const LocalContactOptions& options, Table& table, Experiment& experiment) {
  const std::string what = "bed of beads of 10 mg";
  Panel panel{what + ", physics 18 Hz", "time [s]", "force [N]", {}, {}};
  const auto press = [&](const char* method, double physics_hz) {
    std::vector<std::string> settings = with_rate(method, physics_hz);
    settings.push_back(pressing_hand("[0, 0.02, 0]", 0.028));
    return run_hand(options, options.config_folder + "/beads_mm.yaml", settings, kBeadsEnd_s);
  };
  for (const double physics_hz : {100.0, 43.0, 18.0}) {
    if (interrupted() || (options.quick && physics_hz == 43.0)) continue;
    for (const char* const method : kAllCompared) {
      const HandRun felt = press(method, physics_hz);
      const double calm_n = vibration_n(felt, kBeadsRest_s);
      table.rows.push_back(
          {what, physics_hz, std::string(method), std::nan(""), std::nan(""), mean_n(felt, kBeadsRest_s), calm_n});
      if (physics_hz == 18.0) panel.lines.push_back(hand_line(felt, method_line(method), kPressed_s));
      if (std::string(method) != kLocalContact) continue;
      experiment.check_at_most(formatted("local-contact.yields.beads.%ghz", physics_hz),
                               what + formatted(", physics %g Hz: RMS above 30 Hz at rest", physics_hz), calm_n, "N",
                               kBeadsCalm_n);
      experiment.check_at_least(formatted("local-contact.yields.beads.%ghz.felt", physics_hz),
                                what + formatted(", physics %g Hz: mean force at rest", physics_hz),
                                mean_n(felt, kBeadsRest_s), "N", 0.1);
    }
  }
  return panel;
}

}  // namespace

void claim_yields(const LocalContactOptions& options, Experiment& experiment) {
  Table table{"local_contact_yields",
              {"scene", "physics [Hz]", "method", "force RMS [N]", "force peak [N]", "force at rest [N]",
               "above 30 Hz at rest, RMS [N]"},
              {}};
  std::vector<Panel> panels;
  for (const double depth_m : {0.006, 0.012, 0.017}) {
    if (interrupted() || (options.quick && depth_m == 0.012)) continue;
    panels.push_back(press_soft(options, depth_m, table, experiment));
  }
  if (!interrupted()) panels.push_back(press_beads(options, table, experiment));
  experiment.add_table(std::move(table));
  if (!options.quick) experiment.add_table(press_rabbit_at_speeds(options));
  draw_panels(experiment, "local_contact_yields", "What yields is pressed at 30 mm/s, and held", panels);
}

}  // namespace tools
