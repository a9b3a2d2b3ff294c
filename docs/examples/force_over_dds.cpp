// force_over_dds: prints the force on the hand of a session that runs with `bridge: {}`, ten times a second. Fast DDS
// alone: neither rtbus nor ROS 2 is needed where this runs. Build it with -lfastrtps (Fast DDS 2, libfastrtps-dev).
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

/// geometry_msgs/WrenchStamped as it travels: stamp, name of the frame, force, torque. Plain CDR, little endian.
struct Wrench {
  double force_n[3] = {};
};
class WrenchType : public fast::TopicDataType {
 public:
  WrenchType() {
    setName("geometry_msgs::msg::dds_::WrenchStamped_");
    m_typeSize = 1024;
    m_isGetKeyDefined = false;
  }
  bool deserialize(rtps::SerializedPayload_t* from, void* to) override {
    std::uint32_t characters = 0;  // of the frame's name, with its NUL: behind 4 bytes of encapsulation, 8 of stamp
    if (from->length < 16) return false;
    std::memcpy(&characters, from->data + 12, sizeof characters);
    const std::size_t force = (12 + std::size_t{characters} + 7) / 8 * 8 + 4;  // doubles lie at multiples of 8
    if (from->length < force + 6 * sizeof(double)) return false;
    std::memcpy(static_cast<Wrench*>(to)->force_n, from->data + force, 3 * sizeof(double));
    return true;
  }
  bool serialize(void*, rtps::SerializedPayload_t*) override { return false; }  // it only reads
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 0u; };
  }
  void* createData() override { return new Wrench; }
  void deleteData(void* data) override { delete static_cast<Wrench*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

int main(int argc, char** argv) {
  const std::string node = argc > 1 ? argv[1] : "haptic0";
  fast::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;  // its shared memory would stay when this program is killed
  qos.transport().user_transports.push_back(std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>());
  fast::DomainParticipant* const participant =
      fast::DomainParticipantFactory::get_instance()->create_participant(0, qos);
  fast::TypeSupport type(new WrenchType);
  type.register_type(participant);
  fast::Topic* const topic =
      participant->create_topic("rt/" + node + "/wrench", type->getName(), fast::TOPIC_QOS_DEFAULT);
  fast::Subscriber* const subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
  fast::DataReader* const reader = subscriber->create_datareader(topic, fast::DATAREADER_QOS_DEFAULT);
  if (reader == nullptr) return 1;
  Wrench wrench;
  fast::SampleInfo info;
  for (unsigned count = 0; reader->wait_for_unread_message({30, 0});) {
    while (reader->take_next_sample(&wrench, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data || count++ % 10 != 0) continue;  // of 100 in a second
      std::printf("%+.3f %+.3f %+.3f N\n", wrench.force_n[0], wrench.force_n[1], wrench.force_n[2]);
      std::fflush(stdout);
    }
  }
  std::puts("nothing came for 30 s: does the session run, with bridge: {}, on this network?");
}
