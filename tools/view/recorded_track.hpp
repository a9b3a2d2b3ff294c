#pragma once
/// @file recorded_track.hpp
/// The samples of one recorded topic by time, read from the file as they are needed.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "rtbus/recording/reader.hpp"
#include "rtbus/sample.hpp"

namespace view {

/// The recorded samples are those that this program knows: the same fields in the same places.
template <rtbus::Sample T>
[[nodiscard]] bool same_layout(const rtbus::recording::RecordedTopic& topic) {
  const auto& known = rtbus::SampleTraits<T>::kFields;
  return topic.type_name == rtbus::SampleTraits<T>::kName && topic.sample_bytes == sizeof(T) &&
         topic.fields.size() == known.size() &&
         std::equal(known.begin(), known.end(), topic.fields.begin(), [](const auto& a, const auto& b) {
           return a.name == b.name && a.offset == b.offset && a.count == b.count && a.type == b.type;
         });
}

/// One thread. Keeps the last blocks of rows in memory, at most 20 MB, and all stamps.
template <rtbus::Sample T>
class RecordedTrack {
 public:
  /// Without rows where the recording has no such topic. @param recording Outlives the track. @param notes Gets a
  /// sentence when the samples are of another version.
  RecordedTrack(const rtbus::recording::Recording& recording, const std::string& topic, std::vector<std::string>& notes)
      : recording_(&recording), topic_(recording.find(topic)) {
    if (topic_ == nullptr) return;
    if (!same_layout<T>(*topic_)) {
      notes.push_back(topic + " was recorded by another version of rtbus (" + recording.version() +
                      "): it is not shown");
      topic_ = nullptr;
      return;
    }
    stamps_ns_ = recording.stamps_ns(*topic_);
    for (std::size_t i = 1; i < stamps_ns_.size(); ++i) stamps_ns_[i] = std::max(stamps_ns_[i], stamps_ns_[i - 1]);
  }

  [[nodiscard]] std::size_t rows() const noexcept { return stamps_ns_.size(); }
  [[nodiscard]] std::uint64_t stamp_ns(std::size_t row) const { return stamps_ns_.at(row); }
  /// How many rows are not after `time_ns`.
  [[nodiscard]] std::size_t until(std::uint64_t time_ns) const {
    return static_cast<std::size_t>(std::upper_bound(stamps_ns_.begin(), stamps_ns_.end(), time_ns) -
                                    stamps_ns_.begin());
  }
  /// @returns false when the row cannot be read, or is not what a node can have published.
  [[nodiscard]] bool read(std::size_t row, rtbus::Stamped<T>& out) {
    if (topic_ == nullptr || row >= rows()) return false;
    const Block& block = block_of(row);
    const std::size_t at = row - block.first;
    if ((at + 1) * sizeof(T) > block.samples.size() || at >= block.sequences.size()) return false;
    out.sequence = block.sequences[at];
    out.stamp_ns = stamps_ns_[row];
    std::memcpy(&out.value, block.samples.data() + at * sizeof(T), sizeof(T));
    return rtbus::SampleTraits<T>::sane(out.value, out.stamp_ns);
  }
  [[nodiscard]] std::vector<std::uint64_t> integers(const std::string& field) const {
    return topic_ == nullptr ? std::vector<std::uint64_t>() : recording_->integers(*topic_, field);
  }

 private:
  static constexpr std::size_t kBlocks = 20;  // of telemetry: more than a minute at 1 kHz
  static constexpr std::size_t kBlockRows = std::max<std::size_t>(64, (1U << 20U) / sizeof(T));
  struct Block {
    std::size_t first = SIZE_MAX;
    std::vector<std::byte> samples;
    std::vector<std::uint64_t> sequences;
  };
  const Block& block_of(std::size_t row) {
    const std::size_t first = row / kBlockRows * kBlockRows;
    for (const Block& block : blocks_) {
      if (block.first == first) return block;
    }
    Block& block = blocks_[next_];
    next_ = (next_ + 1) % kBlocks;
    block = {first, recording_->samples(*topic_, first, kBlockRows), recording_->sequences(*topic_, first, kBlockRows)};
    return block;
  }

  const rtbus::recording::Recording* recording_;
  const rtbus::recording::RecordedTopic* topic_;
  std::vector<std::uint64_t> stamps_ns_;
  std::array<Block, kBlocks> blocks_;
  std::size_t next_ = 0;
};

}  // namespace view
