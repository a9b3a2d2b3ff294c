#include "tools/evaluation/worst_physics/worst_case.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "drivers/simulated/simulated_device.hpp"
#include "haptic_node/safety.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/eigen.hpp"

namespace tools {

namespace {

using Eigen::Vector3d;

constexpr std::uint64_t kStart_ns = rtbus::kNsPerS;  // of the harness
constexpr double kOverspeedCutoff_hz = 100.0;        // haptic_node/safety.cpp
/// A force that differs by less is the same to a hand.
constexpr double kSameForce_n = 0.05;
constexpr double kSameForceShare = 0.1;
/// Rounding of the slew limit's sums, and of the actuators' steps.
constexpr double kRounding_n = 1e-6;

/// The hand taps on the wall once a second.
std::vector<std::string> assignments_of(const HostilePlan& plan) {
  std::string hand = "{type: none}";
  if (plan.hand_n_per_m > 0.0) {
    hand =
        "{type: sinusoid, centre_m: [0, 0.002, 0], amplitude_m: [0, 0.006, 0], frequency_hz: 1.0, max_force_n: 20, "
        "stiffness_n_per_m: " +
        std::to_string(plan.hand_n_per_m) + ", damping_n_s_per_m: " + std::to_string(plan.hand_n_s_per_m) +
        ", mass_kg: " + std::to_string(plan.hand_kg) + "}";
  }
  return {"haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: " + hand + "}",
          "haptic.0.method=" + plan.method,
          "haptic.0.coupling={stiffness_n_per_m: " + std::to_string(plan.stiffness_n_per_m) +
              ", damping_n_s_per_m: " + std::to_string(plan.damping_n_s_per_m) + "}"};
}

struct Run {
  Run(const HostilePlan& plan, const std::string& session_file)
      : session(rtbus::config::load_session(session_file, parsed(plan))), harness(session, HarnessOptions{}) {}
  static std::vector<rtbus::config::Override> parsed(const HostilePlan& plan) {
    std::vector<rtbus::config::Override> out;
    for (const std::string& text : assignments_of(plan)) out.push_back(rtbus::config::parse_override(text));
    return out;
  }
  [[nodiscard]] drivers::simulated::Mechanics& mechanics() {
    return static_cast<drivers::simulated::SimulatedDevice&>(harness.device()).mechanics();
  }
  rtbus::config::SessionConfig session;
  Harness harness;
};

std::vector<Vector3d> last_second(std::vector<Vector3d> forces_n) {
  const auto before = static_cast<double>(forces_n.size()) * kRecovery_s / (kRecovery_s + 1.0);
  forces_n.erase(forces_n.begin(), forces_n.begin() + static_cast<std::ptrdiff_t>(before));
  return forces_n;
}

/// Where a tip is at the end of a tick, and how fast.
struct Tip {
  Vector3d position_m, velocity_m_s;
};

/// The last second's forces of a loop that met nothing but honest physics, while its tip goes the same way: a soft hand
/// swings for seconds once it has been thrown, and that is no lie. Within a second it is led to where that way begins.
std::vector<Vector3d> honest_second(const HostilePlan& plan, const WorstSetup& setup, std::span<const Tip> way) {
  Run run(plan, setup.session_file);
  run.harness.run(1.0, nullptr);
  std::vector<Vector3d> out;
  constexpr double kLead_s = 1.0;
  const Vector3d from_m = run.mechanics().position_m();
  const Vector3d lead_m_s = (way.front().position_m - from_m) / kLead_s;
  double lead_s = 0.0;
  run.harness.run(kLead_s, [&](const rtbus::Telemetry&) {
    lead_s += 1e-9 * static_cast<double>(run.harness.config().period_ns());
    run.mechanics().place(from_m + lead_s * lead_m_s, lead_m_s);
  });
  std::size_t next = 0;
  run.harness.run(kRecovery_s + 1.0, [&](const rtbus::Telemetry& tick) {
    if (next < way.size()) run.mechanics().place(way[next].position_m, way[next].velocity_m_s);
    ++next;
    out.push_back(rtbus::vector_of(tick.force_n));
  });
  return last_second(std::move(out));
}

double rms(const std::vector<Vector3d>& forces_n) {
  double sum = 0.0;
  for (const Vector3d& force : forces_n) sum += force.squaredNorm();
  return forces_n.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(forces_n.size()));
}

/// Looks at each tick.
class Judge {
 public:
  Judge(Run& run, WorstOutcome& out) : run_(run), config_(run.harness.config()), out_(out) {
    out_.growth_bound_n = config_.safety.slew_n_per_ms * 1e-6 * static_cast<double>(config_.period_ns()) + kRounding_n;
    out_.bound_w = power_bound_w(config_, kEnergyWindow_s);
  }
  void look(const rtbus::Telemetry& tick) {
    const Vector3d force_n = rtbus::vector_of(tick.force_n), velocity_m_s = rtbus::vector_of(tick.velocity_m_s);
    const double norm_n = force_n.norm();
    if (!force_n.allFinite()) ++out_.nonfinite;
    if (norm_n > config_.safety.max_force_n * (1.0 + 1e-9)) ++out_.above_limit;
    out_.peak_n = std::max(out_.peak_n, norm_n);
    if (force_n.dot(velocity_m_s) >= 0.0) out_.growth_n = std::max(out_.growth_n, growth_n(last_n_, force_n));
    last_n_ = force_n;
    const bool overspeed = (tick.safety & haptic::kOverspeed) != 0;
    if (overspeed && !overspeed_) ++out_.overspeeds;
    overspeed_ = overspeed;
    square_n2_.push_back((square_n2_.empty() ? 0.0 : square_n2_.back()) + norm_n * norm_n);
    work_j_.push_back(run_.mechanics().actuator_work_j());
    const auto window = static_cast<std::size_t>(kEnergyWindow_s / (1e-9 * static_cast<double>(config_.period_ns())));
    if (work_j_.size() > window) {
      out_.power_w = std::max(out_.power_w, (work_j_.back() - work_j_[work_j_.size() - 1 - window]) / kEnergyWindow_s);
    }
  }
  /// Mean power over the second half of what was seen. A force above the continuous one is lowered to it before a
  /// minute has passed: its power counts in proportion.
  [[nodiscard]] double lasting_power_w() const {
    const std::size_t half = work_j_.size() / 2;
    if (half == 0) return 0.0;
    const std::size_t from = work_j_.size() - half;
    const double seconds = static_cast<double>(half) * 1e-9 * static_cast<double>(config_.period_ns());
    const double rms_n = std::sqrt((square_n2_.back() - square_n2_[from]) / static_cast<double>(half));
    const double lasts = std::min(1.0, config_.safety.continuous_force_n / std::max(rms_n, 1e-9));
    return lasts * (work_j_.back() - work_j_[from]) / seconds;
  }

