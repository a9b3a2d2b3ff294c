#include "physics_node/node.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "physics_node/engine_registry.hpp"
#include "physics_node/node_topics.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/pacer.hpp"
#include "rtbus/realtime.hpp"

namespace physics {
namespace {

constexpr std::uint64_t kLongestNapNs = 20 * rtbus::kNsPerMs;  // a stop waits no longer than this
constexpr std::uint64_t kPacketNapNs = rtbus::kNsPerMs / 4;    // between two looks for a packet on the bus

}  // namespace

Node::Node(NodeConfig config)
    : config_(std::move(config)), contact_topics_(config_), heard_ns_(config_.proxies.size(), 0) {}

Node::~Node() { stop(); }

rtbus::Result<std::unique_ptr<Node>, NodeFault> Node::open(NodeConfig config) {
  auto world = make_world(config.physics.engine, config.scene, config.physics.engine_settings());
  return open(std::move(config), std::move(world));
}

rtbus::Result<std::unique_ptr<Node>, NodeFault> Node::open(NodeConfig config, std::unique_ptr<World> world) {
  std::unique_ptr<Node> node(new Node(std::move(config)));
  const NodeConfig& settings = node->config_;
  node->stepper_ = std::make_unique<Stepper>(std::move(world), settings.proxies, settings.physics.parts_per_step(),
                                             settings.shape_hash());

  std::string failed;
  const auto create = [&]<class T>(std::type_identity<T>, const std::string& topic, std::uint32_t capacity) {
    auto writer = rtbus::Publication<T>::create(settings.session, topic, {.capacity = capacity});
    if (!writer && failed.empty()) {
      failed = "session " + settings.session.name + ": topic " + topic + ": " + rtbus::to_string(writer.error());
    }
    return writer;
  };
  std::vector<rtbus::Publication<rtbus::ProxyState>> proxy_states;
  for (const ProxyConfig& proxy : settings.proxies) {
    auto writer = create(std::type_identity<rtbus::ProxyState>{}, "physics.proxy_state." + proxy.device, 1024);
    if (writer) proxy_states.push_back(std::move(*writer));
  }
  auto heartbeat = create(std::type_identity<rtbus::Heartbeat>{}, "physics.heartbeat", rtbus::kHeartbeatSlots);
  auto step_stats = create(std::type_identity<rtbus::StepStats>{}, "physics.step_stats", 16);
  auto node_info = create(std::type_identity<rtbus::NodeInfo>{}, "physics.node_info", 4);
  const auto& bodies = settings.scene.bodies;
  // The bodies of an external engine need not be those of the scene.
  const bool others = settings.physics.engine == "external" && node->stepper_->world().bodies() > 0;
  if (others || std::any_of(bodies.begin(), bodies.end(),
                            [](const auto& body) { return body.type != rtbus::config::BodyType::kStatic; })) {
    auto poses = PosePublisher::create(settings.session, node->stepper_->world().bodies());
    if (poses) {
      node->poses_ = std::move(*poses);
    } else if (failed.empty()) {
      failed = "session " + settings.session.name + ": topic physics.body_poses: " + rtbus::to_string(poses.error());
    }
  }
  if (const std::size_t nodes = node->stepper_->world().soft_nodes(); nodes > 0) {
    auto soft = SoftNodePublisher::create(settings.session, nodes);
    if (soft) {
      node->soft_nodes_ = std::move(*soft);
    } else if (failed.empty()) {
      failed = "session " + settings.session.name + ": topic physics.soft_nodes: " + rtbus::to_string(soft.error());
    }
  }
  if (failed.empty()) failed = node->contact_topics_.open();
  if (failed.empty()) failed = node->contact_points_.open(settings);
  if (!failed.empty()) return rtbus::Failure{NodeFault{failed}};

  std::vector<rtbus::PacketPipe> pipes;
  if (settings.proxies.front().wire.pipe) {
    for (const ProxyConfig& proxy : settings.proxies) {
      auto pipe = rtbus::PacketPipe::serve(settings.session, proxy.device);
      if (!pipe) return rtbus::Failure{NodeFault{"physics: pipe for " + proxy.device + ": " + pipe.error()}};
      pipes.push_back(std::move(*pipe));
    }
  }

  node->topics_ = std::make_unique<Topics>(
      Topics{std::move(*heartbeat), std::move(*step_stats), std::move(*node_info), std::move(proxy_states)});
  node->topics_->pipes = std::move(pipes);
  for (const ProxyConfig& proxy : settings.proxies) {
    node->topics_->device_states.push_back(
        std::make_unique<rtbus::Subscription<rtbus::DeviceState>>(settings.session, proxy.device + ".device_state"));
  }
  if (!rtbus::config::bodies_that_orders_move(settings.scene).empty()) {
    node->topics_->body_orders =
        std::make_unique<rtbus::Subscription<rtbus::BodyOrders>>(settings.session, "physics.body_orders");
  }
  return node;
}

void Node::start() {
  const PhysicsConfig& physics = config_.physics;
  spdlog::info(
      "physics: engine {}, scene {}, {} bodies, {} soft bodies, {} proxies, {} at {}{:g} Hz, {} parts per step",
      physics.engine, config_.scene.name, stepper_->world().bodies(), config_.scene.soft_bodies.size(),
      stepper_->proxies(), physics.clock(), physics.pace == Pace::kFree ? "not less than " : "", 1.0 / physics.step_s(),
      physics.parts_per_step());
  spdlog::info("physics: left out: {}", left_out());
  for (const std::string& warning : config_.warnings) spdlog::warn("physics: {}", warning);
  for (const std::string& warning : stepper_->world().warnings(physics.step_s() / physics.parts_per_step())) {
    spdlog::warn("physics: {}", warning);
  }
  beat_thread_ = std::thread([this] { beat_thread(); });
  step_thread_ = std::thread([this] { step_thread(); });
}

void Node::stop() noexcept {
  stop_steps_.store(true, std::memory_order_release);
  if (step_thread_.joinable()) step_thread_.join();
  stop_beats_.store(true, std::memory_order_release);
  if (beat_thread_.joinable()) beat_thread_.join();
}

std::uint64_t Node::period_ns() const noexcept {
  return static_cast<std::uint64_t>(std::llround(config_.physics.step_s() * 1e9));
}

bool Node::sleep_unless_stopped(std::uint64_t deadline_ns) const noexcept {
  while (!stop_steps_.load(std::memory_order_acquire)) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (now_ns >= deadline_ns) return true;
    rtbus::sleep_until(std::min(deadline_ns, now_ns + kLongestNapNs));
  }
  return false;
}

