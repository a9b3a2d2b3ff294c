#pragma once
/// @file service_messages.hpp
/// The messages of Haply's Inverse Service, format 3.1 and later: texts there, JSON back. Pure functions.
///
/// The service's frame: x right, y away from the user, z up. D = (x, z, −y).
#include <array>
#include <compare>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/device.hpp"
#include "rtbus/result.hpp"

namespace drivers::haply {

/// Name of the map that holds a force: releases of the service differ, and ignore the other one in silence.
enum class ForceField : std::uint8_t { kVector, kValues };

/// What is known about a device from the service's first message.
struct Inventory {
  struct Inverse {
    std::string id;
    bool calibrated = false;
  };
  std::vector<Inverse> inverses;
  std::vector<std::string> grips;        ///< VerseGrips of any kind.
  std::vector<std::string> not_neutral;  ///< "force_scale = 0.5": settings that change what the hand feels.
};

/// One answer about one device and its grip.
struct ServiceState {
  Vec3 position_m{};    ///< The service's frame.
  Vec3 force_n{};       ///< That it renders now, the service's frame.
  Vec3 velocity_m_s{};  ///< The service's frame; not a number: the answer has none.
  bool calibrated = true;
  std::optional<Quat> grip_wxyz;  ///< The service's frame; none: no grip, or asleep.
  std::uint32_t buttons = 0;
};

/// The failure is a sentence for the user.
[[nodiscard]] rtbus::Result<Inventory, std::string> read_inventory(std::string_view json);
/// None: the device is not among the answer's (unplugged). The failure: it is no answer of this format.
[[nodiscard]] rtbus::Result<std::optional<ServiceState>, std::string> read_state(std::string_view json,
                                                                                 const std::string& device,
                                                                                 const std::string& grip);
/// Out of the answer to GET /version; none: it names no version.
struct Version {
  int major = 0, minor = 0;
  auto operator<=>(const Version&) const = default;
};
[[nodiscard]] std::optional<Version> read_version(std::string_view json);
/// A sentence for the user about a message of the event channel; empty: it says nothing that the user should know.
[[nodiscard]] std::string read_event(std::string_view json);
/// @param first The first message names this program; what is set there and later is nothing else.
/// @param force_n In the service's frame.
void write_command(std::string& out, bool first, const std::string& device, const std::string& grip,
                   std::string_view grip_kind, ForceField field, const Vec3& force_n);

[[nodiscard]] inline Vec3 from_service(const Vec3& v) noexcept { return {v[0], v[2], -v[1]}; }
[[nodiscard]] inline Vec3 to_service(const Vec3& v) noexcept { return {v[0], -v[2], v[1]}; }
[[nodiscard]] inline Quat from_service(const Quat& q) noexcept { return {q[0], q[1], q[3], -q[2]}; }

}  // namespace drivers::haply
