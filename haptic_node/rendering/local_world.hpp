#pragma once
/// @file local_world.hpp
/// The surroundings of the proxy, simulated in the haptic loop between two answers of physics: the proxy, what it may
/// touch, and the bodies behind that. Frame W, SI units. Fixed size, no allocation.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "haptic_node/rendering/contact_solver.hpp"
#include "haptic_node/rendering/impulse_history.hpp"
#include "haptic_node/rendering/local_heap.hpp"
#include "haptic_node/rendering/local_soft.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/shapes/standing_shape.hpp"

namespace haptic {

/// What pulls the proxy, in W.
struct LocalSpring {
  Eigen::Vector3d goal_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d goal_velocity_m_s = Eigen::Vector3d::Zero();
  double stiffness_n_per_m = 0.0;
  double damping_n_s_per_m = 0.0;
};

/// The turn of what spins at `rate_rad_s` for `h` seconds.
[[nodiscard]] inline Eigen::Quaterniond turn_of(const Eigen::Vector3d& rate_rad_s, double h) noexcept {
  const double rate = rate_rad_s.norm();
  if (rate * h <= 0.0) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(rate * h, rate_rad_s / rate));
}

/// One instant of the local world belongs to one device sample; a step leads from the sample before to this one.
///
/// The proxy has no mass. Spring and damper, implicit over a step of h, are the mass m_g = h(hK + B) that moves at
/// (K(x − p) + B·v)/(hK + B) (docs/decisions/0005): in free air it goes with the hand and pulls at nothing, at a
/// contact the hand feels K(p − x) + B(v_p − v), which is what the contacts push with.
///
/// An answer of physics describes the world at the instant of the device sample that it answers (decision 0003). By the
/// time it is here, the local world is one or two periods on. A body is put where physics has it at that instant, and
/// goes on from there to now with the impulses that it was given since (local_replay.cpp): no error of a prediction
/// outlives its answer. A surface that this moves, or that turns out to be elsewhere, starts where it was felt last and
/// moves to its place within a part of a step (kBlendSteps).
class LocalWorld {
 public:
  /// Those of the answer, and a few that are felt still while their contacts recede.
  static constexpr std::size_t kBodies = rtbus::kContactSlots + 4;
  static constexpr std::size_t kContacts = rtbus::kContactSlots + 8;  ///< Those of the answer, and some that fade out.
  static constexpr std::size_t kSupports = rtbus::kSupportSlots;
  static constexpr std::size_t kSolved = rtbus::kContactSlots;  ///< Contacts of the proxy in one step.
  static constexpr int kSweeps = 12, kFewestSweeps = 4;
  static constexpr int kRowSweeps = 100;  ///< Rows times sweeps of a step, about: what bounds its time.
  static constexpr double kBlendSteps = 0.3, kBlend_s = 0.01;  ///< Of a step of physics, but no faster than kBlend_s.
  static constexpr double kRecovery_m_s = 0.2;  ///< A surface does not come at the hand faster than this by blending.
  /// What an answer moves in a heap is a prediction put right: it is blended in over this many steps instead.
  static constexpr double kHeapBlendSteps = 2.4;
  /// So it is with what rocks on an edge, over no less than this.
  static constexpr double kRockBlend_s = 0.03;
  static constexpr double kHandSpeed_s = 0.02;
  /// Contacts that the proxy cannot reach in a step, with this to spare, are left out of it.
  static constexpr double kReach_m = 0.2e-3;
  static constexpr int kReplayParts = 8;   ///< At most, from the instant of an answer to now …
  static constexpr int kReplayRows = 100;  ///< … and parts times rows of all bodies, about.
  /// A way out of a body that no answer has named for so long, and for so many steps, is none: another surface is.
  static constexpr double kWayOut_s = 0.5, kWayOutSteps = 4.0;
  /// A surface of triangles has no inside. A proxy that is smaller than this is held by planes as they are told.
  static constexpr double kLeastProxy_m = 0.25e-3;
  /// In each step it is looked for such surfaces as far as the proxy goes at twice its speed, within these bounds. What
  /// pulls it farther is looked for again, so often at most.
  static constexpr double kSlowLook_m_s = 0.1, kFastLook_m_s = 1.0;
  static constexpr int kLooks = 8;
  static constexpr double kBrake_s = 0.01;  ///< Without news bodies come to rest in about three times that.

