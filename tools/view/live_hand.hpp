#pragma once
/// @file live_hand.hpp
/// One haptic node of a live session: where its hand is, and its ticks for the curves.
#include <cstdint>
#include <string>
#include <vector>

#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/order_messages.hpp"
#include "tools/cli/top/top_collect.hpp"
#include "tools/view/frame_source.hpp"
#include "tools/view/session_scene.hpp"
#include "tools/view/session_state.hpp"
#include "tools/view/tick_rows.hpp"

namespace view {

/// An observer of the node's telemetry. One thread.
class LiveHand {
 public:
  LiveHand(const rtbus::Session& session, SessionHand hand);

  /// Takes in what is new. @returns true when something was. @param out Keeps its ticks.
  bool follow(double history_s, ViewHand& out);

  /// Adds the contacts of the proxy: those of physics, else those with the shapes that the haptic loop knows.
  void add_contacts(std::uint32_t hand, const ViewHand& placed, std::vector<ViewContact>& out);

  /// @param physics See HandSigns.
  [[nodiscard]] HandState state(const std::string& physics) const;
  [[nodiscard]] const std::string& name() const noexcept { return config_.name; }

 private:
  void take(const rtbus::Stamped<rtbus::Telemetry>& sample, ViewTicks& out);

  tools::StillHandConfig config_;
  double force_limit_n_;
  std::vector<rtbus::shapes::PlacedShape> shapes_;
  tools::Follow<rtbus::DeviceState> device_;
  tools::Follow<rtbus::ProxyState> proxy_;
  tools::Follow<rtbus::Telemetry> telemetry_;
  tools::Follow<rtbus::ContactPoints> contacts_;
  mutable tools::Follow<rtbus::Orders> orders_;
  std::optional<rtbus::Stamped<rtbus::Telemetry>> tick_;     ///< The newest.
  std::optional<rtbus::Stamped<rtbus::ProxyState>> answer_;  ///< Likewise.
  TickRows rows_;
  std::uint32_t clamped_ = 0;  ///< Bits that limit the force, of the tick at limited_ns_.
  std::uint64_t limited_ns_ = 0;
};

}  // namespace view
