#include "haptic_node/rendering/local_world.hpp"

#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/blend.hpp"
#include "rtbus/clock.hpp"

namespace haptic {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

/// An answer is good for its period, which has one more to go until the next must be here, and a little more. One that
/// was long under way is good for half as long again: where delays are long they vary, and answers get lost, and a body
/// that has gone on for that long without news may do so a little longer.
constexpr double kGoodFor = 1.5;
constexpr double kGoodBesides_s = 3e-3;
constexpr double kGoodForAge = 0.5;
/// An answer that is older than so many steps and so much more has come over a network.
constexpr double kNetworkSteps = 3.0, kNetwork_s = 10e-3;

/// Rows of bodies that are not soft: they come first.
std::size_t rigid_rows_of(const rtbus::ProxyContacts& answer) noexcept {
  std::size_t rows = std::min<std::size_t>(answer.bodies, rtbus::kContactSlots);
  while (rows > 0 && answer.body_kind[rows - 1] == YieldingBody::kKind) --rows;
  return rows;
}

/// The supports of the farthest bodies may not have found a place. @returns the first row that lacks some.
std::size_t complete_rows(const rtbus::ProxyContacts& answer) noexcept {
  if (answer.supports_overflow == 0 || answer.supports == 0) return rtbus::kContactSlots;
  const std::size_t last = std::min<std::size_t>(answer.supports, rtbus::kSupportSlots) - 1;
  return std::max<std::size_t>(answer.support_body[last], 1);
}

}  // namespace

void LocalWorld::reset(const Vector3d& proxy_m) noexcept {
  proxy_ = {proxy_m, Vector3d::Zero(), proxy_.radius_m};
  impulse_n_s_.setZero();
  work_j_ = lifted_j_ = 0.0;
  for (LocalBody& body : bodies_) body.used = false;
  contacts_.reset();
  supports_.count = push_count_ = 0;
  hand_m_s_.setZero();
  springs_.reset();
  any_yields_ = false;
  shapes_.forget_names();
  good_until_ns_ = 0;
  clock_.forget();
}

void LocalWorld::take(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept {
  const double age_s = answer.device_time_ns < now_ns ? rtbus::seconds_between(answer.device_time_ns, now_ns) : 0.0;
  networked_ = age_s > kNetworkSteps * answer.step_s + kNetwork_s;
  const double network_s = networked_ ? age_s : 0.0;
  const double good_s = std::max(kGoodFor * answer.step_s + kGoodBesides_s, kGoodForAge * network_s);
  good_until_ns_ = now_ns + static_cast<std::uint64_t>(good_s * 1e9);
  const double history_ns = std::max(kHistorySteps * answer.step_s, kHistoryAges * network_s) * 1e9;
  given_apart_ns_ = static_cast<std::uint64_t>(history_ns / ImpulseHistory::kRecords);
  // Without a network samples and steps keep in step.
  const double after_s = clock_.sample_after_world_s(answer.step_index, answer.step_s, answer.device_time_ns);
  world_before_s_ = networked_ ? after_s : 0.0;
  springs_.keep_apart(static_cast<std::uint64_t>(history_ns / SpringHistory::kInstants));
  proxy_.radius_m = answer.proxy_radius_m;
  contacts_.remember(bodies_, proxy_);

  for (LocalBody& body : bodies_) body.named = false;
  const std::size_t rigid = rigid_rows_of(answer);
  std::array<std::size_t, rtbus::kContactSlots> slot_of_row{};
  std::array<Quaterniond, rtbus::kContactSlots> turned;
  take_rigid(answer, rigid, now_ns, slot_of_row, turned);
  take_yielding(answer, rigid);
  for (LocalBody& body : bodies_) {
    if (auto* const free = body.as<FreeBody>(); free != nullptr && !body.named) free->leave_supports();
  }
  contacts_.take({answer, now_ns, rigid, slot_of_row, turned}, bodies_, proxy_, shapes_);
  any_yields_ = false;
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    const LocalBody& body = bodies_[slot];
    if (!body.used) continue;
    const auto* const yields = body.as<YieldingBody>();
    const bool felt = yields != nullptr ? yields->touched() : contacts_.any_of(slot);
    if (!body.named && !felt) free_slot(slot);
    any_yields_ = any_yields_ || (body.used && yields != nullptr);
  }
}

