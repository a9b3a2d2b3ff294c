#pragma once
/// @file order_box.hpp
/// Orders of the user on their way from the housekeeping thread to the loop.
#include <atomic>
#include <cstdint>

#include <Eigen/Core>

#include "haptic_node/gains.hpp"
#include "haptic_node/latest_cell.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// What acts on the loop. An E-stop, ordered or by a button of the device, holds until the count of re-arms has grown:
/// orders that merely say nothing of it release nothing, nor do the first ones that a node hears. An E-stop that nobody
/// has counted, as the next orders say, was damage of the topic: it ends with them.
class OrderBox {
 public:
  /// @param configured Gains while none are ordered. @param extra_force_max_n Longer forces are shortened to this.
  explicit OrderBox(const Gains& configured, double extra_force_max_n = 0.0) noexcept
      : configured_(configured), extra_force_max_n_(extra_force_max_n) {
    set_gains(configured);
  }

  /// The newest orders. Housekeeping thread.
  void set(const rtbus::Orders& orders) noexcept {
    set_gains({orders.stiffness_n_per_m > 0.0 ? orders.stiffness_n_per_m : configured_.stiffness_n_per_m,
               orders.damping_n_s_per_m >= 0.0 ? orders.damping_n_s_per_m : configured_.damping_n_s_per_m});
    extra_.put({rtbus::vector_of(orders.extra_force_n), orders.extra_force_until_ns});
    clutched_until_ns_.store(orders.clutched_until_ns, std::memory_order_relaxed);
    stops_.put({orders.estop != 0, orders.estops, orders.rearms});
  }

  /// An E-stop holds. @param pressed The device's E-stop button is down. Loop, every cycle. @realtime Yes.
  [[nodiscard]] bool estopped(bool pressed) noexcept RTBUS_NONBLOCKING {
    if (Stops newest; stops_.take(newest)) heed(newest);
    by_button_ = by_button_ || pressed;
    return ordered_ || by_button_;
  }

  /// The gains that are wanted now, as ordered: not yet limited. @realtime Yes.
  [[nodiscard]] Gains wanted() const noexcept RTBUS_NONBLOCKING {
    return {stiffness_n_per_m_.load(std::memory_order_relaxed), damping_n_s_per_m_.load(std::memory_order_relaxed)};
  }

  /// An order holds the clutch. @realtime Yes.
  [[nodiscard]] bool clutched(std::uint64_t now_ns) const noexcept RTBUS_NONBLOCKING {
    return now_ns < clutched_until_ns_.load(std::memory_order_relaxed);
  }

  /// Force on the hand besides that of the method, in D; zero when its time is over. Loop, every cycle. @realtime Yes.
  [[nodiscard]] Eigen::Vector3d extra_force_n(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
    if (ExtraForce newest; extra_.take(newest)) {
      now_extra_ = newest;
      if (const double norm = newest.force_n.norm(); norm > extra_force_max_n_) {
        now_extra_.force_n *= extra_force_max_n_ / norm;
      }
    }
    return now_ns < now_extra_.until_ns ? now_extra_.force_n : Eigen::Vector3d::Zero();
  }

 private:
  struct ExtraForce {
    Eigen::Vector3d force_n = Eigen::Vector3d::Zero();
    std::uint64_t until_ns = 0;
  };
  struct Stops {
    bool estop = false;
    std::uint64_t estops = 0, rearms = 0;
  };
  void heed(const Stops& newest) noexcept RTBUS_NONBLOCKING {
    if (rearms_seen_ == kNoOrders) {
      rearms_seen_ = newest.rearms;  // where the count stood before this node was there
    } else if (newest.rearms > rearms_seen_ && newest.rearms - rearms_seen_ <= kMostRearms) {
      rearms_seen_ = newest.rearms;
      ordered_ = by_button_ = false;
    }
    if (newest.estop) {
      ordered_ = true;
    } else if (!ordered_ || newest.estops == estops_before_) {
      ordered_ = false;
      estops_before_ = newest.estops;
    }
  }
  void set_gains(const Gains& gains) noexcept {
    stiffness_n_per_m_.store(gains.stiffness_n_per_m, std::memory_order_relaxed);
    damping_n_s_per_m_.store(gains.damping_n_s_per_m, std::memory_order_relaxed);
  }

  const Gains configured_;
  const double extra_force_max_n_;
  LatestCell<ExtraForce> extra_;
  std::atomic<std::uint64_t> clutched_until_ns_{0};
  LatestCell<Stops> stops_;
  static constexpr std::uint64_t kNoOrders = ~std::uint64_t{0};  ///< Above every count that is sane.
  static constexpr std::uint64_t kMostRearms = 1000;             ///< Between two samples; more is damage.
  std::atomic<double> stiffness_n_per_m_{0.0}, damping_n_s_per_m_{0.0};
  // Loop's thread.
  std::uint64_t rearms_seen_ = kNoOrders;
  std::uint64_t estops_before_ = kNoOrders;  ///< As counted while none held.
  bool ordered_ = false, by_button_ = false;
  ExtraForce now_extra_;
};

}  // namespace haptic
