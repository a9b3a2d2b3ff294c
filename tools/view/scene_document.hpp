#pragma once
/// @file scene_document.hpp
/// A scene for the page: one JSON document, and the meshes that it refers to. Pure.
#include <span>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "rtbus/config/scene.hpp"
#include "tools/view/frame_source.hpp"

namespace view {

/// What the page knows of a hand beforehand.
struct SceneHand {
  std::string name;    ///< "haptic0"
  std::string device;  ///< Model: "phantom_desktop".
  std::string method;
  double rate_hz = 0.0;
  double radius_m = 0.0;                                      ///< Of the proxy.
  double force_limit_n = 0.0;                                 ///< Of the device.
  Eigen::Quaterniond q_WD = Eigen::Quaterniond::Identity();   ///< Of the mapping.
  double position_scale = 1.0;                                ///< Likewise.
  Eigen::Vector3d workspace_min_m = Eigen::Vector3d::Zero();  ///< Of the device, frame D.
  Eigen::Vector3d workspace_max_m = Eigen::Vector3d::Zero();
};

/// Without its number. Meshes of more than kMostTriangles are left out and named in the document's `notes`.
[[nodiscard]] ViewScene make_view_scene(const rtbus::config::Scene& scene, const std::string& session,
                                        std::span<const SceneHand> hands);

}  // namespace view
