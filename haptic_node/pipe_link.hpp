#pragma once
/// @file pipe_link.hpp
/// `link: pipe`: the loop's link to physics as the paper had it (He & Choi 2013, section III.A): a thread of its own,
/// at 50 Hz, parcels the newest state of the hand into a named pipe and takes the newest proxy out of the other
/// direction.
#include <atomic>
#include <optional>
#include <string>

#include "haptic_node/latest_cell.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/packet_pipe.hpp"
#include "rtbus/segment.hpp"

namespace haptic {

/// The loop puts and takes (wait-free, no system call); run() does the blocking work on a thread that is not realtime.
class PipeLink {
 public:
  PipeLink(rtbus::Session session, std::string name, double rate_hz)
      : session_(std::move(session)), name_(std::move(name)), rate_hz_(rate_hz) {}

  /// @realtime Yes, both.
  void send(const rtbus::DeviceState& state, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
    hand_out_.put({++sent_, now_ns, state});
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyState>& out) noexcept RTBUS_NONBLOCKING {
    return proxy_in_.take(out);
  }

  /// Samples of physics that were not sane, since the start. @realtime Yes.
  [[nodiscard]] std::uint64_t refused() const noexcept RTBUS_NONBLOCKING {
    return refused_.load(std::memory_order_relaxed);
  }

  /// Until `stop`: one packet per period, answers as they come; connects, and connects anew after physics restarted.
  /// @realtime No.
  void run(const std::atomic<bool>& stop) noexcept;

 private:
  rtbus::Session session_;
  std::string name_;
  double rate_hz_;
  std::uint64_t sent_ = 0;  ///< Of the loop's thread.
  LatestCell<rtbus::Stamped<rtbus::DeviceState>> hand_out_;
  LatestCell<rtbus::Stamped<rtbus::ProxyState>> proxy_in_;
  std::atomic<std::uint64_t> refused_{0};
};

}  // namespace haptic
