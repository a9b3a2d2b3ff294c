#include "tools/link/link_node.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/network_messages.hpp"
#include "rtbus/order_client.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/parent_death.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/sane_sample.hpp"
#include "rtbus/subscription.hpp"
#include "tools/link/packet.hpp"
#include "tools/link/wire.hpp"

namespace link_dds {

namespace {

constexpr std::uint64_t kLook_ns = rtbus::kNsPerMs / 2;  // between two looks at the local topics
constexpr std::uint64_t kMaintain_ns = 20 * rtbus::kNsPerMs;
constexpr std::uint64_t kGreet_ns = rtbus::kNsPerS;
constexpr std::uint64_t kStats_ns = 200 * rtbus::kNsPerMs;
/// A heartbeat goes alone when no step has carried it for so long.
constexpr std::uint64_t kBeatAlone_ns = 20 * rtbus::kNsPerMs;
/// Physics computes the contacts after it has published the proxy.
constexpr std::uint64_t kContactsPatience_ns = 2 * rtbus::kNsPerMs;
/// A haptic loop looks every tick: for so long it is told that physics begins anew.
constexpr std::uint64_t kTellRestart_ns = 50 * rtbus::kNsPerMs;
/// A peer that was silent for the round trip and this may be replaced by another.
constexpr std::uint64_t kSilence_ns = rtbus::kNsPerS;

/// NodeInfo::core of a node that runs elsewhere: observers here need not keep off it.
constexpr std::uint32_t kNoCoreHere = 0xffffffff;

enum class StateKind : std::uint8_t { kStepStats = 1, kPhysicsInfo = 2, kHapticInfo = 3, kOrders = 4 };

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

/// Both directions of one stream pair, and what is measured of them.
struct Flow {
  Flow(PacketWriter writer, PacketReader reader) : out(writer), in(std::move(reader)) {}
  PacketWriter out;  // of link_out
  std::uint64_t sequence = 0;
  PacketReader in;  // of link_in
  NewestWins newest;

  std::mutex guard;  // for what follows
  std::uint64_t echo_ns = 0, came_ns = 0;
  ClockOffset clock;
  double round_trip_sum_s = 0.0, round_trip_max_s = 0.0;
  std::uint64_t round_trips = 0;
  rtbus::NetworkStats stats;

  void send(std::uint64_t life, std::span<const std::uint8_t> body) {
    Head head{life, ++sequence};
    {
      const std::lock_guard lock(guard);
      head.sent_ns = rtbus::monotonic_ns();
      head.echo_ns = echo_ns;
      head.held_ns = echo_ns != 0 ? head.sent_ns - came_ns : 0;
      ++stats.sent;
    }
    out.send(head, body);
  }
  /// A packet that counts has come.
  void heard(const Head& head, std::uint64_t now_ns) {
    const std::lock_guard lock(guard);
    echo_ns = head.sent_ns;
    came_ns = now_ns;
    stats.received = newest.received();
    stats.lost = newest.lost();
    stats.late = newest.late();
    if (head.echo_ns == 0 || head.held_ns > head.sent_ns || now_ns < head.echo_ns) return;
    clock.add(head.echo_ns, head.sent_ns - head.held_ns, head.sent_ns, now_ns);
    const double round_trip_s = rtbus::seconds_between(head.echo_ns, now_ns) - rtbus::seconds_between(0, head.held_ns);
    if (round_trip_s < 0.0) return;
    round_trip_sum_s += round_trip_s;
    round_trip_max_s = std::max(round_trip_max_s, round_trip_s);
    ++round_trips;
  }
  void count(std::uint64_t rtbus::NetworkStats::*which, std::uint64_t by = 1) {
    const std::lock_guard lock(guard);
    stats.*which += by;
  }
  /// Another peer: its clock is another, and so are its stamps.
  void begin_anew() {
    const std::lock_guard lock(guard);
    echo_ns = 0;
    clock.begin_anew();
  }
};

template <rtbus::Sample T>
using Out = rtbus::Subscription<T>;
template <rtbus::Sample T>
using In = rtbus::Publication<T>;

/// Stamps of a topic never go back.
struct Stamps {
  std::uint64_t last_ns = 0;
  [[nodiscard]] std::uint64_t next(std::uint64_t wanted_ns) noexcept { return last_ns = std::max(last_ns, wanted_ns); }
};

}  // namespace

bool LinkPlan::is_here(const std::string& node) const {
  return std::find(here.begin(), here.end(), node) != here.end();
}

struct LinkNode::Impl {
  /// What this end has of a hand.
  struct Hand {
    explicit Hand(LinkedHand of) : about(std::move(of)) {}
    LinkedHand about;
    std::optional<Flow> flow;
    std::optional<PacketWriter> state_out;
    std::optional<PacketReader> state_in;
    std::uint64_t state_sequence = 0;
    NewestWins state_newest[5];
    std::optional<In<rtbus::NetworkStats>> stats;
    std::uint64_t life = 0;  ///< Of the peer that spoke last.

