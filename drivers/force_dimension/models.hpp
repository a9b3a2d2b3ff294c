#pragma once
/// @file models.hpp
/// The devices of Force Dimension and what is known about their limits. The maker's data sheets were not found in
/// readable form: models.cpp names the source of each number, or "own choice".
#include <span>
#include <string_view>

#include "drivers/device.hpp"

namespace drivers::force_dimension {

struct Model {
  std::string_view name;      ///< `model:` in the device file.
  const char* product;        ///< "omega.6"
  int types[2];               ///< As dhdGetSystemType() gives them: right-handed (or only) and left-handed; −1: none.
  bool wrist = false;         ///< Orientation is sensed.
  bool active_wrist = false;  ///< Motors in wrist or gripper: their torque is commanded to zero.
  bool gripper = false;       ///< It has one, whose opening is read.
  bool calibrates_itself = true;  ///< drdAutoInit() drives it; otherwise its user moves it.
  DeviceInfo limits;
};

[[nodiscard]] std::span<const Model> models();
/// The product's name for a type; "type 81" for one that is not known.
[[nodiscard]] std::string product_of(int type);

}  // namespace drivers::force_dimension
