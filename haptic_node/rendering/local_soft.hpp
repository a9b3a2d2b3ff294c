#pragma once
/// @file local_soft.hpp
/// Soft bodies of the local world: where the proxy meets one, a patch of its surface on a spring. Frame W, SI units.
/// Fixed size, no allocation.
#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "haptic_node/rendering/contact_solver.hpp"
#include "rtbus/contact_messages.hpp"

namespace haptic {

/// A patch has the compliance C and the friction that physics tells, and a damper, but no mass: an encoder's step would
/// be felt as if it hit something. It carries the force φ and is displaced by w = C·φ from its place at rest; the
/// surface is the plane through q + w with the normal n.
///
/// An answer describes the instant t_k: the gap g_k of the proxy at p_k, while the local patch bore φ(t_k). So at rest
/// the patch was at q = p_k − g_k·n − C·φ(t_k): what physics has found, less what the local world had made of it.
/// Physics had the same pushes by then, so that q is where the surface would be without them; an error of C enters as
/// (C_true − C)·φ and dies out from answer to answer as long as C is more than half of the true one. The body as a
/// whole gives way as well, later and farther: C is therefore kSofter times what physics tells. The surface goes from
/// where it was felt to the new plane, and turns to it, as those of rigid bodies do (LocalWorld::kBlendSteps), and a
/// force is kept as φ: another C moves no surface.
class LocalSoft {
 public:
  static constexpr std::size_t kPatches = 4;
  static constexpr std::uint32_t kSoftKind = 3;  ///< ProxyContacts::body_kind.
  /// With once as much as measured, the delay makes a soft body rock under the hand (docs/decisions/0008).
  static constexpr double kSofter = 2.0;
  static constexpr double kRelaxation_s = 1e-3;  ///< The damper over the spring.

  /// Rows of bodies that are not soft: they come first.
  [[nodiscard]] static std::size_t rigid_rows(const rtbus::ProxyContacts& answer) noexcept RTBUS_NONBLOCKING;

  /// False: a scene without soft bodies, or none near. Then nothing below needs to be called.
  [[nodiscard]] bool any() const noexcept { return used_ > 0; }
  void reset() noexcept RTBUS_NONBLOCKING;

  /// An answer has come; the proxy is at `proxy_m`. `blend_s` as LocalWorld has it.
  void take(const rtbus::ProxyContacts& answer, const Eigen::Vector3d& proxy_m,
            double blend_s) noexcept RTBUS_NONBLOCKING;

  /// Adds a row for each patch that the proxy, moving at `proxy_m_s`, may reach within `h`, between body 0 and bodies
  /// from `first_body` on, of which it fills kPatches. @returns rows added, at most kPatches.
  std::size_t gather(const Eigen::Vector3d& proxy_m, const Eigen::Vector3d& proxy_m_s, double h, SolverBody* bodies,
                     int first_body, SolverContact* rows) noexcept RTBUS_NONBLOCKING;

  /// Takes the solution of the rows of gather(): to the end of the step, which is the instant `sample_ns`.
  void integrate(const SolverBody* bodies, int first_body, const SolverContact* rows, double h,
                 std::uint64_t sample_ns) noexcept RTBUS_NONBLOCKING;

  /// Body in the scene's order, of the i-th row of gather().
  [[nodiscard]] std::uint32_t body_of(std::size_t row) const noexcept { return patches_[row_patch_[row]].index; }

 private:
  struct Patch {
    bool used = false;
    bool fades = false;  ///< Physics does not name it any more.
    std::uint32_t index = 0;
    Eigen::Vector3d normal = Eigen::Vector3d::UnitY();
    Eigen::Vector3d told_normal = Eigen::Vector3d::UnitY();  ///< Where it turns to.
    Eigen::Vector3d place_m = Eigen::Vector3d::Zero();       ///< q.
    double compliance_m_per_n = 0.0;
    double friction = 0.0;
    double offset_m = 0.0;                                  ///< Added to the gap: what is still to be blended in.
    Eigen::Vector3d spring_n = Eigen::Vector3d::Zero();     ///< φ.
    Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();  ///< On the proxy, in the last step.
  };
  /// φ of every patch at an instant.
  struct Instant {
    std::uint64_t time_ns = 0;
    std::array<Eigen::Vector3d, kPatches> spring_n;
  };
  static constexpr std::size_t kInstants = 512;
  static constexpr double kPastSteps = 2.5;  ///< Of physics: an answer is at most two old.

  [[nodiscard]] Patch* patch_of(std::uint32_t index) noexcept;
  [[nodiscard]] Eigen::Vector3d spring_at(std::size_t patch, std::uint64_t time_ns) const noexcept;
  [[nodiscard]] static double gap_of(const Patch& patch, const Eigen::Vector3d& proxy_m) noexcept {
    return patch.normal.dot(proxy_m - patch.place_m - patch.compliance_m_per_n * patch.spring_n) + patch.offset_m;
  }

  std::array<Patch, kPatches> patches_{};
  std::size_t used_ = 0;
  double blend_s_ = 0.01;
  std::array<std::size_t, kPatches> row_patch_{};
  std::size_t rows_ = 0;
  std::array<Instant, kInstants> instants_{};
  std::uint64_t instant_count_ = 0;
  std::uint64_t instant_apart_ns_ = 0;
};

}  // namespace haptic
