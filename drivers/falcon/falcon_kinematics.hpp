#pragma once
/// @file falcon_kinematics.hpp
/// The Falcon's parallel mechanism: encoder counts ↔ grip position, and forces ↔ joint torques. Three legs at 105°,
/// −15° and −135° around z, each a driven thigh and a parallelogram shin. Frame B of this file: origin at the centre of
/// the base plate, x right, y up, z out of the body towards the user; metres, radians. Equations after R. E. Stamper,
/// PhD thesis 97-4, University of Maryland 1997, ch. 3 and 4 (README.md, "geometry").
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include <Eigen/Core>

namespace drivers::falcon {

/// Link lengths and encoder scale. Published sets disagree by millimetres; README.md compares them.
struct Geometry {
  std::string_view name;
  double thigh_m = 0.0;          ///< a: hip axis to knee.
  double shin_m = 0.0;           ///< b: length of the parallelogram.
  double platform_m = 0.0;       ///< c: shin joint to the grip's centre, radial.
  double joint_offsets_m = 0.0;  ///< D: both offsets at the ends of the shin together.
  double base_m = 0.0;           ///< r: centre of the base to a hip axis, radial.
  double lateral_m = 0.0;        ///< o: sideways offset of a leg.
  double drive_ratio = 1.0;      ///< Motor turns per turn of the thigh.
  double zero_angle_rad = 0.0;   ///< θ0: of a thigh at count 0, above the base plate.

  [[nodiscard]] double rad_per_count() const noexcept;  ///< 1280 counts per motor turn.
};

/// All geometry sets by name; the first is the default.
[[nodiscard]] std::span<const Geometry> geometries() noexcept;

using Counts = std::array<std::int32_t, 3>;

/// The mechanism with one geometry. Immutable; any thread. Everything is realtime-safe and finite for any input.
class Kinematics {
 public:
  explicit Kinematics(const Geometry& geometry) noexcept;

  [[nodiscard]] const Geometry& geometry() const noexcept { return geometry_; }

  [[nodiscard]] Eigen::Vector3d angles_rad(const Counts& counts) const noexcept;
  [[nodiscard]] Eigen::Vector3d counts(const Eigen::Vector3d& angles_rad) const noexcept;  ///< Not rounded.

  /// Position of the grip. Newton's method on the three closure equations, from the intersection of three spheres;
  /// 3 or 4 steps to 1e-13 m. None for angles at which the legs cannot meet: an encoder value is wrong.
  [[nodiscard]] std::optional<Eigen::Vector3d> position_m(const Eigen::Vector3d& angles_rad) const noexcept;

  /// Closed form, knees outwards. None when the grip cannot be there.
  [[nodiscard]] std::optional<Eigen::Vector3d> inverse_rad(const Eigen::Vector3d& position_m) const noexcept;

  /// J = ∂x/∂θ [m/rad] at a position and its angles; joint torque = Jᵀ·force. None near a singularity.
  [[nodiscard]] std::optional<Eigen::Matrix3d> jacobian(const Eigen::Vector3d& position_m,
                                                        const Eigen::Vector3d& angles_rad) const noexcept;

 private:
  /// One leg's closure equation at a position: g = 0 when the leg reaches it.
  struct Closure {
    double g = 0.0;            ///< [m²]
    Eigen::Vector3d gradient;  ///< ∂g/∂x [m]
    double by_angle = 0.0;     ///< ∂g/∂θ [m²/rad]
    bool reachable = false;    ///< Sideways offset within the shin's length.
  };
  [[nodiscard]] Closure closure(std::size_t leg, const Eigen::Vector3d& position_m, double cos_theta,
                                double sin_theta) const noexcept;
  [[nodiscard]] std::optional<Eigen::Vector3d> three_spheres(const Eigen::Vector3d& cos_theta,
                                                             const Eigen::Vector3d& sin_theta) const noexcept;

  Geometry geometry_;
  std::array<double, 3> cos_phi_{};
  std::array<double, 3> sin_phi_{};
};

}  // namespace drivers::falcon
