#pragma once
/// @file hull_points.hpp
/// Where a hull lies on a face.
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/shapes/face_points.hpp"
#include "rtbus/shapes/hull.hpp"

namespace rtbus::shapes {

/// So much higher than the lowest one a point may be: what tips back touches with it again before it has sunk in.
inline constexpr double kHardlyHigher_m = 1e-3;

/// The points of `held` that are hardly higher than its lowest one over the face. Of more than four the four that are
/// farthest apart along two axes of the hull. The lowest one is among them where it is lower than these by a thousandth
/// of `higher_m`: which of many it is otherwise is noise.
/// @param held The hull. @param q_WB Orientation of the hull's frame. @param p_WB Its origin, in W. @param face What
/// it lies on, whose edges are not looked at. @param higher_m Than the lowest one, at most. @param out Set; its count
/// is 0 where the hull is empty. @realtime Yes.
void hull_points(const Hull& held, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& p_WB, const Face& face,
                 FacePoints& out, double higher_m = kHardlyHigher_m) noexcept;

}  // namespace rtbus::shapes
