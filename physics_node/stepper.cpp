#include "physics_node/stepper.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "physics_node/contact_message.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/sane_sample.hpp"

namespace physics {
namespace {

using Eigen::Vector3d;

using rtbus::array_of;
using rtbus::vector_of;

/// Over so long the velocity is averaged at which a tool is taken to go on: an encoder's steps must not throw it.
constexpr double kDrift_s = 15e-3;
/// So far ahead at most it is told what becomes of what yields.
constexpr double kFarthestAhead_s = 0.25;

}  // namespace

Stepper::Stepper(std::unique_ptr<World> world, const std::vector<ProxyConfig>& proxies, int substeps,
                 std::uint64_t shape_hash)
    : world_(std::move(world)), substeps_(std::max(1, substeps)), shape_hash_(shape_hash) {
  for (const ProxyConfig& config : proxies) {
    // Until its device speaks it touches nothing: its first state brings it in.
    world_->release_proxy(world_->add_proxy(
        {config.device, config.mass_kg, config.radius_m, config.friction, config.position_m, 1.0 / config.rate_hz}));
    Link link;
    link.config = config;
    link.target.position_m = config.position_m;
    link.previous_target_m = config.position_m;
    links_.push_back(std::move(link));
  }
}

void Stepper::set_device(std::size_t proxy, const rtbus::DeviceState& device, std::uint64_t sequence) {
  Link& link = links_.at(proxy);
  if (!rtbus::sane(device, device.sample_time_ns)) {
    ++ignored_states_;
    return;
  }
  const double to_world = rtbus::gain_to_world(device.position_scale, device.force_scale);
  link.target.position_m = vector_of(device.target_position_m);
  link.target.velocity_m_s = vector_of(device.target_velocity_m_s);
  link.target.hand_m = device.position_scale * vector_of(device.position_m);
  link.target.stiffness_n_per_m = link.config.stiffness_n_per_m * to_world;
  link.target.damping_n_s_per_m =
      link.config.damping_n_s_per_m
          ? *link.config.damping_n_s_per_m * to_world
          : 2.0 * kDefaultDampingRatio * std::sqrt(link.target.stiffness_n_per_m * link.config.mass_kg);

  link.hand_stiffness_n_per_m = device.hand_stiffness_n_per_m * to_world;
  link.hand_damping_n_s_per_m = device.hand_damping_n_s_per_m * to_world;
  link.prediction_periods = device.prediction_periods;

  if (device.mapping_epoch != link.mapping_epoch) link.coupling_work_j = 0.0;
  const bool begins = link.silent || device.mapping_epoch != link.mapping_epoch || device.enabled == 0;
  link.connected = true;
  link.silent = false;
  link.enabled = device.enabled != 0;
  link.wants_contacts = (device.wants & rtbus::kWantsContacts) != 0;
  link.owns_proxy = (device.wants & rtbus::kOwnsProxy) != 0;
  if (begins || !link.owns_proxy) {
    link.queue.clear();
    link.hand_impulses.take(device);
  } else {
    queue_hand_impulses(link, device);
  }
  if (begins) {
    link.drift_ns = 0;
    link.spring_n_s.setZero();
  }
  follow_drift(link, device);
  link.answer_age_s = std::max(device.answer_age_s, begins ? 0.0 : kAgeKept * link.answer_age_s);
  link.position_scale = device.position_scale;
  link.mapping_epoch = device.mapping_epoch;
  link.device_sequence = sequence;
  link.device_time_ns = device.sample_time_ns;
  if (begins) rebase(proxy);
}

void Stepper::hear(std::size_t proxy, const rtbus::DeviceState& device) {
  Link& link = links_.at(proxy);
  const bool goes_on = !link.silent && link.owns_proxy && device.enabled != 0 &&
                       (device.wants & rtbus::kOwnsProxy) != 0 && device.mapping_epoch == link.mapping_epoch;
  if (!goes_on || device.sample_time_ns <= link.hand_impulses.time_ns) return;
  if (!rtbus::sane(device, device.sample_time_ns)) return;
  queue_hand_impulses(link, device);
  follow_drift(link, device);
}

void Stepper::follow_drift(Link& link, const rtbus::DeviceState& device) {
  const Vector3d at_m = vector_of(device.target_position_m);
  if (link.drift_ns == 0) link.drift_m_s.setZero();
  if (link.drift_ns != 0 && device.sample_time_ns > link.drift_ns) {
    const double h = rtbus::seconds_between(link.drift_ns, device.sample_time_ns);
    link.drift_m_s += -std::expm1(-h / kDrift_s) * ((at_m - link.drift_at_m) / h - link.drift_m_s);
  }
  link.drift_ns = device.sample_time_ns;
  link.drift_at_m = at_m;
}

/// What the hand did since its sample before.
void Stepper::queue_hand_impulses(Link& link, const rtbus::DeviceState& device) {
  const HandImpulses& before = link.hand_impulses;
  ImpulseQueue::Rows rows{};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (device.hand_impulse_generation[i] == 0) continue;
    const bool same =
        device.hand_impulse_generation[i] == before.generation[i] && device.hand_impulse_body[i] == before.body[i];
    rows[i].body = device.hand_impulse_body[i];
    rows[i].impulse_n_s = vector_of(device.hand_impulse_n_s[i]);
    rows[i].angular_n_m_s = vector_of(device.hand_angular_impulse_n_m_s[i]);
    if (!same) continue;
    rows[i].impulse_n_s -= vector_of(before.impulse_n_s[i]);
    rows[i].angular_n_m_s -= vector_of(before.angular_n_m_s[i]);
  }
  const std::uint64_t gap_ns = device.sample_time_ns - std::min(before.time_ns, device.sample_time_ns);
  if (gap_ns > 0) {
    link.gap.add(gap_ns);
    link.tick_ns = gap_ns;
  }
  link.queue.tell(rows, 1e-9 * static_cast<double>(gap_ns));
  link.hand_impulses.take(device);
}

