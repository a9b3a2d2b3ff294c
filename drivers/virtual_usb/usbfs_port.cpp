#include "drivers/virtual_usb/usbfs_port.hpp"

#include <fcntl.h>
#include <linux/ioctl.h>
#include <linux/usbdevice_fs.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "drivers/io/futex.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::virtual_usb {

namespace {

// Above any I/O thread: hardware does not wait for its host.
constexpr int kPriority = 90;
constexpr std::size_t kLargestTransfer = 1u << 20;

/// URBs are named by the client's address of them, as in usbfs.
std::uint64_t id_of(const void* urb) { return reinterpret_cast<std::uintptr_t>(urb); }

}  // namespace

UsbfsPortImpl::UsbfsPortImpl(UsbDevice& device, const Faults& faults)
    : queue_(device), replug_after_s_(faults.replug_after_s) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (faults.unplug_at_s >= 0.0) unplug_ns_ = now_ns + static_cast<std::uint64_t>(faults.unplug_at_s * 1e9);
  queue_.plug(now_ns);
  thread_ = std::thread([this] { run(); });
}

UsbfsPortImpl::~UsbfsPortImpl() {
  quit_.store(true);
  wake_thread();
  thread_.join();
  const std::lock_guard lock(mutex_);
  unplug_locked();
}

void UsbfsPortImpl::wake_thread() noexcept {
  bell_.fetch_add(1);
  io::futex_wake(bell_);
}

void UsbfsPortImpl::run() noexcept {
  rtbus::name_this_thread("usb_virtual");
  (void)rtbus::enter_realtime({.priority = kPriority, .core = -1, .lock_memory = false, .hold_dma_latency = false});
  while (!quit_.load()) {
    const std::uint32_t seen = bell_.load();
    std::uint64_t next_ns = kNever;
    {
      const std::lock_guard lock(mutex_);
      planned_ns_ = 0;  // nobody needs to wake us while we look
      pump(rtbus::monotonic_ns());
      next_ns = planned_ns_;
    }
    // kNever is beyond what the kernel takes as a time; an hour will do.
    io::futex_wait(bell_, seen, std::min(next_ns, rtbus::monotonic_ns() + 3600 * rtbus::kNsPerS));
  }
}

void UsbfsPortImpl::pump(std::uint64_t now_ns) {
  if (now_ns >= unplug_ns_) unplug_locked();
  if (now_ns >= replug_ns_) {
    replug_ns_ = kNever;
    queue_.plug(now_ns);
  }
  const std::uint64_t next_ns = std::min({queue_.pump(now_ns), unplug_ns_, replug_ns_});
  show_done();
  const bool earlier = next_ns < planned_ns_;
  planned_ns_ = next_ns;
  if (earlier) wake_thread();
}

void UsbfsPortImpl::show_done() noexcept {
  Urb urb;
  while (queue_.take_done(urb)) done_.push_back(std::move(urb));
  if (read_end_ < 0) return;
  // A byte in the pipe keeps POLLOUT off.
  char byte = 0;
  if (done_.empty() && !byte_inside_) {
    byte_inside_ = ::syscall(SYS_write, write_end_, &byte, 1) == 1;
  } else if (!done_.empty() && byte_inside_) {
    byte_inside_ = ::syscall(SYS_read, read_end_, &byte, 1) != 1;
  }
}

int UsbfsPortImpl::open() {
  const std::lock_guard lock(mutex_);
  if (!queue_.plugged() || write_end_ >= 0) {
    errno = queue_.plugged() ? EBUSY : ENODEV;
    return -1;
  }
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC | O_NONBLOCK) != 0) return -1;
  (void)::fcntl(ends[1], F_SETPIPE_SZ, 4096);
  read_end_ = ends[0];
  write_end_ = ends[1];
  byte_inside_ = false;
  offset_ = 0;
  done_.clear();
  show_done();
  return write_end_;
}

void UsbfsPortImpl::closed() {
  const std::lock_guard lock(mutex_);
  for (const int interface : claimed_) bound_.erase(interface);
  claimed_.clear();
  queue_.forget();
  done_.clear();
  if (read_end_ >= 0) ::syscall(SYS_close, read_end_);
  read_end_ = write_end_ = -1;
}

void UsbfsPortImpl::unplug_locked() {
  unplug_ns_ = kNever;
  if (!queue_.plugged()) return;
  queue_.unplug();
  show_done();
  if (read_end_ >= 0) ::syscall(SYS_close, read_end_);  // POLLERR at the client's end
  read_end_ = -1;
  if (replug_after_s_ >= 0.0) {
    replug_ns_ = rtbus::monotonic_ns() + static_cast<std::uint64_t>(replug_after_s_ * 1e9);
  }
}

