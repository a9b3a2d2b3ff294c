#include "physics_node/external/external_world.hpp"

#include <algorithm>
#include <chrono>

#include "rtbus/clock.hpp"

namespace physics {

using Eigen::Vector3d;

std::optional<double> ExternalWorld::wait_for_step(std::uint64_t deadline_ns) {
  std::unique_lock lock(mutex_);
  const auto until = std::chrono::steady_clock::time_point(std::chrono::nanoseconds(deadline_ns));
  const bool due = changed_.wait_until(lock, until, [this] { return turn_ == Turn::kEngine || closed_; });
  return due && !closed_ ? std::optional(step_s_) : std::nullopt;
}

void ExternalWorld::finish(const ExternalAnswer& answer) {
  const std::scoped_lock lock(mutex_);
  if (turn_ != Turn::kEngine) return;
  take(answer);
  turn_ = Turn::kNode;
  changed_.notify_all();
}

void ExternalWorld::close() {
  const std::scoped_lock lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

/// The forces of the tool's spring follow from where it is, unless the engine tells their mean; it tells the rest.
void ExternalWorld::take(const ExternalAnswer& answer) {
  answer_ = answer;
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    ExternalHand& hand = hands_[i];
    ProxyReadout& readout = readouts_[i];
    if (hand.mode == ToolMode::kSpring && answer.tools[i].set) {
      readout = answer.tools[i].readout;
      const ProxyTarget& to = hand.target;
      readout.coupling_force_n = answer.tools[i].spring_force_n.value_or(
          to.stiffness_n_per_m * (to.position_m - readout.position_m) +
          to.damping_n_s_per_m * (to.velocity_m_s - readout.velocity_m_s) + to.force_n);
    } else {
      if (hand.mode == ToolMode::kPlaced) {
        readout.position_m = hand.target.position_m;
        readout.velocity_m_s = hand.target.velocity_m_s;
      }
      readout.coupling_force_n.setZero();
      readout.contact_force_n.setZero();
      readout.contacts = 0;
    }
    hand.reset = false;
    hand.pushes.clear();
  }
}

std::size_t ExternalWorld::add_proxy(const ProxyParameters& parameters) {
  ExternalHand hand;
  hand.parameters = parameters;
  hand.target.position_m = parameters.position_m;
  hands_.push_back(hand);
  readouts_.emplace_back();
  readouts_.back().position_m = parameters.position_m;
  return hands_.size() - 1;
}

void ExternalWorld::reset_proxy(std::size_t proxy, const Vector3d& position_m) {
  ExternalHand& hand = hands_.at(proxy);
  hand.mode = ToolMode::kSpring;
  hand.reset = true;
  hand.target.position_m = position_m;
  hand.target.velocity_m_s.setZero();
  hand.pushes.clear();
  readouts_[proxy] = ProxyReadout{};
  readouts_[proxy].position_m = position_m;
}

void ExternalWorld::release_proxy(std::size_t proxy) {
  ExternalHand& hand = hands_.at(proxy);
  hand.mode = ToolMode::kAway;
  hand.pushes.clear();
  readouts_[proxy].velocity_m_s.setZero();
}

void ExternalWorld::place_proxy(std::size_t proxy, const Vector3d& position_m, const Vector3d& velocity_m_s) {
  ExternalHand& hand = hands_.at(proxy);
  if (hand.mode == ToolMode::kAway) return;
  if (!gives_bodies_) unserved_ = hand.parameters.device;
  hand.mode = ToolMode::kPlaced;
  hand.target.position_m = position_m;
  hand.target.velocity_m_s = velocity_m_s;
  readouts_[proxy].position_m = position_m;
  readouts_[proxy].velocity_m_s = velocity_m_s;
}

void ExternalWorld::apply_hand_force(std::size_t proxy, std::size_t body, const Vector3d& force_n,
                                     const Vector3d& torque_n_m) {
  if (body >= bodies_.size() || bodies_[body].behind.kind != BodyKind::kDynamic) return;
  hands_.at(proxy).pushes.push_back({body, force_n, torque_n_m});
}

void ExternalWorld::set_proxy_target(std::size_t proxy, const ProxyTarget& target) {
  ExternalHand& hand = hands_.at(proxy);
  if (hand.mode == ToolMode::kAway) return;
  hand.mode = ToolMode::kSpring;
  hand.target = target;
}

void ExternalWorld::step(double step_s) {
  std::unique_lock lock(mutex_);
  if (closed_) return;
  step_s_ = step_s;
  turn_ = Turn::kEngine;
  changed_.notify_all();
  changed_.wait(lock, [this] { return turn_ == Turn::kNode || closed_; });
}

void ExternalWorld::contacts(std::size_t proxy, double radius_m, ContactSet& out) const {
  const ExternalHand& hand = hands_.at(proxy);
  out.radius_m = radius_m;
  out.proxy_radius_m = hand.parameters.radius_m;
  out.proxy_mass_kg = hand.parameters.mass_kg;
  FoundContacts found;
  if (hand.mode != ToolMode::kAway && proxy < answer_.tools.size()) {
    for (const Contact& contact : answer_.tools[proxy].contacts) {
      if (contact.gap_m <= radius_m) found.push_back(contact);
    }
  }
  keep_nearest(found, out);
  for (BodyBehind& row : out.bodies) {
    const std::uint32_t number = row.body;
    row = bodies_[number].behind;
    row.body = number;
  }
  for (Contact& contact : out.contacts) {
    const BodyBehind& row = out.bodies[contact.row];
    const Vector3d arm_m = contact.point_m - row.centre_m;
    contact.surface_velocity_m_s = row.velocity_m_s + row.angular_velocity_rad_s.cross(arm_m);
    if (row.kind == BodyKind::kDynamic) {
      contact.inverse_mass_per_kg = inverse_mass_at(row.inverse_mass_per_kg, row.inverse_inertia_per_kg_m2, arm_m);
    }
  }
  for (const ExternalAnswer::Support& each : answer_.supports) {
    const auto row = std::find_if(out.bodies.begin(), out.bodies.end(),
                                  [&each](const BodyBehind& body) { return body.body == each.body; });
    if (row == out.bodies.end()) continue;
    if (out.supports.size() == kMaxSupports) {
      ++out.supports_overflow;
      continue;
    }
    out.supports.push_back(each.support);
    out.supports.back().row = static_cast<std::uint32_t>(row - out.bodies.begin());
  }
}

}  // namespace physics
