// The thread `link_in`: what comes from the other machine becomes local topics.
#include <algorithm>
#include <optional>
#include <span>

#include "rtbus/realtime.hpp"
#include "rtbus/sane_sample.hpp"
#include "tools/link/link_node_impl.hpp"

namespace link_dds {

namespace {

/// A haptic loop looks every tick: for so long it is told that physics begins anew.
constexpr std::uint64_t kTellRestart_ns = 50 * rtbus::kNsPerMs;
/// NodeInfo::core of a node that runs elsewhere: observers here need not keep off it.
constexpr std::uint32_t kNoCoreHere = 0xffffffff;

}  // namespace

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
  if (kind < 1 || kind >= kStateKinds) {
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
    case StateKind::kBodyOrders: {
      rtbus::BodyOrders orders;
      if (!has_physics() || plan.bodies.empty() || !unpack(body, orders) || !body.empty() ||
          !take_body_orders(orders, now_ns)) {
        hand.flow->count(&rtbus::NetworkStats::refused);
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

}  // namespace link_dds
