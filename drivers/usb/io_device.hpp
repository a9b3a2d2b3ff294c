#pragma once
/// @file io_device.hpp
/// The device that every USB driver hands to the haptic loop: a Protocol on a Channel, run by an I/O thread of its own.
///
///     usb_io (SCHED_FIFO, one above the loop)            haptic_loop
///     receive sample n                                     wait_sample(): sleeps
///     publish it, wake the loop ───────────────────────►   read(): sample n
///     sleep, at most half a period                         …force law, safety ladder…
///                                                          write(): force n into its cell, no system call
///     send force n  ◄───────────── wakes the I/O thread    wait_sample(): hands force n over, then sleeps again
///     receive sample n + 1 …
///
/// With `clock: timer` nobody calls wait_sample(): the thread then paces itself at DeviceInfo::sample_rate_hz and each
/// exchange carries the newest force. Decision 0006 says why it is cut like this.
///
/// Force is zero when the loop has not written for DeviceInfo::force_timeout_s, when the device has not answered for
/// nine tenths of that (so that the zero is there in time), and while the device is not ready. Each zero that was not
/// asked for makes the loop's next write fail once, so that the force comes back by its ramp. A device that is lost,
/// that reports a fault or that is not ready (not homed: its pose means nothing) gives kLost; the loop then renders
/// zero and starts softly when it is back. A lost device is looked for again every 0.2…2 s and brought up anew.
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "drivers/device.hpp"
#include "drivers/usb/channel.hpp"
#include "drivers/usb/mailbox.hpp"
#include "drivers/usb/protocol.hpp"
#include "drivers/usb/stop_flag.hpp"
#include "rtbus/histogram.hpp"

namespace drivers::usb {

using ProtocolFactory = std::function<std::unique_ptr<Protocol>()>;
/// Opens the device; the fault is a sentence for the user. The channel asks `stop` in every wait.
using ChannelOpener = std::function<rtbus::Result<std::unique_ptr<Channel>, DeviceFault>(StopFlag& stop)>;

/// How a driver wants its exchanges run.
struct IoSettings {
  DeviceInfo info;
  /// Fetch a measurement first in each period, by sending the last force once more, then answer it: two exchanges per
  /// period. For devices that answer much faster than the period, whose measurement would otherwise be a period old.
  bool fetch_first = false;
  /// The device holds its answers back to a pace of its own (a serial chip's latency timer): send as soon as the force
  /// is there, else it waits for a clock that has nothing to do with the device's. At most two exchanges per period.
  bool device_paces = false;
  double reply_timeout_s = 0.008;  ///< A command without answer for so long is lost; the next one is sent [s].
  double lost_after_s = 0.25;      ///< Silence after which the connection is given up and opened anew [s].
  double max_force_wait = 0.5;     ///< Longest wait for the loop's force, as a share of the period.
};

/// Where the I/O thread runs.
struct IoThread {
  int priority = 81;  ///< SCHED_FIFO; one above the loop's.
  int core = -1;      ///< The loop's; −1: chosen like the loop's.
};

using rtbus::LinkState;

/// Figures about the link since start(). A copy; any thread.
struct LinkFigures {
  LinkState state = LinkState::kStopped;
  LinkCounters protocol;
  std::uint64_t losses = 0;       ///< Times the device was lost after it had run.
  std::uint64_t late_forces = 0;  ///< Exchanges that did not wait longer for the loop and sent what there was.
  std::uint64_t timed_out = 0;    ///< Exchanges with zero force, since the loop had not written in time.
  std::uint64_t silences = 0;     ///< Exchanges without an answer.
  std::uint64_t withheld = 0;     ///< Forces that the protocol or a silent device made zero.
};

class IoDevice final : public Device {
 public:
  IoDevice(IoSettings settings, IoThread thread, ProtocolFactory protocol, ChannelOpener opener);
  ~IoDevice() override { IoDevice::stop(); }

  [[nodiscard]] const DeviceInfo& info() const noexcept override { return settings_.info; }

  /// Starts the I/O thread and waits until the device is brought up for the first time. @returns the reason, in the
  /// opener's or the protocol's words, when it could not be; nothing runs then.
  [[nodiscard]] rtbus::Result<void, DeviceFault> start(std::uint64_t now_ns) override;

  /// Hands the last written force over to the I/O thread, if that waits for it, then waits for the next sample.
  /// @realtime Yes: one FUTEX_WAKE and one FUTEX_WAIT, bounded by the deadline.
  [[nodiscard]] IoStatus wait_sample(std::uint64_t deadline_ns) noexcept override;

  [[nodiscard]] IoStatus read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING override;
  [[nodiscard]] IoStatus write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING override;
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override {
    return clamped_.load(std::memory_order_relaxed);
  }
  /// What changed since the last call, as one sentence for the user; empty: nothing. After stop(): how the link was.
  /// @realtime No.
  [[nodiscard]] std::string take_notice() override;

