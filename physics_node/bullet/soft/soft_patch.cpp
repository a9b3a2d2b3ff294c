#include "physics_node/bullet/soft/soft_patch.hpp"

#include <cmath>
#include <limits>

namespace physics::bullet {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The foot moves with the normal and the normal with the foot: they agree after a few turns.
constexpr int kTurns = 4;

/// Where to begin, without a patch from before. False: nothing is near.
bool begin_at_nearest(const RestShape& rest, double reach, SoftPatch& out) {
  double nearest = reach * reach, nearest_behind = reach * reach;
  std::size_t front = rest.nodes.size(), behind = rest.nodes.size();
  for (std::size_t i = 0; i < rest.nodes.size(); ++i) {
    const Vector3d way = out.rest_centre - rest.nodes[i];
    const double distance2 = way.squaredNorm();
    if (way.dot(rest.normals[i]) > 0.0) {
      if (distance2 < nearest) nearest = distance2, front = i;
    } else if (distance2 < nearest_behind) {
      nearest_behind = distance2, behind = i;
    }
  }
  if (front == rest.nodes.size()) front = behind;  // no node faces a ball whose centre is inside
  if (front == rest.nodes.size()) return false;
  out.rest_normal = rest.normals[front];
  out.foot = rest.nodes[front];
  return true;
}

/// Shares around the foot of the nodes that look the same way; foot and normal become theirs. False: there are none.
bool share_out(const RestShape& rest, double width, SoftPatch& out) {
  out.shares.clear();
  double sum = 0.0;
  Vector3d middle = Vector3d::Zero(), normal = Vector3d::Zero();
  for (std::size_t i = 0; i < rest.nodes.size(); ++i) {
    const double inside = 1.0 - (rest.nodes[i] - out.foot).squaredNorm() / (width * width);
    const double same_way = out.rest_normal.dot(rest.normals[i]);
    if (inside <= 0.0 || same_way <= 0.0) continue;
    const double share = inside * inside * inside * same_way;
    out.shares.emplace_back(static_cast<int>(i), share);
    middle += share * rest.nodes[i];
    normal += share * rest.normals[i];
    sum += share;
  }
  if (!(sum > 1e-9) || !(normal.norm() > 1e-6 * sum)) {
    out.shares.clear();
    return false;
  }
  for (auto& [node, share] : out.shares) share /= sum;
  middle /= sum;
  // Half of the way: a whole one may go to and fro.
  out.rest_normal = (out.rest_normal + normal.normalized()).normalized();
  out.foot += out.rest_normal * out.rest_normal.dot(middle - out.foot);  // onto the surface
  return true;
}

}  // namespace

void find_patch(const btSoftBody& soft, const RestShape& rest, const PatchBall& ball, double max_gap, SoftPatch& out) {
  const bool goes_on = out.found && out.gap < ball.width;
  out.found = false;
  const double reach = max_gap + ball.radius + ball.width;
  const btVector3 grown(static_cast<btScalar>(reach), static_cast<btScalar>(reach), static_cast<btScalar>(reach));
  if (!TestPointAgainstAabb2(soft.m_bounds[0] - grown, soft.m_bounds[1] + grown, to_bullet(ball.centre))) return;
  Matrix3d turned;
  for (int row = 0; row < 3; ++row) turned.row(row) = from_bullet(soft.m_pose.m_rot[row]).transpose();
  const Vector3d before = out.rest_centre;
  out.rest_centre = turned.transpose() * (ball.centre - from_bullet(soft.m_pose.m_com));
  if (!goes_on && !begin_at_nearest(rest, reach, out)) return;
  const auto outside = [&out] { return out.rest_normal.dot(out.rest_centre - out.foot) > 0.0; };
  if (goes_on && !outside()) {
    const Vector3d way = out.rest_centre - before;
    out.foot += way - out.rest_normal * out.rest_normal.dot(way);
  }
  for (int turn = 0; turn < kTurns; ++turn) {
    if (outside()) out.foot = out.rest_centre - out.rest_normal * out.rest_normal.dot(out.rest_centre - out.foot);
    if (!share_out(rest, ball.width, out)) return;
  }
  out.point.setZero();
  out.inverse_mass_per_kg = 0.0;
  for (const auto& [index, share] : out.shares) {
    const btSoftBody::Node& node = soft.m_nodes[index];
    out.point += share * from_bullet(node.m_x);
    out.inverse_mass_per_kg += share * share * static_cast<double>(node.m_im);
  }
  out.normal = turned * out.rest_normal;
  out.gap = out.normal.dot(ball.centre - out.point) - ball.radius;
  out.found = std::isfinite(out.gap) && out.gap <= max_gap;
}

}  // namespace physics::bullet
