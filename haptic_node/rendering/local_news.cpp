/// LocalWorld::take(): what an answer of physics changes in the local world.
#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace haptic {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Two normals of one body that are nearer than this belong to one contact.
constexpr double kSameContact = 0.5;
/// A proxy without a size is deep in a body from here on.
constexpr double kDeep_m = 1e-3;
/// So many points of a support make a patch, on which a body stands without tilting.
constexpr std::uint32_t kPatchPoints = 3;
/// Friction of a patch resists spin with its bound at this many radii of gyration: four corners of a square.
constexpr double kPatchRadius = 1.7;
/// A push that lasts makes a heap as much faster as the lightest neighbour of the body, or the body itself where that
/// is heavier, would get in this time.
constexpr double kHeapMobility_s = 0.2e-3;
/// An answer is good for its period, which has one more to go until the next must be here, and a little more.
constexpr double kGoodFor = 1.5;
constexpr double kGoodBesides_s = 3e-3;

using rtbus::vector_of;
Matrix3d matrix_of(const rtbus::Symmetric3& m) noexcept {
  Matrix3d out;
  out << m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5];
  return out;
}

/// Only balls have contacts with a curvature.
bool is_ball(const rtbus::ProxyContacts& answer, std::size_t row) noexcept {
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.contacts, rtbus::kContactSlots); ++i) {
    if (answer.contact_body[i] == row) return answer.contact_curvature_per_m[i] > 0.0;
  }
  return false;
}

/// The largest inverse mass of what holds the body; 0: all that holds it stands.
double loosest_support(const rtbus::ProxyContacts& answer, std::size_t row) noexcept {
  double out = 0.0;
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.supports, rtbus::kSupportSlots); ++i) {
    if (answer.support_body[i] == row) out = std::max(out, answer.support_inverse_mass_per_kg[i]);
  }
  return out;
}

}  // namespace

void LocalWorld::take(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept {
  good_until_ns_ = now_ns + static_cast<std::uint64_t>((kGoodFor * answer.step_s + kGoodBesides_s) * 1e9);
  given_apart_ns_ = static_cast<std::uint64_t>(kHistorySteps * answer.step_s * 1e9 / ImpulseHistory::kRecords);
  blend_s_ = std::max(kBlend_s, kBlendSteps * answer.step_s);
  heap_blend_s_ = std::max(kBlend_s, kHeapBlendSteps * answer.step_s);
  rock_blend_s_ = std::max(kRockBlend_s, kHeapBlendSteps * answer.step_s);
  proxy_radius_m_ = answer.proxy_radius_m;
  // Gaps and velocities as felt, before anything is moved.
  for (std::size_t i = 0; i < contact_count_; ++i) {
    contacts_[i].gap_m = gap_of(contacts_[i]) + contacts_[i].offset_m;
    contacts_[i].late_m_s += surface_m_s(contacts_[i]);
  }
  rigid_rows_ = LocalSoft::rigid_rows(answer);
  soft_.take(answer, position_m_, blend_s_);
  take_bodies(answer, now_ns);
  take_supports(answer);
  catch_up(answer, now_ns);
  take_contacts(answer, now_ns);
  for (Body& body : bodies_) {
    const auto slot = static_cast<std::size_t>(&body - bodies_.data());
    const bool fading = std::any_of(contacts_.begin(), contacts_.begin() + static_cast<std::ptrdiff_t>(contact_count_),
                                    [slot](const Contact& contact) { return contact.body == slot; });
    if (!body.named && !fading) body.used = false;
  }
}

std::size_t LocalWorld::slot_of(std::uint32_t index) noexcept {
  std::size_t free = kBodies;
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    if (bodies_[slot].used && bodies_[slot].index == index) return slot;
    if (!bodies_[slot].used && free == kBodies) free = slot;
  }
  if (free < kBodies) return free;
  // All are taken: one that this answer does not name must go, and is not felt: the contacts of that are to recede.
  std::array<bool, kBodies> felt{};
  for (std::size_t i = 0; i < contact_count_; ++i) {
    if (!contacts_[i].impulse_n_s.isZero(0.0)) felt[contacts_[i].body] = true;
  }
  const bool any = std::any_of(bodies_.begin(), bodies_.end(), [&](const Body& body) {
    return !body.named && !felt[static_cast<std::size_t>(&body - bodies_.data())];
  });
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    if (bodies_[slot].named || (any && felt[slot])) continue;
    for (std::size_t i = 0; i < contact_count_;) {
      if (contacts_[i].body == slot)
        contacts_[i] = contacts_[--contact_count_];
      else
        ++i;
    }
    bodies_[slot].used = false;
    return slot;
  }
  return 0;
}

