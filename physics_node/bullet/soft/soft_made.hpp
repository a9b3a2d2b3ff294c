#pragma once
/// @file soft_made.hpp
/// One soft body of a scene as Bullet's, in Bullet's units.
#include <array>
#include <memory>
#include <string>
#include <vector>

#include <BulletSoftBody/btSoftBody.h>

#include "physics_node/bullet/units.hpp"
#include "rtbus/config/soft_body.hpp"

namespace physics::bullet {

/// Frequencies, rates and pressures of the scene become Bullet's coefficients anew
/// whenever the step changes: of pose matching the share (2π·f·h)² per step, of damping 1 − e^(−λ·h).
///
/// Pressure is ours: a third of each face's p·A·n goes to each of its corners, which sums to zero over a closed
/// surface. (Bullet's own, mean areas times normals of the nodes, does not: its bodies creep over the floor by
/// themselves.) It is explicit: a skin of mass m that encloses V at rest breathes with ω² = A²·(bulk modulus +
/// pressure)/(V·m), A being its area; a step carries h·ω up to kMaxBreathing, and stiffer settings are lowered to that.
class MadeSoftBody {
 public:
  static constexpr double kMaxBreathing = 1.0;
  /// Below this share of its volume at rest a closed body counts as inside out.
  static constexpr double kSmallestVolume = 0.02;

  MadeSoftBody(const rtbus::config::SoftBody& body, btSoftBodyWorldInfo& info, double scale);

  /// Coefficients and forces for a step of `h` seconds.
  void before_step(double h);

  /// False when a node is not finite or farther than `kMaxUnits` away, or the body is inside out.
  [[nodiscard]] bool sound() const;

  /// As placed by the scene, at rest.
  void put_back();

  /// What of the settings a step of `h` seconds cannot carry; empty: nothing.
  [[nodiscard]] std::string complaint(double h) const;

  [[nodiscard]] btSoftBody& soft() noexcept { return *soft_; }
  [[nodiscard]] const btSoftBody& soft() const noexcept { return *soft_; }
  [[nodiscard]] const rtbus::config::SoftBody& body() const noexcept { return body_; }
  [[nodiscard]] double mean_edge_m() const noexcept { return mean_edge_m_; }

 private:
  static constexpr double kMaxUnits = 1e5;
  /// Highest bulk modulus and pressure together that a step carries [Pa].
  [[nodiscard]] double stiffest_pa(double h) const;
  void set_coefficients(double h);
  void press();
  [[nodiscard]] double volume() const;  ///< Now [m³].

  rtbus::config::SoftBody body_;
  double scale_;
  std::vector<btVector3> placed_;  // nodes where the scene has them [units]
  double area_m2_ = 0.0;
  double volume_m3_ = 0.0;
  double mean_edge_m_ = 0.0;
  double step_s_ = 0.0;   // of the coefficients
  double carried_ = 1.0;  // share of pressure and bulk modulus that the step carries
  std::vector<std::array<int, 3>> faces_;
  std::unique_ptr<btSoftBody> soft_;
};

}  // namespace physics::bullet
