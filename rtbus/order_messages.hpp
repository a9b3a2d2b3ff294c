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

/// What becomes of a kinematic body.
enum class BodyOrder : std::uint32_t { kStay = 0, kPose = 1, kTwist = 2 };

/// `physics.body_orders`, written by `rtbus run` alone, in a scene with bodies that orders move: with every order, and
/// once a second. The newest sample is the whole state.
struct BodyOrders {
  static constexpr std::size_t kBodies = 8;
  std::uint64_t orders = 0;  ///< Since the session began.
  std::uint32_t count = 0;   ///< Rows in use.
  std::uint32_t reserved = 0;
  std::array<std::uint32_t, kBodies> body{};      ///< In the scene's order.
  std::array<std::uint32_t, kBodies> order{};     ///< BodyOrder.
  std::array<std::uint64_t, kBodies> until_ns{};  ///< Then it stays where it is (CLOCK_MONOTONIC); as in Orders.
  std::array<Vec3, kBodies> position_m{};         ///< p_WB to go to.
  std::array<Quat, kBodies> orientation_wxyz{};
  std::array<Vec3, kBodies> velocity_m_s{};  ///< v_WB to move at.
  std::array<Vec3, kBodies> angular_velocity_rad_s{};
};

template <>
struct SampleTraits<BodyOrders> {
  static constexpr std::string_view kName = "rtbus/BodyOrders";
  using T = BodyOrders;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{
      RTBUS_FIELD(T, orders, "1"),         RTBUS_FIELD(T, count, "1"),
      RTBUS_FIELD(T, reserved, "1"),       RTBUS_FIELD(T, body, "1"),
      RTBUS_FIELD(T, order, "1"),          RTBUS_FIELD(T, until_ns, "ns"),
      RTBUS_FIELD(T, position_m, "m"),     RTBUS_FIELD(T, orientation_wxyz, "1"),
      RTBUS_FIELD(T, velocity_m_s, "m/s"), RTBUS_FIELD(T, angular_velocity_rad_s, "rad/s")};
};
static_assert(sizeof(BodyOrders) == 976 && Sample<BodyOrders>);

}  // namespace rtbus
