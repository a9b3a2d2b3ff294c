#include "haptic_node/rendering/local_world.hpp"

#include <algorithm>
#include <cmath>

#include "rtbus/clock.hpp"

namespace haptic {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Every support gives way a little, as a share of the body: two that face each other then never contradict each other.
constexpr double kSupportSoftness = 0.02;

}  // namespace

void LocalWorld::reset(const Vector3d& proxy_m) noexcept {
  position_m_ = proxy_m;
  velocity_m_s_.setZero();
  impulse_n_s_.setZero();
  work_j_ = 0.0;
  for (Body& body : bodies_) body.used = false;
  contact_count_ = support_count_ = push_count_ = 0;
  hand_m_s_.setZero();
  soft_.reset();
  for (Touchable& each : touchable_) each.named = false;
  any_touchable_ = false;
  good_until_ns_ = 0;
}

double LocalWorld::gap_of(const Contact& contact) const noexcept {
  const Vector3d point = bodies_[contact.body].centre_m + contact.from_centre_m;
  if (contact.radius_m <= 0.0) return contact.normal.dot(position_m_ - point) - proxy_radius_m_;
  return (position_m_ - point + contact.radius_m * contact.normal).norm() - contact.radius_m - proxy_radius_m_;
}

Vector3d LocalWorld::surface_m_s(const Contact& contact) const noexcept {
  const SolverBody& body = bodies_[contact.body].motion;
  return body.velocity_m_s + body.angular_velocity_rad_s.cross(contact.from_centre_m);
}

/// On a ball the contact goes where the proxy goes.
void LocalWorld::roll(Contact& contact) const noexcept {
  const Vector3d middle = contact.from_centre_m - contact.radius_m * contact.normal;
  const Vector3d way = position_m_ - bodies_[contact.body].centre_m - middle;
  if (way.squaredNorm() <= 1e-12) return;
  contact.normal = way.normalized();
  contact.from_centre_m = middle + contact.radius_m * contact.normal;
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
    position_m_ = spring.goal_m;
    velocity_m_s_ = spring.goal_velocity_m_s;
    return;
  }
  blend(h);
  SolverBody& proxy = solver_bodies_[0];
  proxy.velocity_m_s =
      (spring.stiffness_n_per_m * (spring.goal_m - position_m_) + spring.damping_n_s_per_m * spring.goal_velocity_m_s) /
      lag;
  proxy.inverse_mass_per_kg = 1.0 / (h * lag);

  const std::size_t rows = gather(h);
  SolverContact* const soft_rows = rows_.data() + rows;
  const std::size_t soft = soft_.any() ? soft_.gather(position_m_, solver_bodies_[0].velocity_m_s, h,
                                                      solver_bodies_.data(), kSoftBody, soft_rows)
                                       : 0;
  if (const std::size_t all = rows + soft; all > 0) {
    const int sweeps = std::clamp(kRowSweeps / static_cast<int>(all), kFewestSweeps, kSweeps);
    solve_contacts(solver_bodies_.data(), rows_.data(), all, sweeps);
  }
  const std::uint64_t began_ns = sample_ns - static_cast<std::uint64_t>(h * 1e9);
  for (std::size_t i = 0; i < rows; ++i) {
    if (i >= solved_contacts_) {
      supports_[row_source_[i]].impulse_n_s = rows_[i].impulse_n_s;
      supports_[row_source_[i]].torsion_n_m_s = rows_[i].torsion_n_m_s;
      continue;
    }
    Contact& contact = contacts_[row_source_[i]];
    contact.impulse_n_s = rows_[i].impulse_n_s;
    if (contact.impulse_n_s.isZero(0.0)) continue;
    impulse_n_s_ += contact.impulse_n_s;
    Body& body = bodies_[contact.body];
    const Impulse before = body.given;
    body.given += {-contact.impulse_n_s, -contact.from_centre_m.cross(contact.impulse_n_s)};
    given_[contact.body].add(began_ns, sample_ns, given_apart_ns_, before, body.given);
    push_slot_[push_count_] = contact.body;
    pushes_[push_count_++] = {body.index, -contact.impulse_n_s, contact.from_centre_m};
    if (body.driven) work_j_ += contact.impulse_n_s.dot(surface_m_s(contact));
  }
  for (std::size_t i = 0; i < soft; ++i) {
    if (soft_rows[i].impulse_n_s.isZero(0.0)) continue;
    impulse_n_s_ += soft_rows[i].impulse_n_s;
    push_slot_[push_count_] = kSoftBody;
    pushes_[push_count_++] = {soft_.body_of(i), -soft_rows[i].impulse_n_s, Vector3d::Zero()};
  }
  if (soft_.any()) soft_.integrate(solver_bodies_.data(), kSoftBody, soft_rows, h, sample_ns);
  integrate(h);
}

