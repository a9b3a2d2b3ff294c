#include "tools/evaluation/work_precision/precision_shown.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>

#include "rtbus/eigen.hpp"
#include "tools/cli/common/gnuplot.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/shared/force_profile.hpp"
#include "tools/evaluation/shared/median.hpp"
#include "tools/evaluation/work_precision/precision_stack.hpp"

namespace tools {

namespace {

constexpr double kSlow_hz = 18.0;
constexpr double kPredictionPeriods = 1.5;

/// One tick at full rate; hand, proxy and force in D.
struct WorldTick {
  std::uint64_t time_ns = 0;
  Eigen::Vector3d position_m, velocity_m_s, proxy_m, proxy_m_s, force_n;
  rtbus::ProxyContacts contacts;
};

struct World {
  double stiffness_n_per_m, damping_n_s_per_m;
  haptic::MappingConfig mapping;
  std::size_t from = 0;  ///< Errors count from this tick.
  int axis = 2;
  std::vector<WorldTick> ticks;
};

World record_world(const PrecisionScene& scene) {
  std::vector<rtbus::config::Override> overrides;
  const PrecisionCell cell{"local_contact", kPileRate_hz, kPileRate_hz, kPileRate_hz, 0, false};
  for (const std::string& text : assignments_of(scene, cell)) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(scene.session_file, overrides);
  Harness harness(session, {});
  World out{harness.config().stiffness_n_per_m,
            harness.config().damping_n_s_per_m,
            harness.config().mapping,
            static_cast<std::size_t>(scene.from_s * kPileRate_hz),
            scene.axis,
            {}};
  rtbus::ProxyContacts contacts;
  harness.observe_contacts([&](const rtbus::ProxyContacts& answer) { contacts = answer; });
  harness.run(scene.until_s, [&](const rtbus::Telemetry& tick) {
    out.ticks.push_back({tick.device_time_ns, rtbus::vector_of(tick.position_m), rtbus::vector_of(tick.velocity_m_s),
                         rtbus::vector_of(tick.proxy_position_m), rtbus::vector_of(tick.proxy_velocity_m_s),
                         rtbus::vector_of(tick.rendered_force_n), contacts});
  });
  return out;
}

Eigen::Vector3d coupling_n(const World& world, const WorldTick& tick, double ahead_s) {
  return world.stiffness_n_per_m * (tick.proxy_m + ahead_s * tick.proxy_m_s - tick.position_m) +
         world.damping_n_s_per_m * (tick.proxy_m_s - tick.velocity_m_s);
}

/// How far a method is from the force that was there, over time, and how rough it is itself.
struct Shown {
  double error_rms_n = 0.0, error_peak_n = 0.0;
  Roughness error, force;
};

Shown show_world(const World& world, const haptic::MethodEntry& method, double physics_hz) {
  const haptic::Mapping mapping(world.mapping);
  const auto instance = method.make({world.stiffness_n_per_m, world.damping_n_s_per_m, mapping, {}, false, 0.1});
  const auto stride = static_cast<std::size_t>(std::llround(kPileRate_hz / physics_hz));
  haptic::RenderInput input;
  input.dt_s = 1.0 / kPileRate_hz;
  Shown out;
  std::vector<double> force_n, errors_n;
  rtbus::ProxyContacts contacts;
  double squares = 0.0;
  for (std::size_t i = 0; i < world.ticks.size(); ++i) {
    const WorldTick& tick = world.ticks[i];
    input.now_ns = input.sample_time_ns = tick.time_ns;
    input.position_m = tick.position_m;
    input.velocity_m_s = tick.velocity_m_s;
    input.proxy.fresh = false;
    input.contacts = nullptr;
    if (i >= stride && i % stride == 0) {
      const WorldTick& answer = world.ticks[i - stride];
      input.proxy.valid = input.proxy.fresh = true;
      ++input.proxy.sequence;
      input.proxy.device_time_ns = answer.time_ns;
      input.proxy.arrived_ns = input.now_ns;
      input.proxy.period_s = static_cast<double>(stride) / kPileRate_hz;
      input.proxy.position_m = answer.proxy_m;
      input.proxy.velocity_m_s = answer.proxy_m_s;
      const double periods = method.server_force == haptic::ServerForce::kPredicted ? kPredictionPeriods : 0.0;
      input.proxy.server_force_n = coupling_n(world, answer, periods * input.proxy.period_s);
      if (method.needs_contacts && answer.contacts.device_sequence != 0) {
        contacts = answer.contacts;
        contacts.step_s = input.proxy.period_s;
        input.contacts = &contacts;
      }
    }
    const Eigen::Vector3d rendered_n = instance->render(input).force_n;
    instance->felt(rendered_n);
    if (i < world.from) continue;
    const Eigen::Vector3d error_n = rendered_n - tick.force_n;
    squares += error_n.squaredNorm();
    out.error_peak_n = std::max(out.error_peak_n, error_n.norm());
    force_n.push_back(rendered_n[world.axis]);
    errors_n.push_back(error_n[world.axis]);
  }
  if (!force_n.empty()) out.error_rms_n = std::sqrt(squares / static_cast<double>(force_n.size()));
  out.force = roughness(force_n, kPileRate_hz);
  out.error = roughness(errors_n, kPileRate_hz);
  return out;
}

double vibration_mn(const Roughness& roughness) { return 1e3 * std::sqrt(roughness.power_above_30hz_n2); }

Table all_rates(const World& world, Experiment& experiment) {
  Table table{"work_precision_stack_shown",
              {"method", "physics [Hz]", "force RMS [N]", "force peak [N]", "error, increments RMS [mN]",
               "error above 30 Hz, RMS [mN]", "increments RMS [mN]", "above 30 Hz, RMS [mN]"},
              {}};
  for (const haptic::MethodEntry& method : haptic::registered_methods()) {
    if (!method.needs_physics) continue;
    double before_n = std::numeric_limits<double>::infinity();
    bool falls = true;
    for (const double rate : {5.0, 18.0, 43.0, 100.0, 250.0, 500.0, 1000.0}) {
      const Shown shown = show_world(world, method, rate);
      table.rows.push_back({std::string(method.name), rate, shown.error_rms_n, shown.error_peak_n,
                            1e3 * shown.error.increment_rms_n, vibration_mn(shown.error),
                            1e3 * shown.force.increment_rms_n, vibration_mn(shown.force)});
      falls = falls && shown.error_rms_n < before_n;
      before_n = shown.error_rms_n;
    }
    if (method.server_force != haptic::ServerForce::kNone) continue;
    experiment.check_between(
        "work-precision.stack.shown." + std::string(method.name),
        "stack, one world shown: the error of " + std::string(method.name) + " falls with every faster rate of physics",
        falls ? 1.0 : 0.0, "1", 1.0, 1.0);
  }
  return table;
}

/// Of one method over the starts: whole error [N], its changes per ms and what lies above 30 Hz [mN].
struct Errors {
  std::vector<double> rms_n, increments_mn, vibration_mn;
};

void add(Errors& errors, const Shown& shown) {
  errors.rms_n.push_back(shown.error_rms_n);
  errors.increments_mn.push_back(1e3 * shown.error.increment_rms_n);
  errors.vibration_mn.push_back(vibration_mn(shown.error));
}

void draw(Experiment& experiment, const Table& shown) {
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) return;
  Figure figure;
  figure.stem = "work_precision_stack";
  figure.body =
      "set title 'One pile of 125 cubes, shown to each method at a lower rate and one period late'\n"
      "set grid lc rgb 'gray80'\nset logscale xy\nset format xy '%g'\nset key top right\n"
      "set xlabel 'results of physics [Hz]; haptic loop at 1 kHz'\nset ylabel 'force error, RMS [N]'\nplot ";
  std::string before;
  int style = 0;
  for (const auto& row : shown.rows) {
    const std::string& method = std::get<std::string>(row[0]);
    if (method == before) continue;
    const std::string file = "work_precision_stack_" + method + ".tsv";
    std::ofstream out(experiment.folder() / file);
    for (const auto& each : shown.rows) {
      if (std::get<std::string>(each[0]) == method)
        out << std::get<double>(each[1]) << '\t' << std::get<double>(each[2]) << '\n';
    }
    figure.body += (before.empty() ? "" : ", \\\n     ") + gnuplot_quoted(file) +
                   " using 1:2 with linespoints ps 1.3 lw 1.5 pt " + std::to_string(7 + 2 * style) + " lc " +
                   std::to_string(1 + style) + " title " + gnuplot_quoted(method);
    ++style;
    before = method;
  }
  figure.body += "\n";
  const auto drawn = gnuplot->draw(experiment.folder(), figure);
  if (!drawn) return experiment.note("no figure " + figure.stem + ": " + drawn.error());
  for (const auto& file : *drawn) experiment.add_figure(file);
}

}  // namespace

