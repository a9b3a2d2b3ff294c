#include "tools/bridge/health_stream.hpp"

#include <utility>

#include "rtbus/clock.hpp"
#include "tools/cli/common/formatted.hpp"

namespace bridge {

namespace {

/// A node beats every 20 ms.
constexpr double kSilence_s = 0.5;

void add(Status& row, const char* key, double value) { row.values.emplace_back(key, tools::formatted("%.6g", value)); }
void add(Status& row, const char* key, std::uint64_t value) { row.values.emplace_back(key, std::to_string(value)); }

void warn_if_grown(Status& row, const char* what, std::uint64_t before, std::uint64_t now) {
  if (now <= before) return;
  row.level = Level::kWarn;
  row.message += (row.message.empty() ? "" : ", ") + std::to_string(now - before) + " " + what;
}

}  // namespace

NodeHealth::NodeHealth(const rtbus::Session& session, const std::string& node, bool haptic)
    : name_("rtbus " + session.name + ": " + node),
      beats_(session, node + ".heartbeat"),
      infos_(session, node + ".node_info") {
  if (haptic) {
    loops_.emplace(session, node + ".loop_stats");
    orders_.emplace(session, node + ".orders");
  } else {
    steps_.emplace(session, node + ".step_stats");
  }
}

void NodeHealth::maintain() noexcept {
  beats_.maintain();
  infos_.maintain();
  if (loops_) loops_->maintain();
  if (steps_) steps_->maintain();
  if (orders_) orders_->maintain();
}

void NodeHealth::add_orders(Status& row) {
  (void)orders_->read_latest(order_);
  if (order_.sequence == 0 || order_.value.estop == 0) return;
  row.level = Level::kWarn;
  row.message +=
      (row.message.empty() ? "" : ", ") + std::string("E-stop: ") + std::string(rtbus::text_of(order_.value.reason));
}

void NodeHealth::add_loop(Status& row) {
  const bool first = loop_.sequence == 0;
  rtbus::LoopStats before = loop_.value;
  (void)loops_->read_latest(loop_);
  const rtbus::LoopStats& now = loop_.value;
  if (loop_.sequence == 0) return;
  if (first) before = now;
  warn_if_grown(row, "overruns", before.overruns, now.overruns);
  warn_if_grown(row, "losses of physics", before.losses, now.losses);
  warn_if_grown(row, "pauses of the loop", before.pauses, now.pauses);
  warn_if_grown(row, "ticks without the device", before.device_lost, now.device_lost);
  add(row, "rate_hz", now.achieved_hz);
  add(row, "ticks", now.ticks);
  add(row, "overruns", now.overruns);
  add(row, "wakeup_p99_us", now.wakeup_p99_us);
  add(row, "compute_p99_us", now.compute_p99_us);
  add(row, "force_peak_n", now.force_peak_n);
  add(row, "losses", now.losses);
  add(row, "device_lost", now.device_lost);
}

void NodeHealth::add_steps(Status& row) {
  const bool first = step_.sequence == 0;
  rtbus::StepStats before = step_.value;
  (void)steps_->read_latest(step_);
  const rtbus::StepStats& now = step_.value;
  if (step_.sequence == 0) return;
  if (first) before = now;
  warn_if_grown(row, "late steps", before.late, now.late);
  add(row, "rate_hz", now.achieved_hz);
  add(row, "steps", now.steps);
  add(row, "late", now.late);
  add(row, "step_p99_ms", now.step_p99_ms);
  add(row, "bodies", now.bodies);
}

Status NodeHealth::row() {
  Status out;
  out.name = name_;
  (void)infos_.read_latest(info_);
  out.hardware = rtbus::text_of(info_.value.kind);
  if (orders_) add_orders(out);
  if (loops_) add_loop(out);
  if (steps_) add_steps(out);
  (void)beats_.read_latest(beat_);
  const double silence_s = rtbus::seconds_between(beat_.stamp_ns, rtbus::monotonic_ns());
  if (!beats_.attached()) {
    out.level = Level::kStale;
    out.message = beat_.sequence == 0 ? "has not been seen" : "its process has ended";
  } else if (silence_s > kSilence_s) {
    out.level = Level::kError;
    out.message = "no heartbeat for " + tools::formatted("%.1f", silence_s) + " s";
  }
  if (out.message.empty()) out.message = "running";
  return out;
}

HealthStream::HealthStream(const rtbus::Session& session, const std::vector<std::string>& haptic, bool physics) {
  for (const std::string& node : haptic) nodes_.emplace_back(session, node, true);
  if (physics) nodes_.emplace_back(session, "physics", false);
}

rtbus::Result<void, std::string> HealthStream::open(Participant& participant, const BridgeConfig& config) {
  if (!config.of(Stream::kDiagnostics).on) return {};
  auto writer = participant.writer(config.of(Stream::kDiagnostics).topic, kDiagnosticArray,
                                   {.reliable = config.of(Stream::kDiagnostics).reliable, .depth = 10});
  if (!writer) return rtbus::Failure{writer.error()};
  writer_.emplace(*writer);
  return {};
}

void HealthStream::maintain() noexcept {
  for (NodeHealth& node : nodes_) node.maintain();
}

void HealthStream::publish(Status own, RosClock& clock) {
  if (!writer_) return;
  std::vector<Status> rows;
  for (NodeHealth& node : nodes_) rows.push_back(node.row());
  rows.push_back(std::move(own));
  static const std::string kNoFrame;
  writer_->write(&diagnostics_.fill(header_of(clock.time_of(rtbus::monotonic_ns()), kNoFrame), std::move(rows)));
}

}  // namespace bridge
