#include "haptic_node/rendering/local_world.hpp"

#include <algorithm>
#include <cmath>

namespace haptic {
namespace {

using Eigen::Vector3d;

/// To which a tick is solved without the answer, for its force alone: at 500 N/m and 0.5 N·s/m that is good to 30 uN.
constexpr double kForeseen_m_s = 3e-5;
/// At the device: 0.1 N in a tick of 1 ms is no jump.
constexpr double kFastest_n_per_s = 100.0;

/// Spring and damper over a step of `h`.
double lag_of(const LocalSpring& spring, double h) noexcept {
  return h * spring.stiffness_n_per_m + spring.damping_n_s_per_m;
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
    calm_n_s_ =
        unheld(spring, h, yielding_.calm_n_s(rows_.data(), eased_n_, spring.goal_m, spring.stiffness_n_per_m, h));
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

/// A body swings on a spring without damping under a hand that rests, and each answer that is late or lost makes it
/// swing anew: there the coupling is damped. Behind a network the damping is as asked for: its echo comes back a round
/// trip later (docs/decisions/0021).
void LocalWorld::pull_proxy(const LocalSpring& spring, double h) noexcept {
  LocalSpring damped = spring;
  if (on_free_ && !networked_ && hand_rests()) {
    damped.damping_n_s_per_m = std::max(spring.damping_n_s_per_m, spring.resting_damping_n_s_per_m);
  }
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
  prepare_contacts(solver_bodies_.data(), rows_.data(), rows);
  if (group_moves_) {
    relax_together(solver_bodies_.data(), rows_.data(), rows, tuning_.together_sweeps(), tolerance_m_s);
  } else {
    (light_moves_ ? relax_alone : relax_contacts)(solver_bodies_.data(), rows_.data(), rows, sweeps, tolerance_m_s);
  }
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
  // foresee() may be off by that, and the change is to keep its limit.
  const double off_n = kForeseen_m_s * lag_of(spring, h);
  const auto shorten = [&] {
    const double size_n = eased_n_.norm();
    const double most_by_n = h * std::max(slope_n_per_s, std::min(size_n, most_n) / ease_s_);
    const double by_n = std::max(0.5 * most_by_n, most_by_n - off_n);
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
  on_free_ = light_moves_ = false;
  std::array<bool, kBodies> joins{};
  std::array<bool, kMostGroups> group_joins{};
  for (std::size_t slot = 0; slot < slots_; ++slot) {
    auto* const free = bodies_[slot].as<FreeBody>();
    if (free == nullptr || !bodies_[slot].used) continue;
    on_free_ = on_free_ || touched[slot];
    joins[slot] = touched[slot] || free->goes_on(bodies_[slot].motion, bodies_[slot].given());
    if (bodies_[slot].group == 0) continue;
    group_joins[bodies_[slot].group] = group_joins[bodies_[slot].group] || joins[slot];
  }
  group_moves_ = std::any_of(group_joins.begin(), group_joins.end(), [](bool any) { return any; });
  for (std::size_t slot = 0; slot < slots_; ++slot) {
    LocalBody& body = bodies_[slot];
    auto* const free = body.as<FreeBody>();
    if (free == nullptr || !body.used) continue;
    free->stay_out();
    if (!joins[slot] && !group_joins[body.group]) continue;
    light_moves_ = light_moves_ || free->light();
    next += free->join(body.motion, body.given(), next, h, solver_bodies_[static_cast<std::size_t>(next)]) ? 1 : 0;
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
    if (free == nullptr || !body.used) continue;
    rows += free->add_rows(
        body.motion, [this](int slot) -> const LocalBody& { return bodies_[static_cast<std::size_t>(slot)]; },
        supports_, h, rows_.data(), rows);
  }
  return rows + yielding_.add_row(proxy_.position_m, begun_ns_, h, solver_bodies_[0], rows_.data(), rows);
}

/// @param push_n_s Of a mean, on the proxy, instead of what wavers. @returns what the hand feels of it: where the proxy
/// is pressed to a wall, the wall bears as much more or less, and its friction too. Where it is above one, the wall
/// catches it.
Vector3d LocalWorld::unheld(const LocalSpring& spring, double h, Vector3d push_n_s) const noexcept {
  if (push_n_s.isZero(0.0)) return push_n_s;
  for (std::size_t i = 0; i < solved_contacts_; ++i) {
    const SolverContact& row = rows_[i];
    const double along_n_s = row.normal.dot(push_n_s);
    if (row.normal_n_s <= 0.0) {
      if (row.b != SolverContact::kFixed) continue;  // it would give way
      const double gap_m =
          h * (row.closing_m_s + row.normal.dot(solver_bodies_[0].velocity_m_s - row.surface_velocity_m_s));
      push_n_s -= std::min(0.0, along_n_s + h * spring.stiffness_n_per_m * std::max(0.0, gap_m)) * row.normal;
      continue;
    }
    const double less_n_s = std::min(along_n_s, row.normal_n_s);
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
    LocalBody& body = bodies_[entry.slot];
    if (body.place == entry.place) body.ladder.add(entry.more);  // else its slot has another body by now
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
