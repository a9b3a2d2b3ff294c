#pragma once
/// @file link_messages.hpp
/// Statistics of a device's link, for observers. Conventions as in messages.hpp.
#include "rtbus/messages.hpp"

namespace rtbus {

/// What a device over USB is doing, in LinkStats::state.
enum class LinkState : std::uint32_t {
  kStopped = 0,
  kOpening = 1,   ///< Looking for the device, or bringing it up.
  kNotReady = 2,  ///< Exchanging, but not homed: no pose, no force.
  kRunning = 3,
  kLost = 4,  ///< Gone; looked for again and again.
};

/// `<haptic>.link_stats`, 5 Hz, only with a device over USB: counters and percentiles of its link since start.
struct LinkStats {
  std::uint64_t exchanges = 0;    ///< Completed, with a valid measurement.
  std::uint64_t lost_frames = 0;  ///< Commands that no valid answer followed.
  std::uint64_t bad_frames = 0;   ///< Answers that did not decode, or that no device can give.
  std::uint64_t resyncs = 0;      ///< Times the frame boundary was searched anew.
  std::uint64_t line_errors = 0;  ///< Overrun, parity, framing or device error bits; stalls.
  std::uint64_t limited = 0;      ///< Commands lowered by motor current, heat or norm.
  std::uint64_t silences = 0;     ///< Exchanges without an answer that could be used.
  std::uint64_t late_forces = 0;  ///< Exchanges that did not wait longer for the loop and sent what there was.
  std::uint64_t timed_out = 0;    ///< Exchanges with zero force, since loop or device had been silent for too long.
  std::uint64_t withheld = 0;     ///< Forces that the driver replaced by zero; each begins a new ramp.
  std::uint64_t losses = 0;       ///< Times the device was lost after it had run.
  double sample_to_wire_p50_us = 0.0, sample_to_wire_p99_us = 0.0;  ///< Sample's arrival to its force's handing over.
  double period_p50_us = 0.0, period_p99_us = 0.0;                  ///< From one sample to the next.
  std::uint32_t state = 0;                                          ///< LinkState.
  std::uint32_t reserved = 0;
};

/// "running", "not homed", … for people.
[[nodiscard]] constexpr const char* to_string(LinkState state) noexcept {
  switch (state) {
    case LinkState::kStopped:
      return "stopped";
    case LinkState::kOpening:
      return "opening";
    case LinkState::kNotReady:
      return "not homed";
    case LinkState::kRunning:
      return "running";
    case LinkState::kLost:
      return "lost";
  }
  return "unknown";
}

template <>
struct SampleTraits<LinkStats> {
  static constexpr std::string_view kName = "rtbus/LinkStats";
  using T = LinkStats;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, exchanges, "1"),
                                      RTBUS_FIELD(T, lost_frames, "1"),
                                      RTBUS_FIELD(T, bad_frames, "1"),
                                      RTBUS_FIELD(T, resyncs, "1"),
                                      RTBUS_FIELD(T, line_errors, "1"),
                                      RTBUS_FIELD(T, limited, "1"),
                                      RTBUS_FIELD(T, silences, "1"),
                                      RTBUS_FIELD(T, late_forces, "1"),
                                      RTBUS_FIELD(T, timed_out, "1"),
                                      RTBUS_FIELD(T, withheld, "1"),
                                      RTBUS_FIELD(T, losses, "1"),
                                      RTBUS_FIELD(T, sample_to_wire_p50_us, "us"),
                                      RTBUS_FIELD(T, sample_to_wire_p99_us, "us"),
                                      RTBUS_FIELD(T, period_p50_us, "us"),
                                      RTBUS_FIELD(T, period_p99_us, "us"),
                                      RTBUS_FIELD(T, state, "1"),
                                      RTBUS_FIELD(T, reserved, "1")};
};
static_assert(sizeof(LinkStats) == 128 && Sample<LinkStats>);

}  // namespace rtbus
