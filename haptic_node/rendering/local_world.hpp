#pragma once
/// @file local_world.hpp
/// The surroundings of the proxy, simulated in the haptic loop between two answers of physics: the proxy, what it may
/// touch, and the bodies behind that. Frame W, SI units. Fixed size, no allocation.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "haptic_node/rendering/contact_solver.hpp"
#include "haptic_node/rendering/hand_impulses.hpp"
#include "haptic_node/rendering/known_shapes.hpp"
#include "haptic_node/rendering/local_body.hpp"
#include "haptic_node/rendering/near_shapes.hpp"
#include "haptic_node/rendering/other_hands.hpp"
#include "haptic_node/rendering/proxy_contact_set.hpp"
#include "haptic_node/rendering/tuning.hpp"
#include "haptic_node/rendering/world_clock.hpp"
#include "haptic_node/rendering/yielding_bodies.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// What pulls the proxy, in W.
struct LocalSpring {
  Eigen::Vector3d goal_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d goal_velocity_m_s = Eigen::Vector3d::Zero();
  double stiffness_n_per_m = 0.0;
  double damping_n_s_per_m = 0.0;
  double force_scale = 1.0;                ///< As MappingConfig::force_scale.
  double resting_damping_n_s_per_m = 0.0;  ///< Damping at least, while the hand rests on a body that forces move.
};

/// One instant of the local world belongs to one device sample; a step leads from the sample before to this one.
///
/// The proxy has no mass. Spring and damper, implicit over a step of h, are the mass m_g = h(hK + B) that moves at
/// (K(x − p) + B·v)/(hK + B) (docs/decisions/0012): in free air it goes with the hand and pulls at nothing, at a
/// contact the hand feels K(p − x) + B(v_p − v), which is what the contacts push with.
///
/// An answer of physics describes the world at the instant of the device sample that it answers (decision 0003). By the
/// time it is here, the local world is one or two periods on. A body is put where physics has it at that instant, and
/// goes on from there to now with the hand impulses since: no error of a prediction outlives its answer. A surface that
/// this moves, or that turns out to be elsewhere, starts where it was felt last and moves to its place within a part of
/// a step (blend.hpp).
class LocalWorld {
 public:
  /// Those of the answer, and a few that are felt still while their contacts recede.
  static constexpr std::size_t kBodies = rtbus::kContactSlots + 4;
  /// @param known Shapes of bodies: their contacts follow it in each step, whatever plane an answer told, and the
  /// supports of boxes are found in each step.
  /// @param other_hands Hands besides this one that may push the same bodies.
  explicit LocalWorld(KnownShapes known = {}, std::size_t other_hands = 0, const Tuning& tuning = {})
      : tuning_(tuning), shapes_(std::move(known), tuning), contacts_(tuning), other_hands_(other_hands) {}

  /// Puts the proxy there, at rest, and forgets everything else. @param sample_ns Of the device sample.
  void reset(const Eigen::Vector3d& proxy_m, std::uint64_t sample_ns) noexcept RTBUS_NONBLOCKING;

  /// What the other hands have done by now. Before take() and advance() of the tick.
  void hear(std::span<const OtherHand> hands, std::uint64_t sample_ns) noexcept RTBUS_NONBLOCKING;

  /// What the proxy would bear in the step of `h` that comes, without the answer that is about to be taken: advance()
  /// eases in what the answer changes in that.
  void foresee(const LocalSpring& spring, std::uint64_t sample_ns, double h) noexcept RTBUS_NONBLOCKING;

  /// An answer has come.
  void take(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// Advances everything by `h` seconds, to the instant `sample_ns`.
  void advance(const LocalSpring& spring, std::uint64_t sample_ns, double h) noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] const Eigen::Vector3d& position_m() const noexcept { return proxy_.position_m; }
  [[nodiscard]] const Eigen::Vector3d& velocity_m_s() const noexcept { return proxy_.velocity_m_s; }
  /// Of all contacts on the proxy in the last step, and what an answer's change of it still lacks.
  [[nodiscard]] const Eigen::Vector3d& impulse_n_s() const noexcept { return impulse_n_s_; }
  /// What kinematic bodies, which move whatever pushes, put into the proxy in the last step, and other hands into free
  /// bodies [J]; negative: took.
  [[nodiscard]] double work_j() const noexcept { return work_j_; }

  /// How far the last answer moved what the proxy touched, against what had been made of it; none: it touched nothing.
  [[nodiscard]] std::optional<double> correction_m() const noexcept { return correction_m_; }

  /// What the hand gave, and gives: in entries() of the last step, in sums that physics is told.
  [[nodiscard]] const HandImpulses& hand_impulses() const noexcept { return impulses_; }
  /// What the bodies got in the last step behind the safety ladder, in all.
  void felt(const Eigen::Vector3d& impulse_n_s) noexcept RTBUS_NONBLOCKING;

 private:
  static_assert(HandImpulses::kHeld >= kBodies + 1 && HandImpulses::kMostEntries >= ProxyContactSet::kSolved + 1);
  static constexpr std::size_t kMostRows = HandImpulses::kMostEntries + SupportPool::kSupports;
  static_assert(kMostRows <= kMostRowsTogether);

  static constexpr std::size_t kMostGroups = rtbus::kContactSlots / 2 + 1;  ///< Of two bodies at least; 0 is none.