    // Where the hand is: its state goes out, answers come in.
    std::unique_ptr<Out<rtbus::DeviceState>> device_state;
    std::unique_ptr<Out<rtbus::NodeInfo>> haptic_info;
    std::optional<In<rtbus::ProxyState>> proxy_state;
    std::optional<In<rtbus::ProxyContacts>> contacts;
    std::uint64_t silent_until_ns = 0;  ///< Physics has begun anew: nothing but that is told until then.
    std::uint32_t physics_pid = 0;
    std::uint64_t physics_beats = 0;
    std::uint64_t estops_seen = 0;

    // Where physics is.
    std::unique_ptr<Out<rtbus::ProxyState>> proxy_out;
    std::unique_ptr<Out<rtbus::ProxyContacts>> contacts_out;
    std::unique_ptr<Out<rtbus::Orders>> orders_out;
    std::optional<In<rtbus::DeviceState>> device_state_in;
    std::optional<In<rtbus::NodeInfo>> haptic_info_in;
    TimeShift shift;
    Echoes echoes;
    std::mutex echoes_guard;
    std::atomic<bool> wants_contacts{false};
    std::uint64_t sent_ns = 0;  ///< Of the last answer.
    std::uint64_t estops_told = 0;
    Bytes packet;
  };

  explicit Impl(LinkPlan of)
      : plan(std::move(of)),
        self{kVersion, layout(), new_life(), 0, plan.session.name, plan.here, false},
        peers(self, silence_ns(plan)) {
    self.supervisor = supervisor_id(self.life);
  }

  static std::uint64_t silence_ns(const LinkPlan& plan) {
    double longest_s = 0.0;
    for (const LinkedHand& hand : plan.hands) longest_s = std::max(longest_s, hand.round_trip_s);
    return kSilence_ns + rtbus::ns_of(longest_s);
  }
  [[nodiscard]] bool has_physics() const { return plan.is_here("physics"); }

  [[nodiscard]] std::string open_topics();
  [[nodiscard]] std::string open_streams();
  void maintain();
  void publish_stats();

  void out_thread();
  void send_hand(Hand& hand);
  void send_answer(Hand& hand);
  void send_state(Hand& hand);
  template <rtbus::Sample T>
  void send_sample(Hand& hand, StateKind kind, const T& sample);

  void in_thread();
  /// The peer may speak for `node`, and this is newer than what was taken before.
  [[nodiscard]] bool takes(Hand& hand, const std::string& node, NewestWins& newest, const Head& head,
                           std::uint64_t now_ns);
  void take_answer(Hand& hand, const Head& head, std::span<const std::uint8_t> body);
  void take_hand(Hand& hand, const Head& head, std::span<const std::uint8_t> body);
  void take_state(Hand& hand, const Head& head, std::span<const std::uint8_t> body);
  void take_beat(Hand& hand, const Answer& answer, std::uint64_t now_ns);
  void say(std::string sentence) {
    const std::lock_guard lock(peers_guard);
    words.push_back(std::move(sentence));
  }

  LinkPlan plan;
  PeerHello self;
  std::optional<Wire> wire;
  std::deque<Hand> hands;  // they do not move

  // Of physics, where it is not here. link_in publishes.
  std::optional<In<rtbus::Heartbeat>> heartbeat;
  std::optional<In<rtbus::StepStats>> step_stats;
  std::optional<In<rtbus::NodeInfo>> physics_info;
  Stamps beat_stamps;
  // Of physics, where it is.
  std::unique_ptr<Out<rtbus::Heartbeat>> heartbeat_out;
  std::unique_ptr<Out<rtbus::StepStats>> step_stats_out;
  std::unique_ptr<Out<rtbus::NodeInfo>> physics_info_out;
  rtbus::Stamped<rtbus::Heartbeat> beat;

