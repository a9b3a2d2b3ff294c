#include "physics_node/bullet/bullet_world.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rtbus/three_digits.hpp"

namespace physics::bullet {
namespace {

using Eigen::Vector3d;
using rtbus::three_digits;
namespace config = rtbus::config;

constexpr unsigned long kShuffleSeed = 1;

/// It has the mass of its spring alone.
constexpr double kToolMass_kg = 1e-6;
constexpr double kNothing_n = 1e-4;

// Who collides with whom: proxies with bodies, not with each other.
// (8 is that of soft bodies.) Tools meet light bodies alone.
constexpr int kStaticGroup = 1, kMovingGroup = 2, kProxyGroup = 4, kToolGroup = 16, kLightGroup = 32;

double sleeping_speed_m_s(double gravity_m_s2, double extent_m) { return 0.06 * std::sqrt(gravity_m_s2 * extent_m); }
double sleeping_rate_rad_s(double gravity_m_s2, double extent_m) { return 0.045 * std::sqrt(gravity_m_s2 / extent_m); }

/// Of Bullet's velocities it takes away v·damping in a second, not in proportion to time: 1 − e^(−λ) is the same decay.
btScalar damping_of(double per_s) { return static_cast<btScalar>(-std::expm1(-per_s)); }

/// Before the step, in which contacts take away what they do not allow. Bullet's gyroscopic torque ω×Iω is of the ω
/// before that: of a spin that never is, I⁻¹τh, it is as large as (τh)²/I. It comes first therefore, and not again.
void turn_at_once(btRigidBody& rigid, const btVector3& impulse, double h) {
  if ((rigid.getFlags() & BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY) != 0) {
    // In spite of its name a change of the angular velocity.
    rigid.setAngularVelocity(rigid.getAngularVelocity() +
                             rigid.computeGyroscopicImpulseImplicit_Body(static_cast<btScalar>(h)));
    rigid.setFlags(rigid.getFlags() & ~BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY);
  }
  rigid.applyTorqueImpulse(impulse);
}

}  // namespace

BulletWorld::BulletWorld(const config::Scene& scene, const EngineSettings& settings)
    : BulletWorld(scene, settings, std::make_unique<btDefaultCollisionConfiguration>(),
                  [](btDispatcher* dispatcher, btBroadphaseInterface* broadphase, btConstraintSolver* solver,
                     btCollisionConfiguration* configuration) {
                    return std::make_unique<btDiscreteDynamicsWorld>(dispatcher, broadphase, solver, configuration);
                  }) {}

BulletWorld::BulletWorld(const config::Scene& scene, const EngineSettings& settings,
                         std::unique_ptr<btDefaultCollisionConfiguration> configuration, MakeDynamics make_dynamics)
    : deactivation_(scene.deactivation),
      gravity_m_s2_(scene.gravity_m_s2.norm()),
      smallest_m_(smallest_moving_extent_m(scene)),
      scale_(length_scale(smallest_m_)),
      scene_file_(scene.file),
      configuration_(std::move(configuration)),
      face_contacts_(*configuration_),
      mesh_contacts_(*configuration_),
      dispatcher_(configuration_.get()),
      world_(make_dynamics(&dispatcher_, &broadphase_, &solver_, configuration_.get())) {
  world_->setGravity(to_bullet(scene.gravity_m_s2, scale_));
  btContactSolverInfo& info = world_->getSolverInfo();
  info.m_numIterations = settings.solver_iterations;
  info.m_solverMode |= SOLVER_RANDMIZE_ORDER;  // so spelt
  solver_.setRandSeed(kShuffleSeed);
  info.m_splitImpulsePenetrationThreshold *= static_cast<btScalar>(kToleranceScale);
  world_->getDispatchInfo().m_allowedCcdPenetration *= static_cast<btScalar>(kToleranceScale);
  world_->setForceUpdateAllAabbs(false);  // what sleeps or is static has not moved

  // Bullet's own algorithm for two spheres makes no contact while they are apart, however little, and keeps the old one
  // with its old normal: a proxy that slides over a ball then lifts off along a tangent and drops back, 37 times a
  // second. The general algorithm sees the gap and gives the normal anew in each step.
  dispatcher_.registerCollisionCreateFunc(
      SPHERE_SHAPE_PROXYTYPE, SPHERE_SHAPE_PROXYTYPE,
      configuration_->getCollisionAlgorithmCreateFunc(BOX_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE));
  face_contacts_.add_to(dispatcher_);
  mesh_contacts_.add_to(dispatcher_);

  // Copies in a grid share their shape: the reader gives neighbours the same dimensions and file.
  bodies_.reserve(scene.bodies.size());
  const config::Body* previous = nullptr;
  for (const config::Body& body : scene.bodies) {
    const bool same = previous != nullptr && previous->shape.index() == body.shape.index() &&
                      std::visit(
                          [&body](const auto& other) {
                            using Shape = std::decay_t<decltype(other)>;
                            const auto& own = std::get<Shape>(body.shape);
                            if constexpr (std::is_same_v<Shape, rtbus::shapes::Box>) {
                              return own.half_size_m == other.half_size_m;
                            } else if constexpr (std::is_same_v<Shape, rtbus::shapes::Sphere>) {
                              return own.radius_m == other.radius_m;
                            } else if constexpr (std::is_same_v<Shape, config::ConvexHull>) {
                              return own.points == other.points;
                            } else {
                              return false;
                            }
                          },
                          previous->shape);
    add_body(body, same ? bodies_.back().made : std::make_shared<MadeShape>(make_shape(body.shape, scale_)));
    previous = &body;
  }
}

BulletWorld::~BulletWorld() {
  for (std::size_t i = 0; i < tools_.size(); ++i) drop_tool(i);
  for (const auto& proxy : proxies_) {
    if (!proxy->released()) world_->removeRigidBody(&proxy->body());
  }
  for (const SceneBody& body : bodies_) world_->removeRigidBody(body.rigid.get());
}

void BulletWorld::add_body(const config::Body& body, std::shared_ptr<MadeShape> made) {
  const bool moves = body.type == config::BodyType::kDynamic;
  const auto mass = static_cast<btScalar>(moves ? body.mass_kg : 0.0);
  btVector3 inertia(0, 0, 0);
  if (moves) made->shape->calculateLocalInertia(mass, inertia);
  btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, made->shape.get(), inertia);
  info.m_startWorldTransform =
      btTransform(to_bullet(body.q_WB), to_bullet(Vector3d(body.p_WB + body.q_WB * made->centre_m), scale_));
  info.m_friction = static_cast<btScalar>(body.friction);
  info.m_restitution = static_cast<btScalar>(body.restitution);
  if (moves) {
    info.m_linearDamping = damping_of(body.linear_damping_per_s);
    info.m_angularDamping = damping_of(body.angular_damping_per_s);
  }
  auto rigid = std::make_unique<btRigidBody>(info);
  // A contact that is seen before it touches brakes the body down to the rest of the gap in one step, and nothing is
  // left to bounce. A body that bounces is therefore solved from touching on.
  if (body.motion) {
    rigid->setCollisionFlags(rigid->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    moving_.push_back({rigid.get(), body, config::pose_at(*body.motion, body.p_WB, body.q_WB, 0.0)});
  }
  rigid->setUserIndex(static_cast<int>(bodies_.size()));
  if (moves && body.restitution > 0.0) rigid->setContactProcessingThreshold(0);
  world_->addRigidBody(rigid.get(), moves ? kMovingGroup : kStaticGroup,
                       moves ? kStaticGroup | kMovingGroup | kProxyGroup : kMovingGroup | kProxyGroup);
  if (moves) set_thresholds(body, *rigid);
  double reach = std::numeric_limits<double>::infinity();
  if (made->shape->isConvex()) {
    btVector3 middle;
    btScalar radius = 0;
    made->shape->getBoundingSphere(middle, radius);
    reach = static_cast<double>(middle.length() + radius);
  }
  bodies_.push_back({std::move(made), std::move(rigid), reach});
}

void BulletWorld::set_thresholds(const config::Body& body, btRigidBody& rigid) const {
  const double extent_m = smallest_extent_m(body.shape);
  const double speed = deactivation_.linear_m_s.value_or(sleeping_speed_m_s(gravity_m_s2_, extent_m));
  const double rate = deactivation_.angular_rad_s.value_or(sleeping_rate_rad_s(gravity_m_s2_, extent_m));
  rigid.setSleepingThresholds(static_cast<btScalar>(speed * scale_), static_cast<btScalar>(rate));
  if (!deactivation_.enabled) {
    rigid.setActivationState(DISABLE_DEACTIVATION);
  } else if (body.asleep) {
    rigid.forceActivationState(ISLAND_SLEEPING);
  }
}

std::size_t BulletWorld::add_proxy(const ProxyParameters& parameters) {
  const double radius_m = parameters.radius_m == 0.0 ? kSmallestRadius * smallest_m_ : parameters.radius_m;
  auto proxy = std::make_unique<BulletProxy>(parameters, radius_m, scale_);
  world_->addRigidBody(&proxy->body(), kProxyGroup, kStaticGroup | kMovingGroup);
  proxies_.push_back(std::move(proxy));
  tools_.emplace_back();
  tick_s_.push_back(parameters.tick_s);
  borne_.emplace_back();
  return proxies_.size() - 1;
}

void BulletWorld::reset_proxy(std::size_t index, const Vector3d& position_m) {
  BulletProxy& proxy = *proxies_.at(index);
  if (!position_m.allFinite()) return;
  drop_tool(index);
  proxy.reset(position_m);
  if (proxy.released() || proxy.placed()) {
    proxy.set_released(false);
    proxy.set_placed(false);
    world_->addRigidBody(&proxy.body(), kProxyGroup, kStaticGroup | kMovingGroup);
    return;
  }
  // Contacts of the place it left must not act at the new one.
  broadphase_.getOverlappingPairCache()->cleanProxyFromPairs(proxy.body().getBroadphaseHandle(), &dispatcher_);
  world_->updateSingleAabb(&proxy.body());
}

void BulletWorld::release_proxy(std::size_t index) {
  BulletProxy& proxy = *proxies_.at(index);
  if (proxy.released()) return;
  drop_tool(index);
  if (!proxy.placed()) take_out(proxy);
  proxy.set_placed(false);
  proxy.reset(proxy.state().position_m);
  proxy.set_released(true);
}

void BulletWorld::take_out(BulletProxy& proxy) {
  // What it has touched stays awake until it has found its own rest.
  for (int i = 0; i < dispatcher_.getNumManifolds(); ++i) {
    const btPersistentManifold* const manifold = dispatcher_.getInternalManifoldPointer()[i];
    if (manifold->getBody0() == &proxy.body()) manifold->getBody1()->activate();
    if (manifold->getBody1() == &proxy.body()) manifold->getBody0()->activate();
  }
  world_->removeRigidBody(&proxy.body());
}

void BulletWorld::place_proxy(std::size_t index, const Vector3d& position_m, const Vector3d& velocity_m_s) {
  BulletProxy& proxy = *proxies_.at(index);
  if (proxy.released()) return;
  if (!proxy.placed()) take_out(proxy);
  proxy.set_placed(true);
  proxy.put(position_m, velocity_m_s);
}

/// The tool's spring from the proxy and what the hand felt are together a spring from the hand. Where everything rests,
/// a soft body gets that alone. The debt comes one answer late: it swings the tool up, and a hand that feels the mean
/// does not brake it. Light bodies keep theirs: nothing but hands holds them.
void BulletWorld::drive_tool(std::size_t index, const ProxyTarget& target) {
  BulletProxy& proxy = *proxies_.at(index);
  if (!proxy.placed() || proxy.released()) return;
  auto& tool = tools_[index];
  if (!tool) {
    find_light_bodies(kLightest * target.stiffness_n_per_m * tick_s_[index] * tick_s_[index]);
    if (!any_light_ && !anything_yields()) return;
    ProxyParameters parameters;
    parameters.mass_kg = kToolMass_kg;
    parameters.friction = static_cast<double>(proxy.body().getFriction());
    parameters.position_m = proxy.state().position_m;
    tool = std::make_unique<BulletProxy>(parameters, proxy.radius() / scale_, scale_);
    world_->addRigidBody(&tool->body(), kToolGroup, kLightGroup);
    borne_[index] = Borne{};
  }
  Borne& borne = borne_[index];
  ProxyTarget driven = target;
  borne.left_n.setZero();
  if (borne.left_s > kLeft_s && borne.left_s < kPaid_s && touched_last(index) && target.owed_n.allFinite()) {
    borne.left_n = target.owed_n;
  } else {
    driven.force_n += (anything_yields() ? 1.0 - rest() : 1.0) * target.owed_n;
  }
  tool->set_target(driven);
}

/// So few as are told together push as free bodies do.
void BulletWorld::find_light_bodies(double below_kg) {
  const auto is_light = [below_kg](const SceneBody& body) {
    return static_cast<double>(body.rigid->getInvMass()) * below_kg > 1.0;
  };
  if (std::count_if(bodies_.begin(), bodies_.end(), is_light) <= static_cast<std::ptrdiff_t>(kMostTogether)) return;
  for (SceneBody& body : bodies_) {
    if (body.light || !is_light(body)) continue;
    body.light = any_light_ = true;
    leave_to_bullet(*body.rigid);
    btBroadphaseProxy& handle = *body.rigid->getBroadphaseHandle();
    handle.m_collisionFilterGroup |= kLightGroup;
    handle.m_collisionFilterMask |= kToolGroup;
  }
}

/// Hands and rigid bodies, those that move by themselves too: they have no mass, which makes them static for Bullet as
/// well. What yields may rattle on. A body that turns by 20 mrad moves by RestWatch::kWay_m at the end of kArm_m.
void BulletWorld::watch_rest(double h) {
  constexpr double kArm_m = 0.05;
  rest_.begin();
  for (std::size_t i = 0; i < proxies_.size(); ++i) {
    const BulletProxy& hand = tools_[i] ? *tools_[i] : *proxies_[i];
    if (!proxies_[i]->released()) rest_.see(hand.target().hand_m);
  }
  for (const SceneBody& body : bodies_) {
    if (body.light || (body.rigid->isStaticObject() && !body.rigid->isKinematicObject())) continue;
    const btTransform& pose = body.rigid->getWorldTransform();
    const Vector3d origin_m = from_bullet(pose.getOrigin(), scale_);
    rest_.see(origin_m);
    rest_.see(origin_m + kArm_m * from_bullet(pose.getBasis().getColumn(0)));
    rest_.see(origin_m + kArm_m * from_bullet(pose.getBasis().getColumn(1)));
  }
  rest_.end(h);
}

void BulletWorld::drop_tool(std::size_t index) {
  if (!tools_[index]) return;
  take_out(*tools_[index]);
  tools_[index].reset();
}

void BulletWorld::apply_hand_force(std::size_t proxy, std::size_t body, const Vector3d& force_n,
                                   const Vector3d& torque_n_m) {
  if (body >= bodies_.size() || bodies_[body].rigid->isStaticOrKinematicObject()) return;
  if (!force_n.allFinite() || !torque_n_m.allFinite()) return;
  pushes_.push_back({proxy, body, force_n, torque_n_m});
}

void BulletWorld::set_proxy_target(std::size_t index, const ProxyTarget& target) {
  proxies_.at(index)->set_target(target);
}

btTransform BulletWorld::pose_of(int index, const rtbus::config::PlacedAt& at) const {
  const Vector3d centre_m = at.p_WB + at.q_WB * bodies_[static_cast<std::size_t>(index)].made->centre_m;
  return btTransform(to_bullet(at.q_WB), to_bullet(centre_m, scale_));
}

void BulletWorld::set_body_target(std::size_t index, const BodyTarget& target) {
  for (MovingBody& each : moving_) {
    if (each.rigid->getUserIndex() == static_cast<int>(index)) each.target = target;
  }
}

rtbus::config::PlacedAt BulletWorld::MovingBody::after(double time_s, double step_s) const {
  const auto* const ordered = std::get_if<rtbus::config::TargetMotion>(&*body.motion);
  if (ordered == nullptr) return rtbus::config::pose_at(*body.motion, body.p_WB, body.q_WB, time_s + step_s);
  rtbus::config::PlacedAt wanted = now;
  if (target.kind == BodyTarget::Kind::kPose) {
    wanted = {target.pose.position_m, target.pose.orientation};
  } else if (target.kind == BodyTarget::Kind::kTwist) {
    wanted.p_WB += step_s * target.velocity_m_s;
    if (const double rate = target.angular_velocity_rad_s.norm(); rate > 0.0) {
      const double angle = std::min(rate * step_s, 1.0);  // above, step_toward() would take the other way round
      wanted.q_WB = Eigen::AngleAxisd(angle, target.angular_velocity_rad_s / rate) * now.q_WB;
    }
  }
  return rtbus::config::step_toward(*ordered, body.p_WB, now, wanted, step_s);
}

/// Bullet takes the velocity of a kinematic body to be the way from its interpolation transform to its world transform,
/// and looks for contacts at the latter. The latter is therefore the pose at the start of the step, and the former lies
/// as far behind it as the step goes ahead.
void BulletWorld::place_moving(double h) {
  for (const MovingBody& each : moving_) {
    const rtbus::config::PlacedAt now = each.now, next = each.after(time_s_, h);
    const btTransform at_now = pose_of(each.rigid->getUserIndex(), now);
    const bool moves = (next.p_WB - now.p_WB).squaredNorm() > 0.0 || next.q_WB.coeffs() != now.q_WB.coeffs();
    const btTransform behind = moves
                                   ? pose_of(each.rigid->getUserIndex(),
                                             {2.0 * now.p_WB - next.p_WB, now.q_WB * next.q_WB.conjugate() * now.q_WB})
                                   : at_now;
    each.rigid->setWorldTransform(at_now);
    each.rigid->setInterpolationWorldTransform(behind);
    each.rigid->forceActivationState(moves ? DISABLE_DEACTIVATION : ISLAND_SLEEPING);
    if (!moves) {  // Bullet looks only at those that are awake
      each.rigid->setLinearVelocity(btVector3(0, 0, 0));
      each.rigid->setAngularVelocity(btVector3(0, 0, 0));
    }
  }
}

void BulletWorld::before_dynamics(double) {}
void BulletWorld::after_dynamics(double) {}
bool BulletWorld::touched_last(std::size_t) const { return false; }
void BulletWorld::add_more_contacts(std::size_t, double, ContactSet&) const {}

void BulletWorld::step(double step_s) {
  if (!std::isfinite(step_s) || step_s <= 0.0) return;
  const double h = std::clamp(step_s, kMinStepS, kMaxStepS);
  // The time until a body sleeps is a global of Bullet's; a bounce slower than what gravity adds in two steps is none.
  gDeactivationTime = static_cast<btScalar>(deactivation_.after_s);
  world_->getSolverInfo().m_restitutionVelocityThreshold = static_cast<btScalar>(2.0 * gravity_m_s2_ * h * scale_);

  place_moving(h);
  for (const auto& proxy : proxies_) {
    if (!proxy->placed()) proxy->before_step(h);
  }
  for (const auto& tool : tools_) {
    if (tool) tool->before_step(h);
  }
  for (const Push& push : pushes_) {
    btRigidBody& rigid = *bodies_[push.body].rigid;
    rigid.activate();
    rigid.applyCentralForce(to_bullet(push.force_n, scale_));
    // Not as a torque: Bullet's friction leaves out what a torque does within the step, and a block that is pushed
    // beside its centre crept by h·r×(I⁻¹τ) in each step. Piles stay as they are (docs/decisions/0020).
    if (is_of_pile(rigid)) {
      rigid.applyTorque(to_bullet(push.torque_n_m, scale_ * scale_));
    } else {
      turn_at_once(rigid, to_bullet(Vector3d(h * push.torque_n_m), scale_ * scale_), h);
    }
  }
  pushed_.swap(pushes_);
  pushes_.clear();
  if (any_light_ || anything_yields()) watch_rest(h);
  before_dynamics(h);
  world_->stepSimulation(static_cast<btScalar>(h), 0);  // no sub-steps: exactly one step of h
  after_dynamics(h);
  for (const Push& push : pushed_) {
    btRigidBody& rigid = *bodies_[push.body].rigid;
    rigid.setFlags(rigid.getFlags() | BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY);
  }
  for (MovingBody& each : moving_) {
    each.now = each.after(time_s_, h);
    each.rigid->setWorldTransform(pose_of(each.rigid->getUserIndex(), each.now));
  }
  time_s_ += h;
  step_s_ = h;
  for (const auto& proxy : proxies_) {
    if (proxy->released() || proxy->placed()) continue;
    proxy->after_step(h, [this, &proxy] { return contacts_of(proxy->body()); });
  }
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    if (!tools_[i]) continue;
    tools_[i]->after_step(h, [] { return 1U; });
    ProxyReadout borne = tools_[i]->state();
    borne.coupling_force_n += borne_[i].left_n;
    borne.contact_force_n -= borne_[i].left_n;
    proxies_[i]->bear(borne);
  }
  bear_tools(h);
}