void LocalWorld::free_slot(std::size_t slot) noexcept {
  contacts_.drop(slot);
  if (const auto* const yields = bodies_[slot].as<YieldingBody>()) springs_.close(yields->place());
  bodies_[slot].used = false;
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
  for (const auto& contact : contacts_.all()) felt[contact.body] = felt[contact.body] || contact.felt();
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    const auto* const yields = bodies_[slot].as<YieldingBody>();
    felt[slot] = felt[slot] || (yields != nullptr && yields->touched());
  }
  for (const bool unfelt : {true, false}) {
    for (std::size_t slot = 0; slot < kBodies; ++slot) {
      if (bodies_[slot].named || (unfelt && felt[slot])) continue;
      free_slot(slot);
      return slot;
    }
  }
  return 0;
}

void LocalWorld::take_rigid(const rtbus::ProxyContacts& answer, std::size_t rigid_rows, std::uint64_t now_ns,
                            std::span<std::size_t> slot_of_row, std::span<Quaterniond> turned) noexcept {
  const std::size_t supports = std::min<std::size_t>(answer.supports, SupportPool::kSupports);
  std::array<std::size_t, rtbus::kContactSlots> count{};
  std::array<double, rtbus::kContactSlots> loosest{};
  for (std::size_t i = 0; i < supports; ++i) {
    const std::size_t row = answer.support_body[i];
    if (row >= rigid_rows) continue;
    ++count[row];
    loosest[row] = std::max(loosest[row], answer.support_inverse_mass_per_kg[i]);
  }
  // Every body goes on from the answer's instant to now in so many parts.
  const std::size_t complete = complete_rows(answer);
  int rows = 0;
  for (std::size_t row = 0; row < rigid_rows; ++row) {
    if (answer.body_kind[row] == 0) continue;
    const bool sleeps = count[row] == 0 && row < complete && answer.body_friction_bound_n[row] > 0.0;
    rows += 1 + (loosest[row] > 0.0 ? 0 : sleeps ? 1 : static_cast<int>(count[row]));
  }
  int parts = 1;
  if (answer.device_time_ns < now_ns) {
    const double ticks = std::ceil(rtbus::seconds_between(answer.device_time_ns, now_ns) / tick_s_ - 0.1);
    const int most = std::min(static_cast<int>(std::min(1e3, ticks)), kReplayRows / std::max(1, rows));
    parts = std::clamp(most, 1, networked_ ? kNetworkParts : kReplayParts);
  }
  std::copy_n(supports_.rows.begin(), supports_.count, old_supports_.rows.begin());
  supports_.count = 0;
  supports_.spare = SupportPool::kSupports - supports;
  for (std::size_t row = 0; row < rigid_rows; ++row) {
    slot_of_row[row] = slot_of(answer.body_index[row]);
    turned[row] = take_body({answer, row, row < complete, count[row], loosest[row]}, slot_of_row[row], parts, now_ns);
  }
}

/// Of what a body had been given before it was known, nothing is known, nor is any of that ours.
Quaterniond LocalWorld::take_body(const ToldBody& told, std::size_t slot, int parts, std::uint64_t now_ns) noexcept {
  const rtbus::ProxyContacts& answer = told.answer;
  LocalBody& body = bodies_[slot];
  if (!body.used) {
    body = LocalBody{};
    body.index = answer.body_index[told.row];
    given_[slot].forget();
  }
  body.used = body.named = true;
  const SinceAnswer since{answer.device_time_ns, now_ns,          parts,     tick_s_, given_[slot], body.given,
                          rows_.data(),          world_before_s_, networked_};
  const Impulse then = since.given_at(since.from_ns);
  body.blend_s = std::max(blend::kLeast_s, blend::kSteps * answer.step_s);
  Quaterniond turned = Quaterniond::Identity();
  if (answer.body_kind[told.row] == 0) {
    turned = body.become<FixedBody>().take(told, body.motion);
  } else if (answer.body_kind[told.row] == 1) {
    turned = body.become<DrivenBody>().take(told, since, body.motion);
  } else if (told.loosest_per_kg > 0.0) {
    turned = body.become<PileBody>().take(told, since, body.known, then.linear_n_s, hand_m_s_.norm(), body.motion);
    body.blend_s = std::max(blend::kLeast_s, blend::kPileSteps * answer.step_s);
  } else {
    auto& free = body.become<FreeBody>();
    turned = free.take(told, since, hand_m_s_.norm(), supports_, old_supports_, body.motion);
    if (free.rocks()) body.blend_s = std::max(blend::kRockLeast_s, blend::kPileSteps * answer.step_s);
  }
  if (networked_ && body.as<FreeBody>() != nullptr) {
    body.blend_s = std::max(body.blend_s, blend::kNetworkAges * since.seconds());
  }
  body.known = {answer.device_time_ns, told.centre_m(), then.linear_n_s};
  return turned;
}

