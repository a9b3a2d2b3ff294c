#pragma once
/// @file flow.hpp
/// Both directions of one stream pair of a link, and what is measured of them.
#include <algorithm>
#include <cstdint>
#include <mutex>
#include <span>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/network_messages.hpp"
#include "tools/link/peers.hpp"
#include "tools/link/wire.hpp"

namespace link_dds {

/// `link_out` sends, `link_in` takes; the statistics are anybody's.
struct Flow {
  Flow(PacketWriter writer, PacketReader reader) : out(writer), in(std::move(reader)) {}
  PacketWriter out;  // of link_out
  std::uint64_t sequence = 0;
  PacketReader in;  // of link_in
  NewestWins newest;

  std::mutex guard;  // for what follows
  std::uint64_t echo_ns = 0, came_ns = 0;
  ClockOffset clock;
  double round_trip_sum_s = 0.0, round_trip_max_s = 0.0;
  std::uint64_t round_trips = 0;
  rtbus::NetworkStats stats;

  void send(std::uint64_t life, std::span<const std::uint8_t> body) {
    Head head{life, ++sequence};
    {
      const std::lock_guard lock(guard);
      head.sent_ns = rtbus::monotonic_ns();
      head.echo_ns = echo_ns;
      head.held_ns = echo_ns != 0 ? head.sent_ns - came_ns : 0;
      ++stats.sent;
    }
    out.send(head, body);
  }
  /// A packet that counts has come.
  void heard(const Head& head, std::uint64_t now_ns) {
    const std::lock_guard lock(guard);
    echo_ns = head.sent_ns;
    came_ns = now_ns;
    stats.received = newest.received();
    stats.lost = newest.lost();
    stats.late = newest.late();
    if (head.echo_ns == 0 || head.held_ns > head.sent_ns || now_ns < head.echo_ns) return;
    clock.add(head.echo_ns, head.sent_ns - head.held_ns, head.sent_ns, now_ns);
    const double round_trip_s = rtbus::seconds_between(head.echo_ns, now_ns) - rtbus::seconds_between(0, head.held_ns);
    if (round_trip_s < 0.0) return;
    round_trip_sum_s += round_trip_s;
    round_trip_max_s = std::max(round_trip_max_s, round_trip_s);
    ++round_trips;
  }
  void count(std::uint64_t rtbus::NetworkStats::*which, std::uint64_t by = 1) {
    const std::lock_guard lock(guard);
    stats.*which += by;
  }
  /// Another peer: its clock is another, and so are its stamps.
  void begin_anew() {
    const std::lock_guard lock(guard);
    echo_ns = 0;
    clock.begin_anew();
  }
};

}  // namespace link_dds