void BulletWorld::bear_tools(double h) {
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    if (!tools_[i]) continue;
    Borne& borne = borne_[i];
    const ProxyReadout& now = tools_[i]->state();
    const double share = borne.steps > 0.0 ? -std::expm1(-h / kMean_s) : 1.0;
    borne.once_n += share * (now.contact_force_n - borne.once_n);
    borne.once_m += share * (now.position_m - borne.once_m);
    borne.mean_n += share * (borne.once_n - borne.mean_n);
    borne.mean_m += share * (borne.once_m - borne.mean_m);
    if (now.contact_force_n.isZero(0.0) && borne.mean_n.norm() < kNothing_n) borne.mean_n.setZero();
    borne.left_s = now.contact_force_n.isZero(0.0) ? borne.left_s + h : 0.0;
    borne.steps += 1.0;
    borne.time_s += h;
  }
}

ProxyReadout BulletWorld::proxy(std::size_t index) const { return proxies_.at(index)->state(); }

BodyPose BulletWorld::body_pose(std::size_t index) const {
  const SceneBody& body = bodies_.at(index);
  const btTransform& pose = body.rigid->getWorldTransform();
  const Eigen::Quaterniond q_WB = from_bullet(pose.getRotation());
  return {from_bullet(pose.getOrigin(), scale_) - q_WB * body.made->centre_m, q_WB};
}

