#include "tools/link/link_node.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <random>
#include <utility>

#include "rtbus/parent_death.hpp"
#include "tools/link/link_node_impl.hpp"

namespace link_dds {

namespace {

constexpr std::uint64_t kGreet_ns = rtbus::kNsPerS;
constexpr std::uint64_t kStats_ns = 200 * rtbus::kNsPerMs;
/// A peer that was silent for the round trip and this may be replaced by another.
constexpr std::uint64_t kSilence_ns = rtbus::kNsPerS;

std::uint64_t new_life() {
  std::random_device random;
  const std::uint64_t life = (std::uint64_t{random()} << 32) | random();
  return life != 0 ? life : 1;
}

/// The same for each process that one supervisor starts, and another on each machine.
std::uint64_t supervisor_id(std::uint64_t alone) {
  const char* const pid = std::getenv(rtbus::kSupervisorVariable);
  if (pid == nullptr) return alone;
  std::string boot;
  std::ifstream("/proc/sys/kernel/random/boot_id") >> boot;
  return rtbus::detail::fnv1a(boot + pid, 0xcbf29ce484222325ULL);
}

std::uint64_t silence_ns(const LinkPlan& plan) {
  double longest_s = 0.0;
  for (const LinkedHand& hand : plan.hands) longest_s = std::max(longest_s, hand.round_trip_s);
  return kSilence_ns + rtbus::ns_of(longest_s);
}

}  // namespace

bool LinkPlan::is_here(const std::string& node) const {
  return std::find(here.begin(), here.end(), node) != here.end();
}

LinkNode::Impl::Impl(LinkPlan of)
    : plan(std::move(of)),
      self{kVersion, layout(), new_life(), 0, plan.session.name, plan.here, false},
      peers(self, plan.nodes, silence_ns(plan)) {
  self.supervisor = supervisor_id(self.life);
}

std::string LinkNode::Impl::open_topics() {
  std::string failed;
  const auto create = [&]<class T>(std::optional<In<T>>& into, const std::string& topic, std::uint32_t capacity) {
    auto made = In<T>::create(plan.session, topic, {.capacity = capacity});
    if (made) {
      into.emplace(std::move(*made));
    } else if (failed.empty()) {
      failed = "session " + plan.session.name + ": topic " + topic + ": " + rtbus::to_string(made.error()) +
               "; nodes named by --only must run on one machine alone";
    }
  };
  const auto follow = [&]<class T>(std::unique_ptr<Out<T>>& into, const std::string& topic) {
    into = std::make_unique<Out<T>>(plan.session, topic);
  };
  if (has_physics()) {
    follow(heartbeat_out, "physics.heartbeat");
    follow(step_stats_out, "physics.step_stats");
    follow(physics_info_out, "physics.node_info");
  } else {
    create(heartbeat, "physics.heartbeat", 16);
    create(step_stats, "physics.step_stats", 16);
    create(physics_info, "physics.node_info", 4);
  }
  if (!has_physics() && !plan.bodies.empty()) follow(body_orders_out, "physics.body_orders");
  for (const LinkedHand& about : plan.hands) {
    Hand& hand = hands.emplace_back(about);
    create(hand.stats, "link.stats." + about.name, 16);
    if (has_physics()) {
      create(hand.device_state_in, about.name + ".device_state", 2048);
      create(hand.haptic_info_in, about.name + ".node_info", 4);
      follow(hand.proxy_out, "physics.proxy_state." + about.name);
      follow(hand.contacts_out, "physics.contacts." + about.name);
      follow(hand.orders_out, about.name + ".orders");
    } else {
      create(hand.proxy_state, "physics.proxy_state." + about.name, 1024);
      if (about.wants_contacts) create(hand.contacts, "physics.contacts." + about.name, 64);
      follow(hand.device_state, about.name + ".device_state");
      follow(hand.haptic_info, about.name + ".node_info");
    }
  }
  return failed;
}

std::string LinkNode::Impl::open_streams() {
  for (Hand& hand : hands) {
    const std::string base = "rtbus_link/" + plan.session.name + "/" + hand.about.name + "/";
    const bool physics = has_physics();
    auto out_stream = wire->writer(base + (physics ? "answer" : "hand"), false);
    auto in_stream = wire->reader(base + (physics ? "hand" : "answer"), false);
    auto out_state = wire->writer(base + (physics ? "physics_state" : "hand_state"), true);
    auto in_state = wire->reader(base + (physics ? "hand_state" : "physics_state"), true);
    if (!out_stream) return out_stream.error();
    if (!in_stream) return in_stream.error();
    if (!out_state) return out_state.error();
    if (!in_state) return in_state.error();
    hand.flow.emplace(*out_stream, std::move(*in_stream));
    hand.state_out.emplace(*out_state);
    hand.state_in.emplace(std::move(*in_state));
  }
  return "";
}

void LinkNode::Impl::maintain() {
  const auto each = [](auto&... topics) {
    const auto one = [](auto& topic) {
      if (topic) topic->maintain();
    };
    (one(topics), ...);
  };
  each(heartbeat, step_stats, physics_info, heartbeat_out, step_stats_out, physics_info_out, body_orders_out);
  for (Hand& hand : hands) {
    each(hand.stats, hand.device_state, hand.haptic_info, hand.proxy_state, hand.contacts, hand.proxy_out,
         hand.contacts_out, hand.orders_out, hand.device_state_in, hand.haptic_info_in);
  }
}

void LinkNode::Impl::publish_stats() {
  std::uint64_t refused_packets = 0, refused_peers = 0;
  {
    const std::lock_guard lock(peers_guard);
    refused_packets = peers.refused_packets();
    refused_peers = peers.refused_peers();
  }
  for (Hand& hand : hands) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    rtbus::NetworkStats now;
    {
      Flow& flow = *hand.flow;
      const std::lock_guard lock(flow.guard);
      now = flow.stats;
      now.connected = flow.came_ns != 0 && now_ns < flow.came_ns + rtbus::kNsPerS ? 1 : 0;
      if (flow.round_trips > 0) {
        now.round_trip_mean_s = flow.round_trip_sum_s / static_cast<double>(flow.round_trips);
        now.round_trip_max_s = flow.round_trip_max_s;
      }
      flow.round_trip_sum_s = flow.round_trip_max_s = 0.0;
      flow.round_trips = 0;
      if (const auto clock = flow.clock.estimate(now_ns)) {
        now.round_trip_s = clock->round_trip_s;
        now.clock_offset_s = clock->offset_s;
        now.clock_error_s = clock->error_s;
      }
    }
    now.refused += refused_packets;
    now.refused_peers = refused_peers;
    hand.stats->publish(now, now_ns);
  }
}

