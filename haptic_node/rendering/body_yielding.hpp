#pragma once
/// @file body_yielding.hpp
/// A soft body: where the proxy meets it, a patch of its surface on a spring. Frame W, SI units.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "haptic_node/rendering/blend.hpp"
#include "haptic_node/rendering/body_motion.hpp"
#include "haptic_node/rendering/contact_solver.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// The force that the springs of all patches bore, over the last while. A place in it belongs to one body.
class SpringHistory {
 public:
  static constexpr std::size_t kPlaces = 4;

  void reset() noexcept RTBUS_NONBLOCKING;
  /// @returns a free place, or kPlaces.
  std::size_t open() noexcept RTBUS_NONBLOCKING;
  void close(std::size_t place) noexcept { open_[place] = false; }
  /// @param apart_ns What is nearer to each other is one.
  void keep_apart(std::uint64_t apart_ns) noexcept { apart_ns_ = apart_ns; }
  void set(std::size_t place, const Eigen::Vector3d& spring_n) noexcept { now_n_[place] = spring_n; }
  /// What was set() belongs to that instant.
  void record(std::uint64_t time_ns) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] Eigen::Vector3d at(std::size_t place, std::uint64_t time_ns) const noexcept RTBUS_NONBLOCKING;

  static constexpr std::size_t kInstants = 512;

 private:
  struct Instant {
    std::uint64_t time_ns = 0;
    std::array<Eigen::Vector3d, kPlaces> spring_n;
  };
  std::array<bool, kPlaces> open_{};
  std::array<Eigen::Vector3d, kPlaces> now_n_{};
  std::array<Instant, kInstants> instants_{};
  std::uint64_t count_ = 0;
  std::uint64_t apart_ns_ = 0;
};

/// A patch has the compliance C and the friction that physics tells, and a damper, but no mass: an encoder's step would
/// be felt as if it hit something. It carries the force φ and is displaced by w = C·φ from its place at rest; the
/// surface is the plane through q + w with the normal n.
///
/// An answer describes the instant t_k: the gap g_k of the proxy at p_k, while the local patch bore φ(t_k). So at rest
/// the patch was at q = p_k − g_k·n − C·φ(t_k): what physics has found, less what the local world had made of it.
/// Physics had the same pushes by then, so that q is where the surface would be without them; an error of C enters as
/// (C_true − C)·φ and dies out from answer to answer as long as C is more than half of the true one. The body as a
/// whole gives way as well, later and farther: C is therefore Tuning::softer times what physics tells. The surface goes
/// from where it was felt to the new plane, and turns to it, as those of rigid bodies do (blend.hpp), and a force is
/// kept as φ: another C moves no surface. @realtime Yes.
class YieldingBody {
 public:
  static constexpr std::uint32_t kKind = 3;  ///< ProxyContacts::body_kind.
  static constexpr std::size_t kNoRow = static_cast<std::size_t>(-1);

  YieldingBody() = default;
  /// @param place In the history.
  explicit YieldingBody(std::size_t place) : place_(place) {}

  /// @param contact Of the answer, with this body. @param proxy_m Where the proxy is. @param known Not new.
  /// @returns how far the answer moves a surface that is felt; none: it is not.
  std::optional<double> take(const rtbus::ProxyContacts& answer, std::size_t contact, const SpringHistory& history,
                             const Eigen::Vector3d& proxy_m, bool known,
                             const Tuning& tuning) noexcept RTBUS_NONBLOCKING;
  /// The answer does not name it: it recedes.
  void fade() noexcept { fades_ = true; }

  /// Takes part in a step as body number `self`, which it makes, and adds a row if the proxy, moving at `proxy_m_s`,
  /// may reach it within `h`. @returns rows added, 0 or 1.
  std::size_t add_rows(const Eigen::Vector3d& proxy_m, const Eigen::Vector3d& proxy_m_s, double h, const Blend& blend,
                       const Tuning& tuning, int self, SolverBody& body, SolverContact* rows,
                       std::size_t first) noexcept RTBUS_NONBLOCKING;

  void advance(const StepSolution& step, SpringHistory& history) noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] bool touched() const noexcept { return !impulse_n_s_.isZero(0.0); }
  /// Its row in the step; kNoRow: none.
  [[nodiscard]] std::size_t row() const noexcept { return row_; }
  [[nodiscard]] std::size_t place() const noexcept { return place_; }

 private:
  [[nodiscard]] double gap_of(const Eigen::Vector3d& proxy_m) const noexcept {
    return normal_.dot(proxy_m - place_m_ - compliance_m_per_n_ * spring_n_) + offset_m_;
  }

  std::size_t place_ = 0;
  bool fades_ = false;  ///< Physics does not name it any more.
  Eigen::Vector3d normal_ = Eigen::Vector3d::UnitY();
  Eigen::Vector3d told_normal_ = Eigen::Vector3d::UnitY();  ///< Where it turns to.
  Eigen::Vector3d place_m_ = Eigen::Vector3d::Zero();       ///< q.
  double compliance_m_per_n_ = 0.0;
  double friction_ = 0.0;
  double offset_m_ = 0.0;                                  ///< Added to the gap: what is still to be blended in.
  Eigen::Vector3d spring_n_ = Eigen::Vector3d::Zero();     ///< φ.
  Eigen::Vector3d impulse_n_s_ = Eigen::Vector3d::Zero();  ///< On the proxy, in the last step.
  int self_ = SolverContact::kFixed;                       ///< Its number in the step.
  std::size_t row_ = kNoRow;
};

}  // namespace haptic