  /// @param standing Static bodies whose shape is known: their contacts follow it in each step, whatever plane an
  /// answer told. They stay as long as this object.
  explicit LocalWorld(std::vector<rtbus::shapes::StandingShape> standing = {})
      : standing_(std::move(standing)), nearest_(standing_.size()), touchable_(standing_.size()) {}

  /// Puts the proxy there, at rest, and forgets everything else.
  void reset(const Eigen::Vector3d& proxy_m) noexcept RTBUS_NONBLOCKING;

  /// An answer has come.
  void take(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// Advances everything by `h` seconds, to the instant `sample_ns`.
  void advance(const LocalSpring& spring, std::uint64_t sample_ns, double h) noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] const Eigen::Vector3d& position_m() const noexcept { return position_m_; }
  [[nodiscard]] const Eigen::Vector3d& velocity_m_s() const noexcept { return velocity_m_s_; }
  /// Of all contacts on the proxy in the last step.
  [[nodiscard]] const Eigen::Vector3d& impulse_n_s() const noexcept { return impulse_n_s_; }
  /// What kinematic bodies, which move whatever pushes, put into the proxy in the last step [J]; negative: took.
  [[nodiscard]] double work_j() const noexcept { return work_j_; }

  /// What the proxy did to a body in the last step.
  struct Push {
    std::uint32_t body = 0;                                 ///< In the scene's order.
    Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();  ///< On the body.
    Eigen::Vector3d from_centre_m = Eigen::Vector3d::Zero();
  };
  /// What the push of that number has become behind the safety ladder. @param impulse_n_s On the body.
  void felt(std::size_t push, const Eigen::Vector3d& impulse_n_s) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] std::span<const Push> pushes() const noexcept { return {pushes_.data(), push_count_}; }

 private:
  struct Body {
    bool used = false;
    bool named = false;   ///< By the answer that is being taken.
    bool moves = false;   ///< Something other than a static body.
    bool driven = false;  ///< Kinematic: whatever pushes.
    bool ball = false;
    std::uint32_t index = 0;
    Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
    SolverBody motion;
    Eigen::Vector3d force_n = Eigen::Vector3d::Zero();     ///< All but supports and the proxy.
    Eigen::Vector3d torque_n_m = Eigen::Vector3d::Zero();  ///< Of the same, about the centre: another hand's.
    double friction_bound_n = 0.0;
    bool supported = false;
    bool rocks = false;         ///< Stands on an edge or a point: what it does at an instant is noise.
    bool jammed = false;        ///< Held by bodies that move themselves: a heap.
    LocalHeap heap;             ///< If so.
    Impulse given;              ///< By the proxy, since it is known.
    std::uint64_t told_ns = 0;  ///< Instant of the last answer, where it had the body, and what was given until then.
    Eigen::Vector3d told_centre_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d told_given_n_s = Eigen::Vector3d::Zero();
  };
  struct Contact {
    std::size_t body = 0;
    Eigen::Vector3d from_centre_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::UnitY();
    double radius_m = 0.0;      ///< Of the ball whose surface it is; 0: a plane.
    int standing = -1;          ///< Of standing_: follows that shape; −1: none.
    std::uint64_t feature = 0;  ///< Of a surface: what it is on.
    double friction = 0.0;
    double offset_m = 0.0;                                  ///< Added to the gap: what is still to be blended in.
    double gap_m = 0.0;                                     ///< As of the last step, offset included.
    Eigen::Vector3d late_m_s = Eigen::Vector3d::Zero();     ///< Added to the surface's velocity: likewise.
    bool fades = false;                                     ///< Physics does not know it any more.
    std::uint64_t named_ns = 0;                             ///< When physics named it last.
    Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();  ///< On the proxy, in the last step.
  };
  struct Support {
    std::size_t body = 0;
    Eigen::Vector3d from_centre_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::UnitY();
    Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
    double friction = 0.0;
    double torsion_radius_m = 0.0;
    double force_n = 0.0;  ///< Along the normal, as physics had it.
    Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();
    double torsion_n_m_s = 0.0;
  };
  /// So many steps of physics are kept of what was given: an answer is at most two old.
  static constexpr double kHistorySteps = 2.5;

  [[nodiscard]] std::size_t slot_of(std::uint32_t index) noexcept;
  [[nodiscard]] SolverContact support_row(const Support& support, double h) const noexcept;
  void catch_up(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept;
  void replay(std::size_t slot, std::uint64_t from_ns, std::uint64_t now_ns, int parts,
              Eigen::Quaterniond& turned) noexcept;
  void take_bodies(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept;
  [[nodiscard]] bool take_heap(const rtbus::ProxyContacts& answer, std::size_t row, Body& body,
                               const Eigen::Vector3d& given_n_s, double age_s) noexcept;
  void move_heap(std::size_t slot, double h) noexcept;
  void take_supports(const rtbus::ProxyContacts& answer) noexcept;
  void take_contacts(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept;
  [[nodiscard]] bool blocked(const rtbus::ProxyContacts& answer, std::size_t contact, double gap_m) const noexcept;
  [[nodiscard]] bool names(const rtbus::ProxyContacts& answer, std::size_t row,
                           const Eigen::Vector3d& normal) const noexcept;
  void hold_by_supports(std::size_t slot) noexcept;
  [[nodiscard]] double gap_of(const Contact& contact) const noexcept;
  [[nodiscard]] Eigen::Vector3d surface_m_s(const Contact& contact) const noexcept;
  void roll(Contact& contact) const noexcept;
  [[nodiscard]] int standing_of(std::uint32_t body) const noexcept;
  void follow_hull(Contact& contact) noexcept;
  [[nodiscard]] bool name_surface(const rtbus::ProxyContacts& answer, std::size_t contact) noexcept;
  [[nodiscard]] double look_m(double h) const noexcept;
  void follow_surface(std::size_t standing, double h) noexcept;
  [[nodiscard]] Eigen::Vector3d free_way_m(const Eigen::Vector3d& way_m, double h) const noexcept;
  void blend(double h) noexcept;
  [[nodiscard]] Eigen::Vector3d heap_surface_m_s(const Body& body, const Eigen::Vector3d& normal) const noexcept;
  std::size_t gather(double h) noexcept;
  void integrate(double h) noexcept;

  std::vector<rtbus::shapes::StandingShape> standing_;
  std::vector<rtbus::shapes::NearestFeature> nearest_;  ///< Of the last query of each hull.
  /// A surface that the last answer named.
  struct Touchable {
    bool named = false;
    std::size_t body = 0;
    double friction = 0.0;
  };
  std::vector<Touchable> touchable_;  ///< Of each of standing_; hulls are none.
  bool any_touchable_ = false;

  Eigen::Vector3d position_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d impulse_n_s_ = Eigen::Vector3d::Zero();
  double work_j_ = 0.0;
  Eigen::Vector3d hand_m_s_ = Eigen::Vector3d::Zero();  ///< Mean over about kHandSpeed_s.
  double proxy_radius_m_ = 0.0;
  std::uint64_t good_until_ns_ = 0;
  double blend_s_ = kBlend_s, heap_blend_s_ = kBlend_s, rock_blend_s_ = kRockBlend_s;
  std::uint64_t now_ns_ = 0;
  double tick_s_ = 1e-3;  ///< Of the last step.

  std::array<Body, kBodies> bodies_{};
  std::array<Contact, kContacts> contacts_{};
  std::size_t contact_count_ = 0;
  std::array<Support, kSupports> supports_{};
  std::size_t support_count_ = 0;
  std::array<Contact, kContacts> old_contacts_;  ///< Before the answer that is being taken.
  std::array<Support, kSupports> old_supports_;
  LocalSoft soft_;
  std::size_t rigid_rows_ = 0;  ///< Bodies of the answer that is being taken; soft ones come after them.
  std::array<std::size_t, kBodies> slot_of_row_{};          ///< Of the answer that is being taken.
  std::array<Eigen::Quaterniond, kBodies> turned_since_{};  ///< Likewise: from its instant to now.

  // One step's problem: the proxy first, then bodies; what each row belongs to.
  static constexpr int kSoftBody = kBodies + 1;
  std::array<SolverBody, kBodies + 1 + LocalSoft::kPatches> solver_bodies_{};
  std::array<int, kBodies> solver_body_{};  ///< Of a slot; −1: not in the problem.
  std::array<SolverContact, kSolved + kSupports + LocalSoft::kPatches> rows_{};
  std::array<std::size_t, kSolved + kSupports> row_source_{};
  std::size_t solved_contacts_ = 0;

  std::array<Push, kSolved + LocalSoft::kPatches> pushes_{};
  std::array<std::size_t, kSolved + LocalSoft::kPatches> push_slot_{};  ///< Of its body; kSoftBody and on: soft.
  std::size_t push_count_ = 0;

  std::array<ImpulseHistory, kBodies> given_{};  ///< To the body of that slot.
  std::uint64_t given_apart_ns_ = 0;             ///< What is nearer shares a record.
};

}  // namespace haptic
