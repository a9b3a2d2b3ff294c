#include "haptic_node/rendering/hand_impulses.hpp"

#include <algorithm>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace haptic {

using Eigen::Vector3d;
using rtbus::array_of;

std::size_t HandImpulses::hold(std::uint32_t body) noexcept {
  std::size_t best = kPlaces;
  for (std::size_t i = 0; i < kPlaces; ++i) {
    const Place& place = places_[i];
    if (place.used && place.body == body) {
      places_[i].held = true;
      return i;
    }
    if (place.held || told(i)) continue;
    if (best == kPlaces || (places_[best].used && !place.used)) best = i;
  }
  if (best == kPlaces) return best;  // never while at most kHeld are held
  Place& place = places_[best];
  place.used = place.held = true;
  place.body = body;
  place.sum = {};
  place.history.forget();
  return best;
}

void HandImpulses::release_all() noexcept {
  for (Place& place : places_) place.held = false;
}

bool HandImpulses::told(std::size_t place) const noexcept {
  return std::any_of(rows_.begin(), rows_.end(),
                     [place](const Row& row) { return row.generation != 0 && row.place == place; });
}

void HandImpulses::begin(std::uint64_t began_ns, std::uint64_t ends_ns) noexcept {
  count_ = 0;
  began_ns_ = began_ns;
  ends_ns_ = ends_ns;
}

// Sums are for ever: one step of a world that makes no sense must not be in them. What is left out here settle() shares
// as what the ladder changed.
void HandImpulses::give(std::size_t place, std::size_t slot, const Vector3d& impulse_n_s, const Vector3d& from_centre_m,
                        bool moves) noexcept {
  const bool sane = impulse_n_s.norm() <= kMostGiven_n_s && from_centre_m.norm() <= kFarthest_m;
  if (count_ == kMostEntries || !sane) return;
  Entry& entry = entries_[count_++];
  entry = {places_[place].body, place, slot, impulse_n_s, from_centre_m, moves, {}};
  book(entry.place, {impulse_n_s, from_centre_m.cross(impulse_n_s)}, moves);
  last_ = entry;
}

void HandImpulses::book(std::size_t place, const Impulse& impulse, bool moves) noexcept {
  open_row(place, moves);
  Place& at = places_[place];
  const Impulse before = at.sum;
  at.sum += impulse;
  at.history.add(began_ns_, ends_ns_, apart_ns_, before, at.sum);
}

/// The body that was given nothing for the longest time loses its row. A row in use is kept, or bodies that are touched
/// at the same time would take it from each other in every step: only a body that moves takes that of one that does
/// not.
void HandImpulses::open_row(std::size_t place, bool moves) noexcept {
  const auto in_use = [this](const Row& row) { return row.generation != 0 && row.last_step + 1 >= steps_; };
  const auto goes_before = [&](const Row& a, const Row& b) {
    if (in_use(a) != in_use(b)) return in_use(b);
    if (in_use(a)) return b.moves && !a.moves;
    return b.generation != 0 && (a.generation == 0 || a.last_step < b.last_step);
  };
  Row* first = &rows_.front();
  for (Row& row : rows_) {
    if (row.generation != 0 && row.place == place) {
      row.last_step = steps_;
      row.moves = moves;
      return;
    }
    if (goes_before(row, *first)) first = &row;
  }
  if (in_use(*first) && (first->moves || !moves)) return;
  *first = Row{place, ++generations_, steps_, moves, places_[place].sum, Vector3d::Zero()};
}

void HandImpulses::settle(const Vector3d& impulse_n_s) noexcept {
  const Vector3d felt_n_s = impulse_n_s.allFinite() ? impulse_n_s : Vector3d(Vector3d::Zero());
  const bool known = last_.place != kPlaces && places_[last_.place].body == last_.body;
  if (count_ == 0 && known && !felt_n_s.isZero(0.0)) {
    entries_[count_++] = last_;
    entries_[0].impulse_n_s.setZero();
    book(last_.place, {}, last_.moves);
  }
  double sizes_n_s = 0.0;
  Vector3d rest_n_s = felt_n_s;
  for (const Entry& entry : entries()) {
    sizes_n_s += entry.impulse_n_s.norm();
    rest_n_s -= entry.impulse_n_s;
  }
  for (std::size_t i = 0; i < count_; ++i) {
    Entry& entry = entries_[i];
    const double share = sizes_n_s > 0.0 ? entry.impulse_n_s.norm() / sizes_n_s : 1.0 / static_cast<double>(count_);
    const Vector3d more_n_s = rest_n_s * share;
    entry.more = {more_n_s, entry.from_centre_m.cross(more_n_s)};
    places_[entry.place].sum += entry.more;
    places_[entry.place].history.correct(ends_ns_, entry.more);
  }
  const double step_s = rtbus::seconds_between(began_ns_, ends_ns_);
  for (Row& row : rows_) {
    if (row.generation == 0) continue;
    row.integral_n_s2 += step_s * (places_[row.place].sum - row.before).linear_n_s;
  }
  ++steps_;
}

void HandImpulses::tell(rtbus::DeviceState& out) const noexcept {
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    const bool used = row.generation != 0;
    const Impulse sum = used ? places_[row.place].sum - row.before : Impulse{};
    out.hand_impulse_body[i] = used ? places_[row.place].body : 0;
    out.hand_impulse_generation[i] = row.generation;
    out.hand_impulse_n_s[i] = array_of(sum.linear_n_s);
    out.hand_angular_impulse_n_m_s[i] = array_of(sum.angular_n_m_s);
    out.hand_impulse_integral_n_s2[i] = array_of(row.integral_n_s2);
  }
}

}  // namespace haptic
