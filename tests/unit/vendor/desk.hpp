#pragma once
/// @file desk.hpp
/// A vendor's device on its stand-in, opened as the node opens it, and a loop that it paces. In real time.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>

#include <unistd.h>

#include "drivers/registry/registry.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace tests {

/// Reads a device file that is written in flow style. Throws rtbus::config::Error.
inline std::unique_ptr<drivers::DeviceConfig> parse_device(const std::string& yaml) {
  const auto path = std::filesystem::temp_directory_path() / ("rtbus-vendor-" + std::to_string(::getpid()) + ".yaml");
  std::ofstream(path) << yaml << "\n";
  struct Remove {
    std::filesystem::path path;
    ~Remove() { std::filesystem::remove(path); }
  } remove{path};
  auto file = rtbus::config::load(path.string());
  return drivers::parse_device(file);
}

/// What parsing or opening or starting says; empty: all of them succeed.
inline std::string problem_of(const std::string& yaml) {
  try {
    auto device = parse_device(yaml)->open({});
    if (!device) return device.error().message;
    const auto started = (*device)->start(rtbus::monotonic_ns());
    (*device)->stop();
    return started ? "" : started.error().message;
  } catch (const rtbus::config::Error& error) {
    return error.what();
  }
}

/// A file that begins as a library for 32-bit ARM does: enough for the loader to refuse it.
struct ForeignLibrary {
  ForeignLibrary() {
    std::ofstream(file, std::ios::binary) << std::string(
                                                 "\x7f"
                                                 "ELF\x01\x01\x01",
                                                 7)
                                          << std::string(57, '\0');
  }
  ~ForeignLibrary() { std::filesystem::remove(file); }
  const std::string file =
      (std::filesystem::temp_directory_path() / ("rtbus-arm-" + std::to_string(::getpid()) + ".so")).string();
};

/// Faults of a stand-in that come when the test says so: their times count from pull(). Before that a test can wait for
/// whatever has to be there first.
class Trigger {
 public:
  Trigger() { std::filesystem::remove(file_); }
  ~Trigger() { std::filesystem::remove(file_); }
  Trigger(const Trigger&) = delete;
  Trigger& operator=(const Trigger&) = delete;
  /// The key `faults` of a stand-in, with more keys of that map.
  [[nodiscard]] std::string key(const std::string& more = "") const {
    return "faults: {trigger: " + file_ + (more.empty() ? "" : ", " + more) + "}";
  }
  void pull() const { std::ofstream(file_) << "now"; }

 private:
  const std::string file_ =
      (std::filesystem::temp_directory_path() / ("rtbus-trigger-" + std::to_string(::getpid()))).string();
};

struct Desk {
  explicit Desk(const std::string& yaml) : config(parse_device(yaml)), device(std::move(*config->open({}))) {}
  ~Desk() { device->stop(); }

  /// Brings the device up. @returns what is wrong; empty: nothing.
  std::string start() {
    const auto started = device->start(rtbus::monotonic_ns());
    return started ? "" : started.error().message;
  }

  using Law = std::function<drivers::Vec3(const drivers::DeviceSample&)>;

  /// One cycle of a loop that the device paces. True: the device answered and took the force of the law.
  bool cycle(const Law& law) {
    if (device->wait_sample(rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs) == drivers::IoStatus::kLost) {
      rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs);
    }
    if (++cycles % 20 == 0) device->maintain();
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    read = device->read(now_ns, sample);
    wrote = device->write(now_ns, {read == drivers::IoStatus::kLost ? drivers::Vec3{} : law(sample)});
    said += device->take_notice();
    return read != drivers::IoStatus::kLost && wrote == drivers::IoStatus::kOk;
  }
  /// Cycles until `done` or for so long. @returns whether it was done.
  bool until(double seconds, const drivers::Vec3& force_n, const std::function<bool()>& done) {
    // Like a node's loop, where that is permitted: at ordinary priority a busy machine lets each force come too late.
    const rtbus::ThreadScheduling ordinary;
    (void)rtbus::enter_realtime({.priority = 80, .lock_memory = false, .hold_dma_latency = false});
    bool came = false;
    const std::uint64_t end_ns = rtbus::monotonic_ns() + rtbus::ns_of(seconds);
    while (!came && rtbus::monotonic_ns() < end_ns) {
      answered = cycle([&](const drivers::DeviceSample&) { return force_n; });
      came = done();
    }
    ordinary.restore();
    return came;
  }
  bool ready(double seconds = 5.0) {
    return until(seconds, {}, [&] { return answered; });
  }
  /// Cycles until a notice with this text has come.
  bool says(const std::string& text, double seconds = 5.0, const drivers::Vec3& force_n = {}) {
    return until(seconds, force_n, [&] { return said.find(text) != std::string::npos; });
  }
  /// The tip moves by more than `way_m` along x within the time.
  bool moves(const drivers::Vec3& force_n, double way_m, double seconds) {
    const double from_m = sample.position_m[0];
    return until(seconds, force_n, [&] { return std::abs(sample.position_m[0] - from_m) > way_m; });
  }

  std::unique_ptr<drivers::DeviceConfig> config;
  std::unique_ptr<drivers::Device> device;
  drivers::DeviceSample sample;
  drivers::IoStatus read = drivers::IoStatus::kLost, wrote = drivers::IoStatus::kLost;
  bool answered = false;
  int cycles = 0;
  std::string said;  ///< All notices so far.
};

}  // namespace tests
