#include "drivers/virtual_vendor/witness.hpp"

#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::virtual_vendor {
namespace {

constexpr std::uint64_t kMaintainNs = 20 * rtbus::kNsPerMs;

}  // namespace

Witness::Witness(const UnitSettings& unit, Look look) : unit_(unit), look_(std::move(look)) {
  if (unit_.publish_state) thread_ = std::thread([this] { run(); });
}

Witness::~Witness() {
  ends_.store(true);
  if (thread_.joinable()) thread_.join();
}

void Witness::run() {
  rtbus::name_this_thread("stand_in_state");
  // As the hand would see it, whatever else this machine does.
  (void)rtbus::enter_realtime({.priority = 60, .core = 0, .lock_memory = false, .hold_dma_latency = false});
  auto topic =
      rtbus::Publication<rtbus::PlantState>::create(unit_.session, unit_.node + ".plant_state", {.capacity = 4096});
  if (!topic) return;  // nobody sees it then, which the one who looks will say
  std::uint64_t due_ns = rtbus::monotonic_ns(), maintained_ns = due_ns;
  while (!ends_.load()) {
    rtbus::sleep_until(due_ns += rtbus::kNsPerMs);
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    topic->publish(look_(now_ns), now_ns);
    if (now_ns < maintained_ns + kMaintainNs) continue;
    topic->maintain();
    maintained_ns = now_ns;
  }
}

}  // namespace drivers::virtual_vendor
