#pragma once
/// @file io_device.hpp
/// The device that most drivers hand to the haptic loop: a Line (USB, a vendor's library, a service), run by an I/O
/// thread of its own.
///
///     I/O thread (SCHED_FIFO, one above the loop)        haptic_loop
///     receive sample n                                     wait_sample(): sleeps
///     publish it, wake the loop ───────────────────────►   read(): sample n
///     sleep, at most half a period                         …method, safety ladder…
///                                                          write(): force n into its cell, no system call
///     send force n  ◄───────────── wakes the I/O thread    wait_sample(): hands force n over, then sleeps again
///     receive sample n + 1 …
///
/// Every exit ends at zero force. With no write for info.force_timeout_s, or none that the device answered, the I/O
/// thread sends zero by itself. While the device is not ready or not there, read() and write() say kLost: the loop
/// renders zero and starts softly when it is back. A lost device is looked for again every 0.2…2 s and brought up anew.
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "drivers/device.hpp"
#include "drivers/io/line.hpp"
#include "drivers/io/loop_port.hpp"
#include "drivers/io/stop_flag.hpp"

namespace drivers::io {

/// In which order a period's exchange goes.
enum class ExchangeOrder : std::uint8_t {
  kSendThenReceive,  ///< The device answers a command with a measurement; the force leaves with the next command.
  /// Fetch a measurement first in each period, by sending the last force once more, then answer it: two exchanges per
  /// period. For devices that answer much faster than the period, whose measurement would otherwise be a period old.
  kFetchFirst,
  kReceiveThenSend,  ///< Measurement and command are calls of their own: measure, compute, send, once per period.
};

/// How a driver wants its exchanges run.
struct IoSettings {
  DeviceInfo info;
  ExchangeOrder order = ExchangeOrder::kSendThenReceive;
  /// The device holds its answers back to a pace of its own (a serial chip's latency timer): send as soon as the force
  /// is there, else it waits for a clock that has nothing to do with the device's. At most two exchanges per period.
  bool device_paces = false;
  double reply_timeout_s = 0.008;  ///< A command without answer for so long is lost; the next one is sent [s].
  /// Silence after which the connection is given up and opened anew [s], of three exchanges at least.
  double lost_after_s = 0.25;
  double max_force_wait = 0.5;         ///< Longest wait for the loop's force, as a share of the period.
  const char* thread_name = "usb_io";  ///< At most 15 characters.
  const char* link_name = "USB";       ///< For the figures told at the end.
};

/// Where the I/O thread runs.
struct IoThread {
  int priority = 81;  ///< SCHED_FIFO; one above the loop's.
  int core = -1;      ///< The loop's; −1: chosen like the loop's.
};

/// Figures about the link since start(). A copy; any thread.
struct LinkFigures {
  LinkState state = LinkState::kStopped;
  LinkCounters protocol;
  std::uint64_t losses = 0;       ///< Times the device was lost after it had run.
  std::uint64_t late_forces = 0;  ///< Exchanges that did not wait longer for the loop and sent what there was.
  std::uint64_t timed_out = 0;    ///< Exchanges with zero force, since the loop had not written in time.
  std::uint64_t silences = 0;     ///< Exchanges without an answer.
  std::uint64_t withheld = 0;     ///< Forces that the line or a silent device made zero.
};

class IoDevice final : public Device {
 public:
  IoDevice(IoSettings settings, IoThread thread, LineFactory line);
  ~IoDevice() override { IoDevice::stop(); }

  [[nodiscard]] const DeviceInfo& info() const noexcept override { return settings_.info; }

  /// Starts the I/O thread and waits until the device is brought up for the first time. @returns the reason, in the
  /// line's words, when it could not be; nothing runs then.
  [[nodiscard]] rtbus::Result<void, DeviceFault> start(std::uint64_t now_ns) override;

  [[nodiscard]] IoStatus wait_sample(std::uint64_t deadline_ns) noexcept override {
    return port_.wait_sample(deadline_ns);
  }
  [[nodiscard]] IoStatus read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING override {
    return port_.read(now_ns, out);
  }
  [[nodiscard]] IoStatus write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING override {
    return port_.write(now_ns, command);
  }
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return port_.clamped(); }
  /// What changed since the last call, as one sentence for the user; empty: nothing. After stop(): how the link was.
  /// @realtime No.
  [[nodiscard]] std::string take_notice() override;

  /// Zero force within Line::disconnect(), then the thread is joined. Bounded: an exchange in flight ends at its
  /// reply time-out, a bring-up at its next wait.
  void stop() noexcept override;

  void cancel_start() noexcept override { stop_.raise(); }

  /// Any thread.
  [[nodiscard]] LinkFigures figures() const noexcept;
  [[nodiscard]] std::optional<rtbus::LinkStats> link_stats() const override;
  /// From the arrival of a sample to its force having been handed to the bus [ns]; `clock: device` only. Any thread.
  [[nodiscard]] const rtbus::Histogram& sample_to_wire() const noexcept { return port_.sample_to_wire(); }
  /// From one sample to the next [ns]. Any thread.
  [[nodiscard]] const rtbus::Histogram& sample_period() const noexcept { return port_.sample_period(); }

 private:
  enum class Ended : std::uint8_t { kStopping, kLost, kFault };

  void run() noexcept;
  [[nodiscard]] std::string connect_once();  ///< Connects and exchanges until it ends; why.
  void take_priority() noexcept;
  Ended exchange() noexcept;
  [[nodiscard]] ExchangeStatus step() noexcept;
  [[nodiscard]] SendStatus send() noexcept;
  [[nodiscard]] ExchangeStatus receive(DeviceSample& out) noexcept;
  void publish(const DeviceSample& sample);
  void await_force() noexcept;
  void publish_counters() noexcept;
  void tell(const std::string& text);
  void tell_figures();  ///< The last notice: how the link was.
  void report_first(bool ok, std::string message);

  const IoSettings settings_;
  const IoThread place_;
  const LineFactory make_line_;
  const std::uint64_t period_ns_;
  LoopPort port_;

  // The I/O thread's.
  std::unique_ptr<Line> line_;
  DeviceSample sample_;        ///< The newest one.
  std::uint64_t samples_ = 0;  ///< Since start().
  std::uint64_t last_send_ns_ = 0;
  std::uint64_t last_answer_ns_ = 0;
  int silent_exchanges_ = 0;  ///< In a row.
  bool link_silent_ = false;
  bool pushing_ = false;           ///< The last command that left was a force.
  bool realtime_ = false;          ///< SCHED_FIFO is asked for: from the first sample of a ready device on.
  std::uint64_t back_off_ns_ = 0;  ///< Until the device is looked for again.

  // Published.
  std::atomic<std::uint64_t> losses_{0}, silences_{0};
  std::atomic<std::uint64_t> exchanges_{0}, lost_frames_{0}, bad_frames_{0}, resyncs_{0}, line_errors_{0}, limited_{0};

  StopFlag stop_;
  std::thread thread_;
  std::mutex mutex_;  ///< Of the texts; the I/O thread takes it at changes of state alone.
  std::string notice_;
  struct First;
  First* first_ = nullptr;  ///< Lives in start().
};

}  // namespace drivers::io
