#include "haptic_node/rendering/proxy_contact_set.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "rtbus/eigen.hpp"

namespace haptic {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using rtbus::vector_of;

/// A tip of 5 mm goes round an edge so fast at 0.5 m/s.
constexpr double kFastestTurn_rad_s = 100.0;
/// Of the radius, and in rad: what turns by less in a step is as good as what stands. With ten times that a way around
/// all edges of a cube costs 0.4 mJ; with this it costs 1e-17 J.
constexpr double kTurns = 0.001;
/// A hand that is nearer to an edge than this share of the proxy's radius turns it too fast to be foreseen.
constexpr double kNearCore = 0.1;
/// What would recede for longer was no contact, but an answer that made no sense.
constexpr double kRecedes_s = 1.0;
/// Square of the sine of an angle that is none.
constexpr double kSameDirection = 1e-24;

std::size_t contacts_of(const rtbus::ProxyContacts& answer) noexcept {
  return std::min<std::size_t>(answer.contacts, rtbus::kContactSlots);
}

}  // namespace

bool ProxyContactSet::any_of(std::size_t body) const noexcept {
  const auto contacts = all();
  return std::any_of(contacts.begin(), contacts.end(), [body](const Contact& contact) { return contact.body == body; });
}

void ProxyContactSet::drop(std::size_t body) noexcept {
  for (std::size_t i = 0; i < count_;) {
    if (contacts_[i].body == body)
      contacts_[i] = contacts_[--count_];
    else
      ++i;
  }
}

void ProxyContactSet::turn(std::size_t body, const Quaterniond& turned) noexcept {
  for (std::size_t i = 0; i < count_; ++i) {
    if (contacts_[i].body != body || contacts_[i].fades) continue;
    contacts_[i].from_centre_m = turned * contacts_[i].from_centre_m;
    contacts_[i].normal = turned * contacts_[i].normal;
  }
}

Vector3d ProxyContactSet::carried_m_s(const Contact& contact, const BodyMotion& motion) noexcept {
  if (!contact.fades) return motion.velocity_at(contact.from_centre_m);
  return std::min(0.0, contact.normal.dot(motion.velocity_m_s)) * contact.normal;
}

double ProxyContactSet::gap_of(const Contact& contact, Bodies bodies, const LocalProxy& proxy) noexcept {
  if (contact.fades) return contact.normal.dot(proxy.position_m - contact.faded_m) - proxy.radius_m;
  const Vector3d point = bodies[contact.body].motion.centre_m + contact.from_centre_m;
  if (contact.radius_m <= 0.0) return contact.normal.dot(proxy.position_m - point) - proxy.radius_m;
  return (proxy.position_m - point + contact.radius_m * contact.normal).norm() - contact.radius_m - proxy.radius_m;
}

/// On a ball the contact goes where the proxy goes.
void ProxyContactSet::roll(Contact& contact, Bodies bodies, const LocalProxy& proxy) noexcept {
  const Vector3d middle = contact.from_centre_m - contact.radius_m * contact.normal;
  const Vector3d way = proxy.position_m - bodies[contact.body].motion.centre_m - middle;
  if (way.squaredNorm() <= 1e-12) return;
  contact.normal = way.normalized();
  contact.from_centre_m = middle + contact.radius_m * contact.normal;
}

/// On a convex shape the contact is where that is nearest to the proxy. Inside of it, it stays the plane that it was.
/// @param most_rad So far a body that forces move turns it: one that falls past the proxy turns the force no faster
/// than the hand follows.
void ProxyContactSet::follow(Contact& contact, Bodies bodies, const LocalProxy& proxy, NearShapes& shapes,
                             double most_rad) noexcept {
  const LocalBody& body = bodies[contact.body];
  Vector3d point_m, normal;
  if (!shapes.nearest(body, proxy.position_m, point_m, normal)) return;
  contact.from_centre_m = point_m - body.motion.centre_m;
  const Vector3d axis = contact.normal.cross(normal);
  const double angle_rad = std::acos(std::clamp(normal.dot(contact.normal), -1.0, 1.0));
  if (body.as<FreeBody>() == nullptr || angle_rad <= most_rad || axis.squaredNorm() < kSameDirection) {
    contact.normal = normal;
  } else {
    contact.normal = Eigen::AngleAxisd(most_rad, axis.normalized()) * contact.normal;
  }
}

