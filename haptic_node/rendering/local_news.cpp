/// LocalWorld::take(): what an answer of physics changes in the local world.
#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"

namespace haptic {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Two normals of one body that are nearer than this belong to one contact.
constexpr double kSameContact = 0.5;
/// So many points of a support make a patch, on which a body stands without tilting.
constexpr std::uint32_t kPatchPoints = 3;
/// Friction of a patch resists spin with its bound at this many radii of gyration: four corners of a square.
constexpr double kPatchRadius = 1.7;
/// A push that lasts makes a heap as much faster as the lightest neighbour of the body would get in this time.
constexpr double kHeapMobility_s = 0.2e-3;
/// An answer is good for its period, which has one more to go until the next must be here, and a little more.
constexpr double kGoodFor = 1.5;
constexpr double kGoodBesides_s = 3e-3;

Vector3d vector_of(const rtbus::Vec3& v) noexcept { return {v[0], v[1], v[2]}; }
Matrix3d matrix_of(const rtbus::Symmetric3& m) noexcept {
  Matrix3d out;
  out << m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5];
  return out;
}

/// The largest inverse mass of what holds the body; 0: all that holds it stands.
double loosest_support(const rtbus::ProxyContacts& answer, std::size_t row) noexcept {
  double out = 0.0;
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.supports, rtbus::kSupportSlots); ++i) {
    if (answer.support_body[i] == row) out = std::max(out, answer.support_inverse_mass_per_kg[i]);
  }
  return out;
}

double seconds_from(std::uint64_t from_ns, std::uint64_t to_ns) noexcept {
  return to_ns >= from_ns ? rtbus::seconds_between(from_ns, to_ns) : -rtbus::seconds_between(to_ns, from_ns);
}

}  // namespace

