#pragma once
/// @file bench.hpp
/// Whoever stands at the bench of a virtual USB device: makes its faults begin while a session runs, and watches what
/// the hand feels, published as the simulated plant publishes it (`<node>.plant_state`, 1000 times a second).
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "drivers/simulated/mechanics.hpp"
#include "drivers/virtual_usb/kind.hpp"
#include "drivers/virtual_usb/usbfs_shim.hpp"
#include "rtbus/config/document.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/segment.hpp"

namespace drivers::virtual_usb {

struct BenchSettings {
  Faults faults;
  FaultTimes times;
  bool publish_state = false;
};

/// Reads `faults` and `publish_state`. Throws rtbus::config::Error.
[[nodiscard]] BenchSettings parse_bench(rtbus::config::Map& settings);

class Bench {
 public:
  /// Both run while the device stands still.
  struct Model {
    std::function<void(const Faults&)> play;                                ///< Has these faults from now on.
    std::function<const simulated::Mechanics&(std::uint64_t now_ns)> look;  ///< Lets its time pass.
  };

  Bench(const BenchSettings& settings, Model model, UsbfsPort& port, rtbus::Session session, std::string node);
  ~Bench();
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;

 private:
  void run();
  void follow_trigger(std::uint64_t now_ns);
  void make_well();

  const BenchSettings settings_;
  const Model model_;
  UsbfsPort& port_;
  const rtbus::Session session_;
  const std::string node_;
  std::uint64_t triggered_ns_ = 0;
  bool over_ = false, unplugged_ = false, replugged_ = false;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

/// The device with somebody at its bench. With a trigger it has no faults until then. Models tell their `faults()`, and
/// by `at(now_ns)` their mechanics.
template <class Device>
[[nodiscard]] VirtualDevice on_bench(std::unique_ptr<Device> device, const BenchSettings& settings) {
  VirtualDevice out;
  const bool waits = !settings.times.trigger.empty();
  if (!waits) out.faults = settings.faults;
  if (waits || settings.publish_state) {
    Device* const seen = device.get();
    out.watch = [seen, settings](UsbfsPort& port, const rtbus::Session& session, const std::string& node) {
      const Bench::Model model{
          [seen](const Faults& faults) { seen->faults() = faults; },
          [seen](std::uint64_t now_ns) -> const simulated::Mechanics& { return seen->at(now_ns); }};
      return std::shared_ptr<void>(std::make_shared<Bench>(settings, model, port, session, node));
    };
  }
  out.device = std::move(device);
  return out;
}

}  // namespace drivers::virtual_usb
