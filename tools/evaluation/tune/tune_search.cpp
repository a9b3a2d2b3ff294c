#include "tools/evaluation/tune/tune_search.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "haptic_node/safety.hpp"
#include "rtbus/eigen.hpp"
#include "tools/harness/harness.hpp"

namespace tools {

namespace {

constexpr double kSoftest_n_per_m = 10.0;
constexpr int kSteps = 12;        // of the scan from the softest to what the device renders
constexpr int kHalvings = 4;      // of the step in which it ends
constexpr double kBand_n = 0.05;  // peak to peak, at rest
constexpr double kEnd_s = 2.5;
constexpr double kTail_s = 0.5;
constexpr double kAirSpeed_m_s = 0.1;

const char* const kNobody = "{type: drop, position_m: [0, 0.02, 0], release_s: 0.3}";
const char* const kNormal =
    "{type: push, impedance: normal, start_m: [0, 0.01, 0], direction: [0, -1, 0], distance_m: 0.015, speed_m_s: 0.05, "
    "start_s: 0.3}";
const char* const kFirm =
    "{type: push, impedance: firm, start_m: [0, 0.01, 0], direction: [0, -1, 0], distance_m: 0.015, speed_m_s: 0.05, "
    "start_s: 0.3}";
const char* const kAlong =
    "{type: push, impedance: firm, start_m: [-0.03, 0.02, 0], direction: [1, 0, 0], distance_m: 0.06, speed_m_s: 0.1, "
    "start_s: 0.4, ramp_s: 0.05}";

std::unique_ptr<Harness> make_harness(const TuneQuestion& question, double stiffness, double damping,
                                      const char* hand) {
  std::vector<rtbus::config::Override> overrides;
  const auto set = [&](const std::string& text) { overrides.push_back(rtbus::config::parse_override(text)); };
  const auto number = [&](const char* key, double value) {
    char text[120];
    std::snprintf(text, sizeof text, "%s=%.9g", key, value);
    set(text);
  };
  set("haptic.0.device=" + question.device_file);
  set(std::string("haptic.0.device.hand=") + hand);
  number("haptic.0.device.mechanics.sample_jitter_us", std::min(1000.0, question.delay_us));
  set("haptic.0.method=" + question.method);
  number("haptic.0.rate_hz", question.haptic_hz);
  set("haptic.0.proxy={mass_kg: 0.1}");
  char text[120];
  std::snprintf(text, sizeof text, "haptic.0.coupling={stiffness_n_per_m: %.9g, damping_n_s_per_m: %.9g}", stiffness,
                damping);
  set(text);
  number("physics.rate_hz", std::max(1000.0, question.physics_hz));
  if (question.physics_hz < 1000.0) number("physics.throttle_hz", question.physics_hz);
  auto session = rtbus::config::load_session(question.wall_file, overrides);
  return std::make_unique<Harness>(session, HarnessOptions{});
}

/// At rest at the end, and on the way there within what the device can give.
bool settles(const TuneQuestion& question, double stiffness, double damping, const char* hand, double quantum_m) {
  const auto harness = make_harness(question, stiffness, damping, hand);
  const double limit_n = harness->config().safety.max_force_n;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  bool fine = true;
  harness->run(kEnd_s, [&](const rtbus::Telemetry& tick) {
    fine = fine && rtbus::vector_of(tick.rendered_force_n).norm() <= limit_n && (tick.safety & haptic::kOverspeed) == 0;
    if (harness->now_s() < kEnd_s - kTail_s) return;
    low = std::min(low, tick.force_n[1]);
    high = std::max(high, tick.force_n[1]);
  });
  return fine && high - low <= std::max(kBand_n, 2.0 * quantum_m * stiffness);
}

/// The stiffest wall below which every one that was tried settles; 0 when the softest does not.
double stiffest(const TuneQuestion& question, double damping_time_s, const char* hand, const DeviceFigures& device) {
  const auto fine = [&](double k) { return settles(question, k, damping_time_s * k, hand, device.quantum_m); };
  const double factor = std::pow(device.max_stiffness_n_per_m / kSoftest_n_per_m, 1.0 / kSteps);
  double good = 0.0, bad = 0.0;
  for (int i = 0; i <= kSteps && bad == 0.0; ++i) {
    const double k = kSoftest_n_per_m * std::pow(factor, i);
    (fine(k) ? good : bad) = k;
  }
  for (int i = 0; i < kHalvings && bad > 0.0 && good > 0.0; ++i) {
    const double k = std::sqrt(good * bad);
    (fine(k) ? good : bad) = k;
  }
  return good;
}

FreeAir fly(const TuneQuestion& question, double stiffness, double damping, double quantum_m) {
  const auto harness = make_harness(question, stiffness, damping, kAlong);
  std::vector<double> force_n;
  // At full speed, away from both ends of the way, and once physics has caught up.
  const double begin_s = std::min(0.85, 0.47 + 3.0 / question.physics_hz);
  harness->run(1.1, [&](const rtbus::Telemetry& tick) {
    if (harness->now_s() > begin_s && harness->now_s() < 0.98) force_n.push_back(tick.force_n[0]);
  });
  FreeAir out;
  for (const double each : force_n) out.drag_n_s_per_m -= each / kAirSpeed_m_s / static_cast<double>(force_n.size());
  const auto [low, high] = std::minmax_element(force_n.begin(), force_n.end());
  if (!force_n.empty()) out.ripple_n = *high - *low;
  const haptic::MethodEntry* method = haptic::find_method(question.method);
  if (!method->needs_physics || method->needs_contacts) return out;  // no answer of physics holds them back in free air
  // An answer arrives one period after its sample, and the method goes there on a line that takes one period more.
  const double ahead = method->server_force == haptic::ServerForce::kPredicted ? 1.5 : 0.0;  // prediction_periods
  out.predicted_drag_n_s_per_m = (2.0 - ahead) * stiffness / question.physics_hz;
  out.predicted_ripple_n = 2.0 * stiffness * quantum_m;
  return out;
}

}  // namespace

double TuneRow::all_n_per_m() const noexcept { return std::min({none_n_per_m, normal_n_per_m, firm_n_per_m}); }

TheoryLimits theory_limits(const DeviceFigures& device, double damping_n_s_per_m, double haptic_hz, double delay_s) {
  const double period_s = 1.0 / haptic_hz, b = device.viscous_n_s_per_m;
  TheoryLimits out;
  out.passivity_n_per_m = std::max(0.0, 2.0 * (b - std::abs(damping_n_s_per_m)) / period_s);
  out.friction_n_per_m = 2.0 * b / period_s;
  if (device.quantum_m > 0.0) {
    out.friction_n_per_m = std::min(out.friction_n_per_m, 2.0 * device.coulomb_n / device.quantum_m);
  }
  out.linear_n_per_m = (b + damping_n_s_per_m) / (0.5 * period_s + delay_s);
  return out;
}

TuneAnswer search_gains(const TuneQuestion& question, const std::function<bool(double)>& progress) {
  TuneAnswer out;
  {
    const auto harness = make_harness(question, 1e5, 0.0, kNobody);
    const drivers::DeviceInfo& info = harness->config().device->info();
    out.device = {info.model,
                  info.apparent_mass_kg,
                  info.viscous_damping_n_s_per_m,
                  info.coulomb_friction_n,
                  info.position_quantum_m,
                  info.max_force_n,
                  harness->config().stiffness_n_per_m};
  }
  const double ratios_s[] = {0.0, 0.0005, 0.001, 0.002, 0.005};
  int done = 0;
  for (const double ratio_s : ratios_s) {
    TuneRow row{ratio_s};
    const struct {
      const char* hand;
      double TuneRow::*stiffest;
    } hands[] = {
        {kNobody, &TuneRow::none_n_per_m}, {kNormal, &TuneRow::normal_n_per_m}, {kFirm, &TuneRow::firm_n_per_m}};
    for (const auto& each : hands) {
      if (!progress(static_cast<double>(done++) / (3.0 * std::size(ratios_s)))) return out;
      row.*each.stiffest = stiffest(question, ratio_s, each.hand, out.device);
    }
    out.rows.push_back(row);
  }
  // The stiffest row; of equals the one with the least damping, which costs noise.
  const TuneRow* best = &out.rows.front();
  for (const TuneRow& row : out.rows) {
    if (row.all_n_per_m() > 1.02 * best->all_n_per_m()) best = &row;
  }
  out.stiffness_n_per_m = kTuneMargin * best->all_n_per_m();
  out.damping_n_s_per_m = out.stiffness_n_per_m * best->damping_time_s;
  out.theory = theory_limits(out.device, out.damping_n_s_per_m, question.haptic_hz, 1e-6 * question.delay_us);
  if (out.stiffness_n_per_m > 0.0)
    out.air = fly(question, out.stiffness_n_per_m, out.damping_n_s_per_m, out.device.quantum_m);
  return out;
}

}  // namespace tools
