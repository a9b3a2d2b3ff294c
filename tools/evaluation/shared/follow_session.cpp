#include "tools/evaluation/shared/follow_session.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/interrupt.hpp"

namespace tools {

namespace {

constexpr std::uint64_t kPoll_ns = 20 * rtbus::kNsPerMs;
constexpr double kStartPatience_s = 15.0;  // a loaded machine

RunPlan plan_of(const FollowSetup& setup) {
  static int runs = 0;
  std::vector<std::string> assignments = setup.assignments;
  assignments.push_back("session=" + setup.name + "-" + std::to_string(getpid()) + "-" + std::to_string(++runs));
  return make_run_plan(setup.session_file, assignments);
}

template <class T>
bool open(std::optional<rtbus::Reader<T>>& reader, const rtbus::Session& session, const std::string& topic,
          const rtbus::ReaderOptions& options = {}) {
  if (reader) return true;
  auto opened = rtbus::Reader<T>::open(session, topic, options);
  if (opened) reader.emplace(std::move(*opened));
  return reader.has_value();
}

}  // namespace

FollowedSession::FollowedSession(const FollowSetup& setup) : setup_(setup), plan_(plan_of(setup)) {}

bool FollowedSession::start() {
  for (const std::vector<ChildSpec>* children : {&plan_.plants, &plan_.nodes}) {
    for (const ChildSpec& child : *children) {
      if (auto started = supervisor_.start(child); !started) {
        std::fprintf(stderr, "%s\n", started.error().c_str());
        return false;
      }
    }
    // A haptic node opens its device at once: its plant has to be there.
    const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(kStartPatience_s * 1e9);
    for (const haptic::HapticConfig& haptic : plan_.haptic) {
      const auto plant_there = [&] {
        auto reader = rtbus::Reader<rtbus::PlantState>::open(plan_.session, haptic.name + ".plant_state");
        return reader && reader->writer_alive();
      };
      while (haptic.device->own_process() && !plant_there()) {
        if (rtbus::monotonic_ns() > end_ns || !alive() || !sleep_unless_interrupted(kPoll_ns)) return false;
      }
    }
  }
  return true;
}

bool FollowedSession::alive() {
  const auto end = supervisor_.poll();
  if (!end) return true;
  std::fprintf(stderr, "%s %s\n", end->name.c_str(), end->how().c_str());
  for (const std::string& line : end->last_words) std::fprintf(stderr, "  %s\n", line.c_str());
  return false;
}

void FollowedSession::start_bare_loop(std::uint64_t due_ns) {
  rtbus::Stamped<rtbus::NodeInfo> info;
  const haptic::HapticConfig& beside = plan_.haptic.front();
  if (!setup_.bare_loop || bare_ || !open(info_reader_, plan_.session, beside.name + ".node_info") ||
      info_reader_->read_latest(info) != rtbus::ReadStatus::kFresh) {
    return;
  }
  bare_ = std::make_unique<BareLoop>(
      BareLoopOptions{.period_ns = beside.period_ns(),
                      .phase_ns = due_ns,
                      .core = static_cast<std::int32_t>(info.value.core),  // 0xffffffff is −1: not pinned
                      .priority = std::max(1, beside.realtime.priority - 1)});
}

bool FollowedSession::follow(const OnTick& on_tick, const OnStep& on_step) {
  const std::string& name = plan_.haptic.front().name;
  const std::uint64_t began_ns = rtbus::monotonic_ns();
  std::uint64_t first_ns = 0;
  rtbus::Stamped<rtbus::Telemetry> tick;
  rtbus::Stamped<rtbus::ProxyState> proxy;
  while (first_ns == 0 || rtbus::seconds_between(first_ns, tick.value.due_ns) < setup_.duration_s) {
    if (!sleep_unless_interrupted(kPoll_ns) || !alive()) return false;
    if (rtbus::seconds_between(began_ns, rtbus::monotonic_ns()) > setup_.duration_s + kStartPatience_s) {
      std::fprintf(stderr, "no telemetry of %s within %g s\n", name.c_str(), kStartPatience_s);
      return false;
    }
    open(loop_reader_, plan_.session, name + ".loop_stats");
    if (plan_.physics) open(proxy_reader_, plan_.session, "physics.proxy_state." + name);
    if (!open(tick_reader_, plan_.session, name + ".telemetry", {.presence = true})) continue;
    while (tick_reader_->read_next(tick) == rtbus::ReadStatus::kFresh) {
      if (first_ns == 0) first_ns = tick.value.due_ns;
      on_tick(tick.value);
    }
    while (proxy_reader_ && proxy_reader_->read_next(proxy) == rtbus::ReadStatus::kFresh) {
      if (on_step) on_step(proxy);
    }
    if (first_ns != 0) start_bare_loop(tick.value.due_ns);
  }
  return true;
}

void FollowedSession::judge_load(const LoadMeter& meter) {
  load_ = meter.read();
  const rtbus::LoopStats& loop = loop_.value;
  load_.loop_hogs_core = loop.compute_p99_us + loop.device_p99_us > 0.5e6 / plan_.haptic.front().rate_hz;
  if (!bare_figures_ || bare_figures_->due == 0) return;
  load_.bare_lost_share = 1.0 - static_cast<double>(bare_figures_->ticks) / static_cast<double>(bare_figures_->due);
  load_.pause_ms = bare_figures_->wakeup_max_us * 1e-3;
}

bool FollowedSession::run(const OnTick& on_tick, const OnStep& on_step) {
  const LoadMeter meter;
  const bool ran = start() && follow(on_tick, on_step);
  if (bare_) {
    bare_->stop();
    bare_figures_ = bare_->figures(plan_.haptic.front().name, plan_.haptic.front().rate_hz);
  }
  supervisor_.end_all();
  // What the loop published last is still mapped here.
  if (loop_reader_) (void)loop_reader_->read_latest(loop_);
  judge_load(meter);
  rtbus::remove_dead(plan_.session.name);
  return ran;
}

}  // namespace tools
