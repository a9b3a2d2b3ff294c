#pragma once
/// @file body_free.hpp
/// A body that forces move, on supports that stand. Frame W, SI units.
#include <cstddef>
#include <cstdint>
#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "haptic_node/rendering/body_motion.hpp"
#include "haptic_node/rendering/corner_supports.hpp"
#include "haptic_node/rendering/support.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// Each support pushes back as far as the body is pushed against it, be it one that stands, or another free body.
/// @realtime Yes.
class FreeBody {
 public:
  /// Puts the body where the answer has it.
  /// @param hand_m_s How fast the hand moves. @param supports Gets those of this body.
  /// @param old The pool before this answer.
  void take(const ToldBody& told, const SinceAnswer& since, double hand_m_s, SupportPool& supports,
            const SupportPool& old, BodyMotion& motion) noexcept RTBUS_NONBLOCKING;

  /// One of the bodies that are re-simulated together.
  struct Replayed {
    FreeBody* body = nullptr;
    BodyMotion* motion = nullptr;
    const SinceAnswer* since = nullptr;
    int slot = 0;                                                ///< By which the supports of the others name it.
    Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();  ///< Set: its turn from the answer's instant to now.
  };
  static constexpr std::size_t kMostTogether = 6;

  /// Re-simulates bodies that push each other from the answer's instant to now: under their forces, on their supports,
  /// with the impulses of all hands since, as ticks would have moved them, in fewer and longer steps.
  /// @param together At most kMostTogether, of one answer.
  static void replay(std::span<Replayed> together, SupportPool& supports) noexcept RTBUS_NONBLOCKING;

  /// An answer does not name the body: it stands on nothing that is known, and so has no weight either.
  void leave_supports() noexcept {
    support_count_ = 0;
    supported_ = false;
    corners_.leave();
    force_n_.setZero();
    torque_n_m_.setZero();
  }

  /// Whether it moves by itself in a step, though the proxy does not touch it.
  /// @param given By other hands in this step, and what the ladder added to the own push of the last one.
  [[nodiscard]] bool goes_on(const BodyMotion& motion, const Impulse& given) const noexcept RTBUS_NONBLOCKING;

  /// Takes part in a step as body number `self`. @returns whether it does: a force moves it.
  bool join(const BodyMotion& motion, const Impulse& given, int self, double h,
            SolverBody& out) noexcept RTBUS_NONBLOCKING;
  /// A push may be many times its weight: see relax_alone().
  [[nodiscard]] bool light() const noexcept { return light_; }
  void stay_out() noexcept { self_ = SolverContact::kFixed; }
  /// Its number in the step; SolverContact::kFixed: it takes no part.
  [[nodiscard]] int self() const noexcept { return self_; }

  /// Completes the row of a contact with the proxy. @param late_m_s What the surface is felt to go beyond the body.
  void fill_row(const Eigen::Vector3d& late_m_s, SolverContact& row) const noexcept RTBUS_NONBLOCKING;

  /// Adds the rows of its supports from `rows[first]` on. All bodies that take part have joined.
  /// @param holder_in The free body in that slot, a LocalBody, whose kind and motion hold this one. @returns how many.
  template <class HolderIn>
  std::size_t add_rows(const BodyMotion& motion, const HolderIn& holder_in, SupportPool& supports, double h,
                       SolverContact* rows, std::size_t first) noexcept {
    if (self_ >= 0) {
      corners_.place_holders([&](int slot) {
        return holder_in(slot).template as<FreeBody>() != nullptr ? &holder_in(slot).motion : nullptr;
      });
    }
    const std::size_t count = add_own_rows(motion, supports, h, rows, first);
    for (std::size_t i = 0; i < count; ++i) {
      const Support& support = supports.rows[first_support_ + i];
      if (support.holder == Support::kStands) continue;
      const auto* const holder = holder_in(support.holder).template as<FreeBody>();
      if (holder == nullptr) continue;
      rows[first + i].b = holder->self();
      rows[first + i].from_b_m = support.from_holder_m;
    }
    return count;
  }

  void advance(const StepSolution& step, SupportPool& supports, BodyMotion& motion) noexcept RTBUS_NONBLOCKING;

  /// Answers are late: what stands on nothing loses its forces.
  void brake() noexcept RTBUS_NONBLOCKING;

  /// The scene tells its shape, and the answer how it is turned.
  [[nodiscard]] bool has_shape() const noexcept { return shape_ != nullptr; }

  /// Stands on an edge or a point, and does not roll there: what it does at an instant is noise.
  [[nodiscard]] bool rocks() const noexcept { return rocks_ && !rolls_; }

 private:
  void take_supports(const ToldBody& told, const Tuning& tuning, const BodyMotion& motion, SupportPool& supports,
                     const SupportPool& old) noexcept;
  void make_round(const BodyMotion& motion, Support& support) noexcept;
  void stand_on(const Tuning& tuning, SupportPool& supports, BodyMotion& motion) noexcept;
  class Replay;
  std::size_t add_own_rows(const BodyMotion& motion, SupportPool& supports, double h, SolverContact* rows,
                           std::size_t first) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] static double closing_m_s(double gap_m, double h) noexcept;
  [[nodiscard]] SolverContact row_of(const Support& support, double h) const noexcept;
  [[nodiscard]] SolverBody solver_body(const BodyMotion& motion) const noexcept {
    return {motion.velocity_m_s, motion.angular_velocity_rad_s, inverse_mass_per_kg_, inverse_inertia_per_kg_m2_};
  }

  double inverse_mass_per_kg_ = 0.0;
  bool light_ = false;            ///< Below 100·h(hK + B).
  double softness_per_kg_ = 0.0;  ///< Of each support: two that face each other
                                  ///< then never contradict each other.
  Eigen::Matrix3d inverse_inertia_per_kg_m2_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d force_n_ = Eigen::Vector3d::Zero();     ///< All but supports and the proxy.
  Eigen::Vector3d torque_n_m_ = Eigen::Vector3d::Zero();  ///< Of the same, about the centre: another hand's.
  double friction_bound_n_ = 0.0;
  CornerSupports corners_;  ///< Where it lies with them; otherwise it is on supports as told.
  bool ball_ = false;
  const rtbus::shapes::KnownShape* shape_ = nullptr;  ///< See has_shape().
  bool rolls_ = false;                                ///< On a support that is round.
  bool supported_ = false;
  bool rocks_ = false;                ///< Stands on no patch.
  std::size_t first_support_ = 0;     ///< Its supports in the pool …
  std::size_t support_count_ = 0;     ///< … are so many.
  int self_ = SolverContact::kFixed;  ///< Its number in the step; kFixed: takes no part.
  std::size_t first_row_ = 0;         ///< Of its supports in the step.
};

}  // namespace haptic
