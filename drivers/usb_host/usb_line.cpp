#include "drivers/usb_host/usb_line.hpp"

#include <utility>

namespace drivers::usb {
namespace {

class UsbLine final : public io::Line {
 public:
  UsbLine(std::unique_ptr<Protocol> protocol, ChannelOpener opener)
      : protocol_(std::move(protocol)), open_(std::move(opener)) {}

  rtbus::Result<void, DeviceFault> connect(StopFlag& stop) override {
    auto channel = open_(stop);
    if (!channel) return rtbus::Failure{channel.error()};
    if (const auto up = protocol_->bring_up(**channel); !up) return rtbus::Failure{up.error()};
    channel_ = std::move(*channel);
    return {};
  }

  io::SendStatus send(const Vec3& force_n, double dt_s, bool live, std::uint64_t deadline_ns) noexcept override {
    protocol_->set_live(live);
    switch (protocol_->send(*channel_, force_n, dt_s, deadline_ns)) {
      case UsbStatus::kOk:
        return io::SendStatus::kSent;
      case UsbStatus::kLost:
        return io::SendStatus::kLost;
      case UsbStatus::kStopping:
        return io::SendStatus::kStopping;
      default:
        return io::SendStatus::kNothing;
    }
  }
  bool withheld() const noexcept override { return protocol_->withheld(); }
  ExchangeStatus receive(DeviceSample& out, std::uint64_t deadline_ns) noexcept override {
    return protocol_->receive(*channel_, out, deadline_ns);
  }
  void disconnect(bool reachable) noexcept override {
    if (reachable) protocol_->shut_down(*channel_);
    channel_.reset();
  }

  Readiness readiness() const noexcept override { return protocol_->readiness(); }
  std::string remedy() const override { return protocol_->remedy(); }
  std::string fault() const override { return protocol_->fault(); }
  const LinkCounters& counters() const noexcept override { return protocol_->counters(); }

 private:
  std::unique_ptr<Protocol> protocol_;
  ChannelOpener open_;
  std::unique_ptr<Channel> channel_;
};

}  // namespace

io::LineFactory line_of(ProtocolFactory protocol, ChannelOpener opener) {
  return [protocol = std::move(protocol), opener = std::move(opener)] {
    return std::unique_ptr<io::Line>(std::make_unique<UsbLine>(protocol(), opener));
  };
}

}  // namespace drivers::usb
