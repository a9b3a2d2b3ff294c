#include "physics_node/bullet/soft/soft_patch.hpp"

#include <cmath>
#include <limits>

namespace physics::bullet {
namespace {

using Eigen::Vector3d;

/// The foot moves with the normal and the normal with the foot: they agree after a few turns.
constexpr int kTurns = 4;

/// Where to begin, without a patch from before. False: nothing is near.
bool nearest_node(const btSoftBody& soft, const Vector3d& centre, double reach, SoftPatch& out) {
  double best = reach * reach;
  double best_behind = std::numeric_limits<double>::infinity();
  const btSoftBody::Node *front = nullptr, *behind = nullptr;
  for (int i = 0; i < soft.m_nodes.size(); ++i) {
    const btSoftBody::Node& node = soft.m_nodes[i];
    const Vector3d way = centre - from_bullet(node.m_x);
    const double distance2 = way.squaredNorm();
    if (way.dot(from_bullet(node.m_n)) > 0.0) {
      if (distance2 < best) best = distance2, front = &node;
    } else if (distance2 < best_behind) {
      best_behind = distance2, behind = &node;
    }
  }
  // Of a ball whose centre is inside no node faces it.
  if (front == nullptr && best_behind < reach * reach) front = behind;
  if (front == nullptr) return false;
  out.normal = from_bullet(front->m_n);
  out.point = from_bullet(front->m_x);
  return true;
}

/// Shares around `foot` of the nodes that look the same way, and their means. False: there are none.
bool gather(const btSoftBody& soft, const Vector3d& foot, double width, SoftPatch& out) {
  const Vector3d looks = out.normal;
  out.shares.clear();
  double sum = 0.0;
  for (int i = 0; i < soft.m_nodes.size(); ++i) {
    const btSoftBody::Node& node = soft.m_nodes[i];
    const double inside = 1.0 - (from_bullet(node.m_x) - foot).squaredNorm() / (width * width);
    const double same_way = looks.dot(from_bullet(node.m_n));
    if (inside <= 0.0 || same_way <= 0.0) continue;
    const double share = inside * inside * inside * same_way;
    out.shares.emplace_back(i, share);
    sum += share;
  }
  if (!(sum > 1e-9)) {
    out.shares.clear();
    return false;
  }
  out.point.setZero();
  out.velocity.setZero();
  out.inverse_mass_per_kg = 0.0;
  Vector3d normal = Vector3d::Zero();
  for (auto& [index, share] : out.shares) {
    share /= sum;
    const btSoftBody::Node& node = soft.m_nodes[index];
    out.point += share * from_bullet(node.m_x);
    out.velocity += share * from_bullet(node.m_v);
    normal += share * from_bullet(node.m_n);
    out.inverse_mass_per_kg += share * share * static_cast<double>(node.m_im);
  }
  if (!(normal.norm() > 1e-6)) return false;
  out.normal = normal.normalized();
  return true;
}

}  // namespace

void find_patch(const btSoftBody& soft, const PatchBall& ball, double max_gap, SoftPatch& out) {
  const bool goes_on = out.found && out.gap < ball.width;
  out.found = false;
  const double reach = max_gap + ball.radius + ball.width;
  const btVector3 grown(static_cast<btScalar>(reach), static_cast<btScalar>(reach), static_cast<btScalar>(reach));
  if (!TestPointAgainstAabb2(soft.m_bounds[0] - grown, soft.m_bounds[1] + grown, to_bullet(ball.centre))) return;
  if (!goes_on && !nearest_node(soft, ball.centre, reach, out)) return;
  for (int turn = 0; turn < kTurns; ++turn) {
    const Vector3d foot = ball.centre - out.normal * out.normal.dot(ball.centre - out.point);
    if (!gather(soft, foot, ball.width, out)) return;
  }
  out.gap = out.normal.dot(ball.centre - out.point) - ball.radius;
  out.found = std::isfinite(out.gap) && out.gap <= max_gap;
}

}  // namespace physics::bullet
