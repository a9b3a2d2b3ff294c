/// `rtbus tune`: gains that a device bears at given rates on this machine, from theory and from the same code as runs
/// it.
#include <unistd.h>

#include <yaml-cpp/yaml.h>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "haptic_node/rendering/registry.hpp"
#include "rtbus/config/document.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/cli/common/text_table.hpp"
#include "tools/cli/host/wakeup_probe.hpp"
#include "tools/evaluation/commands.hpp"
#include "tools/evaluation/tune/tune_search.hpp"

namespace tools {

namespace {

struct TuneOptions {
  std::string device;
  TuneQuestion question;
  double measure_s = 2.0;
  bool json = false;
};

std::string figure(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3g", value);
  return value >= 1000.0 ? std::to_string(std::lround(value)) : text;
}

/// A file, or a model: config/devices/sim_MODEL.yaml.
std::string device_file(const std::string& named) {
  if (std::filesystem::exists(named)) {
    if (const auto driver = YAML::LoadFile(named)["driver"]; driver && driver.as<std::string>() != "simulated") {
      throw rtbus::config::Error(
          named + ": driver " + driver.as<std::string>() +
          " moves a real device, and this search goes on until it oscillates; name its simulated "
          "twin (config/devices/sim_*.yaml)");
    }
    return std::filesystem::absolute(named).string();
  }
  if (named.find('/') == named.npos && !named.ends_with(".yaml")) return find_config("devices/sim_" + named + ".yaml");
  throw rtbus::config::Error(named + " is not there; name a device file, or a model (phantom_desktop, falcon …)");
}

nlohmann::ordered_json json_of(const TuneQuestion& question, const WakeupFigures& wakeup, const TuneAnswer& answer) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const TuneRow& row : answer.rows) {
    rows.push_back({{"damping_time_s", row.damping_time_s},
                    {"none_n_per_m", row.none_n_per_m},
                    {"normal_n_per_m", row.normal_n_per_m},
                    {"firm_n_per_m", row.firm_n_per_m}});
  }
  const DeviceFigures& device = answer.device;
  return {{"schema", "rtbus-tune/1"},
          {"device",
           {{"file", question.device_file},
            {"model", device.model},
            {"mass_kg", device.mass_kg},
            {"viscous_n_s_per_m", device.viscous_n_s_per_m},
            {"coulomb_n", device.coulomb_n},
            {"position_quantum_m", device.quantum_m},
            {"max_force_n", device.max_force_n},
            {"max_stiffness_n_per_m", device.max_stiffness_n_per_m}}},
          {"method", question.method},
          {"haptic_hz", question.haptic_hz},
          {"physics_hz", question.physics_hz},
          {"delay_us", question.delay_us},
          {"scheduling", wakeup.grant.scheduling()},
          {"stiffest_settled", rows},
          {"advised",
           {{"stiffness_n_per_m", answer.stiffness_n_per_m},
            {"damping_n_s_per_m", answer.damping_n_s_per_m},
            {"margin", kTuneMargin}}},
          {"theory_at_advised_damping",
           {{"passivity_n_per_m", answer.theory.passivity_n_per_m},
            {"friction_n_per_m", answer.theory.friction_n_per_m},
            {"linear_n_per_m", answer.theory.linear_n_per_m}}},
          {"free_air",
           {{"drag_n_s_per_m", answer.air.drag_n_s_per_m},
            {"predicted_drag_n_s_per_m", answer.air.predicted_drag_n_s_per_m},
            {"ripple_n", answer.air.ripple_n},
            {"predicted_ripple_n", answer.air.predicted_ripple_n}}}};
}

