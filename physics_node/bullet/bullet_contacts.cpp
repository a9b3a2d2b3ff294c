/// What BulletWorld says about the surroundings of a proxy. Reads positions, velocities and the impulses that the
/// solver left in the manifolds; runs no collision query of Bullet's and changes nothing.
#include <algorithm>
#include <cmath>
#include <vector>

#include "physics_node/bullet/bullet_world.hpp"
#include "physics_node/bullet/nearest.hpp"

namespace physics::bullet {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// What holds others and goes more slowly slips, and stands by the time that it is told.
constexpr double kSlip_m_s = 5e-3;

/// Velocity of a body's material at `point_m` of W.
Vector3d velocity_at(const btRigidBody& body, const Vector3d& point_m, double scale) {
  const Vector3d r_m = point_m - from_bullet(body.getWorldTransform().getOrigin(), scale);
  return from_bullet(body.getLinearVelocity(), scale) + from_bullet(body.getAngularVelocity()).cross(r_m);
}

/// Whether a face looks along `normal`.
bool has_face(const btRigidBody& body, const Vector3d& normal) {
  constexpr double kFlat_rad = 2e-3;
  const int shape = body.getCollisionShape()->getShapeType();
  if (shape == STATIC_PLANE_PROXYTYPE) return true;
  if (shape != BOX_SHAPE_PROXYTYPE && shape != CYLINDER_SHAPE_PROXYTYPE) return false;
  btVector3 own = (body.getWorldTransform().getBasis().transpose() * to_bullet(normal)).absolute();
  own[shape == BOX_SHAPE_PROXYTYPE ? own.maxAxis() : 1] = 0;  // a cylinder's axis is y
  return static_cast<double>(own.length()) < kFlat_rad;
}

/// Of one contact point: what the second body of the manifold did to the first, mean over the step.
struct PointForce {
  Vector3d point_m, normal;
  double normal_n;
  Vector3d friction_n;
};
PointForce force_at(const btManifoldPoint& point, double h, double scale) {
  PointForce out;
  out.point_m =
      0.5 * (from_bullet(point.getPositionWorldOnA(), scale) + from_bullet(point.getPositionWorldOnB(), scale));
  out.normal = from_bullet(point.m_normalWorldOnB);
  // Bullet's impulses are mass · units/s.
  out.normal_n = static_cast<double>(point.m_appliedImpulse) / (h * scale);
  out.friction_n = from_bullet(point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 +
                               point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2) /
                   (h * scale);
  return out;
}

}  // namespace

double BulletWorld::pair_friction(const btRigidBody& a, const btRigidBody& b) {
  return static_cast<double>(a.getFriction() * b.getFriction());
}

void BulletWorld::find_contacts(const btRigidBody& proxy, double radius, double radius_m, bool light,
                                FoundContacts& out) const {
  const Vector3d centre = from_bullet(proxy.getWorldTransform().getOrigin());
  const double max_gap = radius_m * scale_;
  std::vector<NearPoint> near;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (bodies_[i].light != light) continue;
    const btRigidBody& rigid = *bodies_[i].rigid;
    const double far = bodies_[i].reach + radius + max_gap;
    if ((from_bullet(rigid.getWorldTransform().getOrigin()) - centre).squaredNorm() > far * far) continue;
    near.clear();
    nearest_points(*bodies_[i].made, rigid.getWorldTransform(), centre, radius, max_gap, near);
    for (const NearPoint& each : near) {
      Contact contact;
      contact.point_m = each.point / scale_;
      contact.normal = each.normal;
      contact.gap_m = each.gap / scale_;
      contact.surface_velocity_m_s = velocity_at(rigid, contact.point_m, scale_);
      contact.friction = pair_friction(rigid, proxy);
      if (bodies_[i].made->shape->getShapeType() == SPHERE_SHAPE_PROXYTYPE) {
        contact.curvature_per_m =
            scale_ / static_cast<double>(static_cast<const btSphereShape&>(*bodies_[i].made->shape).getRadius());
      }
      contact.row = static_cast<std::uint32_t>(i);
      out.push_back(contact);
    }
  }
}

/// In W, about the centre of mass. Inertia grows with the square of the scale.
Eigen::Matrix3d BulletWorld::inverse_inertia_of(const btRigidBody& body) const {
  const btMatrix3x3& inverse = body.getInvInertiaTensorWorld();
  Eigen::Matrix3d out;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      out(row, column) = static_cast<double>(inverse[row][column]) * scale_ * scale_;
    }
  }
  return out;
}