void LocalWorld::take_yielding(const rtbus::ProxyContacts& answer, std::size_t rigid_rows) noexcept {
  const std::size_t bodies = std::min<std::size_t>(answer.bodies, rtbus::kContactSlots);
  if (rigid_rows == bodies && !any_yields_) return;
  for (LocalBody& body : bodies_) {
    if (auto* const yields = body.as<YieldingBody>()) yields->fade();
  }
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.contacts, rtbus::kContactSlots); ++i) {
    const std::size_t row = answer.contact_body[i];
    if (row < rigid_rows || row >= bodies) continue;
    LocalBody& body = bodies_[slot_of(answer.body_index[row])];
    const bool known = body.used;
    if (!known) {
      const std::size_t place = springs_.open();
      if (place == SpringHistory::kPlaces) continue;  // as many as there is room for: the nearest come first
      body = LocalBody{};
      body.index = answer.body_index[row];
      body.kind.emplace<YieldingBody>(place);
    }
    body.used = body.named = true;
    body.blend_s = std::max(blend::kLeast_s, blend::kSteps * answer.step_s);
    body.as<YieldingBody>()->take(answer, i, springs_, proxy_.position_m, known);
  }
}

void LocalWorld::advance(const LocalSpring& spring, std::uint64_t sample_ns, double h) noexcept {
  now_ns_ = sample_ns;
  tick_s_ = h;
  hand_m_s_ += -std::expm1(-h / kHandSpeed_s) * (spring.goal_velocity_m_s - hand_m_s_);
  impulse_n_s_.setZero();
  work_j_ = 0.0;
  push_count_ = 0;
  const double lag = h * spring.stiffness_n_per_m + spring.damping_n_s_per_m;
  if (lag <= 0.0) {  // nothing holds the proxy to the hand: it is the hand
    proxy_.position_m = spring.goal_m;
    proxy_.velocity_m_s = spring.goal_velocity_m_s;
    return;
  }
  contacts_.blend(bodies_, h);
  if (now_ns_ > good_until_ns_) brake(h);
  SolverBody& proxy = solver_bodies_[0];
  proxy.velocity_m_s = (spring.stiffness_n_per_m * (spring.goal_m - proxy_.position_m) +
                        spring.damping_n_s_per_m * spring.goal_velocity_m_s) /
                       lag;
  proxy.inverse_mass_per_kg = 1.0 / (h * lag);

  if (const std::size_t rows = gather(h); rows > 0) {
    const int sweeps = std::clamp(kRowSweeps / static_cast<int>(rows), kFewestSweeps, kSweeps);
    solve_contacts(solver_bodies_.data(), rows_.data(), rows, sweeps);
    book(sample_ns - static_cast<std::uint64_t>(h * 1e9));
  }
  const Vector3d& solved_m_s = proxy.velocity_m_s;
  proxy_.velocity_m_s = shapes_.any_named()
                            ? Vector3d(shapes_.free_way_m(proxy_.position_m, proxy_.radius_m, h * solved_m_s,
                                                          StaticShapes::look_m(proxy_.velocity_m_s.norm(), h)) /
                                       h)
                            : solved_m_s;
  proxy_.position_m += h * proxy_.velocity_m_s;
  contacts_.advance(h);
  move_bodies(h);
}

/// Without answers everything comes to rest.
void LocalWorld::brake(double h) noexcept {
  const double slower = std::exp(-h / kBrake_s);
  for (LocalBody& body : bodies_) {
    if (!body.used) continue;
    body.motion.brake(slower);
    if (auto* const free = body.as<FreeBody>()) free->brake();
    if (auto* const pile = body.as<PileBody>()) pile->brake(slower);
  }
}

/// The rows of one step: contacts that the proxy may reach, then the supports of the bodies that take part, then soft
/// bodies.
std::size_t LocalWorld::gather(double h) noexcept {
  std::array<bool, kBodies> touched{};
  const Vector3d& free_m_s = solver_bodies_[0].velocity_m_s;
  solved_contacts_ = contacts_.gather(bodies_, proxy_, free_m_s, h, shapes_, rows_.data(), touched);
  std::size_t rows = solved_contacts_;
  int next = 1;
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    auto* const free = bodies_[slot].as<FreeBody>();
    if (free == nullptr || !bodies_[slot].used) continue;
    const bool joins =
        free->join(bodies_[slot].motion, touched[slot], next, h, solver_bodies_[static_cast<std::size_t>(next)]);
    next += joins ? 1 : 0;
  }
  for (std::size_t i = 0; i < solved_contacts_; ++i) {
    const auto& contact = contacts_.of_row(i);
    const LocalBody& body = bodies_[contact.body];
    if (const auto* const free = body.as<FreeBody>()) free->fill_row(contact.late_m_s, rows_[i]);
    if (const auto* const pile = body.as<PileBody>()) pile->fill_row(hand_m_s_, h, rows_[i]);
  }
  for (LocalBody& body : bodies_) {
    auto* const free = body.as<FreeBody>();
    if (free != nullptr && body.used) rows += free->add_rows(supports_, h, rows_.data(), rows);
  }
  if (!any_yields_) return rows;
  for (LocalBody& body : bodies_) {
    auto* const yields = body.as<YieldingBody>();
    if (yields == nullptr || !body.used) continue;
    rows += yields->add_rows(proxy_.position_m, free_m_s, h, blend::share_of(body.blend_s, h), next,
                             solver_bodies_[static_cast<std::size_t>(next)], rows_.data(), rows);
    ++next;
  }
  return rows;
}

