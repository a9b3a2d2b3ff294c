#pragma once
/// @file contact_messages.hpp
/// Contacts around a proxy, and the bodies behind them, for a method that simulates both itself. Conventions as in
/// messages.hpp; exact meaning of each quantity: physics_node/engine/contact_set.hpp.
#include "rtbus/messages.hpp"

namespace rtbus {

/// A symmetric 3×3 matrix: xx, xy, xz, yy, yz, zz.
using Symmetric3 = std::array<double, 6>;

inline constexpr std::size_t kContactSlots = 16;
inline constexpr std::size_t kSupportSlots = 32;
inline constexpr std::size_t kYieldSlots = 3;
inline constexpr std::size_t kHandSlots = 16;  ///< A session has no more haptic nodes.

/// `physics.contacts.HAPTIC`, with every ProxyState while a method asks for it (DeviceState::wants) or the session
/// says `physics.contacts: on`. Rows beyond the counts are
/// zero as published; Reader::read_latest_rows() leaves them as they were.
struct ProxyContacts {
  std::uint64_t device_sequence = 0;  ///< The DeviceState this answers, as in the ProxyState of the same step.
  std::uint64_t device_time_ns = 0;   ///< Until then bodies have what the hand did: its sample's time or before.
  std::uint64_t step_index = 0;       ///< Pairs it with its ProxyState.
  double step_s = 0.0;                ///< Simulated time between this and the one before.
  double radius_m = 0.0;              ///< Valid while the proxy is not farther than this from proxy_position_m.
  Vec3 proxy_position_m{};            ///< p_WP at the end of the step.
  Vec3 proxy_velocity_m_s{};          ///< v_WP.
  double proxy_mass_kg = 0.0;
  double proxy_radius_m = 0.0;
  std::uint32_t mapping_epoch = 0;      ///< Of the DeviceState it answers.
  std::uint32_t contacts = 0;           ///< Rows used of the contact_… arrays, nearest first.
  std::uint32_t bodies = 0;             ///< … of the body_… arrays.
  std::uint32_t supports = 0;           ///< … of the support_… arrays.
  std::uint32_t contacts_overflow = 0;  ///< Contacts within the radius that found no row, in this step.
  std::uint32_t supports_overflow = 0;
  std::uint32_t hands = 0;       ///< Rows used of hand_time_ns: haptic nodes of the session.
  std::uint32_t yields = 0;      ///< Rows used of the yield_… arrays; 0: nothing that yields is near.
  std::uint64_t shape_hash = 0;  ///< Of the shapes of the world's scene (Scene::shape_hash()); 0: it has none.

  /// By how much the reaction of what yields falls where the proxy is not at yield_tool_m but elsewhere: along the
  /// reaction, and across.
  double yield_stiffness_n_per_m = 0.0, yield_stiffness_across_n_per_m = 0.0;
  double yield_friction = 0.0;  ///< Coulomb coefficient of the pair.
  double yield_rest = 0.0;      ///< 0 to 1: how much it counts as at rest, since nobody has moved for long.

  /// By haptic node, in the session's order: bodies have received the hand_impulse_… of that hand until then, in the
  /// time of its samples. 0: none.
  std::array<std::uint64_t, kHandSlots> hand_time_ns{};

  std::array<std::uint32_t, kContactSlots> contact_body{};              ///< Row of the body behind.
  std::array<Vec3, kContactSlots> contact_point_m{};                    ///< On the body.
  std::array<Vec3, kContactSlots> contact_normal{};                     ///< Unit, towards the proxy.
  std::array<double, kContactSlots> contact_gap_m{};                    ///< Negative: penetrates.
  std::array<Vec3, kContactSlots> contact_velocity_m_s{};               ///< Of the body's surface.
  std::array<double, kContactSlots> contact_friction{};                 ///< Of the pair.
  std::array<double, kContactSlots> contact_curvature_per_m{};          ///< Of a ball: 1/radius. 0: a plane.
  std::array<Symmetric3, kContactSlots> contact_inverse_mass_per_kg{};  ///< Zero: no force moves it.

