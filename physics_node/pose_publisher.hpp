#pragma once
/// @file pose_publisher.hpp
/// `physics.body_poses`: where the bodies are, for whoever draws them. Nothing is copied while nobody looks.
#include <atomic>
#include <cstdint>
#include <memory>

#include "physics_node/stepper.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"

namespace physics {

/// Owns the topic. Reads the world and never changes it: forces are bit-identical with and without an observer.
class PosePublisher {
 public:
  static constexpr std::uint64_t kPeriod_ns = 1'000'000'000 / 30;

  /// @param bodies Of the scene, static ones included. The ring holds at least four frames.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<PosePublisher>, rtbus::TopicError> create(
      const rtbus::Session& session, std::size_t bodies);

  /// Makes the topic anew when it was deleted, and asks the kernel whether somebody looks. For the thread that beats.
  void maintain() noexcept {
    writer_.maintain();
    observed_.store(writer_.observed(), std::memory_order_relaxed);
  }
  [[nodiscard]] bool observed() const noexcept { return observed_.load(std::memory_order_relaxed); }

  /// Publishes a frame when somebody looks and kPeriod_ns have passed. For the thread that steps, after it has
  /// published its answers: about 20 ns per body of the time that is left until the next step.
  void publish_if_due(const Stepper& stepper, std::uint64_t now_ns) noexcept;

 private:
  explicit PosePublisher(rtbus::Publication<rtbus::BodyPoses> writer) : writer_(std::move(writer)) {}

  rtbus::Publication<rtbus::BodyPoses> writer_;
  std::atomic<bool> observed_{false};
  std::uint64_t due_ns_ = 0;
  std::uint64_t frames_ = 0;
};

}  // namespace physics
