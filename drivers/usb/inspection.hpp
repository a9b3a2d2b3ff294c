#pragma once
/// @file inspection.hpp
/// Queries a device's state without changing it: nothing is loaded, homed or moved, every command is zero.
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drivers/usb/channel.hpp"

namespace drivers::usb {

/// What a device says about itself. Texts are for people; an empty one is not known.
struct Inspection {
  std::string model;     ///< "Vintage PHANToM"
  std::string firmware;  ///< "runs", "none runs", …
  std::string homing;    ///< "homed", "not homed", …
  std::string remedy;    ///< What to do next; empty: nothing.
  bool answered = false;
  bool homed = false;                    ///< It says so, or its counters are those of its home pose.
  std::vector<std::int32_t> counters;    ///< Motor encoders as they came.
  std::vector<double> stylus_angle_rad;  ///< Of a sensed stylus, as the sensors show them; empty: none is sensed.
  std::string model_key;                 ///< `model:` of the device file, where the driver has several.
  std::string home;                      ///< Its home pose in words, "with the upper arm …".
};

using Inspector = std::function<Inspection(Channel& channel)>;

/// A device that is open for a query, exclusively. One thread.
class Probe {
 public:
  virtual ~Probe() = default;
  [[nodiscard]] virtual Inspection ask() = 0;
};

}  // namespace drivers::usb
