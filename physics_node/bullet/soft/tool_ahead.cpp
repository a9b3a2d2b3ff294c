#include "physics_node/bullet/soft/tool_ahead.hpp"

#include <algorithm>

namespace physics::bullet {
namespace {

using Eigen::Vector3d;

constexpr double kMass_kg = 1e-6;  ///< It has that of its spring alone.

ProxyParameters parameters_of(double friction) {
  ProxyParameters out;
  out.mass_kg = kMass_kg;
  out.friction = friction;
  return out;
}

void copy_state(const btSoftBody& from, btSoftBody& to) {
  for (int i = 0; i < from.m_nodes.size(); ++i) {
    const btSoftBody::Node& source = from.m_nodes[i];
    btSoftBody::Node& node = to.m_nodes[i];
    node.m_x = source.m_x;
    node.m_q = source.m_q;
    node.m_v = source.m_v;
    node.m_vn = source.m_vn;
    node.m_n = source.m_n;
    node.m_im = source.m_im;
    node.m_f = btVector3(0, 0, 0);
  }
  to.m_pose.m_com = from.m_pose.m_com;
  to.m_pose.m_rot = from.m_pose.m_rot;
  to.m_pose.m_scl = from.m_pose.m_scl;
  to.m_rcontacts.resizeNoInitialize(0);
  to.m_scontacts.resizeNoInitialize(0);
  to.updateBounds();
}

}  // namespace

ToolAhead::ToolAhead(btSoftBodyWorldInfo& info, double radius_m, double friction, double scale)
    : info_(info), scale_(scale), tool_(parameters_of(friction), radius_m, scale) {}

void ToolAhead::start(const std::vector<const MadeSoftBody*>& near, const Vector3d& tool_m,
                      const Vector3d& velocity_m_s) {
  running_.clear();
  for (const MadeSoftBody* body : near) {
    auto copy = std::find_if(copies_.begin(), copies_.end(), [body](const Copy& each) { return each.of == body; });
    if (copy == copies_.end()) {
      copies_.push_back({body, std::make_unique<MadeSoftBody>(body->body(), info_, scale_)});
      copy = copies_.end() - 1;
      // At its first step a body of Bullet's takes the distances of its nodes for the lengths of its links at rest.
      copy->body->soft().predictMotion(btScalar(1e-3));
    }
    copy_state(body->soft(), copy->body->soft());
    running_.push_back(copy->body.get());
  }
  tool_.put(tool_m, velocity_m_s);
}

void ToolAhead::step(double h, const ProxyTarget& target,
                     const std::function<void(MadeSoftBody&, BulletProxy&)>& collide) {
  tool_.set_target(target);
  tool_.before_step(h);
  for (MadeSoftBody* body : running_) {
    body->before_step(h);
    body->soft().predictMotion(static_cast<btScalar>(h));
    collide(*body, tool_);
  }
  for (MadeSoftBody* body : running_) body->soft().solveConstraints();
  for (MadeSoftBody* body : running_) body->soft().integrateMotion();
  btRigidBody& rigid = tool_.body();
  btTransform pose = rigid.getWorldTransform();
  pose.setOrigin(pose.getOrigin() + rigid.getLinearVelocity() * static_cast<btScalar>(h));
  rigid.setWorldTransform(pose);
  tool_.after_step(h, [] { return 1U; });
}

}  // namespace physics::bullet
