#include "drivers/phantom/phantom_config.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "drivers/usb_host/open_options.hpp"
#include "rtbus/config/vector3.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::phantom {
namespace {

using rtbus::config::Map;
using rtbus::config::Range;

Vec3 three(Map& map, std::string_view key, Range range, const Vec3& fallback) {
  return rtbus::array_of(rtbus::config::read_vector3(map, key, range, rtbus::vector_of(fallback)));
}

Model parse_model(Map& file) {
  std::vector<std::string> names;
  for (const Model& model : models()) names.emplace_back(model.key);
  const std::string name = file.choice("model", names);
  Model model = *std::find_if(models().begin(), models().end(), [&](const Model& m) { return m.key == name; });
  // The tip adapter of a Vintage PHANToM lengthens its forearm; the five-bar has no such length.
  if (!model.five_bar) model.arm.forearm_m = file.number("forearm_m", {0.05, 0.5}, model.arm.forearm_m);
  return model;
}

void parse_motors(Map& map, MotorLimits& motors) {
  motors.peak_ma = map.number("peak_a", {0.05, 5.999}, motors.peak_ma * 1e-3) * 1e3;
  motors.continuous_ma =
      map.number("continuous_a", {0.05, 5.999}, std::min(motors.continuous_ma, motors.peak_ma) * 1e-3) * 1e3;
  motors.time_constant_s = map.number("thermal_time_constant_s", {0.1, 600.0}, motors.time_constant_s);
  if (motors.continuous_ma > motors.peak_ma) map.fail("continuous_a", "exceeds motors.peak_a; lower it");
}

void parse_limits(Map& map, DeviceInfo& info) {
  info.max_force_n = map.number("max_force_n", {0.1, 20.0}, info.max_force_n);
  info.max_slew_n_per_ms = map.number("max_slew_n_per_ms", {0.01, 100.0}, info.max_slew_n_per_ms);
  info.max_stiffness_n_per_m = map.number("max_stiffness_n_per_m", {1.0, 20000.0}, info.max_stiffness_n_per_m);
  info.max_speed_m_s = map.number("max_speed_m_s", {0.05, 20.0}, info.max_speed_m_s);
  info.workspace_min_m = three(map, "workspace_min_m", {-1.0, 1.0}, info.workspace_min_m);
  info.workspace_max_m = three(map, "workspace_max_m", {-1.0, 1.0}, info.workspace_max_m);
  for (std::size_t i = 0; i < 3; ++i) {
    if (info.workspace_min_m[i] >= info.workspace_max_m[i]) {
      map.fail("workspace_max_m", "is not above limits.workspace_min_m on every axis; raise it");
    }
  }
}

// What follows from the geometry at the centre of the workspace: the force that the continuous current gives in the
// worst direction, and the largest step of the tip for one count.
void compute_info(const PhantomSettings& settings, DeviceInfo& info) {
  const Kinematics arm(settings.model);
  JointAngles centre;
  ArmPose pose;
  if (!arm.inverse(Eigen::Vector3d::Zero(), centre) || !arm.forward(centre, pose)) return;
  double most_ma_per_n = 0.0;
  double largest_step_m = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double torque_per_n = pose.jacobian_m.col(i).norm();  // of the worst direction
    most_ma_per_n = std::max(most_ma_per_n, std::abs(arm.currents_ma(torque_per_n * Eigen::Vector3d::Unit(i))[i]));
    const double rad_per_count = (arm.angles({1, 1, 1}) - arm.angles({0, 0, 0})).cwiseAbs()[i];
    largest_step_m = std::max(largest_step_m, torque_per_n * rad_per_count);
  }
  info.continuous_force_n = std::min(info.max_force_n, settings.motors.continuous_ma / most_ma_per_n);
  info.position_quantum_m = largest_step_m;
}

}  // namespace

