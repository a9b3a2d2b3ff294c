#include "haptic_node/pipe_link.hpp"

#include <algorithm>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

void PipeLink::run(const std::atomic<bool>& stop) noexcept {
  rtbus::name_this_thread("haptic_pipe");
  const auto period_ns = static_cast<std::uint64_t>(1e9 / rate_hz_);
  std::optional<rtbus::PacketPipe> pipe;
  rtbus::Stamped<rtbus::DeviceState> hand;
  rtbus::Stamped<rtbus::ProxyState> proxy;
  std::uint64_t due_ns = rtbus::monotonic_ns();
  while (!stop.load(std::memory_order_relaxed)) {
    due_ns = std::max(due_ns + period_ns, rtbus::monotonic_ns());
    if (pipe && pipe->broken()) pipe.reset();
    if (!pipe) {
      try {
        if (auto opened = rtbus::PacketPipe::connect(session_, name_)) pipe.emplace(std::move(*opened));
      } catch (...) {  // out of memory: the next round tries again
      }
    }
    if (pipe && hand_out_.take(hand)) (void)pipe->send(hand);
    while (pipe && !pipe->broken() && rtbus::monotonic_ns() < due_ns && !stop.load(std::memory_order_relaxed)) {
      const std::uint64_t refused_before = pipe->refused();
      if (pipe->receive_newest(due_ns, proxy)) proxy_in_.put(proxy);
      refused_.fetch_add(pipe->refused() - refused_before, std::memory_order_relaxed);
    }
    rtbus::sleep_until(due_ns);
  }
}

}  // namespace haptic
