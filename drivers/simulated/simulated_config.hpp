#pragma once
/// @file simulated_config.hpp
/// The device file of the simulated device (`driver: simulated`), checked. Every key is explained in
/// config/devices/sim_phantom_desktop.yaml.
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/device.hpp"
#include "drivers/device_config.hpp"
#include "drivers/simulated/hand.hpp"
#include "drivers/simulated/mechanics.hpp"
#include "rtbus/config/document.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::simulated {

/// Everything a simulated device is made from.
struct SimulatedSettings {
  MechanicsParameters mechanics;
  Hand hand;
  DeviceInfo info;
  double sample_rate_hz = 1000.0;  ///< Of the device's own sampling, for `clock: device`.
  double plant_rate_hz = 4000.0;   ///< Of the plant process's loop.
  bool own_process = false;
  std::vector<std::string> warnings;  ///< See DeviceConfig::warnings().

  [[nodiscard]] std::uint64_t force_timeout_ns() const noexcept {
    return static_cast<std::uint64_t>(info.force_timeout_s * 1e9 + 0.5);
  }
};

/// A checked device file of `driver: simulated`.
class SimulatedConfig final : public DeviceConfig {
 public:
  explicit SimulatedConfig(SimulatedSettings settings) : settings_(std::move(settings)) {}

  [[nodiscard]] const DeviceInfo& info() const noexcept override { return settings_.info; }
  [[nodiscard]] bool own_process() const noexcept override { return settings_.own_process; }
  [[nodiscard]] std::vector<std::string> warnings() const override { return settings_.warnings; }
  [[nodiscard]] std::optional<Vec3> start_position_m() const override {
    return rtbus::array_of(settings_.mechanics.start_position_m);
  }
  /// A SimulatedDevice, or with `process: own` a PlantLink to the plant process of `context.node_name`.
  [[nodiscard]] rtbus::Result<std::unique_ptr<Device>, DeviceFault> open(const OpenContext& context) const override;

  [[nodiscard]] const SimulatedSettings& settings() const noexcept { return settings_; }

 private:
  SimulatedSettings settings_;
};

/// Reads what follows `schema` and `driver` in a device file. Throws rtbus::config::Error.
[[nodiscard]] std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file);

/// Reads the `hand:` map. `start_m` becomes the point where the script begins; it stays as it is without a hand.
/// Throws rtbus::config::Error.
[[nodiscard]] Hand parse_hand(rtbus::config::Map& map, Eigen::Vector3d& start_m);

}  // namespace drivers::simulated
