#pragma once
/// @file virtual_channel.hpp
/// A usb::Channel straight over a virtual device, in simulated time: blocking calls move the clock on to the next thing
/// that happens, so that seconds of protocol pass in milliseconds and every run is the same. For tests of protocols.
#include <cstdint>
#include <deque>
#include <vector>

#include "drivers/usb/channel.hpp"
#include "drivers/virtual_usb/urb_queue.hpp"

namespace drivers::virtual_usb {

struct VirtualChannelOptions {
  std::uint64_t start_ns = 1'000'000'000;  ///< Where the clock begins.
  std::vector<int> interfaces = {0};       ///< As in usb::DeviceMatch: the bulk endpoints are those of the last one.
  int read_packets = 1;                    ///< Packets per posted IN transfer.
  int posted = 4;                          ///< IN transfers kept posted.
  Faults faults;                           ///< Of these, unplug_at_s and replug_after_s, from start_ns.
};

class VirtualChannel final : public usb::Channel {
 public:
  /// @param device Outlives the channel. Plugged in by the constructor.
  explicit VirtualChannel(UsbDevice& device, VirtualChannelOptions options = {});

  [[nodiscard]] std::uint64_t now_ns() const noexcept override { return now_ns_; }
  [[nodiscard]] usb::UsbStatus sleep_until(std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] usb::UsbStatus control_out(const usb::Setup& setup, std::span<const std::uint8_t> data,
                                           std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] usb::UsbStatus control_in(const usb::Setup& setup, std::span<std::uint8_t> data, std::size_t& got,
                                          std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] usb::UsbStatus write(std::span<const std::uint8_t> bytes, std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] usb::UsbStatus read(std::span<std::uint8_t> out, std::size_t& got,
                                    std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] std::size_t read_size() const noexcept override { return read_size_; }

  /// From then on every call gives kStopping; kNever takes it back.
  void stop_at(std::uint64_t time_ns) noexcept { stop_ns_ = time_ns; }
  /// From then on every call gives kLost.
  void unplug_at(std::uint64_t time_ns) noexcept { unplug_ns_ = time_ns; }
  /// Plugged in anew, now, as a freshly opened channel would find it.
  void replug();
  [[nodiscard]] UrbQueue& queue() noexcept { return queue_; }

 private:
  /// Moves on to the next event, at most to `deadline_ns`. @returns kOk, or why to give up.
  [[nodiscard]] usb::UsbStatus advance(std::uint64_t deadline_ns) noexcept;
  [[nodiscard]] usb::UsbStatus run(Urb urb, Urb& out, std::uint64_t deadline_ns) noexcept;
  void post_reads();
  void sort_done();

  UrbQueue queue_;
  std::uint64_t now_ns_;
  std::uint64_t stop_ns_ = kNever;
  std::uint64_t unplug_ns_ = kNever;
  std::uint8_t out_ = 0;
  std::uint8_t in_ = 0;
  std::size_t read_size_ = 64;
  int posted_wanted_;
  int posted_ = 0;
  bool stalled_ = false;  ///< Stalled IN transfers are coming back.
  std::uint64_t next_id_ = 1;
  std::deque<Urb> arrived_;  ///< Finished IN transfers nobody has read.
  std::deque<Urb> others_;   ///< Finished OUT and control transfers.
};

}  // namespace drivers::virtual_usb
