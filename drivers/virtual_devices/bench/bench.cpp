#include "drivers/virtual_devices/bench/bench.hpp"

#include <unistd.h>

#include <optional>

#include "drivers/simulated/plant_state.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::virtual_usb {
namespace {

constexpr std::uint64_t kMaintain_ns = 20 * rtbus::kNsPerMs;

}  // namespace

BenchSettings parse_bench(rtbus::config::Map& settings) {
  BenchSettings out;
  out.faults = parse_faults(settings, out.times);
  out.publish_state = settings.boolean("publish_state", out.publish_state);
  if (out.times.for_s >= 0.0 && out.times.trigger.empty()) {
    settings.fail("faults", "holds for_s, which counts from a trigger; add faults.trigger, or leave it out");
  }
  return out;
}

Bench::Bench(const BenchSettings& settings, Model model, UsbfsPort& port, rtbus::Session session, std::string node)
    : settings_(settings),
      model_(std::move(model)),
      port_(port),
      session_(std::move(session)),
      node_(std::move(node)),
      thread_([this] { run(); }) {}

Bench::~Bench() {
  ends_.store(true);
  thread_.join();
}

void Bench::run() {
  rtbus::name_this_thread("usb_bench");
  // As the hand would see it, whatever else this machine does.
  (void)rtbus::enter_realtime({.priority = 60, .core = 0, .lock_memory = false, .hold_dma_latency = false});
  using Topic = rtbus::Publication<rtbus::PlantState>;
  std::optional<Topic> topic;
  if (settings_.publish_state) {
    // Without the topic nobody sees it, which the one who looks will say.
    if (auto made = Topic::create(session_, node_ + ".plant_state", {.capacity = 4096}))
      topic.emplace(std::move(*made));
  }
  std::uint64_t due_ns = rtbus::monotonic_ns(), maintained_ns = due_ns;
  while (!ends_.load()) {
    rtbus::sleep_until(due_ns += rtbus::kNsPerMs);
    follow_trigger(rtbus::monotonic_ns());
    if (!topic) continue;
    rtbus::PlantState state;
    port_.locked([&] {
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      state = simulated::state_of(model_.look(now_ns), now_ns);
    });
    topic->publish(state, state.sample_time_ns);
    if (state.sample_time_ns < maintained_ns + kMaintain_ns) continue;
    topic->maintain();
    maintained_ns = state.sample_time_ns;
  }
}

void Bench::follow_trigger(std::uint64_t now_ns) {
  if (settings_.times.trigger.empty()) return;
  if (::access(settings_.times.trigger.c_str(), F_OK) != 0) {
    if (triggered_ns_ != 0) make_well();
    return;
  }
  if (triggered_ns_ == 0) {
    triggered_ns_ = now_ns;
    port_.locked([this] { model_.play(settings_.faults); });
  }
  const double t_s = rtbus::seconds_between(triggered_ns_, now_ns);
  const Faults& faults = settings_.faults;
  if (!unplugged_ && faults.unplug_at_s >= 0.0 && t_s >= faults.unplug_at_s) {
    unplugged_ = true;
    port_.unplug();
  }
  if (unplugged_ && !replugged_ && faults.replug_after_s >= 0.0 && t_s >= faults.unplug_at_s + faults.replug_after_s) {
    replugged_ = true;
    port_.replug();
  }
  if (!over_ && settings_.times.for_s >= 0.0 && t_s >= settings_.times.for_s) {
    over_ = true;
    port_.locked([this] { model_.play(Faults{}); });
  }
}

void Bench::make_well() {
  if (unplugged_ && !replugged_) port_.replug();
  port_.locked([this] { model_.play(Faults{}); });
  triggered_ns_ = 0;
  over_ = unplugged_ = replugged_ = false;
}

}  // namespace drivers::virtual_usb
