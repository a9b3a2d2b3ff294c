#pragma once
/// @file bus_link.hpp
/// The loop's link to physics over the bus.
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "haptic_node/loop.hpp"
#include "haptic_node/pipe_link.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/subscription.hpp"

namespace haptic {

/// `<haptic>.device_state` out, and those of the session's other hands in, where the method feels them;
/// `physics.proxy_state.<haptic>` and `physics.heartbeat` in, from whichever physics process is there. With `link:
/// pipe` hand and proxy travel through the pipe; the topic of the hand goes on for observers, and the heartbeat stays
/// on the bus: whether physics lives is not part of the comparison. send() and receive() belong to the loop's thread,
/// maintain() to the housekeeping thread.
class BusLink final : public PhysicsLink {
 public:
  /// @param needs_physics False: the incoming topics are left out. @param needs_contacts False: so is that of the
  /// contacts.
  /// @param wire Form of the link. @param other_hands Whose states the loop reads as well.
  BusLink(rtbus::Publication<rtbus::DeviceState> device_state, const rtbus::Session& session, const std::string& node,
          bool needs_physics, bool needs_contacts, const rtbus::config::LinkConfig& wire,
          const std::vector<OtherHandConfig>& other_hands)
      : device_state_(std::move(device_state)) {
    for (const OtherHandConfig& other : other_hands) {
      other_hands_.push_back(
          std::make_unique<rtbus::Subscription<rtbus::DeviceState>>(session, other.name + ".device_state"));
    }
    if (!needs_physics) return;
    if (wire.pipe) {
      pipe_ = std::make_unique<PipeLink>(session, node, *wire.rate_hz);
    } else {
      proxy_state_ = std::make_unique<rtbus::Subscription<rtbus::ProxyState>>(session, "physics.proxy_state." + node);
    }
    if (needs_contacts) {
      contacts_ = std::make_unique<rtbus::Subscription<rtbus::ProxyContacts>>(session, "physics.contacts." + node);
    }
    heartbeat_ = std::make_unique<rtbus::Subscription<rtbus::Heartbeat>>(session, "physics.heartbeat");
  }

  void send(const rtbus::DeviceState& state, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING override {
    device_state_.publish(state, now_ns);
    if (pipe_) pipe_->send(state, now_ns);
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyState>& out) noexcept RTBUS_NONBLOCKING override {
    if (pipe_) return pipe_->receive(out);
    return proxy_state_ && proxy_state_->read_latest(out) == rtbus::ReadStatus::kFresh;
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyContacts>& out) noexcept RTBUS_NONBLOCKING override {
    return contacts_ && contacts_->read_latest_rows(out) == rtbus::ReadStatus::kFresh;
  }
  [[nodiscard]] bool receive(std::size_t other,
                             rtbus::Stamped<rtbus::DeviceState>& out) noexcept RTBUS_NONBLOCKING override {
    return other < other_hands_.size() && other_hands_[other]->read_latest(out) == rtbus::ReadStatus::kFresh;
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::Heartbeat>& out) noexcept RTBUS_NONBLOCKING override {
    return heartbeat_ && heartbeat_->read_latest(out) == rtbus::ReadStatus::kFresh;
  }
  [[nodiscard]] std::uint64_t refused() const noexcept RTBUS_NONBLOCKING override {
    return (proxy_state_ ? proxy_state_->refused() : 0) + (pipe_ ? pipe_->refused() : 0) +
           (contacts_ ? contacts_->refused() : 0) + (heartbeat_ ? heartbeat_->refused() : 0);
  }

  /// Finds physics, finds it again after a restart, and makes the own topic anew when it was deleted. About every
  /// 20 ms. @realtime No.
  void maintain() noexcept {
    device_state_.maintain();
    if (proxy_state_) proxy_state_->maintain();
    if (contacts_) contacts_->maintain();
    if (heartbeat_) heartbeat_->maintain();
    for (const auto& other : other_hands_) other->maintain();
  }

  /// The work of `link: pipe`, for a thread of its own; null without it.
  [[nodiscard]] PipeLink* pipe() const noexcept { return pipe_.get(); }
  [[nodiscard]] const rtbus::Publication<rtbus::DeviceState>& device_state() const noexcept { return device_state_; }

 private:
  rtbus::Publication<rtbus::DeviceState> device_state_;
  std::unique_ptr<rtbus::Subscription<rtbus::ProxyState>> proxy_state_;
  std::unique_ptr<rtbus::Subscription<rtbus::ProxyContacts>> contacts_;
  std::unique_ptr<rtbus::Subscription<rtbus::Heartbeat>> heartbeat_;
  std::vector<std::unique_ptr<rtbus::Subscription<rtbus::DeviceState>>> other_hands_;
  std::unique_ptr<PipeLink> pipe_;
};

}  // namespace haptic