  std::mutex peers_guard;  // for what follows
  Peers peers;
  std::vector<std::string> words;
  std::vector<std::string> estops;  ///< Reasons of E-stops that the other machine ordered.

  std::atomic<bool> stop{false};
  std::thread out, in;
};

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
  each(heartbeat, step_stats, physics_info, heartbeat_out, step_stats_out, physics_info_out);
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

// --- out
// --------------------------------------------------------------------------------------------------------------

template <rtbus::Sample T>
void LinkNode::Impl::send_sample(Hand& hand, StateKind kind, const T& sample) {
  Bytes body{static_cast<std::uint8_t>(kind)};
  pack(sample, body);
  hand.state_out->send({self.life, ++hand.state_sequence, rtbus::monotonic_ns(), 0, 0}, body);
}

void LinkNode::Impl::send_hand(Hand& hand) {
  rtbus::Stamped<rtbus::DeviceState> sample;
  if (hand.device_state->read_latest(sample) != rtbus::ReadStatus::kFresh) return;
  hand.flow->send(self.life, pack_hand(sample.value, sample.sequence));
}

void LinkNode::Impl::send_answer(Hand& hand) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  Answer answer;
  rtbus::Stamped<rtbus::ProxyState> proxy;
  const bool stepped = hand.proxy_out->read_latest(proxy) == rtbus::ReadStatus::kFresh;
  if (!stepped && now_ns < hand.sent_ns + kBeatAlone_ns) return;
  std::optional<Echoes::Echo> echo;
  if (stepped && proxy.value.device_sequence != 0) {
    {
      const std::lock_guard lock(hand.echoes_guard);
      echo = hand.echoes.find(proxy.value.device_time_ns);
    }
    if (!echo) hand.flow->count(&rtbus::NetworkStats::unknown);
  }
  if (echo) {
    answer.proxy = proxy.value;
    rtbus::Stamped<rtbus::ProxyContacts> contacts;
    const std::uint64_t patience_ns = now_ns + kContactsPatience_ns;
    while (hand.wants_contacts.load(std::memory_order_relaxed)) {
      if (hand.contacts_out->read_latest(contacts) == rtbus::ReadStatus::kFresh &&
          contacts.value.step_index >= proxy.value.step_index) {
        break;
      }
      if (rtbus::monotonic_ns() >= patience_ns || !hand.contacts_out->attached()) break;
      rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs / 20);
    }
    if (contacts.value.step_index == proxy.value.step_index) answer.contacts = contacts.value;
    answer.proxy->device_sequence = echo->device_sequence;
    answer.proxy->device_time_ns = echo->device_time_ns;
    if (answer.contacts) {
      answer.contacts->device_sequence = echo->device_sequence;
      // Bodies may have received what the hand did until a little before that sample only.
      const std::uint64_t before_ns = proxy.value.device_time_ns - contacts.value.device_time_ns;
      answer.contacts->device_time_ns = echo->device_time_ns - std::min(echo->device_time_ns, before_ns);
    }
  }
  (void)heartbeat_out->read_latest(beat);
  if (beat.sequence == 0) return;
  answer.beat = beat.value;
  const std::uint64_t sent_ns = rtbus::monotonic_ns();
  answer.beat_age_ns = sent_ns > beat.stamp_ns ? sent_ns - beat.stamp_ns : 0;
  // Its own times travel as ages too.
  answer.beat.last_work_ns = sent_ns > beat.value.last_work_ns ? sent_ns - beat.value.last_work_ns : 0;
  const LeftOut left = pack_answer(answer, hand.packet);
  if (left.contacts + left.supports > 0) {
    hand.flow->count(&rtbus::NetworkStats::left_out, left.contacts + left.supports);
  }
  hand.flow->send(self.life, hand.packet);
  hand.sent_ns = sent_ns;
}

void LinkNode::Impl::send_state(Hand& hand) {
  if (hand.haptic_info) {
    rtbus::Stamped<rtbus::NodeInfo> info;
    if (hand.haptic_info->read_latest(info) == rtbus::ReadStatus::kFresh) {
      send_sample(hand, StateKind::kHapticInfo, info.value);
    }
    return;
  }
  rtbus::Stamped<rtbus::Orders> orders;
  if (hand.orders_out->read_latest(orders) == rtbus::ReadStatus::kFresh) {
    send_sample(hand, StateKind::kOrders, orders.value);
  }
}