void Stepper::HandImpulses::take(const rtbus::DeviceState& device) noexcept {
  time_ns = device.sample_time_ns;
  body = device.hand_impulse_body;
  generation = device.hand_impulse_generation;
  impulse_n_s = device.hand_impulse_n_s;
  angular_n_m_s = device.hand_angular_impulse_n_m_s;
}

/// What the bodies receive in the next step. In one memory samples and steps are out of step by a part of a step at
/// most, or a tick. So much, and two ticks of 1 ms, is held back once samples have failed to come: the push goes on
/// evenly where two in a row are lost.
void Stepper::gather_impulses(double dt_s) {
  constexpr double kMostOverNetwork_s = 0.25, kMostOfStep = 0.25, kMostTicks_s = 3e-3;
  const double held_s = kMostOfStep * dt_s + kMostTicks_s;
  const auto due_s = [&](const Link& link) {
    if (link.config.wire.over_network()) return link.queue.due_s(dt_s, kMostOverNetwork_s, 0.0);
    return link.queue.due_s(dt_s, held_s, 1e-9 * static_cast<double>(link.tick_ns));
  };
  const auto gives_here = [](const Link& link) {
    return link.owns_proxy && link.enabled && !link.silent && !link.config.wire.over_network();
  };
  const auto until_ns = [&](const Link& link) {
    return received_until_ns(link) + rtbus::ns_of(std::min(due_s(link), link.queue.queued_s()));
  };
  // Hands that press a body between them give it equally long pushes: where the last sample of one is not there, the
  // other one's waits for it, but not for a hand that has ended, and no more than held_s of it. A body of a gram gains
  // 0.5 m/s by 0.5 N within 1 ms.
  std::uint64_t newest_ns = 0, common_ns = std::numeric_limits<std::uint64_t>::max();
  for (const Link& link : links_) {
    if (gives_here(link)) newest_ns = std::max(newest_ns, link.device_time_ns);
  }
  for (const Link& link : links_) {
    const bool is_due = link.device_time_ns + link.gap.goes_on_ns(link.tick_ns) >= newest_ns;
    if (gives_here(link) && is_due) common_ns = std::min(common_ns, until_ns(link));
  }
  for (Link& link : links_) {
    link.due.clear();
    const double due = due_s(link);
    double most_s = due;
    if (gives_here(link) && common_ns < until_ns(link)) {
      const std::uint64_t from_ns = received_until_ns(link);
      const double common_s = common_ns > from_ns ? rtbus::seconds_between(from_ns, common_ns) : 0.0;
      most_s = std::clamp(common_s, std::min(due, std::max(0.0, link.queue.queued_s() - held_s)), due);
    }
    link.queue.take(due, most_s, link.due);
  }
}

