#pragma once
/// @file interpolation.hpp
/// The methods that the paper compares with (He & Choi 2013, section IV, Fig. 6): physics makes the force, the haptic
/// loop ramps from one to the next.
#include <string_view>

#include "haptic_node/rendering/method.hpp"

namespace haptic {

/// Eq. (1): f_j = f_{i−1} + (f_i − f_{i−1})·(j mod N)/N, j counting cycles since f_i arrived. N is the number of haptic
/// cycles per physics step; the paper's eq. (2) prints that quotient upside down (T_h/T_s, 0.05 for its 1 ms and 20
/// ms). Its scale factor α is the mapping's 1/force_scale, which the force has gone through before it comes here. Eq.
/// (3) and (4), the force itself, are made in physics_node/stepper.hpp: `interpolation_predicted` differs there only.
///
/// While a force is late, the output stays at f_i; j mod N taken literally would make a saw-tooth back to f_{i−1}.
///
/// The improved form, beside what physics does, reaches f_i one cycle earlier ((j + 1)/N, so that with N = 1 the newest
/// force acts at once) and starts its ramp from what the hand has, so that a force that comes early makes no step.
class Interpolation final : public Method {
 public:
  Interpolation(std::string_view name, bool paper) noexcept : name_(name), paper_(paper) {}

  [[nodiscard]] std::string_view name() const noexcept override { return name_; }
  [[nodiscard]] bool needs_physics() const noexcept override { return true; }
  [[nodiscard]] RenderOutput render(const RenderInput& input) noexcept RTBUS_NONBLOCKING override;
  void reset() noexcept RTBUS_NONBLOCKING override;

 private:
  std::string_view name_;  ///< Of the registry's row: a literal.
  bool paper_;
  double cycles_per_step_ = 1.0;                          ///< N.
  double cycle_ = 0.0;                                    ///< j.
  Eigen::Vector3d from_n_ = Eigen::Vector3d::Zero();      ///< f_{i−1}.
  Eigen::Vector3d to_n_ = Eigen::Vector3d::Zero();        ///< f_i.
  Eigen::Vector3d rendered_n_ = Eigen::Vector3d::Zero();  ///< f_j of the last cycle.
};

}  // namespace haptic