std::size_t BulletWorld::awake_bodies() const noexcept {
  return static_cast<std::size_t>(std::count_if(bodies_.begin(), bodies_.end(), [](const SceneBody& body) {
    return !body.rigid->isStaticOrKinematicObject() && body.rigid->isActive();
  }));
}

std::size_t BulletWorld::solved_contacts() const noexcept {
  std::size_t points = 0;
  for (int i = 0; i < dispatcher_.getNumManifolds(); ++i) {
    const btPersistentManifold& manifold = *dispatcher_.getManifoldByIndexInternal(i);
    const auto is_solved = [](const btCollisionObject* body) {
      return !body->isStaticOrKinematicObject() && body->isActive();
    };
    if (is_solved(manifold.getBody0()) || is_solved(manifold.getBody1())) {
      points += static_cast<std::size_t>(manifold.getNumContacts());
    }
  }
  return points;
}

std::uint32_t BulletWorld::contacts_of(const btRigidBody& body) {
  std::uint32_t touching = 0;  // bodies, as the other engines count
  for (int i = 0; i < dispatcher_.getNumManifolds(); ++i) {
    const btPersistentManifold* const manifold = dispatcher_.getInternalManifoldPointer()[i];
    if (manifold->getBody0() != &body && manifold->getBody1() != &body) continue;
    bool pushes = false;
    for (int point = 0; point < manifold->getNumContacts(); ++point) {
      pushes = pushes || manifold->getContactPoint(point).getAppliedImpulse() > 0;
    }
    if (pushes) ++touching;
  }
  return std::max(touching, 1U);  // asked only when something did push
}

std::vector<std::string> BulletWorld::warnings(double longest_step_s) const {
  std::vector<std::string> out;
  const bool moves = std::any_of(bodies_.begin(), bodies_.end(),
                                 [](const SceneBody& body) { return !body.rigid->isStaticOrKinematicObject(); });
  if (!moves || gravity_m_s2_ <= 0.0) return out;
  const double resting_s = kRestingStep * std::sqrt(smallest_m_ / gravity_m_s2_);
  if (longest_step_s > resting_s * (1.0 + 1e-9)) {
    out.push_back(scene_file_ + ": a step of " + three_digits(longest_step_s * 1e3) + " ms is longer than " +
                  three_digits(resting_s * 1e3) + " ms, up to which a stack of ten bodies of " +
                  three_digits(smallest_m_ * 1e3) +
                  " mm rests; raise physics.rate_hz or physics.substeps (20 solver_iterations allow twice the step)");
  }
  return out;
}

}  // namespace physics::bullet