void BulletWorld::describe_bodies(const BulletProxy& proxy, ContactSet& out) const {
  const Companions companions = add_companions(out);
  for (std::size_t row = 0; row < out.bodies.size(); ++row) {
    BodyBehind& behind = out.bodies[row];
    const btRigidBody& rigid = *bodies_[behind.body].rigid;
    behind.centre_m = from_bullet(rigid.getWorldTransform().getOrigin(), scale_);
    behind.velocity_m_s = from_bullet(rigid.getLinearVelocity(), scale_);
    behind.angular_velocity_rad_s = from_bullet(rigid.getAngularVelocity());
    behind.kind = rigid.isKinematicObject() ? BodyKind::kKinematic
                  : rigid.isStaticObject()  ? BodyKind::kStatic
                                            : BodyKind::kDynamic;
    if (behind.kind != BodyKind::kDynamic) continue;
    behind.inverse_mass_per_kg = static_cast<double>(rigid.getInvMass());
    behind.inverse_inertia_per_kg_m2 = inverse_inertia_of(rigid);
    // getGravity() is an acceleration.
    if (rigid.isActive())
      behind.external_force_n = from_bullet(rigid.getGravity(), scale_) / behind.inverse_mass_per_kg;
    if (companions.carries[row]) add_carried(*companions.carried, behind);
  }
  for (Contact& contact : out.contacts) {
    const BodyBehind& behind = out.bodies[contact.row];
    contact.inverse_mass_per_kg = inverse_mass_at(behind.inverse_mass_per_kg, behind.inverse_inertia_per_kg_m2,
                                                  contact.point_m - behind.centre_m);
  }

  for (const btPersistentManifold* const manifold : all_manifolds()) {
    for (std::uint32_t row = 0; row < out.bodies.size(); ++row) {
      if (out.bodies[row].kind != BodyKind::kDynamic) continue;
      const btRigidBody* const held = bodies_[out.bodies[row].body].rigid.get();
      if (manifold->getBody0() == held) add_held_by(proxy, *manifold, true, row, companions, out);
      if (manifold->getBody1() == held) add_held_by(proxy, *manifold, false, row, companions, out);
    }
  }
  add_near_supports(companions.groups, out);
  // Where there are too many, those of the body that is nearest matter most.
  std::stable_sort(out.supports.begin(), out.supports.end(),
                   [](const Support& a, const Support& b) { return a.row < b.row; });
  if (out.supports.size() > kMaxSupports) {
    out.supports_overflow = static_cast<std::uint32_t>(out.supports.size() - kMaxSupports);
    out.supports.resize(kMaxSupports);
  }
  for (const Push& push : pushed_) {
    if (proxies_[push.proxy].get() != &proxy) continue;  // the hands tell each other
    for (BodyBehind& behind : out.bodies) {
      if (behind.body == push.body && behind.kind == BodyKind::kDynamic) behind.proxy_force_n += push.force_n;
    }
  }
  for (BodyBehind& behind : out.bodies) {
    const btRigidBody& rigid = *bodies_[behind.body].rigid;
    if (behind.kind != BodyKind::kDynamic || rigid.isActive() || behind.friction_bound_n > 0.0) continue;
    const auto own = static_cast<double>(rigid.getFriction());
    behind.friction_bound_n = own * own * gravity_m_s2_ / behind.inverse_mass_per_kg;
  }
}

/// All of them as one rigid body, about their common centre of mass.
void BulletWorld::add_carried(const CarriedBodies& carried, BodyBehind& behind) const {
  std::vector<const btRigidBody*> all = carried.carried_by(*bodies_[behind.body].rigid);
  if (all.empty()) return;
  all.push_back(bodies_[behind.body].rigid.get());
  const auto centre_m = [this](const btRigidBody* each) {
    return from_bullet(each->getWorldTransform().getOrigin(), scale_);
  };
  const Vector3d own_m = behind.centre_m;
  double sum_kg = 0.0;
  Vector3d moment_kg_m = Vector3d::Zero();
  for (const btRigidBody* const each : all) {
    sum_kg += mass_kg(*each);
    moment_kg_m += mass_kg(*each) * (centre_m(each) - own_m);
  }
  behind.centre_m += moment_kg_m / sum_kg;
  behind.own_from_centre_m = own_m - behind.centre_m;
  behind.velocity_m_s -= behind.angular_velocity_rad_s.cross(behind.own_from_centre_m);
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Zero();
  for (const btRigidBody* const each : all) {
    const Vector3d from_m = centre_m(each) - behind.centre_m;
    inertia_kg_m2 += inverse_inertia_of(*each).inverse();
    inertia_kg_m2 +=
        mass_kg(*each) * (from_m.squaredNorm() * Eigen::Matrix3d::Identity() - from_m * from_m.transpose());
  }
  behind.external_force_n *= sum_kg * behind.inverse_mass_per_kg;
  behind.inverse_mass_per_kg = 1.0 / sum_kg;
  behind.inverse_inertia_per_kg_m2 = inertia_kg_m2.inverse();
}

