#pragma once
/// @file topic_directory.hpp
/// For tools that were not compiled against a topic: which topics exist, what is in them, and removal of dead ones.
/// Nothing here is for the realtime context.
#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"
#include "rtbus/topic.hpp"

namespace rtbus {

/// One segment in /dev/shm that carries our kind of name.
struct TopicInfo {
  std::string session;
  std::string topic;
  std::string problem;  ///< Why it could not be opened; empty when all the rest below is valid.
  std::string type_name;
  std::vector<Segment::OwnedField> fields;
  std::uint32_t sample_bytes = 0;
  std::uint32_t capacity = 0;
  std::uint64_t published = 0;        ///< Samples over the life of the topic.
  std::uint32_t epoch = 0;            ///< Writers it has had.
  std::uint32_t writer_pid = 0;       ///< Of the present or last writer.
  std::uint64_t writer_start_ns = 0;  ///< CLOCK_MONOTONIC.
  bool writer_alive = false;
  std::uint64_t segment_bytes = 0;  ///< Valid also with a problem.
  uid_t owner = 0;                  ///< Likewise.
};

/// All topics, or those of one session, sorted by session and topic. Segments of other users and damaged ones are
/// listed with their problem.
[[nodiscard]] std::vector<TopicInfo> list_topics(std::optional<std::string_view> session = std::nullopt);

/// What remove_dead() has removed.
struct RemovedTopics {
  std::vector<std::string> names;  ///< Segment names, as in /dev/shm.
  std::uint64_t bytes = 0;
};

/// Removes the segments whose writer is dead, of all sessions or of one. Only regular files that carry our name pattern
/// and belong to this user (root: to anybody), and only with the writer's lock in hand, so a writer that starts at the
/// same moment either is seen alive or creates the topic anew.
RemovedTopics remove_dead(std::optional<std::string_view> session = std::nullopt);

/// Reads any topic by name, as bytes.
class RawReader {
 public:
  [[nodiscard]] static Result<RawReader, TopicError> open(const Session& session, std::string_view topic,
                                                          ReaderOptions options = {.trust = OwnerTrust::kAnyone});

  /// As Reader::read_latest and read_next; the sample lies in bytes() afterwards.
  [[nodiscard]] ReadStatus read_latest() noexcept;
  [[nodiscard]] ReadStatus read_next() noexcept;

  /// The last sample read: description().sample_bytes bytes, zero before the first.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept;
  [[nodiscard]] std::uint64_t sequence() const noexcept { return sequence_; }
  [[nodiscard]] std::uint64_t stamp_ns() const noexcept { return stamp_ns_; }
  [[nodiscard]] std::uint64_t missed() const noexcept { return ring_.missed(); }
  [[nodiscard]] std::uint64_t refused() const noexcept { return ring_.refused(); }  ///< As Reader::refused().

  [[nodiscard]] bool wait(std::uint64_t deadline_ns) noexcept {
    return segment_.wait_newer_than(ring_.last_sequence(), deadline_ns);
  }
  [[nodiscard]] const Segment::Description& description() const noexcept { return segment_.description(); }
  [[nodiscard]] bool writer_alive() const noexcept { return segment_.writer_alive(); }
  [[nodiscard]] bool replaced() const noexcept { return segment_.replaced(); }
  [[nodiscard]] const Segment& segment() const noexcept { return segment_; }

 private:
  RawReader(Segment segment, const ReaderOptions& options);
  ReadStatus take(detail::RingRead read) noexcept;
  [[nodiscard]] bool believes(const void* sample, std::uint64_t stamp_ns) noexcept;

  Segment segment_;
  detail::RingReader ring_;
  std::vector<std::uint64_t> sample_;   ///< The last good one.
  std::vector<std::uint64_t> scratch_;  ///< Where a copy is made before it is known to be good.
  SaneBytes sane_ = nullptr;            ///< Null: the type is none of the bus's own.
  std::uint64_t sequence_ = 0;
  std::uint64_t stamp_ns_ = 0;
};

/// One value out of a sample. Text ends at its first zero byte; what a terminal should not be sent is replaced by '?'.
using FieldValue = std::variant<double, std::int64_t, std::uint64_t, std::string>;

/// Decodes element `index` of `field` (text: the whole field, index 0). `sample` must be as long as the description
/// says. An element that lies outside the sample reads as zero.
[[nodiscard]] FieldValue field_value(std::span<const std::byte> sample, const Segment::OwnedField& field,
                                     std::uint32_t index);

/// Elements to print of a field: its count, or 1 for text.
[[nodiscard]] std::uint32_t field_elements(const Segment::OwnedField& field) noexcept;

/// Calls `visit(label, unit, value)` for every element of every field in order. Labels: "gate" for a single element,
/// "position_m[0]" for one of several.
void visit_fields(
    std::span<const std::byte> sample, const Segment::Description& description,
    const std::function<void(const std::string& label, const std::string& unit, const FieldValue&)>& visit);

/// A value for people and CSV: shortest decimal text that reads back to the same double.
[[nodiscard]] std::string to_text(const FieldValue& value);

}  // namespace rtbus
