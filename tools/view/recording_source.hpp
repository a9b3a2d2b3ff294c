#pragma once
/// @file recording_source.hpp
/// A recording as a source of frames, at the instant that the playback says.
#include <memory>
#include <string>
#include <vector>

#include "rtbus/recording/reader.hpp"
#include "rtbus/result.hpp"
#include "tools/cli/still/told_shapes.hpp"
#include "tools/view/frame_source.hpp"
#include "tools/view/playback.hpp"
#include "tools/view/recorded_bodies.hpp"
#include "tools/view/recorded_hand.hpp"

namespace view {

/// One thread.
class RecordingSource : public FrameSource {
 public:
  static constexpr double kHistory_s = 60.0;  ///< Of the curves.

  /// The error is a sentence for the user: no such file, no recording, nothing in it that could be shown.
  [[nodiscard]] static rtbus::Result<std::shared_ptr<RecordingSource>, std::string> open(const std::string& file);

  void follow() override;
  [[nodiscard]] std::string session() const override { return recording_.session(); }
  [[nodiscard]] const ViewScene* scene() const override { return &scene_; }
  [[nodiscard]] const ViewFrame& frame() const override { return frame_; }
  [[nodiscard]] const Document& state() const override { return state_; }
  [[nodiscard]] const Document& figures() const override { return figures_; }
  [[nodiscard]] Playback* playback() override { return &playback_; }
  [[nodiscard]] const Document& playback_state() const override { return playback_state_; }
  [[nodiscard]] double clock_s(std::uint64_t) const override { return static_cast<double>(time_ns()) * 1e-9; }

 private:
  explicit RecordingSource(rtbus::recording::Recording recording);
  [[nodiscard]] std::string load();
  [[nodiscard]] std::string find_span();
  void read_told_shapes();
  void step(int ticks);
  void judge_hands();
  void tell_playback();
  [[nodiscard]] std::uint64_t time_ns() const;

  rtbus::recording::Recording recording_;
  Playback playback_{0.0};
  std::uint64_t begin_ns_ = 0;
  ViewScene scene_;
  std::vector<std::string> notes_;
  nlohmann::ordered_json marks_ = nlohmann::ordered_json::array();
  std::unique_ptr<RecordedBodies> bodies_;
  tools::ToldShapesTable told_;  ///< The last world that an external engine told.
  std::vector<RecordedHand> hands_;
  double shown_s_ = -1.0;
  std::uint32_t jumps_ = 0;
  bool began_ = false;
  ViewFrame frame_;
  Document state_, figures_, playback_state_;
};

}  // namespace view
