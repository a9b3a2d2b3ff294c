#pragma once
/// @file live_source.hpp
/// A running session as a source of frames, followed through restarts of its nodes, its end and its return.
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tools/cli/common/started_with.hpp"
#include "tools/cli/still/still_frame.hpp"
#include "tools/cli/still/told_shapes.hpp"
#include "tools/cli/top/top_collect.hpp"
#include "tools/view/frame_source.hpp"
#include "tools/view/live_hand.hpp"

namespace view {

struct LiveOptions {
  std::optional<std::string> session;    ///< None: the only live one.
  std::string config;                    ///< Session file; "": as the session's nodes were started.
  std::vector<std::string> assignments;  ///< With `config`: its changed keys.
};

/// An observer: while it lives, physics publishes poses and the haptic nodes their ticks. One thread.
class LiveSource : public FrameSource {
 public:
  static constexpr double kHistory_s = 60.0;  ///< Of the curves.

  explicit LiveSource(LiveOptions options);

  void follow() override;
  [[nodiscard]] std::string session() const override { return seen_.session; }
  [[nodiscard]] const ViewScene* scene() const override { return scene_ ? &*scene_ : nullptr; }
  [[nodiscard]] const ViewFrame& frame() const override { return frame_; }
  [[nodiscard]] const Document& state() const override { return state_; }
  [[nodiscard]] const Document& figures() const override { return figures_; }

 private:
  void look_around();
  [[nodiscard]] std::string load(const tools::StartedWith& started);
  void show(ViewScene scene, const rtbus::Session& session, std::vector<LiveHand> hands);
  void follow_bodies();
  void follow_told_shapes();
  void judge_hands();
  [[nodiscard]] std::string physics_trouble() const;

  LiveOptions options_;
  tools::TopCollector collector_;
  tools::TopSnapshot seen_;
  std::uint64_t looked_ns_ = 0;

  std::set<std::uint32_t> pids_;  ///< Of the nodes when the scene was read.
  rtbus::Session session_;        ///< Of the scene.
  std::string problem_;           ///< Why there is no scene, or why it is not that of the session.
  std::uint32_t scenes_ = 0;
  std::optional<ViewScene> scene_;
  std::vector<LiveHand> hands_;
  std::optional<tools::ToldShapesReader> told_;  ///< Of the session, whatever its scene file says.
  std::optional<tools::StartedWith> started_;    ///< What the scene was read from.
  std::optional<tools::BodyPoseReader> bodies_;
  std::optional<tools::SoftNodeReader> soft_;
  bool moving_ = false, yields_ = false;  ///< The scene has such bodies.

  ViewFrame frame_;
  Document state_, figures_;
};

}  // namespace view