  std::array<std::uint32_t, kContactSlots> body_index{};  ///< In the scene's order.
  std::array<std::uint32_t, kContactSlots> body_kind{};   ///< 0 static, 1 kinematic, 2 dynamic.
  /// Of mass. Where a body is told as one with what it carries, all body_… are of both, and hand_impulse_… likewise.
  std::array<Vec3, kContactSlots> body_centre_m{};
  std::array<Quat, kContactSlots> body_orientation_wxyz{};      ///< q_WB; zero: not known.
  std::array<Vec3, kContactSlots> body_origin_from_centre_m{};  ///< Of the body's frame, in which its shape is given.
  std::array<Vec3, kContactSlots> body_velocity_m_s{};
  std::array<Vec3, kContactSlots> body_angular_velocity_rad_s{};
  std::array<double, kContactSlots> body_inverse_mass_per_kg{};
  std::array<Symmetric3, kContactSlots> body_inverse_inertia_per_kg_m2{};
  std::array<Vec3, kContactSlots> body_external_force_n{};  ///< Gravity and normal forces of its other contacts,
                                                            ///< without hand_impulse_… of any hand.
  std::array<Vec3, kContactSlots> body_external_torque_n_m{};
  std::array<Vec3, kContactSlots> body_friction_force_n{};  ///< Friction of its other contacts.
  std::array<Vec3, kContactSlots> body_friction_torque_n_m{};
  std::array<double, kContactSlots> body_friction_bound_n{};  ///< Upper bound of this friction, Σ μ·N.
  std::array<Vec3, kContactSlots> body_proxy_force_n{};       ///< By this proxy, on the body.

  std::array<std::uint32_t, kSupportSlots> support_body{};    ///< Row of the body that is held.
  std::array<std::uint32_t, kSupportSlots> support_holder{};  ///< Row of the body that holds, plus 1; 0: it has none.
  std::array<Vec3, kSupportSlots> support_point_m{};
  std::array<Vec3, kSupportSlots> support_normal{};  ///< Unit, towards the body that is held.
  std::array<double, kSupportSlots> support_force_n{};
  std::array<double, kSupportSlots> support_friction{};
  std::array<Vec3, kSupportSlots> support_velocity_m_s{};
  std::array<double, kSupportSlots> support_inverse_mass_per_kg{};  ///< Of what holds; 0: no force moves it.
  std::array<std::uint32_t, kSupportSlots> support_points{};  ///< Loaded contact points: 1 a point; 2 an edge or one of
                                                              ///< its ends; 3 or more, or two faces, a patch; 0: near
                                                              ///< its holder, and not touching.

