/// What SoftWorld tells about a tool that somebody else moves: what is near to it, what it bears and will bear.
#include <algorithm>
#include <cmath>
#include <limits>

#include "physics_node/bullet/soft/soft_world.hpp"

namespace physics::bullet {
namespace {

using Eigen::Vector3d;

/// A body takes part in what is looked ahead when the tool comes so near.
constexpr double kMargin_m = 2e-3;
/// Stiffness is measured with a tool that is so much aside, over so long at least.
constexpr double kAside_m = 0.2e-3, kShortestProbe_s = 16e-3;
/// Below that answers come so fast that nothing has to be looked ahead for.
constexpr double kAtOnce_s = 8e-3;
/// Means are taken over so much of a course before and after an instant: bodies swing with periods of some 50 ms.
constexpr double kWindow = 0.25;
constexpr double kSoftest_n_per_m = 1.0, kStiffest_n_per_m = 1e4;

}  // namespace

SoftWorld::NearNode SoftWorld::nearest_node(const MadeSoftBody& made, const Vector3d& tool_m, double radius) const {
  NearNode out;
  const btSoftBody& soft = made.soft();
  const btVector3 centre = to_bullet(tool_m, scale());
  btScalar nearest2 = std::numeric_limits<btScalar>::infinity();
  for (int i = 0; i < soft.m_nodes.size(); ++i) {
    const btScalar distance2 = (centre - soft.m_nodes[i].m_x).length2();
    if (distance2 < nearest2) nearest2 = distance2, out.node = &soft.m_nodes[i];
  }
  const double distance = std::sqrt(static_cast<double>(nearest2));
  const double reach = radius + static_cast<double>(soft.getCollisionShape()->getMargin());
  const Vector3d way = from_bullet(centre - out.node->m_x);
  out.normal = distance > 1e-6 * reach ? Vector3d(way / distance) : from_bullet(out.node->m_n);
  out.gap_m = (distance - reach) / scale();
  return out;
}

/// Of all bodies.
ToolReaction::Instant SoftWorld::instant_at(double after_s, const Vector3d& tool_m, const Vector3d& reaction_n,
                                            double radius, const std::vector<const MadeSoftBody*>& bodies) const {
  ToolReaction::Instant out;
  out.after_s = after_s;
  out.tool_m = tool_m;
  out.reaction_n = reaction_n;
  out.gap_m = std::numeric_limits<double>::infinity();
  for (const MadeSoftBody* body : bodies) {
    const NearNode near = nearest_node(*body, tool_m, radius);
    if (near.gap_m >= out.gap_m) continue;
    out.gap_m = near.gap_m;
    out.normal = near.normal;
  }
  out.gap_m = reaction_n.isZero(0.0) ? std::max(0.0, out.gap_m) : 0.0;
  return out;
}

void SoftWorld::tool_reaction(std::size_t proxy, double radius_m, double ahead_s, const Vector3d& velocity_m_s,
                              ToolReaction& out) {
  out = ToolReaction{};
  if (proxy >= tools().size() || !tools()[proxy]) return;
  const BulletProxy& tool = *tools()[proxy];
  const Borne& bears = borne(proxy);
  if (seen_.size() <= proxy) seen_.resize(proxy + 1);
  Seen& seen = seen_[proxy];
  if (bears.steps < seen.measured) seen.measured = 0.0;  // another tool
  const Vector3d tool_m = tool.state().position_m;
  std::vector<const MadeSoftBody*> all, near;
  double friction = 0.0, nearest_m = std::numeric_limits<double>::infinity();
  for (const auto& made : bodies_) {
    const double gap_m = nearest_node(*made, tool_m, tool.radius()).gap_m;
    all.push_back(made.get());
    if (gap_m <= velocity_m_s.norm() * ahead_s + kMargin_m) near.push_back(made.get());
    if (gap_m < nearest_m) nearest_m = gap_m, friction = made->body().friction;
  }
  if (!(nearest_m <= radius_m)) return BulletWorld::tool_reaction(proxy, radius_m, ahead_s, velocity_m_s, out);
  out.instants[0] = instant_at(0.0, bears.mean_m, bears.mean_n, tool.radius(), all);
  out.count = 1;
  out.rest = rest();
  out.friction = friction * static_cast<double>(tool.body().getFriction());
  if (!near.empty()) look_ahead(tool, ahead_s, velocity_m_s, near, bears.steps, seen, out);
  const double guess_n_per_m = tool.target().stiffness_n_per_m;
  out.stiffness_n_per_m = seen.along_n_per_m > 0.0 ? seen.along_n_per_m : guess_n_per_m;
  out.stiffness_across_n_per_m = seen.across_n_per_m > 0.0 ? seen.across_n_per_m : 0.5 * out.stiffness_n_per_m;
}

/// One course ahead as the tool goes, and, as often as the steps of the world allow it, one beside it: by how much less
/// it bears there is the stiffness.
void SoftWorld::look_ahead(const BulletProxy& tool, double ahead_s, const Vector3d& velocity_m_s,
                           const std::vector<const MadeSoftBody*>& near, double steps_done, Seen& seen,
                           ToolReaction& out) {
  const double course_s = std::max(ahead_s, kShortestProbe_s);
  const int steps = static_cast<int>(std::ceil(1.25 * course_s / h_));
  const double cost = static_cast<double>(steps) * static_cast<double>(near.size());
  const bool measures = steps_done - seen.measured >= cost || seen.along_n_per_m <= 0.0;
  if (!measures && ahead_s < kAtOnce_s) return;
  if (measures) seen.measured = steps_done;
  if (!seen.plain) {
    btSoftBodyWorldInfo& info = soft_dynamics_.getWorldInfo();
    for (auto* course : {&seen.plain, &seen.aside}) {
      *course = std::make_unique<ToolAhead>(info, tool.radius() / scale(),
                                            static_cast<double>(tool.body().getFriction()), scale());
    }
  }
  const Course plain = run_course(*seen.plain, tool, near, steps, course_s, velocity_m_s, Vector3d::Zero());
  if (ahead_s >= kAtOnce_s) {
    for (const ToolReaction::Instant& each : plain.instants) out.instants[out.count++] = each;
  }
  if (!measures) return;
  const Vector3d& borne_n = plain.instants.back().reaction_n;
  const Vector3d along = borne_n.isZero(0.0) ? out.instants[0].normal : Vector3d(borne_n.normalized());
  Vector3d across = velocity_m_s - along * along.dot(velocity_m_s);
  across = across.norm() > 1e-3 ? Vector3d(across.normalized()) : Vector3d(along.unitOrthogonal());
  const bool measures_across = seen.along_n_per_m > 0.0 && seen.turn++ % 2 == 1;
  const Vector3d aside = measures_across ? across : Vector3d(-along);
  const Course beside = run_course(*seen.aside, tool, near, steps, course_s, velocity_m_s, kAside_m * aside);
  double less_n = 0.0, aside_m = 0.0;
  for (std::size_t i = 0; i < plain.instants.size(); ++i) {
    less_n -= (beside.instants[i].reaction_n - plain.instants[i].reaction_n).dot(aside);
    aside_m += (beside.instants[i].tool_m - plain.instants[i].tool_m).dot(aside);
  }
  double stiffness = less_n / std::max(aside_m, 0.1 * kAside_m);
  if (!std::isfinite(stiffness) || borne_n.isZero(0.0)) return;
  stiffness = std::clamp(stiffness, kSoftest_n_per_m, kStiffest_n_per_m);
  double& told = measures_across ? seen.across_n_per_m : seen.along_n_per_m;
  told = told > 0.0 ? told + 0.3 * (stiffness - told) : stiffness;
}

SoftWorld::Course SoftWorld::run_course(ToolAhead& course, const BulletProxy& tool,
                                        const std::vector<const MadeSoftBody*>& near, int steps, double course_s,
                                        const Vector3d& velocity_m_s, const Vector3d& aside_m) {
  const Vector3d from_m = tool.state().position_m;
  course.start(near, from_m, velocity_m_s);
  const auto collide = [this](MadeSoftBody& copy, BulletProxy& held) {
    collide_with_fixed(copy);
    collide_with_proxy(copy.soft(), held, copy.body().contact_hardness, true);
  };
  const std::vector<const MadeSoftBody*> copies(course.bodies().begin(), course.bodies().end());
  Course out;
  const auto middle_s = [&](std::size_t i) { return 0.5 * static_cast<double>(i + 1) * course_s; };
  std::size_t window = 0;
  Vector3d force_n = Vector3d::Zero(), place_m = Vector3d::Zero();
  double time_s = 0.0;
  int count = 0;
  for (int i = 1; i <= steps && window < out.instants.size(); ++i) {
    const double now_s = i * h_;
    const double aside = std::min(1.0, now_s / (0.25 * course_s));
    ProxyTarget target = tool.target();
    target.position_m += now_s * velocity_m_s + aside * aside_m;
    target.velocity_m_s = velocity_m_s;
    course.step(h_, target, collide);
    if (now_s < middle_s(window) - kWindow * course_s) continue;
    force_n += course.tool().contact_force_n;
    place_m += course.tool().position_m;
    time_s += now_s;
    ++count;
    if (now_s + h_ <= middle_s(window) + kWindow * course_s && i < steps) continue;
    force_n /= count, place_m /= count, time_s /= count;
    out.instants[window++] = instant_at(time_s, place_m, force_n, tool.radius(), copies);
    force_n.setZero(), place_m.setZero();
    time_s = 0.0, count = 0;
  }
  return out;
}

/// As collide(), for a copy: against what no force moves.
void SoftWorld::collide_with_fixed(MadeSoftBody& copy) {
  for (const SceneBody& body : scene_bodies()) {
    if (body.rigid->isStaticOrKinematicObject()) collide_with_body(copy.soft(), body, copy.body().contact_hardness);
  }
}

void SoftWorld::add_more_contacts(std::size_t index, double radius_m, ContactSet& out) const {
  const BulletProxy& proxy = *proxies()[index];
  if (proxy.released()) return;
  const Vector3d at_m = from_bullet(proxy.body().getWorldTransform().getOrigin(), scale());
  for (std::size_t s = 0; s < bodies_.size(); ++s) {
    const MadeSoftBody& made = *bodies_[s];
    const NearNode near = nearest_node(made, at_m, proxy.radius());
    if (!(near.gap_m <= radius_m)) continue;
    if (out.contacts.size() == kMaxContacts) {
      ++out.contacts_overflow;
      continue;
    }
    BodyBehind behind;
    behind.body = static_cast<std::uint32_t>(scene_bodies().size() + s);
    behind.kind = BodyKind::kSoft;
    behind.centre_m = from_bullet(near.node->m_x, scale());
    behind.inverse_mass_per_kg = static_cast<double>(near.node->m_im);
    Contact contact;
    contact.row = static_cast<std::uint32_t>(out.bodies.size());
    contact.point_m = behind.centre_m + near.normal * made.body().margin_m;
    contact.normal = near.normal;
    contact.gap_m = near.gap_m;
    contact.friction = made.body().friction * static_cast<double>(proxy.body().getFriction());
    contact.inverse_mass_per_kg = behind.inverse_mass_per_kg * Eigen::Matrix3d::Identity();
    out.bodies.push_back(behind);
    out.contacts.push_back(contact);
  }
}

}  // namespace physics::bullet
