#include "physics_node/bullet/bullet_proxy.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace physics::bullet {
namespace {

using Eigen::Vector3d;

Vector3d clamp_each(const Vector3d& value, double limit) { return value.cwiseMax(-limit).cwiseMin(limit); }

}  // namespace

BulletProxy::BulletProxy(const ProxyParameters& parameters, double radius_m, double scale)
    : mass_kg_(parameters.mass_kg), scale_(scale) {
  const bool finite = std::isfinite(parameters.mass_kg) && std::isfinite(radius_m) &&
                      std::isfinite(parameters.friction) && parameters.position_m.allFinite();
  if (!finite || parameters.mass_kg <= 0.0 || radius_m <= 0.0 || parameters.friction < 0.0) {
    throw std::invalid_argument("a proxy needs a mass above 0 kg, and a radius and a friction of 0 or more");
  }
  const auto radius = static_cast<btScalar>(radius_m * scale);
  shape_ = std::make_unique<btSphereShape>(radius);
  btRigidBody::btRigidBodyConstructionInfo info(static_cast<btScalar>(mass_kg_), nullptr, shape_.get());
  info.m_friction = static_cast<btScalar>(parameters.friction);
  body_ = std::make_unique<btRigidBody>(info);  // no inertia given: it does not turn
  body_mass_kg_ = mass_kg_;
  body_->setFlags(body_->getFlags() | BT_DISABLE_WORLD_GRAVITY);
  body_->setActivationState(DISABLE_DEACTIVATION);
  // Any step of more than a twentieth of the radius is looked along; the swept sphere is the proxy itself.
  body_->setCcdMotionThreshold(radius * btScalar(0.05));
  body_->setCcdSweptSphereRadius(radius);
  reset(parameters.position_m);
}

void BulletProxy::reset(const Vector3d& position_m) {
  if (!position_m.allFinite()) return;
  const Vector3d at_m = clamped(position_m);  // which may be of state_
  state_ = ProxyReadout{};
  place(at_m, Vector3d::Zero());
  target_.position_m = state_.position_m;
  target_.velocity_m_s.setZero();
  target_.force_n.setZero();
}

void BulletProxy::put(const Vector3d& position_m, const Vector3d& velocity_m_s) {
  if (!position_m.allFinite() || !velocity_m_s.allFinite()) return;
  state_ = ProxyReadout{};
  place(clamped(position_m), clamp_each(velocity_m_s, kMaxVelocityMS));
}

void BulletProxy::bear(const ProxyReadout& tool) noexcept {
  state_.coupling_force_n = tool.coupling_force_n;
  state_.contact_force_n = tool.contact_force_n;
  state_.contacts = tool.contacts;
}

void BulletProxy::set_target(const ProxyTarget& target) {
  if (!target.position_m.allFinite() || !target.velocity_m_s.allFinite() || !std::isfinite(target.stiffness_n_per_m) ||
      !std::isfinite(target.damping_n_s_per_m) || !target.force_n.allFinite()) {
    return;
  }
  target_.position_m = clamped(target.position_m);
  target_.velocity_m_s = clamp_each(target.velocity_m_s, kMaxVelocityMS);
  target_.stiffness_n_per_m = std::clamp(target.stiffness_n_per_m, 0.0, kMaxStiffnessNPerM);
  target_.damping_n_s_per_m = std::clamp(target.damping_n_s_per_m, 0.0, kMaxDampingNSPerM);
  target_.force_n = clamp_each(target.force_n, kMaxForceN);
  if (target.hand_m.allFinite()) target_.hand_m = target.hand_m;
}

void BulletProxy::before_step(double h) {
  const double K = target_.stiffness_n_per_m;
  const double B = target_.damping_n_s_per_m;
  ghost_mass_kg_ = h * (h * K + B);
  ghost_momentum_ = h * (K * (target_.position_m - state_.position_m) + B * target_.velocity_m_s + target_.force_n);
  const double mass_kg = mass_kg_ + ghost_mass_kg_;
  const Vector3d v_free = (mass_kg_ * state_.velocity_m_s + ghost_momentum_) / mass_kg;

  // Nobody's hand comes near this; it keeps Bullet's bounding boxes within what it accepts.
  free_velocity_ = to_bullet(clamp_each(v_free, 2.0 * kMaxUnits / (scale_ * h)), scale_);
  body_->setLinearVelocity(free_velocity_);
  body_->setInterpolationLinearVelocity(free_velocity_);
  if (mass_kg != body_mass_kg_) {
    body_->setMassProps(static_cast<btScalar>(mass_kg), btVector3(0, 0, 0));
    body_mass_kg_ = mass_kg;
  }
}

void BulletProxy::read_step(double h) {
  const btVector3 velocity = body_->getLinearVelocity();
  const Vector3d v_next = from_bullet(velocity, scale_);
  const Vector3d x_next = from_bullet(body_->getWorldTransform().getOrigin(), scale_);
  if (!v_next.allFinite() || !x_next.allFinite()) {  // bodies too heavy or too fast for the solver: begin anew, at rest
    reset(state_.position_m);
    touched_ = false;
    return;
  }
  touched_ = velocity != free_velocity_;  // without a contact Bullet hands back what it was given, bit for bit
  state_.coupling_force_n = (ghost_momentum_ - ghost_mass_kg_ * v_next) / h;
  state_.contact_force_n = Vector3d::Zero();
  if (touched_) state_.contact_force_n = mass_kg_ * (v_next - state_.velocity_m_s) / h - state_.coupling_force_n;
  state_.velocity_m_s = v_next;
  state_.position_m = x_next;
  const Vector3d inside = clamped(x_next);
  if (inside != x_next) place(inside, Vector3d::Zero());  // the end of the world
}

void BulletProxy::place(const Vector3d& position_m, const Vector3d& velocity_m_s) {
  state_.position_m = position_m;
  state_.velocity_m_s = velocity_m_s;
  const btTransform pose(btQuaternion::getIdentity(), to_bullet(position_m, scale_));
  body_->setWorldTransform(pose);
  body_->setInterpolationWorldTransform(pose);
  body_->setLinearVelocity(to_bullet(velocity_m_s, scale_));
  body_->setInterpolationLinearVelocity(to_bullet(velocity_m_s, scale_));
}

Vector3d BulletProxy::clamped(const Vector3d& position_m) const { return clamp_each(position_m, kMaxUnits / scale_); }

}  // namespace physics::bullet
