#include "haptic_node/rendering/local_world.hpp"

#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/blend.hpp"
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
/// To which a tick is solved without the answer, for its force alone: at 500 N/m and 0.5 N·s/m that is good to 30 uN.
constexpr double kForeseen_m_s = 3e-5;
/// At the device: 0.1 N in a tick of 1 ms is no jump.
constexpr double kFastest_n_per_s = 100.0;

/// Spring and damper over a step of `h`.
double lag_of(const LocalSpring& spring, double h) noexcept {
  return h * spring.stiffness_n_per_m + spring.damping_n_s_per_m;
}

/// The supports of the farthest bodies may not have found a place. @returns the first row that lacks some.
std::size_t complete_rows(const rtbus::ProxyContacts& answer) noexcept {
  if (answer.supports_overflow == 0 || answer.supports == 0) return rtbus::kContactSlots;
  const std::size_t last = std::min<std::size_t>(answer.supports, rtbus::kSupportSlots) - 1;
  return std::max<std::size_t>(answer.support_body[last], 1);
}

}  // namespace

void LocalWorld::reset(const Vector3d& proxy_m, std::uint64_t sample_ns) noexcept {
  now_ns_ = sample_ns;
  proxy_ = {proxy_m, Vector3d::Zero(), proxy_.radius_m};
  impulse_n_s_.setZero();
  calm_n_s_.setZero();
  foreseen_n_s_.reset();
  eased_n_.setZero();
  work_j_ = lifted_j_ = 0.0;
  for (LocalBody& body : slots()) body.used = false;
  slots_ = 0;
  contacts_.reset();
  supports_.count = 0;
  impulses_.release_all();
  hand_m_s_.setZero();
  yielding_.forget();
  yielding_place_ = HandImpulses::kPlaces;
  shapes_.forget_names();
  good_until_ns_ = 0;
  clock_.forget();
  light_kg_ = 0.0;
  on_free_ = false;
}

/// A body of a pile, which no single impulse moves, feels other hands through physics alone.
void LocalWorld::hear(std::span<const OtherHand> hands, std::uint64_t sample_ns) noexcept {
  for (LocalBody& body : slots()) body.heard = Impulse{};
  other_hands_.hear(hands, sample_ns, [this](std::uint32_t index, const Impulse& more) {
    for (LocalBody& body : slots()) {
      if (body.used && body.index == index) body.heard += more;
    }
  });
}

