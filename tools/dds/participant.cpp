#include "tools/dds/participant.hpp"

#include <utility>

namespace tools::dds {

Qos new_qos(bool reliable, bool latched, std::int32_t depth) {
  Qos qos(dds_create_qos(), &dds_delete_qos);
  dds_qset_reliability(qos.get(), reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_MSECS(10));
  dds_qset_durability(qos.get(), latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  if (latched) {
    dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, depth, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED);
  }
  dds_qset_writer_data_lifecycle(qos.get(), false);
  return qos;
}

std::string refused(const std::string& topic, dds_return_t code) {
  return "DDS refuses the topic " + topic + ": " + dds_strretcode(code);
}

rtbus::Result<Participant, std::string> Participant::open(int domain, const std::string& configuration) {
  const auto id = static_cast<dds_domainid_t>(domain);
  const dds_entity_t made = dds_create_domain(id, configuration.c_str());
  if (made < 0) return rtbus::Failure{std::string(dds_strretcode(made))};
  const dds_entity_t participant = dds_create_participant(id, nullptr, nullptr);
  if (participant < 0) {
    dds_delete(made);
    return rtbus::Failure{std::string(dds_strretcode(participant))};
  }
  return Participant(made, participant);
}

Participant::Participant(Participant&& other) noexcept
    : domain_(std::exchange(other.domain_, 0)), participant_(std::exchange(other.participant_, 0)) {}

Participant::~Participant() {
  if (domain_ > 0) dds_delete(domain_);
}

rtbus::Result<dds_entity_t, std::string> Participant::writer(const std::string& topic,
                                                             const dds_topic_descriptor_t& type, const Qos& qos) {
  const dds_entity_t to = dds_create_topic(participant_, &type, topic.c_str(), nullptr, nullptr);
  const dds_entity_t made = to < 0 ? to : dds_create_writer(participant_, to, qos.get(), nullptr);
  if (made < 0) return rtbus::Failure{refused(topic, made)};
  return made;
}

rtbus::Result<dds_entity_t, std::string> Participant::reader(const std::string& topic,
                                                             const dds_topic_descriptor_t& type, const Qos& qos) {
  const dds_entity_t to = dds_create_topic(participant_, &type, topic.c_str(), nullptr, nullptr);
  const dds_entity_t made = to < 0 ? to : dds_create_reader(participant_, to, qos.get(), nullptr);
  if (made < 0) return rtbus::Failure{refused(topic, made)};
  return made;
}

}  // namespace tools::dds