void BulletWorld::add_held_by(const BulletProxy& proxy, const btPersistentManifold& manifold, bool first,
                              std::uint32_t row, const Companions& companions, ContactSet& out) const {
  BodyBehind& behind = out.bodies[row];
  const auto& held = *static_cast<const btRigidBody*>(first ? manifold.getBody0() : manifold.getBody1());
  const auto& other = *static_cast<const btRigidBody*>(first ? manifold.getBody1() : manifold.getBody0());
  if (companions.carries[row] && other.getUserIndex() >= 0 && companions.carried->is_carried(other)) return;
  const bool together = companions.groups[row] > 0;
  const double sign = first ? 1.0 : -1.0;
  const bool awake = held.isActive();
  Support support;
  support.row = row;
  if (together && BulletSolver::joins_pile(manifold) && !other.isStaticOrKinematicObject()) {
    const auto body = static_cast<std::uint32_t>(other.getUserIndex());
    for (std::uint32_t i = 0; i < out.bodies.size(); ++i) {
      if (out.bodies[i].body == body) support.holder = i + 1;
    }
  }
  support.normal.setZero();
  Support touches = support;
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    const PointForce force = force_at(manifold.getContactPoint(i), step_s_, scale_);
    if (&other == &proxy.body()) {
      behind.proxy_force_n += sign * (force.normal_n * force.normal + force.friction_n);
      continue;
    }
    touches.point_m += force.point_m;
    touches.normal += sign * force.normal;
    ++touches.points;
    if (force.normal_n <= 0.0) continue;
    const Vector3d r_m = force.point_m - behind.centre_m;
    const Vector3d push_n = sign * force.normal_n * force.normal;
    if (awake) {
      behind.external_force_n += push_n;
      behind.external_torque_n_m += r_m.cross(push_n);
      behind.friction_force_n += sign * force.friction_n;
      behind.friction_torque_n_m += r_m.cross(Vector3d(sign * force.friction_n));
    }
    support.point_m += force.normal_n * force.point_m;
    support.normal += push_n;
    support.normal_force_n += force.normal_n;
    ++support.points;
  }
  if (support.normal_force_n > 0.0) {
    support.point_m /= support.normal_force_n;
  } else if (support.holder > 0 && touches.points > 0) {
    support = touches;
    support.point_m /= touches.points;
  }
  if (support.points == 0 || support.normal.norm() <= 0.0) return;
  support.normal.normalize();
  // A box of a pile loses some points of the manifold when it slides, at times all but one, and has them again some
  // steps later.
  if (has_face(held, support.normal) && has_face(other, support.normal)) support.points = std::max(support.points, 3U);
  support.friction = pair_friction(held, other);
  support.inverse_mass_per_kg = static_cast<double>(other.getInvMass());
  // One that lies on others rattles with them.
  const bool heavier = !together && support.inverse_mass_per_kg > 0.0 && companions.carried &&
                       !companions.carried->is_carried(other) &&
                       kMostMassRatio * support.inverse_mass_per_kg <= static_cast<double>(held.getInvMass());
  if (heavier) support.inverse_mass_per_kg = 0.0;  // it goes as it went, whatever this one does
  const auto goes_m_s = [&](const Vector3d& point_m) -> Vector3d {
    const Vector3d velocity_m_s = velocity_at(other, point_m, scale_);
    return heavier && velocity_m_s.norm() < kSlip_m_s ? Vector3d(Vector3d::Zero()) : velocity_m_s;
  };
  support.surface_velocity_m_s = goes_m_s(support.point_m);
  behind.friction_bound_n += support.friction * support.normal_force_n;
  if (support.holder > 0 && !first) return;  // once is enough
  if (support.points != 2 || (support.inverse_mass_per_kg > 0.0 && support.holder == 0)) {
    out.supports.push_back(support);
    return;
  }
  // An edge: in its middle alone the body would roll and spin about that. Of a pile supports are not felt one by one.
  const bool loaded = support.normal_force_n > 0.0;
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    const PointForce force = force_at(manifold.getContactPoint(i), step_s_, scale_);
    if (loaded && force.normal_n <= 0.0) continue;
    Support end = support;
    end.point_m = force.point_m;
    end.normal_force_n = force.normal_n;
    end.surface_velocity_m_s = goes_m_s(end.point_m);
    out.supports.push_back(end);
  }
}

