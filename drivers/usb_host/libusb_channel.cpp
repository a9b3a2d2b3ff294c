#include "drivers/usb_host/libusb_channel.hpp"

#include <libusb.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <utility>

#include "rtbus/clock.hpp"

namespace drivers::usb {

namespace {

constexpr std::size_t kLargestControl = 512;
constexpr std::size_t kLargestWrite = 4096;
/// A cancelled transfer comes back at once; one that does not in this time is the kernel's fault and is given up.
constexpr std::uint64_t kCancelPatienceNs = rtbus::kNsPerS;

}  // namespace

LibusbChannel::LibusbChannel(Context context, int fd, StopFlag& stop)
    : context_(std::move(context)), fd_(fd), stop_(stop) {
  stop_.set_waker([ctx = context_.get()] { libusb_interrupt_event_handler(ctx); });
}

rtbus::Result<std::unique_ptr<Channel>, DeviceFault> LibusbChannel::open(const DeviceMatch& match, StopFlag& stop) {
  auto context = make_context(true);
  if (!context) return rtbus::Failure{context.error()};
  std::unique_ptr<LibusbChannel> channel(new LibusbChannel(std::move(*context), -1, stop));
  auto handle = open_device(channel->context_.get(), match);
  if (!handle) return rtbus::Failure{handle.error()};
  channel->handle_ = std::move(*handle);
  if (auto ready = channel->prepare(match); !ready) return rtbus::Failure{ready.error()};
  return std::unique_ptr<Channel>(std::move(channel));
}

rtbus::Result<std::unique_ptr<Channel>, DeviceFault> LibusbChannel::open_fd(int fd, const DeviceMatch& match,
                                                                            StopFlag& stop) {
  auto context = make_context(false);
  if (!context) {
    ::close(fd);
    return rtbus::Failure{context.error()};
  }
  std::unique_ptr<LibusbChannel> channel(new LibusbChannel(std::move(*context), fd, stop));
  auto handle = wrap_device(channel->context_.get(), fd);
  if (!handle) return rtbus::Failure{handle.error()};
  channel->handle_ = std::move(*handle);
  if (auto ready = channel->prepare(match); !ready) return rtbus::Failure{ready.error()};
  return std::unique_ptr<Channel>(std::move(channel));
}

rtbus::Result<void, DeviceFault> LibusbChannel::prepare(const DeviceMatch& match) {
  libusb_set_auto_detach_kernel_driver(handle_.get(), 1);
  for (const int interface : match.interfaces) {
    if (const int error = libusb_claim_interface(handle_.get(), interface); error != 0) {
      libusb_device* const device = libusb_get_device(handle_.get());
      char node[40];
      std::snprintf(node, sizeof node, "/dev/bus/usb/%03d/%03d", libusb_get_bus_number(device),
                    libusb_get_device_address(device));
      return rtbus::Failure{
          DeviceFault{explain(error, "claiming USB interface " + std::to_string(interface), users_of({node}))}};
    }
    claimed_.push_back(interface);
  }
  if (auto found = find_endpoints(match.interfaces.back()); !found) return found;

  const auto equip = [this](Slot& slot, std::size_t bytes) {
    slot.channel = this;
    slot.buffer.resize(bytes);
    slot.transfer = libusb_alloc_transfer(0);
    return slot.transfer != nullptr;
  };
  bool equipped = equip(control_, LIBUSB_CONTROL_SETUP_SIZE + kLargestControl) && equip(out_slot_, kLargestWrite);
  for (Slot& slot : in_slots_) {
    slot.in = true;
    equipped = equip(slot, read_size_) && equipped;
  }
  if (!equipped) return rtbus::Failure{DeviceFault{"no memory for USB transfers"}};
  libusb_fill_bulk_transfer(out_slot_.transfer, handle_.get(), out_, out_slot_.buffer.data(), 0, &completed, &out_slot_,
                            0);
  for (Slot& slot : in_slots_) {
    libusb_fill_bulk_transfer(slot.transfer, handle_.get(), in_, slot.buffer.data(), static_cast<int>(read_size_),
                              &completed, &slot, 0);
  }
  if (post_reads() != UsbStatus::kOk) {
    return rtbus::Failure{DeviceFault{"the USB device takes no transfers; unplug it and plug it in again"}};
  }
  return {};
}

rtbus::Result<void, DeviceFault> LibusbChannel::find_endpoints(int interface) {
  libusb_config_descriptor* raw = nullptr;
  if (const int error = libusb_get_active_config_descriptor(libusb_get_device(handle_.get()), &raw); error != 0) {
    return rtbus::Failure{DeviceFault{explain(error, "reading the USB configuration")}};
  }
  const std::unique_ptr<libusb_config_descriptor, void (*)(libusb_config_descriptor*)> config(
      raw, &libusb_free_config_descriptor);
  for (int i = 0; i < config->bNumInterfaces; ++i) {
    const libusb_interface& each = config->interface[i];
    if (each.num_altsetting < 1 || each.altsetting[0].bInterfaceNumber != interface) continue;
    for (int e = 0; e < each.altsetting[0].bNumEndpoints; ++e) {
      const libusb_endpoint_descriptor& endpoint = each.altsetting[0].endpoint[e];
      if ((endpoint.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK) continue;
      const bool in = (endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN) != 0;
      if (in && in_ == 0) {
        in_ = endpoint.bEndpointAddress;
        read_size_ = std::max<std::size_t>(endpoint.wMaxPacketSize & 0x7ff, 1);
      } else if (!in && out_ == 0) {
        out_ = endpoint.bEndpointAddress;
      }
    }
  }
  if (in_ != 0 && out_ != 0) return {};
  return rtbus::Failure{DeviceFault{"USB interface " + std::to_string(interface) +
                                    " has no pair of bulk endpoints: this is another kind of device"}};
}

LibusbChannel::~LibusbChannel() {
  stop_.set_waker({});
  bool all_back = true;
  const auto retire = [&](Slot& slot) {
    if (slot.transfer == nullptr) return;
    take_back(slot);
    // One that never came back stays allocated: freeing it would be worse.
    if (slot.done != 0) {
      libusb_free_transfer(slot.transfer);
    } else {
      all_back = false;
    }
  };
  for (Slot& slot : in_slots_) {
    if (slot.done == 0) libusb_cancel_transfer(slot.transfer);
  }
  for (Slot& slot : in_slots_) retire(slot);
  retire(out_slot_);
  retire(control_);
  if (handle_) {
    for (const int interface : claimed_) libusb_release_interface(handle_.get(), interface);
  }
  if (!all_back) {
    (void)handle_.release();
    (void)context_.release();
    return;
  }
  handle_.reset();
  if (fd_ >= 0) ::close(fd_);
}

std::uint64_t LibusbChannel::now_ns() const noexcept { return rtbus::monotonic_ns(); }

UsbStatus LibusbChannel::sleep_until(std::uint64_t deadline_ns) noexcept {
  // Transfers go on in the kernel meanwhile.
  if (stop_.ends_waits() || stop_.sleep_until(deadline_ns)) return UsbStatus::kStopping;
  return lost_ ? UsbStatus::kLost : UsbStatus::kOk;
}

void LibusbChannel::completed(libusb_transfer* transfer) noexcept {
  Slot& slot = *static_cast<Slot*>(transfer->user_data);
  slot.done = 1;
  if (slot.in) slot.channel->arrived_.push_back(&slot);
}

UsbStatus LibusbChannel::submit(Slot& slot) noexcept {
  if (lost_) return UsbStatus::kLost;
  slot.done = 0;
  const int error = libusb_submit_transfer(slot.transfer);
  if (error == 0) return UsbStatus::kOk;
  slot.done = 1;
  if (error != LIBUSB_ERROR_NO_DEVICE) return UsbStatus::kError;
  lost_ = true;
  return UsbStatus::kLost;
}

UsbStatus LibusbChannel::outcome(const Slot& slot) noexcept {
  switch (slot.transfer->status) {
    case LIBUSB_TRANSFER_COMPLETED:
      return UsbStatus::kOk;
    case LIBUSB_TRANSFER_STALL:
      return UsbStatus::kStall;
    case LIBUSB_TRANSFER_NO_DEVICE:
      lost_ = true;
      return UsbStatus::kLost;
    default:
      return UsbStatus::kError;
  }
}

UsbStatus LibusbChannel::handle_events(std::uint64_t deadline_ns, int* done) noexcept {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  const std::uint64_t left_ns = deadline_ns > now_ns ? deadline_ns - now_ns : 0;
  timeval patience{};
  patience.tv_sec = static_cast<time_t>(left_ns / rtbus::kNsPerS);
  patience.tv_usec = static_cast<suseconds_t>(left_ns % rtbus::kNsPerS / rtbus::kNsPerUs);
  const int error = libusb_handle_events_timeout_completed(context_.get(), &patience, done);
  if (error == 0 || error == LIBUSB_ERROR_INTERRUPTED || error == LIBUSB_ERROR_TIMEOUT) return UsbStatus::kOk;
  return error == LIBUSB_ERROR_NO_DEVICE ? UsbStatus::kLost : UsbStatus::kError;
}

void LibusbChannel::take_back(Slot& slot) noexcept {
  if (slot.done != 0) return;
  libusb_cancel_transfer(slot.transfer);
  const std::uint64_t give_up_ns = rtbus::monotonic_ns() + kCancelPatienceNs;
  while (slot.done == 0 && rtbus::monotonic_ns() < give_up_ns) {
    if (handle_events(give_up_ns, &slot.done) != UsbStatus::kOk) break;
  }
  if (slot.done == 0) lost_ = true;
}

UsbStatus LibusbChannel::await(Slot& slot, std::uint64_t deadline_ns) noexcept {
  UsbStatus status = UsbStatus::kOk;
  while (slot.done == 0 && status == UsbStatus::kOk) {
    if (stop_.ends_waits()) {
      status = UsbStatus::kStopping;
    } else if (rtbus::monotonic_ns() >= deadline_ns) {
      status = UsbStatus::kTimeout;
    } else {
      status = handle_events(deadline_ns, &slot.done);
    }
  }
  if (slot.done != 0) return outcome(slot);
  take_back(slot);
  // It may have been done in the last moment.
  const bool moved = slot.done != 0 && slot.transfer->status == LIBUSB_TRANSFER_COMPLETED;
  return moved && status == UsbStatus::kTimeout ? UsbStatus::kOk : status;
}

UsbStatus LibusbChannel::control(const Setup& setup, std::size_t length, std::uint64_t deadline_ns) noexcept {
  libusb_fill_control_setup(control_.buffer.data(), setup.request_type, setup.request, setup.value, setup.index,
                            static_cast<std::uint16_t>(length));
  libusb_fill_control_transfer(control_.transfer, handle_.get(), control_.buffer.data(), &completed, &control_, 0);
  if (const UsbStatus status = submit(control_); status != UsbStatus::kOk) return status;
  return await(control_, deadline_ns);
}

UsbStatus LibusbChannel::control_out(const Setup& setup, std::span<const std::uint8_t> data,
                                     std::uint64_t deadline_ns) noexcept {
  if (data.size() > kLargestControl) return UsbStatus::kError;
  std::copy(data.begin(), data.end(), control_.buffer.begin() + LIBUSB_CONTROL_SETUP_SIZE);
  Setup out = setup;
  out.request_type &= 0x7f;
  return control(out, data.size(), deadline_ns);
}

UsbStatus LibusbChannel::control_in(const Setup& setup, std::span<std::uint8_t> data, std::size_t& got,
                                    std::uint64_t deadline_ns) noexcept {
  got = 0;
  if (data.size() > kLargestControl) return UsbStatus::kError;
  Setup in = setup;
  in.request_type |= 0x80;
  const UsbStatus status = control(in, data.size(), deadline_ns);
  if (status != UsbStatus::kOk) return status;
  got = std::min<std::size_t>(static_cast<std::size_t>(control_.transfer->actual_length), data.size());
  std::copy_n(control_.buffer.begin() + LIBUSB_CONTROL_SETUP_SIZE, got, data.begin());
  return status;
}

UsbStatus LibusbChannel::write(std::span<const std::uint8_t> bytes, std::uint64_t deadline_ns) noexcept {
  if (bytes.size() > kLargestWrite) return UsbStatus::kError;
  std::copy(bytes.begin(), bytes.end(), out_slot_.buffer.begin());
  out_slot_.transfer->length = static_cast<int>(bytes.size());
  UsbStatus status = submit(out_slot_);
  if (status == UsbStatus::kOk) status = await(out_slot_, deadline_ns);
  if (status == UsbStatus::kStall && libusb_clear_halt(handle_.get(), out_) == LIBUSB_ERROR_NO_DEVICE) {
    lost_ = true;
    status = UsbStatus::kLost;
  }
  return status;
}

UsbStatus LibusbChannel::post_reads() noexcept {
  for (Slot& slot : in_slots_) {
    if (slot.done == 0 || std::find(arrived_.begin(), arrived_.end(), &slot) != arrived_.end()) continue;
    if (const UsbStatus status = submit(slot); status != UsbStatus::kOk) return status;
  }
  return UsbStatus::kOk;
}

UsbStatus LibusbChannel::recover_from_stall() noexcept {
  // The others come back with the same stall, or are taken back; what they brought before it stays readable.
  for (Slot& slot : in_slots_) take_back(slot);
  std::erase_if(arrived_, [](const Slot* slot) {
    return slot->transfer->status != LIBUSB_TRANSFER_COMPLETED || slot->transfer->actual_length == 0;
  });
  if (libusb_clear_halt(handle_.get(), in_) == LIBUSB_ERROR_NO_DEVICE) lost_ = true;
  return lost_ || post_reads() == UsbStatus::kLost ? UsbStatus::kLost : UsbStatus::kStall;
}

UsbStatus LibusbChannel::read(std::span<std::uint8_t> out, std::size_t& got, std::uint64_t deadline_ns) noexcept {
  got = 0;
  bool looked = false;  // at the bus: also a caller who may not wait gets what the kernel already has
  for (;;) {
    if (stop_.ends_waits()) return UsbStatus::kStopping;
    if (!arrived_.empty()) {
      Slot& slot = *arrived_.front();
      arrived_.pop_front();
      const UsbStatus status = outcome(slot);
      if (status == UsbStatus::kLost) return status;
      if (status == UsbStatus::kStall) return recover_from_stall();
      if (status == UsbStatus::kOk) {
        got = std::min<std::size_t>(static_cast<std::size_t>(slot.transfer->actual_length), out.size());
        std::copy_n(slot.buffer.begin(), got, out.begin());
      }
      if (submit(slot) == UsbStatus::kLost && status != UsbStatus::kOk) return UsbStatus::kLost;
      return status;
    }
    if (lost_) return UsbStatus::kLost;
    if (looked && rtbus::monotonic_ns() >= deadline_ns) {
      if (post_reads() == UsbStatus::kLost) return UsbStatus::kLost;
      return UsbStatus::kTimeout;
    }
    looked = true;
    if (const UsbStatus status = handle_events(deadline_ns, nullptr); status != UsbStatus::kOk) return status;
  }
}

}  // namespace drivers::usb
