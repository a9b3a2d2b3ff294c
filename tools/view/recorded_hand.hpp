#pragma once
/// @file recorded_hand.hpp
/// One haptic node of a recording at an instant: where its hand is, and its ticks for the curves.
#include <cstdint>
#include <string>
#include <vector>

#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/order_messages.hpp"
#include "tools/view/frame_source.hpp"
#include "tools/view/recorded_track.hpp"
#include "tools/view/session_scene.hpp"
#include "tools/view/session_state.hpp"
#include "tools/view/tick_rows.hpp"

namespace view {

/// One thread.
class RecordedHand {
 public:
  /// @param recording Outlives the hand. @param notes Gets sentences about what cannot be shown.
  RecordedHand(const rtbus::recording::Recording& recording, SessionHand hand, std::vector<std::string>& notes);

  /// The ticks after those of the call before, up to `time_ns`; after a jump those of the last `history_s`.
  void follow(std::uint64_t time_ns, bool jump, double history_s, ViewHand& out);

  /// Adds the contacts of the proxy at that time, where they were recorded.
  void add_contacts(std::uint64_t time_ns, std::uint32_t hand, const ViewHand& placed, std::vector<ViewContact>& out);

  [[nodiscard]] HandState state(std::uint64_t time_ns);
  [[nodiscard]] const std::string& name() const noexcept { return config_.name; }
  [[nodiscard]] const RecordedTrack<rtbus::Telemetry>& ticks() const noexcept { return telemetry_; }
  [[nodiscard]] const RecordedTrack<rtbus::DeviceState>& devices() const noexcept { return device_; }

 private:
  tools::StillHandConfig config_;
  double force_limit_n_;
  std::vector<rtbus::shapes::PlacedShape> shapes_;
  RecordedTrack<rtbus::DeviceState> device_;
  RecordedTrack<rtbus::ProxyState> proxy_;
  RecordedTrack<rtbus::Telemetry> telemetry_;
  RecordedTrack<rtbus::ContactPoints> contacts_;
  RecordedTrack<rtbus::Orders> orders_;
  TickRows rows_;
  std::size_t next_ = 0, next_answer_ = 0;  ///< Rows that no call has taken.
  std::uint64_t limited_ns_ = 0;            ///< When a limit acted last.
  std::uint32_t limits_ = 0;                ///< Its bits.
};

}  // namespace view
