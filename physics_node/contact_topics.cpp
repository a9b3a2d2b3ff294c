#include "physics_node/contact_topics.hpp"

#include <utility>

namespace physics {

ContactTopics::ContactTopics(const NodeConfig& config)
    : session_(config.session),
      always_(config.physics.contacts_always),
      radius_m_(config.physics.contact_radius_m.value_or(0.0)) {
  for (const ProxyConfig& proxy : config.proxies) {
    topics_.push_back(std::make_unique<Topic>());
    topics_.back()->name = "physics.contacts." + proxy.device;
  }
}

std::string ContactTopics::open() {
  for (const auto& topic : topics_) {
    if (!always_) break;
    if (std::string failed = create(*topic); !failed.empty()) return failed;
  }
  return {};
}

std::string ContactTopics::create(Topic& topic) {
  auto writer = Writer::create(session_, topic.name, {.capacity = kCapacity});
  if (!writer) {
    topic.failed = true;
    return "session " + session_.name + ": topic " + topic.name + ": " + rtbus::to_string(writer.error());
  }
  topic.owner = std::make_unique<Writer>(std::move(*writer));
  topic.ready.store(topic.owner.get(), std::memory_order_release);
  in_use_.store(true, std::memory_order_relaxed);
  return {};
}

void ContactTopics::publish(Stepper& stepper, std::uint64_t now_ns) noexcept {
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (!always_ && !stepper.wants_contacts(i)) continue;
    Writer* const writer = topics_[i]->ready.load(std::memory_order_acquire);
    if (writer == nullptr) {
      topics_[i]->asked.store(true, std::memory_order_relaxed);
      continue;
    }
    stepper.contacts(i, radius_m_, message_);
    writer->publish(message_, now_ns);
  }
}

std::string ContactTopics::maintain() {
  std::string failed;
  for (const auto& topic : topics_) {
    if (topic->owner) topic->owner->maintain();
    if (topic->owner || topic->failed || !topic->asked.load(std::memory_order_relaxed)) continue;
    if (std::string each = create(*topic); failed.empty()) failed = std::move(each);
  }
  return failed;
}

}  // namespace physics
