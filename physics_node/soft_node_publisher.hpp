#pragma once
/// @file soft_node_publisher.hpp
/// `physics.soft_nodes`: where the nodes of the soft bodies are, for whoever draws them. Nothing is copied while nobody
/// looks.
#include <atomic>
#include <cstdint>
#include <memory>

#include "physics_node/stepper.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"

namespace physics {

/// As PosePublisher, with the nodes of soft bodies in place of poses.
class SoftNodePublisher {
 public:
  static constexpr std::uint64_t kPeriod_ns = 1'000'000'000 / 30;

  /// @param nodes Of the scene, above 0. The ring holds at least four frames.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<SoftNodePublisher>, rtbus::TopicError> create(
      const rtbus::Session& session, std::size_t nodes);

  /// Makes the topic anew when it was deleted, and asks the kernel whether somebody looks. For the thread that beats.
  void maintain() noexcept {
    writer_.maintain();
    observed_.store(writer_.observed(), std::memory_order_relaxed);
  }
  [[nodiscard]] bool observed() const noexcept { return observed_.load(std::memory_order_relaxed); }

  /// Publishes a frame when somebody looks and kPeriod_ns have passed. For the thread that steps.
  void publish_if_due(const Stepper& stepper, std::uint64_t now_ns) noexcept;

 private:
  explicit SoftNodePublisher(rtbus::Publication<rtbus::SoftNodes> writer) : writer_(std::move(writer)) {}

  rtbus::Publication<rtbus::SoftNodes> writer_;
  std::atomic<bool> observed_{false};
  std::uint64_t due_ns_ = 0;
  std::uint64_t frames_ = 0;
};

}  // namespace physics
