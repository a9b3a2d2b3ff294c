#pragma once
/// @file frames.hpp
/// Frames as ROS 2 names them, and the one rotation between our world and REP 103. Numbers stay as the bus has them:
/// each message names the frame that it is expressed in, and the tree of frames says how they lie.
///
///     world                  REP 103: x forward, y left, z up
///       rtbus_world          W: x right, y up, z towards the user       /tf_static
///         <haptic>_base      D, where the session file places it        /tf_static
///           <haptic>_hand    T                                          /tf
///         <haptic>_proxy     P                                          /tf
///         body/<name>        B                                          /tf
#include <string>

#include <Eigen/Geometry>

namespace bridge {

inline constexpr const char* kRosWorld = "world";
inline constexpr const char* kWorld = "rtbus_world";

[[nodiscard]] inline std::string base_frame(const std::string& node) { return node + "_base"; }
[[nodiscard]] inline std::string hand_frame(const std::string& node) { return node + "_hand"; }
[[nodiscard]] inline std::string proxy_frame(const std::string& node) { return node + "_proxy"; }
[[nodiscard]] inline std::string body_frame(const std::string& name) { return "body/" + name; }

/// q_RW, from W to `world`: x_R = −z_W (forward is away from the user), y_R = −x_W, z_R = y_W.
[[nodiscard]] inline Eigen::Quaterniond ros_from_world() noexcept { return {0.5, 0.5, -0.5, -0.5}; }

}  // namespace bridge