/// What the proxy gave to whom.
void LocalWorld::book(std::uint64_t began_ns) noexcept {
  for (std::size_t i = 0; i < solved_contacts_; ++i) {
    auto& contact = contacts_.of_row(i);
    contact.impulse_n_s = rows_[i].impulse_n_s;
    if (!contact.felt()) continue;
    give(contact.body, contact.impulse_n_s, contact.from_centre_m, began_ns);
    const LocalBody& body = bodies_[contact.body];
    if (body.as<DrivenBody>() == nullptr) continue;
    work_j_ += contact.impulse_n_s.dot(body.motion.velocity_at(contact.from_centre_m));
    // Where it comes to its place nobody works: a hand that it lifts gets what it has, and nothing besides. What was
    // taken to be higher than it is gives back what it was counted to have done.
    lifted_j_ += contact.impulse_n_s.dot(contact.normal) * (contact.blend_m_s + contact.normal.dot(contact.late_m_s));
    work_j_ += std::min(0.0, lifted_j_);
    lifted_j_ = std::max(0.0, lifted_j_);
  }
  if (!any_yields_) return;
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    const auto* const yields = bodies_[slot].as<YieldingBody>();
    if (yields == nullptr || !bodies_[slot].used || yields->row() == YieldingBody::kNoRow) continue;
    const Vector3d& impulse = rows_[yields->row()].impulse_n_s;
    if (!impulse.isZero(0.0)) give(slot, impulse, Vector3d::Zero(), began_ns);
  }
}

/// @param impulse_n_s On the proxy.
void LocalWorld::give(std::size_t slot, const Vector3d& impulse_n_s, const Vector3d& from_centre_m,
                      std::uint64_t began_ns) noexcept {
  LocalBody& body = bodies_[slot];
  impulse_n_s_ += impulse_n_s;
  const Impulse before = body.given;
  body.given += {-impulse_n_s, -from_centre_m.cross(impulse_n_s)};
  given_[slot].add(began_ns, now_ns_, given_apart_ns_, before, body.given);
  push_slot_[push_count_] = slot;
  pushes_[push_count_++] = {body.index, -impulse_n_s, from_centre_m};
}

void LocalWorld::felt(std::size_t push, const Vector3d& impulse_n_s) noexcept {
  const std::size_t slot = push_slot_[push];
  LocalBody& body = bodies_[slot];
  const Vector3d more_n_s = impulse_n_s - pushes_[push].impulse_n_s;
  const Impulse more{more_n_s, pushes_[push].from_centre_m.cross(more_n_s)};
  body.given += more;
  if (const auto* const free = body.as<FreeBody>()) free->correct(more, body.motion);  // it moves by what was felt
  given_[slot].correct(now_ns_, more);
}

void LocalWorld::move_bodies(double h) noexcept {
  StepSolution step{solver_bodies_.data(), rows_.data(), h};
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    LocalBody& body = bodies_[slot];
    if (!body.used) continue;
    if (auto* const driven = body.as<DrivenBody>()) driven->advance(step, body.motion);
    if (auto* const free = body.as<FreeBody>()) free->advance(step, supports_, body.motion);
    if (auto* const yields = body.as<YieldingBody>()) yields->advance(step, springs_);
    if (auto* const pile = body.as<PileBody>()) {
      step.pushed_n_s.setZero();
      for (std::size_t i = 0; i < push_count_; ++i) {
        if (push_slot_[i] == slot) step.pushed_n_s += pushes_[i].impulse_n_s;
      }
      pile->advance(step, body.motion);
    }
    if (body.motion.angular_velocity_rad_s.isZero(0.0)) continue;
    contacts_.turn(slot, turn_of(body.motion.angular_velocity_rad_s, h));
  }
  if (any_yields_) springs_.record(now_ns_);
}

}  // namespace haptic