/// Applies the part of the impulses of the step that belongs to the interval [from, to] of a step of `dt_s` seconds
/// (0…1 of the step). The loop counts an impulse at the beginning of its tick; so does a part of a step.
void Stepper::apply_pending(std::size_t proxy, double from, double to, double dt_s) {
  Link& link = links_[proxy];
  pushes_.clear();
  for (const PendingImpulse& pending : link.due) {
    const double share = (std::min(to, pending.to) - std::max(from, pending.from)) / (pending.to - pending.from);
    if (share <= 0.0) continue;
    auto push = std::find_if(pushes_.begin(), pushes_.end(),
                             [&pending](const PendingImpulse& each) { return each.body == pending.body; });
    if (push == pushes_.end()) push = pushes_.insert(push, PendingImpulse{pending.body});
    push->impulse_n_s += share * pending.impulse_n_s;
    push->angular_n_m_s += share * pending.angular_n_m_s;
  }
  const double per_s = 1.0 / ((to - from) * dt_s);
  link.tool_push_n.setZero();
  for (const PendingImpulse& push : pushes_) {
    if (push.body == rtbus::kYieldingBodies) {
      link.tool_push_n = per_s * push.impulse_n_s;
      continue;
    }
    const Vector3d force_n = per_s * push.impulse_n_s;
    Vector3d torque_n_m = per_s * push.angular_n_m_s;
    // The hand knows one centre of a body and of what it carries.
    if (push.body < own_B_m_.size() && !own_B_m_[push.body].isZero(0.0)) {
      torque_n_m -= (world_->body_pose(push.body).orientation * own_B_m_[push.body]).cross(force_n);
    }
    world_->apply_hand_force(proxy, push.body, force_n, torque_n_m);
  }
}

void Stepper::release(std::size_t proxy) {
  Link& link = links_.at(proxy);
  if (!link.connected) return;
  link.target.velocity_m_s.setZero();
  link.silent = true;
  link.wants_contacts = false;
  link.queue.clear();
  world_->release_proxy(proxy);
}

double Stepper::contact_radius_m(std::size_t proxy) const {
  const Link& link = links_.at(proxy);
  const double speed_m_s = std::max({world_->proxy(proxy).velocity_m_s.norm(), link.target.velocity_m_s.norm(),
                                     kHandSpeed_m_s * link.position_scale}) +
                           kFall_m_s2 * link.position_scale * step_s_;
  return std::max(kRestRadius_m * link.position_scale, std::max(2.0 * step_s_, link.answer_age_s) * speed_m_s);
}

std::uint64_t Stepper::received_until_ns(const Link& link) noexcept {
  return link.device_time_ns - std::min(link.device_time_ns, rtbus::ns_of(link.queue.queued_s()));
}

void Stepper::contacts(std::size_t proxy, double radius_m, rtbus::ProxyContacts& out) {
  world_->contacts(proxy, radius_m > 0.0 ? radius_m : contact_radius_m(proxy), contacts_);
  for (BodyBehind& body : contacts_.bodies) {
    if (body.kind == BodyKind::kSoft) continue;
    const BodyPose pose = world_->body_pose(body.body);
    body.orientation = pose.orientation;
    if (body.body >= own_B_m_.size()) own_B_m_.resize(body.body + 1, Vector3d::Zero());
    own_B_m_[body.body] = pose.orientation.conjugate() * body.own_from_centre_m;
    body.origin_from_centre_m = pose.position_m - body.centre_m;
  }
  const Link& link = links_[proxy];
  world_->tool_reaction(proxy, contacts_.radius_m,
                        std::min(std::max(2.0 * step_s_, link.answer_age_s), kFarthestAhead_s), link.drift_m_s,
                        reaction_);
  fill_message(contacts_, reaction_, answer(proxy), out);
  out.shape_hash = shape_hash_;
  out.device_time_ns = received_until_ns(links_[proxy]);
  out.hands = static_cast<std::uint32_t>(std::min(links_.size(), rtbus::kHandSlots));
  for (std::size_t i = 0; i < out.hands; ++i) {
    out.hand_time_ns[i] = links_[i].owns_proxy ? received_until_ns(links_[i]) : 0;
  }
}

