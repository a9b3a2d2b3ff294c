#include "physics_node/bullet/soft/soft_world.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <BulletSoftBody/btSoftBodyInternals.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>

namespace physics::bullet {
namespace {

using Eigen::Vector3d;
namespace config = rtbus::config;

/// Soft bodies meet each other in Bullet, everything else through collide().
constexpr int kSoftGroup = 8;

/// A ball smaller than this share of the edges falls between the nodes.
constexpr double kSmallestTool = 0.6;

std::string millimetres(double length_m) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g mm", length_m * 1e3);
  return text;
}

}  // namespace

SoftWorld::SoftWorld(const config::Scene& scene, const EngineSettings& settings)
    : BulletWorld(scene, settings, std::make_unique<btSoftBodyRigidBodyCollisionConfiguration>(),
                  [](btDispatcher* dispatcher, btBroadphaseInterface* broadphase, btConstraintSolver* solver,
                     btCollisionConfiguration* configuration) -> std::unique_ptr<btDiscreteDynamicsWorld> {
                    return std::make_unique<SoftDynamics>(dispatcher, broadphase, solver, configuration);
                  }),
      soft_dynamics_(static_cast<SoftDynamics&>(dynamics())) {
  btSoftBodyWorldInfo& info = soft_dynamics_.getWorldInfo();
  info.m_gravity = to_bullet(scene.gravity_m_s2, scale());  // of its own, beside the world's
  info.air_density = 0;
  for (const config::SoftBody& body : scene.soft_bodies) {
    auto made = std::make_unique<MadeSoftBody>(body, info, scale());
    soft_dynamics_.addSoftBody(&made->soft(), kSoftGroup, kSoftGroup);
    for (int i = 0; i < made->soft().m_nodes.size(); ++i) nodes_.push_back(&made->soft().m_nodes[i]);
    bodies_.push_back(std::move(made));
  }
  soft_dynamics_.collide = [this] { collide(); };
  soft_dynamics_.moved = [this] { note_velocities(); };
}

SoftWorld::~SoftWorld() {
  for (const auto& body : bodies_) soft_dynamics_.removeSoftBody(&body->soft());
}

void SoftWorld::before_dynamics(double h) {
  h_ = h;
  for (const auto& body : bodies_) body->before_step(h);
  for (std::size_t i = 0; i < touched_.size(); ++i) {
    if (!tools()[i] || borne(i).left_n.isZero(0.0)) continue;
    for (const Touched::Node& each : touched_[i].nodes)
      each.node->m_f += to_bullet(each.share * borne(i).left_n, scale());
  }
}

/// Not where the tool has touched a light body after the nodes.
bool SoftWorld::touched_last(std::size_t tool) const {
  return tool < touched_.size() && !touched_[tool].nodes.empty() &&
         touched_[tool].since_s <= borne(tool).left_s + 0.5 * h_;
}

/// The deeper a node is in the tool, the more of its force it bears.
void SoftWorld::note_touched(std::size_t tool) {
  Touched& touched = touched_[tool];
  const auto contacts = [&](std::size_t body) -> auto& { return bodies_[body]->soft().m_rcontacts; };
  bool any = false;
  for (std::size_t b = 0; b < bodies_.size(); ++b) any = any || contacts(b).size() > contacts_before_[b];
  touched.since_s = any ? 0.0 : touched.since_s + h_;
  if (!any) return;
  touched.nodes.clear();
  double sum = 0.0;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    for (int i = contacts_before_[b]; i < contacts(b).size(); ++i) {
      const btSoftBody::RContact& contact = contacts(b)[i];
      const btScalar gap = contact.m_cti.m_offset + contact.m_node->m_x.dot(contact.m_cti.m_normal);
      touched.nodes.push_back({contact.m_node, std::max(0.0, -static_cast<double>(gap))});
      sum += touched.nodes.back().share;
    }
  }
  const double evenly = 1.0 / static_cast<double>(touched.nodes.size());
  for (Touched::Node& each : touched.nodes) each.share = sum > 0.0 ? each.share / sum : evenly;
}