/// The contacts of one surface, anew: where its distance to the proxy has a minimum.
void ProxyContactSet::follow_surface(const NearShapes::Named& named, Bodies bodies, const LocalProxy& proxy, double h,
                                     NearShapes& shapes) noexcept {
  const Vector3d& centre_m = bodies[named.body].motion.centre_m;
  std::size_t old_count = 0, kept = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    if (contacts_[i].surface == named.shape && !contacts_[i].fades) {
      old_[old_count++] = contacts_[i];
    } else {
      if (kept != i) contacts_[kept] = contacts_[i];
      ++kept;
    }
  }
  count_ = kept;
  NearShapes::Minima minima;
  const double reach_m = proxy.radius_m + shapes.look_m(proxy.velocity_m_s.norm(), h);
  const std::size_t found = shapes.minima(named.shape, proxy.position_m, reach_m, minima);
  std::array<bool, kContacts> matched{};
  for (std::size_t m = 0; m < found && count_ < kContacts; ++m) {
    Contact contact;
    contact.body = named.body;
    contact.surface = named.shape;
    contact.feature = minima[m].feature;
    contact.friction = named.friction;
    contact.from_centre_m = minima[m].point_m - centre_m;
    const bool clear = minima[m].distance_m >= NearShapes::kSurface_m;
    if (clear) contact.normal = (proxy.position_m - centre_m - contact.from_centre_m) / minima[m].distance_m;
    std::size_t best = old_count;
    double best_cosine = tuning_.same_plane_cosine;
    for (std::size_t j = 0; j < old_count; ++j) {
      if (matched[j]) continue;
      const bool same = old_[j].feature == contact.feature;
      const double cosine = same ? 2.0 : old_[j].normal.dot(contact.normal);
      if (cosine <= best_cosine) continue;
      best = j;
      best_cosine = cosine;
    }
    if (!clear) {
      if (best == old_count) continue;
      contact.normal = old_[best].normal;
    }
    if (best < old_count) {
      matched[best] = true;
      contact.offset_m = old_[best].offset_m;
      contact.impulse_n_s = old_[best].impulse_n_s;
    } else {
      contact.offset_m = std::max(0.0, -gap_of(contact, bodies, proxy));  // what comes to be inside is let out slowly
    }
    contacts_[count_++] = contact;
  }
}

/// @returns whether a contact of the answer with that body is on a surface, whose contacts each step finds.
bool ProxyContactSet::name_surface(std::size_t body, double friction, Bodies bodies, const LocalProxy& proxy,
                                   NearShapes& shapes) noexcept {
  const int shape = bodies[body].shape;
  if (!shapes.is_surface(shape) || !shapes.holds(proxy.radius_m)) return false;
  shapes.name({shape, body, friction});
  return true;
}

/// @returns whether the answer has a contact with that row's body whose normal is about that one.
bool ProxyContactSet::names(const TakenAnswer& taken, std::size_t row, const Vector3d& normal) const noexcept {
  for (std::size_t i = 0; i < contacts_of(taken.answer); ++i) {
    if (taken.answer.contact_body[i] != row) continue;
    if (normal.dot(taken.turned[row] * vector_of(taken.answer.contact_normal[i])) > tuning_.same_contact_cosine)
      return true;
  }
  return false;
}

/// @returns whether the proxy's centre is inside of the body of that contact, and the way out leads into another body.
bool ProxyContactSet::blocked(const rtbus::ProxyContacts& answer, std::size_t contact, double gap_m,
                              const LocalProxy& proxy) const noexcept {
  if (gap_m > -behind_m(proxy)) return false;
  const Vector3d normal = vector_of(answer.contact_normal[contact]);
  for (std::size_t i = 0; i < contacts_of(answer); ++i) {
    if (answer.contact_body[i] == answer.contact_body[contact]) continue;
    const Vector3d other = vector_of(answer.contact_normal[i]);
    const Vector3d there_m = proxy.position_m - gap_m * normal;
    const bool opposes = other.dot(normal) < -tuning_.same_contact_cosine;
    if (opposes && other.dot(there_m - vector_of(answer.contact_point_m[i])) < proxy.radius_m) return true;
  }
  return false;
}