void LocalWorld::take(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept {
  good_until_ns_ = now_ns + static_cast<std::uint64_t>((kGoodFor * answer.step_s + kGoodBesides_s) * 1e9);
  instant_apart_ns_ = static_cast<std::uint64_t>(kPastSteps * answer.step_s * 1e9 / kInstants);
  blend_s_ = std::max(kBlend_s, kBlendSteps * answer.step_s);
  heap_blend_s_ = std::max(kBlend_s, kHeapBlendSteps * answer.step_s);
  proxy_radius_m_ = answer.proxy_radius_m;
  // The gaps as felt, before anything is moved.
  for (std::size_t i = 0; i < contact_count_; ++i) contacts_[i].gap_m = gap_of(contacts_[i]) + contacts_[i].offset_m;
  rigid_rows_ = LocalSoft::rigid_rows(answer);
  soft_.take(answer, position_m_, blend_s_);
  take_bodies(answer, now_ns);
  take_supports(answer);
  take_contacts(answer);
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

bool LocalWorld::past_of(const Body& body, std::size_t slot, std::uint64_t time_ns, Past& out) const noexcept {
  if (instant_count_ == 0 || time_ns < body.since_ns) return false;
  // The first instant that is later, by halving; the ring keeps the newest kInstants.
  std::uint64_t low = instant_count_ > kInstants ? instant_count_ - kInstants : 0;
  std::uint64_t high = instant_count_;
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (instant_ns_[middle % kInstants] <= time_ns)
      low = middle + 1;
    else
      high = middle;
  }
  const std::uint64_t oldest = instant_count_ > kInstants ? instant_count_ - kInstants : 0;
  if (low == oldest) return false;
  const std::uint64_t before_ns = instant_ns_[(low - 1) % kInstants];
  const Past& past = instants_[(low - 1) % kInstants][slot];
  if (!past.used || past.index != body.index) return false;
  out = past;
  if (low == instant_count_) {
    out.centre_m += past.velocity_m_s * rtbus::seconds_between(before_ns, time_ns);
    return true;
  }
  const Past& next = instants_[low % kInstants][slot];
  if (!next.used || next.index != body.index) return true;
  const double share =
      rtbus::seconds_between(before_ns, time_ns) / rtbus::seconds_between(before_ns, instant_ns_[low % kInstants]);
  out.centre_m += share * (next.centre_m - past.centre_m);
  out.velocity_m_s += share * (next.velocity_m_s - past.velocity_m_s);
  out.given_n_s += share * (next.given_n_s - past.given_n_s);
  out.angular_velocity_rad_s += share * (next.angular_velocity_rad_s - past.angular_velocity_rad_s);
  out.turned = past.turned.slerp(share, next.turned);
  return true;
}

void LocalWorld::take_bodies(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept {
  for (Body& body : bodies_) body.named = false;
  const double age_s = answer.device_time_ns < now_ns ? rtbus::seconds_between(answer.device_time_ns, now_ns) : 0.0;
  for (std::size_t row = 0; row < rigid_rows_; ++row) {
    const std::size_t slot = slot_of(answer.body_index[row]);
    Body& body = bodies_[slot];
    const Vector3d centre_m = vector_of(answer.body_centre_m[row]);
    const Vector3d velocity_m_s = vector_of(answer.body_velocity_m_s[row]);
    const Vector3d rate_rad_s = vector_of(answer.body_angular_velocity_rad_s[row]);
    Past then;
    const bool known = body.used && past_of(body, slot, answer.device_time_ns, then);
    const bool jammed = take_heap(answer, row, body, known ? &then : nullptr, age_s);
    // The instant was remembered before the last answers put it right.
    for (const Correction& made : body.corrections) {
      if (made.made_ns <= answer.device_time_ns) continue;
      then.centre_m += made.way_m + made.speed_m_s * seconds_from(made.sample_ns, answer.device_time_ns);
      then.velocity_m_s += made.speed_m_s;
      then.angular_velocity_rad_s += made.rate_rad_s;
    }
    Quaterniond turned = Quaterniond::Identity();
    if (known) turned = (body.turned * then.turned.conjugate()).normalized();
    if (known && !jammed) {
      const Vector3d faster_m_s = velocity_m_s - then.velocity_m_s;
      body.centre_m += centre_m - then.centre_m + age_s * faster_m_s;
      body.motion.velocity_m_s += faster_m_s;
      body.motion.angular_velocity_rad_s += rate_rad_s - then.angular_velocity_rad_s;
      body.corrections[body.next_correction++ % kCorrections] = {now_ns, answer.device_time_ns,
                                                                 centre_m - then.centre_m, faster_m_s,
                                                                 rate_rad_s - then.angular_velocity_rad_s};
    } else if (!known) {
      // New, or so new that the answer is to a sample from before it.
      const std::uint64_t since_ns = body.used ? body.since_ns : now_ns;
      const LocalHeap heap = body.heap;
      body = Body{};
      body.heap = heap;
      body.index = answer.body_index[row];
      body.since_ns = since_ns;
      body.centre_m = centre_m + age_s * (jammed ? heap.speed_m_s() : velocity_m_s);
      body.motion.velocity_m_s = velocity_m_s;
      body.motion.angular_velocity_rad_s = rate_rad_s;
    }
    body.used = body.named = true;
    body.jammed = jammed;
    body.told_ns = answer.device_time_ns;
    body.told_centre_m = centre_m;
    body.told_given_n_s = known ? then.given_n_s : Vector3d(Vector3d::Zero());
    body.moves = answer.body_kind[row] != 0;
    const Matrix3d R = turned.toRotationMatrix();
    body.motion.inverse_mass_per_kg = answer.body_inverse_mass_per_kg[row];
    body.motion.inverse_inertia_per_kg_m2 = R * matrix_of(answer.body_inverse_inertia_per_kg_m2[row]) * R.transpose();
    body.force_n = vector_of(answer.body_external_force_n[row]);
    body.friction_bound_n = answer.body_friction_bound_n[row];
    body.supported = false;
    slot_of_row_[row] = slot;
    turned_since_[row] = turned;
  }
}

/// @returns whether other bodies that can move hold this one: a heap. Then where it is now follows from where it was
/// told to be, not from what it had been predicted to be: no error of a prediction outlives its answer.
bool LocalWorld::take_heap(const rtbus::ProxyContacts& answer, std::size_t row, Body& body, const Past* then,
                           double age_s) noexcept {
  const double loosest = loosest_support(answer, row);
  if (loosest <= 0.0) return false;
  const Vector3d centre_m = vector_of(answer.body_centre_m[row]);
  const Vector3d given_n_s = then != nullptr ? then->given_n_s : Vector3d(Vector3d::Zero());
  LocalHeap& heap = body.heap;
  heap.set_mobility(kHeapMobility_s * loosest);
  if (body.used && body.told_ns != 0 && answer.device_time_ns > body.told_ns) {
    // Among bodies that give way to each other the speed of an instant is noise: the mean since the last answer is not.
    const double apart_s = rtbus::seconds_between(body.told_ns, answer.device_time_ns);
    heap.learn((given_n_s - body.told_given_n_s) / apart_s, (centre_m - body.told_centre_m) / apart_s,
               hand_m_s_.norm());
  } else if (!body.used) {
    heap.forget();
  }
  if (then == nullptr) return true;
  body.centre_m = centre_m + heap.way_m(body.given_n_s - given_n_s, age_s);
  body.corrections = {};
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
    support.from_centre_m =
        turned_since_[row] * (vector_of(answer.support_point_m[i]) - vector_of(answer.body_centre_m[row]));
    support.normal = vector_of(answer.support_normal[i]);
    // What touches moves as one along the normal; a solver leaves a remainder.
    support.velocity_m_s = vector_of(answer.support_velocity_m_s[i]);
    const Vector3d own_m_s = body.motion.velocity_m_s + body.motion.angular_velocity_rad_s.cross(support.from_centre_m);
    support.velocity_m_s += support.normal * support.normal.dot(own_m_s - support.velocity_m_s);
    support.force_n = answer.support_force_n[i];
    support.friction = answer.support_friction[i];
    if (answer.support_points[i] >= kPatchPoints) support.torsion_radius_m = 1.0;  // its size: hold_by_supports()
    body.force_n -= answer.support_force_n[i] * support.normal;
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

void LocalWorld::take_contacts(const rtbus::ProxyContacts& answer) noexcept {
  auto& old = old_contacts_;
  const std::size_t old_count = contact_count_;
  std::copy_n(contacts_.begin(), old_count, old.begin());
  std::array<bool, kContacts> matched{};
  contact_count_ = 0;
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.contacts, rtbus::kContactSlots); ++i) {
    const std::size_t row = answer.contact_body[i];
    if (row >= rigid_rows_) continue;
    Contact& contact = contacts_[contact_count_++];
    contact = Contact{};
    contact.body = slot_of_row_[row];
    contact.from_centre_m =
        turned_since_[row] * (vector_of(answer.contact_point_m[i]) - vector_of(answer.body_centre_m[row]));
    contact.normal = turned_since_[row] * vector_of(answer.contact_normal[i]);
    contact.friction = answer.contact_friction[i];
    if (answer.contact_curvature_per_m[i] > 0.0) contact.radius_m = 1.0 / answer.contact_curvature_per_m[i];
    const double gap_m = gap_of(contact);
    std::size_t best = old_count;
    double best_cosine = kSameContact;
    for (std::size_t j = 0; j < old_count; ++j) {
      const double cosine = old[j].normal.dot(contact.normal);
      if (matched[j] || old[j].body != contact.body || cosine <= best_cosine) continue;
      best = j;
      best_cosine = cosine;
    }
    if (best < old_count) {
      matched[best] = true;
      contact.impulse_n_s = old[best].impulse_n_s;
    }
    if (!contact.impulse_n_s.isZero(0.0)) {
      contact.offset_m = old[best].gap_m - gap_m;
    } else if (gap_m < 0.0) {
      contact.offset_m = -gap_m;
    }
  }
  for (std::size_t j = 0; j < old_count && contact_count_ < kContacts; ++j) {
    if (matched[j] || old[j].impulse_n_s.isZero(0.0) || !bodies_[old[j].body].used) continue;
    Contact& contact = contacts_[contact_count_++];
    contact = old[j];
    contact.offset_m += old[j].gap_m - (gap_of(contact) + contact.offset_m);  // its body may have been moved
    contact.fades = true;
  }
}

}  // namespace haptic
