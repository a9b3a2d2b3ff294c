#pragma once
/// @file overlap.hpp
/// What starts inside what: for warnings about a scene, before anything moves.
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rtbus/config/scene.hpp"

namespace rtbus::config {

/// True when p_W lies deeper than `depth_m` [m] below the surface of the body. A mesh encloses something only when it
/// is closed, and its depth is not asked: any point inside counts.
[[nodiscard]] bool is_inside(const Body& body, const Eigen::Vector3d& p_W, double depth_m);

/// The same of a soft body at rest.
[[nodiscard]] bool is_inside(const SoftBody& body, const Eigen::Vector3d& p_W);

/// Dynamic bodies that start inside another body, deeper than a tenth of the smaller one's least extent: contacts push
/// them apart with a jerk. Judged at corners, ends and centres: edges that cross without a corner inside are missed.
/// @returns at most one sentence for the user: the first pair, and how many there are.
[[nodiscard]] std::vector<std::string> overlap_warnings(const Scene& scene);

}  // namespace rtbus::config