void LocalWorld::take(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept {
  const double age_s = answer.device_time_ns < now_ns ? rtbus::seconds_between(answer.device_time_ns, now_ns) : 0.0;
  networked_ = age_s > kNetworkSteps * answer.step_s + kNetwork_s;
  const double network_s = networked_ ? age_s : 0.0;
  const double good_s =
      std::max(tuning_.good_periods * answer.step_s + tuning_.good_besides_s, kGoodForAge * network_s);
  good_until_ns_ = now_ns + static_cast<std::uint64_t>(good_s * 1e9);
  const double history_ns = std::max(tuning_.history_periods() * answer.step_s, kHistoryAges * network_s) * 1e9;
  const auto apart_ns = static_cast<std::uint64_t>(history_ns / ImpulseHistory::kRecords);
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

void LocalWorld::take_rigid(const rtbus::ProxyContacts& answer, std::uint64_t now_ns,
                            std::span<std::size_t> slot_of_row, std::span<Quaterniond> turned) noexcept {
  const std::size_t rigid_rows = std::min<std::size_t>(answer.bodies, rtbus::kContactSlots);
  const std::size_t supports = std::min<std::size_t>(answer.supports, SupportPool::kSupports);
  std::array<std::size_t, rtbus::kContactSlots> count{}, ends{};  // `ends`: of edges
  std::array<double, rtbus::kContactSlots> loosest{};
  for (std::size_t i = 0; i < supports; ++i) {
    const std::size_t row = answer.support_body[i];
    if (row >= rigid_rows) continue;
    ++count[row];
    if (answer.support_points[i] == 2) ++ends[row];
    loosest[row] = std::max(loosest[row], answer.support_inverse_mass_per_kg[i]);
  }
  // Every body goes on from the answer's instant to now in so many parts.
  const std::size_t complete = complete_rows(answer);
  int rows = 0;
  for (std::size_t row = 0; row < rigid_rows; ++row) {
    if (answer.body_kind[row] == 0) continue;
    const bool sleeps = count[row] == 0 && row < complete && answer.body_friction_bound_n[row] > 0.0;
    const bool corners = shapes_.known().has_corners(answer.body_index[row]);
    rows += 1 + (loosest[row] > 0.0 ? 0
                 : sleeps           ? 1
                          : static_cast<int>(corners ? FreeBody::kCorners * (count[row] - ends[row] / 2) : count[row]));
  }
  int parts = 1;
  if (answer.device_time_ns < now_ns) {
    const double age_s = rtbus::seconds_between(answer.device_time_ns, now_ns);
    const double ticks = std::ceil(age_s / tick_s_ - 0.1);
    const double wanted =
        networked_ ? kNetworkParts : std::max(tuning_.parts, std::ceil(age_s / tuning_.longest_part_s));
    const int budget = static_cast<int>(tuning_.row_budget) / std::max(1, rows);
    parts = std::max(1, std::min(static_cast<int>(std::min({1e3, ticks, wanted})), budget));
  }
  std::copy_n(supports_.rows.begin(), supports_.count, old_supports_.rows.begin());
  supports_.count = 0;
  supports_.spare = SupportPool::kSupports - supports;
  for (std::size_t row = 0; row < rigid_rows; ++row) {
    slot_of_row[row] = slot_of(answer.body_index[row]);
    turned[row] = take_body({answer, row, row < complete, count[row], loosest[row]}, slot_of_row[row], parts, now_ns);
  }
}

Quaterniond LocalWorld::take_body(const ToldBody& told, std::size_t slot, int parts, std::uint64_t now_ns) noexcept {
  const rtbus::ProxyContacts& answer = told.answer;
  LocalBody& body = bodies_[slot];
  if (!body.used) {
    body = LocalBody{};
    body.index = answer.body_index[told.row];
    body.place = impulses_.hold(body.index);
  }
  body.used = body.named = true;
  body.ladder.replayed();
  const SinceAnswer since{answer.device_time_ns,
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
    turned = free.take(told, since, hand_m_s_.norm(), supports_, old_supports_, body.motion);
    if (free.rocks()) body.blend = Blend::of_rocking(tuning_, answer.step_s);
    if (hand_rests() && free.light_kg(proxy_kg_) > 0.0) body.blend = Blend::of_light_at_rest(tuning_, answer.step_s);
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

/// What a tick begins with, be it by foresee() or by advance().
void LocalWorld::begin_tick(const LocalSpring& spring, std::uint64_t sample_ns, double h) noexcept {
  if (begun_ns_ == sample_ns) return;
  begun_ns_ = sample_ns;
  hand_m_s_ += -std::expm1(-h / tuning_.noise_s) * (spring.goal_velocity_m_s - hand_m_s_);
  brake(h);
}

void LocalWorld::advance(const LocalSpring& spring, std::uint64_t sample_ns, double h) noexcept {
  begin_tick(spring, sample_ns, h);
  now_ns_ = sample_ns;
  tick_s_ = h;
  impulse_n_s_.setZero();
  calm_n_s_.setZero();
  work_j_ = 0.0;
  impulses_.begin(sample_ns - static_cast<std::uint64_t>(h * 1e9), sample_ns);
  if (lag_of(spring, h) <= 0.0) {  // nothing holds the proxy to the hand: it is the hand
    proxy_.position_m = spring.goal_m;
    proxy_.velocity_m_s = spring.goal_velocity_m_s;
    foreseen_n_s_.reset();
    eased_n_.setZero();
    return;
  }
  contacts_.blend(bodies_, h);
  if (solve(spring, h, kTolerance_m_s) > 0) give_impulses();
  ease(spring, h);
  if (yielding_.averages()) {
    calm_n_s_ = unheld(yielding_.calm_n_s(rows_.data(), eased_n_, spring.goal_m, spring.stiffness_n_per_m, h));
    impulse_n_s_ += calm_n_s_;
  }
  yielding_.keep(rows_.data(), h);
  const SolverBody& proxy = solver_bodies_[0];
  const Vector3d& solved_m_s = proxy.velocity_m_s;
  proxy_.velocity_m_s = !shapes_.named().empty()
                            ? Vector3d(shapes_.free_way_m(proxy_.position_m, proxy_.radius_m, h * solved_m_s,
                                                          shapes_.look_m(proxy_.velocity_m_s.norm(), h)) /
                                       h)
                            : solved_m_s;
  proxy_.position_m += h * proxy_.velocity_m_s;
  contacts_.advance(h);
  move_bodies(h);
}

/// A light body swings on the spring within few ticks. Physics hears of that too late to brake it, so that it is braked
/// here: by half of what is critical, as long as it is touched. Any other body swings on a spring without damping under
/// a hand that rests, and each answer that is late or lost makes it swing anew. Behind a network the damping is as
/// asked for: its echo comes back a round trip later (docs/decisions/0021).
void LocalWorld::pull_proxy(const LocalSpring& spring, double h) noexcept {
  LocalSpring damped = spring;
  damped.damping_n_s_per_m =
      std::max({spring.damping_n_s_per_m, std::sqrt(spring.stiffness_n_per_m * light_kg_),
                on_free_ && !networked_ && hand_rests() ? spring.resting_damping_n_s_per_m : 0.0});
  const double lag = lag_of(damped, h);
  SolverBody& proxy = solver_bodies_[0];
  proxy.velocity_m_s = (damped.stiffness_n_per_m * (damped.goal_m - proxy_.position_m) +
                        damped.damping_n_s_per_m * damped.goal_velocity_m_s) /
                       lag;
  proxy.angular_velocity_rad_s.setZero();
  proxy_kg_ = h * lag_of(spring, h);
  proxy.inverse_mass_per_kg = 1.0 / (h * lag);
}

/// A second time where the proxy comes around an edge within the step. @returns rows.
std::size_t LocalWorld::solve(const LocalSpring& spring, double h, double tolerance_m_s) noexcept {
  pull_proxy(spring, h);
  const Vector3d free_way_m = h * solver_bodies_[0].velocity_m_s;
  const std::size_t rows = solve_once(h, tolerance_m_s, false);
  if (rows == 0) return 0;
  const Vector3d way_m = h * solver_bodies_[0].velocity_m_s;
  const std::span<const SolverContact> contacts(rows_.data(), solved_contacts_);
  if (!contacts_.bend(bodies_, proxy_, way_m, free_way_m, contacts, h, shapes_)) return rows;
  pull_proxy(spring, h);
  return solve_once(h, tolerance_m_s, true);
}

std::size_t LocalWorld::solve_once(double h, double tolerance_m_s, bool again) noexcept {
  const std::size_t rows = gather(h, again);
  if (rows == 0) return 0;
  const int sweeps = std::clamp(static_cast<int>(tuning_.row_budget) / static_cast<int>(rows), tuning_.fewest_sweeps(),
                                tuning_.most_sweeps());
  solve_contacts(solver_bodies_.data(), rows_.data(), rows, sweeps, tolerance_m_s);
  return rows;
}

void LocalWorld::foresee(const LocalSpring& spring, std::uint64_t sample_ns, double h) noexcept {
  foreseen_n_s_.reset();
  begin_tick(spring, sample_ns, h);
  if (lag_of(spring, h) <= 0.0) return;
  contacts_.keep();
  contacts_.blend(bodies_, h);
  Vector3d sum_n_s = Vector3d::Zero();
  if (solve(spring, h, kForeseen_m_s) > 0) {
    for (std::size_t i = 0; i < solved_contacts_; ++i) sum_n_s += rows_[i].impulse_n_s;
    sum_n_s += yielding_.impulse_n_s(rows_.data());
  }
  if (sum_n_s.allFinite()) foreseen_n_s_ = sum_n_s;
  contacts_.bring_back();
}

/// The force goes from what it would have been without the answer to what it is with it, no faster than a surface that
/// rises at Tuning::recovery_m_s would change it. What would take longer than ease_s_ decays to that with this
/// time constant. What that would bring faster than kFastest_n_per_s comes at once: such a change makes no sense.
void LocalWorld::ease(const LocalSpring& spring, double h) noexcept {
  const double slope_n_per_s = tuning_.recovery_m_s * spring.stiffness_n_per_m;
  const double most_n = std::max(slope_n_per_s, kFastest_n_per_s * spring.force_scale) * ease_s_;
  const auto shorten = [&] {
    const double size_n = eased_n_.norm(), by_n = h * std::max(slope_n_per_s, std::min(size_n, most_n) / ease_s_);
    eased_n_ =
        size_n > by_n ? Vector3d(std::min(size_n - by_n, most_n) / size_n * eased_n_) : Vector3d(Vector3d::Zero());
  };
  if (!eased_n_.isZero(0.0)) shorten();
  if (foreseen_n_s_) {
    eased_n_ += (*foreseen_n_s_ - impulse_n_s_) / h;
    foreseen_n_s_.reset();
    if (!eased_n_.allFinite()) eased_n_.setZero();
    shorten();
  }
  if (!eased_n_.isZero(0.0)) impulse_n_s_ += h * eased_n_;
}

/// Without answers everything comes to rest, and so does what the last answer does not name: a body that moves whatever
/// pushes would take the proxy along for ever.
void LocalWorld::brake(double h) noexcept {
  const bool answer_good = begun_ns_ <= good_until_ns_;
  const double slower = std::exp(-h / tuning_.blend_floor_s);
  for (LocalBody& body : slots()) {
    if (!body.used || (body.named && answer_good)) continue;
    body.motion.brake(slower);
    if (auto* const free = body.as<FreeBody>()) free->brake();
    if (auto* const pile = body.as<PileBody>()) pile->brake(slower);
  }
}

/// The rows of one step: contacts that the proxy may reach, then the supports of the bodies that take part, then what
/// yields.
std::size_t LocalWorld::gather(double h, bool again) noexcept {
  std::array<bool, kBodies> touched{};
  const Vector3d& free_m_s = solver_bodies_[0].velocity_m_s;
  const Vector3d pulled_m_s = free_m_s + h * solver_bodies_[0].inverse_mass_per_kg * yielding_.bears_n(begun_ns_);
  solved_contacts_ = contacts_.gather(bodies_, proxy_, free_m_s, pulled_m_s, h, shapes_, rows_.data(), touched, again);
  std::size_t rows = solved_contacts_;
  int next = 1;
  light_kg_ = 0.0;
  on_free_ = false;
  for (std::size_t slot = 0; slot < slots_; ++slot) {
    auto* const free = bodies_[slot].as<FreeBody>();
    if (free == nullptr || !bodies_[slot].used) continue;
    if (touched[slot]) {
      light_kg_ = std::max(light_kg_, free->light_kg(proxy_kg_));
      on_free_ = true;
    }
    Impulse given = bodies_[slot].heard;
    given += bodies_[slot].ladder.due();
    const bool joins =
        free->join(bodies_[slot].motion, given, touched[slot], next, h, solver_bodies_[static_cast<std::size_t>(next)]);
    next += joins ? 1 : 0;
  }
  for (std::size_t i = 0; i < solved_contacts_; ++i) {
    const auto& contact = contacts_.of_row(i);
    if (contact.fades) continue;  // what is left of it gives way to nothing
    const LocalBody& body = bodies_[contact.body];
    if (const auto* const free = body.as<FreeBody>()) free->fill_row(contact.late_m_s, rows_[i]);
    if (const auto* const pile = body.as<PileBody>()) pile->fill_row(hand_m_s_, h, rows_[i]);
  }
  for (LocalBody& body : slots()) {
    auto* const free = body.as<FreeBody>();
    if (free != nullptr && body.used) rows += free->add_rows(body.motion, supports_, h, rows_.data(), rows);
  }
  return rows + yielding_.add_row(proxy_.position_m, begun_ns_, h, solver_bodies_[0], rows_.data(), rows);
}

/// @param push_n_s Of a mean, on the proxy, instead of what wavers. @returns what the hand feels of it: where the proxy
/// is pressed to a wall, the wall bears as much more or less, and its friction too.
Vector3d LocalWorld::unheld(Vector3d push_n_s) const noexcept {
  if (push_n_s.isZero(0.0)) return push_n_s;
  for (std::size_t i = 0; i < solved_contacts_; ++i) {
    const SolverContact& row = rows_[i];
    if (row.normal_n_s <= 0.0) continue;
    const double less_n_s = std::min(row.normal.dot(push_n_s), row.normal_n_s);
    push_n_s -= less_n_s * row.normal;
    const Vector3d across_n_s = row.impulse_n_s - row.normal_n_s * row.normal;
    Vector3d holds_n_s = across_n_s - (push_n_s - row.normal.dot(push_n_s) * row.normal);
    const double most_n_s = row.friction * (row.normal_n_s - less_n_s);
    if (const double size_n_s = holds_n_s.norm(); size_n_s > most_n_s) holds_n_s *= most_n_s / size_n_s;
    push_n_s += holds_n_s - across_n_s;
  }
  return push_n_s;
}

/// What the proxy gave to whom.
void LocalWorld::give_impulses() noexcept {
  for (std::size_t i = 0; i < solved_contacts_; ++i) {
    auto& contact = contacts_.of_row(i);
    contact.impulse_n_s = rows_[i].impulse_n_s;
    if (!contact.active()) continue;
    const LocalBody& body = bodies_[contact.body];
    give(body.place, contact.body, contact.impulse_n_s, contact.from_centre_m, body.is_moved());
    if (body.as<DrivenBody>() == nullptr) continue;
    work_j_ += contact.impulse_n_s.dot(ProxyContactSet::carried_m_s(contact, body.motion));
    // Where it comes to its place nobody works: a hand that it lifts gets what it has, and nothing besides. What was
    // taken to be higher than it is gives back what it was counted to have done.
    lifted_j_ += contact.impulse_n_s.dot(contact.normal) * (contact.blend_m_s + contact.normal.dot(contact.late_m_s));
    work_j_ += std::min(0.0, lifted_j_);
    lifted_j_ = std::max(0.0, lifted_j_);
  }
  const Vector3d yields_n_s = yielding_.impulse_n_s(rows_.data());
  if (!yields_n_s.isZero(0.0)) give(yielding_place_, kBodies, yields_n_s, Vector3d::Zero(), true);
}

/// @param impulse_n_s On the proxy.
void LocalWorld::give(std::size_t place, std::size_t slot, const Vector3d& impulse_n_s, const Vector3d& from_centre_m,
                      bool moves) noexcept {
  impulse_n_s_ += impulse_n_s;
  impulses_.give(place, slot, -impulse_n_s, from_centre_m, moves);
}

void LocalWorld::felt(const Vector3d& impulse_n_s) noexcept {
  impulses_.settle(impulse_n_s + calm_n_s_);
  for (const auto& entry : impulses_.entries()) {
    if (entry.slot == kBodies) continue;  // what yields feels it in physics
    bodies_[entry.slot].ladder.add(entry.more);
  }
}

void LocalWorld::move_bodies(double h) noexcept {
  StepSolution step{solver_bodies_.data(), rows_.data(), h};
  for (std::size_t slot = 0; slot < slots_; ++slot) {
    LocalBody& body = bodies_[slot];
    if (!body.used) continue;
    body.ladder.step();
    if (auto* const driven = body.as<DrivenBody>()) driven->advance(step, body.motion);
    if (auto* const free = body.as<FreeBody>()) {
      free->advance(step, supports_, body.motion);
      work_j_ += body.heard.work_j(body.motion.velocity_m_s, body.motion.angular_velocity_rad_s);
    }
    if (auto* const pile = body.as<PileBody>()) {
      step.pushed_n_s.setZero();
      for (const auto& entry : impulses_.entries()) {
        if (entry.slot == slot) step.pushed_n_s += entry.impulse_n_s;
      }
      pile->advance(step, body.blend.share(h), body.motion);
    }
    if (body.motion.angular_velocity_rad_s.isZero(0.0)) continue;
    contacts_.turn(slot, turn_of(body.motion.angular_velocity_rad_s, h));
  }
}

}  // namespace haptic
