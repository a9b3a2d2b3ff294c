#pragma once
/// @file recorder.hpp
/// Follows the topics of a session and hands every sample to a recording.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/recording/writer.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/orders/marks.hpp"

namespace tools {

/// Which topics of a session are recorded.
struct RecordedTopics {
  std::vector<std::string> names;  ///< Topics that begin so, and no others; empty: as below.
  bool bodies = false;             ///< The poses of bodies and the nodes of soft bodies: 30 times a second all of them.
  bool contacts = false;           ///< Contacts beside the tip: 10 kB per step of physics.
  bool from_first = false;         ///< Also what was published before the recorder came, as far as the rings hold it.
};

struct RecorderFigures {
  std::uint64_t samples = 0;
  std::uint64_t dropped = 0;  ///< Samples that were overwritten before this process got to them.
  std::uint64_t marks = 0;
  std::size_t topics = 0;
};

/// One thread. Attaches to topics as they come, follows nodes that are restarted, and asks for the telemetry.
class Recorder {
 public:
  Recorder(rtbus::Session session, rtbus::recording::Writer writer, RecordedTopics wanted);

  /// Looks for new topics. Every second or so. @returns a fault when the file cannot be extended.
  [[nodiscard]] rtbus::Result<void, rtbus::recording::Fault> attach();

  /// Takes in what is new, and changes over to segments that came in the place of others. Every 20 ms: the shortest
  /// ring holds more. @returns a fault when the file cannot be extended.
  [[nodiscard]] rtbus::Result<void, rtbus::recording::Fault> drain();

  [[nodiscard]] rtbus::Result<void, rtbus::recording::Fault> flush() { return writer_.flush(); }
  [[nodiscard]] rtbus::Result<void, rtbus::recording::Fault> close();
  [[nodiscard]] RecorderFigures figures() const;
  /// Why `driver: replay` could not play the motion so far; empty: it can.
  [[nodiscard]] std::string why_no_replay() const;
  [[nodiscard]] bool writers_alive() const;  ///< Some topic's node still lives.
  [[nodiscard]] std::uint64_t file_bytes() const noexcept { return writer_.file_bytes(); }

 private:
  struct Followed {
    std::string name;
    std::size_t handle = 0;
    std::uint64_t type_hash = 0;
    std::uint64_t missed_before = 0;      ///< By readers before this one.
    std::uint64_t last_stamp_ns = 0;      ///< Of the newest sample taken.
    std::uint64_t recorded_until_ns = 0;  ///< By readers before this one: a new segment begins with old samples.
    std::uint64_t samples = 0;
    std::optional<rtbus::RawReader> reader;
  };
  [[nodiscard]] bool wants(const std::string& topic) const;
  [[nodiscard]] rtbus::Result<void, rtbus::recording::Fault> follow(Followed& topic);
  void take(Followed& topic);

  rtbus::Session session_;
  rtbus::recording::Writer writer_;
  RecordedTopics wanted_;
  std::vector<Followed> topics_;
  MarkInbox inbox_;
  std::uint64_t marks_ = 0;
  std::uint64_t missed_in_other_layouts_ = 0;  ///< By topics that came back with other fields.
};

}  // namespace tools
