#pragma once
/// @file hostile_physics.hpp
/// A physics that speaks the protocol and wants to hurt: each sample is sane by itself (rtbus/sane_sample.hpp), and
/// what they say is chosen against the hand. It sees the hand as every physics does.
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "tools/harness/harness.hpp"
#include "tools/harness/random.hpp"

namespace tools {

/// What a hostile physics is made of. SI units, at the device, whose frame is the world's.
struct HostilePlan {
  std::string method = "remote_virtual_coupling";
  double stiffness_n_per_m = 200.0;
  double damping_n_s_per_m = 0.5;
  /// Of the hand; no stiffness: nobody holds the tip.
  double hand_n_per_m = 300.0, hand_n_s_per_m = 3.0, hand_kg = 0.08;

  /// Along the motion; likewise, in proportion to its speed; a sine; a walk of the set-point; jumps; one direction.
  enum class Push : std::uint8_t { kAlong, kFaster, kResonant, kWalk, kJump, kSteady };
  Push push = Push::kAlong;
  double force_n = 2.0;         ///< Wanted.
  double speed_m_s = 1.8;       ///< Above it the push pauses, to stay below the overspeed cut.
  double frequency_hz = 5.0;    ///< Of the sine.
  double change_s = 0.1;        ///< Between two random directions.
  double lie_j = 0.05;          ///< Work that each answer claims more; 0: none.
  bool lie_alternates = false;  ///< Plus and minus.
  double free_share = 0.2;      ///< Of answers that say that the proxy touches nothing.
  double wild_share = 0.0;      ///< Of answers whose figures are drawn up to the limits of what is sane.
  double insane_share = 0.0;    ///< Of answers with figures that are none: each is a loss of physics.
  double age_s = 0.0;           ///< The answers are to samples up to so old.
  double step_s = 1e-3;         ///< What it says that a step is.
  double silent_every_s = 0.0;  ///< 0: never silent.
  double silent_s = 0.1;

  // Of local_contact:
  double plate_s = 0.005;        ///< Time in which the surface wants to reach its place.
  double kinematic_share = 1.0;  ///< Of bodies that move whatever pushes; the others are dynamic, static or soft.
  double flip_share = 0.0;       ///< Of contacts whose normal points the other way.
  double jump_m = 0.0;           ///< Gaps jump by up to this.
  double friction = 0.3;
  double inverse_mass_per_kg = 1.0;
  double compliance_m_per_n =
      0.0;                    ///< Unless all bodies are kinematic something yields, 1 over this stiff. 0: nothing.
  double rename_share = 0.0;  ///< Of answers in which the bodies have other numbers.
  int contacts = 1;
  int supports = 0;
};

/// A lineage that begins with this number begins with the plan by which the bound is derived (docs/safety.md): a hand
/// that swings in circles as fast as the overspeed cut allows, and the force that the motors bear for ever along its
/// motion.
inline constexpr std::uint64_t kCircling = 0;

/// The plan of these numbers: the first draws it, each further one changes some of it. Empty lineages are not allowed.
[[nodiscard]] HostilePlan hostile_plan(const std::string& method, std::span<const std::uint64_t> lineage);
/// One line.
[[nodiscard]] std::string describe(const HostilePlan& plan);

/// For Harness::tamper().
class HostilePhysics {
 public:
  /// @param stiffness_n_per_m As rendered. @param until_ns From then on it passes on what the true physics says.
  HostilePhysics(const HostilePlan& plan, double stiffness_n_per_m, std::uint64_t seed, std::uint64_t until_ns);

  void answer(Harness::Answer& answer);
  [[nodiscard]] std::uint64_t lies() const noexcept { return lies_; }  ///< Answers so far that were not the true ones.

 private:
  [[nodiscard]] Eigen::Vector3d wanted_force_n(const Eigen::Vector3d& velocity_m_s, double t_s);
  [[nodiscard]] Eigen::Vector3d direction();
  [[nodiscard]] double wild(double limit);
  void lie_about_proxy(Harness::Answer& answer, const Eigen::Vector3d& force_n);
  void lie_about_contacts(const rtbus::DeviceState& hand, const Eigen::Vector3d& force_n, rtbus::ProxyContacts& out);
  void fill_contact(std::size_t row, const Eigen::Vector3d& proxy_m, const Eigen::Vector3d& normal,
                    const Eigen::Vector3d& surface_m_s, rtbus::ProxyContacts& out);
  void fill_bodies(const Eigen::Vector3d& surface_m_s, rtbus::ProxyContacts& out);
  void fill_supports(rtbus::ProxyContacts& out);
  void fill_yields(const Eigen::Vector3d& proxy_m, const Eigen::Vector3d& normal, rtbus::ProxyContacts& out);

  HostilePlan plan_;
  double stiffness_n_per_m_;
  std::uint64_t until_ns_;
  Random random_;
  std::uint64_t lies_ = 0;
  std::uint32_t epoch_ = 0;
  double work_j_ = 0.0;       ///< Claimed in this epoch.
  double true_work_j_ = 0.0;  ///< As physics had it when the lies ended: the sum must not step back.
  std::uint64_t next_change_ns_ = 0;
  std::uint64_t next_silence_ns_ = 0;
  std::uint32_t names_ = 0;
  Eigen::Vector3d axis_;
  Eigen::Vector3d walk_m_ = Eigen::Vector3d::Zero();
};

}  // namespace tools
