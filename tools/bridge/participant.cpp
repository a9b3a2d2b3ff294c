#include "tools/bridge/participant.hpp"

#include <ros2_messages.h>

namespace bridge {

// The hashes are those of the published definitions, which ROS 2 computes when it generates its code.
const MessageType kPoseStamped{&geometry_msgs_msg_dds__PoseStamped__desc,
                               "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"};
const MessageType kTwistStamped{&geometry_msgs_msg_dds__TwistStamped__desc,
                                "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"};
const MessageType kWrenchStamped{&geometry_msgs_msg_dds__WrenchStamped__desc,
                                 "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77"};
const MessageType kJoy{&sensor_msgs_msg_dds__Joy__desc,
                       "0d356c79cad3401e35ffeb75a96a96e08be3ef896b8b83841d73e890989372c5"};
const MessageType kJointState{&sensor_msgs_msg_dds__JointState__desc,
                              "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"};
const MessageType kTfMessage{&tf2_msgs_msg_dds__TFMessage__desc,
                             "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"};
const MessageType kDiagnosticArray{&diagnostic_msgs_msg_dds__DiagnosticArray__desc,
                                   "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"};
const MessageType kBool{&std_msgs_msg_dds__Bool__desc, ""};
const MessageType kFloat64{&std_msgs_msg_dds__Float64__desc, ""};
const MessageType kString{&std_msgs_msg_dds__String__desc, ""};

namespace {

/// ROS 2's name of a topic on DDS.
std::string dds_name(const std::string& topic) { return "rt" + topic; }

/// How Cyclone DDS is to be set up. A network without multicast (lo, most VPNs) is searched by unicast, at the places
/// of the first participants, and every second: others may hear nothing else.
std::string configuration(const std::string& network, const std::vector<std::string>& peers) {
  std::string out = "<General>";
  if (!peers.empty()) out += "<AllowMulticast>false</AllowMulticast>";
  if (network != "auto") out += "<Interfaces><NetworkInterface name=\"" + network + "\"/></Interfaces>";
  out += "</General><Discovery><SPDPInterval>1s</SPDPInterval>";
  out += "<Peers>";
  if (network == "lo") out += "<Peer address=\"127.0.0.1\"/>";
  for (const std::string& peer : peers) out += "<Peer address=\"" + peer + "\"/>";
  out += "</Peers>";
  if (!peers.empty()) out += "<ParticipantIndex>auto</ParticipantIndex>";
  return out + "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex></Discovery>";
}

}  // namespace

bool DdsWriter::write(const void* message) noexcept {
  if (dds_write(writer_, message) != DDS_RETCODE_OK) return false;
  ++written_;
  return true;
}

rtbus::Result<Participant, std::string> Participant::open(int domain, const std::string& network,
                                                          const std::vector<std::string>& peers) {
  auto participant = tools::dds::Participant::open(domain, configuration(network, peers));
  if (!participant) {
    return rtbus::Failure{"DDS does not begin on network '" + network + "', domain " + std::to_string(domain) + ": " +
                          participant.error() + "; `ip link` lists the interfaces, bridge.network names one"};
  }
  return Participant(std::move(*participant));
}

rtbus::Result<DdsWriter, std::string> Participant::writer(const std::string& name, const MessageType& type,
                                                          const WriterQos& wanted) {
  const tools::dds::Qos qos = tools::dds::new_qos(wanted.reliable, wanted.latched, wanted.depth);
  const std::string hash = "typehash=RIHS01_" + std::string(type.hash) + ";";
  dds_qset_userdata(qos.get(), hash.data(), hash.size());
  const auto made = participant_.writer(dds_name(name), *type.descriptor, qos);
  if (!made) return rtbus::Failure{made.error()};
  return DdsWriter(*made);
}

rtbus::Result<DdsReader, std::string> Participant::reader(const std::string& name, const MessageType& type,
                                                          bool reliable, int depth) {
  const auto made = participant_.reader(dds_name(name), *type.descriptor, tools::dds::new_qos(reliable, false, depth));
  if (!made) return rtbus::Failure{made.error()};
  return DdsReader(*made, depth);
}

}  // namespace bridge
