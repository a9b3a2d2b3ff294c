#pragma once
/// @file other_hands.hpp
/// What the other hands of a session do to bodies that this one touches, from their newest DeviceState. Frame W, SI
/// units. Fixed size once it is made.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic_node/rendering/impulse_history.hpp"
#include "haptic_node/rendering/method.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/longest_gap.hpp"
#include "rtbus/messages.hpp"

namespace haptic {

/// Two hands at one body are springs to each other. An answer of physics knows the other hand as it was one or two
/// periods ago; its DeviceState knows it as of its last tick. So the impulses of the other hand are booked like the own
/// ones: a body receives them tick by tick, and from the instant of an answer it is replayed with all that physics did
/// not have by then (ProxyContacts::hand_time_ns). In the tick that is running the other hand is taken to push as in
/// its last one, and the next tick puts that right. (Without it a block between two hands that push equally would get
/// the own impulse of each tick before the other one, and drift away from the own hand.)
///
/// A hand that is not heard goes on for a tick more than it was silent of late (at most 5 ms): a message that is lost,
/// or a late loop, must not take its push from a body and give it back in the next tick. A gram gains 0.3 m/s by 0.3 N
/// in 1 ms. Where no message is lost these are two ticks, so that the end of a hand is felt within 3 ms. After three
/// times as long it has ended, and what it was taken to give is taken back. One thread. @realtime everything but the
/// constructor.
class OtherHands {
 public:
  explicit OtherHands(std::size_t hands) : hands_(hands) {}

  /// What is nearer to each other than that shares a record of the history.
  void keep_apart(std::uint64_t apart_ns) noexcept { apart_ns_ = apart_ns; }

  /// Reads what is new, and hands what each body gets in the tick of the own sample `now_ns` to `give(body, Impulse)`.
  template <class Give>
  void hear(std::span<const OtherHand> hands, std::uint64_t now_ns, Give&& give) noexcept {
    for (std::size_t i = 0; i < std::min(hands.size(), hands_.size()); ++i) {
      if (hands[i].fresh) learn(hands_[i], hands[i], apart_ns_);
      for (Row& row : hands_[i].rows) {
        if (row.generation == 0) continue;
        const Impulse more = book(hands_[i], row, now_ns);
        if (!more.is_zero()) give(row.body, more);
      }
    }
  }

  /// Of one answer and one body: what all of them have given it between the answer's instant and a time.
  class Since {
   public:
    /// @param others,answer Outlive this.
    Since(const OtherHands& others, const rtbus::ProxyContacts& answer, std::uint32_t body) noexcept
        : others_(others), answer_(answer), body_(body) {}
    /// There is no other hand.
    [[nodiscard]] bool none() const noexcept { return others_.hands_.empty(); }
    [[nodiscard]] Impulse until(std::uint64_t time_ns) const noexcept RTBUS_NONBLOCKING;
    /// Until the tick that is running, without what that gives.
    [[nodiscard]] Impulse until_now() const noexcept RTBUS_NONBLOCKING;

   private:
    template <class At>
    [[nodiscard]] Impulse sum(At&& at) const noexcept;
    const OtherHands& others_;
    const rtbus::ProxyContacts& answer_;
    std::uint32_t body_;
  };

 private:
  /// What one hand has given to one body since that took the row.
  struct Row {
    std::uint32_t body = 0;
    std::uint32_t generation = 0;   ///< 0: unused.
    Impulse told;                   ///< As its DeviceState has it.
    Impulse given;                  ///< The same, from when it is heard here.
    Impulse last;                   ///< In its last tick.
    Impulse booked, booked_before;  ///< With what it is taken to give meanwhile: in this tick, and in the one before.
    ImpulseHistory history;

    void begin(std::uint32_t for_body, std::uint32_t of_generation) noexcept RTBUS_NONBLOCKING;
  };
  struct Hand {
    std::uint32_t number = 0;  ///< In the session's order.
    std::uint32_t mapping_epoch = 0;
    std::uint64_t time_ns = 0;   ///< Of its newest sample; 0: none yet.
    std::uint64_t until_ns = 0;  ///< Its impulses are known so far: beyond a sample that its device repeats.
    std::uint64_t tick_ns = 0;   ///< In this time it gave the last of them.
    rtbus::LongestGap gap;
    std::array<Row, rtbus::kHandImpulseRows> rows;
  };
  static void learn(Hand& hand, const OtherHand& heard, std::uint64_t apart_ns) noexcept RTBUS_NONBLOCKING;
  static void learn_row(Hand& hand, std::size_t index, const rtbus::DeviceState& state,
                        std::uint64_t apart_ns) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] static Impulse book(const Hand& hand, Row& row, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  std::vector<Hand> hands_;
  std::uint64_t apart_ns_ = 0;
};

}  // namespace haptic
