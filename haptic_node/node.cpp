#include "haptic_node/node.hpp"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <optional>
#include <system_error>

#include "haptic_node/bus_link.hpp"
#include "haptic_node/config_warnings.hpp"
#include "haptic_node/rendering/registry.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/link_messages.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/pacer.hpp"
#include "rtbus/parent_death.hpp"
#include "rtbus/publication.hpp"

namespace haptic {

namespace {

constexpr std::uint64_t kHousePeriod_ns = 20 * rtbus::kNsPerMs;  // the heartbeat of docs/architecture.md
constexpr int kStatsEvery = 10;                                  // 5 Hz
constexpr int kInfoEvery = 50;                                   // 1 Hz

const char* describe(LoopEvent event) {
  switch (event) {
    case LoopEvent::kNone:
      break;
    case LoopEvent::kLinkLost:
      return "physics is lost: force fades to zero";
    case LoopEvent::kLinkLags:
      return "physics answers a hand of long ago: device_time_ns of its answers is too old; force fades to zero";
    case LoopEvent::kLinkAlive:
      return "physics is there: force ramps up";
    case LoopEvent::kOtherScene:
      return "physics has another scene: no force; restart this node";
    case LoopEvent::kDeviceLost:
      return "the device does not answer or takes no force: zero force";
    case LoopEvent::kDeviceBack:
      return "the device answers and takes forces";
    case LoopEvent::kOverspeed:
      return "overspeed: force cut until the tip is slow again";
    case LoopEvent::kClutched:
      return "clutch pressed: the tool waits where it is";
    case LoopEvent::kReleased:
      return "clutch released: mapping re-based";
    case LoopEvent::kEstopped:
      return "E-stop: force fades to zero, until it is re-armed (rtbus estop --rearm)";
    case LoopEvent::kRearmed:
      return "re-armed after the E-stop: force ramps up";
    case LoopEvent::kPaused:  // tell_pause()
      break;
  }
  return "";
}

/// @param stood_ms,held_ms Of the loop without a cycle, and of the device with an old force.
std::string tell_pause(double stood_ms, double held_ms) {
  return fmt::format(
      "the loop stood for {:.0f} ms, longer than the {:.0f} ms that the device holds a force: the force "
      "begins anew",
      stood_ms, held_ms);
}

bool is_warning(LoopEvent event) {
  return event == LoopEvent::kLinkLost || event == LoopEvent::kLinkLags || event == LoopEvent::kOtherScene ||
         event == LoopEvent::kDeviceLost || event == LoopEvent::kOverspeed || event == LoopEvent::kEstopped ||
         event == LoopEvent::kPaused;
}

/// Ring that holds at least two seconds of ticks, for readers that follow in order.
std::uint32_t two_seconds(double rate_hz) { return std::bit_ceil(static_cast<std::uint32_t>(2.0 * rate_hz)); }

}  // namespace

/// The node's ends of its topics.
struct Node::Topics {
  BusLink link;
  rtbus::Publication<rtbus::Telemetry> telemetry;
  rtbus::Publication<rtbus::LoopStats> loop_stats;
  rtbus::Publication<rtbus::Heartbeat> heartbeat;
  rtbus::Publication<rtbus::NodeInfo> node_info;
  std::optional<rtbus::Publication<rtbus::LinkStats>> link_stats;  ///< Of a device over USB.
  std::unique_ptr<rtbus::Subscription<rtbus::Orders>> orders;      ///< Null without a supervisor, who writes them.

