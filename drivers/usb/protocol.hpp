#pragma once
/// @file protocol.hpp
/// What a USB device class adds to the shared I/O thread of drivers/usb: how to bring the device to life, and one
/// exchange of force and measurement. Blocking, without threads of its own; runs on any Channel.
#include <cstdint>
#include <string>

#include "drivers/device.hpp"
#include "drivers/usb/channel.hpp"

namespace drivers::usb {

/// What one exchange gave.
enum class ExchangeStatus : std::uint8_t {
  kSample,   ///< `out` holds a new measurement.
  kNothing,  ///< No (valid) answer in time; the connection stands. Counted; too many in a row count as lost.
  kFault,    ///< The device answered that it cannot go on (see Protocol::fault()); bring it up anew.
  kLost,     ///< Unplugged.
  kStopping
};

/// Why forces are withheld although measurements come.
enum class Readiness : std::uint8_t {
  kReady,
  kNotHomed,  ///< The user (or the device) must home first; Protocol::remedy() says how.
};

/// Counters of a protocol since it was made. Written by the I/O thread; the I/O thread publishes copies.
struct LinkCounters {
  std::uint64_t exchanges = 0;    ///< Completed, with a valid measurement.
  std::uint64_t lost_frames = 0;  ///< Commands that no valid answer followed.
  std::uint64_t bad_frames = 0;   ///< Answers that did not decode.
  std::uint64_t resyncs = 0;      ///< Times the frame boundary was searched anew.
  std::uint64_t line_errors = 0;  ///< Overrun, parity, framing or device error bits.
  std::uint64_t clamped = 0;      ///< Commands limited by motor current, thermal model or norm.
};

class Protocol {
 public:
  virtual ~Protocol() = default;

  /// From freshly opened to exchanging: line set-up, firmware, probing. May take seconds; polls the channel, so that
  /// kStopping ends it early. On failure the message says what is wrong and what to do about it.
  [[nodiscard]] virtual rtbus::Result<void, DeviceFault> bring_up(Channel& channel) = 0;

  /// First half of an exchange: sends the force [N, frame D at T] as motor commands. Zero while not ready. @param dt_s
  /// Since the last send [s], for thermal models.
  [[nodiscard]] virtual UsbStatus send(Channel& channel, const Vec3& force_n, double dt_s,
                                       std::uint64_t deadline_ns) noexcept = 0;

  /// The last send() made a force zero that it was asked for: the device's last answer justifies none, or its motors
  /// bear none. It must not come back at once; the loop then begins a new ramp.
  [[nodiscard]] virtual bool withheld() const noexcept { return false; }

  /// Told before each send: the loop renders and the device answers. Otherwise whatever the driver adds by itself (the
  /// weight of a grip) has to fade within 0.1 s, for nobody looks after it.
  virtual void set_live(bool live) noexcept { (void)live; }

  /// Second half: waits for the answer and decodes it. `out.time_ns` is when it arrived.
  [[nodiscard]] virtual ExchangeStatus receive(Channel& channel, DeviceSample& out,
                                               std::uint64_t deadline_ns) noexcept = 0;

  /// Zero force, then whatever leaves the device as it was found. Bounded to about 50 ms.
  virtual void shut_down(Channel& channel) noexcept = 0;

  [[nodiscard]] virtual Readiness readiness() const noexcept = 0;
  [[nodiscard]] virtual std::string remedy() const { return {}; }  ///< For Readiness::kNotHomed, one sentence.
  [[nodiscard]] virtual std::string fault() const { return {}; }   ///< For ExchangeStatus::kFault, one sentence.
  [[nodiscard]] virtual const LinkCounters& counters() const noexcept = 0;
};

}  // namespace drivers::usb
