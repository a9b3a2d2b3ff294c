// libdrivers_haply.so: the device file, and what the module exports.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/driver_module.hpp"
#include "drivers/haply/http_get.hpp"
#include "drivers/haply/line.hpp"
#include "drivers/io/io_device.hpp"
#include "drivers/vendor/device_keys.hpp"
#include "drivers/virtual_vendor/haply/service.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/vector3.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::haply {
namespace {

namespace stand_in = virtual_vendor::haply;
using rtbus::config::Map;

class Config final : public DeviceConfig {
 public:
  Config(Settings settings, DeviceInfo info, bool fetch_first, std::optional<stand_in::Settings> service)
      : settings_(std::move(settings)),
        info_(std::move(info)),
        fetch_first_(fetch_first),
        service_(std::move(service)) {}
  [[nodiscard]] const DeviceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] bool has_link() const noexcept override { return true; }
  [[nodiscard]] bool is_virtual() const noexcept override { return service_.has_value(); }
  [[nodiscard]] rtbus::Result<std::unique_ptr<Device>, DeviceFault> open(const OpenContext& context) const override {
    io::IoSettings io;
    io.info = info_;
    io.order = fetch_first_ ? io::ExchangeOrder::kFetchFirst : io::ExchangeOrder::kSendThenReceive;
    io.thread_name = "haply_io";
    io.link_name = "Inverse Service";
    const io::IoThread place{.priority = context.loop_priority + 1, .core = context.loop_core};
    auto service = service_;
    if (service) service = virtual_vendor::seen_by(*service, context);
    Settings named = settings_;
    named.owner = vendor::owner_name(context);
    if (service && service->unit.one_session) named.claim = "haply virtual " + service->unit.serial;
    return std::unique_ptr<Device>(std::make_unique<io::IoDevice>(io, place, [settings = named, service]() mutable {
      if (service) {
        auto runs = std::make_shared<stand_in::Service>(*service);
        settings.prepare = [runs] { return Settings::Ports{runs->port(), runs->events_port()}; };
      }
      return std::unique_ptr<io::Line>(std::make_unique<HaplyLine>(settings));
    }));
  }

 private:
  Settings settings_;
  DeviceInfo info_;
  bool fetch_first_;
  std::optional<stand_in::Settings> service_;
};

/// Peak force: a published ROS driver's limit of 10 N per axis, lowered to 8 N. Radius: the maker's tutorial.
/// Everything else, own choice: nothing was established.
DeviceInfo limits(bool minverse) {
  DeviceInfo out;
  out.model = minverse ? "minverse" : "inverse3";
  out.dof_sensed = 6;
  out.max_force_n = 8.0;
  out.continuous_force_n = 3.0;
  out.max_stiffness_n_per_m = 1000.0;
  out.max_slew_n_per_ms = 1.5;
  out.position_quantum_m = 20e-6;
  out.apparent_mass_kg = 0.1;
  const double radius_m = minverse ? 0.04 : 0.08;
  out.workspace_min_m = {-radius_m, -radius_m, -radius_m};
  out.workspace_max_m = {radius_m, radius_m, radius_m};
  out.can_pace_loop = true;
  out.measures_velocity = true;
  return out;
}

std::unique_ptr<DeviceConfig> parse(Map& file) {
  DeviceInfo info = limits(vendor::read_model(file, {"inverse3", "minverse"}) == "minverse");
  vendor::read_limits(file, info);
  info.sample_rate_hz = file.number("sample_rate_hz", {100.0, 4000.0}, 1000.0);
  Settings settings;
  settings.port = static_cast<int>(file.integer("port", 1, 65535, settings.port));
  settings.events_port = static_cast<int>(file.integer("events_port", 0, 65535, settings.events_port));
  settings.device = file.text("device_id", "");
  settings.grip = file.text("grip_id", "");
  info.serial = settings.device;
  settings.field = file.choice("force_field", {"auto", "vector", "values"}, "auto");
  settings.origin_m =
      rtbus::array_of(rtbus::config::read_vector3(file, "origin_m", {-0.5, 0.5}, rtbus::vector_of(settings.origin_m)));
  const bool fetch_first = file.integer("exchanges_per_period", 1, 2, 2) == 2;
  std::optional<stand_in::Settings> service;
  if (auto map = file.optional_map("virtual")) {
    service = stand_in::read(*map, info);
    map->finish();
  }
  return std::make_unique<Config>(std::move(settings), std::move(info), fetch_first, std::move(service));
}

/// Whether the service runs, and what it knows. Nothing is commanded.
std::vector<Finding> look(bool load) {
  std::vector<Finding> out;
  if (!load) return out;
  std::error_code failed;
  const bool installed = std::filesystem::exists("/etc/haply-inverse-service", failed);
  WebSocket socket;
  io::StopFlag stop;
  if (const std::string problem = socket.connect("127.0.0.1", 10001, stop); !problem.empty()) {
    out.push_back({"Haply Inverse Service", false, installed ? "installed, does not run" : "not installed",
                   installed ? "sudo systemctl start haply-inverse-service" : "install its package from Haply"});
    return out;
  }
  std::string_view text;
  if (socket.receive_first(text, stop) != WireStatus::kOk) {
    out.push_back({"Haply Inverse Service", false, "runs, sends no list of devices", "restart it"});
    return out;
  }
  const auto inventory = read_inventory(text);
  if (!inventory) return {{"Haply Inverse Service", false, "runs", inventory.error()}};
  const auto version =
      read_version(http_get("127.0.0.1", 10001, "/version", rtbus::monotonic_ns() + rtbus::kNsPerS, stop));
  out.push_back({"Haply Inverse Service", true,
                 version ? "runs, version " + std::to_string(version->major) + "." + std::to_string(version->minor)
                         : "runs, tells no version",
                 ""});
  for (const auto& each : inventory->inverses) {
    out.push_back({"Inverse3 " + each.id, each.calibrated, each.calibrated ? "calibrated" : "not calibrated",
                   each.calibrated ? "" : "touch the mark on its body with the magnet of its gimbal"});
  }
  for (const std::string& grip : inventory->grips) out.push_back({grip, true, "known", ""});
  return out;
}

}  // namespace
}  // namespace drivers::haply

RTBUS_DRIVER_MODULE_LOOK("haply", "Haply Inverse3 and VerseGrip, by the maker's Inverse Service",
                         &drivers::haply::parse, &drivers::haply::look)
