#include "drivers/virtual_usb/virtual_channel.hpp"

#include <algorithm>
#include <utility>

namespace drivers::virtual_usb {

using usb::UsbStatus;

namespace {

UsbStatus status_of(int result) {
  switch (result) {
    case kUrbOk:
      return UsbStatus::kOk;
    case kUrbStall:
      return UsbStatus::kStall;
    case kUrbGone:
      return UsbStatus::kLost;
    default:
      return UsbStatus::kError;
  }
}

}  // namespace

VirtualChannel::VirtualChannel(UsbDevice& device, VirtualChannelOptions options)
    : queue_(device), now_ns_(options.start_ns), posted_wanted_(options.posted) {
  std::uint16_t packet = 64;
  for (const Endpoint& endpoint : queue_.configuration().endpoints) {
    if (endpoint.interface != options.interfaces.back() || endpoint.type != EndpointType::kBulk) continue;
    if ((endpoint.address & 0x80) != 0 && in_ == 0) {
      in_ = endpoint.address;
      packet = endpoint.max_packet;
    } else if ((endpoint.address & 0x80) == 0 && out_ == 0) {
      out_ = endpoint.address;
    }
  }
  read_size_ = static_cast<std::size_t>(options.read_packets) * packet;
  if (options.faults.unplug_at_s >= 0.0) {
    unplug_ns_ = options.start_ns + static_cast<std::uint64_t>(options.faults.unplug_at_s * 1e9);
  }
  queue_.plug(now_ns_);
  post_reads();
}

void VirtualChannel::replug() {
  unplug_ns_ = kNever;
  arrived_.clear();
  others_.clear();
  posted_ = 0;
  stalled_ = false;
  queue_.plug(now_ns_);
  post_reads();
}

void VirtualChannel::post_reads() {
  if (in_ == 0) return;
  for (; posted_ < posted_wanted_; ++posted_) {
    Urb urb;
    urb.id = next_id_++;
    urb.endpoint = in_;
    urb.length = read_size_;
    queue_.submit(std::move(urb), now_ns_);
  }
}

void VirtualChannel::sort_done() {
  Urb done;
  while (queue_.take_done(done)) {
    if (done.endpoint != 0 && done.endpoint == in_) {
      --posted_;
      // After a stall every posted transfer comes back with one; the reader hears of the first, the halt is cleared
      // after the last.
      const bool told = stalled_;
      stalled_ = done.status == kUrbStall && posted_ > 0;
      if (done.status == kUrbStall && posted_ == 0) queue_.clear_halt(in_);
      if (told && done.status == kUrbStall) continue;
      arrived_.push_back(std::move(done));
    } else {
      others_.push_back(std::move(done));
    }
  }
  if (queue_.plugged() && !queue_.halted(in_)) post_reads();
}

UsbStatus VirtualChannel::advance(std::uint64_t deadline_ns) noexcept {
  if (now_ns_ >= stop_ns_) return UsbStatus::kStopping;
  if (now_ns_ >= unplug_ns_ && queue_.plugged()) queue_.unplug();
  if (!queue_.plugged()) return UsbStatus::kLost;
  const std::uint64_t next_ns = queue_.pump(now_ns_);
  if (queue_.has_done()) {
    sort_done();
    return UsbStatus::kOk;
  }
  if (now_ns_ >= deadline_ns) return UsbStatus::kTimeout;
  now_ns_ = std::max(now_ns_, std::min({next_ns, deadline_ns, stop_ns_, unplug_ns_}));
  return UsbStatus::kOk;
}

UsbStatus VirtualChannel::sleep_until(std::uint64_t deadline_ns) noexcept {
  for (;;) {
    if (now_ns_ >= deadline_ns && now_ns_ < stop_ns_) return UsbStatus::kOk;
    const UsbStatus status = advance(deadline_ns);
    if (status == UsbStatus::kTimeout) return UsbStatus::kOk;
    if (status != UsbStatus::kOk) return status;
  }
}

UsbStatus VirtualChannel::run(Urb urb, Urb& out, std::uint64_t deadline_ns) noexcept {
  const std::uint64_t id = urb.id = next_id_++;
  if (now_ns_ >= stop_ns_) return UsbStatus::kStopping;
  queue_.submit(std::move(urb), now_ns_);
  for (;;) {
    sort_done();
    const auto mine = std::find_if(others_.begin(), others_.end(), [&](const Urb& each) { return each.id == id; });
    if (mine != others_.end()) {
      out = std::move(*mine);
      others_.erase(mine);
      if (out.status == kUrbStall) queue_.clear_halt(out.endpoint);
      return status_of(out.status);
    }
    const UsbStatus status = advance(deadline_ns);
    if (status != UsbStatus::kOk) {
      (void)queue_.discard(id, out);
      return status;
    }
  }
}

UsbStatus VirtualChannel::control_out(const usb::Setup& setup, std::span<const std::uint8_t> data,
                                      std::uint64_t deadline_ns) noexcept {
  Urb urb;
  urb.setup = setup;
  urb.setup.request_type &= 0x7f;
  urb.setup_length = static_cast<std::uint16_t>(data.size());
  urb.data.assign(data.begin(), data.end());
  Urb done;
  return run(std::move(urb), done, deadline_ns);
}

UsbStatus VirtualChannel::control_in(const usb::Setup& setup, std::span<std::uint8_t> data, std::size_t& got,
                                     std::uint64_t deadline_ns) noexcept {
  got = 0;
  Urb urb;
  urb.setup = setup;
  urb.setup.request_type |= 0x80;
  urb.setup_length = static_cast<std::uint16_t>(data.size());
  urb.length = data.size();
  Urb done;
  const UsbStatus status = run(std::move(urb), done, deadline_ns);
  if (status == UsbStatus::kOk) {
    got = std::min(done.data.size(), data.size());
    std::copy_n(done.data.begin(), got, data.begin());
  }
  return status;
}

UsbStatus VirtualChannel::write(std::span<const std::uint8_t> bytes, std::uint64_t deadline_ns) noexcept {
  Urb urb;
  urb.endpoint = out_;
  urb.data.assign(bytes.begin(), bytes.end());
  Urb done;
  if (out_ == 0) return UsbStatus::kError;
  return run(std::move(urb), done, deadline_ns);
}

UsbStatus VirtualChannel::read(std::span<std::uint8_t> out, std::size_t& got, std::uint64_t deadline_ns) noexcept {
  got = 0;
  for (;;) {
    // What arrived before an unplugging or a stop is still delivered, unless the driver is to end.
    if (now_ns_ >= stop_ns_) return UsbStatus::kStopping;
    sort_done();
    if (!arrived_.empty()) {
      const Urb first = std::move(arrived_.front());
      arrived_.pop_front();
      got = std::min(first.data.size(), out.size());
      std::copy_n(first.data.begin(), got, out.begin());
      return status_of(first.status);
    }
    const UsbStatus status = advance(deadline_ns);
    if (status != UsbStatus::kOk) return status;
  }
}

}  // namespace drivers::virtual_usb
