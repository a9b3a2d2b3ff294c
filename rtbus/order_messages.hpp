#pragma once
/// @file order_messages.hpp
/// What the user wants of a node while it runs: E-stop, gains, clutch, a force besides. Conventions as in messages.hpp.
#include "rtbus/messages.hpp"

namespace rtbus {

/// `<haptic>.orders`, written by `rtbus run` alone: with every order, and once a second. The newest sample is the whole
/// state, so a node that lost samples, or that was started again, obeys it too.
struct Orders {
  std::uint64_t estops = 0;         ///< E-stops ordered since the session began.
  std::uint64_t rearms = 0;         ///< Times that forces were allowed again after an E-stop.
  double stiffness_n_per_m = 0.0;   ///< Of the coupling, at the device; 0: as configured.
  double damping_n_s_per_m = -1.0;  ///< Likewise; negative: as configured.
  std::uint32_t estop = 0;          ///< 1: zero force until re-armed.
  std::uint32_t reserved = 0;
  Text<96> reason{};                       ///< Of the E-stop, for people.
  Vec3 extra_force_n{};                    ///< On the hand besides that of the method, in D …
  std::uint64_t extra_force_until_ns = 0;  ///< … until then (CLOCK_MONOTONIC), at most kLongestHold_ns ahead.
  std::uint64_t clutched_until_ns = 0;     ///< As if the clutch's button were held until then; likewise.

  /// Who wants more repeats the order: silence ends it.
  static constexpr std::uint64_t kLongestHold_ns = 1'000'000'000;
};

template <>
struct SampleTraits<Orders> {
  static constexpr std::string_view kName = "rtbus/Orders";
  using T = Orders;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, estops, "1"),
                                      RTBUS_FIELD(T, rearms, "1"),
                                      RTBUS_FIELD(T, stiffness_n_per_m, "N/m"),
                                      RTBUS_FIELD(T, damping_n_s_per_m, "N.s/m"),
                                      RTBUS_FIELD(T, estop, "bool"),
                                      RTBUS_FIELD(T, reserved, "1"),
                                      RTBUS_FIELD(T, reason, ""),
                                      RTBUS_FIELD(T, extra_force_n, "N"),
                                      RTBUS_FIELD(T, extra_force_until_ns, "ns"),
                                      RTBUS_FIELD(T, clutched_until_ns, "ns")};
};
static_assert(sizeof(Orders) == 176 && Sample<Orders>);

}  // namespace rtbus
