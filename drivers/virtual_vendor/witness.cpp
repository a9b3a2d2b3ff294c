#include "drivers/virtual_vendor/witness.hpp"

#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::virtual_vendor {
namespace {

constexpr std::uint64_t kMaintainNs = 20 * rtbus::kNsPerMs;

}  // namespace

rtbus::PlantState state_of(const simulated::Mechanics& mechanics, std::uint64_t now_ns) {
  rtbus::PlantState out;
  out.position_m = out.true_position_m = rtbus::array_of(mechanics.position_m());
  out.true_velocity_m_s = rtbus::array_of(mechanics.velocity_m_s());
  out.applied_force_n = rtbus::array_of(mechanics.applied_force_n());
  out.hand_force_n = rtbus::array_of(mechanics.hand_force_n());
  out.sample_time_ns = now_ns;
  out.buttons = mechanics.buttons();
  out.timed_out = mechanics.timed_out() ? 1 : 0;
  return out;
}

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
