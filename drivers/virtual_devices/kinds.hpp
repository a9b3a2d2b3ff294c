#pragma once
/// @file kinds.hpp
/// The virtual USB devices of this build, one row each in kinds.cpp. `usb: {virtual: …}` in a device file and
/// `rtbus virtual-device KIND` make them.
#include <span>
#include <string_view>

#include "drivers/virtual_usb/kind.hpp"

namespace drivers::virtual_usb {

[[nodiscard]] std::span<const Kind> kinds() noexcept;
/// Null when there is no row of that name.
[[nodiscard]] const Kind* find_kind(std::string_view name) noexcept;

}  // namespace drivers::virtual_usb