  /// Zero force within Protocol::shut_down(), then the thread is joined. Bounded: an exchange in flight ends at its
  /// reply time-out, a bring-up at its next wait.
  void stop() noexcept override;

  void cancel_start() noexcept override { stop_.raise(); }

  /// Any thread.
  [[nodiscard]] LinkFigures figures() const noexcept;
  [[nodiscard]] std::optional<rtbus::LinkStats> link_stats() const override;
  /// From the arrival of a sample to its force having been handed to the bus [ns]; `clock: device` only. Any thread.
  [[nodiscard]] const rtbus::Histogram& sample_to_wire() const noexcept { return sample_to_wire_ns_; }
  /// From one sample to the next [ns]. Any thread.
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
  enum class Ended : std::uint8_t { kStopping, kLost, kFault };

  void run() noexcept;
  [[nodiscard]] std::string connect_once();  ///< Opens, brings up and exchanges until it ends; why.
  void take_priority() noexcept;
  Ended exchange(Channel& channel) noexcept;
  [[nodiscard]] ExchangeStatus step(Channel& channel) noexcept;
  [[nodiscard]] UsbStatus send(Channel& channel) noexcept;
  [[nodiscard]] ExchangeStatus receive(Channel& channel, DeviceSample& out) noexcept;
  void publish(const DeviceSample& sample) noexcept;
  void await_force(std::uint64_t number, std::uint64_t deadline_ns) noexcept;
  void set_state(LinkState state) noexcept;
  void publish_counters() noexcept;
  void tell(std::string text);
  void tell_figures();  ///< The last notice: how the link was.
  void report_first(bool ok, std::string message);

  const IoSettings settings_;
  const IoThread place_;
  const ProtocolFactory make_protocol_;
  const ChannelOpener open_;
  const std::uint64_t period_ns_;
  const std::uint64_t force_timeout_ns_;
  const std::uint64_t answer_timeout_ns_;  ///< Silence of the device after which forces are zero.

  // Between the two threads. The waits are a store, then a look at the other side's flag, all seq_cst: either the waker
  // sees the waiter, or the waiter sees the news before it sleeps (FUTEX_WAIT looks once more).
  Mailbox<Sample> samples_;
  Mailbox<Force> forces_;
  alignas(64) std::atomic<std::uint32_t> sample_bell_{0};  ///< Rung with every sample and every change of state.
  std::atomic<std::uint64_t> newest_sample_{0};
  std::atomic<bool> loop_waits_{false};
  alignas(64) std::atomic<std::uint32_t> force_bell_{0};
  std::atomic<std::uint64_t> answered_{0};  ///< Number of the sample that the newest force answers.
  std::atomic<bool> io_waits_{false};
  std::atomic<std::uint64_t> last_wait_ns_{0};  ///< When the loop last asked to be paced.
  /// Counts the zeros that the I/O thread sent instead of a force. A force that was written before the loop knew of the
  /// newest one does not leave any more.
  std::atomic<std::uint32_t> withheld_{0};
  alignas(64) std::atomic<LinkState> state_{LinkState::kStopped};

  // The loop's.
  Sample read_;
  std::uint32_t withheld_seen_ = 0;
  std::atomic<std::uint64_t> clamped_{0};

  // The I/O thread's.
  std::unique_ptr<Protocol> protocol_;
  Force force_;
  std::uint64_t sample_number_ = 0;
  std::uint64_t last_send_ns_ = 0;
  std::uint64_t running_since_ns_ = 0;  ///< A force from before that answers another life of the device.
  std::uint64_t last_answer_ns_ = 0;
  std::uint64_t last_published_ns_ = 0;
  std::uint64_t awaited_ns_ = 0;  ///< Arrival of the sample that the next force answers; 0: none.
  bool link_silent_ = false;
  bool pushing_ = false;           ///< The last command that left was a force.
  bool realtime_ = false;          ///< SCHED_FIFO is asked for: from the first sample of a ready device on.
  std::uint64_t back_off_ns_ = 0;  ///< Until the device is looked for again.

  // Published.
  std::atomic<std::uint64_t> losses_{0}, late_forces_{0}, timed_out_{0}, silences_{0};
  std::atomic<std::uint64_t> exchanges_{0}, lost_frames_{0}, bad_frames_{0}, resyncs_{0}, line_errors_{0}, limited_{0};
  rtbus::Histogram sample_to_wire_ns_, sample_period_ns_;

  StopFlag stop_;
  std::thread thread_;
  std::mutex mutex_;  ///< Of the texts; the I/O thread takes it at changes of state alone.
  std::string notice_;
  struct First;
  First* first_ = nullptr;  ///< Lives in start().
};

}  // namespace drivers::usb
