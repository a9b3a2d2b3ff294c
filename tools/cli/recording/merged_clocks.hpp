#pragma once
/// @file merged_clocks.hpp
/// Two recordings of one session, made on two machines: the stamps of the second on the clock of the first. Each
/// machine counts its own CLOCK_MONOTONIC; how far they are apart stands in the statistics of the link
/// (`link.stats.<haptic>`), which both recordings have.
#include <cstdint>
#include <string>
#include <vector>

#include "rtbus/recording/reader.hpp"
#include "rtbus/result.hpp"

namespace tools {

class MergedClocks {
 public:
  /// The error is a sentence for the user.
  [[nodiscard]] static rtbus::Result<MergedClocks, std::string> of(const rtbus::recording::Recording& first,
                                                                   const rtbus::recording::Recording& second);

  /// A stamp of the second recording, by the clock of the first. Negative: from before that machine was started.
  [[nodiscard]] std::int64_t on_first(std::uint64_t stamp_ns) const;
  /// How far off that may be [s].
  [[nodiscard]] double error_s(std::uint64_t stamp_ns) const;
  [[nodiscard]] const std::string& source() const noexcept { return source_; }  ///< Recording and topic.

 private:
  /// The second's clock less the first's, at a stamp of the second.
  struct Row {
    std::uint64_t stamp_ns;
    double offset_s, error_s;
  };
  [[nodiscard]] Row at(std::uint64_t stamp_ns) const;

  std::vector<Row> rows_;  ///< In order; at least one.
  std::string source_;
};

}  // namespace tools
