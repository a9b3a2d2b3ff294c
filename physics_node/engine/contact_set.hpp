#pragma once
/// @file contact_set.hpp
/// Contacts of a proxy, present and near, and the bodies behind them: enough to simulate both for a while without the
/// engine. Frame W, SI units. All values belong to the end of the last step; forces are those of its last part (Stepper
/// divides a step into parts).
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace physics {

/// One place where the proxy touches a body or may soon touch it. The proxy is a sphere, so a convex body has one.
struct Contact {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();  ///< On the body's surface.
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< Unit, from the body to the proxy.
  double gap_m = 0.0;  ///< From surface to surface along the normal; negative: penetrates.
  Eigen::Vector3d surface_velocity_m_s = Eigen::Vector3d::Zero();  ///< Of the body, at the point.
  double friction = 0.0;                                           ///< Coulomb coefficient of the pair [1].
  double curvature_per_m = 0.0;                                    ///< Of the surface of a ball; 0: treated as a plane.
  /// Inverse effective mass of the body for a force at the point: acceleration of the point = this · force. Symmetric.
  /// Zero for a body that no force moves. Rigid: 1/m·1 − [r]×·I⁻¹·[r]×, r from the centre of mass to the point.
  Eigen::Matrix3d inverse_mass_per_kg = Eigen::Matrix3d::Zero();
  std::uint32_t row = 0;  ///< Of the body in ContactSet::bodies.
};

/// Of a soft body it is the nearest node: `body` counts on after the rigid bodies, `centre_m` is the node's place, the
/// mass is the node's, velocities are zero. What a soft body does to a placed tool is told besides (ToolReaction).
enum class BodyKind : std::uint32_t { kStatic = 0, kKinematic = 1, kDynamic = 2, kSoft = 3 };

/// A body behind at least one contact, or one that such a body touches.
struct BodyBehind {
  std::uint32_t body = 0;  ///< In the scene's order (World::body_pose).
  BodyKind kind = BodyKind::kStatic;
  /// Centre of mass, together with what it carries where it is told as one with that.
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d own_from_centre_m = Eigen::Vector3d::Zero();      ///< Of its own mass alone, from there.
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< q_WB, set by the stepper.
  Eigen::Vector3d origin_from_centre_m = Eigen::Vector3d::Zero();   ///< Of the body's frame; likewise.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();
  double inverse_mass_per_kg = 0.0;                                     ///< 0: no force moves it.
  Eigen::Matrix3d inverse_inertia_per_kg_m2 = Eigen::Matrix3d::Zero();  ///< In W, about the centre of mass.
  /// Gravity and the normal forces of all its other contacts, those with other proxies included; 0 while it sleeps.
  /// Without World::apply_hand_force() of any proxy: methods that push so tell each other
  /// (ProxyContacts::hand_time_ns).
  Eigen::Vector3d external_force_n = Eigen::Vector3d::Zero();
  Eigen::Vector3d external_torque_n_m = Eigen::Vector3d::Zero();  ///< Of the same, about the centre of mass.
  /// Friction of its other contacts, separate because it changes with the push: a simulation of the body computes it
  /// again, up to the bound. 0 while it sleeps.
  Eigen::Vector3d friction_force_n = Eigen::Vector3d::Zero();
  Eigen::Vector3d friction_torque_n_m = Eigen::Vector3d::Zero();
  /// Friction bound of its other contacts, Σ μ·N. An estimate: N is of the last step and changes with the push. A body
  /// that has slept since the start has no known contacts; its bound is then μ²·m·g with its own μ.
  double friction_bound_n = 0.0;
  Eigen::Vector3d proxy_force_n = Eigen::Vector3d::Zero();  ///< By this proxy, on the body.
};

/// What supports a body behind a contact: another body that pushes on it, its contact points taken together. An edge is
/// two, its ends, but in a pile. A support is a contact with gap 0.
struct Support {
  std::uint32_t row = 0;     ///< Of the supported body, in ContactSet::bodies.
  std::uint32_t holder = 0;  ///< Row of what holds it, plus 1, if both are told together (kMostTogether); 0: it is not.
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();               ///< Mean of the points, weighted by their forces.
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();               ///< Unit, towards the supported body.
  double normal_force_n = 0.0;                                     ///< > 0; with a holder also 0: it touches.
  double friction = 0.0;                                           ///< Coulomb coefficient of the pair [1].
  Eigen::Vector3d surface_velocity_m_s = Eigen::Vector3d::Zero();  ///< Of what holds, at the point.
  double inverse_mass_per_kg = 0.0;                                ///< Of what holds; 0: no force moves it.
  /// Contact points that carry: 1 is a point, 2 an edge, more are a patch. Face on face is a patch with however many.
  /// 0: it is near its holder, and does not touch it.
  std::uint32_t points = 0;
};

/// What all bodies that yield do to the tool of a method that simulates it itself: soft bodies, and a bed
/// of very light ones (kLightest). Such a tool takes room among them (World::drive_tool). Now, and at some instants
/// ahead, if it goes on as it goes.
struct ToolReaction {
  static constexpr std::size_t kInstants = 3;
  /// One instant of it.
  struct Instant {
    double after_s = 0.0;                                  ///< After the end of the last step.
    Eigen::Vector3d tool_m = Eigen::Vector3d::Zero();      ///< Where the tool is then.
    Eigen::Vector3d reaction_n = Eigen::Vector3d::Zero();  ///< On the tool, mean around that time.
    Eigen::Vector3d normal = Eigen::Vector3d::UnitY();     ///< Unit, from what is nearest to the tool.
    double gap_m = 0.0;                                    ///< To that; 0: it touches.
  };
  std::size_t count = 0;  ///< Of instants; 0: nothing that yields is near.
  std::array<Instant, kInstants> instants{};
  /// By how much the reaction falls where the tool is not there but elsewhere: along the reaction, and across.
  double stiffness_n_per_m = 0.0, stiffness_across_n_per_m = 0.0;
  double friction = 0.0;  ///< Coulomb coefficient of the pair [1].
  double rest = 0.0;      ///< 0 to 1: how much it counts as at rest, since nobody has moved for long.
};

/// Upper limits, which bound the message and the work of the solver.
inline constexpr std::size_t kMaxContacts = 16;
inline constexpr std::size_t kMaxSupports = 32;
/// So many dynamic bodies that touch each other are told together: each has a row, be it near the proxy or not, and
/// where two of them touch is one support, of either, with the other as its holder. More of them are a pile, and so are
/// those of which one is more than so many times as heavy as another: an engine does not find the forces among these
/// within a step, and they rattle. But what lies on a body and touches nothing else may be told as one with it.
inline constexpr std::size_t kMostTogether = 6;
inline constexpr double kMostMassRatio = 10.0;
/// Boxes that are so near to each other are told together as if they touched, by a support of no points.
inline constexpr double kNearTogether_m = 10e-3;

/// What is near the proxy: the contact constraints and the bodies behind them.
struct ContactSet {
  double radius_m = 0.0;        ///< All contacts within this distance are listed, or counted as overflow.
  double proxy_radius_m = 0.0;  ///< As the engine sees it.
  double proxy_mass_kg = 0.0;
  std::vector<Contact> contacts;  ///< By gap, the nearest first; those of soft bodies after all others.
  /// One row for each body, in the order of its nearest contact; then those that are told together with one of them;
  /// soft ones last.
  std::vector<BodyBehind> bodies;
  std::vector<Support> supports;
  std::uint32_t contacts_overflow = 0;  ///< Contacts within the radius that did not fit: the farthest.
  std::uint32_t supports_overflow = 0;
};

/// Inverse effective mass of a rigid body at `r_m` from its centre of mass (Contact::inverse_mass_per_kg).
[[nodiscard]] inline Eigen::Matrix3d inverse_mass_at(double inverse_mass_per_kg, const Eigen::Matrix3d& inverse_inertia,
                                                     const Eigen::Vector3d& r_m) {
  Eigen::Matrix3d cross;
  cross << 0, -r_m.z(), r_m.y(), r_m.z(), 0, -r_m.x(), -r_m.y(), r_m.x(), 0;
  return inverse_mass_per_kg * Eigen::Matrix3d::Identity() - cross * inverse_inertia * cross;
}

/// A contact that was found, before its body has a row: `row` is the body's number in the scene.
using FoundContacts = std::vector<Contact>;

/// Sorts what was found by gap (the scene's order where gaps are equal), keeps the nearest kMaxContacts, gives each
/// body a row with `body` set and lets the contacts point there. Clears the rest of `out`.
inline void keep_nearest(FoundContacts& found, ContactSet& out) {
  std::stable_sort(found.begin(), found.end(), [](const Contact& a, const Contact& b) {
    return a.gap_m != b.gap_m ? a.gap_m < b.gap_m : a.row < b.row;
  });
  out.contacts.clear();
  out.bodies.clear();
  out.supports.clear();
  out.supports_overflow = 0;
  const std::size_t kept = std::min(found.size(), kMaxContacts);
  out.contacts_overflow = static_cast<std::uint32_t>(found.size() - kept);
  for (std::size_t i = 0; i < kept; ++i) {
    Contact contact = found[i];
    std::uint32_t row = 0;
    while (row < out.bodies.size() && out.bodies[row].body != contact.row) ++row;
    if (row == out.bodies.size()) {
      out.bodies.emplace_back();
      out.bodies.back().body = contact.row;
    }
    contact.row = row;
    out.contacts.push_back(contact);
  }
}

}  // namespace physics