void UsbfsPortImpl::unplug() {
  const std::lock_guard lock(mutex_);
  unplug_locked();
  pump(rtbus::monotonic_ns());
}

void UsbfsPortImpl::replug() {
  const std::lock_guard lock(mutex_);
  if (!queue_.plugged()) queue_.plug(rtbus::monotonic_ns());
  pump(rtbus::monotonic_ns());
}

void UsbfsPortImpl::bind_kernel_driver(int interface, const std::string& name) {
  const std::lock_guard lock(mutex_);
  bound_[interface] = name;
}

std::string UsbfsPortImpl::kernel_driver(int interface) {
  const std::lock_guard lock(mutex_);
  const auto found = bound_.find(interface);
  return found == bound_.end() ? "" : found->second;
}

void UsbfsPortImpl::locked(const std::function<void()>& change) {
  const std::lock_guard lock(mutex_);
  change();
  queue_.poke(rtbus::monotonic_ns());
  pump(rtbus::monotonic_ns());
}

long UsbfsPortImpl::read(void* out, std::size_t size) {
  const std::lock_guard lock(mutex_);
  const Descriptors& all = queue_.device().descriptors();
  std::vector<std::uint8_t> bytes = all.device;
  bytes.insert(bytes.end(), all.configuration.begin(), all.configuration.end());
  const std::size_t got = offset_ < bytes.size() ? std::min(size, bytes.size() - offset_) : 0;
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset_), got, static_cast<std::uint8_t*>(out));
  offset_ += got;
  return static_cast<long>(got);
}

long UsbfsPortImpl::seek(long offset, int whence) {
  const std::lock_guard lock(mutex_);
  const long to = whence == SEEK_SET ? offset : whence == SEEK_CUR ? static_cast<long>(offset_) + offset : -1;
  if (to < 0) return -EINVAL;
  offset_ = static_cast<std::size_t>(to);
  return to;
}

long UsbfsPortImpl::submit(void* argument) {
  auto& request = *static_cast<usbdevfs_urb*>(argument);
  if (!queue_.plugged()) return -ENODEV;
  if (request.buffer_length < 0 || static_cast<std::size_t>(request.buffer_length) > kLargestTransfer) return -EINVAL;
  const auto* const bytes = static_cast<const std::uint8_t*>(request.buffer);
  const auto size = static_cast<std::size_t>(request.buffer_length);
  Urb urb;
  urb.id = id_of(argument);
  urb.short_not_ok = (request.flags & USBDEVFS_URB_SHORT_NOT_OK) != 0;
  urb.zero_packet = (request.flags & USBDEVFS_URB_ZERO_PACKET) != 0;
  if (request.type == USBDEVFS_URB_TYPE_CONTROL) {
    if (size < 8) return -EINVAL;
    urb.setup = {bytes[0], bytes[1], static_cast<std::uint16_t>(bytes[2] | bytes[3] << 8),
                 static_cast<std::uint16_t>(bytes[4] | bytes[5] << 8)};
    urb.setup_length = static_cast<std::uint16_t>(bytes[6] | bytes[7] << 8);
    if (urb.setup_length > size - 8) return -EINVAL;
    if ((urb.setup.request_type & 0x80) != 0) {
      urb.length = urb.setup_length;
    } else {
      urb.data.assign(bytes + 8, bytes + 8 + urb.setup_length);
    }
  } else if (request.type == USBDEVFS_URB_TYPE_BULK || request.type == USBDEVFS_URB_TYPE_INTERRUPT) {
    const Endpoint* const endpoint = queue_.configuration().find(request.endpoint);
    if (endpoint == nullptr) return -ENOENT;
    if (claimed_.count(endpoint->interface) == 0) return -EINVAL;
    urb.endpoint = request.endpoint;
    urb.length = size;
    if ((request.endpoint & 0x80) == 0) urb.data.assign(bytes, bytes + size);
  } else {
    return -EINVAL;  // isochronous: no device here has it
  }
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  queue_.submit(std::move(urb), now_ns);
  pump(now_ns);
  return 0;
}

