#include "drivers/simulated/plant.hpp"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/pacer.hpp"

namespace drivers::simulated {

rtbus::Result<std::unique_ptr<Plant>, rtbus::TopicError> Plant::create(const SimulatedSettings& settings,
                                                                       const rtbus::Session& session,
                                                                       const std::string& node_name) {
  auto states =
      rtbus::Publication<rtbus::PlantState>::create(session, node_name + ".plant_state", {.capacity = kStatesKept});
  if (!states) return rtbus::Failure{states.error()};
  return std::unique_ptr<Plant>(new Plant(settings, session, node_name, std::move(*states)));
}

Plant::Plant(const SimulatedSettings& settings, const rtbus::Session& session, const std::string& node_name,
             rtbus::Publication<rtbus::PlantState> states)
    : mechanics_(settings.mechanics, settings.hand),
      period_ns_(static_cast<std::uint64_t>(std::llround(1e9 / settings.plant_rate_hz))),
      force_timeout_ns_(settings.force_timeout_ns()),
      states_(std::move(states)),
      commands_(session, node_name + ".plant_command") {}

void Plant::run_until(const std::atomic<bool>& stop) noexcept {
  const std::uint64_t start_ns = rtbus::monotonic_ns();
  mechanics_.reset(start_ns);
  rtbus::Pacer pacer(start_ns, period_ns_);
  while (!stop.load(std::memory_order_relaxed)) {
    rtbus::sleep_until(pacer.due_ns());
    cycle(rtbus::monotonic_ns());
    pacer.advance(rtbus::monotonic_ns());
  }
}

void Plant::cycle(std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING {
  // The time that passed belongs to the old force: the new one acts from now on.
  mechanics_.advance_to(now_ns);
  if (commands_.read_latest(command_) == rtbus::ReadStatus::kFresh) {
    // A stamp from the future would hold its force for longer than the time-out allows.
    const std::uint64_t stamped_ns = std::min(command_.stamp_ns, now_ns);
    mechanics_.set_force(rtbus::vector_of(command_.value.force_n), stamped_ns + force_timeout_ns_);
    // A dead node's last words do not count.
    const bool current = now_ns < stamped_ns + force_timeout_ns_;
    if (current && !std::exchange(commanded_, true)) mechanics_.begin_script(now_ns);
  }
  mechanics_.expire_force(now_ns);

  rtbus::PlantState state;
  state.position_m = rtbus::array_of(mechanics_.measure(now_ns));
  state.true_position_m = rtbus::array_of(mechanics_.position_m());
  state.true_velocity_m_s = rtbus::array_of(mechanics_.velocity_m_s());
  state.applied_force_n = rtbus::array_of(mechanics_.applied_force_n());
  state.hand_force_n = rtbus::array_of(mechanics_.hand_force_n());
  state.sample_time_ns = now_ns;
  state.command_time_ns = std::min(command_.stamp_ns, now_ns);
  state.buttons = mechanics_.buttons();
  state.timed_out = mechanics_.timed_out() ? 1 : 0;
  states_.publish(state, now_ns);
}

rtbus::RealtimeGrant enter_plant_realtime() {
  // enter_realtime() pins the thread, which suits the haptic loop; beside it the plant had better keep moving.
  cpu_set_t before;
  CPU_ZERO(&before);
  const bool known = ::sched_getaffinity(0, sizeof before, &before) == 0;
  rtbus::RealtimeRequest request;
  --request.priority;
  request.hold_dma_latency = false;  // the haptic node holds it
  rtbus::RealtimeGrant grant = rtbus::enter_realtime(request);
  if (known && ::sched_setaffinity(0, sizeof before, &before) == 0) grant.core = -1;
  return grant;
}

}  // namespace drivers::simulated