/// Bodies as of the answer's instant; those of a heap as of now.
void LocalWorld::take_bodies(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept {
  for (Body& body : bodies_) body.named = false;
  const double age_s = answer.device_time_ns < now_ns ? rtbus::seconds_between(answer.device_time_ns, now_ns) : 0.0;
  for (std::size_t row = 0; row < rigid_rows_; ++row) {
    const std::size_t slot = slot_of(answer.body_index[row]);
    Body& body = bodies_[slot];
    if (!body.used) {
      body = Body{};
      body.index = answer.body_index[row];
      given_[slot].forget();
    }
    // Of what it had been given before it was known, nothing is known, nor is any of that ours.
    const Impulse then = given_[slot].at(answer.device_time_ns, body.given);
    body.centre_m = vector_of(answer.body_centre_m[row]);
    body.jammed = take_heap(answer, row, body, then.linear_n_s, age_s);
    if (!body.jammed) {
      body.motion.velocity_m_s = vector_of(answer.body_velocity_m_s[row]);
      body.motion.angular_velocity_rad_s = vector_of(answer.body_angular_velocity_rad_s[row]);
    }
    body.used = body.named = true;
    body.told_ns = answer.device_time_ns;
    body.told_centre_m = vector_of(answer.body_centre_m[row]);
    body.told_given_n_s = then.linear_n_s;
    body.moves = answer.body_kind[row] != 0;
    body.driven = answer.body_kind[row] == 1;
    body.ball = is_ball(answer, row);
    body.motion.inverse_mass_per_kg = answer.body_inverse_mass_per_kg[row];
    body.motion.inverse_inertia_per_kg_m2 = matrix_of(answer.body_inverse_inertia_per_kg_m2[row]);
    body.force_n = vector_of(answer.body_external_force_n[row]);
    body.torque_n_m = vector_of(answer.body_external_torque_n_m[row]);
    body.friction_bound_n = answer.body_friction_bound_n[row];
    body.supported = body.rocks = false;
    slot_of_row_[row] = slot;
    turned_since_[row].setIdentity();
  }
}

/// @returns whether other bodies that can move hold this one: a heap.
bool LocalWorld::take_heap(const rtbus::ProxyContacts& answer, std::size_t row, Body& body, const Vector3d& given_n_s,
                           double age_s) noexcept {
  const double loosest = loosest_support(answer, row);
  if (loosest <= 0.0) return false;
  const Vector3d centre_m = body.centre_m;
  LocalHeap& heap = body.heap;
  heap.set_mobility(kHeapMobility_s * std::min(loosest, answer.body_inverse_mass_per_kg[row]));
  if (body.used && body.told_ns != 0 && answer.device_time_ns > body.told_ns) {
    // Among bodies that give way to each other the speed of an instant is noise: the mean since the last answer is not.
    const double apart_s = rtbus::seconds_between(body.told_ns, answer.device_time_ns);
    heap.learn((given_n_s - body.told_given_n_s) / apart_s, (centre_m - body.told_centre_m) / apart_s,
               hand_m_s_.norm());
  } else if (!body.used) {
    heap.forget();
  }
  body.centre_m = centre_m + heap.way_m(body.given.linear_n_s - given_n_s, age_s);
  return true;
}

/// Supports push back only as far as they are pushed against: their forces of then are taken out of the body's force.
void LocalWorld::take_supports(const rtbus::ProxyContacts& answer) noexcept {
  auto& old = old_supports_;
  const std::size_t old_count = support_count_;
  std::copy_n(supports_.begin(), old_count, old.begin());
  support_count_ = 0;
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.supports, kSupports); ++i) {
    const std::size_t row = answer.support_body[i];
    if (row >= rigid_rows_ || bodies_[slot_of_row_[row]].jammed) continue;
    Support& support = supports_[support_count_++];
    support = Support{};
    support.body = slot_of_row_[row];
    Body& body = bodies_[support.body];
    support.from_centre_m = vector_of(answer.support_point_m[i]) - vector_of(answer.body_centre_m[row]);
    support.normal = vector_of(answer.support_normal[i]);
    // What touches moves as one along the normal; a solver leaves a remainder.
    support.velocity_m_s = vector_of(answer.support_velocity_m_s[i]);
    const Vector3d own_m_s = body.motion.velocity_m_s + body.motion.angular_velocity_rad_s.cross(support.from_centre_m);
    support.velocity_m_s += support.normal * support.normal.dot(own_m_s - support.velocity_m_s);
    support.force_n = answer.support_force_n[i];
    support.friction = answer.support_friction[i];
    if (answer.support_points[i] >= kPatchPoints) support.torsion_radius_m = 1.0;  // its size: hold_by_supports()
    body.force_n -= answer.support_force_n[i] * support.normal;
    body.torque_n_m -= support.from_centre_m.cross(answer.support_force_n[i] * support.normal);
    body.supported = true;
    for (std::size_t j = 0; j < old_count; ++j) {
      if (old[j].body != support.body || old[j].normal.dot(support.normal) < 0.9) continue;
      support.impulse_n_s = old[j].impulse_n_s;
      support.torsion_n_m_s = old[j].torsion_n_m_s;
      break;
    }
  }
  // The supports of the farthest bodies may not have found a place. Without them nothing would hold what they hold: it
  // goes on as it went.
  std::size_t complete = kBodies;
  if (answer.supports_overflow > 0 && answer.supports > 0) {
    complete = std::max<std::size_t>(answer.support_body[std::min<std::size_t>(answer.supports, kSupports) - 1], 1);
  }
  for (std::size_t row = 0; row < rigid_rows_; ++row) {
    const std::size_t slot = slot_of_row_[row];
    Body& body = bodies_[slot];
    if (row >= complete) {
      body.motion.inverse_mass_per_kg = 0.0;
      body.force_n.setZero();
      body.torque_n_m.setZero();
      // As in a heap: a speed that the hand does not share is over by the time it is told.
      const double lasting_m_s = std::max(LocalHeap::kOwnSpeed_m_s, hand_m_s_.norm());
      if (const double speed = body.motion.velocity_m_s.norm(); body.moves && !body.driven && speed > lasting_m_s) {
        body.motion.velocity_m_s *= lasting_m_s / speed;
        body.motion.angular_velocity_rad_s.setZero();
      }
    }
    if (body.jammed || body.motion.inverse_mass_per_kg <= 0.0) continue;
    if (body.supported) {
      hold_by_supports(slot);
    } else if (body.friction_bound_n > 0.0 && support_count_ < kSupports) {
      // It has slept since it was made: nobody knows yet what it stands on, only how hard that holds it.
      Support& support = supports_[support_count_++];
      support = Support{};
      support.body = slot;
      support.friction = 1.0;
      body.motion.inverse_inertia_per_kg_m2.setZero();
    }
  }
}

