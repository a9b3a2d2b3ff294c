#include "tools/evaluation/bench/bench_devices.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "haptic_node/node_config.hpp"
#include "rtbus/config/session.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/evaluation/shared/follow_session.hpp"

namespace tools {

namespace {

constexpr double kTail_s = 0.5;
constexpr double kForceShare = 0.02;

struct Run {
  const char* session;
  const char* what;
};

constexpr Run kRuns[] = {{"wall_virtual_omega", "force_dimension, stand-in for libdrd"},
                         {"wall_virtual_touch", "openhaptics, stand-in for libHD"},
                         {"wall_virtual_inverse3", "haply, stand-in for the service"}};

struct Outcome {
  bool ran = false;
  double p50_us = 0.0, p99_us = 0.0;
  double peak_n = 0.0;
  double held_n = 0.0;
  std::uint64_t ticks = 0;
  std::uint64_t repeated = 0;  ///< Ticks without a new measurement: their force answers an old one.
  MachineLoad load;
};

Outcome follow(const std::string& session_file, const std::string& device, const char* name, double duration_s) {
  FollowSetup setup;
  setup.session_file = session_file;
  setup.name = name;
  setup.duration_s = duration_s;
  if (!device.empty()) setup.assignments.push_back("haptic.0.device=" + device);
  FollowedSession session(setup);
  Outcome out;
  std::vector<double> latency_us;
  std::vector<double> force_n;
  std::uint64_t measured_ns = 0;
  out.ran = session.run([&](const rtbus::Telemetry& tick) {
    if (tick.device_time_ns == 0 || tick.due_ns != tick.device_time_ns) return;
    if (tick.device_time_ns == std::exchange(measured_ns, tick.device_time_ns)) {
      ++out.repeated;
      return;
    }
    latency_us.push_back(tick.wakeup_us + tick.device_us + tick.compute_us);
    const rtbus::Vec3& f = tick.force_n;
    force_n.push_back(std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
  });
  out.load = session.load();
  out.ticks = latency_us.size();
  if (latency_us.empty()) return out;
  std::sort(latency_us.begin(), latency_us.end());
  const auto at = [&](double share) {
    return latency_us[static_cast<std::size_t>(share * double(latency_us.size() - 1))];
  };
  out.p50_us = at(0.50);
  out.p99_us = at(0.99);
  out.peak_n = *std::max_element(force_n.begin(), force_n.end());
  const std::size_t tail = std::min(force_n.size(), static_cast<std::size_t>(kTail_s * 1000.0));
  for (std::size_t i = force_n.size() - tail; i < force_n.size(); ++i) out.held_n += force_n[i] / double(tail);
  return out;
}

/// The simulated device with the mechanics and the hand of a stand-in's file.
std::string simulated_partner(const std::string& session_file) {
  rtbus::config::SessionConfig session = rtbus::config::load_session(session_file);
  const drivers::DeviceInfo info = haptic::read_haptic_config(session, 0).device->info();
  char text[800];
  std::snprintf(
      text, sizeof text,
      "{schema: device/1, driver: simulated, mechanics: {mass_kg: %g, viscous_n_s_per_m: 0.3, coulomb_n: 0.05, "
      "gravity_m_s2: [0, 0, 0], max_force_n: %g, force_step_n: 0, position_quantum_m: %g}, limits: "
      "{continuous_force_n: %g, max_slew_n_per_ms: %g, max_stiffness_n_per_m: %g}, hand: {type: push, "
      "impedance: normal, start_m: [0, 0.012, 0], direction: [0, -1, 0], distance_m: 0.018, speed_m_s: 0.05, "
      "start_s: 1.0}}",
      info.apparent_mass_kg, info.max_force_n, info.position_quantum_m, info.continuous_force_n, info.max_slew_n_per_ms,
      info.max_stiffness_n_per_m);
  return text;
}

}  // namespace

void bench_devices(const BenchDevicesOptions& options, Experiment& experiment) {
  Table table{"sample_to_force",
              {"device", "ticks", "p50 [us]", "p99 [us]", "largest force [N]", "held force [N]", "p50 simulated [us]",
               "p99 simulated [us]", "ticks without a new sample"},
              {}};
  for (const Run& run : kRuns) {
    const std::string file = find_session(run.session);
    const Outcome simulated = follow(file, simulated_partner(file), "bench_simulated", options.duration_s);
    const Outcome device = follow(file, "", "bench_device", options.duration_s);
    if (!simulated.ran || !device.ran) {
      experiment.note(std::string(run.what) + ": the session did not run; see the messages above");
      experiment.check_at_least(std::string(run.session) + ".runs", std::string(run.what) + ": runs", 0.0, "", 1.0);
      continue;
    }
    table.rows.push_back({std::string(run.what), double(device.ticks), device.p50_us, device.p99_us, device.peak_n,
                          device.held_n, simulated.p50_us, simulated.p99_us, double(device.repeated)});
    const auto within = [&](const char* id, const char* what, double value_n, double reference_n) {
      experiment.check_between(std::string(run.session) + id, std::string(run.what) + what, value_n / reference_n, "",
                               1.0 - kForceShare, 1.0 + kForceShare, device.load);
    };
    within(".peak_force", ": largest contact force over the simulated device's", device.peak_n, simulated.peak_n);
    within(".held_force", ": held contact force over the simulated device's", device.held_n, simulated.held_n);
  }
  experiment.add_table(std::move(table));
  experiment.note("sample to force: from the measurement to the end of the cycle that wrote its force, in the node");
  experiment.note("a tick without a new sample repeats the last one; it is counted and has no latency");
}

}  // namespace tools