/// Deep inside of a body its nearest surface may be another one in each answer: a way out, once begun, is kept.
/// @returns whether `contact` has become that one.
bool ProxyContactSet::keep_way_out(const TakenAnswer& taken, std::size_t row, std::size_t old_count,
                                   std::span<bool> matched, Bodies bodies, const LocalProxy& proxy,
                                   Contact& contact) noexcept {
  const double good_s = tuning_.way_out_s + tuning_.way_out_periods() * std::clamp(taken.answer.step_s, 0.0, 1.0);
  const auto good_ns = static_cast<std::uint64_t>(good_s * 1e9);
  for (std::size_t j = 0; j < old_count; ++j) {
    const bool leads_out = !matched[j] && old_[j].body == contact.body && taken.now_ns <= old_[j].named_ns + good_ns &&
                           old_[j].active() && gap_of(old_[j], bodies, proxy) < 0.0 &&
                           old_[j].normal.dot(contact.normal) < 0.0;
    if (!leads_out || names(taken, row, old_[j].normal)) continue;
    matched[j] = true;
    contact = old_[j];
    contact.fades = false;
    contact.offset_m = old_[j].gap_m - gap_of(contact, bodies, proxy);
    contact.late_m_s.setZero();
    return true;
  }
  return false;
}

/// @returns the old contact that is this one; old_count: none.
std::size_t ProxyContactSet::match(const Contact& contact, std::size_t old_count,
                                   std::span<const bool> matched) const noexcept {
  std::size_t best = old_count;
  double best_cosine = tuning_.same_contact_cosine;
  for (std::size_t j = 0; j < old_count; ++j) {
    const double cosine = old_[j].normal.dot(contact.normal);
    if (matched[j] || old_[j].body != contact.body || cosine <= best_cosine) continue;
    best = j;
    best_cosine = cosine;
  }
  return best;
}

void ProxyContactSet::remember(Bodies bodies, const LocalProxy& proxy) noexcept {
  for (std::size_t i = 0; i < count_; ++i) {
    Contact& contact = contacts_[i];
    contact.gap_m = gap_of(contact, bodies, proxy) + contact.offset_m;
    contact.late_m_s += carried_m_s(contact, bodies[contact.body].motion);
  }
}

std::optional<double> ProxyContactSet::take(const TakenAnswer& taken, Bodies bodies, const LocalProxy& proxy,
                                            NearShapes& shapes) noexcept {
  const rtbus::ProxyContacts& answer = taken.answer;
  const std::size_t old_count = count_;
  std::copy_n(contacts_.begin(), old_count, old_.begin());
  std::array<bool, kContacts> matched{};
  count_ = 0;
  shapes.forget_names();
  std::optional<double> correction_m;
  for (std::size_t i = 0; i < contacts_of(answer); ++i) {
    const std::size_t row = answer.contact_body[i];
    if (row >= taken.rigid_rows) continue;
    const std::size_t slot = taken.slot_of_row[row];
    if (name_surface(slot, answer.contact_friction[i], bodies, proxy, shapes)) continue;
    Contact& contact = contacts_[count_++];
    contact = Contact{};
    contact.named_ns = taken.now_ns;
    contact.body = slot;
    contact.from_centre_m =
        taken.turned[row] * (vector_of(answer.contact_point_m[i]) - vector_of(answer.body_centre_m[row]));
    contact.normal = taken.turned[row] * vector_of(answer.contact_normal[i]);
    contact.friction = answer.contact_friction[i];
    if (answer.contact_curvature_per_m[i] > 0.0) contact.radius_m = 1.0 / answer.contact_curvature_per_m[i];
    follow(contact, bodies, proxy, shapes, std::numbers::pi);
    const std::size_t best = match(contact, old_count, matched);
    const bool of_pile = bodies[slot].as<PileBody>() != nullptr;
    if (of_pile && contact.radius_m <= 0.0 && best < old_count && old_[best].active()) {
      contact.told_normal = std::exchange(contact.normal, old_[best].normal);
    }
    const double gap_m = gap_of(contact, bodies, proxy);
    if (best == old_count && gap_m < 0.0 && keep_way_out(taken, row, old_count, matched, bodies, proxy, contact)) {
      continue;
    }
    const bool felt = best < old_count && old_[best].active();
    // What physics has before the proxy, and what has come to be behind it unfelt, has gone past it: the plane goes on
    // where its body has ended.
    const bool past = !felt && bodies[contact.body].as<FixedBody>() == nullptr && gap_m < -behind_m(proxy) &&
                      answer.contact_gap_m[i] > -behind_m(proxy);
    if (past || (best == old_count && blocked(answer, i, gap_m, proxy))) {
      --count_;
      continue;
    }
    if (best < old_count) {
      matched[best] = true;
      contact.impulse_n_s = old_[best].impulse_n_s;
    }
    const LocalBody& body = bodies[contact.body];
    if (contact.active()) {
      contact.offset_m = old_[best].gap_m - gap_m;
      correction_m = std::max(correction_m.value_or(0.0), std::abs(contact.offset_m - old_[best].offset_m));
      if (!of_pile) {
        contact.late_m_s = old_[best].late_m_s - body.motion.velocity_at(contact.from_centre_m);
        const double late = contact.late_m_s.norm();
        if (late > tuning_.recovery_m_s) contact.late_m_s *= tuning_.recovery_m_s / late;
      }
    } else if (gap_m < 0.0) {
      contact.offset_m = -gap_m;
    }
  }
  for (std::size_t j = 0; j < old_count && count_ < kContacts; ++j) {
    if (matched[j] || !old_[j].active() || !bodies[old_[j].body].used) continue;
    Contact& contact = contacts_[count_++];
    contact = old_[j];
    if (!contact.fades && shapes.is_named(contact.surface)) {
      correction_m = correction_m.value_or(0.0);
      continue;
    }
    if (old_[j].gap_m < -kRecedes_s * tuning_.recovery_m_s) {
      --count_;
      continue;
    }
    contact.late_m_s.setZero();
    contact.fades = true;
    contact.faded_m = proxy.position_m - (proxy.radius_m + old_[j].gap_m) * contact.normal;  // where it was felt
    contact.offset_m = 0.0;
    contact.radius_m = 0.0;
  }
  return correction_m;
}