void Stepper::contact_points(std::size_t proxy, rtbus::ContactPoints& out) {
  world_->contacts(proxy, contact_radius_m(proxy), contacts_);
  out.step_index = steps_;
  out.simulated_s = simulated_s_;
  fill_points(contacts_, out);
}

void Stepper::set_body_orders(const rtbus::BodyOrders& orders, std::uint64_t now_ns) {
  for (std::size_t i = 0; i < std::min<std::size_t>(orders.count, rtbus::BodyOrders::kBodies); ++i) {
    if (orders.body[i] >= world_->bodies()) continue;
    BodyTarget target;
    const rtbus::Quat& q = orders.orientation_wxyz[i];
    const Eigen::Quaterniond q_WB(q[0], q[1], q[2], q[3]);
    const auto order = static_cast<rtbus::BodyOrder>(orders.order[i]);
    if (now_ns < orders.until_ns[i] && order == rtbus::BodyOrder::kTwist) {
      target.kind = BodyTarget::Kind::kTwist;
      target.velocity_m_s = vector_of(orders.velocity_m_s[i]);
      target.angular_velocity_rad_s = vector_of(orders.angular_velocity_rad_s[i]);
    } else if (now_ns < orders.until_ns[i] && order == rtbus::BodyOrder::kPose && q_WB.norm() > 0.5) {
      target.kind = BodyTarget::Kind::kPose;
      target.pose = {vector_of(orders.position_m[i]), q_WB.normalized()};
    }
    world_->set_body_target(orders.body[i], target);
  }
}

void Stepper::step(double dt_s, int substeps) {
  const double h = dt_s / substeps;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    const Link& link = links_[i];
    if (link.connected && !link.silent && link.config.wire.paper) world_->set_proxy_target(i, explicit_spring(i));
  }
  for (Link& link : links_) {
    link.coupling_force_n.setZero();
    link.contact_force_n.setZero();
    link.contacts = 0;
  }
  gather_impulses(dt_s);
  const auto end_of = [dt_s](const Link& link) -> Vector3d {
    if (!link.enabled || link.owns_proxy || link.config.lead_steps == 0.0) return link.target.position_m;
    return link.target.position_m + link.config.lead_steps * dt_s * link.target.velocity_m_s;
  };
  for (int part = 1; part <= substeps; ++part) {
    for (std::size_t i = 0; i < links_.size(); ++i) {
      const Link& link = links_[i];
      if (!link.connected || link.silent || link.config.wire.paper) continue;
      if (link.owns_proxy) {
        world_->place_proxy(i, link.target.position_m, link.target.velocity_m_s);
        apply_pending(i, (part - 1.0) / substeps, static_cast<double>(part) / substeps, dt_s);
        drive_tool(i, static_cast<double>(part) / substeps, dt_s);
        continue;
      }
      ProxyTarget target = link.target;
      target.position_m = end_of(link);
      if (!link.enabled) target.velocity_m_s.setZero();  // nothing may drag a proxy that nobody feels
      if (part < substeps) {
        const double done = static_cast<double>(part) / substeps;
        target.position_m = link.previous_target_m + done * (target.position_m - link.previous_target_m);
      }
      world_->set_proxy_target(i, target);
    }
    for (std::size_t i = 0; i < links_.size(); ++i) links_[i].begin_m = world_->proxy(i).position_m;
    world_->step(h);
    for (std::size_t i = 0; i < links_.size(); ++i) {
      Link& link = links_[i];
      const ProxyReadout readout = world_->proxy(i);
      if (link.owns_proxy) link.spring_n_s += h * (readout.coupling_force_n - link.tool_push_n);
      link.coupling_work_j -= readout.coupling_force_n.dot(readout.position_m - link.begin_m);
      link.coupling_force_n += readout.coupling_force_n / substeps;
      link.contact_force_n += readout.contact_force_n / substeps;
      link.contacts = std::max(link.contacts, readout.contacts);
    }
  }
  for (Link& link : links_) {
    link.previous_target_m = end_of(link);
    if (!link.owns_proxy) continue;
    for (const PendingImpulse& pending : link.due) {
      if (pending.body == rtbus::kYieldingBodies) continue;
      link.contact_force_n -= pending.impulse_n_s / dt_s;
      link.contacts += pending.impulse_n_s.isZero(0.0) ? 0U : 1U;
    }
    link.coupling_force_n = -link.contact_force_n;
  }
  step_s_ = dt_s;
  simulated_s_ += dt_s;
  ++steps_;
}

