#pragma once
/// @file yielding_bodies.hpp
/// What yields to the proxy: soft bodies, and a bed of very light ones. Frame W, SI units.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "haptic_node/rendering/blend.hpp"
#include "haptic_node/rendering/contact_solver.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// The tool takes room among these bodies in physics. An answer tells what they do to it, R, where it is then, q, and
/// how R falls with the tool's place; now, and ahead if the tool goes on as it goes. For the proxy at p this is
///
///   R(p, t) = R(t) − S·(p − q(t)),     one-sided along R, at most friction · its normal part across.
///
/// So at rest it is what physics has found, whatever S is: S bridges what the hand does otherwise than foreseen.
/// What the proxy feels goes back as the impulses of rtbus::kYieldingBodies. One thread. @realtime Yes.
class YieldingBodies {
 public:
  static constexpr std::size_t kNoRow = static_cast<std::size_t>(-1);

  /// @param mean_s Time over which the force of what rests is averaged.
  explicit YieldingBodies(double mean_s) noexcept : mean_s_(mean_s) {}

  void forget() noexcept {
    count_ = 0;
    rest_ = mean_weight_ = 0.0;
    rests_s_ = 0.0;
    mean_n_.setZero();
    normal_n_s_ = 0.0;
    late_n_.setZero();
  }

  /// @returns how far the answer moves the surface that is felt; none: nothing is.
  std::optional<double> take(const rtbus::ProxyContacts& answer, const Eigen::Vector3d& proxy_m, std::uint64_t now_ns,
                             const Blend& blend) noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] bool near() const noexcept { return count_ > 0; }
  /// Whether there is anything to average: something is near, or its mean is still felt.
  [[nodiscard]] bool averages() const noexcept { return near() || mean_weight_ > 0.0; }

  /// The force on a proxy where the tool of physics is now.
  [[nodiscard]] Eigen::Vector3d bears_n(std::uint64_t now_ns) const noexcept RTBUS_NONBLOCKING;

  /// The row of the tick of `h` that ends at `now_ns`; what acts across is given to `proxy` at once.
  /// @returns rows added, 0 or 1.
  std::size_t add_row(const Eigen::Vector3d& proxy_m, std::uint64_t now_ns, double h, SolverBody& proxy,
                      SolverContact* rows, std::size_t first) noexcept RTBUS_NONBLOCKING;

  /// On the proxy, by the solution of the rows.
  [[nodiscard]] Eigen::Vector3d impulse_n_s(const SolverContact* rows) const noexcept RTBUS_NONBLOCKING;
  /// What is felt besides: where an answer says that the world is at rest, the hand feels a mean over mean_s instead of
  /// what wavers. What the hand itself moves changes the mean at once, by twice the stiffness of body and coupling in
  /// series, at most the coupling's: a spring which gives way to the body within mean_s (Zener's solid, which is
  /// passive). Bodies feel what wavers, so that the third law holds in the mean.
  /// @param eased_n What LocalWorld::ease() adds to the force of now.
  [[nodiscard]] Eigen::Vector3d calm_n_s(const SolverContact* rows, const Eigen::Vector3d& eased_n,
                                         const Eigen::Vector3d& goal_m, double stiffness_n_per_m,
                                         double h) noexcept RTBUS_NONBLOCKING;
  /// That solution is what is felt.
  void keep(const SolverContact* rows, double h) noexcept RTBUS_NONBLOCKING;

 private:
  struct Instant {
    double after_s = 0.0;
    Eigen::Vector3d tool_m = Eigen::Vector3d::Zero(), reaction_n = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::UnitY();
    double gap_m = 0.0;
  };
  [[nodiscard]] Instant at(std::uint64_t now_ns) const noexcept;
  /// An instant, and what is felt there: so much where the tool is, along `n`; less or more ahead of it.
  struct Felt {
    Instant now;
    Eigen::Vector3d n;
    double bears_n;
    [[nodiscard]] double ahead_m(const Eigen::Vector3d& proxy_m) const noexcept {
      return n.dot(proxy_m - now.tool_m) + now.gap_m;
    }
  };
  [[nodiscard]] Felt felt(std::uint64_t now_ns) const noexcept;

  std::size_t count_ = 0;
  std::array<Instant, rtbus::kYieldSlots> instants_{};
  std::uint64_t from_ns_ = 0;
  Blend blend_;
  Eigen::Vector3d late_n_ = Eigen::Vector3d::Zero();  ///< Of the reaction before the answer, what is still felt.
  double along_n_per_m_ = 0.0, across_n_per_m_ = 0.0;
  double friction_ = 0.0;    ///< Coulomb coefficient of the pair [1].
  double normal_n_s_ = 0.0;  ///< Of the last tick.
  Eigen::Vector3d across_n_s_ = Eigen::Vector3d::Zero();
  std::size_t row_ = kNoRow;
  double mean_s_;
  double rest_ = 0.0;         ///< As told last.
  double mean_weight_ = 0.0;  ///< 0 to 1: so much of the mean is felt. On its way to that, unless the hand moves.
  Eigen::Vector3d rests_at_m_ = Eigen::Vector3d::Zero();  ///< Mean place of the hand since it moved last …
  double rests_s_ = 0.0;                                  ///< … which is so long ago.
  Eigen::Vector3d mean_n_ = Eigen::Vector3d::Zero();      ///< What is felt where the world is at rest.
  Eigen::Vector3d goal_m_ = Eigen::Vector3d::Zero();      ///< Of the last tick.
};

}  // namespace haptic
