#pragma once
/// @file scene.hpp
/// A scene file, `schema: scene/1`: what stands in the world. Both nodes read it.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/config/body_motion.hpp"
#include "rtbus/config/body_shape.hpp"
#include "rtbus/config/document.hpp"
#include "rtbus/config/soft_body.hpp"
#include "rtbus/shapes/known_shape.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace rtbus::config {

/// How a body moves.
enum class BodyType {
  kStatic,     ///< Never moves.
  kDynamic,    ///< Moved by gravity, contacts and the hand. Needs an engine that moves bodies.
  kKinematic,  ///< Moves by its own motion and yields to nothing. Likewise.
};

/// One body in W (right-handed, y up).
struct Body {
  std::string name;    ///< Unique in the scene, [A-Za-z0-9_-], 1…64 characters.
  std::string source;  ///< "scenes/wall.yaml:14: bodies.0": where it stands, for messages.
  BodyType type = BodyType::kStatic;
  BodyShape shape;                                           ///< In the body's frame.
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();            ///< [m]
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();  ///< Unit length.
  double friction = 0.0;                                     ///< Coulomb coefficient, 0…2; of a pair: the product.
  double restitution = 0.0;            ///< Speed after over speed before an impact, 0…1; of a pair: the product.
  double mass_kg = 0.0;                ///< Of a dynamic body, spread evenly over its volume; else 0.
  double linear_damping_per_s = 0.0;   ///< dv/dt = −λ·v, as of a body in air.
  double angular_damping_per_s = 0.0;  ///< Likewise of the angular velocity.
  std::optional<BodyMotion> motion;    ///< Of a kinematic body, else none.
  bool asleep = false;                 ///< Starts at rest and stays so until something touches it.
};

/// When bodies that hardly move are put to rest, to save their share of each step. A touch wakes them.
struct Deactivation {
  bool enabled = true;
  double after_s = 0.5;                 ///< Slower than both speeds for so long.
  std::optional<double> linear_m_s;     ///< None: the engine's choice, from size and gravity.
  std::optional<double> angular_rad_s;  ///< Likewise.
};

/// A scene file, read and checked.
struct Scene {
  Eigen::Vector3d gravity_m_s2{0.0, -9.81, 0.0};
  std::vector<Body> bodies;  ///< Grids already unrolled.
  std::vector<SoftBody> soft_bodies;
  Deactivation deactivation;
  std::string name;  ///< From the file, else the file's name without folder and suffix.
  std::string file;  ///< Where it stands: its own file, or the session file it is written in.

  /// The planes, spheres and boxes that never move, in the scene's order: what the `direct` method and the analytic
  /// engine know.
  [[nodiscard]] std::vector<shapes::PlacedShape> static_shapes() const;

  /// Shapes that `local_contact` knows, in the scene's order: planes and meshes, which never move, boxes, capsules,
  /// cylinders, and hulls of at most Hull::kMost points.
  [[nodiscard]] std::vector<shapes::KnownShape> known_shapes() const;

  /// Of what two processes must agree on to find the same contacts: kind and shape of all bodies, in order, and where
  /// those are that never move. Never 0.
  [[nodiscard]] std::uint64_t shape_hash() const;
};

/// Reads a scene from its map and finishes the map. Throws Error.
[[nodiscard]] Scene read_scene(Map& map);

/// Bodies with `motion: target`, as indices into Scene::bodies.
[[nodiscard]] std::vector<std::size_t> bodies_that_orders_move(const Scene& scene);

}  // namespace rtbus::config
