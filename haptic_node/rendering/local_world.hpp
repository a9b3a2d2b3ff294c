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
#include "haptic_node/rendering/local_body.hpp"
#include "haptic_node/rendering/proxy_contact_set.hpp"
#include "haptic_node/rendering/static_shapes.hpp"
#include "haptic_node/rendering/world_clock.hpp"
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

/// One instant of the local world belongs to one device sample; a step leads from the sample before to this one.
///
/// The proxy has no mass. Spring and damper, implicit over a step of h, are the mass m_g = h(hK + B) that moves at
/// (K(x − p) + B·v)/(hK + B) (docs/decisions/0005): in free air it goes with the hand and pulls at nothing, at a
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
  static constexpr int kSweeps = 12, kFewestSweeps = 4;
  static constexpr int kRowSweeps = 100;  ///< Rows times sweeps of a step, about: what bounds its time.
  static constexpr double kHandSpeed_s = 0.02;
  static constexpr int kReplayParts = 8;    ///< At most, from the instant of an answer to now …
  static constexpr int kNetworkParts = 64;  ///< … over a network …
  static constexpr int kReplayRows = 100;   ///< … and parts times rows of all bodies, about.
  static constexpr double kBrake_s = 0.01;  ///< Without answers bodies come to rest in about three times that.

  /// @param standing Static bodies whose shape is known: their contacts follow it in each step, whatever plane an
  /// answer told. They stay as long as this object.
  explicit LocalWorld(std::vector<rtbus::shapes::StandingShape> standing = {}) : shapes_(std::move(standing)) {}

  /// Puts the proxy there, at rest, and forgets everything else.
  void reset(const Eigen::Vector3d& proxy_m) noexcept RTBUS_NONBLOCKING;

  /// An answer has come.
  void take(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  /// Advances everything by `h` seconds, to the instant `sample_ns`.
  void advance(const LocalSpring& spring, std::uint64_t sample_ns, double h) noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] const Eigen::Vector3d& position_m() const noexcept { return proxy_.position_m; }
  [[nodiscard]] const Eigen::Vector3d& velocity_m_s() const noexcept { return proxy_.velocity_m_s; }
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
  static constexpr std::size_t kMostPushes = ProxyContactSet::kSolved + SpringHistory::kPlaces;
  static constexpr std::size_t kMostRows = kMostPushes + SupportPool::kSupports;
  /// So many steps of physics are kept of what was given, or so many ages of an answer, which over a network is older
  /// than the two steps that it is at most without one.
  static constexpr double kHistorySteps = 2.5, kHistoryAges = 1.25;

  [[nodiscard]] std::size_t slot_of(std::uint32_t index) noexcept;
  void take_rigid(const rtbus::ProxyContacts& answer, std::size_t rigid_rows, std::uint64_t now_ns,
                  std::span<std::size_t> slot_of_row, std::span<Eigen::Quaterniond> turned) noexcept;
  void free_slot(std::size_t slot) noexcept;
  [[nodiscard]] Eigen::Quaterniond take_body(const ToldBody& told, std::size_t slot, int parts,
                                             std::uint64_t now_ns) noexcept;
  void take_yielding(const rtbus::ProxyContacts& answer, std::size_t rigid_rows) noexcept;
  void brake(double h) noexcept;
  std::size_t gather(double h) noexcept;
  void book(std::uint64_t began_ns) noexcept;
  void give(std::size_t slot, const Eigen::Vector3d& impulse_n_s, const Eigen::Vector3d& from_centre_m,
            std::uint64_t began_ns) noexcept;
  void move_bodies(double h) noexcept;

  StaticShapes shapes_;
  LocalProxy proxy_;
  Eigen::Vector3d impulse_n_s_ = Eigen::Vector3d::Zero();
  double work_j_ = 0.0;
  double lifted_j_ = 0.0;  ///< By corrections of where kinematic bodies are, less what corrections gave back.
  Eigen::Vector3d hand_m_s_ = Eigen::Vector3d::Zero();  ///< Mean over about kHandSpeed_s.
  std::uint64_t good_until_ns_ = 0;
  WorldClock clock_;
  bool networked_ = false;       ///< The last answer came over a network.
  double world_before_s_ = 0.0;  ///< SinceAnswer::besides_s of it.
  std::uint64_t now_ns_ = 0;
  double tick_s_ = 1e-3;  ///< Of the last step.

  std::array<LocalBody, kBodies> bodies_{};
  ProxyContactSet contacts_;
  SupportPool supports_, old_supports_;
  SpringHistory springs_;
  bool any_yields_ = false;

  // One step's problem: the proxy first, then bodies.
  std::array<SolverBody, kBodies + 1> solver_bodies_{};
  std::array<SolverContact, kMostRows> rows_{};
  std::size_t solved_contacts_ = 0;

  std::array<Push, kMostPushes> pushes_{};
  std::array<std::size_t, kMostPushes> push_slot_{};  ///< Of its body.
  std::size_t push_count_ = 0;

  std::array<ImpulseHistory, kBodies> given_{};  ///< To the body of that slot.
  std::uint64_t given_apart_ns_ = 0;             ///< What is nearer shares a record.
};

}  // namespace haptic
