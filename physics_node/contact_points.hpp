#pragma once
/// @file contact_points.hpp
/// The topics `physics.contact_points.<haptic>`: contacts and their normals for observers, of every method. Nothing is
/// computed without an observer.
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "physics_node/node_config.hpp"
#include "physics_node/stepper.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/publication.hpp"

namespace physics {

/// Two threads: one publishes after the steps, one maintains about every 20 ms. Reads the world and never changes it:
/// forces are bit-identical with and without an observer.
class ContactPointTopics {
 public:
  static constexpr std::uint64_t kPeriod_ns = rtbus::kNsPerS / 30;
  static constexpr std::uint32_t kCapacity = 64;

  /// @returns what failed, in one sentence, or "".
  [[nodiscard]] std::string open(const NodeConfig& config);

  /// For each proxy that somebody looks at, when kPeriod_ns have passed. Step thread, after its answers.
  void publish_if_due(Stepper& stepper, std::uint64_t now_ns) noexcept;

  /// Creates topics again that were deleted, and asks the kernel whether observers are attached. Other thread.
  void maintain() noexcept;

 private:
  struct Topic {
    rtbus::Publication<rtbus::ContactPoints> writer;
    std::atomic<bool> observed{false};
  };
  std::vector<std::unique_ptr<Topic>> topics_;  // in the order of the proxies
  rtbus::ContactPoints message_;                // of the step thread
  std::uint64_t due_ns_ = 0;
};

}  // namespace physics
