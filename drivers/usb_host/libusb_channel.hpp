#pragma once
/// @file libusb_channel.hpp
/// A Channel over libusb's asynchronous interface. All transfers are allocated when it is opened; several IN transfers
/// stay posted. libusb's events are handled by the calling thread inside the blocking calls: there is no event thread.
#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "drivers/io/stop_flag.hpp"
#include "drivers/usb/channel.hpp"
#include "drivers/usb_host/libusb_context.hpp"

struct libusb_transfer;

namespace drivers::usb {

using io::StopFlag;

class LibusbChannel final : public Channel {
 public:
  static constexpr int kPosted = 4;  ///< IN transfers kept posted, each of one packet.

  /// Finds, opens and claims the device on the bus. A kernel driver that has an interface is detached and gets it back
  /// when the channel is closed. @param stop Outlives the channel.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<Channel>, DeviceFault> open(const DeviceMatch& match,
                                                                                 StopFlag& stop);

  /// The same with a usbfs descriptor that is open already (from a broker, a sandbox, or a virtual device). The channel
  /// closes it, also when this fails.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<Channel>, DeviceFault> open_fd(int fd, const DeviceMatch& match,
                                                                                    StopFlag& stop);
  ~LibusbChannel() override;
  LibusbChannel(const LibusbChannel&) = delete;
  LibusbChannel& operator=(const LibusbChannel&) = delete;

  [[nodiscard]] std::uint64_t now_ns() const noexcept override;
  [[nodiscard]] UsbStatus sleep_until(std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] UsbStatus control_out(const Setup& setup, std::span<const std::uint8_t> data,
                                      std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] UsbStatus control_in(const Setup& setup, std::span<std::uint8_t> data, std::size_t& got,
                                     std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] UsbStatus write(std::span<const std::uint8_t> bytes, std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] UsbStatus read(std::span<std::uint8_t> out, std::size_t& got,
                               std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] std::size_t read_size() const noexcept override { return read_size_; }

 private:
  /// A transfer and its memory. libusb calls back inside the I/O thread's own calls, so nothing here is shared.
  struct Slot {
    LibusbChannel* channel = nullptr;
    libusb_transfer* transfer = nullptr;
    std::vector<std::uint8_t> buffer;
    int done = 1;  ///< 0: libusb has it.
    bool in = false;
  };

  LibusbChannel(Context context, int fd, StopFlag& stop);
  [[nodiscard]] rtbus::Result<void, DeviceFault> prepare(const DeviceMatch& match);
  [[nodiscard]] rtbus::Result<void, DeviceFault> find_endpoints(int interface);
  static void completed(libusb_transfer* transfer) noexcept;
  [[nodiscard]] UsbStatus submit(Slot& slot) noexcept;
  [[nodiscard]] UsbStatus control(const Setup& setup, std::size_t length, std::uint64_t deadline_ns) noexcept;
  /// Handles events until the slot is done, the deadline or a stop; then takes the transfer back.
  [[nodiscard]] UsbStatus await(Slot& slot, std::uint64_t deadline_ns) noexcept;
  [[nodiscard]] UsbStatus handle_events(std::uint64_t deadline_ns, int* done) noexcept;
  void take_back(Slot& slot) noexcept;
  [[nodiscard]] UsbStatus post_reads() noexcept;
  [[nodiscard]] UsbStatus recover_from_stall() noexcept;
  [[nodiscard]] UsbStatus outcome(const Slot& slot) noexcept;

  Context context_;
  int fd_ = -1;  ///< Handed in, closed after the handle; −1: libusb opened the device itself.
  Handle handle_;
  StopFlag& stop_;
  std::vector<int> claimed_;
  std::uint8_t in_ = 0;
  std::uint8_t out_ = 0;
  std::size_t read_size_ = 64;
  bool lost_ = false;
  Slot control_, out_slot_;
  std::array<Slot, kPosted> in_slots_;
  std::deque<Slot*> arrived_;  ///< Completed IN transfers in the order of completion, not yet read.
};

}  // namespace drivers::usb