LinkNode::LinkNode(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

LinkNode::~LinkNode() {
  impl_->stop.store(true);
  if (impl_->out.joinable()) impl_->out.join();
  if (impl_->in.joinable()) impl_->in.join();
}

rtbus::Result<std::unique_ptr<LinkNode>, std::string> LinkNode::open(LinkPlan plan) {
  std::unique_ptr<LinkNode> node(new LinkNode(std::make_unique<Impl>(std::move(plan))));
  if (const std::string failed = node->impl_->open_topics(); !failed.empty()) return rtbus::Failure{failed};
  return node;
}

rtbus::Result<void, std::string> LinkNode::connect() {
  Impl& impl = *impl_;
  std::vector<std::string> others;
  const std::string own = impl.plan.network.machine_of(impl.plan.here.front());
  const auto add = [&](const std::string& node) {
    const std::string address = impl.plan.network.machine_of(node);
    if (!impl.plan.is_here(node) && std::find(others.begin(), others.end(), address) == others.end()) {
      others.push_back(address);
    }
  };
  add("physics");
  if (impl.has_physics()) {
    for (const LinkedHand& hand : impl.plan.hands) add(hand.name);
  }
  auto wire = Wire::open(impl.plan.network.domain, own, others);
  if (!wire) return rtbus::Failure{wire.error()};
  impl.wire.emplace(std::move(*wire));
  if (const std::string failed = impl.open_streams(); !failed.empty()) return rtbus::Failure{failed};
  return {};
}

void LinkNode::serve(const std::function<bool()>& ended, const std::function<void(const std::string&)>& tell) {
  Impl& impl = *impl_;
  impl.out = std::thread([&impl] { impl.out_thread(); });
  impl.in = std::thread([&impl] { impl.in_thread(); });
  std::uint64_t greet_ns = 0, stats_ns = 0;
  while (!ended()) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    impl.maintain();
    if (now_ns >= greet_ns) {
      greet_ns = now_ns + kGreet_ns;
      impl.wire->greet(impl.self);
    }
    if (now_ns >= stats_ns) {
      stats_ns = now_ns + kStats_ns;
      impl.publish_stats();
    }
    std::vector<std::string> words, estops;
    {
      const std::lock_guard lock(impl.peers_guard);
      impl.wire->hear([&](const PeerHello& hello) {
        for (std::string& each : impl.peers.hear(hello, now_ns)) impl.words.push_back(std::move(each));
      });
      words.swap(impl.words);
      estops.swap(impl.estops);
    }
    for (const std::string& each : words) tell(each);
    impl.pass_on(estops, tell);
    impl.pass_on_bodies(tell);
    rtbus::sleep_until(now_ns + kMaintain_ns);
  }
  impl.stop.store(true);
  impl.out.join();
  impl.in.join();
  impl.self.leaving = true;
  impl.wire->greet(impl.self);
}

}  // namespace link_dds