void LinkNode::Impl::out_thread() {
  rtbus::name_this_thread("link_out");
  (void)rtbus::prefer_on_time();
  rtbus::Stamped<rtbus::StepStats> steps;
  rtbus::Stamped<rtbus::NodeInfo> info;
  while (!stop.load(std::memory_order_relaxed)) {
    const std::uint64_t next_ns = rtbus::monotonic_ns() + kLook_ns;
    const bool new_steps = step_stats_out && step_stats_out->read_latest(steps) == rtbus::ReadStatus::kFresh;
    const bool new_info = physics_info_out && physics_info_out->read_latest(info) == rtbus::ReadStatus::kFresh;
    for (Hand& hand : hands) {
      if (has_physics()) {
        send_answer(hand);
      } else {
        send_hand(hand);
      }
      send_state(hand);
      if (new_steps) send_sample(hand, StateKind::kStepStats, steps.value);
      if (new_info) send_sample(hand, StateKind::kPhysicsInfo, info.value);
    }
    rtbus::sleep_until(next_ns);
  }
}

// --- in
// ---------------------------------------------------------------------------------------------------------------

bool LinkNode::Impl::takes(Hand& hand, const std::string& node, NewestWins& newest, const Head& head,
                           std::uint64_t now_ns) {
  {
    const std::lock_guard lock(peers_guard);
    if (!peers.accepts(node, head.life, now_ns)) return false;
  }
  if (hand.life != head.life) {
    hand.life = head.life;
    hand.shift.begin_anew();
    hand.flow->begin_anew();
  }
  return newest.takes(head.life, head.sequence);
}

void LinkNode::Impl::take_beat(Hand& hand, const Answer& answer, std::uint64_t now_ns) {
  rtbus::Heartbeat here = answer.beat;
  here.last_work_ns = now_ns > answer.beat.last_work_ns ? now_ns - answer.beat.last_work_ns : 0;
  const std::uint64_t then_ns = now_ns > answer.beat_age_ns ? now_ns - answer.beat_age_ns : 0;
  if (!rtbus::SampleTraits<rtbus::Heartbeat>::sane(here, now_ns)) {
    hand.flow->count(&rtbus::NetworkStats::refused);
    return;
  }
  // Physics that was started anew within the patience of this link: a loop must hear of it, since its sums and steps
  // begin anew.
  const bool another = here.pid != hand.physics_pid || here.beats < hand.physics_beats;
  if (hand.physics_pid != 0 && another) {
    hand.silent_until_ns = now_ns + kTellRestart_ns;
    say("physics began anew: " + hand.about.name + " does so too");
  }
  hand.physics_pid = here.pid;
  hand.physics_beats = here.beats;
  if (now_ns < hand.silent_until_ns) here.state = static_cast<std::uint32_t>(rtbus::NodeState::kStarting);
  heartbeat->publish(here, beat_stamps.next(then_ns));
}

void LinkNode::Impl::take_answer(Hand& hand, const Head& head, std::span<const std::uint8_t> body) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (!takes(hand, "physics", hand.flow->newest, head, now_ns)) return;
  const std::optional<Answer> answer = unpack_answer(body);
  if (!answer) {
    hand.flow->count(&rtbus::NetworkStats::refused);
    return;
  }
  hand.flow->heard(head, now_ns);
  take_beat(hand, *answer, now_ns);
  if (now_ns < hand.silent_until_ns) return;
  if (answer->proxy) {
    if (rtbus::SampleTraits<rtbus::ProxyState>::sane(*answer->proxy, now_ns)) {
      hand.proxy_state->publish(*answer->proxy, now_ns);
    } else {
      hand.flow->count(&rtbus::NetworkStats::refused);
    }
  }
  if (answer->contacts && hand.contacts) {
    if (rtbus::SampleTraits<rtbus::ProxyContacts>::sane(*answer->contacts, now_ns)) {
      hand.contacts->publish(*answer->contacts, now_ns);
    } else {
      hand.flow->count(&rtbus::NetworkStats::refused);
    }
  }
}