std::string Node::left_out() const {
  std::string text(find_engine(config_.physics.engine)->left_out);
  const auto add = [&text](const char* part) { text += (text.empty() ? "" : ", ") + std::string(part); };
  if (config_.scene.soft_bodies.empty()) add("soft bodies");
  if (!poses_) {
    add("body poses");
  } else if (!poses_->observed()) {
    add("body poses without an observer");
  }
  if (soft_nodes_ && !soft_nodes_->observed()) add("soft nodes without an observer");
  if (!contact_topics_.in_use()) add("contact constraints while no method asks for them");
  return text;
}

/// Bodies receive what the hand did in each of its samples at that time; the newest one says where it is.
bool Node::hear_all(std::size_t device, rtbus::Stamped<rtbus::DeviceState>& newest) noexcept {
  rtbus::Stamped<rtbus::DeviceState> next;
  bool fresh = false;
  while (topics_->device_states[device]->read_next(next) == rtbus::ReadStatus::kFresh) {
    if (fresh) stepper_->hear(device, newest.value);
    newest = next;
    fresh = true;
  }
  return fresh;
}

bool Node::read_devices() noexcept {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  bool first_is_fresh = false;
  if (topics_->body_orders) {
    (void)topics_->body_orders->read_latest(body_orders_);
    stepper_->set_body_orders(body_orders_.value, now_ns);
  }
  for (std::size_t i = 0; i < heard_ns_.size(); ++i) {
    rtbus::Stamped<rtbus::DeviceState> sample;
    const bool fresh = topics_->pipes.empty()
                           ? hear_all(i, sample)
                           : topics_->pipes[i].receive_newest(i == 0 ? now_ns + kLongestNapNs : now_ns, sample);
    if (fresh) {
      first_is_fresh = first_is_fresh || i == 0;
      stepper_->set_device(i, sample.value, sample.sequence);
      heard_ns_[i] = sample.stamp_ns;  // not now: the newest sample of a dead writer may be old
    }
    const std::uint64_t silent_ns = kDeviceSilentNs + rtbus::ns_of(stepper_->proxy(i).wire.round_trip_s);
    if (heard_ns_[i] != 0 && now_ns > heard_ns_[i] + silent_ns) {
      stepper_->release(i);
      heard_ns_[i] = 0;
    }
  }
  return first_is_fresh;
}

