#pragma once
/// @file line.hpp
/// One device as the I/O thread of an IoDevice reaches it: how to connect, and one exchange of force and measurement.
/// Over USB it is a Protocol on a Channel (drivers/usb_host/usb_line.hpp); a vendor's library or service has its own.
///
/// Blocking, without threads of its own; called by the I/O thread alone. @realtime No.
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "drivers/device.hpp"
#include "drivers/io/stop_flag.hpp"
#include "rtbus/result.hpp"

namespace drivers::io {

/// What one exchange gave.
enum class ExchangeStatus : std::uint8_t {
  kSample,   ///< `out` holds a new measurement.
  kNothing,  ///< No (valid) answer in time; the connection stands. Counted; too many in a row count as lost.
  kFault,    ///< The device answered that it cannot go on (see Line::fault()); bring it up anew.
  kLost,     ///< Unplugged.
  kStopping
};

enum class SendStatus : std::uint8_t {
  kSent,
  kNothing,  ///< Not taken; the connection stands.
  kFault,    ///< See Line::fault().
  kLost,     ///< Unplugged.
  kStopping
};

/// Why forces are withheld although measurements come.
enum class Readiness : std::uint8_t {
  kReady,
  kNotHomed,  ///< The user (or the device) must act first; Line::remedy() says how.
};

/// Counters since the line was made. Written by the I/O thread; the I/O thread publishes copies.
struct LinkCounters {
  std::uint64_t exchanges = 0;    ///< Completed, with a valid measurement.
  std::uint64_t lost_frames = 0;  ///< Commands that no valid answer followed.
  std::uint64_t bad_frames = 0;   ///< Answers that did not decode.
  std::uint64_t resyncs = 0;      ///< Times the frame boundary was searched anew.
  std::uint64_t line_errors = 0;  ///< Overrun, parity, framing or device error bits.
  std::uint64_t clamped = 0;      ///< Commands limited by motor current, thermal model or norm.
};

class Line {
 public:
  virtual ~Line() = default;

  /// From nothing to exchanging: open, firmware, probing. May take seconds; asks `stop` in every wait that can be
  /// ended. The fault is a sentence for the user. On failure nothing stays open.
  [[nodiscard]] virtual rtbus::Result<void, DeviceFault> connect(StopFlag& stop) = 0;

  /// Sends the force [N, frame D at T]. Zero while not ready. @param dt_s Since the last send [s], for thermal models.
  /// @param live The loop renders and the device answers. Otherwise forces that the driver adds itself (the weight of a
  /// grip) must fade within 0.1 s.
  [[nodiscard]] virtual SendStatus send(const Vec3& force_n, double dt_s, bool live,
                                        std::uint64_t deadline_ns) noexcept = 0;

  /// The last send() replaced a force by zero, because of the device's last reply or its motors. The force must not
  /// return at once; the loop starts a new ramp.
  [[nodiscard]] virtual bool withheld() const noexcept { return false; }

  /// Waits for the measurement. `out.time_ns` is when it arrived, CLOCK_MONOTONIC.
  [[nodiscard]] virtual ExchangeStatus receive(DeviceSample& out, std::uint64_t deadline_ns) noexcept = 0;

  /// Closes. `reachable`: zero force first, and whatever leaves the device as it was found. Bounded to about 50 ms.
  virtual void disconnect(bool reachable) noexcept = 0;

  [[nodiscard]] virtual Readiness readiness() const noexcept = 0;
  [[nodiscard]] virtual std::string remedy() const { return {}; }  ///< For Readiness::kNotHomed, one sentence.
  [[nodiscard]] virtual std::string fault() const { return {}; }   ///< For kFault, one sentence.
  /// What the user should know; mostly empty. Asked after connect() and after each exchange.
  [[nodiscard]] virtual std::string take_news() { return {}; }
  [[nodiscard]] virtual const LinkCounters& counters() const noexcept = 0;
};

using LineFactory = std::function<std::unique_ptr<Line>()>;

}  // namespace drivers::io
