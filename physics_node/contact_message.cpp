#include "physics_node/contact_message.hpp"

#include <algorithm>

#include "rtbus/eigen.hpp"

namespace physics {
namespace {

static_assert(kMaxContacts == rtbus::kContactSlots && kMaxSupports == rtbus::kSupportSlots &&
              ToolReaction::kInstants == rtbus::kYieldSlots);

using rtbus::array_of;

rtbus::Symmetric3 array_of(const Eigen::Matrix3d& m) {
  return {m(0, 0), 0.5 * (m(0, 1) + m(1, 0)), 0.5 * (m(0, 2) + m(2, 0)), m(1, 1), 0.5 * (m(1, 2) + m(2, 1)), m(2, 2)};
}

void fill_head(const ContactSet& set, const rtbus::ProxyState& proxy, rtbus::ProxyContacts& out) {
  out.device_sequence = proxy.device_sequence;
  out.device_time_ns = proxy.device_time_ns;
  out.step_index = proxy.step_index;
  out.step_s = proxy.step_s;
  out.radius_m = set.radius_m;
  out.proxy_position_m = proxy.position_m;
  out.proxy_velocity_m_s = proxy.velocity_m_s;
  out.proxy_mass_kg = set.proxy_mass_kg;
  out.proxy_radius_m = set.proxy_radius_m;
  out.mapping_epoch = proxy.mapping_epoch;
  out.contacts_overflow = set.contacts_overflow;
  out.supports_overflow = set.supports_overflow;
}

void fill_contact(const Contact& contact, std::size_t i, rtbus::ProxyContacts& out) {
  out.contact_body[i] = contact.row;
  out.contact_point_m[i] = array_of(contact.point_m);
  out.contact_normal[i] = array_of(contact.normal);
  out.contact_gap_m[i] = contact.gap_m;
  out.contact_velocity_m_s[i] = array_of(contact.surface_velocity_m_s);
  out.contact_friction[i] = contact.friction;
  out.contact_curvature_per_m[i] = contact.curvature_per_m;
  out.contact_inverse_mass_per_kg[i] = array_of(contact.inverse_mass_per_kg);
}

void fill_body(const BodyBehind& body, std::size_t i, rtbus::ProxyContacts& out) {
  out.body_index[i] = body.body;
  out.body_kind[i] = static_cast<std::uint32_t>(body.kind);
  out.body_centre_m[i] = array_of(body.centre_m);
  const Eigen::Quaterniond& q_WB = body.orientation;
  out.body_orientation_wxyz[i] = {q_WB.w(), q_WB.x(), q_WB.y(), q_WB.z()};
  out.body_origin_from_centre_m[i] = array_of(body.origin_from_centre_m);
  out.body_velocity_m_s[i] = array_of(body.velocity_m_s);
  out.body_angular_velocity_rad_s[i] = array_of(body.angular_velocity_rad_s);
  out.body_inverse_mass_per_kg[i] = body.inverse_mass_per_kg;
  out.body_inverse_inertia_per_kg_m2[i] = array_of(body.inverse_inertia_per_kg_m2);
  out.body_external_force_n[i] = array_of(body.external_force_n);
  out.body_external_torque_n_m[i] = array_of(body.external_torque_n_m);
  out.body_friction_force_n[i] = array_of(body.friction_force_n);
  out.body_friction_torque_n_m[i] = array_of(body.friction_torque_n_m);
  out.body_friction_bound_n[i] = body.friction_bound_n;
  out.body_proxy_force_n[i] = array_of(body.proxy_force_n);
}

void fill_support(const Support& support, std::size_t i, rtbus::ProxyContacts& out) {
  out.support_body[i] = support.row;
  out.support_holder[i] = support.holder;
  out.support_point_m[i] = array_of(support.point_m);
  out.support_normal[i] = array_of(support.normal);
  out.support_force_n[i] = support.normal_force_n;
  out.support_friction[i] = support.friction;
  out.support_velocity_m_s[i] = array_of(support.surface_velocity_m_s);
  out.support_inverse_mass_per_kg[i] = support.inverse_mass_per_kg;
  out.support_points[i] = support.points;
}

void fill_reaction(const ToolReaction& reaction, rtbus::ProxyContacts& out) {
  out.yields = static_cast<std::uint32_t>(reaction.count);
  out.yield_stiffness_n_per_m = reaction.stiffness_n_per_m;
  out.yield_stiffness_across_n_per_m = reaction.stiffness_across_n_per_m;
  out.yield_friction = reaction.friction;
  out.yield_rest = reaction.rest;
  for (std::size_t i = 0; i < reaction.count; ++i) {
    const ToolReaction::Instant& each = reaction.instants[i];
    out.yield_after_s[i] = each.after_s;
    out.yield_tool_m[i] = array_of(each.tool_m);
    out.yield_reaction_n[i] = array_of(each.reaction_n);
    out.yield_normal[i] = array_of(each.normal);
    out.yield_gap_m[i] = each.gap_m;
  }
}

/// Rows of bodies that are not soft: they come first, and what soft ones do is told otherwise.
std::size_t rigid_rows(const ContactSet& set) {
  return static_cast<std::size_t>(std::find_if(set.bodies.begin(), set.bodies.end(),
                                               [](const BodyBehind& body) { return body.kind == BodyKind::kSoft; }) -
                                  set.bodies.begin());
}

}  // namespace

void fill_message(const ContactSet& set, const ToolReaction& reaction, const rtbus::ProxyState& proxy,
                  rtbus::ProxyContacts& out) {
  out = rtbus::ProxyContacts{};
  fill_head(set, proxy, out);
  fill_reaction(reaction, out);
  out.bodies = static_cast<std::uint32_t>(std::min(rigid_rows(set), kMaxContacts));
  const auto soft = std::find_if(set.contacts.begin(), set.contacts.end(),
                                 [&out](const Contact& contact) { return contact.row >= out.bodies; });
  out.contacts =
      static_cast<std::uint32_t>(std::min(static_cast<std::size_t>(soft - set.contacts.begin()), kMaxContacts));
  out.supports = static_cast<std::uint32_t>(std::min(set.supports.size(), kMaxSupports));
  for (std::size_t i = 0; i < out.contacts; ++i) fill_contact(set.contacts[i], i, out);
  for (std::size_t i = 0; i < out.bodies; ++i) fill_body(set.bodies[i], i, out);
  for (std::size_t i = 0; i < out.supports; ++i) fill_support(set.supports[i], i, out);
}

void fill_points(const ContactSet& set, rtbus::ContactPoints& out) {
  out = {.step_index = out.step_index, .simulated_s = out.simulated_s};
  out.count = static_cast<std::uint32_t>(std::min(set.contacts.size(), rtbus::kContactSlots));
  out.overflow = set.contacts_overflow;
  for (std::size_t i = 0; i < out.count; ++i) {
    const Contact& contact = set.contacts[i];
    out.point_m[i] = rtbus::array_of(contact.point_m);
    out.normal[i] = rtbus::array_of(contact.normal);
    out.gap_m[i] = contact.gap_m;
    out.body_index[i] = set.bodies[contact.row].body;
  }
}

}  // namespace physics
