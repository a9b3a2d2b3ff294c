#pragma once
/// @file network_messages.hpp
/// Statistics of a link to another machine, for observers. Conventions as in messages.hpp.
#include "rtbus/messages.hpp"

namespace rtbus {

/// `link.stats.HAPTIC`, 5 Hz, on both machines: the link between that haptic node and physics, as this end measures
/// it. Counters are those since the link process started.
struct NetworkStats {
  double round_trip_s = 0.0;        ///< Least of the last half second, without the time at the other end.
  double round_trip_mean_s = 0.0;   ///< Since the sample before this one.
  double round_trip_max_s = 0.0;    ///< Likewise.
  double clock_offset_s = 0.0;      ///< The other machine's CLOCK_MONOTONIC less this one's.
  double clock_error_s = 0.0;       ///< Bound of its error; 0: no estimate yet.
  std::uint64_t sent = 0;           ///< Packets.
  std::uint64_t received = 0;       ///< Packets that were used.
  std::uint64_t lost = 0;           ///< Numbers passed over: never came, or later than a newer one.
  std::uint64_t late = 0;           ///< Packets that came after a newer one, or twice: dropped.
  std::uint64_t refused = 0;        ///< Packets of peers that do not count, and broken ones.
  std::uint64_t refused_peers = 0;  ///< Times a peer was refused.
  std::uint64_t left_out = 0;       ///< Contacts and supports that did not fit into a datagram.
  std::uint64_t unknown = 0;        ///< Answers to samples that are not remembered: not sent.
  std::uint32_t connected = 0;      ///< 1: something came within the last second.
  std::uint32_t reserved = 0;
};

template <>
struct SampleTraits<NetworkStats> {
  static constexpr std::string_view kName = "rtbus/NetworkStats";
  using T = NetworkStats;
  static constexpr std::array kFields{RTBUS_FIELD(T, round_trip_s, "s"),
                                      RTBUS_FIELD(T, round_trip_mean_s, "s"),
                                      RTBUS_FIELD(T, round_trip_max_s, "s"),
                                      RTBUS_FIELD(T, clock_offset_s, "s"),
                                      RTBUS_FIELD(T, clock_error_s, "s"),
                                      RTBUS_FIELD(T, sent, "1"),
                                      RTBUS_FIELD(T, received, "1"),
                                      RTBUS_FIELD(T, lost, "1"),
                                      RTBUS_FIELD(T, late, "1"),
                                      RTBUS_FIELD(T, refused, "1"),
                                      RTBUS_FIELD(T, refused_peers, "1"),
                                      RTBUS_FIELD(T, left_out, "1"),
                                      RTBUS_FIELD(T, unknown, "1"),
                                      RTBUS_FIELD(T, connected, "1"),
                                      RTBUS_FIELD(T, reserved, "1")};
};
static_assert(sizeof(NetworkStats) == 112 && Sample<NetworkStats>);

}  // namespace rtbus
