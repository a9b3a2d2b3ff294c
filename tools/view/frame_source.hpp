#pragma once
/// @file frame_source.hpp
/// Where the frames of `rtbus view` come from. A live session is the first source; a recording can be another one.
/// Frame W: right-handed, y up. SI units. Times are seconds of CLOCK_MONOTONIC (of a recording: of its clock).
#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "physics_node/engine/world.hpp"
#include "rtbus/config/body_shape.hpp"
#include "tools/view/playback.hpp"

namespace view {

/// What stays while a scene is shown. The page receives the document first, then the meshes.
struct ViewScene {
  std::uint32_t number = 0;         ///< Grows with each scene of a source, from 1.
  nlohmann::ordered_json document;  ///< docs/viewer-protocol.md, message `scene`.
  std::vector<std::shared_ptr<const rtbus::config::TriangleMesh>> meshes;
  std::vector<std::uint32_t> order;  ///< Row of a frame → body in the scene's order; rows of one shape are neighbours.
  std::size_t soft_nodes = 0;
};

/// One cycle of a haptic loop: a row of the curves.
struct ViewTick {
  double time_s = 0.0;
  std::array<float, 3> force_n{};             ///< Sent to the device, frame D.
  std::array<float, 3> position_m{};          ///< p_DT.
  std::array<float, 3> proxy_m{};             ///< p_DP.
  float proxy_age_ms = 0.0F;                  ///< NaN: the cycle used no answer of physics.
  float energy_mj = 0.0F;                     ///< Observed energy E.
  float wakeup_us = 0.0F, compute_us = 0.0F;  ///< Of the cycle.
  float step_ms = 0.0F;                       ///< Longest physics step since the tick before it; NaN: no physics.
  float gate = 0.0F;                          ///< Product of start ramp and stale fade, 0…1.
  std::uint32_t safety = 0;                   ///< haptic::SafetyBit.
};
inline constexpr std::size_t kTickFloats = 16;  ///< Of the row without its time.

/// The ticks of the last seconds, numbered from 0.
struct ViewTicks {
  std::uint64_t first = 0;  ///< Number of the oldest that is kept.
  std::deque<ViewTick> rows;

  [[nodiscard]] std::uint64_t end() const noexcept { return first + rows.size(); }
};

struct ViewHand {
  Eigen::Vector3d proxy_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d device_m = Eigen::Vector3d::Zero();  ///< Where the device is in the world.
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();   ///< On the hand: newtons at the device, turned into W.
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  ///< p_WD of the present mapping.
  double radius_m = 0.0;                               ///< Of the proxy; 0: a point.
  ViewTicks ticks;
};

struct ViewContact {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< Towards the proxy.
  double gap_m = 0.0;                                 ///< Negative: penetrates.
  std::uint32_t hand = 0;
};

/// The newest of everything that moves.
struct ViewFrame {
  std::uint64_t number = 0;        ///< Grows with anything new.
  std::uint64_t poses_number = 0;  ///< Grows with new poses or nodes; 0: none yet.
  double poses_s = 0.0;            ///< When they were taken in.
  double simulated_s = 0.0;
  std::uint32_t jumps = 0;               ///< Of a recording: grows when the curves begin anew, after a jump.
  std::vector<physics::BodyPose> poses;  ///< In the scene's order; empty: as the scene places them.
  std::vector<Eigen::Vector3d> soft_nodes_m;
  std::vector<ViewContact> contacts;
  std::vector<ViewHand> hands;  ///< In the order of the scene document.
};

/// A message in JSON. The number grows when the text has changed; 0: there is none yet.
struct Document {
  std::uint64_t number = 0;
  nlohmann::ordered_json json;

  void set(nlohmann::ordered_json next) {
    if (number > 0 && next == json) return;
    json = std::move(next);
    ++number;
  }
};

/// One thread.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  FrameSource() : id_(++made()) {}
  FrameSource(const FrameSource&) = delete;
  FrameSource& operator=(const FrameSource&) = delete;

  /// No two sources of a process have the same. Numbers of scenes and frames count within one source.
  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }

  /// Takes in what is new. Called 60 times a second while somebody looks.
  virtual void follow() = 0;
  /// Of the session that is shown; "": none is.
  [[nodiscard]] virtual std::string session() const = 0;
  /// Null before the first scene. Afterwards the last one stays, also when its session has ended.
  [[nodiscard]] virtual const ViewScene* scene() const = 0;
  [[nodiscard]] virtual const ViewFrame& frame() const = 0;
  /// What is shown, its state in a word, and why: docs/viewer-protocol.md, message `state`.
  [[nodiscard]] virtual const Document& state() const = 0;
  /// The figures of `rtbus top`: message `figures`.
  [[nodiscard]] virtual const Document& figures() const = 0;
  /// Of a recording; null: live.
  [[nodiscard]] virtual Playback* playback() { return nullptr; }
  /// Message `playback`; number 0: live.
  [[nodiscard]] virtual const Document& playback_state() const {
    static const Document none;
    return none;
  }
  /// The frame's clock. @param now_ns CLOCK_MONOTONIC.
  [[nodiscard]] virtual double clock_s(std::uint64_t now_ns) const { return static_cast<double>(now_ns) * 1e-9; }

 private:
  static std::uint64_t& made() noexcept {
    static std::uint64_t count = 0;
    return count;
  }
  std::uint64_t id_;
};

}  // namespace view
