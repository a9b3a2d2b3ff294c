#include "tests/bridge/fast_peer.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <utility>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

namespace tests {

namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

/// A type of which only the name is known.
class RawType : public dds::TopicDataType {
 public:
  explicit RawType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 65536;
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const Bytes& bytes = *static_cast<Bytes*>(data);
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Bytes*>(data)->size()); };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

}  // namespace

struct FastPeer::Impl : dds::DomainParticipantListener {
  struct Topic : dds::DataReaderListener {
    dds::DataReader* reader = nullptr;
    mutable std::mutex guard;
    Bytes newest;
    std::uint64_t received = 0;
    void on_data_available(dds::DataReader* from) override {
      Bytes bytes;
      dds::SampleInfo info;
      while (from->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
        if (!info.valid_data) continue;
        const std::lock_guard lock(guard);
        newest = bytes;
        ++received;
      }
    }
  };
  struct Writer : dds::DataWriterListener {
    dds::DataWriter* writer = nullptr;
    std::atomic<int> matches{0};
    void on_publication_matched(dds::DataWriter*, const dds::PublicationMatchedStatus& status) override {
      matches = status.current_count;
    }
  };

  void on_publisher_discovery(dds::DomainParticipant*, rtps::WriterDiscoveryInfo&& info) override {
    if (info.status != rtps::WriterDiscoveryInfo::DISCOVERED_WRITER) return;
    FoundWriter found;
    found.type = info.info.typeName().to_string();
    found.user_data.assign(info.info.m_qos.m_userData.begin(), info.info.m_qos.m_userData.end());
    found.keyed = info.info.topicKind() == rtps::WITH_KEY;
    found.reliable = info.info.m_qos.m_reliability.kind == dds::RELIABLE_RELIABILITY_QOS;
    found.latched = info.info.m_qos.m_durability.kind == dds::TRANSIENT_LOCAL_DURABILITY_QOS;
    const std::lock_guard lock(guard);
    found_[info.info.topicName().to_string()] = found;
  }

  dds::Topic* topic(const std::string& name, const std::string& type) {
    if (dds::TopicDescription* const known = participant->lookup_topicdescription(name)) {
      return dynamic_cast<dds::Topic*>(known);
    }
    dds::TypeSupport(new RawType(type)).register_type(participant);
    return participant->create_topic(name, type, dds::TOPIC_QOS_DEFAULT);
  }

  dds::DomainParticipant* participant = nullptr;
  mutable std::mutex guard;
  std::map<std::string, FoundWriter> found_;
  std::map<std::string, std::unique_ptr<Topic>> topics;
  std::vector<std::unique_ptr<Writer>> writers;
};

FastPeer::FastPeer(int domain) : impl_(std::make_unique<Impl>()) {
  dds::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>());
  impl_->participant = dds::DomainParticipantFactory::get_instance()->create_participant(
      static_cast<dds::DomainId_t>(domain), qos, impl_.get(), dds::StatusMask::none());
  if (impl_->participant == nullptr) throw std::runtime_error("Fast DDS makes no participant");
}

FastPeer::~FastPeer() {
  impl_->participant->set_listener(nullptr);
  impl_->participant->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(impl_->participant);
}

void FastPeer::listen(const std::string& topic, const std::string& type, bool reliable, bool latched) {
  auto made = std::make_unique<Impl::Topic>();
  dds::Subscriber* const subscriber = impl_->participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  dds::DataReaderQos qos;
  qos.reliability().kind = reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind = latched ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.history().depth = 100;
  qos.data_sharing().off();
  qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
  made->reader = subscriber->create_datareader(impl_->topic(topic, type), qos, made.get());
  if (made->reader == nullptr) throw std::runtime_error("Fast DDS makes no reader of " + topic);
  impl_->topics[topic] = std::move(made);
}

std::optional<Bytes> FastPeer::newest(const std::string& topic) const {
  const auto found = impl_->topics.find(topic);
  if (found == impl_->topics.end()) return std::nullopt;
  const std::lock_guard lock(found->second->guard);
  return found->second->received == 0 ? std::nullopt : std::optional<Bytes>(found->second->newest);
}

std::uint64_t FastPeer::received(const std::string& topic) const {
  const auto found = impl_->topics.find(topic);
  if (found == impl_->topics.end()) return 0;
  const std::lock_guard lock(found->second->guard);
  return found->second->received;
}

std::map<std::string, FoundWriter> FastPeer::writers() const {
  const std::lock_guard lock(impl_->guard);
  return impl_->found_;
}

std::size_t FastPeer::announce(const std::string& topic, const std::string& type) {
  auto made = std::make_unique<Impl::Writer>();
  dds::Publisher* const publisher = impl_->participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
  dds::DataWriterQos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  qos.history().depth = 10;
  qos.data_sharing().off();
  qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
  made->writer = publisher->create_datawriter(impl_->topic(topic, type), qos, made.get());
  if (made->writer == nullptr) throw std::runtime_error("Fast DDS makes no writer of " + topic);
  impl_->writers.push_back(std::move(made));
  return impl_->writers.size() - 1;
}

bool FastPeer::matched(std::size_t writer) const { return impl_->writers.at(writer)->matches > 0; }

void FastPeer::write(std::size_t writer, const Bytes& payload) {
  Bytes copy = payload;
  impl_->writers.at(writer)->writer->write(&copy);
}

std::string hex(const Bytes& bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string out;
  for (const std::uint8_t byte : bytes) {
    out += kDigits[byte >> 4];
    out += kDigits[byte & 0xf];
  }
  return out;
}

}  // namespace tests