  /// Housekeeping: makes anew what somebody has deleted, and finds physics.
  void maintain() noexcept {
    heartbeat.maintain();
    link.maintain();
    telemetry.maintain();
    loop_stats.maintain();
    node_info.maintain();
    if (link_stats) link_stats->maintain();
    if (orders) orders->maintain();
  }
  /// How often that was needed, and whether it fails. Any thread.
  [[nodiscard]] rtbus::RenewalCount renewals() const noexcept {
    rtbus::RenewalCount count = rtbus::count_renewals(heartbeat, link.device_state(), telemetry, loop_stats, node_info);
    if (link_stats) count += rtbus::count_renewals(*link_stats);
    return count;
  }
};

Node::Node(HapticConfig config) : config_(std::move(config)), observed_(config_.telemetry_always) {}

rtbus::Result<std::unique_ptr<Node>, NodeFault> Node::open(HapticConfig config, const rtbus::Session& session) {
  std::unique_ptr<Node> node(new Node(std::move(config)));
  const HapticConfig& settings = node->config_;

  std::string failed;
  const auto create = [&]<class T>(std::type_identity<T>, const char* subject, std::uint32_t capacity) {
    const std::string topic = settings.name + "." + subject;
    auto writer = rtbus::Publication<T>::create(session, topic, {.capacity = capacity});
    if (!writer && failed.empty()) {
      failed = "session " + session.name + ": topic " + topic + ": " + rtbus::to_string(writer.error());
    }
    return writer;
  };
  const std::uint32_t history = two_seconds(settings.rate_hz);
  auto device_state = create(std::type_identity<rtbus::DeviceState>{}, "device_state", history);
  auto telemetry = create(std::type_identity<rtbus::Telemetry>{}, "telemetry", history);
  auto loop_stats = create(std::type_identity<rtbus::LoopStats>{}, "loop_stats", 16);
  auto heartbeat = create(std::type_identity<rtbus::Heartbeat>{}, "heartbeat", rtbus::kHeartbeatSlots);
  auto node_info = create(std::type_identity<rtbus::NodeInfo>{}, "node_info", 4);
  std::optional<rtbus::Publication<rtbus::LinkStats>> link_stats;
  if (settings.device->has_link()) {
    auto made = create(std::type_identity<rtbus::LinkStats>{}, "link_stats", 16);
    if (made) link_stats.emplace(std::move(*made));
  }
  if (!failed.empty()) return rtbus::Failure{NodeFault{failed}};
  node->topics_.reset(new Topics{
      .link = {std::move(*device_state), session, settings.name, find_method(settings.method)->needs_physics,
               find_method(settings.method)->needs_contacts, settings.wire, settings.other_hands},
      .telemetry = std::move(*telemetry),
      .loop_stats = std::move(*loop_stats),
      .heartbeat = std::move(*heartbeat),
      .node_info = std::move(*node_info),
      .link_stats = std::move(link_stats),
      .orders = std::getenv(rtbus::kSupervisorVariable) == nullptr
                    ? nullptr
                    : std::make_unique<rtbus::Subscription<rtbus::Orders>>(session, settings.name + ".orders")});

  auto device = settings.device->open({.session = session,
                                       .node_name = settings.name,
                                       .loop_priority = settings.realtime.priority,
                                       .loop_core = settings.realtime.core});
  if (!device) return rtbus::Failure{NodeFault{settings.name + ": " + device.error().message}};
  node->device_ = std::move(*device);
  node->loop_ = std::make_unique<Loop>(settings, *node->device_, node->topics_->link, true);
  return node;
}

Node::~Node() { stop(); }

std::string Node::left_out() const {
  std::string text;
  if (!config_.device->uses_usb()) text += "libusb, USB I/O thread, ";
  if (!loop_->method().needs_physics()) text += "physics link, ";
  if (!config_.wire.pipe) text += "pipe thread, ";
  return text + "telemetry without an observer";
}

rtbus::Result<void, NodeFault> Node::start() {
  const drivers::DeviceInfo& device = device_->info();
  if (auto started = device_->start(rtbus::monotonic_ns()); !started) {
    return rtbus::Failure{NodeFault{config_.name + ": " + started.error().message}};
  }
  spdlog::info("{}: {} at {:g} Hz, clock {}, method {}, K {:g} N/m, B {:g} N s/m, limit {:g} N", config_.name,
               device.model, config_.rate_hz, config_.clock == LoopClock::kTimer ? "timer" : "device", config_.method,
               config_.stiffness_n_per_m, config_.damping_n_s_per_m, config_.safety.max_force_n);
  for (const std::string& warning : config_.warnings) spdlog::warn("{}: {}", config_.name, warning);
  if (config_.stiffness_n_per_m < config_.stiffness_requested_n_per_m) {
    spdlog::warn("{}: requested stiffness {:g} N/m lowered to {:g} N/m, the limit of {} at this rate", config_.name,
                 config_.stiffness_requested_n_per_m, config_.stiffness_n_per_m, device.model);
  }
  if (config_.damping_n_s_per_m < config_.damping_requested_n_s_per_m) {
    spdlog::warn("{}: requested damping {:g} N s/m lowered to {:g} N s/m, what {} carries at {:g} Hz", config_.name,
                 config_.damping_requested_n_s_per_m, config_.damping_n_s_per_m, device.model, config_.rate_hz);
  }
  if (const std::string raised = damping_raised(config_); !raised.empty()) {
    spdlog::info("{}: {}", config_.name, raised);
  }
  if (const std::string beyond = beyond_passive(config_); !beyond.empty()) {
    spdlog::info("{}: {}", config_.name, beyond);
  }
  if (config_.wire.paper) {
    spdlog::info("{}: form paper: explicit spring at the server, absolute damping, {:g} packets/s by {}; passivity {}",
                 config_.name, config_.wire.rate_hz.value_or(config_.rate_hz), config_.wire.pipe ? "pipe" : "bus",
                 config_.safety.passivity.control ? "controlled" : "observed only: nobody holds a simulated device");
  }
  spdlog::info("{}: left out: {}", config_.name, left_out());

  // A node that is started again under an E-stop knows of it before its first cycle.
  if (topics_->orders) topics_->orders->maintain();
  take_orders();
  try {
    start_threads();
  } catch (const std::system_error& error) {
    stop();
    return rtbus::Failure{NodeFault{config_.name + ": no thread could be started: " + error.what()}};
  }
  if (config_.realtime_enforce && !grant_.fifo) {
    stop();
    return rtbus::Failure{NodeFault{config_.name + ": realtime.policy is enforce and SCHED_FIFO was not granted"}};
  }
  return {};
}

void Node::start_threads() {
  loop_thread_ = std::thread([this] { loop_thread(); });
  // The loop reports what it was granted before its first cycle.
  while (!granted_.load(std::memory_order_acquire)) std::this_thread::yield();
  spdlog::info("{}: granted: {}", config_.name, grant_.summary());
  for (const std::string& warning : grant_.warnings) spdlog::warn("{}: {}", config_.name, warning);
  house_thread_ = std::thread([this] { house_thread(); });
  if (PipeLink* const pipe = topics_->link.pipe()) {
    pipe_thread_ = std::thread([this, pipe] { pipe->run(house_stop_); });
  }
}

void Node::stop() noexcept {
  stop_.store(true, std::memory_order_release);
  if (loop_thread_.joinable()) loop_thread_.join();
  house_stop_.store(true, std::memory_order_release);
  if (house_thread_.joinable()) house_thread_.join();
  if (pipe_thread_.joinable()) pipe_thread_.join();
  if (device_) device_->stop();
}

void Node::loop_thread() noexcept {
  rtbus::name_this_thread("haptic_loop");
  grant_ = rtbus::enter_realtime(config_.realtime);
  granted_.store(true, std::memory_order_release);
  if (!(config_.realtime_enforce && !grant_.fifo)) {
    const std::uint64_t start_ns = rtbus::monotonic_ns();
    if (config_.clock == LoopClock::kTimer) {
      run_timer(start_ns);
    } else {
      run_device(start_ns);
    }
  }
  loop_->release(rtbus::monotonic_ns());
  rtbus::leave_realtime();
}

void Node::after_cycle() noexcept {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  last_tick_ns_.store(now_ns, std::memory_order_relaxed);
  if (observed_.load(std::memory_order_relaxed)) topics_->telemetry.publish(loop_->telemetry(), now_ns);
  for (LoopEvent event = loop_->take_event(); event != LoopEvent::kNone; event = loop_->take_event()) {
    events_.push(now_ns, static_cast<std::int32_t>(event), 1e-6 * static_cast<double>(loop_->last_pause_ns()));
  }
}

void Node::run_timer(std::uint64_t start_ns) noexcept {
  rtbus::Pacer pacer(start_ns, config_.period_ns());
  const auto spin_ns = static_cast<std::uint64_t>(config_.spin_s * 1e9);
  while (!stop_.load(std::memory_order_relaxed)) {
    const std::uint64_t due_ns = pacer.due_ns();
    rtbus::sleep_until(due_ns - spin_ns);
    std::uint64_t now_ns = rtbus::monotonic_ns();
    while (now_ns < due_ns) now_ns = rtbus::monotonic_ns();  // the spin tail, bounded by spin_us
    loop_->cycle(due_ns, now_ns);
    after_cycle();
    pacer.advance(rtbus::monotonic_ns());
    loop_->count_schedule(pacer.due(), pacer.overruns());
  }
}

void Node::run_device(std::uint64_t start_ns) noexcept {
  // The device paces: a cycle starts when its sample is there, or after two periods without one, so that a silent
  // device still gets its zero force and the counters go on. Periods without a cycle are overruns, as with the timer.
  const std::uint64_t period_ns = config_.period_ns();
  std::uint64_t served = 0;
  std::uint64_t last_ns = start_ns;
  while (!stop_.load(std::memory_order_relaxed)) {
    const drivers::IoStatus waited = device_->wait_sample(last_ns + 2 * period_ns);
    // A lost device may not turn the highest priority of the machine into a busy loop.
    if (waited == drivers::IoStatus::kLost) rtbus::sleep_until(last_ns + period_ns);
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    loop_->cycle(0, now_ns);
    after_cycle();
    ++served;
    last_ns = now_ns;
    const std::uint64_t due = (now_ns - start_ns + period_ns / 2) / period_ns;
    loop_->count_schedule(std::max(due, served), due > served ? due - served : 0);
  }
}

void Node::report_events() {
  if (const std::string notice = device_->take_notice(); !notice.empty()) spdlog::info("{}: {}", config_.name, notice);
  events_.drain([this](const rtbus::Event& record) {
    const auto event = static_cast<LoopEvent>(record.code);
    spdlog::log(is_warning(event) ? spdlog::level::warn : spdlog::level::info, "{}: {}", config_.name,
                event == LoopEvent::kPaused ? tell_pause(record.values[0], 1e3 * device_->info().force_timeout_s)
                                            : describe(event));
  });
  if (const rtbus::RenewalCount renewals = topics_->renewals(); renewals != renewals_told_) {
    spdlog::warn("{}: {}", config_.name, renewals.text());
    renewals_told_ = renewals;
  }
}

void Node::publish_stats(double achieved_hz) noexcept {
  rtbus::LoopStats stats = loop_->stats();
  stats.achieved_hz = achieved_hz;
  topics_->loop_stats.publish(stats, rtbus::monotonic_ns());
  if (!topics_->link_stats) return;
  if (const auto link = device_->link_stats()) topics_->link_stats->publish(*link, rtbus::monotonic_ns());
}

void Node::take_orders() noexcept {
  if (!topics_->orders) return;
  rtbus::Stamped<rtbus::Orders> newest;
  if (topics_->orders->read_latest(newest) != rtbus::ReadStatus::kFresh) return;
  if (!config_.adjustable_stiffness) newest.value.stiffness_n_per_m = 0.0;
  if (!config_.adjustable_damping) newest.value.damping_n_s_per_m = -1.0;
  loop_->order(newest.value);
}

void Node::house_thread() noexcept {
  rtbus::name_this_thread("haptic_house");
  (void)rtbus::prefer_on_time();
  rtbus::NodeInfo info;
  rtbus::set_text(info.role, "haptic");
  rtbus::set_text(info.kind, device_->info().model);
  rtbus::set_text(info.method, config_.method);
  rtbus::set_text(info.clock, config_.clock == LoopClock::kTimer ? "timer" : "device");
  rtbus::set_text(info.scheduling, grant_.scheduling());
  rtbus::set_text(info.realtime, grant_.summary());
  rtbus::set_text(info.left_out, left_out());
  info.rate_hz = config_.rate_hz;
  info.force_limit_n = config_.safety.max_force_n;
  info.stiffness_requested_n_per_m = config_.stiffness_requested_n_per_m;
  info.stiffness_rendered_n_per_m = config_.stiffness_n_per_m;
  info.damping_requested_n_s_per_m = config_.damping_requested_n_s_per_m;
  info.damping_rendered_n_s_per_m = config_.damping_n_s_per_m;
  info.core = static_cast<std::uint32_t>(grant_.core);

  rtbus::Heartbeat beat;
  beat.pid = static_cast<std::uint32_t>(getpid());
  beat.work_period_ns = config_.period_ns();
  std::uint64_t last_count_ns = rtbus::monotonic_ns();
  std::uint64_t last_ticks = 0;
  double achieved_hz = 0.0;

  std::uint64_t due_ns = rtbus::monotonic_ns();
  for (int round = 0; !house_stop_.load(std::memory_order_acquire); ++round) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    beat.beats++;
    beat.last_work_ns = last_tick_ns_.load(std::memory_order_relaxed);
    beat.state = static_cast<std::uint32_t>(stop_.load() ? rtbus::NodeState::kStopping : rtbus::NodeState::kRunning);
    topics_->heartbeat.publish(beat, now_ns);
    topics_->maintain();
    take_orders();
    device_->maintain();
    observed_.store(config_.telemetry_always || topics_->telemetry.observed(), std::memory_order_relaxed);
    if (round % kStatsEvery == 0) publish_stats(achieved_hz);
    if (round % kInfoEvery == 0) {
      topics_->node_info.publish(info, now_ns);
      const std::uint64_t ticks = loop_->stats().ticks;
      if (const double elapsed_s = rtbus::seconds_between(last_count_ns, now_ns); elapsed_s > 0.5) {
        achieved_hz = static_cast<double>(ticks - last_ticks) / elapsed_s;
        last_ticks = ticks;
        last_count_ns = now_ns;
      }
    }
    due_ns = std::max(due_ns + kHousePeriod_ns, now_ns);
    rtbus::sleep_until(due_ns);
  }
  beat.beats++;
  beat.state = static_cast<std::uint32_t>(rtbus::NodeState::kStopping);
  topics_->heartbeat.publish(beat, rtbus::monotonic_ns());
  publish_stats(achieved_hz);
}

}  // namespace haptic