/// Surfaces go on to where physics has them. Without news everything comes to rest, and so does what the last answer
/// does not name: a body that moves whatever pushes would take the proxy along for ever.
void LocalWorld::blend(double h) noexcept {
  const double share = -std::expm1(-h / blend_s_), heap_share = -std::expm1(-h / heap_blend_s_),
               rock_share = -std::expm1(-h / rock_blend_s_);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contact_count_; ++i) {
    Contact& contact = contacts_[i];
    if (contact.fades) {
      // It recedes until it is felt no more.
      if (contact.impulse_n_s.isZero(0.0)) continue;
      contact.offset_m += kRecovery_m_s * h;
    } else {
      const Body& body = bodies_[contact.body];
      const double part = body.jammed ? heap_share : body.rocks && contact.radius_m <= 0.0 ? rock_share : share;
      contact.offset_m -= std::min(part * contact.offset_m, kRecovery_m_s * h);
      contact.late_m_s *= 1.0 - part;
    }
    if (kept != i) contacts_[kept] = contact;
    ++kept;
  }
  contact_count_ = kept;
  const bool news = now_ns_ <= good_until_ns_;
  const double slower = std::exp(-h / kBrake_s);
  for (Body& body : bodies_) {
    if (!body.used || (body.named && news)) continue;
    body.motion.velocity_m_s *= slower;
    body.motion.angular_velocity_rad_s *= slower;
    if (!body.supported) {  // what stands on something is held there by its weight
      body.force_n.setZero();
      body.torque_n_m.setZero();
    }
    body.heap.brake(slower);
  }
}

/// What the proxy rubs against on a heap. Along the normal the heap moves as it is known to. Across it, it goes along
/// with the hand, as far as both move the same way, and else stands: were the proxy dragged by what an answer says, the
/// spring to the hand would pull the body back one and a half periods late, and stacks swing under a hand at rest.
Vector3d LocalWorld::heap_surface_m_s(const Body& body, const Vector3d& normal) const noexcept {
  const Vector3d hand_m_s = hand_m_s_ - normal.dot(hand_m_s_) * normal;
  const double square = hand_m_s.squaredNorm();
  Vector3d out = normal.dot(body.heap.free_m_s()) * normal;
  if (square > 0.0) out += std::clamp(hand_m_s.dot(body.heap.speed_m_s()) / square, 0.0, 1.0) * hand_m_s;
  return out;
}

/// The rows of one step: contacts that the proxy may reach, then the supports of the bodies that take part.
std::size_t LocalWorld::gather(double h) noexcept {
  std::array<bool, kBodies> takes_part{};
  std::size_t rows = 0;
  for (std::size_t i = 0; any_touchable_ && i < touchable_.size(); ++i) {
    if (touchable_[i].named) follow_surface(i, h);
  }
  for (std::size_t i = 0; i < contact_count_; ++i) {
    Contact& contact = contacts_[i];
    if (contact.radius_m > 0.0) roll(contact);
    if (contact.standing >= 0 && !contact.fades) follow_hull(contact);
    const Body& body = bodies_[contact.body];
    const Vector3d surface = surface_m_s(contact) + contact.late_m_s;
    contact.gap_m = gap_of(contact) + contact.offset_m;
    const double way_m = -contact.normal.dot(solver_bodies_[0].velocity_m_s - surface) * h;
    if (rows == kSolved || contact.gap_m > way_m + kReach_m) {
      contact.impulse_n_s.setZero();
      continue;
    }
    takes_part[contact.body] = true;
    SolverContact& row = rows_[rows];
    row = SolverContact{};
    row.normal = contact.normal;
    row.from_b_m = contact.from_centre_m;
    row.surface_velocity_m_s = surface;
    row.closing_m_s = std::max(contact.gap_m / h, -kRecovery_m_s);
    row.friction = contact.friction;
    row.impulse_n_s = contact.impulse_n_s;
    if (body.jammed) {
      row.surface_velocity_m_s = heap_surface_m_s(body, row.normal);
      row.softness_per_kg = body.heap.mobility_m_s_n() / h;
      row.advance_m_s = body.heap.advance_m_s(row.normal);
    }
    row_source_[rows++] = i;
  }
  solved_contacts_ = rows;

  int next = 1;
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    const Body& body = bodies_[slot];
    solver_body_[slot] = SolverContact::kFixed;
    if (!body.used || body.jammed || body.motion.inverse_mass_per_kg <= 0.0) continue;
    const bool moving = !body.motion.velocity_m_s.isZero(1e-9) || !body.motion.angular_velocity_rad_s.isZero(1e-7);
    const bool falls = !body.supported && !body.force_n.isZero(0.0);
    if (!takes_part[slot] && !moving && !falls) continue;
    solver_body_[slot] = next;
    SolverBody& solver = solver_bodies_[static_cast<std::size_t>(next++)];
    solver = body.motion;
    solver.velocity_m_s += h * body.motion.inverse_mass_per_kg * body.force_n;
    solver.angular_velocity_rad_s += h * body.motion.inverse_inertia_per_kg_m2 * body.torque_n_m;
  }
  for (std::size_t i = 0; i < solved_contacts_; ++i) {
    const Contact& contact = contacts_[row_source_[i]];
    rows_[i].b = solver_body_[contact.body];
    if (rows_[i].b >= 0) rows_[i].surface_velocity_m_s = contact.late_m_s;
  }

  for (std::size_t i = 0; i < support_count_; ++i) {
    Support& support = supports_[i];
    const int held = solver_body_[support.body];
    if (held < 0) {
      support.impulse_n_s.setZero();
      support.torsion_n_m_s = 0.0;
      continue;
    }
    rows_[rows] = support_row(support, h);
    rows_[rows].a = held;
    row_source_[rows++] = i;
  }
  return rows;
}

