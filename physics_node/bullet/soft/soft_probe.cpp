#include "physics_node/bullet/soft/soft_probe.hpp"

#include <cmath>

namespace physics::bullet {
namespace {

using Eigen::Vector3d;

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

void SoftProbe::start(const MadeSoftBody& real, const SoftPatch& patch, const Vector3d& force_n) {
  copy_state(real.soft(), plain_.soft());
  copy_state(real.soft(), loaded_.soft());
  patch_ = patch;
  force_n_ = force_n;
  time_s_ = sum_m_ = 0.0;
  count_ = 0;
  running_ = true;
}

void SoftProbe::step(MadeSoftBody& copy, const Vector3d& force_n, double h,
                     const std::function<void(btSoftBody&)>& collide) {
  copy.before_step(h);
  copy.push(patch_, force_n);
  copy.soft().predictMotion(static_cast<btScalar>(h));
  collide(copy.soft());
  copy.soft().solveConstraints();
  copy.soft().integrateMotion();
}

bool SoftProbe::advance(double h, const std::function<void(btSoftBody&)>& collide) {
  if (!running_) return false;
  step(plain_, force_n_, h, collide);
  step(loaded_, force_n_ - kLoad_n * patch_.normal, h, collide);
  time_s_ += h;
  if (time_s_ > 0.5 * kHorizon_s) {
    double deeper = 0.0;
    for (const auto& [node, share] : patch_.shares) {
      const btVector3 way = plain_.soft().m_nodes[node].m_x - loaded_.soft().m_nodes[node].m_x;
      deeper += share * patch_.normal.dot(from_bullet(way, scale_));
    }
    sum_m_ += deeper;
    ++count_;
  }
  if (time_s_ < kHorizon_s) return false;
  running_ = false;
  const double compliance = sum_m_ / (count_ * kLoad_n);
  if (!std::isfinite(compliance) || compliance <= 0.0) return false;  // the copies have come to grief
  compliance_m_per_n_ = compliance;
  return true;
}

}  // namespace physics::bullet
