#pragma once
/// @file tick_rows.hpp
/// Ticks of a haptic loop as rows of the curves, and its hand in the world, from the samples of the bus or of a
/// recording. One thread.
#include <cstdint>
#include <deque>
#include <limits>
#include <vector>

#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/shapes/shapes.hpp"
#include "rtbus/topic.hpp"
#include "tools/cli/still/still_frame.hpp"
#include "tools/view/frame_source.hpp"

namespace view {

class TickRows {
 public:
  /// An answer of physics. In the order of its sequence numbers, before the tick that uses it.
  void add_answer(const rtbus::Stamped<rtbus::ProxyState>& answer);
  /// The row of a tick.
  [[nodiscard]] ViewTick row(const rtbus::Stamped<rtbus::Telemetry>& tick);
  void forget() { *this = {}; }

 private:
  struct Step {
    std::uint64_t sequence = 0;
    float compute_ms = 0.0F;
  };
  [[nodiscard]] float step_before(const rtbus::Telemetry& tick);

  std::deque<Step> steps_;                                   ///< Those that no tick has used yet.
  float step_ms_ = std::numeric_limits<float>::quiet_NaN();  ///< Of the last step that a tick used.
};

/// Where hand and proxy are in the world. @param proxy Null where there is none (`direct`).
void place_hand(const tools::StillHandConfig& config, const rtbus::DeviceState& device, const rtbus::ProxyState* proxy,
                const rtbus::Telemetry& tick, ViewHand& out);

/// Adds the contacts of one hand's proxy.
void add_points(const rtbus::ContactPoints& contacts, std::uint32_t hand, std::vector<ViewContact>& out);

/// The same where the haptic loop itself finds the contacts of a proxy (`direct`, `virtual_coupling`): with all shapes
/// that are nearer than `reach_m`.
void add_points(const std::vector<rtbus::shapes::PlacedShape>& shapes, const ViewHand& placed, double reach_m,
                std::uint32_t hand, std::vector<ViewContact>& out);

/// Keeps the last `history_s` seconds.
void forget_older(double history_s, ViewTicks& ticks);

}  // namespace view
