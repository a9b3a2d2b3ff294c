#include "tools/evaluation/drop/drop_sweeps.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/shared/set_hand.hpp"

namespace tools {

namespace {

constexpr int kPhases = 40;
constexpr int kSensitivityPhases = 8;
constexpr double kRelease_s = 0.5;
const char* const kNoQuantum = "haptic.0.device.mechanics.position_quantum_m=0";

/// Period of the server in this session: what a phase is a part of.
double period_s(const FallSetup& setup) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : setup.assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(setup.session_file, overrides);
  return session.physics ? physics::read_node_config(session).physics.step_s() : 0.0;
}

/// Falls at `phases` phases of the server. Its own settings come before `--set`, so that the user has the last word.
CellShares falls(const DropOptions& options, const DropCase& each, const std::vector<std::string>& settings, int phases,
                 double latency_s) {
  DropOptions varied = options;
  varied.assignments = settings;
  varied.assignments.insert(varied.assignments.end(), options.assignments.begin(), options.assignments.end());
  const FallSetup setup = drop_setup(varied, each, kRelease_s);
  const double period = period_s(setup);
  CellShares shares;
  for (int phase = 0; phase < phases && !interrupted(); ++phase) {
    HarnessOptions link;
    link.latency_s = latency_s;
    link.physics_phase_s = period * phase / phases;
    shares.add(judge_fall(fall_in_harness(setup, link), drop_limits(each)));
  }
  return shares;
}

/// A row per value, a column per published case.
Table sweep(const DropOptions& options, std::string name, std::string column, const std::vector<double>& values,
            const std::vector<std::string>& fixed, const char* key) {
  Table table{std::move(name), {std::move(column)}, {}};
  for (const DropCase& each : drop_cases()) {
    char text[80];
    std::snprintf(text, sizeof text, "%s K=%g", each.method, each.stiffness_n_per_m);
    table.columns.emplace_back(text);
  }
  for (const double value : values) {
    std::vector<std::string> settings = fixed;
    settings.push_back(set_hand(key, value));
    std::vector<Cell> row{value};
    for (const DropCase& each : drop_cases()) {
      row.emplace_back(falls(options, each, settings, kSensitivityPhases, 0.0).text());
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// Peak of the method's force while a hand moves up and down by 10 mm in free air, once a second: "0.31 N", or when it
/// went beyond what the device can give.
std::string hand_in_free_air(const DropOptions& options, std::vector<std::string> settings) {
  settings.insert(settings.begin(), "scene.bodies.wall.position_m=[0, -10, 0]");  // it must not catch the proxy
  settings.insert(
      settings.begin(),
      "haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: sinusoid, "
      "centre_m: [0, 0.03, 0], amplitude_m: [0, 0.01, 0], frequency_hz: 1, impedance: firm}}");
  settings.insert(settings.end(), options.assignments.begin(), options.assignments.end());
  const FallTrace trace = fall_in_harness({options.session_file, settings, 4.0}, {});
  double peak_n = 0.0;
  char text[64];
  for (std::size_t i = 0; i < trace.time_s.size(); ++i) {
    peak_n = std::max(peak_n, std::abs(trace.rendered_n[i]));
    if (peak_n > trace.max_force_n) {
      std::snprintf(text, sizeof text, "diverged at %.2f s", trace.time_s[i]);
      return text;
    }
  }
  std::snprintf(text, sizeof text, "%.2f N", peak_n);
  return text;
}

/// The server's spring alone: remote coupling at 50 packets per second, explicit and implicit.
Table server_spring(const DropOptions& options) {
  Table table{"drop_server_spring",
              {"proxy stiffness [N/m]", "h*B/m", "explicit (form: paper)", "implicit (form: improved)"},
              {}};
  for (const double stiffness : {50.0, 100.0, 150.0, 200.0, 250.0, 300.0, 500.0, 1000.0}) {
    constexpr double kMass_kg = 0.07, kRatio = 0.85, kStep_s = 0.02;
    const double damping = 2.0 * kRatio * std::sqrt(stiffness * kMass_kg);
    std::vector<std::string> settings{
        "haptic.0.method=remote_virtual_coupling",      set_hand("coupling.stiffness_n_per_m", 100.0),
        set_hand("link_rate_hz", 1.0 / kStep_s),        set_hand("proxy.mass_kg", kMass_kg),
        set_hand("proxy.stiffness_n_per_m", stiffness), set_hand("proxy.damping_n_s_per_m", damping)};
    std::vector<Cell> row{stiffness, kStep_s * damping / kMass_kg, hand_in_free_air(options, settings)};
    settings.emplace_back("haptic.0.form=improved");
    settings.emplace_back("physics.step_on=packet");
    row.emplace_back(hand_in_free_air(options, settings));
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// The improved form: every step of a 1 kHz physics published at once, implicit spring, relative damping, passivity.
Table improved(const DropOptions& options) {
  Table table{"drop_improved_form", {"method", "K = 100 N/m", "K = 500 N/m", "K = 1000 N/m"}, {}};
  for (const char* method :
       {"direct", "virtual_coupling", "remote_virtual_coupling", "interpolation", "interpolation_predicted"}) {
    std::vector<Cell> row{std::string(method)};
    for (const double stiffness : {100.0, 500.0, 1000.0}) {
      const DropCase each{"", "", method, stiffness, 1e-4 * stiffness, "", Outcome::kSettled, 0, 0, 4.0};
      const std::vector<std::string> settings{"haptic.0.form=improved", "haptic.0.link_rate_hz=null",
                                              "physics.step_on=clock", set_hand("prediction_periods", 1.0)};
      row.emplace_back(falls(options, each, settings, kSensitivityPhases, 0.0).text());
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace

void CellShares::add(const FallFigures& figures) {
  ++runs;
  switch (figures.outcome) {
    case Outcome::kSettled:
      ++settled;
      settling_s.push_back(figures.settling_s);
      rest_mm.push_back(figures.rest_m * 1e3);
      break;
    case Outcome::kOscillating:
      ++oscillating;
      break;
    case Outcome::kDiverged:
      ++diverged;
      break;
    case Outcome::kNoFall:
      ++no_fall;
      break;
  }
}

int CellShares::count(Outcome outcome) const noexcept {
  switch (outcome) {
    case Outcome::kSettled:
      return settled;
    case Outcome::kOscillating:
      return oscillating;
    case Outcome::kDiverged:
      return diverged;
    case Outcome::kNoFall:
      return no_fall;
  }
  return 0;
}

std::string CellShares::text() const {
  std::string out;
  for (const Outcome each : {Outcome::kSettled, Outcome::kOscillating, Outcome::kDiverged, Outcome::kNoFall}) {
    if (count(each) == 0) continue;
    char part[64];
    if (each == Outcome::kSettled) {
      std::vector<double> sorted = settling_s;
      std::sort(sorted.begin(), sorted.end());
      std::snprintf(part, sizeof part, "settled %.2f s", sorted[sorted.size() / 2]);
    } else {
      std::snprintf(part, sizeof part, "%s", to_string(each));
    }
    out += (out.empty() ? "" : ", ") + std::string(part);
    if (count(each) < runs) out += " (" + std::to_string(count(each)) + "/" + std::to_string(runs) + ")";
  }
  return out.empty() ? "-" : out;
}

CellShares sweep_cells(const DropOptions& options, const DropCase& each, Table& cells, double& worst_share) {
  CellShares all;
  for (const double latency_s : {0.0, 0.001, 0.002}) {
    for (const bool encoder : {false, true}) {
      const std::vector<std::string> settings =
          encoder ? std::vector<std::string>{} : std::vector<std::string>{kNoQuantum};
      const CellShares cell = falls(options, each, settings, kPhases, latency_s);
      cells.rows.push_back({std::string(each.id), latency_s * 1e3, std::string(encoder ? "23 um" : "exact"),
                            static_cast<double>(cell.settled), static_cast<double>(cell.oscillating),
                            static_cast<double>(cell.diverged), static_cast<double>(cell.runs)});
      if (cell.runs > 0) worst_share = std::min(worst_share, static_cast<double>(cell.count(each.outcome)) / cell.runs);
      all.runs += cell.runs;
      all.settled += cell.settled;
      all.oscillating += cell.oscillating;
      all.diverged += cell.diverged;
      all.no_fall += cell.no_fall;
      all.settling_s.insert(all.settling_s.end(), cell.settling_s.begin(), cell.settling_s.end());
      all.rest_mm.insert(all.rest_mm.end(), cell.rest_mm.begin(), cell.rest_mm.end());
    }
  }
  return all;
}

FallTrace representative_fall(const DropOptions& options, const DropCase& each) {
  HarnessOptions link;
  link.physics_phase_s = 0.3e-3;
  return fall_in_harness(drop_setup(options, each, kRelease_s), link);
}

std::vector<Table> drop_sensitivity(const DropOptions& options) {
  std::vector<Table> out;
  out.push_back(
      sweep(options, "drop_link_rate", "packets per second [Hz]", {50, 100, 200, 250, 500}, {}, "link_rate_hz"));
  out.push_back(sweep(options, "drop_horizon", "horizon [periods]", {0, 0.5, 1.0, 1.2, 1.3, 1.4, 1.5, 2.0}, {},
                      "prediction_periods"));
  out.push_back(sweep(options, "drop_friction", "Coulomb friction [N]", {0.04, 0.05, 0.055, 0.06, 0.065, 0.07, 0.08},
                      {}, "device.mechanics.coulomb_n"));
  out.push_back(server_spring(options));
  out.push_back(improved(options));
  return out;
}

}  // namespace tools
