#include "drivers/virtual_usb/usbfs_shim.hpp"

#include <linux/ioctl.h>
#include <stdarg.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstddef>

#include "drivers/virtual_usb/usbfs_port.hpp"

namespace drivers::virtual_usb {
namespace {

constexpr std::size_t kDescriptors = 4096;
/// Whose descriptor it is; null: nobody's here, so it goes to the kernel.
std::array<std::atomic<UsbfsPortImpl*>, kDescriptors> g_ports{};

UsbfsPortImpl* port_of(int fd) noexcept {
  if (fd < 0 || static_cast<std::size_t>(fd) >= kDescriptors) return nullptr;
  return g_ports[static_cast<std::size_t>(fd)].load(std::memory_order_acquire);
}

long with_errno(long result) noexcept {
  if (result >= 0) return result;
  errno = static_cast<int>(-result);
  return -1;
}

/// Enters its descriptors into the table; forgets them when it goes.
class ListedPort final : public UsbfsPort {
 public:
  ListedPort(UsbDevice& device, const Faults& faults) : port_(device, faults) {}
  ~ListedPort() override {
    for (auto& entry : g_ports) {
      UsbfsPortImpl* mine = &port_;
      entry.compare_exchange_strong(mine, nullptr);
    }
  }
  [[nodiscard]] int open() override {
    const int fd = port_.open();
    if (fd < 0) return fd;
    if (static_cast<std::size_t>(fd) >= kDescriptors) {
      port_.closed();
      ::syscall(SYS_close, fd);
      errno = EMFILE;
      return -1;
    }
    g_ports[static_cast<std::size_t>(fd)].store(&port_, std::memory_order_release);
    return fd;
  }
  void unplug() override { port_.unplug(); }
  void replug() override { port_.replug(); }
  void bind_kernel_driver(int interface, const std::string& name) override {
    port_.bind_kernel_driver(interface, name);
  }
  [[nodiscard]] std::string kernel_driver(int interface) override { return port_.kernel_driver(interface); }
  void locked(const std::function<void()>& change) override { port_.locked(change); }

 private:
  UsbfsPortImpl port_;
};

std::unique_ptr<UsbfsPort> attach(UsbDevice& device, const Faults& faults) {
  return std::make_unique<ListedPort>(device, faults);
}

constexpr UsbfsShim kShim{kShimAbiVersion, sizeof(Faults), &attach};

}  // namespace
}  // namespace drivers::virtual_usb

using drivers::virtual_usb::port_of;
using drivers::virtual_usb::with_errno;

extern "C" {

const drivers::virtual_usb::UsbfsShim* rtbus_usbfs_shim() { return &drivers::virtual_usb::kShim; }

// In front of the C library's. What is not ours goes straight to the kernel, by the same system call.
int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  auto* const port = _IOC_TYPE(request) == 'U' ? port_of(fd) : nullptr;
  if (port == nullptr) return static_cast<int>(::syscall(SYS_ioctl, fd, request, argument));
  return static_cast<int>(with_errno(port->ioctl(request, argument)));
}

ssize_t read(int fd, void* out, size_t size) {
  auto* const port = port_of(fd);
  if (port == nullptr) return ::syscall(SYS_read, fd, out, size);
  return with_errno(port->read(out, size));
}

off_t lseek(int fd, off_t offset, int whence) noexcept {
  auto* const port = port_of(fd);
  if (port == nullptr) return ::syscall(SYS_lseek, fd, offset, whence);
  return with_errno(port->seek(offset, whence));
}

off64_t lseek64(int fd, off64_t offset, int whence) noexcept { return lseek(fd, offset, whence); }

int close(int fd) {
  if (auto* const port = port_of(fd)) {
    drivers::virtual_usb::g_ports[static_cast<std::size_t>(fd)].store(nullptr, std::memory_order_release);
    port->closed();
  }
  return static_cast<int>(::syscall(SYS_close, fd));
}

}  // extern "C"
