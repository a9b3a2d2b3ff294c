// What a LocalWorld takes from an answer of physics.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "haptic_node/rendering/blend.hpp"
#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"

namespace haptic {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

// Behind a network, where delays are long, vary, and answers get lost.
/// An answer that is older than so many steps and so much more has come over one.
constexpr double kNetworkSteps = 3.0, kNetwork_s = 10e-3;
/// It is good for so much of its age: a body that has gone on for that long without news may do so a little longer.
constexpr double kGoodForAge = 0.5;
/// So many ages of an answer are hand impulses known.
constexpr double kHistoryAges = 1.25;
/// Parts from the instant of an answer to now, at most.
constexpr int kNetworkParts = 64;

/// The change of the force by an answer is eased in for a period at most, or as long as bodies need to come to rest.
constexpr double kEasesFloors = 3.0, kLongestEase_s = 0.1;

/// The supports of the farthest bodies may not have found a place. @returns the first row that lacks some.
std::size_t complete_rows(const rtbus::ProxyContacts& answer) noexcept {
  if (answer.supports_overflow == 0 || answer.supports == 0) return rtbus::kContactSlots;
  const std::size_t last = std::min<std::size_t>(answer.supports, rtbus::kSupportSlots) - 1;
  return std::max<std::size_t>(answer.support_body[last], 1);
}

}  // namespace

void LocalWorld::take(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept {
  const double age_s = answer.device_time_ns < now_ns ? rtbus::seconds_between(answer.device_time_ns, now_ns) : 0.0;
  networked_ = age_s > kNetworkSteps * answer.step_s + kNetwork_s;
  const double network_s = networked_ ? age_s : 0.0;
  const double good_s =
      std::max(tuning_.good_periods * answer.step_s + tuning_.good_besides_s, kGoodForAge * network_s);
  good_until_ns_ = now_ns + static_cast<std::uint64_t>(good_s * 1e9);
  const double history_ns = std::max(tuning_.history_periods() * answer.step_s, kHistoryAges * network_s) * 1e9;
  const auto apart_ns = static_cast<std::uint64_t>(history_ns / ImpulseHistory::kSpan) + 1;
  // Without a network samples and steps keep in step.
  const double after_s = clock_.sample_after_world_s(answer.step_index, answer.step_s, answer.device_time_ns);
  world_lag_s_ = networked_ ? after_s : 0.0;
  impulses_.keep_apart(apart_ns);
  other_hands_.keep_apart(apart_ns);
  proxy_.radius_m = answer.proxy_radius_m;
  ease_s_ = std::max(kEasesFloors * tuning_.blend_floor_s, std::min(answer.step_s, kLongestEase_s));
  correction_m_.reset();
  contacts_.remember(bodies_, proxy_);

  for (LocalBody& body : slots()) body.named = false;
  const std::size_t rigid = std::min<std::size_t>(answer.bodies, rtbus::kContactSlots);
  std::array<std::size_t, rtbus::kContactSlots> slot_of_row{};
  std::array<Quaterniond, rtbus::kContactSlots> turned;
  // The local world is at its last sample: the step to the one of `now_ns` comes after this.
  take_rigid(answer, std::min(now_ns, now_ns_), slot_of_row, turned);
  for (LocalBody& body : slots()) {
    if (auto* const free = body.as<FreeBody>(); free != nullptr && !body.named) free->leave_supports();
  }
  const auto rigid_m = contacts_.take({answer, now_ns, rigid, slot_of_row, turned}, bodies_, proxy_, shapes_);
  if (rigid_m) correction_m_ = std::max(correction_m_.value_or(0.0), *rigid_m);
  for (std::size_t slot = 0; slot < slots_; ++slot) {
    const LocalBody& body = bodies_[slot];
    if (body.used && !body.named && !contacts_.any_of(slot)) free_slot(slot);
  }
  if (answer.yields == 0 && !yielding_.near()) return;
  const auto yields_m =
      yielding_.take(answer, proxy_.position_m, now_ns, Blend::of_yielding(tuning_, answer.step_s, hand_rests()));
  if (yields_m) correction_m_ = std::max(correction_m_.value_or(0.0), *yields_m);
  if (yielding_.near() && yielding_place_ == HandImpulses::kPlaces) {
    yielding_place_ = impulses_.hold(rtbus::kYieldingBodies);
  } else if (!yielding_.near()) {
    impulses_.release(yielding_place_);
    yielding_place_ = HandImpulses::kPlaces;
  }
}

void LocalWorld::free_slot(std::size_t slot) noexcept {
  contacts_.drop(slot);
  impulses_.release(bodies_[slot].place);
  bodies_[slot].used = false;
  while (slots_ > 0 && !bodies_[slots_ - 1].used) --slots_;
}

std::size_t LocalWorld::slot_of(std::uint32_t index) noexcept {
  std::size_t free = slots_;
  for (std::size_t slot = slots_; slot-- > 0;) {
    if (bodies_[slot].used && bodies_[slot].index == index) return slot;
    if (!bodies_[slot].used) free = slot;
  }
  slots_ = std::max(slots_, std::min(free + 1, kBodies));
  if (free < kBodies) return free;
  // All are taken: one that this answer has not named so far must go, and is not felt: the contacts of that are to
  // recede.
  std::array<bool, kBodies> felt{};
  for (const auto& contact : contacts_.all()) felt[contact.body] = felt[contact.body] || contact.active();
  for (const bool unfelt : {true, false}) {
    for (std::size_t slot = 0; slot < kBodies; ++slot) {
      if (bodies_[slot].named || (unfelt && felt[slot])) continue;
      free_slot(slot);
      slots_ = std::max(slots_, slot + 1);
      return slot;
    }
  }
  return 0;
}

LocalWorld::ToldSupports LocalWorld::read_supports(const rtbus::ProxyContacts& answer,
                                                   std::size_t rigid_rows) const noexcept {
  ToldSupports out;
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.supports, rtbus::kSupportSlots); ++i) {
    const std::size_t row = answer.support_body[i];
    const std::size_t holder = answer.support_holder[i];
    if (row >= rigid_rows || (holder > 0 && answer.support_points[i] == 0)) continue;  // near, and does not touch
    ++out.count[row];
    if (answer.support_points[i] == 2) ++out.ends[row];
    out.loosest_per_kg[row] = std::max(out.loosest_per_kg[row], answer.support_inverse_mass_per_kg[i]);
    // What holds another one is held by it.
    if (holder == 0 || holder > rigid_rows) continue;
    ++out.count[holder - 1];
    out.loosest_per_kg[holder - 1] = std::max(out.loosest_per_kg[holder - 1], answer.body_inverse_mass_per_kg[row]);
  }
  find_groups(answer, rigid_rows, out);
  return out;
}