 private:
  Run& run_;
  const haptic::HapticConfig& config_;
  WorstOutcome& out_;
  Vector3d last_n_ = Vector3d::Zero();
  bool overspeed_ = false;
  std::vector<double> work_j_, square_n2_;  ///< Sums, at each tick.
};

}  // namespace

double growth_n(const Vector3d& before_n, const Vector3d& now_n) {
  const double before2 = before_n.squaredNorm();
  const double left = before2 > 0.0 ? std::clamp(now_n.dot(before_n) / before2, 0.0, 1.0) : 0.0;
  return (now_n - left * before_n).norm();
}

double power_bound_w(const haptic::HapticConfig& config, double window_s) {
  const haptic::SafetyConfig& safety = config.safety;
  const double dt_s = 1e-9 * static_cast<double>(config.period_ns());
  const double warm = std::sqrt((safety.thermal_time_constant_s + window_s) / window_s);
  const double force_n = std::min(safety.max_force_n, warm * safety.continuous_force_n);
  const double delay_s = 1.0 / (2.0 * std::numbers::pi * kOverspeedCutoff_hz) + 2.0 * dt_s;
  return force_n * (safety.overspeed_m_s + safety.max_force_n / config.device->info().apparent_mass_kg * delay_s);
}

WorstOutcome run_worst_case(const std::string& method, std::span<const std::uint64_t> lineage,
                            const WorstSetup& setup) {
  const HostilePlan plan = hostile_plan(method, lineage);
  Run run(plan, setup.session_file);
  WorstOutcome out;
  Judge judge(run, out);
  const auto look = [&judge](const rtbus::Telemetry& tick) { judge.look(tick); };
  const auto until_ns = kStart_ns + static_cast<std::uint64_t>(setup.hostile_s * 1e9);
  HostilePhysics hostile(plan, run.harness.config().stiffness_n_per_m, lineage.back(), until_ns);
  run.harness.tamper([&hostile](Harness::Answer& answer) { hostile.answer(answer); });

  run.harness.run(kTrial_s, look);
  out.answers = hostile.lies();
  out.trial_w = judge.lasting_power_w();
  if (out.trial_w < setup.give_up_below_w && out.forces_hold()) return out;
  run.harness.run(setup.hostile_s - kTrial_s, look);
  std::vector<Vector3d> forces_n;
  std::vector<Tip> way;
  run.harness.run(kRecovery_s + 1.0, [&](const rtbus::Telemetry& tick) {
    if (tick.due_ns < until_ns + static_cast<std::uint64_t>(kRecovery_s * 1e9)) look(tick);
    forces_n.push_back(rtbus::vector_of(tick.force_n));
    way.push_back({run.mechanics().position_m(), run.mechanics().velocity_m_s()});
  });
  out.answers = hostile.lies();

  out.hash = run.harness.hash();
  // A tip that nobody holds stays where the lies have left it, perhaps deep inside the wall, which has no energy to
  // lift it out: there is nothing to compare with.
  if (plan.hand_n_per_m <= 0.0) return out;
  const std::vector<Vector3d> honest_n = honest_second(plan, setup, way);
  std::vector<Vector3d> differences_n = last_second(std::move(forces_n));
  for (std::size_t i = 0; i < std::min(differences_n.size(), honest_n.size()); ++i) differences_n[i] -= honest_n[i];
  out.recovery_error_n = rms(differences_n);
  out.recovery_bound_n = kSameForce_n + kSameForceShare * rms(honest_n);
  return out;
}

}  // namespace tools
