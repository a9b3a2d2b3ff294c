#pragma once
/// @file soft_probe.hpp
/// Compliance of a patch of a soft body, measured on copies of the body.
#include <functional>

#include "physics_node/bullet/soft/soft_made.hpp"
#include "physics_node/bullet/soft/soft_patch.hpp"

namespace physics::bullet {

/// Two copies of a body start where it is, carry on as it does under the force that it bears, and one of them bears
/// kLoad_n more on the patch. After kHorizon_s the compliance is the difference of the patch's places, mean over the
/// second half (by then it swings about its end), over the load. The body itself is not touched. One step of each copy
/// per step of the world: no step takes much longer than the others.
class SoftProbe {
 public:
  static constexpr double kLoad_n = 0.02;
  static constexpr double kHorizon_s = 0.1;

  SoftProbe(const rtbus::config::SoftBody& body, btSoftBodyWorldInfo& info, double scale)
      : scale_(scale), plain_(body, info, scale), loaded_(body, info, scale) {}

  /// From the present state of `real`, which bears `force_n` on `patch` (and its own weight).
  void start(const MadeSoftBody& real, const SoftPatch& patch, const Eigen::Vector3d& force_n);

  /// Gives up: the patch is not there any more.
  void stop() noexcept { running_ = false; }

  [[nodiscard]] bool running() const noexcept { return running_; }

  /// One step of `h` seconds; `collide` adds the contacts of a copy. @returns true when a compliance is there.
  bool advance(double h, const std::function<void(btSoftBody&)>& collide);

  /// Along the normal of the patch, > 0 [m/N].
  [[nodiscard]] double compliance_m_per_n() const noexcept { return compliance_m_per_n_; }

 private:
  void step(MadeSoftBody& copy, const Eigen::Vector3d& force_n, double h,
            const std::function<void(btSoftBody&)>& collide);

  double scale_;
  MadeSoftBody plain_, loaded_;
  SoftPatch patch_;
  Eigen::Vector3d force_n_ = Eigen::Vector3d::Zero();
  bool running_ = false;
  double time_s_ = 0.0;
  double sum_m_ = 0.0;
  int count_ = 0;
  double compliance_m_per_n_ = 0.0;
};

}  // namespace physics::bullet
