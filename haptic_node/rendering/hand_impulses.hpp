#pragma once
/// @file hand_impulses.hpp
/// The hand impulses: what the hand has given to each body, with its times. The re-simulation of an answer reads them,
/// and device_state tells them. Frame W, SI units. Fixed size, no allocation.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "haptic_node/rendering/impulse_history.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// A body has a place from when it is held until others need it: what it was given outlives its contact. Sums count
/// what the safety ladder let through. One thread. @realtime Everything.
class HandImpulses {
 public:
  static constexpr std::size_t kHeld = rtbus::kContactSlots + 5;           ///< Places that may be held at a time.
  static constexpr std::size_t kPlaces = kHeld + rtbus::kHandImpulseRows;  ///< Those, and what is still told.

  /// What the proxy gave to a body in the last step.
  struct Entry {
    std::uint32_t body = 0;                                 ///< In the scene's order.
    std::size_t place = kPlaces;                            ///< Of the body, here.
    std::size_t slot = 0;                                   ///< Of the body, in the local world.
    Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();  ///< On the body.
    Eigen::Vector3d from_centre_m = Eigen::Vector3d::Zero();
    bool moves = false;
    Impulse more;  ///< What the ladder let through beyond that.
  };

  /// @returns the place of that body, its own until release().
  std::size_t hold(std::uint32_t body) noexcept RTBUS_NONBLOCKING;
  void release(std::size_t place) noexcept { places_[place].held = false; }
  void release_all() noexcept RTBUS_NONBLOCKING;

  /// What is nearer to each other than that shares a record of the history.
  void keep_apart(std::uint64_t apart_ns) noexcept { apart_ns_ = apart_ns; }

  /// A step begins, and lasts from `began_ns` to `ends_ns`.
  void begin(std::uint64_t began_ns, std::uint64_t ends_ns) noexcept RTBUS_NONBLOCKING;
  /// In it the proxy gave that. @param impulse_n_s On the body. At most kMostEntries times in a step. What no hand can
  /// give in a step is passed over, and so is what is not finite. @param moves An impulse moves the body: of more
  /// bodies than device_state has rows for, these are told first.
  void give(std::size_t place, std::size_t slot, const Eigen::Vector3d& impulse_n_s,
            const Eigen::Vector3d& from_centre_m, bool moves) noexcept RTBUS_NONBLOCKING;
  static constexpr std::size_t kMostEntries = rtbus::kContactSlots + 4;
  static constexpr double kMostGiven_n_s = 1e3, kFarthest_m = 1e3;
  [[nodiscard]] std::span<const Entry> entries() const noexcept { return {entries_.data(), count_}; }

  /// The step is over; the bodies got `impulse_n_s` in all, which is what the safety ladder let through. What it took
  /// or added, the bodies share as they share the force: Entry::more. What it still gives when nothing is touched
  /// belongs to the body that was touched last, which has an entry then as well. What is not finite counts as nothing.
  void settle(const Eigen::Vector3d& impulse_n_s) noexcept RTBUS_NONBLOCKING;

  [[nodiscard]] const Impulse& sum(std::size_t place) const noexcept { return places_[place].sum; }
  [[nodiscard]] const ImpulseHistory& history(std::size_t place) const noexcept { return places_[place].history; }

  void tell(rtbus::DeviceState& out) const noexcept RTBUS_NONBLOCKING;

 private:
  struct Place {
    bool used = false;
    bool held = false;
    std::uint32_t body = 0;
    Impulse sum;  ///< Since the place is the body's.
    ImpulseHistory history;
  };
  /// A row of device_state.
  struct Row {
    std::size_t place = kPlaces;
    std::uint32_t generation = 0;  ///< 0: the row is free.
    std::uint64_t last_step = 0;   ///< When its body was given something …
    bool moves = false;            ///< … which moves it.
    Impulse before;                ///< Sum of the place when the row was opened.
    Eigen::Vector3d integral_n_s2 = Eigen::Vector3d::Zero();
  };

  [[nodiscard]] bool told(std::size_t place) const noexcept;
  void open_row(std::size_t place, bool moves) noexcept RTBUS_NONBLOCKING;
  void book(std::size_t place, const Impulse& impulse, bool moves) noexcept RTBUS_NONBLOCKING;

  std::array<Place, kPlaces> places_{};
  std::array<Row, rtbus::kHandImpulseRows> rows_{};
  std::array<Entry, kMostEntries> entries_{};
  std::size_t count_ = 0;
  Entry last_;  ///< Of the body that was touched last; its place is kPlaces before there is one.
  std::uint64_t began_ns_ = 0, ends_ns_ = 0;
  std::uint64_t apart_ns_ = 0;
  std::uint64_t steps_ = 0;
  std::uint32_t generations_ = 0;
};

}  // namespace haptic