/// The tool among what yields goes with the proxy, and gets what the hand felt. What its spring gives besides is owed.
void Stepper::drive_tool(std::size_t proxy, double done, double dt_s) {
  const Link& link = links_[proxy];
  ProxyTarget drive = link.target;
  drive.position_m = link.previous_target_m + done * (link.target.position_m - link.previous_target_m);
  drive.velocity_m_s = (link.target.position_m - link.previous_target_m) / dt_s;
  drive.force_n = link.tool_push_n;
  drive.owed_n = -link.spring_n_s / pays_back_s(link);
  world_->drive_tool(proxy, drive);
}

/// Two hands at one light body: what differs of their forces is a delayed integrator, d/dt φ = −g·φ(t − age)/pays_back,
/// g = S/(S + K) < 1, because each is owed what the other one's spring gave. It rings for ever from age = π/(2g) times
/// that on.
double Stepper::pays_back_s(const Link& link) const {
  const auto owners = std::count_if(links_.begin(), links_.end(),
                                    [](const Link& each) { return each.owns_proxy && !each.silent && each.enabled; });
  return owners < 2 ? kPaysBack_s : std::max(kPaysBack_s, kPaysBackAges * link.answer_age_s);
}

rtbus::ProxyState Stepper::answer(std::size_t proxy) const {
  const Link& link = links_.at(proxy);
  const ProxyReadout readout = world_->proxy(proxy);
  rtbus::ProxyState state;
  state.position_m = array_of(readout.position_m);
  state.velocity_m_s = array_of(readout.velocity_m_s);
  state.orientation_wxyz = array_of(readout.orientation);
  state.angular_velocity_rad_s = array_of(readout.angular_velocity_rad_s);
  state.coupling_force_n = array_of(link.coupling_force_n);
  state.contact_force_n = array_of(link.contact_force_n);
  state.hand_force_n = array_of(hand_force_n(link, readout));
  state.coupling_work_j = link.owns_proxy ? 0.0 : link.coupling_work_j;
  state.step_s = step_s_;
  state.device_sequence = link.device_sequence;
  state.device_time_ns = link.device_time_ns;
  state.step_index = steps_;
  state.contacts = link.contacts;
  state.mapping_epoch = link.mapping_epoch;
  return state;
}

ProxyTarget Stepper::explicit_spring(std::size_t proxy) const {
  const Link& link = links_[proxy];
  const ProxyReadout now = world_->proxy(proxy);
  ProxyTarget held;
  held.position_m = link.target.position_m;
  held.force_n = link.target.stiffness_n_per_m * (link.target.position_m - now.position_m) -
                 link.target.damping_n_s_per_m * now.velocity_m_s;
  return held;
}

Vector3d Stepper::hand_force_n(const Link& link, const ProxyReadout& readout) const {
  if (!link.enabled || link.silent) return Vector3d::Zero();
  const Vector3d ahead_m = link.prediction_periods * step_s_ * readout.velocity_m_s;
  const Vector3d stretch_m = readout.position_m + ahead_m - link.target.position_m;
  const Vector3d speed_m_s =
      link.config.wire.paper ? readout.velocity_m_s : Vector3d(link.target.velocity_m_s - readout.velocity_m_s);
  return link.hand_stiffness_n_per_m * stretch_m - link.hand_damping_n_s_per_m * speed_m_s;
}

void Stepper::rebase(std::size_t proxy) {
  Link& link = links_[proxy];
  world_->reset_proxy(proxy, link.target.position_m);
  link.previous_target_m = link.target.position_m;
}

}  // namespace physics