void BulletWorld::contacts(std::size_t index, double radius_m, ContactSet& out) const {
  const BulletProxy& proxy = *proxies_.at(index);
  out.radius_m = radius_m;
  out.proxy_radius_m = proxy.radius() / scale_;
  out.proxy_mass_kg = proxy.mass_kg();
  FoundContacts found;
  if (!proxy.released()) {
    find_contacts(proxy.body(), proxy.radius(), radius_m, false, found);
    if (any_light_ && !tools_[index]) find_contacts(proxy.body(), proxy.radius(), radius_m, true, found);
  }
  keep_nearest(found, out);
  describe_bodies(proxy, out);
  add_more_contacts(index, radius_m, out);
}

/// Light bodies follow the tool as they can: where it is pressed into them they do so further on. How stiff they are is
/// seen between one answer and the next. That only bridges what the hand does meanwhile: the tool of this world is on
/// the same spring as the hand's proxy, so that each answer is right for a hand that rests, whatever stiffness is told.
void BulletWorld::tool_reaction(std::size_t index, double radius_m, double ahead_s, const Vector3d& /*velocity_m_s*/,
                                ToolReaction& out) {
  constexpr double kSofter = 0.5, kStiffer = 8.0, kLeastWay_m = 10e-6, kShare = 0.3;
  out = ToolReaction{};
  if (index >= tools_.size() || !tools_[index] || !any_light_) return;
  const BulletProxy& tool = *tools_[index];
  Borne& borne = borne_[index];
  FoundContacts found;
  find_contacts(tool.body(), tool.radius(), radius_m, true, found);
  if (found.empty() && borne.mean_n.isZero(0.0)) return;
  ToolReaction::Instant now;
  now.tool_m = borne.mean_m;
  now.reaction_n = borne.mean_n;
  if (!found.empty()) {
    const auto nearest = std::min_element(found.begin(), found.end(),
                                          [](const Contact& a, const Contact& b) { return a.gap_m < b.gap_m; });
    now.normal = nearest->normal;
    now.gap_m = now.reaction_n.isZero(0.0) ? std::max(0.0, nearest->gap_m) : 0.0;
    out.friction = nearest->friction;
  }
  out.instants[out.count++] = now;
  const double spring_n_per_m = tool.target().stiffness_n_per_m;
  if (borne.stiffness_n_per_m <= 0.0) borne.stiffness_n_per_m = spring_n_per_m;
  if (!now.reaction_n.isZero(0.0)) {
    const Vector3d along = now.reaction_n.normalized();
    const double way_m = along.dot(now.tool_m - borne.told_m);
    if (!borne.told_n.isZero(0.0) && std::abs(way_m) > kLeastWay_m) {
      const double seen = -along.dot(now.reaction_n - borne.told_n) / way_m;
      borne.stiffness_n_per_m +=
          kShare * (std::clamp(seen, kSofter * spring_n_per_m, kStiffer * spring_n_per_m) - borne.stiffness_n_per_m);
    }
    // As it went since it was told last: what is pushed out of the way goes on.
    const double told_s = borne.time_s - borne.told_s;
    const double into_m_s = borne.told_n.isZero(0.0) || told_s <= 0.0 ? 0.0 : std::min(0.0, way_m / told_s);
    ToolReaction::Instant then = now;
    then.after_s = ahead_s;
    then.tool_m += ahead_s * into_m_s * along;
    if (into_m_s < 0.0 && ahead_s > 0.0) out.instants[out.count++] = then;
  }
  borne.told_n = now.reaction_n;
  borne.told_m = now.tool_m;
  borne.told_s = borne.time_s;
  out.stiffness_n_per_m = borne.stiffness_n_per_m;
  out.rest = rest();
}

}  // namespace physics::bullet