/// A body that stands on a patch does not tilt: the patch pushes where it must. It may still spin about the normal.
void LocalWorld::hold_by_supports(std::size_t slot) noexcept {
  SolverBody& motion = bodies_[slot].motion;
  bool patch = false, more = false;
  Vector3d normal = Vector3d::UnitY();
  for (std::size_t i = 0; i < support_count_; ++i) {
    const Support& support = supports_[i];
    if (support.body != slot || support.torsion_radius_m <= 0.0) continue;
    if (patch && std::abs(normal.dot(support.normal)) < 0.95) more = true;
    normal = support.normal;
    patch = true;
  }
  bodies_[slot].rocks = !patch;
  if (!patch) return;
  double about_normal = 0.0;
  if (!more) {
    const Matrix3d inertia = motion.inverse_inertia_per_kg_m2.inverse();
    if (inertia.allFinite()) about_normal = normal.dot(inertia * normal);
  }
  double radius_m = 0.0;
  motion.inverse_inertia_per_kg_m2.setZero();
  // What it was taken to tilt by is over, or it would roll on, and no friction would stop it.
  motion.angular_velocity_rad_s =
      more ? Vector3d(Vector3d::Zero()) : Vector3d(normal * normal.dot(motion.angular_velocity_rad_s));
  if (about_normal > 0.0) {
    motion.inverse_inertia_per_kg_m2 = normal * normal.transpose() / about_normal;
    radius_m = kPatchRadius * std::sqrt(about_normal * motion.inverse_mass_per_kg);
  }
  for (std::size_t i = 0; i < support_count_; ++i) {
    if (supports_[i].body == slot && supports_[i].torsion_radius_m > 0.0) supports_[i].torsion_radius_m = radius_m;
  }
}

/// @returns whether the answer has a contact with that body whose normal is about that one.
bool LocalWorld::names(const rtbus::ProxyContacts& answer, std::size_t row, const Vector3d& normal) const noexcept {
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.contacts, rtbus::kContactSlots); ++i) {
    if (answer.contact_body[i] != row) continue;
    if (normal.dot(turned_since_[row] * vector_of(answer.contact_normal[i])) > kSameContact) return true;
  }
  return false;
}

