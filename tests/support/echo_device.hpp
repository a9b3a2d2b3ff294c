#pragma once
/// @file echo_device.hpp
/// The smallest virtual USB device: what comes in by bulk OUT goes out by bulk IN, after a while. Vendor requests: 1
/// writes a value, 2 reads it back, 3 stalls, anything else stalls too.
#include <algorithm>
#include <cstdint>
#include <deque>
#include <vector>

#include "drivers/virtual_usb/usb_device.hpp"

namespace tests {

class EchoDevice final : public drivers::virtual_usb::UsbDevice {
 public:
  using Reply = drivers::virtual_usb::Reply;
  using PacketReply = drivers::virtual_usb::PacketReply;
  static constexpr std::uint16_t kVendor = 0x1209, kProduct = 0x0001;  // pid.codes: for tests

  explicit EchoDevice(std::u16string serial = u"E1", bool high_speed = false) {
    const std::uint8_t packet_low = high_speed ? 0x00 : 0x40, packet_high = high_speed ? 0x02 : 0x00;
    descriptors_.device = {18, 1, 0x00, 0x02, 0xff, 0, 0, 64, 0x09, 0x12, 0x01, 0x00, 0x00, 0x01, 1, 2, 3, 1};
    descriptors_.configuration = {9, 2, 32,   0, 1,          1,           0,    0x80, 50,  // configuration 1
                                  9, 4, 0,    0, 2,          0xff,        0xff, 0xff, 0,   // interface 0, vendor class
                                  7, 5, 0x81, 2, packet_low, packet_high, 0,               // bulk IN
                                  7, 5, 0x02, 2, packet_low, packet_high, 0};              // bulk OUT
    descriptors_.strings = {u"rtbus", u"Echo", std::move(serial)};
    descriptors_.high_speed = high_speed;
    packet_ = high_speed ? 512 : 64;
  }

  [[nodiscard]] const drivers::virtual_usb::Descriptors& descriptors() const noexcept override { return descriptors_; }

  [[nodiscard]] PacketReply control(const drivers::usb::Setup& setup, std::span<const std::uint8_t>, std::uint16_t,
                                    std::uint64_t) override {
    ++controls;
    if (setup.request == 1 && setup.request_type == 0x40) {
      value = setup.value;
      return {};
    }
    if (setup.request == 2 && setup.request_type == 0xc0) {
      return {Reply::kAck, {static_cast<std::uint8_t>(value & 0xff), static_cast<std::uint8_t>(value >> 8)}, 0};
    }
    return {Reply::kStall, {}, 0};
  }

  [[nodiscard]] PacketReply out_packet(std::uint8_t, std::span<const std::uint8_t> bytes,
                                       std::uint64_t now_ns) override {
    if (refuse_out) return {Reply::kNak, {}, 0};
    ++commands;
    last_command.assign(bytes.begin(), bytes.end());
    last_command_ns = now_ns;
    if (history.size() < 100'000) history.push_back({now_ns, last_command});
    if (!mute && lose_next-- <= 0) replies_.push_back({now_ns + delay_ns, {bytes.begin(), bytes.end()}});
    lose_next = std::max(lose_next, 0);
    return {};
  }

  [[nodiscard]] PacketReply in_packet(std::uint8_t, std::uint64_t now_ns) override {
    if (stall_next_in) {
      stall_next_in = false;
      return {Reply::kStall, {}, 0};
    }
    if (replies_.empty()) return {Reply::kNak, {}, 0};
    if (replies_.front().due_ns > now_ns) return {Reply::kNak, {}, replies_.front().due_ns};
    PacketReply out{Reply::kAck, std::move(replies_.front().bytes), 0};
    last_answer_ns = now_ns;
    replies_.pop_front();
    return out;
  }

  void bus_reset(std::uint64_t) override {
    ++resets;
    replies_.clear();
  }

  // Faults and observations; under the binding's lock where there is one.
  std::uint64_t delay_ns = 0;  ///< From command to reply.
  bool mute = false;
  bool stall_next_in = false;
  bool refuse_out = false;  ///< NAK for ever.
  int lose_next = 0;        ///< So many replies never come.
  std::uint16_t value = 0;
  int commands = 0, controls = 0, resets = 0;
  std::vector<std::uint8_t> last_command;
  std::uint64_t last_command_ns = 0;
  std::uint64_t last_answer_ns = 0;
  struct Command {
    std::uint64_t time_ns;
    std::vector<std::uint8_t> bytes;
  };
  std::vector<Command> history;  ///< The first hundred thousand commands.

 private:
  struct Pending {
    std::uint64_t due_ns;
    std::vector<std::uint8_t> bytes;
  };
  drivers::virtual_usb::Descriptors descriptors_;
  std::size_t packet_ = 64;
  std::deque<Pending> replies_;
};

}  // namespace tests