void print(const TuneQuestion& question, const WakeupFigures& wakeup, const TuneAnswer& answer) {
  const DeviceFigures& d = answer.device;
  std::printf("%s: %s kg, friction %s N and %s N.s/m, encoder step %s um, at most %s N and %s N/m at %s Hz\n",
              d.model.c_str(), figure(d.mass_kg).c_str(), figure(d.coulomb_n).c_str(),
              figure(d.viscous_n_s_per_m).c_str(), figure(1e6 * d.quantum_m).c_str(), figure(d.max_force_n).c_str(),
              figure(d.max_stiffness_n_per_m).c_str(), figure(question.haptic_hz).c_str());
  std::printf("%s, physics at %s Hz and one period late, wake-up p99 %s us here (%s)\n\n", question.method.c_str(),
              figure(question.physics_hz).c_str(), figure(question.delay_us).c_str(), wakeup.grant.scheduling());
  TextTable table({{"B/K [ms]", TextTable::Align::kRight},
                   {"nobody [N/m]", TextTable::Align::kRight},
                   {"hand 300 N/m", TextTable::Align::kRight},
                   {"hand 700 N/m", TextTable::Align::kRight}});
  for (const TuneRow& row : answer.rows) {
    const auto cell = [&](double k) {
      return k >= 0.999 * d.max_stiffness_n_per_m ? figure(k) + " (limit)" : k > 0.0 ? figure(k) : "none";
    };
    table.add(
        {figure(1e3 * row.damping_time_s), cell(row.none_n_per_m), cell(row.normal_n_per_m), cell(row.firm_n_per_m)});
  }
  std::printf("Stiffest wall that comes to rest (within 0.05 N or two encoder steps):\n");
  for (const std::string& line : table.lines()) std::printf("  %s\n", line.c_str());
  if (answer.stiffness_n_per_m <= 0.0) {
    std::printf("\nNo gain settles with every hand; raise the rate of physics, or take another method.\n");
    return;
  }
  std::printf("\nAdvice, %g of the best row:\n  coupling: {stiffness_n_per_m: %s, damping_n_s_per_m: %s}\n",
              kTuneMargin, figure(answer.stiffness_n_per_m).c_str(), figure(answer.damping_n_s_per_m).c_str());
  std::printf(
      "Theory at that damping: passive below %s N/m (Colgate & Schenkel: no friction, no hand), free of limit cycles\n"
      "below %s (Abbott & Okamura), linearly stable below %s (Gil, Sanchez, Hulin). Friction and hand do the rest.\n",
      figure(answer.theory.passivity_n_per_m).c_str(), figure(answer.theory.friction_n_per_m).c_str(),
      figure(answer.theory.linear_n_per_m).c_str());
  std::printf(
      "Free air at 0.1 m/s: drag %s N.s/m (predicted %s), ripple %s N peak to peak (encoder steps alone: %s).\n",
      figure(answer.air.drag_n_s_per_m).c_str(), figure(answer.air.predicted_drag_n_s_per_m).c_str(),
      figure(answer.air.ripple_n).c_str(), figure(answer.air.predicted_ripple_n).c_str());
}

int tune(TuneOptions& options) {
  try {
    options.question.wall_file = find_config("wall.yaml");
    options.question.device_file = device_file(options.device);
    const bool bar = ::isatty(STDERR_FILENO) == 1 && !options.json;
    RunProgress progress(bar, false);
    WakeupFigures wakeup;
    if (options.measure_s > 0.0) {
      wakeup = probe_wakeup({.rate_hz = options.question.haptic_hz, .duration_s = options.measure_s},
                            [&](double share) { progress.show_share(0.2 * share, "this machine's wake-up latency"); });
      options.question.delay_us = wakeup.p99_us;
    }
    const TuneAnswer answer = search_gains(options.question, [&](double share) {
      progress.show_share(0.2 + 0.8 * share, "stiffest wall that settles");
      return !interrupted();
    });
    progress.clear();
    if (interrupted()) return kExitFailed;
    if (options.json) {
      std::cout << json_of(options.question, wakeup, answer).dump(2) << '\n';
    } else {
      print(options.question, wakeup, answer);
    }
    return answer.stiffness_n_per_m > 0.0 ? kExitFine : kExitFailed;
  } catch (const YAML::Exception& error) {
    std::cerr << options.device << ": " << error.what() << '\n';
    return kExitUsage;
  } catch (const rtbus::config::Error& error) {
    std::cerr << error.what() << '\n';
    return kExitUsage;
  }
}

}  // namespace

Action add_tune(rtbus::Command command) {
  auto options = std::make_shared<TuneOptions>();
  options->question.method = "remote_virtual_coupling";
  std::vector<std::string> methods;
  for (const haptic::MethodEntry& row : haptic::registered_methods()) methods.emplace_back(row.name);
  command
      .option("--device", options->device,
              "Simulated device: a file, or its model (phantom_desktop, phantom_omni, falcon). For a real one name "
              "its simulated twin")
      .required();
  command.option("--physics-rate", options->question.physics_hz, "Results of physics [Hz]; each comes a period late")
      .required()
      .range(0.5, 1000.0);
  command.option("--rate", options->question.haptic_hz, "Of the haptic loop [Hz]").range(500.0, 10000.0).show_default();
  command.option("--method", options->question.method, "Method").one_of(methods).show_default();
  command.option("--measure", options->measure_s, "Length of the wake-up measurement [s]; 0: none, delay 0")
      .range(0.0, 600.0)
      .show_default();
  command.flag("--json", options->json, "As JSON, schema rtbus-tune/1");
  command.footer(
      "Measures how late a realtime thread wakes up here, then runs the node's own code against a wall under a "
      "simulated\n"
      "clock: dropped by nobody, pushed by a soft and by a firm hand, stiffer and stiffer. docs/safety.md says what "
      "else\n"
      "protects the hand.");
  return [options] { return tune(*options); };
}

}  // namespace tools
