#pragma once
/// @file usb_line.hpp
/// A USB driver's Protocol on a Channel, as the line of an I/O device (drivers/io).
#include <functional>
#include <memory>

#include "drivers/io/io_device.hpp"
#include "drivers/usb/channel.hpp"
#include "drivers/usb/protocol.hpp"

namespace drivers::usb {

using io::ExchangeOrder;
using io::IoDevice;
using io::IoSettings;
using io::IoThread;
using io::LinkFigures;
using io::LinkState;
using io::StopFlag;

using ProtocolFactory = std::function<std::unique_ptr<Protocol>()>;
/// Opens the device; the fault is a sentence for the user. The channel asks `stop` in every wait.
using ChannelOpener = std::function<rtbus::Result<std::unique_ptr<Channel>, DeviceFault>(StopFlag& stop)>;

/// The protocol is made once per start of the device, a channel with every connection.
[[nodiscard]] io::LineFactory line_of(ProtocolFactory protocol, ChannelOpener opener);

[[nodiscard]] inline std::unique_ptr<IoDevice> make_io_device(IoSettings settings, IoThread thread,
                                                              ProtocolFactory protocol, ChannelOpener opener) {
  return std::make_unique<IoDevice>(std::move(settings), thread, line_of(std::move(protocol), std::move(opener)));
}

}  // namespace drivers::usb
