#include "drivers/virtual_usb/standard_requests.hpp"

#include <algorithm>
#include <utility>

namespace drivers::virtual_usb {

namespace {

// bRequest, table 9-4.
constexpr std::uint8_t kGetStatus = 0, kClearFeature = 1, kSetFeature = 3, kSetAddress = 5, kGetDescriptor = 6,
                       kGetConfiguration = 8, kSetConfiguration = 9, kGetInterface = 10, kSetInterface = 11;
// Descriptor types, table 9-5.
constexpr std::uint8_t kDevice = 1, kConfiguration = 2, kString = 3;
constexpr std::uint8_t kTypeMask = 0x60, kRecipientMask = 0x1f, kToEndpoint = 2;
constexpr std::uint16_t kEndpointHalt = 0;
constexpr std::uint16_t kEnglish = 0x0409;

PacketReply stall() { return {Reply::kStall, {}, 0}; }
PacketReply ack(std::vector<std::uint8_t> bytes = {}) { return {Reply::kAck, std::move(bytes), 0}; }

}  // namespace

StandardRequests::StandardRequests(UsbDevice& device)
    : device_(device), configuration_(parse_configuration(device.descriptors().configuration)) {}

void StandardRequests::reset(std::uint64_t now_ns) {
  halted_.clear();
  device_.bus_reset(now_ns);
}

PacketReply StandardRequests::descriptor(std::uint8_t type, std::uint8_t index) const {
  const Descriptors& all = device_.descriptors();
  if (type == kDevice) return ack(all.device);
  if (type == kConfiguration && index == 0) return ack(all.configuration);
  if (type == kString && index <= all.strings.size()) {
    std::vector<std::uint8_t> out{0, kString};
    const std::u16string text =
        index == 0 ? std::u16string(1, static_cast<char16_t>(kEnglish)) : all.strings[index - 1];
    for (const char16_t letter : text) {
      out.push_back(static_cast<std::uint8_t>(letter & 0xff));
      out.push_back(static_cast<std::uint8_t>(letter >> 8));
    }
    out[0] = static_cast<std::uint8_t>(out.size());
    return ack(std::move(out));
  }
  return stall();  // also the device qualifier: hosts ask it, and a device of one speed must refuse (9.6.2)
}

std::optional<PacketReply> StandardRequests::answer(const usb::Setup& setup, std::uint16_t length,
                                                    std::uint64_t now_ns) {
  if ((setup.request_type & kTypeMask) != 0) return std::nullopt;
  const auto endpoint = static_cast<std::uint8_t>(setup.index & 0x8f);
  const bool to_endpoint = (setup.request_type & kRecipientMask) == kToEndpoint;
  PacketReply reply = stall();
  switch (setup.request) {
    case kGetDescriptor:
      reply = descriptor(static_cast<std::uint8_t>(setup.value >> 8), static_cast<std::uint8_t>(setup.value & 0xff));
      break;
    case kGetStatus:
      if (to_endpoint) {
        reply = ack({static_cast<std::uint8_t>(halted(endpoint) ? 1 : 0), 0});
      } else {
        reply = ack({static_cast<std::uint8_t>((configuration_.attributes >> 6) & 1), 0});  // bit 0: self-powered
      }
      break;
    case kClearFeature:
      if (to_endpoint && setup.value == kEndpointHalt) clear_halt(endpoint);
      reply = ack();
      break;
    case kSetFeature:
      if (to_endpoint && setup.value == kEndpointHalt && configuration_.find(endpoint) != nullptr) halt(endpoint);
      reply = ack();
      break;
    case kSetAddress:
      reply = ack();
      break;
    case kGetConfiguration:
      reply = ack({configured_});
      break;
    case kSetConfiguration:
      if (setup.value == 0 || setup.value == configuration_.value) {
        configured_ = static_cast<std::uint8_t>(setup.value);
        reset(now_ns);
        reply = ack();
      }
      break;
    case kGetInterface:
      reply = ack({0});
      break;
    case kSetInterface:
      if (setup.value == 0) reply = ack();
      break;
    default:
      break;
  }
  if (reply.bytes.size() > length) reply.bytes.resize(length);
  return reply;
}

}  // namespace drivers::virtual_usb