/// Of body 0.
SolverContact LocalWorld::support_row(const Support& support, double h) const noexcept {
  const Body& body = bodies_[support.body];
  SolverContact row;
  row.normal = support.normal;
  row.from_a_m = support.from_centre_m;
  row.surface_velocity_m_s = support.velocity_m_s;
  row.friction = support.friction;
  row.torsion_radius_m = support.torsion_radius_m;
  row.softness_per_kg = kSupportSoftness * body.motion.inverse_mass_per_kg;
  row.expected_n_s = support.force_n * h;
  row.impulse_n_s = support.impulse_n_s;
  row.torsion_n_m_s = support.torsion_n_m_s;
  if (!body.supported) row.held_n_s = body.friction_bound_n * h;
  return row;
}

void LocalWorld::felt(std::size_t push, const Vector3d& impulse_n_s) noexcept {
  if (push_slot_[push] >= kBodies) return;  // soft: not carried forward by impulses
  Body& body = bodies_[push_slot_[push]];
  const Vector3d more_n_s = impulse_n_s - pushes_[push].impulse_n_s;
  const Impulse more{more_n_s, pushes_[push].from_centre_m.cross(more_n_s)};
  body.given += more;
  if (!body.jammed && solver_body_[push_slot_[push]] >= 0) {  // it moves by what was felt
    body.motion.velocity_m_s += body.motion.inverse_mass_per_kg * more.linear_n_s;
    body.motion.angular_velocity_rad_s += body.motion.inverse_inertia_per_kg_m2 * more.angular_n_m_s;
  }
  given_[push_slot_[push]].correct(now_ns_, more);
}

void LocalWorld::integrate(double h) noexcept {
  const Vector3d& solved_m_s = solver_bodies_[0].velocity_m_s;
  velocity_m_s_ = any_touchable_ ? Vector3d(free_way_m(h * solved_m_s, h) / h) : solved_m_s;
  position_m_ += h * velocity_m_s_;
  for (std::size_t i = 0; i < contact_count_; ++i) {
    contacts_[i].offset_m -= h * contacts_[i].normal.dot(contacts_[i].late_m_s);
  }
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    Body& body = bodies_[slot];
    if (!body.used || !body.moves) continue;
    if (body.jammed) {
      move_heap(slot, h);
      continue;
    }
    if (solver_body_[slot] >= 0) {
      const SolverBody& solver = solver_bodies_[static_cast<std::size_t>(solver_body_[slot])];
      body.motion.velocity_m_s = solver.velocity_m_s;
      body.motion.angular_velocity_rad_s = solver.angular_velocity_rad_s;
    }
    body.centre_m += h * body.motion.velocity_m_s;
    if (body.motion.angular_velocity_rad_s.isZero(0.0)) continue;
    const Quaterniond turned = turn_of(body.motion.angular_velocity_rad_s, h);
    for (std::size_t i = 0; i < contact_count_; ++i) {
      if (contacts_[i].body != slot) continue;
      contacts_[i].from_centre_m = turned * contacts_[i].from_centre_m;
      contacts_[i].normal = turned * contacts_[i].normal;
    }
  }
}

/// As its contacts took it to move when they were solved.
void LocalWorld::move_heap(std::size_t slot, double h) noexcept {
  Body& body = bodies_[slot];
  Vector3d impulse_n_s = Vector3d::Zero();
  for (std::size_t i = 0; i < push_count_; ++i) {
    if (push_slot_[i] == slot) impulse_n_s += pushes_[i].impulse_n_s;
  }
  const Vector3d way_m = body.heap.way_m(impulse_n_s, h);
  body.centre_m += way_m;
  body.motion.velocity_m_s = way_m / h;
  body.motion.angular_velocity_rad_s.setZero();
}

}  // namespace haptic
