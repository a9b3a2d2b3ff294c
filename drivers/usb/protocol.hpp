#pragma once
/// @file protocol.hpp
/// What a USB driver adds to the shared I/O thread of drivers/io: how to bring the device up, and one exchange of
/// force and measurement. Blocking, without threads of its own; runs on any Channel.
#include <cstdint>
#include <string>

#include "drivers/device.hpp"
#include "drivers/io/line.hpp"
#include "drivers/usb/channel.hpp"

namespace drivers::usb {

using io::ExchangeStatus;
using io::LinkCounters;
using io::Readiness;

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

  /// The last send() replaced a force by zero, because of the device's last reply or its motors. The force must not
  /// return at once; the loop starts a new ramp.
  [[nodiscard]] virtual bool withheld() const noexcept { return false; }

  /// Set before each send: the loop renders and the device replies. Otherwise forces that the driver adds itself (the
  /// weight of a grip) must fade within 0.1 s.
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
