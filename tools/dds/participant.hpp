#pragma once
/// @file participant.hpp
/// One participant on DDS, and the QoS of its writers and readers.
#include <dds/dds.h>

#include <cstdint>
#include <memory>
#include <string>

#include "rtbus/result.hpp"

namespace tools::dds {

using Qos = std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)>;

/// @param reliable Repeated until it has come; a writer waits at most 10 ms for readers that lag.
/// @param latched Who comes later gets the last samples too (transient local).
/// @param depth Keep last so many: the newest win.
[[nodiscard]] Qos new_qos(bool reliable, bool latched, std::int32_t depth);

/// What DDS says when it refuses a topic, as a sentence for the user.
[[nodiscard]] std::string refused(const std::string& topic, dds_return_t code);

/// A participant in a domain of its own configuration; both end with it.
class Participant {
 public:
  /// @param domain 0 to 232. @param configuration XML of Cyclone DDS, the inside of <Domain>.
  /// The error is what DDS says of it. The threads of Cyclone DDS inherit the CPUs of the calling thread.
  [[nodiscard]] static rtbus::Result<Participant, std::string> open(int domain, const std::string& configuration);
  ~Participant();
  Participant(Participant&& other) noexcept;
  Participant& operator=(Participant&&) = delete;

  [[nodiscard]] dds_entity_t entity() const noexcept { return participant_; }
  /// The errors are sentences for the user.
  [[nodiscard]] rtbus::Result<dds_entity_t, std::string> writer(const std::string& topic,
                                                                const dds_topic_descriptor_t& type, const Qos& qos);
  [[nodiscard]] rtbus::Result<dds_entity_t, std::string> reader(const std::string& topic,
                                                                const dds_topic_descriptor_t& type, const Qos& qos);

 private:
  Participant(dds_entity_t domain, dds_entity_t participant) : domain_(domain), participant_(participant) {}
  dds_entity_t domain_, participant_;
};

}  // namespace tools::dds
