#pragma once
/// @file scene.hpp
/// A scene file, `schema: scene/1`: what stands in the world. Both nodes read it.
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/config/document.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace rtbus::config {

/// How a body moves. The reader refuses what no engine of this build can move.
enum class BodyType {
  kStatic,  ///< Never moves.
};

/// One body in W (right-handed, y up).
struct Body {
  std::string name;  ///< Unique in the scene, [A-Za-z0-9_-], 1…64 characters.
  BodyType type = BodyType::kStatic;
  shapes::Shape shape;                                       ///< In the body's frame.
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();            ///< [m]
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();  ///< Unit length.
  double friction = 0.0;                                     ///< Coulomb coefficient, 0…2.
};

struct Scene {
  Eigen::Vector3d gravity_m_s2{0.0, -9.81, 0.0};
  std::vector<Body> bodies;
  std::string name;  ///< From the file, else the file's name without folder and suffix.
  std::string file;  ///< Where it stands: its own file, or the session file it is written in.

  /// The bodies that never move, in the scene's order: all that the `direct` law and the analytic engine need.
  [[nodiscard]] std::vector<shapes::PlacedShape> static_shapes() const;
};

/// Reads a scene from its map and finishes the map. Throws Error.
[[nodiscard]] Scene read_scene(Map& map);

}  // namespace rtbus::config