long UsbfsPortImpl::reap(void* argument) {
  if (done_.empty()) return read_end_ >= 0 ? -EAGAIN : -ENODEV;
  const Urb urb = std::move(done_.front());
  done_.pop_front();
  // The number that the caller gave is the address of its own request.  NOLINTNEXTLINE(performance-no-int-to-ptr)
  auto& request = *reinterpret_cast<usbdevfs_urb*>(static_cast<std::uintptr_t>(urb.id));
  request.status = urb.status;
  request.actual_length = static_cast<int>(urb.actual);
  request.error_count = 0;
  const bool control = urb.endpoint == 0;
  const bool in = ((control ? urb.setup.request_type : urb.endpoint) & 0x80) != 0;
  if (in && !urb.data.empty()) {
    std::memcpy(static_cast<std::uint8_t*>(request.buffer) + (control ? 8 : 0), urb.data.data(), urb.data.size());
  }
  void* const address = &request;
  std::memcpy(argument, &address, sizeof address);
  show_done();
  return 0;
}

long UsbfsPortImpl::discard(void* argument) {
  Urb urb;
  if (!queue_.discard(id_of(argument), urb)) return -EINVAL;
  done_.push_back(std::move(urb));
  show_done();
  return 0;
}

long UsbfsPortImpl::claim(int interface) {
  const auto& known = queue_.configuration().interfaces;
  if (std::find(known.begin(), known.end(), interface) == known.end()) return -ENOENT;
  if (claimed_.count(interface) == 0 && bound_.count(interface) != 0) return -EBUSY;
  claimed_.insert(interface);
  bound_[interface] = "usbfs";
  return 0;
}

/// USBDEVFS_IOCTL: a request to the driver of an interface; only its detaching and attaching.
long UsbfsPortImpl::driver_request(void* argument) {
  const auto& request = *static_cast<const usbdevfs_ioctl*>(argument);
  if (request.ioctl_code == static_cast<int>(USBDEVFS_DISCONNECT)) {
    const auto found = bound_.find(request.ifno);
    if (found == bound_.end()) return -ENODATA;
    if (found->second != "usbfs") unbound_[request.ifno] = found->second;
    bound_.erase(found);
    return 0;
  }
  if (request.ioctl_code == static_cast<int>(USBDEVFS_CONNECT)) {
    if (bound_.count(request.ifno) != 0) return -EBUSY;
    const auto found = unbound_.find(request.ifno);
    if (found == unbound_.end()) return 0;
    bound_[request.ifno] = found->second;
    unbound_.erase(found);
    return 1;
  }
  return -ENOTTY;
}

long UsbfsPortImpl::ioctl(unsigned long request, void* argument) {
  const std::lock_guard lock(mutex_);
  const bool gone = read_end_ < 0;
  switch (request) {  // what goes on after an unplugging
    case USBDEVFS_REAPURBNDELAY:
      return reap(argument);
    case USBDEVFS_DISCARDURB:
      return gone ? -ENODEV : discard(argument);
    case USBDEVFS_RELEASEINTERFACE: {
      const int interface = *static_cast<int*>(argument);
      if (claimed_.erase(interface) == 0) return -EINVAL;
      bound_.erase(interface);
      return gone ? -ENODEV : 0;
    }
    default:
      if (gone) return -ENODEV;
  }
  switch (request) {
    case USBDEVFS_GET_CAPABILITIES:
      *static_cast<std::uint32_t*>(argument) = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                                               USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_BULK_SCATTER_GATHER |
                                               USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
      return 0;
    case USBDEVFS_CONNECTINFO:
      *static_cast<usbdevfs_connectinfo*>(argument) = {1, 0};
      return 0;
    case USBDEVFS_GET_SPEED:
      return queue_.device().descriptors().high_speed ? 3 : 2;
    case USBDEVFS_SUBMITURB:
      return submit(argument);
    case USBDEVFS_CLAIMINTERFACE:
      return claim(*static_cast<int*>(argument));
    case USBDEVFS_GETDRIVER: {
      auto& answer = *static_cast<usbdevfs_getdriver*>(argument);
      const auto found = bound_.find(static_cast<int>(answer.interface));
      if (found == bound_.end()) return -ENODATA;
      std::snprintf(answer.driver, sizeof answer.driver, "%s", found->second.c_str());
      return 0;
    }
    case USBDEVFS_IOCTL:
      return driver_request(argument);
    case USBDEVFS_CLEAR_HALT:
    case USBDEVFS_RESETEP:
      queue_.clear_halt(static_cast<std::uint8_t>(*static_cast<unsigned*>(argument)));
      pump(rtbus::monotonic_ns());
      return 0;
    case USBDEVFS_RESET:
      queue_.reset(rtbus::monotonic_ns());
      return 0;
    case USBDEVFS_SETINTERFACE:
    case USBDEVFS_SETCONFIGURATION:
      return 0;
    default:
      return -ENOTTY;
  }
}

}  // namespace drivers::virtual_usb
