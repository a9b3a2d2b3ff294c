#pragma once
/// @file simulated_link.hpp
/// A network under the simulated clock: delay, jitter, packets that overtake each other, and losses, one by one or in
/// bursts. One seed, one run.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <iterator>
#include <optional>
#include <utility>

#include "tools/harness/random.hpp"

namespace tools {

/// Both ways of a network between a haptic node and physics.
struct NetworkOptions {
  double round_trip_s = 0.0;  ///< Mean of both ways together.
  double out_share = 0.5;     ///< Part of it on the way from the hand to physics.
  double jitter_share = 0.0;  ///< Each packet takes 1 ± this times its way's mean, drawn evenly; 0…1.
  bool reorder = true;        ///< Packets may overtake each other; false: each waits for those before it.
  double lost_share = 0.0;    ///< Of the packets of each way; 0…1, below 1 with bursts.
  double burst_s = 0.0;       ///< Mean length of an outage that loses all; 0: each packet is lost by itself.

  [[nodiscard]] bool exists() const noexcept { return round_trip_s > 0.0 || lost_share > 0.0; }
};

/// When a packet arrives, if it does. Losses in bursts are those of a line that is good or bad and changes by chance
/// (E. N. Gilbert, "Capacity of a burst-noise channel", Bell System Technical Journal 39, 1960; E. O. Elliott, ibid.
/// 42, 1963), in continuous time: the same outages whatever is sent.
class OneWay {
 public:
  OneWay(const NetworkOptions& options, double delay_s, std::uint64_t seed)
      : options_(options), delay_s_(delay_s), random_(seed) {
    bad_ = options_.burst_s > 0.0 && random_.chance(options_.lost_share);
  }

  /// Empty: lost. @param sent_ns Never earlier than the one before.
  [[nodiscard]] std::optional<std::uint64_t> arrival_ns(std::uint64_t sent_ns) {
    const double spread = options_.jitter_share > 0.0 ? options_.jitter_share * (2.0 * random_.fraction() - 1.0) : 0.0;
    if (is_lost(sent_ns)) return std::nullopt;
    std::uint64_t at_ns = sent_ns + static_cast<std::uint64_t>(std::llround(delay_s_ * (1.0 + spread) * 1e9));
    if (!options_.reorder) at_ns = std::max(at_ns, last_arrival_ns_);
    last_arrival_ns_ = at_ns;
    return at_ns;
  }

 private:
  [[nodiscard]] bool is_lost(std::uint64_t sent_ns) {
    if (options_.lost_share <= 0.0) return false;
    if (options_.burst_s <= 0.0) return random_.chance(options_.lost_share);
    // A bad line recovers at the rate 1/burst, a good one breaks so often that it is bad for lost_share of the time.
    const double since_s = 1e-9 * static_cast<double>(sent_ns - std::exchange(looked_ns_, sent_ns));
    const double remembered = std::exp(-since_s / (options_.burst_s * (1.0 - options_.lost_share)));
    bad_ = random_.chance(options_.lost_share + ((bad_ ? 1.0 : 0.0) - options_.lost_share) * remembered);
    return bad_;
  }

  NetworkOptions options_;
  double delay_s_;
  Random random_;
  bool bad_ = false;
  std::uint64_t looked_ns_ = 0;
  std::uint64_t last_arrival_ns_ = 0;
};

/// Packets under way. The newest wins: what arrives after one that was sent later is dropped.
template <class Packet>
class DelayLine {
 public:
  void send(Packet packet, std::uint64_t arrival_ns) {
    // Almost always the end.
    auto at = under_way_.end();
    while (at != under_way_.begin() && std::prev(at)->arrival_ns > arrival_ns) --at;
    under_way_.insert(at, {arrival_ns, ++sent_, std::move(packet)});
  }

  struct Arrived {
    std::uint64_t arrival_ns = 0;
    std::uint64_t number = 0;  ///< As sent, from 1.
    Packet packet;
  };
  /// The newest of those that have arrived until then; empty: nothing newer has.
  [[nodiscard]] std::optional<Arrived> take(std::uint64_t now_ns) {
    std::optional<Arrived> newest;
    while (!under_way_.empty() && under_way_.front().arrival_ns <= now_ns) {
      if (under_way_.front().number > taken_) {
        taken_ = under_way_.front().number;
        newest = std::move(under_way_.front());
      }
      under_way_.pop_front();
    }
    return newest;
  }

 private:
  std::deque<Arrived> under_way_;
  std::uint64_t sent_ = 0;
  std::uint64_t taken_ = 0;
};

}  // namespace tools
