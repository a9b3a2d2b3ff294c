#pragma once
/// @file participant.hpp
/// The bridge's place on DDS: one participant, writers and readers of ROS 2 topics. ROS 2 sees a topic by three things:
/// the name "rt" + its full name, the type "<package>::msg::dds_::<Type>_", and a QoS that fits.
#include <dds/dds.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtbus/result.hpp"
#include "tools/dds/participant.hpp"

namespace bridge {

/// A message type: what idlc made, and the hash that ROS 2 gives it since Iron (REP 2016).
struct MessageType {
  const dds_topic_descriptor_t* descriptor;
  std::string_view hash;  ///< 64 hexadecimal digits; empty: a type that is only read.
};

extern const MessageType kPoseStamped, kTwistStamped, kWrenchStamped, kJoy, kJointState, kTfMessage, kDiagnosticArray,
    kBool, kFloat64, kString;

struct WriterQos {
  bool reliable = true;
  std::int32_t depth = 1;  ///< Keep last so many: the newest wins.
  bool latched = false;    ///< Who comes later gets the last sample too (transient local).
};

/// Writes one topic. One thread.
class DdsWriter {
 public:
  /// Hands `message` to DDS; waits at most 10 ms for readers that lag. @returns false when that failed.
  bool write(const void* message) noexcept;
  [[nodiscard]] std::uint64_t written() const noexcept { return written_; }

 private:
  friend class Participant;
  explicit DdsWriter(dds_entity_t writer) : writer_(writer) {}
  dds_entity_t writer_;
  std::uint64_t written_ = 0;
};

/// Reads one topic. One thread.
class DdsReader {
 public:
  /// Hands each message that has come to `take(message, writer)`. `writer` names who wrote it, alike for all of its
  /// messages.
  template <class Message, class Take>
  void drain(const Take& take) {
    for (int more = depth_; more > 0; more -= static_cast<int>(kAtOnce)) {
      void* samples[kAtOnce] = {};
      dds_sample_info_t infos[kAtOnce];
      const dds_return_t count = dds_take(reader_, samples, infos, kAtOnce, kAtOnce);
      for (dds_return_t i = 0; i < count; ++i) {
        if (infos[i].valid_data) take(*static_cast<const Message*>(samples[i]), infos[i].publication_handle);
      }
      if (count > 0) dds_return_loan(reader_, samples, count);
      if (count < static_cast<dds_return_t>(kAtOnce)) return;
    }
  }

  [[nodiscard]] dds_entity_t entity() const noexcept { return reader_; }

 private:
  friend class Participant;
  DdsReader(dds_entity_t reader, int depth) : reader_(reader), depth_(depth) {}
  static constexpr std::uint32_t kAtOnce = 16;
  dds_entity_t reader_;
  int depth_;  ///< As many as the reader keeps.
};

class Participant {
 public:
  /// @param network Interface; "auto": Cyclone DDS chooses. @param peers Hosts that are asked one by one; with any of
  /// them no multicast is used. The error is a sentence for the user.
  /// The threads of Cyclone DDS inherit the CPUs of the calling thread.
  [[nodiscard]] static rtbus::Result<Participant, std::string> open(int domain, const std::string& network,
                                                                    const std::vector<std::string>& peers = {});
  /// @param topic "/haptic0/pose". The errors are sentences for the user.
  [[nodiscard]] rtbus::Result<DdsWriter, std::string> writer(const std::string& topic, const MessageType& type,
                                                             const WriterQos& qos);
  /// Keeps the last `depth` of all writers together.
  [[nodiscard]] rtbus::Result<DdsReader, std::string> reader(const std::string& topic, const MessageType& type,
                                                             bool reliable = true, int depth = 16);
  [[nodiscard]] dds_entity_t entity() const noexcept { return participant_.entity(); }

 private:
  explicit Participant(tools::dds::Participant participant) : participant_(std::move(participant)) {}
  tools::dds::Participant participant_;
};

}  // namespace bridge
