#pragma once
/// @file soft_body.hpp
/// A body that yields: a triangle mesh of point masses (nodes) at its vertices and links along its edges.
#include <memory>
#include <string>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rtbus/config/body_shape.hpp"
#include "rtbus/config/document.hpp"

namespace rtbus::config {

/// Frequencies, pressures and rates keep their meaning when the step changes; the stiffnesses without a unit are shares
/// per iteration, as the solver takes them.
struct SoftBody {
  std::string name;                                          ///< Unique in the scene, among the rigid bodies too.
  std::string source;                                        ///< Where it stands, for messages: see Body::source.
  std::shared_ptr<const TriangleMesh> mesh;                  ///< At rest, in the body's frame.
  bool closed = false;                                       ///< The mesh encloses a volume.
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();            ///< [m]
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();  ///< Unit length.
  double mass_kg = 0.0;                                      ///< Spread evenly over the surface.
  double linear_stiffness = 0.5;   ///< Share of a link's stretch that one position iteration takes away, 0…1.
  double bending_stiffness = 0.0;  ///< The same of links between nodes two edges apart; 0: there are none.
  double pose_matching_hz = 8.0;  ///< Each node on a spring to its place in the rest shape, of this frequency; 0: none.
  double bulk_modulus_pa = 0.0;   ///< Pressure inside per share of volume lost; needs a closed mesh.
  double pressure_pa = 0.0;       ///< Inside, at the rest volume; p·V stays. Needs a closed mesh.
  double damping_per_s = 2.0;     ///< dv/dt = −λ·v of each node.
  double friction = 0.5;          ///< Coulomb coefficient; of a pair: the product.
  double contact_hardness = 0.2;  ///< Share of a penetration that one iteration takes away, 0…1.
  double margin_m = 0.001;        ///< The skin's half thickness: nodes are balls of this radius.
  int position_iterations = 4;
  int velocity_iterations = 0;  ///< Damp the links; exclude pose matching.
  int clusters = 0;  ///< Above 0: soft bodies meet each other by so many convex parts, else by nodes and faces.
  int cluster_iterations = 4;
};

/// Reads one entry of `soft_bodies:` but for its name. Throws Error.
[[nodiscard]] SoftBody read_soft_body(Map& map);

}  // namespace rtbus::config
