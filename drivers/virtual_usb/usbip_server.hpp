#pragma once
/// @file usbip_server.hpp
/// A virtual device offered to the Linux kernel's USB/IP client: after `usbip attach` it is on the desk, for any
/// program. The protocol has no authentication: bind it to this machine alone unless you mean otherwise.
///
/// One thread in run(), one connection attached at a time; the others may list. The device keeps its power and state
/// when the client detaches, as a real one keeps them when its program ends.
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include "drivers/virtual_usb/kind.hpp"
#include "drivers/virtual_usb/urb_queue.hpp"
#include "rtbus/result.hpp"

namespace drivers::virtual_usb {

class UsbipServer {
 public:
  /// Opens the listening socket. @param port 0: any; port() tells. The failure is a sentence for the user.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<UsbipServer>, std::string> listen(VirtualDevice device,
                                                                                       const std::string& address,
                                                                                       std::uint16_t port);
  ~UsbipServer();
  UsbipServer(const UsbipServer&) = delete;
  UsbipServer& operator=(const UsbipServer&) = delete;

  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }

  /// Serves until `stopping()` says so; it is asked at least every 100 ms, after each signal and when a client has
  /// gone.
  void run(const std::function<bool()>& stopping);

  /// Told of attach and detach, in words for people. May be empty.
  std::function<void(const std::string&)> on_event;

 private:
  struct Client;
  UsbipServer(VirtualDevice device, int listener, std::uint16_t port);
  [[nodiscard]] std::uint64_t play(std::uint64_t now_ns);
  void accept_client();
  void take_input(Client& client);
  /// Handles whole messages in the client's buffer. False: the stream is broken, drop the client.
  [[nodiscard]] bool digest(Client& client);
  [[nodiscard]] bool digest_op(Client& client, std::size_t& used);
  [[nodiscard]] bool digest_urb(Client& client, std::size_t& used);
  void attach(Client& client);
  void detach(const std::string& why);
  void answer_done();
  void flush(Client& client);
  void tell(const std::string& text) const;

  VirtualDevice device_;
  UrbQueue queue_;
  int listener_;
  std::uint16_t port_;
  std::list<Client> clients_;
  Client* attached_ = nullptr;
  std::uint64_t unplug_ns_ = kNever;
  std::uint64_t replug_ns_ = kNever;
};

}  // namespace drivers::virtual_usb
