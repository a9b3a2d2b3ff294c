#pragma once
/// @file still_frame.hpp
/// One instant of a scene, ready to be drawn: where its bodies are, where the hands are and what they feel. Taken from
/// a running session over the bus, or from the harness.
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "haptic_node/node_config.hpp"
#include "physics_node/engine/world.hpp"
#include "physics_node/node_config.hpp"
#include "rtbus/config/scene.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tools/cli/still/told_shapes.hpp"
#include "tools/harness/harness.hpp"

namespace tools {

/// What one haptic device holds in the world. Frame W.
struct StillHand {
  std::string name;       ///< "haptic0"
  double radius_m = 0.0;  ///< Of the proxy; 0: a point.
  Eigen::Vector3d proxy_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d target_m = Eigen::Vector3d::Zero();  ///< Where the device is.
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();   ///< On the hand: newtons at the device, turned into W.
};

struct StillFrame {
  std::string stem;                           ///< File name without suffix: "still_start".
  std::string moment;                         ///< For people: "t = 2.31 s, hardest push".
  std::vector<physics::BodyPose> poses;       ///< In the scene's order.
  std::vector<Eigen::Vector3d> soft_nodes_m;  ///< Of all soft bodies, one after the other.
  std::vector<StillHand> hands;
};

/// The scene as its file places it, without hands.
[[nodiscard]] StillFrame frame_of(const rtbus::config::Scene& scene);

/// What stays of a haptic node between frames.
struct StillHandConfig {
  std::string name;
  double radius_m = 0.0;
  Eigen::Quaterniond q_WD = Eigen::Quaterniond::Identity();
  double position_scale = 1.0;
};
[[nodiscard]] StillHandConfig hand_config(const haptic::HapticConfig& haptic, const physics::NodeConfig* physics);

/// The hand by the newest samples of its topics. @param proxy Null where there is none (`direct`).
[[nodiscard]] StillHand hand_of(const StillHandConfig& config, const rtbus::DeviceState& device,
                                const rtbus::ProxyState* proxy, const rtbus::Telemetry& tick);

/// The present instant of a harness. @param ticks The last of each hand.
[[nodiscard]] StillFrame frame_of(const rtbus::config::Scene& scene, const Harness& harness,
                                  std::span<const rtbus::Telemetry> ticks);

/// Puts the complete frames of `physics.body_poses` together. One thread.
class BodyPoseReader {
 public:
  /// Asks physics to publish, for as long as the reader lives.
  [[nodiscard]] static rtbus::Result<BodyPoseReader, rtbus::TopicError> open(const rtbus::Session& session);

  /// Takes in what is new. @returns true when a newer frame is complete.
  bool drain();
  [[nodiscard]] bool replaced() const noexcept { return reader_.replaced(); }  ///< Open it anew.
  [[nodiscard]] const std::vector<physics::BodyPose>& poses() const noexcept { return complete_; }
  [[nodiscard]] double simulated_s() const noexcept { return simulated_s_; }  ///< Of the complete frame.

 private:
  explicit BodyPoseReader(rtbus::Reader<rtbus::BodyPoses> reader) : reader_(std::move(reader)) {}
  rtbus::Reader<rtbus::BodyPoses> reader_;
  std::vector<physics::BodyPose> partial_, complete_;
  std::uint64_t frame_ = 0;
  double simulated_s_ = 0.0;
};

/// Puts the complete frames of `physics.soft_nodes` together. One thread.
class SoftNodeReader {
 public:
  /// Asks physics to publish, for as long as the reader lives.
  [[nodiscard]] static rtbus::Result<SoftNodeReader, rtbus::TopicError> open(const rtbus::Session& session);

  /// Takes in what is new. @returns true when a newer frame is complete.
  bool drain();
  [[nodiscard]] bool replaced() const noexcept { return reader_.replaced(); }  ///< Open it anew.
  /// Of the newest complete frame; empty: there was none yet.
  [[nodiscard]] const std::vector<Eigen::Vector3d>& nodes_m() const noexcept { return complete_; }

 private:
  explicit SoftNodeReader(rtbus::Reader<rtbus::SoftNodes> reader) : reader_(std::move(reader)) {}
  rtbus::Reader<rtbus::SoftNodes> reader_;
  std::vector<Eigen::Vector3d> partial_, complete_;
  std::uint64_t frame_ = 0;
};

/// The bus as a source of frames. One thread.
class BusFrames {
 public:
  /// @param scene Of the session file. An external engine that tells its shapes has other bodies.
  BusFrames(rtbus::Session session, rtbus::config::Scene scene, std::vector<StillHandConfig> hands);

  /// Opens what is there; physics publishes poses from then on. @returns false while something is missing.
  [[nodiscard]] bool attach();
  /// Takes in what is new. @returns true when there is a frame newer than before.
  bool drain();
  /// The newest, without stem. The hands are at most one tick and one step away from the bodies' instant.
  [[nodiscard]] const StillFrame& frame() const noexcept { return newest_; }
  /// What the frame's poses belong to.
  [[nodiscard]] const rtbus::config::Scene& scene() const noexcept { return scene_; }

 private:
  void follow_told_shapes();

  struct Hand {
    StillHandConfig config;
    std::optional<rtbus::Reader<rtbus::DeviceState>> device;
    std::optional<rtbus::Reader<rtbus::ProxyState>> proxy;
    std::optional<rtbus::Reader<rtbus::Telemetry>> telemetry;
    rtbus::Stamped<rtbus::DeviceState> device_now;
    rtbus::Stamped<rtbus::ProxyState> proxy_now;
    rtbus::Stamped<rtbus::Telemetry> tick_now;
  };
  rtbus::Session session_;
  rtbus::config::Scene scene_;
  ToldShapesReader told_;
  StillFrame newest_;
  std::vector<Hand> hands_;
  std::optional<BodyPoseReader> bodies_;
  std::optional<SoftNodeReader> soft_;
  bool moving_ = false;  ///< The scene has bodies that move, or an engine tells its own: there is a topic to wait for.
  bool yields_ = false;  ///< The scene has soft bodies: likewise.
  std::uint64_t taken_ns_ = 0;
};

}  // namespace tools
