#include "drivers/virtual_usb/urb_queue.hpp"

#include <algorithm>
#include <span>
#include <utility>

namespace drivers::virtual_usb {

namespace {

// Bytes besides the payload that a bulk transaction takes on the wire (USB 2.0, tables 5-9 and 5-10).
constexpr std::size_t kOverheadFullSpeed = 13, kOverheadHighSpeed = 55;
// A NAK that asks for a retry in the past is retried this much later: time must go on.
constexpr std::uint64_t kShortestRetryNs = 1000;
constexpr std::uint8_t kIn = 0x80;

}  // namespace

UrbQueue::UrbQueue(UsbDevice& device) : device_(device), standard_(device) {
  lines_[0].max_packet = 64;
  for (const Endpoint& endpoint : standard_.configuration().endpoints) {
    lines_[endpoint.address].max_packet = std::max<std::uint16_t>(endpoint.max_packet, 1);
  }
}

void UrbQueue::submit(Urb urb, std::uint64_t now_ns) {
  urb.submitted_ns = now_ns;
  urb.actual = 0;
  if (urb.endpoint == 0 ? (urb.setup.request_type & kIn) != 0 : (urb.endpoint & kIn) != 0) urb.data.clear();
  const auto line = lines_.find(urb.endpoint);
  if (!plugged_ || line == lines_.end()) {
    urb.status = plugged_ ? kUrbStall : kUrbGone;
    done_.push_back(std::move(urb));
    return;
  }
  poke(now_ns);  // a line that waits for something to happen: here it is
  line->second.urbs.push_back(std::move(urb));
}

void UrbQueue::poke(std::uint64_t now_ns) noexcept {
  for (auto& [address, line] : lines_) {
    if (line.retry_ns == kNever) line.retry_ns = now_ns;
  }
}

bool UrbQueue::discard(std::uint64_t id, Urb& out) {
  for (auto& [address, line] : lines_) {
    const auto urb = std::find_if(line.urbs.begin(), line.urbs.end(), [&](const Urb& each) { return each.id == id; });
    if (urb == line.urbs.end()) continue;
    out = std::move(*urb);
    out.status = kUrbCancelled;
    line.urbs.erase(urb);
    return true;
  }
  return false;
}

bool UrbQueue::take_done(Urb& out) {
  if (done_.empty()) return false;
  out = std::move(done_.front());
  done_.pop_front();
  return true;
}

std::size_t UrbQueue::pending() const noexcept {
  std::size_t count = 0;
  for (const auto& [address, line] : lines_) count += line.urbs.size();
  return count;
}

void UrbQueue::forget() {
  for (auto& [address, line] : lines_) line.urbs.clear();
  done_.clear();
}

void UrbQueue::unplug() {
  plugged_ = false;
  for (auto& [address, line] : lines_) {
    while (!line.urbs.empty()) finish(line, kUrbGone);
  }
}

void UrbQueue::plug(std::uint64_t now_ns) {
  plugged_ = true;
  for (auto& [address, line] : lines_) line.retry_ns = 0;
  standard_.reset(now_ns);
}

std::uint64_t UrbQueue::ready_ns(const Line& line) const noexcept {
  if (line.urbs.empty() || line.retry_ns == kNever) return kNever;
  return std::max({bus_free_ns_, line.retry_ns, line.urbs.front().submitted_ns});
}

std::uint64_t UrbQueue::pump(std::uint64_t now_ns) {
  for (;;) {
    std::uint64_t earliest_ns = kNever;
    std::map<std::uint8_t, Line>::iterator first = lines_.end();
    for (auto line = lines_.begin(); line != lines_.end(); ++line) {
      if (const std::uint64_t t_ns = ready_ns(line->second); t_ns < earliest_ns) {
        earliest_ns = t_ns;
        first = line;
      }
    }
    if (earliest_ns > now_ns) return earliest_ns;
    one_packet(first->first, first->second, earliest_ns);
  }
}

void UrbQueue::one_packet(std::uint8_t endpoint, Line& line, std::uint64_t t_ns) {
  if (endpoint == 0) {
    control(line, t_ns);
  } else if (standard_.halted(endpoint)) {
    occupy_bus(0, 1, t_ns);
    finish(line, kUrbStall);
  } else if ((endpoint & kIn) != 0) {
    in_packet(endpoint, line, t_ns);
  } else {
    out_packet(endpoint, line, t_ns);
  }
}

void UrbQueue::control(Line& line, std::uint64_t t_ns) {
  Urb& urb = line.urbs.front();
  auto reply = standard_.answer(urb.setup, urb.setup_length, t_ns);
  if (!reply) reply = device_.control(urb.setup, urb.data, urb.setup_length, t_ns);
  if (reply->reply == Reply::kNak) return nak(line, *reply, t_ns);
  if (reply->reply == Reply::kStall) {
    occupy_bus(8, 2, t_ns);
    return finish(line, kUrbStall);
  }
  if ((urb.setup.request_type & kIn) != 0) {
    urb.data = std::move(reply->bytes);
    const std::size_t most = std::min<std::size_t>(urb.setup_length, urb.length);
    if (urb.data.size() > most) urb.data.resize(most);
  }
  urb.actual = urb.data.size();
  occupy_bus(8 + urb.actual, 3, t_ns);  // set-up, data and status stage
  finish(line, urb.short_not_ok && urb.actual < urb.length ? kUrbShort : kUrbOk);
}

void UrbQueue::out_packet(std::uint8_t endpoint, Line& line, std::uint64_t t_ns) {
  Urb& urb = line.urbs.front();
  const std::size_t size = std::min<std::size_t>(urb.data.size() - urb.actual, line.max_packet);
  const bool closing = urb.actual == urb.data.size();  // an empty transfer, or the empty packet behind a full one
  const auto reply = device_.out_packet(endpoint, std::span(urb.data).subspan(urb.actual, size), t_ns);
  if (reply.reply == Reply::kNak) return nak(line, reply, t_ns);
  occupy_bus(size, 1, t_ns);
  if (reply.reply == Reply::kStall) {
    standard_.halt(endpoint);
    return finish(line, kUrbStall);
  }
  urb.actual += size;
  urb.zero_sent = urb.zero_sent || closing;
  if (urb.actual < urb.data.size()) return;
  const bool owes_empty = urb.zero_packet && !urb.zero_sent && urb.data.size() % line.max_packet == 0;
  if (!owes_empty) finish(line, kUrbOk);
}

void UrbQueue::in_packet(std::uint8_t endpoint, Line& line, std::uint64_t t_ns) {
  Urb& urb = line.urbs.front();
  const auto reply = device_.in_packet(static_cast<std::uint8_t>(endpoint & 0x0f), t_ns);
  if (reply.reply == Reply::kNak) return nak(line, reply, t_ns);
  occupy_bus(reply.bytes.size(), 1, t_ns);
  if (reply.reply == Reply::kStall) {
    standard_.halt(endpoint);
    return finish(line, kUrbStall);
  }
  const std::size_t room = urb.length - urb.data.size();
  const std::size_t taken = std::min(room, reply.bytes.size());
  urb.data.insert(urb.data.end(), reply.bytes.begin(), reply.bytes.begin() + static_cast<std::ptrdiff_t>(taken));
  urb.actual = urb.data.size();
  if (reply.bytes.size() > room || reply.bytes.size() > line.max_packet) return finish(line, kUrbOverflow);
  const bool is_short = reply.bytes.size() < line.max_packet;
  if (is_short && urb.short_not_ok && urb.actual < urb.length) return finish(line, kUrbShort);
  if (is_short || urb.actual == urb.length) finish(line, kUrbOk);
}

void UrbQueue::nak(Line& line, const PacketReply& reply, std::uint64_t t_ns) noexcept {
  line.retry_ns = reply.retry_ns == 0 ? kNever : std::max(reply.retry_ns, t_ns + kShortestRetryNs);
}

void UrbQueue::finish(Line& line, int status) {
  line.urbs.front().status = status;
  done_.push_back(std::move(line.urbs.front()));
  line.urbs.pop_front();
}

void UrbQueue::occupy_bus(std::size_t bytes, int packets, std::uint64_t t_ns) noexcept {
  const bool high = device_.descriptors().high_speed;
  const std::size_t total =
      bytes + static_cast<std::size_t>(packets) * (high ? kOverheadHighSpeed : kOverheadFullSpeed);
  const std::uint64_t bits = 8 * total;
  bus_free_ns_ = t_ns + (high ? bits * 1000 / 480 : bits * 1000 / 12);
  // Something has happened: who waited for that may try again. Others keep to their own time.
  poke(bus_free_ns_);
}

}  // namespace drivers::virtual_usb
