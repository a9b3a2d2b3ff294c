#pragma once
/// @file contact_topics.hpp
/// The topics `physics.contacts.<haptic>` of the node: each is created, and costs time, only when it is needed.
#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "physics_node/node_config.hpp"
#include "physics_node/stepper.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/publication.hpp"

namespace physics {

/// Two threads: one publishes after each step, one maintains about every 20 ms.
class ContactTopics {
 public:
  static constexpr std::uint32_t kCapacity = 64;

  explicit ContactTopics(const NodeConfig& config);

  /// With `physics.contacts: on`: creates all. @returns what failed, in one sentence, or "".
  [[nodiscard]] std::string open();

  /// Publishes for each device that wants it, or for all. A topic that is missing yet is asked for. Step thread.
  void publish(Stepper& stepper, std::uint64_t now_ns) noexcept;

  /// Creates what publish() asked for, and makes anew what somebody has deleted. @returns what failed, in one sentence
  /// and once for each topic, or "". Other thread.
  [[nodiscard]] std::string maintain();

  /// A topic exists. Any thread.
  [[nodiscard]] bool in_use() const noexcept { return in_use_.load(std::memory_order_relaxed); }

 private:
  using Writer = rtbus::Publication<rtbus::ProxyContacts>;
  struct Topic {
    std::string name;
    std::unique_ptr<Writer> owner;
    std::atomic<Writer*> ready{nullptr};
    std::atomic<bool> asked{false};
    bool failed = false;
  };
  [[nodiscard]] std::string create(Topic& topic);

  rtbus::Session session_;
  bool always_;
  double radius_m_;
  std::vector<std::unique_ptr<Topic>> topics_;  // in the order of the proxies
  rtbus::ProxyContacts message_;                // of the step thread
  std::atomic<bool> in_use_{false};
};

}  // namespace physics
