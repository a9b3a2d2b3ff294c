// The thread `link_out`: what local topics say goes to the other machine.
#include <algorithm>
#include <optional>
#include <span>

#include "rtbus/realtime.hpp"
#include "tools/link/link_node_impl.hpp"

namespace link_dds {

namespace {

constexpr std::uint64_t kLook_ns = rtbus::kNsPerMs / 2;  // between two looks at the local topics
/// A heartbeat goes alone when no step has carried it for so long.
constexpr std::uint64_t kBeatAlone_ns = 20 * rtbus::kNsPerMs;
/// Physics computes the contacts after it has published the proxy.
constexpr std::uint64_t kContactsPatience_ns = 2 * rtbus::kNsPerMs;

}  // namespace

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

void LinkNode::Impl::send_body_orders() {
  rtbus::Stamped<rtbus::BodyOrders> sample;
  if (!body_orders_out || body_orders_out->read_latest(sample) != rtbus::ReadStatus::kFresh) return;
  // The other clock is another: an order's end travels as the time that it has left.
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  for (std::uint64_t& until_ns : sample.value.until_ns) until_ns = until_ns > now_ns ? until_ns - now_ns : 0;
  send_sample(hands.front(), StateKind::kBodyOrders, sample.value);
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
    send_body_orders();
    rtbus::sleep_until(next_ns);
  }
}

}  // namespace link_dds
