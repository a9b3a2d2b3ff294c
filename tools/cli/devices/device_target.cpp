#include "tools/cli/devices/device_target.hpp"
#include "tools/cli/common/find_config.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "drivers/usb_module/usb_module.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/document.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/devices/vendor_devices.hpp"

namespace tools {

namespace {

using drivers::usb::FoundDevice;

constexpr const char* kPreloaded = "RTBUS_PRELOADED";

/// A virtual device in this process needs its library in front of the C library: starts this program once more, so.
void restart_with(const std::string& library) {
  if (library.empty() || std::getenv(kPreloaded) != nullptr) return;
  // A sanitizer's run-time has to stay the first library.
  const char* const before = std::getenv("LD_PRELOAD");
  const std::string preload =
      (before == nullptr ? "" : std::string(before) + ":") + folder_of_this_program() + "/" + library;
  ::setenv(kPreloaded, "1", 1);
  ::setenv("LD_PRELOAD", preload.c_str(), 1);
  std::ifstream in("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> words;
  for (std::string word; std::getline(in, word, '\0');) words.push_back(word);
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  ::execv("/proc/self/exe", arguments.data());
}

std::unique_ptr<drivers::DeviceConfig> read_file(const std::string& file, const std::vector<std::string>& assignments) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto map = rtbus::config::load(file, overrides);
  return drivers::parse_device(map);
}

/// The same for a file that exists in memory alone; its messages name `name`.
std::unique_ptr<drivers::DeviceConfig> read_text(const std::string& yaml, const std::string& name,
                                                 const std::vector<std::string>& assignments) {
  const int fd = ::memfd_create("device", MFD_CLOEXEC);
  const std::string file = "/proc/self/fd/" + std::to_string(fd);
  if (fd < 0 || ::write(fd, yaml.data(), yaml.size()) != static_cast<ssize_t>(yaml.size())) {
    throw rtbus::config::Error("no memory for the settings of the device");
  }
  try {
    auto config = read_file(file, assignments);
    ::close(fd);
    return config;
  } catch (const rtbus::config::Error& error) {
    ::close(fd);
    std::string text = error.what();
    // "/proc/self/fd/5:2: model is missing …"
    if (text.starts_with(file)) text = name + text.substr(std::min(text.find(' '), text.size()));
    throw rtbus::config::Error(text + " (by --set KEY=VALUE, or name a device file instead of an ID)");
  }
}

/// `driver:` of a device file.
std::string driver_in(const std::string& file) {
  auto map = rtbus::config::load(file);
  return map.has_map("driver") ? "" : map.text("driver", "");
}

std::string listed(const std::vector<FoundDevice>& devices) {
  std::string out;
  for (const FoundDevice& device : devices) {
    if (device.driver.empty()) continue;
    out += (out.empty() ? "" : ", ") + device.usb_id() + (device.serial.empty() ? "" : ":" + device.serial);
  }
  return out;
}

}  // namespace

void add_target_options(rtbus::Command command, TargetOptions& options) {
  command.option("device", options.device, "Device file, or the USB ID, serial or driver that `rtbus devices` shows")
      .required()
      .type_name("FILE|ID");
  command.option("--set", options.assignments, "Change a key of the device file").take_all().type_name("KEY=VALUE");
  command
      .option("--virtual", options.virtual_files,
              "Look for the ID among the virtual devices of these device files, not on the bus")
      .take_all()
      .type_name("FILE");
}

std::vector<std::unique_ptr<drivers::DeviceConfig>> read_virtual_files(const std::vector<std::string>& files) {
  std::vector<std::unique_ptr<drivers::DeviceConfig>> out;
  for (const std::string& file : files) {
    auto config = read_file(file, {});
    if (!config->is_virtual()) {
      throw rtbus::config::Error(file + ": has no virtual device; give it usb: {virtual: …}, or virtual: {…}");
    }
    restart_with(config->preload());
    out.push_back(std::move(config));
  }
  return out;
}

drivers::usb::FoundDevices find_devices(drivers::usb::ListRequest request,
                                        const std::vector<std::string>& virtual_files) {
  const auto configs = read_virtual_files(virtual_files);
  std::vector<FoundDevice> in_order;  // one per file
  for (const auto& config : configs) {
    if (config->uses_usb()) request.virtual_devices.push_back(config.get());
  }
  drivers::usb::FoundDevices out;
  if (virtual_files.empty() || !request.virtual_devices.empty()) {
    if (const auto module = drivers::usb::load_usb_module()) {
      out = (*module)->list(request);
    } else {
      out.problem = "looking for USB devices " + module.error();
    }
  }
  if (virtual_files.empty()) {
    add_vendor_devices(out.devices);
    return out;
  }
  std::size_t next = 0;
  for (std::size_t i = 0; i < configs.size(); ++i) {
    if (configs[i]->uses_usb()) {
      if (next < out.devices.size()) in_order.push_back(std::move(out.devices[next++]));
    } else {
      in_order.push_back(describe_stand_in(*configs[i], driver_in(virtual_files[i])));
    }
  }
  out.devices = std::move(in_order);
  return out;
}

rtbus::Result<DeviceTarget, std::string> find_target(const TargetOptions& options) {
  DeviceTarget out;
  const auto use_file = [&](const std::string& file) {
    out.file = file;
    out.config = read_file(file, options.assignments);
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    out.yaml = text.str();
    restart_with(out.config->preload());
  };
  if (options.virtual_files.empty() && (std::filesystem::exists(options.device) || options.device.ends_with(".yaml"))) {
    use_file(options.device);
    return out;
  }
  const drivers::usb::FoundDevices found = find_devices({}, options.virtual_files);
  if (!found.problem.empty() && found.devices.empty()) return rtbus::Failure{"no USB here: " + found.problem};
  std::vector<std::size_t> matching;
  for (std::size_t i = 0; i < found.devices.size(); ++i) {
    if (!found.devices[i].driver.empty() && found.devices[i].is(options.device)) matching.push_back(i);
  }
  const std::string there = listed(found.devices);
  if (matching.empty()) {
    return rtbus::Failure{"no file and no device is called " + options.device + "; " +
                          (there.empty() ? "no haptic device is plugged in (rtbus devices --all shows everything)"
                                         : "there is: " + there)};
  }
  if (matching.size() > 1) {
    return rtbus::Failure{options.device + " is the ID of several devices; name one of " + there};
  }
  const FoundDevice& device = found.devices[matching.front()];
  if (!options.virtual_files.empty()) {
    use_file(options.virtual_files[matching.front()]);
    return out;
  }
  out.file = "device " + device.usb_id() + (device.serial.empty() ? "" : ":" + device.serial);
  out.yaml = "schema: device/1\ndriver: " + device.driver + "\n";
  const bool own_serial = device.driver == "falcon" || device.driver == "phantom";  // the makers' libraries have others
  if (own_serial && !device.serial.empty()) out.yaml += "serial: \"" + device.serial + "\"\n";
  out.config = read_text(out.yaml, out.file + ":", options.assignments);
  return out;
}

rtbus::Result<void, drivers::DeviceFault> start_device(drivers::Device& device) {
  std::atomic<bool> done{false};
  std::thread watch([&] {
    while (!done.load()) {
      if (interrupted()) device.cancel_start();
      rtbus::sleep_until(rtbus::monotonic_ns() + 20 * rtbus::kNsPerMs);
    }
  });
  auto started = device.start(rtbus::monotonic_ns());
  done.store(true);
  watch.join();
  return started;
}

}  // namespace tools