/// @returns whether the proxy's centre is inside of the body of that contact, and the way out leads into another body.
bool LocalWorld::blocked(const rtbus::ProxyContacts& answer, std::size_t contact, double gap_m) const noexcept {
  if (gap_m > -std::max(proxy_radius_m_, kDeep_m)) return false;
  const Vector3d normal = vector_of(answer.contact_normal[contact]);
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.contacts, rtbus::kContactSlots); ++i) {
    if (answer.contact_body[i] == answer.contact_body[contact]) continue;
    const Vector3d other = vector_of(answer.contact_normal[i]);
    const Vector3d there_m = position_m_ - gap_m * normal;
    const bool opposes = other.dot(normal) < -kSameContact;
    if (opposes && other.dot(there_m - vector_of(answer.contact_point_m[i])) < proxy_radius_m_) return true;
  }
  return false;
}

void LocalWorld::take_contacts(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept {
  auto& old = old_contacts_;
  const std::size_t old_count = contact_count_;
  std::copy_n(contacts_.begin(), old_count, old.begin());
  std::array<bool, kContacts> matched{};
  const auto way_out_ns =
      static_cast<std::uint64_t>((kWayOut_s + kWayOutSteps * std::clamp(answer.step_s, 0.0, 1.0)) * 1e9);
  contact_count_ = 0;
  for (Touchable& each : touchable_) each.named = false;
  any_touchable_ = false;
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.contacts, rtbus::kContactSlots); ++i) {
    const std::size_t row = answer.contact_body[i];
    if (row >= rigid_rows_ || name_surface(answer, i)) continue;
    Contact& contact = contacts_[contact_count_++];
    contact = Contact{};
    contact.named_ns = now_ns;
    contact.body = slot_of_row_[row];
    contact.from_centre_m =
        turned_since_[row] * (vector_of(answer.contact_point_m[i]) - vector_of(answer.body_centre_m[row]));
    contact.normal = turned_since_[row] * vector_of(answer.contact_normal[i]);
    contact.friction = answer.contact_friction[i];
    if (answer.contact_curvature_per_m[i] > 0.0) contact.radius_m = 1.0 / answer.contact_curvature_per_m[i];
    contact.standing = standing_.empty() ? -1 : standing_of(answer.body_index[row]);
    if (contact.standing >= 0) follow_hull(contact);
    const double gap_m = gap_of(contact);
    std::size_t best = old_count;
    double best_cosine = kSameContact;
    for (std::size_t j = 0; j < old_count; ++j) {
      const double cosine = old[j].normal.dot(contact.normal);
      if (matched[j] || old[j].body != contact.body || cosine <= best_cosine) continue;
      best = j;
      best_cosine = cosine;
    }
    if (best == old_count && gap_m < 0.0) {
      // Deep inside of a body its nearest surface may be another one in each answer: a way out, once begun, is kept.
      for (std::size_t j = 0; j < old_count && best == old_count; ++j) {
        const bool leads_out = !matched[j] && old[j].body == contact.body && now_ns <= old[j].named_ns + way_out_ns &&
                               !old[j].impulse_n_s.isZero(0.0) && gap_of(old[j]) < 0.0 &&
                               old[j].normal.dot(contact.normal) < 0.0;
        if (leads_out && !names(answer, row, old[j].normal)) best = j;
      }
      if (best < old_count) {
        matched[best] = true;
        contact = old[best];
        contact.offset_m = old[best].gap_m - gap_of(contact);
        contact.late_m_s.setZero();
        contact.fades = false;
        continue;
      }
    }
    if (best == old_count && blocked(answer, i, gap_m)) {
      --contact_count_;
      continue;
    }
    if (best < old_count) {
      matched[best] = true;
      contact.impulse_n_s = old[best].impulse_n_s;
    }
    if (!contact.impulse_n_s.isZero(0.0)) {
      contact.offset_m = old[best].gap_m - gap_m;
      if (!bodies_[contact.body].jammed) {
        contact.late_m_s = old[best].late_m_s - surface_m_s(contact);
        const double late = contact.late_m_s.norm();
        if (late > kRecovery_m_s) contact.late_m_s *= kRecovery_m_s / late;
      }
    } else if (gap_m < 0.0) {
      contact.offset_m = -gap_m;
    }
  }
  for (std::size_t j = 0; j < old_count && contact_count_ < kContacts; ++j) {
    if (matched[j] || old[j].impulse_n_s.isZero(0.0) || !bodies_[old[j].body].used) continue;
    Contact& contact = contacts_[contact_count_++];
    contact = old[j];
    if (!old[j].fades && old[j].standing >= 0 && touchable_[static_cast<std::size_t>(old[j].standing)].named) continue;
    contact.offset_m += old[j].gap_m - (gap_of(contact) + contact.offset_m);  // its body may have been moved
    contact.late_m_s.setZero();
    contact.fades = true;
  }
}

}  // namespace haptic
