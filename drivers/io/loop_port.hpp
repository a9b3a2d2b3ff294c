#pragma once
/// @file loop_port.hpp
/// Where the haptic loop meets the thread that talks to a device: the I/O thread of an IoDevice, or the servo thread of
/// a vendor's library. Measurements go one way, forces the other; each side may wait for the other for a bounded time.
///
///     device's thread                                      haptic_loop
///     publish(sample n) ───────────────────────────────►   wait_sample(): wakes; read(): sample n
///     await_force(): sleeps, bounded                       …method, safety ladder…
///                                                          write(): force n into its cell, no system call
///     take_force()  ◄──────────── wakes the other thread   wait_sample(): hands force n over, then sleeps again
///
/// A force acts for info.force_timeout_s after it was written. A zero that the device's side decided on makes the next
/// write() fail, so that the force returns by the loop's ramp.
#include <atomic>
#include <cstdint>

#include "drivers/device.hpp"
#include "drivers/io/mailbox.hpp"
#include "rtbus/histogram.hpp"
#include "rtbus/link_messages.hpp"

namespace drivers::io {

using rtbus::LinkState;

/// For counters with one writing thread: a relaxed load and store is enough.
inline void bump(std::atomic<std::uint64_t>& counter) noexcept RTBUS_NONBLOCKING {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

class LoopPort {
 public:
  explicit LoopPort(const DeviceInfo& info);

  /// For another start(). Neither side may be running.
  void reset() noexcept;

  // --- The loop's side, as in Device ---

  /// @realtime Yes: one FUTEX_WAKE and one FUTEX_WAIT, bounded by the deadline.
  [[nodiscard]] IoStatus wait_sample(std::uint64_t deadline_ns) noexcept;
  [[nodiscard]] IoStatus read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] IoStatus write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING;
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING {
    return clamped_.load(std::memory_order_relaxed);
  }

  // --- The device's side, one thread. No locks, no allocation; publish() and set_state() may make a FUTEX_WAKE,
  // await_force() a FUTEX_WAIT ---

  void publish(const DeviceSample& sample) noexcept;
  /// The loop asked to be paced within the 50 ms before the newest sample.
  [[nodiscard]] bool paced() const noexcept;
  /// Waits for the force that answers the newest sample. False, and counted as late: it did not come in time.
  bool await_force(std::uint64_t deadline_ns) noexcept;

  struct Command {
    Vec3 force_n{};
    bool live = false;  ///< False: the force is zero, since one of both sides has been silent for too long.
  };
  /// The force to send now. @param last_answer_ns When the device last measured: after nine tenths of the force
  /// time-out without a measurement the force is zero.
  [[nodiscard]] Command take_force(std::uint64_t now_ns, std::uint64_t last_answer_ns) noexcept;
  /// The command has left at `now_ns`.
  void sent(std::uint64_t now_ns) noexcept;
  /// The device's side replaced a force by zero.
  void withhold() noexcept { withheld_.fetch_add(1, std::memory_order_release); }

  /// Only in LinkState::kRunning samples are read and forces taken.
  void set_state(LinkState state) noexcept;
  [[nodiscard]] LinkState state() const noexcept { return state_.load(std::memory_order_acquire); }

  /// Silence of the device after which forces are zero [ns].
  [[nodiscard]] std::uint64_t answer_timeout_ns() const noexcept { return answer_timeout_ns_; }

  // --- Figures. Any thread ---

  /// What this port knows of LinkStats; the rest stays zero.
  [[nodiscard]] rtbus::LinkStats stats() const noexcept;
  /// From the arrival of a sample to its force having been sent [ns]; `clock: device` only.
  [[nodiscard]] const rtbus::Histogram& sample_to_wire() const noexcept { return sample_to_wire_ns_; }
  /// From one sample to the next [ns].
  [[nodiscard]] const rtbus::Histogram& sample_period() const noexcept { return sample_period_ns_; }

 private:
  struct Force {
    Vec3 force_n{};
    std::uint64_t time_ns = 0;   ///< When the loop wrote it; 0: never.
    std::uint32_t withheld = 0;  ///< Of withheld_, as the loop had seen it then.
  };
  struct Sample {
    DeviceSample value;
    std::uint64_t number = 0;
  };

  const double max_force_n_;
  const std::uint64_t force_timeout_ns_;
  const std::uint64_t answer_timeout_ns_;

  // Between the two threads. The waits are a store, then a look at the other side's flag, all seq_cst: either the waker
  // sees the waiter, or the waiter sees the new sample before it sleeps (FUTEX_WAIT looks once more).
  Mailbox<Sample> samples_;
  Mailbox<Force> forces_;
  alignas(64) std::atomic<std::uint32_t> sample_bell_{0};  ///< Rung with every sample and every change of state.
  std::atomic<std::uint64_t> newest_sample_{0};
  std::atomic<bool> loop_waits_{false};
  alignas(64) std::atomic<std::uint32_t> force_bell_{0};
  std::atomic<std::uint64_t> answered_{0};  ///< Number of the sample that the newest force answers.
  std::atomic<bool> device_waits_{false};
  std::atomic<std::uint64_t> last_wait_ns_{0};  ///< When the loop last asked to be paced.
  /// Counts the zeros that the device's side sent instead of a force. A force that was written before the loop knew of
  /// the newest one does not leave any more.
  std::atomic<std::uint32_t> withheld_{0};
  alignas(64) std::atomic<LinkState> state_{LinkState::kStopped};

  // The loop's.
  Sample read_;
  std::uint32_t withheld_seen_ = 0;
  std::atomic<std::uint64_t> clamped_{0};

  // The device side's.
  Force force_;
  std::uint64_t sample_number_ = 0;
  std::uint64_t running_since_ns_ = 0;  ///< A force from before that answers another life of the device.
  std::uint64_t last_published_ns_ = 0;
  std::uint64_t awaited_ns_ = 0;  ///< Arrival of the sample that the next force answers; 0: none.

  // Published.
  std::atomic<std::uint64_t> late_forces_{0}, timed_out_{0};
  rtbus::Histogram sample_to_wire_ns_, sample_period_ns_;
};

}  // namespace drivers::io