/// Free bodies that push each other, and that nothing else holds that moves. Those of a group that is too large are a
/// pile.
void LocalWorld::find_groups(const rtbus::ProxyContacts& answer, std::size_t rigid_rows,
                             ToldSupports& out) const noexcept {
  const std::size_t supports = std::min<std::size_t>(answer.supports, rtbus::kSupportSlots);
  std::array<std::size_t, rtbus::kContactSlots> first{};  // row of each row's group
  std::iota(first.begin(), first.end(), std::size_t{0});
  for (std::size_t i = 0; i < supports; ++i) {
    const std::size_t a = answer.support_body[i], b = answer.support_holder[i];
    if (b == 0 || a >= rigid_rows || b > rigid_rows || first[a] == first[b - 1]) continue;
    const std::size_t keep = std::min(first[a], first[b - 1]), drop = std::max(first[a], first[b - 1]);
    std::replace(first.begin(), first.end(), drop, keep);
  }
  const std::size_t complete = complete_rows(answer);
  std::size_t groups = 0;
  for (std::size_t head = 0; head < rigid_rows; ++head) {
    std::size_t size = 0;
    bool free = first[head] == head;
    for (std::size_t row = head; row < rigid_rows; ++row) {
      if (first[row] != head) continue;
      ++size;
      free = free && row < complete && answer.body_kind[row] == 2 && answer.body_inverse_mass_per_kg[row] > 0.0;
    }
    for (std::size_t i = 0; i < supports; ++i) {
      const std::size_t row = answer.support_body[i];
      if (row >= rigid_rows || first[row] != head) continue;
      free = free && (answer.support_holder[i] > 0 || answer.support_inverse_mass_per_kg[i] <= 0.0);
    }
    if (!free || size < 2 || size > FreeBody::kMostTogether) continue;
    ++groups;
    for (std::size_t row = head; row < rigid_rows; ++row) {
      if (first[row] == head) out.group[row] = groups;
    }
  }
}

