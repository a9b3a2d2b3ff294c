#include "physics_node/contact_points.hpp"

#include <utility>

namespace physics {

std::string ContactPointTopics::open(const NodeConfig& config) {
  for (const ProxyConfig& proxy : config.proxies) {
    const std::string topic = "physics.contact_points." + proxy.device;
    auto writer = rtbus::Publication<rtbus::ContactPoints>::create(config.session, topic, {.capacity = kCapacity});
    if (!writer) return "session " + config.session.name + ": topic " + topic + ": " + rtbus::to_string(writer.error());
    topics_.push_back(std::unique_ptr<Topic>(new Topic{std::move(*writer)}));
  }
  return {};
}

void ContactPointTopics::publish_if_due(Stepper& stepper, std::uint64_t now_ns) noexcept {
  if (now_ns < due_ns_) return;
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (!topics_[i]->observed.load(std::memory_order_relaxed)) continue;
    due_ns_ = now_ns + kPeriod_ns;
    stepper.contact_points(i, message_);
    topics_[i]->writer.publish(message_, now_ns);
  }
}

void ContactPointTopics::maintain() noexcept {
  for (const auto& topic : topics_) {
    topic->writer.maintain();
    topic->observed.store(topic->writer.observed(), std::memory_order_relaxed);
  }
}

}  // namespace physics
