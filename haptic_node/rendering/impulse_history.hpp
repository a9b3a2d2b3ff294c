#pragma once
/// @file impulse_history.hpp
/// What the proxy has given to one body over the last while. Frame W, SI units. Fixed size, no allocation.
#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"

namespace haptic {

/// On a body, and about its centre.
struct Impulse {
  Eigen::Vector3d linear_n_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_n_m_s = Eigen::Vector3d::Zero();

  Impulse& operator+=(const Impulse& other) noexcept {
    linear_n_s += other.linear_n_s;
    angular_n_m_s += other.angular_n_m_s;
    return *this;
  }
  [[nodiscard]] Impulse operator-(const Impulse& other) const noexcept {
    return {linear_n_s - other.linear_n_s, angular_n_m_s - other.angular_n_m_s};
  }
  /// On a body that moves so.
  [[nodiscard]] double work_j(const Eigen::Vector3d& velocity_m_s,
                              const Eigen::Vector3d& angular_velocity_rad_s) const noexcept {
    return linear_n_s.dot(velocity_m_s) + angular_n_m_s.dot(angular_velocity_rad_s);
  }
  [[nodiscard]] bool is_zero() const noexcept { return linear_n_s.isZero(0.0) && angular_n_m_s.isZero(0.0); }
};

/// A ring of the sums at the ends of the steps in which something was given. In between the sum stands still. One
/// thread. @realtime everything.
class ImpulseHistory {
 public:
  /// Each tick of 1 ms has its own for three periods of physics at 5 Hz. Where four ticks shared one, what a body of 3
  /// g had got since an answer was 16 uN·s off, and it oscillated by 0.2 N.
  static constexpr std::size_t kRecords = 1024;
  static constexpr std::size_t kSpan = kRecords - 2;  ///< Between them; the newest may be short.

  void forget() noexcept RTBUS_NONBLOCKING { count_ = 0; }
  /// A step from `begin_ns` to `end_ns` brought the sum from `before` to `after`. What comes of the same step again
  /// shares a record, and so do steps that follow each other until they are `apart_ns` long together. So a push without
  /// gaps is known for kSpan times as long. Not earlier than any before.
  void add(std::uint64_t begin_ns, std::uint64_t end_ns, std::uint64_t apart_ns, const Impulse& before,
           const Impulse& after) noexcept RTBUS_NONBLOCKING;
  /// The last step gave that more, if it ended at `end_ns`.
  void correct(std::uint64_t end_ns, const Impulse& more) noexcept RTBUS_NONBLOCKING;
  /// The sum at that time, a step's share taken evenly over it. @param sum What it is now. What is older than the ring
  /// is taken for its beginning.
  [[nodiscard]] Impulse at(std::uint64_t time_ns, const Impulse& sum) const noexcept RTBUS_NONBLOCKING;
  /// When something was given first, later than that; `now_ns`: nothing was.
  [[nodiscard]] std::uint64_t first_after(std::uint64_t time_ns, std::uint64_t now_ns) const noexcept RTBUS_NONBLOCKING;

 private:
  [[nodiscard]] std::uint64_t oldest() const noexcept { return count_ > kRecords ? count_ - kRecords : 0; }
  /// Number of the first record that is later; count_: none.
  [[nodiscard]] std::uint64_t record_after(std::uint64_t time_ns) const noexcept RTBUS_NONBLOCKING;
  void put(std::uint64_t time_ns, const Impulse& sum) noexcept RTBUS_NONBLOCKING;

  // By number, modulo the ring. Between two of them the sum goes evenly, or stands still.
  std::array<std::uint64_t, kRecords> time_ns_{};
  std::array<Impulse, kRecords> sum_{};
  std::uint64_t count_ = 0;
};

}  // namespace haptic
