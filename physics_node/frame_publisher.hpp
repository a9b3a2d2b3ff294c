#pragma once
/// @file frame_publisher.hpp
/// `physics.body_poses` and `physics.soft_nodes`: poses of bodies and positions of soft nodes, for observers. Nothing
/// is copied without an observer.
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "physics_node/stepper.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"

namespace physics {

/// Owns a topic whose samples together are a frame: a picture of the world. Reads the world and never changes it:
/// forces are bit-identical with and without an observer.
/// @tparam Sample rtbus::BodyPoses or rtbus::SoftNodes.
template <class Sample>
class FramePublisher {
 public:
  static constexpr std::uint64_t kPeriod_ns = 1'000'000'000 / 30;

  /// @param items In a frame: bodies of the scene, static ones included, or nodes. The ring holds at least four frames.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<FramePublisher>, rtbus::TopicError> create(
      const rtbus::Session& session, std::size_t items);

  /// Creates the topic again when it was deleted, and asks the kernel whether an observer is attached. For the
  /// heartbeat thread.
  void maintain() noexcept {
    writer_.maintain();
    observed_.store(writer_.observed(), std::memory_order_relaxed);
  }
  [[nodiscard]] bool observed() const noexcept { return observed_.load(std::memory_order_relaxed); }

  /// Publishes a frame when an observer is attached and kPeriod_ns have passed. For the step thread, after its answers:
  /// about 20 ns per body.
  void publish_if_due(const Stepper& stepper, std::uint64_t now_ns) noexcept;

 private:
  explicit FramePublisher(rtbus::Publication<Sample> writer) : writer_(std::move(writer)) {}

  rtbus::Publication<Sample> writer_;
  std::atomic<bool> observed_{false};
  std::uint64_t due_ns_ = 0;
  std::uint64_t frames_ = 0;
};

using PosePublisher = FramePublisher<rtbus::BodyPoses>;
using SoftNodePublisher = FramePublisher<rtbus::SoftNodes>;

}  // namespace physics
