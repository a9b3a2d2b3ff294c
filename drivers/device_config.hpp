#pragma once
/// @file device_config.hpp
/// A device file that has been read and checked: what a driver's parse() returns.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/device.hpp"
#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"

namespace drivers {

/// What a driver may need to know besides its own file.
struct OpenContext {
  rtbus::Session session;  ///< For drivers that talk over the bus (a plant in its own process).
  std::string node_name;   ///< "haptic0"
  int loop_priority = 80;  ///< SCHED_FIFO priority of the loop; an I/O thread runs one above it.
  int loop_core = -1;      ///< Core of the loop; −1: the last one this process may use.
};

/// A checked device file, ready to be opened: reading the file and touching the hardware are two steps, so that a wrong
/// file is found before anything starts.
class DeviceConfig {
 public:
  virtual ~DeviceConfig() = default;
  /// Limits and model as the file gives them, before any hardware was asked.
  [[nodiscard]] virtual const DeviceInfo& info() const noexcept = 0;
  /// About what the file allows and hardly means: sentences for the user, each with its place, cause and remedy.
  [[nodiscard]] virtual std::vector<std::string> warnings() const { return {}; }
  /// p_DT at the start [m]; none: the file cannot know.
  [[nodiscard]] virtual std::optional<Vec3> start_position_m() const { return std::nullopt; }
  /// True when the driver wants a second process that must be started first (`process: own`).
  [[nodiscard]] virtual bool own_process() const noexcept { return false; }
  /// True when opening it maps libusb and starts an I/O thread.
  [[nodiscard]] virtual bool uses_usb() const noexcept { return false; }
  /// True when an I/O thread or a vendor's thread runs the device: it paces the loop unless the session says otherwise,
  /// and the statistics of its link are published.
  [[nodiscard]] virtual bool has_link() const noexcept { return uses_usb(); }
  /// True when the device of this file is a stand-in without hardware (`virtual:`).
  [[nodiscard]] virtual bool is_virtual() const noexcept { return !preload().empty(); }
  /// File name of a library, beside the programs, that the node's process must have in LD_PRELOAD; empty: none.
  [[nodiscard]] virtual std::string preload() const { return {}; }
  [[nodiscard]] virtual rtbus::Result<std::unique_ptr<Device>, DeviceFault> open(const OpenContext& context) const = 0;
};

}  // namespace drivers