  // What soft bodies, and a bed of very light ones, do to the tool, at instants in order of time: in the world
  // now, and further on if the tool goes on as it goes.
  std::array<double, kYieldSlots> yield_after_s{};   ///< After device_time_ns.
  std::array<Vec3, kYieldSlots> yield_tool_m{};      ///< Where the tool is then.
  std::array<Vec3, kYieldSlots> yield_reaction_n{};  ///< On the tool.
  std::array<Vec3, kYieldSlots> yield_normal{};      ///< Unit, from what is nearest to the tool.
  std::array<double, kYieldSlots> yield_gap_m{};     ///< To that; 0: it touches.
};

template <>
struct SampleTraits<ProxyContacts> {
  static constexpr std::string_view kName = "rtbus/ProxyContacts";
  using T = ProxyContacts;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, device_sequence, "1"),
                                      RTBUS_FIELD(T, device_time_ns, "ns"),
                                      RTBUS_FIELD(T, step_index, "1"),
                                      RTBUS_FIELD(T, step_s, "s"),
                                      RTBUS_FIELD(T, radius_m, "m"),
                                      RTBUS_FIELD(T, proxy_position_m, "m"),
                                      RTBUS_FIELD(T, proxy_velocity_m_s, "m/s"),
                                      RTBUS_FIELD(T, proxy_mass_kg, "kg"),
                                      RTBUS_FIELD(T, proxy_radius_m, "m"),
                                      RTBUS_FIELD(T, mapping_epoch, "1"),
                                      RTBUS_FIELD(T, contacts, "1"),
                                      RTBUS_FIELD(T, bodies, "1"),
                                      RTBUS_FIELD(T, supports, "1"),
                                      RTBUS_FIELD(T, contacts_overflow, "1"),
                                      RTBUS_FIELD(T, supports_overflow, "1"),
                                      RTBUS_FIELD(T, hands, "1"),
                                      RTBUS_FIELD(T, yields, "1"),
                                      RTBUS_FIELD(T, shape_hash, "1"),
                                      RTBUS_FIELD(T, yield_stiffness_n_per_m, "N/m"),
                                      RTBUS_FIELD(T, yield_stiffness_across_n_per_m, "N/m"),
                                      RTBUS_FIELD(T, yield_friction, "1"),
                                      RTBUS_FIELD(T, yield_rest, "1"),
                                      RTBUS_FIELD(T, hand_time_ns, "ns"),
                                      RTBUS_FIELD(T, contact_body, "1"),
                                      RTBUS_FIELD(T, contact_point_m, "m"),
                                      RTBUS_FIELD(T, contact_normal, "1"),
                                      RTBUS_FIELD(T, contact_gap_m, "m"),
                                      RTBUS_FIELD(T, contact_velocity_m_s, "m/s"),
                                      RTBUS_FIELD(T, contact_friction, "1"),
                                      RTBUS_FIELD(T, contact_curvature_per_m, "1/m"),
                                      RTBUS_FIELD(T, contact_inverse_mass_per_kg, "1/kg"),
                                      RTBUS_FIELD(T, body_index, "1"),
                                      RTBUS_FIELD(T, body_kind, "1"),
                                      RTBUS_FIELD(T, body_centre_m, "m"),
                                      RTBUS_FIELD(T, body_orientation_wxyz, "1"),
                                      RTBUS_FIELD(T, body_origin_from_centre_m, "m"),
                                      RTBUS_FIELD(T, body_velocity_m_s, "m/s"),
                                      RTBUS_FIELD(T, body_angular_velocity_rad_s, "rad/s"),
                                      RTBUS_FIELD(T, body_inverse_mass_per_kg, "1/kg"),
                                      RTBUS_FIELD(T, body_inverse_inertia_per_kg_m2, "1/(kg m2)"),
                                      RTBUS_FIELD(T, body_external_force_n, "N"),
                                      RTBUS_FIELD(T, body_external_torque_n_m, "N m"),
                                      RTBUS_FIELD(T, body_friction_force_n, "N"),
                                      RTBUS_FIELD(T, body_friction_torque_n_m, "N m"),
                                      RTBUS_FIELD(T, body_friction_bound_n, "N"),
                                      RTBUS_FIELD(T, body_proxy_force_n, "N"),
                                      RTBUS_FIELD(T, support_body, "1"),
                                      RTBUS_FIELD(T, support_holder, "1"),
                                      RTBUS_FIELD(T, support_point_m, "m"),
                                      RTBUS_FIELD(T, support_normal, "1"),
                                      RTBUS_FIELD(T, support_force_n, "N"),
                                      RTBUS_FIELD(T, support_friction, "1"),
                                      RTBUS_FIELD(T, support_velocity_m_s, "m/s"),
                                      RTBUS_FIELD(T, support_inverse_mass_per_kg, "1/kg"),
                                      RTBUS_FIELD(T, support_points, "1"),
                                      RTBUS_FIELD(T, yield_after_s, "s"),
                                      RTBUS_FIELD(T, yield_tool_m, "m"),
                                      RTBUS_FIELD(T, yield_reaction_n, "N"),
                                      RTBUS_FIELD(T, yield_normal, "1"),
                                      RTBUS_FIELD(T, yield_gap_m, "m")};
  static constexpr std::array kTables{
      RTBUS_TABLE(T, hands, hand_time_ns, hand_time_ns, kHandSlots),
      RTBUS_TABLE(T, contacts, contact_body, contact_inverse_mass_per_kg, kContactSlots),
      RTBUS_TABLE(T, bodies, body_index, body_proxy_force_n, kContactSlots),
      RTBUS_TABLE(T, supports, support_body, support_points, kSupportSlots),
      RTBUS_TABLE(T, yields, yield_after_s, yield_gap_m, kYieldSlots)};
};

static_assert(sizeof(ProxyContacts) == 11512 && TabularSample<ProxyContacts>);

/// `physics.contact_points.HAPTIC`, at most 30 times a second and only while an observer is attached: where the proxy
/// touches, or nearly so, whatever the method. The radius is that of Stepper::contact_radius_m(). Rows beyond the count
/// are zero.
struct ContactPoints {
  std::uint64_t step_index = 0;
  double simulated_s = 0.0;                               ///< Simulated time since the world was made.
  std::uint32_t count = 0;                                ///< Rows used, nearest first; soft ones last.
  std::uint32_t overflow = 0;                             ///< Contacts that found no row.
  std::array<Vec3, kContactSlots> point_m{};              ///< On the body, in W.
  std::array<Vec3, kContactSlots> normal{};               ///< Unit, towards the proxy.
  std::array<double, kContactSlots> gap_m{};              ///< Negative: penetrates.
  std::array<std::uint32_t, kContactSlots> body_index{};  ///< In the scene's order; soft ones after the others.
};

template <>
struct SampleTraits<ContactPoints> {
  static constexpr std::string_view kName = "rtbus/ContactPoints";
  using T = ContactPoints;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, step_index, "1"), RTBUS_FIELD(T, simulated_s, "s"),
                                      RTBUS_FIELD(T, count, "1"),      RTBUS_FIELD(T, overflow, "1"),
                                      RTBUS_FIELD(T, point_m, "m"),    RTBUS_FIELD(T, normal, "1"),
                                      RTBUS_FIELD(T, gap_m, "m"),      RTBUS_FIELD(T, body_index, "1")};
};
static_assert(sizeof(ContactPoints) == 984 && Sample<ContactPoints>);

}  // namespace rtbus
