#pragma once
/// @file device_walk.hpp
/// A loop over one device for guided tools, at the device's own pace or by a timer, with the driver's housekeeping
/// beside it; and how such a tool asks.
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/device.hpp"

namespace tools {

class Walk {
 public:
  explicit Walk(drivers::Device& device);

  struct Outcome {
    std::uint64_t samples = 0;
    std::uint64_t lost = 0;
    double elapsed_s = 0.0;
  };
  /// The force for a sample [N]; true: seen enough.
  using Each = std::function<bool(const drivers::DeviceSample& sample, double elapsed_s, drivers::Vec3& force_n)>;
  /// Runs for so long, until `each` has seen enough, or until Ctrl-C; ends at zero force. What the driver has to say is
  /// printed on stderr.
  Outcome run(double seconds, const Each& each);

 private:
  drivers::Device& device_;
  std::uint64_t period_ns_;
};

/// What came of one step of a guided tool.
struct GuidedStep {
  std::string name;
  bool ok = false;
  std::string what;
};

/// Waits for the first sample: until then the driver tells what it waits for, mostly to be homed by hand.
[[nodiscard]] GuidedStep wait_until_ready(Walk& walk);

/// Tells the user what comes and waits for Enter, unless `yes`. False: Ctrl-C, or the end of the input.
[[nodiscard]] bool confirm(bool yes, const std::string& text);

void print_steps(const std::vector<GuidedStep>& steps);
[[nodiscard]] nlohmann::ordered_json steps_json(const std::vector<GuidedStep>& steps);

}  // namespace tools