bool Node::wait_for_packet() noexcept {
  while (!stop_steps_.load(std::memory_order_acquire)) {
    if (read_devices()) return true;
    if (topics_->pipes.empty()) rtbus::sleep_until(rtbus::monotonic_ns() + kPacketNapNs);
  }
  return false;
}

void Node::publish_pictures(std::uint64_t now_ns) noexcept {
  if (poses_) poses_->publish_if_due(*stepper_, now_ns);
  if (soft_nodes_) soft_nodes_->publish_if_due(*stepper_, now_ns);
  contact_points_.publish_if_due(*stepper_, now_ns);
}

void Node::publish_answers(std::uint64_t compute_ns) noexcept {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  for (std::size_t i = 0; i < topics_->proxy_states.size(); ++i) {
    rtbus::ProxyState state = stepper_->answer(i);
    state.step_compute_s = static_cast<double>(compute_ns) * 1e-9;
    topics_->proxy_states[i].publish(state, now_ns);
    if (!topics_->pipes.empty())
      (void)topics_->pipes[i].send(rtbus::Stamped<rtbus::ProxyState>{steps_ + 1, now_ns, state});
  }
  contact_topics_.publish(*stepper_, now_ns);
  last_compute_ns_.store(compute_ns, std::memory_order_relaxed);
  last_work_ns_.store(now_ns, std::memory_order_relaxed);
}

void Node::count_step(std::uint64_t compute_ns, std::uint64_t due, double wall_s, bool late) noexcept {
  step_time_ns_.record(compute_ns);
  due_.store(due, std::memory_order_relaxed);
  wall_s_.store(wall_s, std::memory_order_relaxed);
  simulated_s_.store(stepper_->simulated_s(), std::memory_order_relaxed);
  std::uint64_t ignored = stepper_->ignored_states();
  for (const auto& device_state : topics_->device_states) ignored += device_state->refused();
  for (const auto& pipe : topics_->pipes) ignored += pipe.refused();
  ignored_.store(ignored, std::memory_order_relaxed);
  recoveries_.store(stepper_->world().recoveries(), std::memory_order_relaxed);
  if (late) late_.fetch_add(1, std::memory_order_relaxed);
  steps_.fetch_add(1, std::memory_order_relaxed);
}

void Node::step_on_time() noexcept {
  const double step_s = config_.physics.step_s();
  rtbus::Pacer pacer(rtbus::monotonic_ns(), period_ns());

  while (sleep_unless_stopped(pacer.due_ns())) {
    read_devices();
    const std::uint64_t began_ns = rtbus::monotonic_ns();
    stepper_->step(step_s);
    const std::uint64_t ended_ns = rtbus::monotonic_ns();
    const bool late = pacer.advance(ended_ns) > 0;
    publish_answers(ended_ns - began_ns);
    count_step(ended_ns - began_ns, pacer.due(), static_cast<double>(pacer.due()) * step_s, late);
    publish_pictures(ended_ns);
  }
}

