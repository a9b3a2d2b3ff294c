#pragma once
/// @file plant_link.hpp
/// The haptic node's end of a simulated device that runs in a process of its own (`process: own`, simulated_plant).
///
/// The plant publishes PlantState on `<node>.plant_state` and obeys PlantCommand on `<node>.plant_command`. Either side
/// may die and come back: the plant goes to zero force by itself, this end reports kLost until states arrive again.
#include <cstdint>
#include <mutex>
#include <optional>

#include "drivers/device.hpp"
#include "drivers/device_config.hpp"
#include "drivers/simulated/simulated_config.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/subscription.hpp"

namespace drivers::simulated {

class PlantLink final : public Device {
 public:
  /// A plant whose newest state is older is lost.
  static constexpr std::uint64_t kLostAfterNs = 20 * rtbus::kNsPerMs;
  /// A command that the plant has not taken so long after it was published does not arrive. The plant looks for
  /// commands after it takes the time of its state, so no pause of either side looks like this.
  static constexpr std::uint64_t kUnheardAfterNs = 2 * rtbus::kNsPerMs;
  /// start() waits so long for the plant.
  static constexpr std::uint64_t kStartPatienceNs = 3 * rtbus::kNsPerS;

  PlantLink(const SimulatedSettings& settings, const OpenContext& context);
  ~PlantLink() override { PlantLink::stop(); }

  [[nodiscard]] const DeviceInfo& info() const noexcept override { return info_; }

  /// Creates the command topic and waits up to kStartPatienceNs for the plant. The fault says what to start.
  [[nodiscard]] rtbus::Result<void, DeviceFault> start(std::uint64_t now_ns) override;

  /// Sleeps to the next sample of `sample_rate_hz`, then looks every 50 µs for the state that the plant measured then
  /// or later: the plant steps at its own rate, so there is at most one of its periods to wait. Polling instead of the
  /// topic's futex keeps the plant's loop free of system calls and bounds every wait here by the deadline.
  [[nodiscard]] IoStatus wait_sample(std::uint64_t deadline_ns) noexcept override;

  [[nodiscard]] IoStatus read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING override;
  [[nodiscard]] IoStatus write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING override;
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return clamped_; }
  void maintain() noexcept override {
    states_.maintain();
    const std::lock_guard lock(life_);
    if (commands_) commands_->maintain();
  }

  /// Publishes zero force and removes the command topic. A restart needs another start().
  void stop() noexcept override;

 private:
  /// Takes in the newest state; true when it is one that nobody has read yet.
  bool fetch() noexcept RTBUS_NONBLOCKING;
  /// False when a state of the plant shows that it no longer gets the commands.
  bool heard() const noexcept RTBUS_NONBLOCKING;

  DeviceInfo info_;
  OpenContext context_;
  std::uint64_t sample_period_ns_;
  rtbus::Subscription<rtbus::PlantState> states_;
  std::mutex life_;  ///< Housekeeping may run beside start() and stop(); the loop takes it never.
  std::optional<rtbus::Publication<rtbus::PlantCommand>> commands_;
  rtbus::Stamped<rtbus::PlantState> newest_;
  bool unread_ = false;                 ///< newest_ came in by fetch() and was not handed out by read() yet.
  bool have_state_ = false;             ///< Something came since start().
  bool obeys_ = false;                  ///< The plant has taken a command since start().
  std::uint64_t unheard_stamp_ns_ = 0;  ///< Of the oldest command that the plant may not have taken; 0: it took all.
  std::uint64_t unheard_sent_ns_ = 0;   ///< That command was there to read from then on.
  std::uint64_t next_sample_ns_ = 0;
  std::uint64_t clamped_ = 0;
};

}  // namespace drivers::simulated