  /// What the supports say of the bodies of an answer, by row.
  struct ToldSupports {
    std::array<std::size_t, rtbus::kContactSlots> count{};
    std::array<std::size_t, rtbus::kContactSlots> ends{};  ///< Of edges.
    std::array<double, rtbus::kContactSlots> loosest_per_kg{};
    std::array<std::size_t, rtbus::kContactSlots> group{};  ///< As LocalBody::group.
  };
  [[nodiscard]] ToldSupports read_supports(const rtbus::ProxyContacts& answer, std::size_t rigid_rows) const noexcept;
  void find_groups(const rtbus::ProxyContacts& answer, std::size_t rigid_rows, ToldSupports& out) const noexcept;
  [[nodiscard]] SinceAnswer since_answer(const rtbus::ProxyContacts& answer, const LocalBody& body, int parts,
                                         std::uint64_t now_ns) noexcept;
  void replay_free(const rtbus::ProxyContacts& answer, std::span<const std::size_t> slot_of_row, int parts,
                   std::uint64_t now_ns, std::span<Eigen::Quaterniond> turned) noexcept;

  [[nodiscard]] std::span<LocalBody> slots() noexcept { return {bodies_.data(), slots_}; }
  [[nodiscard]] std::size_t slot_of(std::uint32_t index) noexcept;
  void take_rigid(const rtbus::ProxyContacts& answer, std::uint64_t now_ns, std::span<std::size_t> slot_of_row,
                  std::span<Eigen::Quaterniond> turned) noexcept;
  void free_slot(std::size_t slot) noexcept;
  [[nodiscard]] Eigen::Quaterniond take_body(const ToldBody& told, std::size_t slot, int parts,
                                             std::uint64_t now_ns) noexcept;
  void follow_shape(const ToldBody& told, LocalBody& body) const noexcept;
  void pull_proxy(const LocalSpring& spring, double h) noexcept;
  void begin_tick(const LocalSpring& spring, std::uint64_t sample_ns, double h) noexcept;
  void brake(double h) noexcept;
  [[nodiscard]] std::size_t solve(const LocalSpring& spring, double h, double tolerance_m_s) noexcept;
  std::size_t solve_once(double h, double tolerance_m_s, bool again) noexcept;
  void ease(const LocalSpring& spring, double h) noexcept;
  std::size_t gather(double h, bool again) noexcept;
  [[nodiscard]] bool hand_rests() const noexcept { return hand_m_s_.norm() < tuning_.resting_hand_m_s(); }
  /// Lighter than the proxy in a tick, which throws it about. @param inverse_mass_per_kg 0: no force moves it.
  [[nodiscard]] bool is_light(double inverse_mass_per_kg) const noexcept {
    return inverse_mass_per_kg * proxy_kg_ >= 1.0;
  }
  [[nodiscard]] Eigen::Vector3d unheld(const LocalSpring& spring, double h, Eigen::Vector3d push_n_s) const noexcept;
  void give_impulses() noexcept;
  void give(std::size_t place, std::size_t slot, const Eigen::Vector3d& impulse_n_s,
            const Eigen::Vector3d& from_centre_m, bool moves) noexcept;
  void move_bodies(double h) noexcept;

  Tuning tuning_;
  NearShapes shapes_;
  LocalProxy proxy_;
  Eigen::Vector3d impulse_n_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d calm_n_s_ = Eigen::Vector3d::Zero();  ///< Of impulse_n_s_, what no body feels.
  std::optional<Eigen::Vector3d> foreseen_n_s_;         ///< By foresee(), for the next step.
  Eigen::Vector3d eased_n_ = Eigen::Vector3d::Zero();   ///< What the hand feels besides: answers change it slowly.
  double ease_s_ = 0.0;                                 ///< For so long at most.
  double work_j_ = 0.0;
  double lifted_j_ = 0.0;  ///< By corrections of where kinematic bodies are, less what corrections gave back.
  Eigen::Vector3d hand_m_s_ = Eigen::Vector3d::Zero();  ///< Mean over about Tuning::noise_s.
  std::uint64_t good_until_ns_ = 0;
  WorldClock clock_;
  bool networked_ = false;      ///< The last answer came over a network.
  double world_lag_s_ = 0.0;    ///< SinceAnswer::world_lag_s of it.
  double proxy_kg_ = 0.0;       ///< In a tick: h(hK + B), as asked for.
  bool light_moves_ = false;    ///< A light free body takes part in the step …
  bool group_moves_ = false;    ///< … and such that push each other.
  bool on_free_ = false;        ///< A body that forces move was touched in it.
  std::uint64_t now_ns_ = 0;    ///< The bodies are there.
  std::uint64_t begun_ns_ = 0;  ///< This tick has begun.
  std::optional<double> correction_m_;
  double tick_s_ = 1e-3;  ///< Of the last step.

  std::array<LocalBody, kBodies> bodies_{};
  std::size_t slots_ = 0;  ///< None is used from here on: a tick does not look there.
  ProxyContactSet contacts_;
  SupportPool supports_, old_supports_;
  YieldingBodies yielding_{tuning_.resting_mean_s()};
  std::size_t yielding_place_ = HandImpulses::kPlaces;  ///< Among the hand impulses, while something yields.

  // One step's problem: the proxy first, then bodies.
  std::array<SolverBody, kBodies + 1> solver_bodies_{};
  std::array<SolverContact, kMostRows> rows_{};
  std::size_t solved_contacts_ = 0;

  HandImpulses impulses_;
  OtherHands other_hands_;
};

}  // namespace haptic
