#pragma once
/// @file soft_patch.hpp
/// The part of a soft body that a ball touches or is nearest to, smoothed over a few nodes. Lengths in Bullet's units, W.
#include <utility>
#include <vector>

#include <BulletSoftBody/btSoftBody.h>

#include "physics_node/bullet/units.hpp"

namespace physics::bullet {

/// Shares w of the nodes around the foot of the ball's centre on the surface, 1 together. Point, normal and velocity of
/// the patch are their means with these shares, and a force on the patch is shared out by them: so the work at the
/// patch, F·Σ w·v, is the work at the nodes, and nothing is lost or made between them. Means go smoothly from node to
/// node, where distances to the nodes or to the faces between them would not.
struct SoftPatch {
  bool found = false;
  std::vector<std::pair<int, double>> shares;  ///< Node and w.
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();    ///< Unit, outward.
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   ///< Of the material.
  double gap = 0.0;                                     ///< From the plane through the point to the ball.
  double inverse_mass_per_kg = 0.0;                     ///< Of the patch: Σ w²/m.
};

/// A ball, and how far around its foot nodes count.
struct PatchBall {
  Eigen::Vector3d centre;
  double radius;
  double width;
};

/// Looks on from where `out` has been found before, as long as the ball is near to it: what it has pressed in does not
/// turn it to the other side. Else begins at the node that faces the ball and is nearest. Not found: nothing is nearer
/// than `max_gap`. Changes nothing but `out`, whose memory it keeps.
void find_patch(const btSoftBody& soft, const PatchBall& ball, double max_gap, SoftPatch& out);

}  // namespace physics::bullet