void Node::step_throttled() noexcept {
  const double step_s = config_.physics.step_s();
  const std::uint64_t first_ns = rtbus::monotonic_ns();
  std::uint64_t begins_ns = first_ns;

  while (sleep_unless_stopped(begins_ns)) {
    read_devices();
    const std::uint64_t began_ns = rtbus::monotonic_ns();
    stepper_->step(step_s);
    const std::uint64_t ended_ns = rtbus::monotonic_ns();
    const bool late = ended_ns > begins_ns + period_ns();
    begins_ns = std::max(begins_ns + period_ns(), ended_ns);
    if (!late && !sleep_unless_stopped(begins_ns)) break;
    publish_answers(ended_ns - began_ns);
    const std::uint64_t elapsed_ns = begins_ns - first_ns;
    count_step(ended_ns - began_ns, elapsed_ns / period_ns(), static_cast<double>(elapsed_ns) * 1e-9, late);
    publish_pictures(ended_ns);
  }
}

void Node::step_freely() noexcept {
  if (!rtbus::stay_off_cores(config_.haptic_cores)) {
    spdlog::warn("physics: runs freely on a core of a haptic loop: there is no other; give the process a second CPU");
  }
  const std::uint64_t longest_ns = period_ns();
  const std::uint64_t start_ns = rtbus::monotonic_ns();
  std::uint64_t before_ns = start_ns;

  while (sleep_unless_stopped(before_ns + kShortestFreeStepNs)) {
    read_devices();
    const std::uint64_t began_ns = rtbus::monotonic_ns();
    const std::uint64_t elapsed_ns = began_ns - before_ns;
    before_ns = began_ns;
    stepper_->step(static_cast<double>(std::min(elapsed_ns, longest_ns)) * 1e-9);
    const std::uint64_t ended_ns = rtbus::monotonic_ns();
    publish_answers(ended_ns - began_ns);
    count_step(ended_ns - began_ns, stepper_->steps(), rtbus::seconds_between(start_ns, began_ns),
               elapsed_ns > longest_ns);
    publish_pictures(ended_ns);
  }
}

void Node::step_thread() noexcept {
  rtbus::name_this_thread("physics_step");
  // At a free pace it never waits, and would take its CPU from whoever else is there.
  if (config_.physics.pace != Pace::kFree) scheduling_.enter();
  if (config_.physics.packet_rate_hz) {
    step_on_packets();
  } else if (config_.physics.pace == Pace::kFree) {
    step_freely();
  } else if (config_.physics.throttle_hz) {
    step_throttled();
  } else {
    step_on_time();
  }
  scheduling_.leave();
}

void Node::step_on_packets() noexcept {
  const double step_s = config_.physics.step_s();
  const bool throttled = config_.physics.throttle_hz.has_value();
  std::uint64_t first_ns = 0;
  while (wait_for_packet()) {
    const std::uint64_t began_ns = rtbus::monotonic_ns();
    if (first_ns == 0) first_ns = began_ns - period_ns();
    stepper_->step(step_s);
    const std::uint64_t ended_ns = rtbus::monotonic_ns();
    const bool late = ended_ns > began_ns + period_ns();
    if (throttled && !sleep_unless_stopped(began_ns + period_ns())) break;
    publish_answers(ended_ns - began_ns);
    // Without a packet no step is due.
    const std::uint64_t due = steps_.load(std::memory_order_relaxed) + 1;
    count_step(ended_ns - began_ns, due, rtbus::seconds_between(first_ns, rtbus::monotonic_ns()), late);
    publish_pictures(ended_ns);
  }
}

}  // namespace physics
