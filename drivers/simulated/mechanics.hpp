#pragma once
/// @file mechanics.hpp
/// The mechanics of a simulated device: a point mass at the tip with friction, gravity, a force actuator, encoders, and
/// a hand that may hold it. Frame D, SI units, time in integer nanoseconds.
///
/// One step of h seconds, v the velocity, p the momentum that everything but friction would leave:
///
///     (m + m_h + h b + h B_h + h² K_h) v* = p = (m + m_h) v + h (F + m g + K_h (x_h − x) + B_h v_h)
///     |p| ≤ h f_c:  v' = 0                      (dry friction holds: exactly, without creep)
///     otherwise:    v' = (1 − h f_c/|p|) v*     (and opposes the motion: isotropic, in impulse form)
///     x' = x + h v'
///
/// Semi-implicit Euler: viscosity and the hand's spring-damper (K_h, B_h, taken at the step's end x_h, v_h) are
/// implicit, so no hand is too stiff for the step; the price is an extra damping of about h K_h/2, under 1 % of the
/// presets'. A spring force beyond the hand's limit acts as a constant force of that size instead. First order in h.
#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "drivers/simulated/hand.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::simulated {

struct MechanicsParameters {
  double mass_kg = 0.041;                                       ///< Apparent mass at the tip.
  double viscous_n_s_per_m = 0.05;                              ///< b.
  double coulomb_n = 0.06;                                      ///< f_c: a smaller force moves nothing at rest.
  Eigen::Vector3d gravity_m_s2 = Eigen::Vector3d(0, -9.81, 0);  ///< Acts on mass_kg; zero for a balanced arm.
  double max_force_n = 7.9;                                     ///< The actuator saturates here (norm; direction kept).
  double force_step_n = 0.0;                                    ///< Resolution of the actuator per axis; 0: none.
  double position_quantum_m = 0.0;                              ///< Encoder step per axis; 0: none.
  std::uint64_t sample_jitter_ns = 0;  ///< measure() looks back 0…this, uniformly. At most 1 ms.
  std::uint64_t jitter_seed = 1;
  std::uint64_t step_ns = 100'000;  ///< h, 10…500 µs.
  bool end_stops = true;            ///< The workspace's faces stop the tip, inelastically.
  Eigen::Vector3d workspace_min_m = Eigen::Vector3d::Constant(-0.06);
  Eigen::Vector3d workspace_max_m = Eigen::Vector3d::Constant(0.06);
  Eigen::Vector3d start_position_m = Eigen::Vector3d::Zero();
};

/// Makes `force_n` one that a device may be given: zero when not finite, at most `limit_n` long, direction kept.
/// False when it had to be changed. @realtime Yes.
bool limit_force(double limit_n, Eigen::Vector3d& force_n) noexcept RTBUS_NONBLOCKING;

/// One thread at a time. Everything but construction is realtime-safe and bounded.
class Mechanics {
 public:
  /// advance_to() simulates at most this much at once; what is longer is skipped and counted.
  static constexpr std::uint64_t kMaxCatchUpNs = 1'000'000'000;
  /// For set_force(): the force acts until the next one.
  static constexpr std::uint64_t kNever = ~std::uint64_t{0};

  Mechanics(const MechanicsParameters& parameters, Hand hand);

  /// At rest at the start position, no force, at `now_ns`. The hand waits at the beginning of its script.
  void reset(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// The hand's script begins (again) at `now_ns`.
  void begin_script(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// Lets the time up to `now_ns` pass with the force held: as many whole steps as fit; the rest waits for the next
  /// call, so that calls in any pieces give the same states bit by bit. A time before the present one changes nothing.
  void advance_to(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// The actuator's force from the present step on, until `expires_ns`, when it goes to zero by itself (within a step).
  /// Saturated to max_force_n with its direction kept, then rounded to force_step_n; a non-finite force counts as zero.
  /// False when the force had to be saturated or refused.
  bool set_force(const Eigen::Vector3d& force_n, std::uint64_t expires_ns) noexcept RTBUS_NONBLOCKING;

  /// Ends a force whose time is over at `now_ns` without waiting for the next step.
  void expire_force(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
    if (now_ns < force_expires_ns_) return;
    force_n_.setZero();
    timed_out_ = true;
  }

  /// What the encoders show at `now_ns` (not before the time reached): position, jittered in time, rounded to quanta.
  /// Between steps the tip is taken to coast. Draws one number of the jitter generator when there is jitter.
  [[nodiscard]] Eigen::Vector3d measure(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// Puts the tip somewhere with a velocity. For tests and experiments.
  void place(const Eigen::Vector3d& position_m, const Eigen::Vector3d& velocity_m_s) noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] const Eigen::Vector3d& position_m() const noexcept { return position_m_; }
  [[nodiscard]] const Eigen::Vector3d& velocity_m_s() const noexcept { return velocity_m_s_; }
  /// The actuator's force on the tip.
  [[nodiscard]] const Eigen::Vector3d& applied_force_n() const noexcept { return force_n_; }
  /// The hand's force on the tip over the last step, the inertia of the hand's mass included.
  [[nodiscard]] const Eigen::Vector3d& hand_force_n() const noexcept { return hand_force_n_; }
  /// Work of the actuator's force on the tip since reset() [J], over the way that the tip really went.
  [[nodiscard]] double actuator_work_j() const noexcept { return actuator_work_j_; }
  [[nodiscard]] std::uint32_t buttons() const noexcept { return hand_.buttons(elapsed_ns(time_ns_)); }
  /// True while the actuator is at zero because no force came in time (also before the first one).
  [[nodiscard]] bool timed_out() const noexcept { return timed_out_; }
  /// Time reached, in whole steps since reset().
  [[nodiscard]] std::uint64_t time_ns() const noexcept { return time_ns_; }
  /// Time that was not simulated because a gap was longer than kMaxCatchUpNs.
  [[nodiscard]] std::uint64_t skipped_ns() const noexcept { return skipped_ns_; }
  [[nodiscard]] const MechanicsParameters& parameters() const noexcept { return parameters_; }

 private:
  static constexpr std::size_t kHistory = 128;  // the longest jitter (1 ms) at the shortest step (10 µs) fits

  void step() noexcept RTBUS_NONBLOCKING;
  void stop_at_ends() noexcept RTBUS_NONBLOCKING;
  void remember() noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] Eigen::Vector3d slowed(const Eigen::Vector3d& momentum, double inertia_kg) const noexcept;
  [[nodiscard]] Eigen::Vector3d position_at(std::uint64_t time_ns) const noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] std::uint64_t elapsed_ns(std::uint64_t time_ns) const noexcept {
    return script_running_ && time_ns > script_start_ns_ ? time_ns - script_start_ns_ : 0;
  }

  MechanicsParameters parameters_;
  Hand hand_;
  double step_s_;

  std::uint64_t time_ns_ = 0;
  std::uint64_t script_start_ns_ = 0;
  bool script_running_ = false;
  Eigen::Vector3d position_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d force_n_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d hand_force_n_ = Eigen::Vector3d::Zero();
  double actuator_work_j_ = 0.0;
  std::uint64_t force_expires_ns_ = kNever;
  bool timed_out_ = true;
  std::uint64_t skipped_ns_ = 0;
  std::uint64_t random_state_ = 0;
  std::array<Eigen::Vector3d, kHistory> history_m_;  ///< Positions at the ends of the last steps.
  std::uint64_t steps_ = 0;  ///< Since reset() or place(): the newest is history_m_[steps_ % kHistory].
};

}  // namespace drivers::simulated
