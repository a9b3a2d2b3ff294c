#pragma once
/// @file usbfs_port.hpp
/// One virtual device behind a usbfs descriptor: its transfers, its time, its plug. Private to libvirtual_usb.so.
/// Requests and their answers: include/uapi/linux/usbdevice_fs.h and drivers/usb/core/devio.c of Linux 6.1.
#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include "drivers/virtual_usb/urb_queue.hpp"
#include "drivers/virtual_usb/usbfs_shim.hpp"

namespace drivers::virtual_usb {

class UsbfsPortImpl final : public UsbfsPort {
 public:
  UsbfsPortImpl(UsbDevice& device, const Faults& faults);
  ~UsbfsPortImpl() override;

  [[nodiscard]] int open() override;
  void unplug() override;
  void replug() override;
  void bind_kernel_driver(int interface, const std::string& name) override;
  [[nodiscard]] std::string kernel_driver(int interface) override;
  void locked(const std::function<void()>& change) override;

  /// The system calls on our descriptor: result, or a negative errno.
  [[nodiscard]] long ioctl(unsigned long request, void* argument);
  [[nodiscard]] long read(void* out, std::size_t size);
  [[nodiscard]] long seek(long offset, int whence);
  void closed();

 private:
  void run() noexcept;
  void pump(std::uint64_t now_ns);
  void wake_thread() noexcept;
  void unplug_locked();
  void show_done() noexcept;
  [[nodiscard]] long submit(void* argument);
  [[nodiscard]] long reap(void* argument);
  [[nodiscard]] long discard(void* argument);
  [[nodiscard]] long claim(int interface);
  [[nodiscard]] long driver_request(void* argument);

  std::mutex mutex_;
  UrbQueue queue_;
  std::uint64_t unplug_ns_ = kNever;
  std::uint64_t replug_ns_ = kNever;
  double replug_after_s_ = -1.0;

  int read_end_ = -1;   ///< Of the pipe; −1: not open, or unplugged.
  int write_end_ = -1;  ///< The client's descriptor.
  bool byte_inside_ = false;
  std::size_t offset_ = 0;
  std::deque<Urb> done_;
  std::set<int> claimed_;
  std::map<int, std::string> bound_, unbound_;  ///< Kernel drivers by interface.

  std::atomic<std::uint32_t> bell_{0};
  std::uint64_t planned_ns_ = 0;  ///< When the thread will look next.
  std::atomic<bool> quit_{false};
  std::thread thread_;
};

}  // namespace drivers::virtual_usb
