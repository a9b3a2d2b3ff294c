#pragma once
/// @file scripted_channel.hpp
/// A channel whose far end is a function: what the test wants a device to say. Watches that no command is sent while
/// another one waits for its answer.
#include <algorithm>
#include <deque>
#include <functional>
#include <string>
#include <vector>

#include "drivers/usb/channel.hpp"

namespace drivers::phantom::testing {

class ScriptedChannel final : public usb::Channel {
 public:
  static constexpr std::uint64_t kAnswerNs = 300'000;
  /// From a command's text (without LF) to what comes back; empty: nothing does.
  using Device = std::function<std::string(const std::string&)>;
  explicit ScriptedChannel(Device device) : device_(std::move(device)) {}

  [[nodiscard]] std::uint64_t now_ns() const noexcept override { return now_ns_; }
  [[nodiscard]] usb::UsbStatus sleep_until(std::uint64_t deadline_ns) noexcept override {
    now_ns_ = std::max(now_ns_, deadline_ns);
    return usb::UsbStatus::kOk;
  }
  [[nodiscard]] usb::UsbStatus control_out(const usb::Setup& setup, std::span<const std::uint8_t> data,
                                           std::uint64_t) noexcept override {
    controls.push_back({setup, {data.begin(), data.end()}});
    return control_status;
  }
  [[nodiscard]] usb::UsbStatus control_in(const usb::Setup&, std::span<std::uint8_t>, std::size_t& got,
                                          std::uint64_t) noexcept override {
    got = 0;
    return usb::UsbStatus::kStall;
  }
  [[nodiscard]] usb::UsbStatus write(std::span<const std::uint8_t> bytes, std::uint64_t) noexcept override {
    if (lost) return usb::UsbStatus::kLost;
    if (!answers_.empty() && answers_.front().ready_ns > now_ns_) ++pipelined;
    std::string text(bytes.begin(), bytes.end());
    if (!text.empty() && text.back() == '\n') text.pop_back();
    commands.push_back(text);
    std::string answer = device_(text);
    if (!answer.empty()) answers_.push_back({now_ns_ + kAnswerNs + extra_delay_ns, std::move(answer)});
    return usb::UsbStatus::kOk;
  }
  [[nodiscard]] usb::UsbStatus read(std::span<std::uint8_t> out, std::size_t& got,
                                    std::uint64_t deadline_ns) noexcept override {
    got = 0;
    if (lost) return usb::UsbStatus::kLost;
    if (answers_.empty() || answers_.front().ready_ns > deadline_ns) {
      now_ns_ = std::max(now_ns_, deadline_ns);
      return usb::UsbStatus::kTimeout;
    }
    now_ns_ = std::max(now_ns_, answers_.front().ready_ns);
    const std::string answer = answers_.front().text;
    answers_.pop_front();
    got = std::min(out.size(), answer.size());
    std::copy_n(answer.begin(), got, out.begin());
    return usb::UsbStatus::kOk;
  }
  [[nodiscard]] std::size_t read_size() const noexcept override { return 512; }

  struct Control {
    usb::Setup setup;
    std::vector<int> data;
  };
  std::vector<Control> controls;
  std::vector<std::string> commands;
  int pipelined = 0;
  bool lost = false;
  usb::UsbStatus control_status = usb::UsbStatus::kOk;
  std::uint64_t extra_delay_ns = 0;

 private:
  struct Answer {
    std::uint64_t ready_ns;
    std::string text;
  };
  Device device_;
  std::deque<Answer> answers_;
  std::uint64_t now_ns_ = 1'000'000'000;
};

}  // namespace drivers::phantom::testing