PhantomFile read_file(Map& file) {
  PhantomFile out;
  PhantomSettings& settings = out.settings;
  settings.model = parse_model(file);
  const std::string homing = file.choice("homing", {"at_start", "button", "counters"}, "at_start");
  settings.homing = homing == "button"     ? HomingMode::kButton
                    : homing == "counters" ? HomingMode::kCounters
                                           : HomingMode::kAtStart;
  settings.home_tolerance_rad = file.number("home_tolerance_rad", {0.005, 0.3}, settings.home_tolerance_rad);
  settings.gravity_share = file.number("gravity_compensation", {0.0, 1.0}, 0.0);
  if (settings.gravity_share > 0.0 && settings.model.weight.upper_arm_kg <= 0.0) {
    file.fail("gravity_compensation",
              "is not possible: no masses are published for a " + std::string(settings.model.name) + "; leave it at 0");
  }
  if (auto motors = file.optional_map("motors")) {
    parse_motors(*motors, settings.motors);
    motors->finish();
  }
  if (settings.model.gimbal != GimbalKind::kNone) {
    if (auto gimbal = file.optional_map("gimbal")) {
      settings.gimbal_zero_rad = three(*gimbal, "zero_rad", {-3.2, 3.2}, settings.gimbal_zero_rad);
      settings.gimbal_sign = three(*gimbal, "sign", {-1.0, 1.0}, settings.gimbal_sign);
      for (const double sign : settings.gimbal_sign) {
        if (std::abs(sign) != 1.0) gimbal->fail("sign", "holds something else than 1 and -1");
      }
      gimbal->finish();
    }
  }
  DeviceInfo& info = out.info;
  info = settings.model.limits;
  info.model = std::string(settings.model.key);
  if (auto limits = file.optional_map("limits")) {
    parse_limits(*limits, info);
    limits->finish();
  }
  info.dof_sensed = settings.model.gimbal == GimbalKind::kNone ? 3 : 6;
  info.dof_actuated = 3;
  info.thermal_time_constant_s = settings.motors.time_constant_s;
  info.force_timeout_s = 0.020;
  info.can_pace_loop = true;
  info.sample_rate_hz = file.number("sample_rate_hz", {100.0, 2000.0}, 1000.0);
  out.fetch_first = file.integer("exchanges_per_period", 1, 2, 2) == 2;
  compute_info(settings, info);
  return out;
}

std::unique_ptr<DeviceConfig> parse(Map& file, const virtual_usb::Kind* virtual_kind) {
  PhantomFile read = read_file(file);
  const bool any = file.boolean("probe_any_teensy", false);
  usb::OpenOptions options = usb::parse_open_options(file, virtual_kind);
  if (options.serial.empty() && !any && !options.virtual_device) {
    file.fail("serial",
              "is missing: every Teensy program has the USB ids of these arms, and a probe makes an unknown one "
              "act on text; name the arm's controller (rtbus devices lists them), or set probe_any_teensy: true");
  }
  read.info.serial = options.serial;
  usb::IoSettings io;
  io.info = read.info;
  if (read.fetch_first) io.order = usb::ExchangeOrder::kFetchFirst;
  io.reply_timeout_s = static_cast<double>(PhantomProtocol::kReplyLostNs) * 1e-9;
  // Interface 0 is the serial line's control, 1 its data. PJRC's shared id.
  usb::DeviceMatch match{kVendorId, kProductId, options.serial, {0, 1}};
  // What is known about the counters outlives a connection.
  auto homing =
      std::make_shared<Homing>(Kinematics(read.settings.model), read.settings.homing, read.settings.home_tolerance_rad);
  return std::make_unique<usb::UsbDeviceConfig>(
      io, match, std::move(options),
      [settings = read.settings, homing] { return std::make_unique<PhantomProtocol>(settings, homing); },
      usb::UsbTooling{&inspect, {}});
}

usb::Inspection inspect(usb::Channel& channel) {
  PhantomSettings settings;
  settings.model = models().front();  // it says itself which one it is
  auto homing = std::make_shared<Homing>(Kinematics(settings.model), settings.homing, settings.home_tolerance_rad);
  return PhantomProtocol(settings, homing).inspect(channel);
}

}  // namespace drivers::phantom
