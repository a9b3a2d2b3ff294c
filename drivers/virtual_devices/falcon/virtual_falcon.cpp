#include "drivers/virtual_devices/falcon/virtual_falcon.hpp"

#include <algorithm>
#include <utility>

#include "drivers/falcon/falcon_protocol.hpp"

namespace drivers::virtual_usb {
namespace {

namespace ftdi = falcon::ftdi;

constexpr std::uint8_t kEndpointIn = 1;
constexpr std::uint8_t kEndpointOut = 2;
constexpr std::uint8_t kModemStatus = 0x01;
// The chip's buffers, from its data sheet.
constexpr std::size_t kSendBufferBytes = 128;
constexpr std::size_t kReceiveBufferBytes = 256;
// How long a refused IN packet waits at most before it is asked for again: what arrives meanwhile may complete it.
constexpr std::uint64_t kAskAgainNs = 1'000'000;
constexpr std::uint64_t kAskAgainEventNs = 50'000;

std::u16string widen(const std::string& text) { return {text.begin(), text.end()}; }

Descriptors make_descriptors(const std::string& serial) {
  constexpr auto low = [](int v) { return static_cast<std::uint8_t>(v & 0xFF); };
  constexpr auto high = [](int v) { return static_cast<std::uint8_t>(v >> 8); };
  Descriptors out;
  // bcdUSB 2.00, endpoint 0 of 8 bytes; bcdDevice 6.00 is how an FT232R is recognised.
  out.device = {18,
                1,
                0x00,
                0x02,
                0,
                0,
                0,
                8,
                low(falcon::kVendorId),
                high(falcon::kVendorId),
                low(falcon::kProductId),
                high(falcon::kProductId),
                0x00,
                0x06,
                1,
                2,
                3,
                1};
  out.configuration = {9, 2, 32,   0, 1,  1,    0,    0xA0, 45,  // one configuration, bus-powered, 90 mA
                       9, 4, 0,    0, 2,  0xFF, 0xFF, 0xFF, 2,   // interface 0, vendor class
                       7, 5, 0x81, 2, 64, 0,    0,               // bulk IN
                       7, 5, 0x02, 2, 64, 0,    0};              // bulk OUT
  out.strings = {u"NOVINT", u"FALCON HAPTIC", widen(serial)};
  return out;
}

}  // namespace

VirtualFalcon::VirtualFalcon(VirtualFalconSettings settings)
    : settings_(std::move(settings)),
      arm_(settings_.arm),
      board_(arm_, settings_.board),
      descriptors_(make_descriptors(settings_.serial)),
      random_(settings_.board.seed + 1) {}

void VirtualFalcon::wake(std::uint64_t now_ns) {
  if (!powered_) power_cycle(now_ns);
}

void VirtualFalcon::power_cycle(std::uint64_t now_ns) {
  powered_ = true;
  arm_.power_up(now_ns);
  board_.power_up(now_ns);
}

void VirtualFalcon::bus_reset(std::uint64_t now_ns) {
  wake(now_ns);
  sender_free_ns_ = now_ns;
  last_in_ns_ = now_ns;
  latency_ms_ = 16;
  event_enabled_ = false;
  line_errors_ = 0;
  discard_received(now_ns);
}

PacketReply VirtualFalcon::control(const usb::Setup& setup, std::span<const std::uint8_t>, std::uint16_t length,
                                   std::uint64_t now_ns) {
  wake(now_ns);
  constexpr std::size_t kMostRemembered = 10'000;
  if (requests_.size() < kMostRemembered) requests_.push_back(setup);
  PacketReply out;
  if ((setup.request_type & 0x80) == 0) {
    if ((setup.request_type & 0x60) == 0x40) vendor_request(setup, now_ns);
    return out;  // what it does not know it takes, like the chip
  }
  if (setup.request == ftdi::kGetLatency) {
    out.bytes = {latency_ms_};
  } else if (setup.request == ftdi::kModemStatus) {
    out.bytes = {kModemStatus, ftdi::kTransmitterEmpty};
  } else {
    out.bytes.assign(2, 0);
  }
  out.bytes.resize(std::min<std::size_t>(out.bytes.size(), length));
  return out;
}

void VirtualFalcon::vendor_request(const usb::Setup& setup, std::uint64_t now_ns) {
  switch (setup.request) {
    case ftdi::kReset:
      if (setup.value != 1) discard_received(now_ns);  // 1 discards what has not been sent yet: it is on its way
      if (setup.value == 0) {
        board_.set_dtr(false, now_ns);
        event_enabled_ = false;
      }
      return;
    case ftdi::kModemControl:
      if ((setup.value & 0x0100U) != 0) board_.set_dtr((setup.value & 1U) != 0, now_ns);
      return;
    case ftdi::kBaudRate: {
      const ftdi::Baud rate = ftdi::baud_of(setup.value, setup.index);
      if (rate.actual_hz > 0.0) baud_ = rate;
      return;
    }
    case ftdi::kSetLatency:
      latency_ms_ = static_cast<std::uint8_t>(std::max(1, setup.value & 0xFF));
      return;
    case ftdi::kEventCharacter:
      event_character_ = static_cast<std::uint8_t>(setup.value & 0xFFU);
      event_enabled_ = (setup.value & 0x0100U) != 0;
      return;
    default:
      return;
  }
}

void VirtualFalcon::discard_received(std::uint64_t now_ns) {
  auto& bytes = board_.outgoing();
  while (!bytes.empty() && bytes.front().time_ns <= now_ns) bytes.pop_front();
}

PacketReply VirtualFalcon::out_packet(std::uint8_t endpoint, std::span<const std::uint8_t> bytes,
                                      std::uint64_t now_ns) {
  wake(now_ns);
  if (endpoint != kEndpointOut) return {Reply::kStall, {}, 0};
  const std::uint64_t byte_ns = byte_time_ns(baud_.actual_hz);
  const std::uint64_t backlog_ns = sender_free_ns_ > now_ns ? sender_free_ns_ - now_ns : 0;
  const std::uint64_t room_ns = (kSendBufferBytes - std::min(kSendBufferBytes, bytes.size())) * byte_ns;
  if (backlog_ns > room_ns) return {Reply::kNak, {}, now_ns + backlog_ns - room_ns};
  sender_free_ns_ = std::max(sender_free_ns_, now_ns);
  for (const std::uint8_t byte : bytes) {
    sender_free_ns_ += byte_ns;
    board_.receive(byte, baud_.actual_hz, sender_free_ns_);
  }
  return {};
}

// The newest bytes find no room when the host does not fetch.
void VirtualFalcon::drop_overrun(std::uint64_t now_ns) {
  auto& bytes = board_.outgoing();
  const auto arrived = std::partition_point(bytes.begin(), bytes.end(),
                                            [now_ns](const LineByte& byte) { return byte.time_ns <= now_ns; });
  if (static_cast<std::size_t>(arrived - bytes.begin()) <= kReceiveBufferBytes) return;
  bytes.erase(bytes.begin() + kReceiveBufferBytes, arrived);
  line_errors_ |= ftdi::kOverrun;
}

// A packet leaves when its payload is full, when the event character has come, or when the latency timer has run out.
bool VirtualFalcon::packet_due(std::uint64_t now_ns, std::size_t& bytes, std::uint64_t& retry_ns) const {
  const std::deque<LineByte>& line = board_.outgoing();
  bytes = 0;
  std::size_t until_event = 0;
  std::size_t until_split = 0;
  while (bytes < line.size() && bytes < ftdi::kPayloadBytes && line[bytes].time_ns <= now_ns) {
    ++bytes;
    if (line[bytes - 1].may_split && until_split == 0) until_split = bytes;
    if (event_enabled_ && line[bytes - 1].value == event_character_) until_event = bytes;
  }
  if (bytes == ftdi::kPayloadBytes) return true;
  if (until_event > 0) {
    bytes = until_event;
    return true;
  }
  const std::uint64_t timer_ns = last_in_ns_ + std::uint64_t{latency_ms_} * 1'000'000;
  if (now_ns >= timer_ns) {
    // Half a reply has arrived: wait for the rest, unless a fault splits it here.
    if (bytes > 0 && !line[bytes - 1].ends_reply && until_split != bytes && bytes < line.size()) {
      retry_ns = line[bytes].time_ns;
      return false;
    }
    return true;
  }
  retry_ns = std::min(timer_ns, now_ns + (event_enabled_ ? kAskAgainEventNs : kAskAgainNs));
  return board_.faults().status_flood;
}

PacketReply VirtualFalcon::in_packet(std::uint8_t endpoint, std::uint64_t now_ns) {
  wake(now_ns);
  if (endpoint != kEndpointIn) return {Reply::kStall, {}, 0};
  arm_.advance_to(now_ns);
  drop_overrun(now_ns);
  PacketReply out;
  std::size_t bytes = 0;
  if (!packet_due(now_ns, bytes, out.retry_ns)) {
    out.reply = Reply::kNak;
    return out;
  }
  const Faults& faults = board_.faults();
  if (faults.stall_in > 0.0 && static_cast<double>(random_() >> 11) * 0x1p-53 < faults.stall_in) {
    return {Reply::kStall, {}, 0};
  }
  out.retry_ns = 0;
  auto& line = board_.outgoing();
  std::uint8_t status = ftdi::kTransmitterEmpty | line_errors_;
  if (faults.overrun) status |= ftdi::kOverrun;
  line_errors_ = 0;
  out.bytes = {kModemStatus, 0};
  for (std::size_t i = 0; i < bytes; ++i) {
    const LineByte byte = line.front();
    line.pop_front();
    if (same_rate(baud_.actual_hz, byte.baud_hz)) {
      out.bytes.push_back(byte.value);
    } else {  // the chip listened at another rate
      out.bytes.push_back(static_cast<std::uint8_t>(byte.value ^ 0xAA));
      status |= ftdi::kFramingError;
    }
  }
  out.bytes[1] = status;
  last_in_ns_ = now_ns;
  return out;
}

}  // namespace drivers::virtual_usb