void ProxyContactSet::blend(Bodies bodies, double h) noexcept {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    Contact& contact = contacts_[i];
    contact.blend_m_s = 0.0;
    if (contact.told_normal && !contact.fades) {
      const double share = bodies[contact.body].blend.share(h);
      contact.normal = (contact.normal + share * (*contact.told_normal - contact.normal)).normalized();
    }
    if (contact.fades) {
      // It recedes until it is felt no more.
      if (!contact.active()) continue;
      contact.offset_m += tuning_.recovery_m_s * h;
      contact.faded_m += h * carried_m_s(contact, bodies[contact.body].motion);
    } else if (contact.offset_m != 0.0 || !contact.late_m_s.isZero(0.0)) {
      const Blend& blend = bodies[contact.body].blend;
      const double rise_m = std::min(blend.share(h) * contact.offset_m, tuning_.recovery_m_s * h);
      contact.offset_m -= rise_m;
      contact.blend_m_s = rise_m / h;
      contact.late_m_s *= blend.velocity_left(h);
    }
    if (kept != i) contacts_[kept] = contact;
    ++kept;
  }
  count_ = kept;
}

bool ProxyContactSet::bend(Bodies bodies, const LocalProxy& proxy, const Vector3d& way_m, const Vector3d& free_way_m,
                           std::span<const SolverContact> rows, double h, NearShapes& shapes) noexcept {
  std::size_t strongest = rows.size();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Contact& contact = contacts_[row_source_[i]];
    const LocalBody& body = bodies[contact.body];
    const bool known = !contact.fades && (contact.surface >= 0 || (body.shape >= 0 && body.as<FreeBody>() == nullptr));
    if (!known || rows[i].normal_n_s <= 0.0) continue;
    if (strongest == rows.size() || rows[i].normal_n_s > rows[strongest].normal_n_s) strongest = i;
  }
  if (strongest == rows.size()) return false;
  Contact& contact = contacts_[row_source_[strongest]];
  const Vector3d normal = contact.normal;
  const auto along = [&normal](const Vector3d& way) -> Vector3d { return way - normal.dot(way) * normal; };
  const double slid_m = along(way_m).norm(), free_m = along(free_way_m).norm();
  if (slid_m <= kTurns * proxy.radius_m || slid_m > proxy.radius_m || free_m <= 0.0) return false;
  // Farther on there may be surfaces that this step does not know.
  const double seen_m = shapes.look_m(proxy.velocity_m_s.norm(), h);
  if (!shapes.named().empty() && way_m.norm() > seen_m) return false;
  const auto nearest = [&](const Vector3d& there_m, Vector3d& point_m, Vector3d& outward) {
    if (contact.surface < 0) return shapes.nearest(bodies[contact.body], there_m, point_m, outward);
    NearShapes::Minima minima;
    const std::size_t found = shapes.minima(contact.surface, there_m, proxy.radius_m + seen_m, minima);
    // The one that goes on where this one ends, and not another wall.
    double best_cosine = tuning_.same_contact_cosine;
    for (std::size_t m = 0; m < found; ++m) {
      if (minima[m].distance_m < NearShapes::kSurface_m) return false;
      const Vector3d way = (there_m - minima[m].point_m) / minima[m].distance_m;
      if (way.dot(normal) <= best_cosine) continue;
      best_cosine = way.dot(normal);
      point_m = minima[m].point_m;
      outward = way;
    }
    return best_cosine > tuning_.same_contact_cosine;
  };
  const Vector3d end_m = proxy.position_m + way_m;
  Vector3d point_m, turned;
  if (!nearest(end_m, point_m, turned)) return false;
  // What turns against the way is another wall.
  if (turned.dot(normal) > 1.0 - 0.5 * kTurns * kTurns || (turned - normal).dot(way_m) <= 0.0) return false;
  // The massless proxy ends where the shape is nearest to its free place, as far as friction lets it slide.
  const Vector3d pulled = proxy.position_m + free_way_m - point_m;
  const double left_m = pulled.norm();
  if (left_m > kNearCore * proxy.radius_m && pulled.dot(turned) > 0.0) {
    const Vector3d exact_m = point_m + (proxy.radius_m / left_m) * pulled;
    if (!nearest(end_m + std::min(1.0, slid_m / free_m) * (exact_m - end_m), point_m, turned)) return false;
  }
  contact.normal = turned;
  contact.from_centre_m = point_m - bodies[contact.body].motion.centre_m;
  bent_ = row_source_[strongest];
  return true;
}