void LocalWorld::take_rigid(const rtbus::ProxyContacts& answer, std::uint64_t now_ns,
                            std::span<std::size_t> slot_of_row, std::span<Quaterniond> turned) noexcept {
  const std::size_t rigid_rows = std::min<std::size_t>(answer.bodies, rtbus::kContactSlots);
  const ToldSupports told = read_supports(answer, rigid_rows);
  // Every body goes on from the answer's instant to now in so many parts.
  const std::size_t complete = complete_rows(answer);
  int rows = 0;
  for (std::size_t row = 0; row < rigid_rows; ++row) {
    if (answer.body_kind[row] == 0) continue;
    const std::size_t count = told.count[row];
    const bool sleeps = count == 0 && row < complete && answer.body_friction_bound_n[row] > 0.0;
    const bool corners = shapes_.known().has_corners(answer.body_index[row]);
    rows += 1 + (told.loosest_per_kg[row] > 0.0 && told.group[row] == 0 ? 0
                 : sleeps                                               ? 1
                 : corners ? static_cast<int>(CornerSupports::kCorners * (count - told.ends[row] / 2))
                           : static_cast<int>(count));
  }
  int parts = 1;
  if (answer.device_time_ns < now_ns) {
    const double age_s = rtbus::seconds_between(answer.device_time_ns, now_ns);
    const double ticks = std::ceil(age_s / tick_s_ - 0.1);
    const double wanted = networked_ ? kNetworkParts : tuning_.parts;
    const bool any_group =
        std::any_of(told.group.begin(), told.group.end(), [](std::size_t group) { return group > 0; });
    const int budget = any_group ? tuning_.together_budget() : static_cast<int>(tuning_.row_budget);
    parts = std::max(1, std::min(static_cast<int>(std::min({1e3, ticks, wanted})), budget / std::max(1, rows)));
  }
  std::copy_n(supports_.rows.begin(), supports_.count, old_supports_.rows.begin());
  supports_.count = 0;
  supports_.spare = SupportPool::kSupports - std::min<std::size_t>(answer.supports, rtbus::kSupportSlots);
  for (std::size_t row = 0; row < rigid_rows; ++row) {
    slot_of_row[row] = slot_of(answer.body_index[row]);
    LocalBody& body = bodies_[slot_of_row[row]];
    if (!body.used) {
      body = LocalBody{};
      body.index = answer.body_index[row];
      body.place = impulses_.hold(body.index);
    }
    body.used = body.named = true;
    body.group = told.group[row];
  }
  for (std::size_t row = 0; row < rigid_rows; ++row) {
    const bool together = told.group[row] > 0;
    turned[row] = take_body({answer, row, row < complete, told.count[row], together ? 0.0 : told.loosest_per_kg[row],
                             together, slot_of_row.first(rigid_rows)},
                            slot_of_row[row], parts, now_ns);
  }
  replay_free(answer, slot_of_row.first(rigid_rows), parts, now_ns, turned);
}

SinceAnswer LocalWorld::since_answer(const rtbus::ProxyContacts& answer, const LocalBody& body, int parts,
                                     std::uint64_t now_ns) noexcept {
  return {answer.device_time_ns,
          now_ns,
          parts,
          tick_s_,
          impulses_.history(body.place),
          impulses_.sum(body.place),
          {other_hands_, answer, body.index},
          rows_.data(),
          tuning_,
          shapes_.known(),
          world_lag_s_,
          networked_,
          proxy_kg_};
}

