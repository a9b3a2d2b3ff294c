#pragma once
/// @file urb_queue.hpp
/// What a host controller does with a device: takes transfers (URBs), cuts them into packets, ends them. One FIFO per
/// endpoint; no threads, no clock, no locks: time is handed in, so the same queue runs in simulated time, behind a
/// usbfs file descriptor and behind a USB/IP socket.
///
/// The bus has a speed: a packet takes (payload + overhead) bits at 12 or 480 Mbit/s, one after the other. Each packet
/// happens at its own moment, not when pump() comes to look, so runs repeat bit by bit however they are pumped.
#include <cstdint>
#include <deque>
#include <map>
#include <vector>

#include "drivers/virtual_usb/standard_requests.hpp"
#include "drivers/virtual_usb/usb_device.hpp"

namespace drivers::virtual_usb {

inline constexpr std::uint64_t kNever = UINT64_MAX;

/// How a transfer ended: negative Linux errno values, as usbfs and USB/IP have them.
enum UrbResult : int {
  kUrbOk = 0,
  kUrbCancelled = -2,  ///< ENOENT
  kUrbStall = -32,     ///< EPIPE
  kUrbOverflow = -75,  ///< EOVERFLOW: the device sent more than was asked for.
  kUrbShort = -121,    ///< EREMOTEIO: short, and short_not_ok.
  kUrbGone = -108,     ///< ESHUTDOWN: unplugged.
};

/// A transfer.
struct Urb {
  std::uint64_t id = 0;            ///< The submitter's; unique among those pending.
  std::uint8_t endpoint = 0;       ///< With direction bit 7; 0 for control whatever its direction.
  usb::Setup setup;                ///< Control only, request_type with its direction bit.
  std::uint16_t setup_length = 0;  ///< wLength, control only.
  std::vector<std::uint8_t> data;  ///< OUT: what to send. IN: filled; size() is what came.
  std::size_t length = 0;          ///< IN: how much is asked for [byte].
  bool short_not_ok = false;
  bool zero_packet = false;  ///< OUT that ends on a full packet is followed by an empty one.
  int status = 0;            ///< UrbResult, when done.
  std::size_t actual = 0;    ///< Bytes moved, when done.

  // The queue's.
  std::uint64_t submitted_ns = 0;
  bool zero_sent = false;
};

class UrbQueue {
 public:
  /// @param device Outlives the queue.
  explicit UrbQueue(UsbDevice& device);

  /// Queues a transfer. An endpoint that the device does not have, or a device that is unplugged, ends it at once.
  void submit(Urb urb, std::uint64_t now_ns);

  /// The device may have changed its mind from outside (a test, a fault): ask again where it refused until an event.
  void poke(std::uint64_t now_ns) noexcept;

  /// Takes a pending transfer back. @returns false when there is none of that id (it is done already).
  /// @param out The transfer with status kUrbCancelled and what it had moved so far.
  bool discard(std::uint64_t id, Urb& out);

  /// Lets happen everything that happens until `now_ns`. @returns when to call again; kNever: after another submit.
  std::uint64_t pump(std::uint64_t now_ns);

  /// Finished transfers, in the order in which they finished.
  [[nodiscard]] bool take_done(Urb& out);
  [[nodiscard]] bool has_done() const noexcept { return !done_.empty(); }
  [[nodiscard]] std::size_t pending() const noexcept;

  /// Forgets everything pending, without a word: whoever submitted it is gone.
  void forget();
  /// Everything pending ends with kUrbGone, everything submitted later too.
  void unplug();
  /// Plugged in (again): halts forgotten, the device told by bus_reset(); it keeps its power and state.
  void plug(std::uint64_t now_ns);
  [[nodiscard]] bool plugged() const noexcept { return plugged_; }

  /// As libusb_clear_halt() and libusb_reset_device() reach the device.
  void clear_halt(std::uint8_t endpoint) { standard_.clear_halt(endpoint); }
  void reset(std::uint64_t now_ns) { standard_.reset(now_ns); }
  [[nodiscard]] bool halted(std::uint8_t endpoint) const noexcept { return standard_.halted(endpoint); }

  [[nodiscard]] const Configuration& configuration() const noexcept { return standard_.configuration(); }
  [[nodiscard]] UsbDevice& device() noexcept { return device_; }

 private:
  struct Line {
    std::deque<Urb> urbs;
    std::uint64_t retry_ns = 0;  ///< After a NAK; kNever: after something else has happened.
    std::uint16_t max_packet = 64;
  };

  [[nodiscard]] std::uint64_t ready_ns(const Line& line) const noexcept;
  void one_packet(std::uint8_t endpoint, Line& line, std::uint64_t t_ns);
  void control(Line& line, std::uint64_t t_ns);
  void out_packet(std::uint8_t endpoint, Line& line, std::uint64_t t_ns);
  void in_packet(std::uint8_t endpoint, Line& line, std::uint64_t t_ns);
  void nak(Line& line, const PacketReply& reply, std::uint64_t t_ns) noexcept;
  void finish(Line& line, int status);
  void occupy_bus(std::size_t bytes, int packets, std::uint64_t t_ns) noexcept;

  UsbDevice& device_;
  StandardRequests standard_;
  std::map<std::uint8_t, Line> lines_;  ///< By address; OUT and control sort before IN, and win ties.
  std::deque<Urb> done_;
  std::uint64_t bus_free_ns_ = 0;
  bool plugged_ = true;
};

}  // namespace drivers::virtual_usb
