#pragma once
/// @file held_force.hpp
/// The forces that acted on the hand: each from its own write to the next.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// The last kEntries forces. Samples may come late, in bursts or less often than cycles: the impulse between two of
/// them is that of the forces that really acted then. @realtime Yes, all of it; bounded by kEntries.
class HeldForce {
 public:
  static constexpr std::size_t kEntries = 64;

  /// @param limit_s The device's time-out: no force is held for longer.
  explicit HeldForce(double limit_s) noexcept : limit_s_(limit_s) {}

  /// `force_n` acts from `time_ns` on.
  void write(std::uint64_t time_ns, const Eigen::Vector3d& force_n) noexcept RTBUS_NONBLOCKING {
    entries_[written_++ % kEntries] = {time_ns, force_n};
  }
  /// The last force was not sent.
  void revoke() noexcept RTBUS_NONBLOCKING {
    if (written_ > 0) entries_[(written_ - 1) % kEntries].force_n.setZero();
  }

  /// ∫F dt from `from_ns` to `to_ns` [N·s].
  [[nodiscard]] Eigen::Vector3d impulse_n_s(std::uint64_t from_ns,
                                            std::uint64_t to_ns) const noexcept RTBUS_NONBLOCKING {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    std::uint64_t end_ns = to_ns;
    // From the newest entry back to the one that was acting at from_ns.
    for (std::size_t back = 0; back < std::min<std::uint64_t>(written_, kEntries) && end_ns > from_ns; ++back) {
      const Entry& entry = entries_[(written_ - 1 - back) % kEntries];
      if (entry.time_ns >= end_ns) continue;
      const std::uint64_t dies_ns = entry.time_ns + static_cast<std::uint64_t>(limit_s_ * 1e9);
      const std::uint64_t begin_ns = std::max(entry.time_ns, from_ns);
      if (const std::uint64_t until_ns = std::min(end_ns, dies_ns); until_ns > begin_ns) {
        sum += entry.force_n * rtbus::seconds_between(begin_ns, until_ns);
      }
      end_ns = begin_ns;
    }
    return sum;
  }

 private:
  struct Entry {
    std::uint64_t time_ns = 0;
    Eigen::Vector3d force_n = Eigen::Vector3d::Zero();
  };
  double limit_s_;
  std::array<Entry, kEntries> entries_{};
  std::uint64_t written_ = 0;
};

}  // namespace haptic
