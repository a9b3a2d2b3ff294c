#pragma once
/// @file reader.hpp
/// Reads a recording, also one that is still being written or whose recorder was killed.
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "rtbus/recording/writer.hpp"
#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"

namespace rtbus::recording {

/// One topic of a recording.
struct RecordedTopic {
  std::string name;
  std::string type_name;
  std::vector<Segment::OwnedField> fields;  ///< Offsets as in the sample that row() puts together.
  std::uint32_t sample_bytes = 0;
  std::uint64_t rows = 0;     ///< Whole rows: all fields are there.
  std::uint64_t dropped = 0;  ///< Samples that the recorder lost.
};

/// An event that was noted during the recording (`rtbus mark`).
struct RecordedMark {
  std::uint64_t stamp_ns = 0;
  std::string text;
};

/// A recording, open for reading.
class Recording {
 public:
  [[nodiscard]] static Result<Recording, Fault> open(const std::string& path);
  Recording(Recording&&) noexcept;
  Recording& operator=(Recording&&) noexcept;
  ~Recording();

  [[nodiscard]] const std::string& path() const noexcept;
  [[nodiscard]] const std::string& session() const noexcept;
  [[nodiscard]] const std::string& version() const noexcept;
  [[nodiscard]] const std::string& started_utc() const noexcept;
  [[nodiscard]] std::uint64_t started_unix_ns() const noexcept;
  [[nodiscard]] std::uint64_t started_monotonic_ns() const noexcept;
  [[nodiscard]] bool complete() const noexcept;  ///< False: cut off, or still growing.
  [[nodiscard]] const std::vector<RecordedTopic>& topics() const noexcept;
  [[nodiscard]] const RecordedTopic* find(std::string_view name) const noexcept;
  [[nodiscard]] std::vector<RecordedMark> marks() const;
  [[nodiscard]] std::vector<ConfigFile> config() const;
  /// In the order of physics.body_poses; empty where the recorder did not know them.
  [[nodiscard]] std::vector<std::string> body_names() const;
  [[nodiscard]] std::vector<std::string> commands() const;  ///< Command lines of the nodes, words apart by blanks.

  /// Stamps, or sequence numbers, of rows [first, first + count) of a topic; fewer at the end.
  [[nodiscard]] std::vector<std::uint64_t> stamps_ns(const RecordedTopic& topic, std::uint64_t first = 0,
                                                     std::uint64_t count = UINT64_MAX) const;
  [[nodiscard]] std::vector<std::uint64_t> sequences(const RecordedTopic& topic, std::uint64_t first = 0,
                                                     std::uint64_t count = UINT64_MAX) const;
  /// One element of a numeric field over those rows, as double.
  [[nodiscard]] std::vector<double> column(const RecordedTopic& topic, const std::string& field,
                                           std::uint32_t element = 0, std::uint64_t first = 0,
                                           std::uint64_t count = UINT64_MAX) const;
  /// The same for integers, without rounding: stamps in nanoseconds do not fit a double.
  [[nodiscard]] std::vector<std::uint64_t> integers(const RecordedTopic& topic, const std::string& field,
                                                    std::uint64_t first = 0, std::uint64_t count = UINT64_MAX) const;
  /// The samples of those rows as they came off the bus, one after the other, `sample_bytes` each.
  [[nodiscard]] std::vector<std::byte> samples(const RecordedTopic& topic, std::uint64_t first = 0,
                                               std::uint64_t count = UINT64_MAX) const;

 private:
  struct Impl;
  explicit Recording(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtbus::recording