std::size_t ProxyContactSet::gather(Bodies bodies, const LocalProxy& proxy, const Vector3d& free_m_s,
                                    const Vector3d& pulled_m_s, double h, NearShapes& shapes, SolverContact* rows,
                                    std::span<bool> touched, bool again) noexcept {
  if (!again) {
    for (const NearShapes::Named& each : shapes.named()) follow_surface(each, bodies, proxy, h, shapes);
  }
  std::size_t count = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    Contact& contact = contacts_[i];
    if (!again && contact.radius_m > 0.0) roll(contact, bodies, proxy);
    if (!again && !contact.fades) follow(contact, bodies, proxy, shapes, kFastestTurn_rad_s * h);
    const Vector3d surface = carried_m_s(contact, bodies[contact.body].motion) + contact.late_m_s;
    contact.gap_m = gap_of(contact, bodies, proxy) + contact.offset_m;
    const double way_m =
        h * (contact.normal.dot(surface) - std::min(contact.normal.dot(free_m_s), contact.normal.dot(pulled_m_s)));
    const bool past = !contact.active() && contact.gap_m < -behind_m(proxy) - std::abs(way_m);
    if (count == kSolved || past || contact.gap_m > way_m + tuning_.reach_m()) {
      contact.impulse_n_s.setZero();
      continue;
    }
    touched[contact.body] = true;
    SolverContact& row = rows[count];
    row = SolverContact{};
    row.normal = contact.normal;
    row.from_b_m = contact.from_centre_m;
    row.surface_velocity_m_s = surface;
    // Before an edge the proxy is behind the plane of what comes after it, by less than it slides.
    const double behind_m_s = again && i == bent_ ? free_m_s.norm() : 0.0;
    row.closing_m_s = std::max(contact.gap_m / h, -tuning_.recovery_m_s - behind_m_s);
    row.friction = contact.friction;
    row.impulse_n_s = contact.impulse_n_s;
    row_source_[count++] = i;
  }
  // Surfaces that face each other with the proxy between do not both come nearer: they would squeeze it. Nor does one
  // come out of the proxy that pushes it against a body that forces move, nor that body: it would be thrown away.
  const auto moves = [&](std::size_t row) { return bodies[of_row(row).body].as<FreeBody>() != nullptr; };
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = i + 1; j < count; ++j) {
      const bool throws = moves(i) || moves(j);
      if (rows[i].normal.dot(rows[j].normal) >= (throws ? 0.0 : -tuning_.same_contact_cosine)) continue;
      const bool both = rows[i].closing_m_s < 0.0 && rows[j].closing_m_s < 0.0;
      if (both || (throws && of_row(j).active())) rows[i].closing_m_s = std::max(0.0, rows[i].closing_m_s);
      if (both || (throws && of_row(i).active())) rows[j].closing_m_s = std::max(0.0, rows[j].closing_m_s);
    }
  }
  return count;
}

void ProxyContactSet::keep() noexcept {
  kept_count_ = count_;
  std::copy_n(contacts_.begin(), count_, kept_.begin());
}

void ProxyContactSet::bring_back() noexcept {
  count_ = kept_count_;
  std::copy_n(kept_.begin(), count_, contacts_.begin());
}

void ProxyContactSet::advance(double h) noexcept {
  for (std::size_t i = 0; i < count_; ++i) contacts_[i].offset_m -= h * contacts_[i].normal.dot(contacts_[i].late_m_s);
}

}  // namespace haptic