/// @param turned Gets the turn of each free body, by row.
void LocalWorld::replay_free(const rtbus::ProxyContacts& answer, std::span<const std::size_t> slot_of_row, int parts,
                             std::uint64_t now_ns, std::span<Quaterniond> turned) noexcept {
  for (std::size_t first = 0; first < slot_of_row.size(); ++first) {
    const std::size_t group = bodies_[slot_of_row[first]].group;
    std::array<std::optional<SinceAnswer>, FreeBody::kMostTogether> since;
    std::array<FreeBody::Replayed, FreeBody::kMostTogether> members;
    std::array<std::size_t, FreeBody::kMostTogether> rows{};
    std::size_t count = 0;
    for (std::size_t row = 0; row < slot_of_row.size(); ++row) {
      LocalBody& body = bodies_[slot_of_row[row]];
      auto* const free = body.as<FreeBody>();
      const bool with_it = row == first || (group > 0 && body.group == group);
      if (!with_it || free == nullptr || count == members.size()) continue;
      if (row < first) break;  // it has gone with an earlier one
      since[count].emplace(since_answer(answer, body, parts, now_ns));
      members[count] = {free, &body.motion, &*since[count], static_cast<int>(slot_of_row[row])};
      rows[count++] = row;
    }
    if (count == 0) continue;
    FreeBody::replay({members.data(), count}, supports_);
    for (std::size_t k = 0; k < count; ++k) turned[rows[k]] = members[k].turned;
  }
}

Quaterniond LocalWorld::take_body(const ToldBody& told, std::size_t slot, int parts, std::uint64_t now_ns) noexcept {
  const rtbus::ProxyContacts& answer = told.answer;
  LocalBody& body = bodies_[slot];
  body.ladder.replayed();
  const SinceAnswer since = since_answer(answer, body, parts, now_ns);
  const Impulse then = since.given_at(since.from_ns);
  body.blend = Blend::of(tuning_, answer.step_s);
  Quaterniond turned = Quaterniond::Identity();
  if (answer.body_kind[told.row] == 0) {
    turned = body.become<FixedBody>().take(told, body.motion);
  } else if (answer.body_kind[told.row] == 1) {
    turned = body.become<DrivenBody>().take(told, since, body.motion);
  } else if (const auto* const pile = body.as<PileBody>();
             told.loosest_per_kg > 0.0 || (told.supports == 0 && pile != nullptr && pile->held())) {
    turned = body.become<PileBody>().take(told, since, body.known, then.linear_n_s, hand_m_s_.norm(), body.motion);
    body.blend = Blend::of_pile(tuning_, answer.step_s);
  } else {
    auto& free = body.become<FreeBody>();
    free.take(told, since, hand_m_s_.norm(), supports_, old_supports_, body.motion);
    if (free.rocks()) body.blend = Blend::of_rocking(tuning_, answer.step_s);
    if (told.complete && hand_rests() && is_light(answer.body_inverse_mass_per_kg[told.row])) {
      body.blend = Blend::of_light_at_rest(tuning_, answer.step_s);
    }
  }
  if (networked_ && body.as<FreeBody>() != nullptr) body.blend = body.blend.over_network(since.seconds());
  body.known = {answer.device_time_ns, told.centre_m(), then.linear_n_s};
  follow_shape(told, body);
  return turned;
}

/// Contacts follow the shape of what stands, of what moves by itself, and of what forces move alone. A body of a pile
/// is known by its planes: it does not turn as the pile does.
void LocalWorld::follow_shape(const ToldBody& told, LocalBody& body) const noexcept {
  const int shape = shapes_.known().index_of(body.index);
  const auto* const free = body.as<FreeBody>();
  const bool stands = body.as<FixedBody>() != nullptr;
  const bool moves = free != nullptr ? free->has_shape() : body.as<DrivenBody>() != nullptr && told.knows_orientation();
  const bool follows = shape >= 0 && (shapes_.known()[shape].stands ? stands : moves);
  body.shape = follows ? shape : -1;
  body.origin_B_m = told.origin_B_m();
}

}  // namespace haptic
