#include "drivers/simulated/plant_link.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "rtbus/eigen.hpp"

namespace drivers::simulated {

PlantLink::PlantLink(const SimulatedSettings& settings, const OpenContext& context)
    : info_(settings.info),
      context_(context),
      sample_period_ns_(static_cast<std::uint64_t>(std::llround(1e9 / settings.sample_rate_hz))),
      states_(context.session, context.node_name + ".plant_state") {}

rtbus::Result<void, DeviceFault> PlantLink::start(std::uint64_t) {
  stop();
  const std::string topic = context_.node_name + ".plant_command";
  auto writer = rtbus::Publication<rtbus::PlantCommand>::create(context_.session, topic);
  if (!writer) return rtbus::Failure{DeviceFault{topic + ": " + rtbus::to_string(writer.error())}};
  {
    const std::lock_guard lock(life_);
    commands_.emplace(std::move(*writer));
  }
  clamped_ = 0;
  have_state_ = obeys_ = false;
  unheard_stamp_ns_ = 0;

  const std::uint64_t give_up_ns = rtbus::monotonic_ns() + kStartPatienceNs;
  for (;;) {
    states_.maintain();
    fetch();
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (have_state_ && now_ns < newest_.value.sample_time_ns + kLostAfterNs) {
      next_sample_ns_ = now_ns + sample_period_ns_;
      return {};
    }
    if (now_ns > give_up_ns) break;
    rtbus::sleep_until(now_ns + rtbus::kNsPerMs);
  }
  std::string message = states_.topic() +
                        " stays silent: `process: own` needs a running plant; start `simulated_plant "
                        "--config SESSION.yaml --node " +
                        context_.node_name + "` (`rtbus run` does it by itself), or set `process: node`";
  // NotFound only says that the plant does not run; anything else deserves its own words.
  if (!states_.attached() && states_.last_error() != rtbus::TopicError::kNotFound) {
    message += std::string(" (") + rtbus::to_string(states_.last_error()) + ")";
  }
  stop();
  return rtbus::Failure{DeviceFault{message}};
}

bool PlantLink::fetch() noexcept RTBUS_NONBLOCKING {
  if (states_.read_latest(newest_) == rtbus::ReadStatus::kFresh) {
    unread_ = have_state_ = true;
    if (unheard_stamp_ns_ != 0 && newest_.value.command_time_ns >= unheard_stamp_ns_) {
      unheard_stamp_ns_ = 0;
      obeys_ = true;
    }
  }
  return unread_;
}

IoStatus PlantLink::wait_sample(std::uint64_t deadline_ns) noexcept {
  constexpr std::uint64_t kPollNs = 50 * rtbus::kNsPerUs;
  if (!commands_) return IoStatus::kLost;
  rtbus::sleep_until(std::min(next_sample_ns_, deadline_ns));
  for (;;) {
    if (fetch() && newest_.value.sample_time_ns >= next_sample_ns_) {
      // The grid follows the requested rate, not the moment of waking; what was missed is gone.
      const std::uint64_t late_ns = newest_.value.sample_time_ns - next_sample_ns_;
      next_sample_ns_ += sample_period_ns_ * (late_ns / sample_period_ns_ + 1);
      return IoStatus::kOk;
    }
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (now_ns >= deadline_ns) break;
    rtbus::sleep_until(std::min(now_ns + kPollNs, deadline_ns));
  }
  const bool silent = deadline_ns > newest_.value.sample_time_ns + kLostAfterNs;
  return silent ? IoStatus::kLost : IoStatus::kTimeout;
}

IoStatus PlantLink::read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING {
  if (!commands_) return IoStatus::kLost;
  fetch();
  const rtbus::PlantState& state = newest_.value;
  if (!have_state_ || now_ns > state.sample_time_ns + kLostAfterNs) return IoStatus::kLost;
  const bool fresh = std::exchange(unread_, false);
  out.position_m = state.position_m;
  out.orientation_wxyz = {1, 0, 0, 0};
  out.buttons = state.buttons;
  // The plant may have measured after the caller looked at its clock; ages must not come out negative.
  out.time_ns = std::min(state.sample_time_ns, now_ns);
  return fresh ? IoStatus::kOk : IoStatus::kStale;
}

bool PlantLink::heard() const noexcept {
  return unheard_stamp_ns_ == 0 || newest_.value.sample_time_ns < unheard_sent_ns_ + kUnheardAfterNs;
}

IoStatus PlantLink::write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING {
  if (!commands_) return IoStatus::kLost;
  Eigen::Vector3d force_n = rtbus::vector_of(command.force_n);
  if (!limit_force(info_.max_force_n, force_n)) ++clamped_;
  commands_->publish({rtbus::array_of(force_n)}, now_ns);
  if (unheard_stamp_ns_ == 0) {
    unheard_stamp_ns_ = now_ns;
    unheard_sent_ns_ = rtbus::monotonic_ns();
  }
  // A plant that lets go while it is commanded, or holds an old command, does not get the commands: their topic is
  // lost, and is being made anew. The force that it takes next has to come by a ramp.
  return obeys_ && (newest_.value.timed_out != 0 || !heard()) ? IoStatus::kLost : IoStatus::kOk;
}

void PlantLink::stop() noexcept {
  const std::lock_guard lock(life_);
  if (!commands_) return;
  commands_->publish({}, rtbus::monotonic_ns());
  commands_.reset();
}

}  // namespace drivers::simulated