void SoftWorld::collide() {
  for (const auto& made : bodies_) {
    for (const SceneBody& body : scene_bodies()) collide_with_body(made->soft(), body, made->body().contact_hardness);
    for (const auto& proxy : proxies()) {
      if (!proxy->released() && !proxy->placed())
        collide_with_proxy(made->soft(), *proxy, made->body().contact_hardness, false);
    }
  }
  touched_.resize(tools().size());
  contacts_before_.resize(bodies_.size());
  for (std::size_t i = 0; i < tools().size(); ++i) {
    if (!tools()[i]) continue;
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      MadeSoftBody& made = *bodies_[b];
      contacts_before_[b] = made.soft().m_rcontacts.size();
      collide_with_proxy(made.soft(), *tools()[i], made.body().contact_hardness, true);
    }
    note_touched(i);
  }
}

void SoftWorld::collide_with_body(btSoftBody& soft, const SceneBody& body, double hardness) {
  btRigidBody& rigid = *body.rigid;
  const btTransform& pose = rigid.getWorldTransform();
  const btScalar margin = soft.getCollisionShape()->getMargin();
  if (rigid.getCollisionShape()->getShapeType() == STATIC_PLANE_PROXYTYPE) {
    const btVector3 up = pose.getBasis().getColumn(1);
    const btScalar height = up.dot(pose.getOrigin()) + margin;
    const Vector3d normal = from_bullet(up);
    for (int i = 0; i < soft.m_nodes.size(); ++i) {
      const btScalar gap = up.dot(soft.m_nodes[i].m_x) - height;
      if (gap < 0) add_contact(soft, soft.m_nodes[i], rigid, normal, static_cast<double>(gap), hardness);
    }
    return;
  }
  btVector3 low, high;
  rigid.getAabb(low, high);
  if (!TestAabbAgainstAabb2(low, high, soft.m_bounds[0], soft.m_bounds[1])) return;
  const btVector3 grown(margin, margin, margin);
  for (int i = 0; i < soft.m_nodes.size(); ++i) {
    btSoftBody::Node& node = soft.m_nodes[i];
    if (!TestPointAgainstAabb2(low - grown, high + grown, node.m_x)) continue;
    near_.clear();
    nearest_points(*body.made, pose, from_bullet(node.m_x), static_cast<double>(margin), 0.0, near_);
    for (const NearPoint& each : near_) add_contact(soft, node, rigid, each.normal, each.gap, hardness);
  }
}

/// Against where the proxy comes to in this step: what it would pass through is found on its way. Of a penetration a
/// node gets m_tool/(m_tool + m_node). With the massless tool `hardness` makes up for that: it presses as deep as a
/// heavy one. A node that is held gets nothing either way.
void SoftWorld::collide_with_proxy(btSoftBody& soft, BulletProxy& proxy, double hardness, bool massless) {
  btRigidBody& rigid = proxy.body();
  const btVector3 centre =
      rigid.getWorldTransform().getOrigin() + rigid.getLinearVelocity() * static_cast<btScalar>(h_);
  const btScalar reach = static_cast<btScalar>(proxy.radius()) + soft.getCollisionShape()->getMargin();
  const btVector3 grown(reach, reach, reach);
  if (!TestAabbAgainstAabb2(centre - grown, centre + grown, soft.m_bounds[0], soft.m_bounds[1])) return;
  for (int i = 0; i < soft.m_nodes.size(); ++i) {
    btSoftBody::Node& node = soft.m_nodes[i];
    const btVector3 offset = node.m_x - centre;
    const btScalar distance2 = offset.length2();
    if (distance2 >= reach * reach) continue;
    const btScalar distance = btSqrt(distance2);
    const btVector3 normal = distance > reach * btScalar(1e-6) ? offset / distance : node.m_n * btScalar(-1);
    const bool gives_way = massless && node.m_im > 0;
    const double heavier = gives_way ? static_cast<double>(rigid.getInvMass() / node.m_im) : 0.0;
    add_contact(soft, node, rigid, from_bullet(normal), static_cast<double>(distance - reach),
                std::min(1.0, hardness * (1.0 + heavier)));
  }
}

