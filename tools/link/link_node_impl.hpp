#pragma once
/// @file link_node_impl.hpp
/// What the threads of a LinkNode share. Private to tools/link.
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/network_messages.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/subscription.hpp"
#include "tools/link/flow.hpp"
#include "tools/link/link_node.hpp"
#include "tools/link/packet.hpp"
#include "tools/link/peers.hpp"
#include "tools/link/wire.hpp"

namespace link_dds {

/// First byte of a packet of state.
enum class StateKind : std::uint8_t { kStepStats = 1, kPhysicsInfo = 2, kHapticInfo = 3, kOrders = 4, kBodyOrders = 5 };
inline constexpr std::size_t kStateKinds = 6;
inline constexpr std::uint64_t kMaintain_ns = 20 * rtbus::kNsPerMs;  ///< Between two looks whether to go on.

template <rtbus::Sample T>
using Out = rtbus::Subscription<T>;
template <rtbus::Sample T>
using In = rtbus::Publication<T>;

/// Stamps of a topic never go back.
struct Stamps {
  std::uint64_t last_ns = 0;
  [[nodiscard]] std::uint64_t next(std::uint64_t wanted_ns) noexcept { return last_ns = std::max(last_ns, wanted_ns); }
};

struct LinkNode::Impl {
  /// What this end has of a hand.
  struct Hand {
    explicit Hand(LinkedHand of) : about(std::move(of)) {}
    LinkedHand about;
    std::optional<Flow> flow;
    std::optional<PacketWriter> state_out;
    std::optional<PacketReader> state_in;
    std::uint64_t state_sequence = 0;
    std::array<NewestWins, kStateKinds> state_newest;
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
    Bytes packet;
  };

  explicit Impl(LinkPlan of);
  [[nodiscard]] bool has_physics() const { return plan.is_here("physics"); }

  [[nodiscard]] std::string open_topics();
  [[nodiscard]] std::string open_streams();
  void maintain();
  void publish_stats();

  void out_thread();
  void send_hand(Hand& hand);
  void send_answer(Hand& hand);
  void send_state(Hand& hand);
  void send_body_orders();
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
  [[nodiscard]] bool take_body_orders(rtbus::BodyOrders orders, std::uint64_t now_ns);
  /// Passes orders of the other machine on to `rtbus run` of this one, as if they had been given here.
  void pass_on(const std::vector<std::string>& estops, const std::function<void(const std::string&)>& tell);
  void pass_on_bodies(const std::function<void(const std::string&)>& tell);
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
  std::unique_ptr<Out<rtbus::BodyOrders>> body_orders_out;  ///< Of the hands' machine; null where orders move none.
  // Of physics, where it is.
  std::unique_ptr<Out<rtbus::Heartbeat>> heartbeat_out;
  std::unique_ptr<Out<rtbus::StepStats>> step_stats_out;
  std::unique_ptr<Out<rtbus::NodeInfo>> physics_info_out;
  rtbus::Stamped<rtbus::Heartbeat> beat;
  rtbus::BodyOrders body_orders;  ///< Taken last, of link_in.

  std::mutex peers_guard;  // for what follows
  Peers peers;
  std::vector<std::string> words;
  std::vector<std::string> estops;   ///< Reasons of E-stops that the other machine ordered.
  rtbus::BodyOrders waiting_orders;  ///< Of bodies, likewise; each body's newest.
  std::string told_refusal;          ///< Of the thread that serves.

  std::atomic<bool> stop{false};
  std::thread out, in;
};

}  // namespace link_dds