void LinkNode::Impl::take_hand(Hand& hand, const Head& head, std::span<const std::uint8_t> body) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (!takes(hand, hand.about.name, hand.flow->newest, head, now_ns)) return;
  std::optional<link_dds::Hand> taken = unpack_hand(body);
  if (!taken) {
    hand.flow->count(&rtbus::NetworkStats::refused);
    return;
  }
  hand.flow->heard(head, now_ns);
  rtbus::DeviceState& state = taken->state;
  const Echoes::Echo echo{state.sample_time_ns, taken->device_sequence};
  state.sample_time_ns = hand.shift.here(state.sample_time_ns, now_ns);
  if (!rtbus::SampleTraits<rtbus::DeviceState>::sane(state, now_ns)) {
    hand.flow->count(&rtbus::NetworkStats::refused);
    return;
  }
  hand.wants_contacts.store((state.wants & rtbus::kWantsContacts) != 0, std::memory_order_relaxed);
  {
    const std::lock_guard lock(hand.echoes_guard);
    hand.echoes.remember(state.sample_time_ns, echo);
  }
  hand.device_state_in->publish(state, now_ns);
}

void LinkNode::Impl::take_state(Hand& hand, const Head& head, std::span<const std::uint8_t> body) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  const std::size_t kind = body.empty() ? 0 : body.front();
  if (kind < 1 || kind > 4) {
    hand.flow->count(&rtbus::NetworkStats::refused);
    return;
  }
  const std::string node = has_physics() ? hand.about.name : "physics";
  if (!takes(hand, node, hand.state_newest[kind], head, now_ns)) return;
  body = body.subspan(1);
  const auto as_it_is = [](const auto&) {};
  const auto publish = [&]<class T>(std::optional<In<T>>& into, const auto& change) {
    T sample;
    if (into && unpack(body, sample) && body.empty() && rtbus::SampleTraits<T>::sane(sample, now_ns)) {
      change(sample);
      into->publish(sample, now_ns);
    } else {
      hand.flow->count(&rtbus::NetworkStats::refused);
    }
  };
  switch (static_cast<StateKind>(kind)) {
    case StateKind::kStepStats:
      publish(step_stats, as_it_is);
      break;
    case StateKind::kPhysicsInfo:
      publish(physics_info, as_it_is);
      break;
    case StateKind::kHapticInfo:
      publish(hand.haptic_info_in, [](rtbus::NodeInfo& info) { info.core = kNoCoreHere; });
      break;
    case StateKind::kOrders: {
      rtbus::Orders orders;
      if (has_physics() || !unpack(body, orders) || !body.empty() ||
          !rtbus::SampleTraits<rtbus::Orders>::sane(orders, now_ns)) {
        hand.flow->count(&rtbus::NetworkStats::refused);
        break;
      }
      // The newest sample is the whole state: one that says stop counts, and once.
      if (orders.estop != 0 && orders.estops != hand.estops_seen) {
        hand.estops_seen = orders.estops;
        const std::lock_guard lock(peers_guard);
        estops.push_back(rtbus::text_of(orders.reason));
      }
      break;
    }
  }
}

void LinkNode::Impl::in_thread() {
  rtbus::name_this_thread("link_in");
  (void)rtbus::prefer_on_time();
  while (!stop.load(std::memory_order_relaxed)) {
    wire->wait(kMaintain_ns);
    for (Hand& hand : hands) {
      hand.flow->in.drain([&](const Head& head, std::span<const std::uint8_t> body) {
        if (has_physics()) {
          take_hand(hand, head, body);
        } else {
          take_answer(hand, head, body);
        }
      });
      hand.state_in->drain([&](const Head& head, std::span<const std::uint8_t> body) { take_state(hand, head, body); });
    }
  }
}

// --- the node
// ---------------------------------------------------------------------------------------------------------

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
    for (const std::string& reason : estops) {
      const nlohmann::json order{{"order", "estop"}, {"reason", "other machine: " + reason}};
      constexpr double kPatience_s = 0.5;
      const auto answer = rtbus::send_order_text(impl.plan.session.name, order.dump(), kPatience_s);
      tell(answer ? "E-stop ordered on the other machine is passed on: " + reason
                  : "E-stop ordered on the other machine has no taker here: " + answer.error().sentence);
    }
    rtbus::sleep_until(now_ns + kMaintain_ns);
  }
  impl.stop.store(true);
  impl.out.join();
  impl.in.join();
  impl.self.leaving = true;
  impl.wire->greet(impl.self);
}

}  // namespace link_dds