/// A contact for Bullet's solver of soft bodies. In each iteration it takes away the approach of this step and
/// `hardness` of the penetration, and of the sliding what Coulomb's friction may: all of it, or as much as the approach
/// presses.
void SoftWorld::add_contact(btSoftBody& soft, btSoftBody::Node& node, btRigidBody& rigid, const Vector3d& normal,
                            double gap, double hardness) {
  const btScalar node_inverse = node.m_im, rigid_inverse = rigid.getInvMass();
  if (node_inverse + rigid_inverse <= 0) return;
  btSoftBody::RContact contact{};
  contact.t1 = contact.t2 = btVector3(0, 0, 0);  // only of multibodies, but copied with the rest
  contact.m_cti.m_colObj = &rigid;
  contact.m_cti.m_normal = to_bullet(normal);
  contact.m_cti.m_offset = static_cast<btScalar>(gap) - node.m_x.dot(contact.m_cti.m_normal);
  contact.m_node = &node;
  const btVector3 arm = node.m_x - rigid.getWorldTransform().getOrigin();
  const auto h = static_cast<btScalar>(h_);
  contact.m_c0 = ImpulseMatrix(h, node_inverse, rigid_inverse, rigid.getInvInertiaTensorWorld(), arm);
  contact.m_c1 = arm;
  contact.m_c2 = node_inverse * h;
  const btVector3 relative = (node.m_x - node.m_q) - rigid.getVelocityInLocalPoint(arm) * h;
  const btScalar approach = relative.dot(contact.m_cti.m_normal);
  const btScalar sliding = (relative - contact.m_cti.m_normal * approach).length();
  const btScalar held = soft.m_cfg.kDF * rigid.getFriction() * btMax(-approach, btScalar(0));
  contact.m_c3 = sliding <= held ? 0 : 1 - held / sliding;
  contact.m_c4 = static_cast<btScalar>(hardness);
  soft.m_rcontacts.push_back(contact);
  if (!rigid.isStaticOrKinematicObject()) rigid.activate();
}

void SoftWorld::note_velocities() {
  velocities_.clear();
  for (const auto* const group : {&proxies(), &tools()}) {
    for (const auto& each : *group) velocities_.push_back(each ? each->body().getLinearVelocity() : btVector3(0, 0, 0));
  }
}

void SoftWorld::after_dynamics(double h) {
  for (std::size_t i = 0; i < velocities_.size(); ++i) {
    const bool is_tool = i >= proxies().size();
    const auto& each = is_tool ? tools()[i - proxies().size()] : proxies()[i];
    if (!each) continue;
    btRigidBody& rigid = each->body();
    const btVector3 change = rigid.getLinearVelocity() - velocities_[i];
    if (change.isZero()) continue;
    btTransform pose = rigid.getWorldTransform();
    pose.setOrigin(pose.getOrigin() + change * static_cast<btScalar>(h));
    rigid.setWorldTransform(pose);
    rigid.setInterpolationWorldTransform(pose);
    rigid.setInterpolationLinearVelocity(rigid.getLinearVelocity());
  }
  for (const auto& body : bodies_) {
    if (body->sound()) continue;
    body->put_back();
    ++recoveries_;
  }
}

Vector3d SoftWorld::soft_node(std::size_t node) const { return from_bullet(nodes_.at(node)->m_x, scale()); }

std::size_t SoftWorld::solved_contacts() const noexcept {
  std::size_t points = BulletWorld::solved_contacts();
  for (const auto& body : bodies_) points += static_cast<std::size_t>(body->soft().m_rcontacts.size());
  return points;
}

std::vector<std::string> SoftWorld::warnings(double longest_step_s) const {
  std::vector<std::string> out = BulletWorld::warnings(longest_step_s);
  for (const auto& made : bodies_) {
    const std::string where = scene_file() + ": soft body " + made->body().name + ": ";
    if (const std::string complaint = made->complaint(longest_step_s); !complaint.empty())
      out.push_back(where + complaint);
    for (const auto& proxy : proxies()) {
      const double radius_m = proxy->radius() / scale();
      if (radius_m + made->body().margin_m >= kSmallestTool * made->mean_edge_m()) continue;
      out.push_back(where + "a tool of " + millimetres(radius_m) + " falls between nodes that are " +
                    millimetres(made->mean_edge_m()) + " apart; raise proxy.radius_m, or take more nodes");
    }
  }
  return out;
}

}  // namespace physics::bullet
