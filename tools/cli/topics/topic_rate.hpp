#pragma once
/// @file topic_rate.hpp
/// How fast a topic moves, from what its ring still holds: no waiting, and right for 1 Hz topics too.
#include <cstdint>
#include <optional>
#include <string>

#include "tools/cli/topics/interval_stats.hpp"

namespace tools {

struct TopicRate {
  std::optional<double>
      rate_hz;                  ///< Over the samples held; 0 when the topic has fallen silent; none before two samples.
  std::optional<double> age_s;  ///< Since the newest stamp; none when nothing was published.
};

/// Judges samples that were read at `now_ns`. A topic is silent when nothing has come for the longest of 0.2 s, five
/// times its mean period and twice the longest pause between the samples held.
[[nodiscard]] TopicRate judge_rate(const IntervalStats& held, std::uint64_t newest_stamp_ns, std::uint64_t now_ns);

/// Reads the whole ring of `topic` once: hundreds of microseconds for the largest topics.
[[nodiscard]] TopicRate recent_rate(const std::string& session, const std::string& topic);

}  // namespace tools
