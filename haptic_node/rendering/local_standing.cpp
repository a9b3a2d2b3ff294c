/// Contacts on static bodies whose true shape the loop knows.
#include <algorithm>
#include <array>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/messages.hpp"

namespace haptic {
namespace {

using Eigen::Vector3d;
using rtbus::shapes::StandingShape;
using rtbus::shapes::Surface;

/// A proxy whose centre is this near to a surface has no normal of its own: its contact stays as it was.
constexpr double kSurface_m = 1e-6;
/// Of one surface in one step. A smooth one has one, a crease two, a corner three.
constexpr std::size_t kMinima = 8;
/// Normals nearer than about 18 degrees: the impulse of the one is where the other begins.
constexpr double kSameNormal = 0.95;
/// What approaches by less than this share of its way slides along.
constexpr double kSlides = 1e-3;

Vector3d in_body(const StandingShape& standing, const Vector3d& p_W) {
  return standing.q_WB.conjugate() * (p_W - standing.p_WB);
}

}  // namespace

int LocalWorld::standing_of(std::uint32_t body) const noexcept {
  for (std::size_t i = 0; i < standing_.size(); ++i) {
    if (standing_[i].body == body) return static_cast<int>(i);
  }
  return -1;
}

/// On a hull the contact is where the hull is nearest to the proxy. Inside of it, it stays the plane that it was.
void LocalWorld::follow_hull(Contact& contact) noexcept {
  const auto index = static_cast<std::size_t>(contact.standing);
  const StandingShape& standing = standing_[index];
  const auto* const hull = std::get_if<rtbus::shapes::Hull>(&standing.shape);
  if (hull == nullptr) return;
  const Vector3d proxy_B = in_body(standing, position_m_);
  Vector3d nearest_B;
  if (!nearest_point(*hull, proxy_B, nearest_[index], nearest_B)) return;
  const Vector3d way_B = proxy_B - nearest_B;
  const double distance_m = way_B.norm();
  if (distance_m < kSurface_m) return;  // the direction of what is left is rounding
  contact.normal = standing.q_WB * Vector3d(way_B / distance_m);
  contact.from_centre_m = standing.p_WB + standing.q_WB * nearest_B - bodies_[contact.body].centre_m;
}

/// @returns whether that contact of the answer is on a surface, whose contacts each step finds by itself.
bool LocalWorld::name_surface(const rtbus::ProxyContacts& answer, std::size_t contact) noexcept {
  const std::size_t row = answer.contact_body[contact];
  const int index = standing_.empty() ? -1 : standing_of(answer.body_index[row]);
  if (index < 0 || proxy_radius_m_ < kLeastProxy_m) return false;
  if (standing_[static_cast<std::size_t>(index)].surface() == nullptr) return false;
  touchable_[static_cast<std::size_t>(index)] = {true, slot_of_row_[row], answer.contact_friction[contact]};
  any_touchable_ = true;
  return true;
}

double LocalWorld::look_m(double h) const noexcept {
  return h * std::clamp(2.0 * velocity_m_s_.norm(), kSlowLook_m_s, kFastLook_m_s);
}

/// The contacts of one surface, anew: where its distance to the proxy has a minimum.
void LocalWorld::follow_surface(std::size_t index, double h) noexcept {
  const StandingShape& standing = standing_[index];
  const Touchable& touchable = touchable_[index];
  std::array<Contact, kContacts>& old = old_contacts_;
  std::size_t old_count = 0, kept = 0;
  for (std::size_t i = 0; i < contact_count_; ++i) {
    if (contacts_[i].standing == static_cast<int>(index) && !contacts_[i].fades) {
      old[old_count++] = contacts_[i];
    } else {
      if (kept != i) contacts_[kept] = contacts_[i];
      ++kept;
    }
  }
  contact_count_ = kept;
  std::array<Surface::Minimum, kMinima> minima;
  const std::size_t found =
      standing.surface()->minima(in_body(standing, position_m_), proxy_radius_m_ + look_m(h), minima);
  std::array<bool, kContacts> matched{};
  for (std::size_t m = 0; m < found && contact_count_ < kContacts; ++m) {
    Contact contact;
    contact.body = touchable.body;
    contact.standing = static_cast<int>(index);
    contact.feature = minima[m].feature;
    contact.friction = touchable.friction;
    contact.from_centre_m = standing.p_WB + standing.q_WB * minima[m].point_m - bodies_[contact.body].centre_m;
    const Vector3d way = position_m_ - bodies_[contact.body].centre_m - contact.from_centre_m;
    std::size_t best = old_count;
    if (minima[m].distance_m >= kSurface_m) contact.normal = way / minima[m].distance_m;
    double best_cosine = kSameNormal;
    for (std::size_t j = 0; j < old_count; ++j) {
      if (matched[j]) continue;
      const bool same = old[j].feature == contact.feature;
      const double cosine = same ? 2.0 : old[j].normal.dot(contact.normal);
      if (cosine <= best_cosine) continue;
      best = j;
      best_cosine = cosine;
    }
    if (minima[m].distance_m < kSurface_m) {
      if (best == old_count) continue;
      contact.normal = old[best].normal;
    }
    if (best < old_count) {
      matched[best] = true;
      contact.offset_m = old[best].offset_m;
      contact.impulse_n_s = old[best].impulse_n_s;
    } else {
      contact.offset_m = std::max(0.0, -gap_of(contact));  // what comes to be inside is let out slowly
    }
    contacts_[contact_count_++] = contact;
  }
}

/// How far along `way_m` the proxy can go: the rows of a step know surfaces as far as it was looked for them.
Vector3d LocalWorld::free_way_m(const Vector3d& way_m, double h) const noexcept {
  const double length_m = way_m.norm(), seen_m = look_m(h);
  if (length_m <= seen_m) return way_m;
  const Vector3d along = way_m / length_m;
  double gone_m = seen_m;
  for (int look = 1; look < kLooks && gone_m < length_m; ++look) {
    for (std::size_t index = 0; index < touchable_.size(); ++index) {
      if (!touchable_[index].named) continue;
      const StandingShape& standing = standing_[index];
      const Vector3d at_B = in_body(standing, position_m_ + gone_m * along);
      const Vector3d along_B = standing.q_WB.conjugate() * along;
      std::array<Surface::Minimum, kMinima> minima;
      const std::size_t found = standing.surface()->minima(at_B, proxy_radius_m_ + seen_m, minima);
      for (std::size_t m = 0; m < found; ++m) {
        if (minima[m].distance_m < kSurface_m) return gone_m * along;
        const double approach_m = seen_m * (minima[m].point_m - at_B).dot(along_B) / minima[m].distance_m;
        if (approach_m > kSlides * seen_m && minima[m].distance_m - proxy_radius_m_ < approach_m) {
          return gone_m * along;
        }
      }
    }
    gone_m = std::min(length_m, gone_m + seen_m);
  }
  return gone_m * along;
}

}  // namespace haptic
