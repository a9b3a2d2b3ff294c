#pragma once
/// @file plant.hpp
/// The loop of a plant process: mechanics and hand that live on when the haptic node is killed or starved, as hardware
/// does, so that it can be seen what the hand feels then.
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "drivers/simulated/mechanics.hpp"
#include "drivers/simulated/simulated_config.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/result.hpp"
#include "rtbus/subscription.hpp"

namespace drivers::simulated {

/// Life: create() → run_until() on the loop's thread, maintain() meanwhile on another → destruction unlinks the topic.
class Plant {
 public:
  /// Two seconds of states at 4 kHz, so that a reader can follow in order.
  static constexpr std::uint32_t kStatesKept = 8192;

  /// Publishes on `<node>.plant_state`, obeys `<node>.plant_command`. @realtime No.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<Plant>, rtbus::TopicError> create(
      const SimulatedSettings& settings, const rtbus::Session& session, const std::string& node_name);

  /// Cycles at `plant_rate_hz` until `stop` is true. A force acts for force_timeout_ms after its command was stamped,
  /// however late it was read. The hand's script begins with the first command: nobody takes a device in hand before
  /// its software runs.
  void run_until(const std::atomic<bool>& stop) noexcept;

  /// Looks for the haptic node's topic, and makes its own anew when it was deleted; about every 20 ms, on another
  /// thread. @realtime No.
  void maintain() noexcept {
    commands_.maintain();
    states_.maintain();
  }

 private:
  Plant(const SimulatedSettings& settings, const rtbus::Session& session, const std::string& node_name,
        rtbus::Publication<rtbus::PlantState> states);
  void cycle(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING;

  Mechanics mechanics_;
  std::uint64_t period_ns_;
  std::uint64_t force_timeout_ns_;
  rtbus::Publication<rtbus::PlantState> states_;
  rtbus::Subscription<rtbus::PlantCommand> commands_;
  rtbus::Stamped<rtbus::PlantCommand> command_;
  bool commanded_ = false;  ///< A command has come: the script runs.
};

/// SCHED_FIFO one below the haptic loop's default priority, on any core, memory locked; what was not granted is in the
/// result. Calling thread. @realtime No.
[[nodiscard]] rtbus::RealtimeGrant enter_plant_realtime();

}  // namespace drivers::simulated