Table show_piles(const std::vector<ShownPile>& piles, int starts, Experiment& experiment, RunProgress& progress) {
  Table rates;
  Table slow{"work_precision_pile_shown",
             {"pile", "method", "error, RMS [N]", "error, change per ms [mN]", "error above 30 Hz [mN]",
              "there: change per ms [mN]", "there: above 30 Hz [mN]"},
             {}};
  for (const ShownPile& pile : piles) {
    Errors local, remote;
    std::vector<double> there_mn, there_vibration_mn;
    for (int start = 0; start < starts && !interrupted(); ++start) {
      progress.show_share(static_cast<double>(start) / starts, pile.name + ", one world shown");
      const World world = record_world(pile.scene(start));
      if (rates.rows.empty()) rates = all_rates(world, experiment);
      std::vector<double> force_n;
      for (std::size_t i = world.from; i < world.ticks.size(); ++i) {
        force_n.push_back(world.ticks[i].force_n[world.axis]);
      }
      const Roughness there = roughness(force_n, kPileRate_hz);
      there_mn.push_back(1e3 * there.increment_rms_n);
      there_vibration_mn.push_back(vibration_mn(there));
      add(local, show_world(world, *haptic::find_method("local_contact"), kSlow_hz));
      add(remote, show_world(world, *haptic::find_method("remote_virtual_coupling"), kSlow_hz));
    }
    if (interrupted()) break;
    for (const auto& [name, errors] : {std::pair{"local_contact", &local}, {"remote_virtual_coupling", &remote}}) {
      slow.rows.push_back({pile.name, std::string(name), median(errors->rms_n), median(errors->increments_mn),
                           median(errors->vibration_mn), median(there_mn), median(there_vibration_mn)});
    }
    char text[240];
    std::snprintf(text, sizeof text,
                  "%s, one world shown at 18 Hz: local_contact's error over remote coupling's: RMS %.2f, change per ms "
                  "%.2f, above 30 Hz %.2f (medians of %d starts)",
                  pile.name.c_str(), median(local.rms_n) / median(remote.rms_n),
                  median(local.increments_mn) / median(remote.increments_mn),
                  median(local.vibration_mn) / median(remote.vibration_mn), starts);
    experiment.note(text);
  }
  draw(experiment, rates);
  experiment.add_table(std::move(slow));
  return rates;
}

}  // namespace tools
