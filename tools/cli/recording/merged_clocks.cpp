#include "tools/cli/recording/merged_clocks.hpp"

#include <algorithm>
#include <cmath>

#include "rtbus/clock.hpp"
#include "rtbus/network_messages.hpp"

namespace tools {
namespace {

using rtbus::recording::RecordedTopic;
using rtbus::recording::Recording;

/// By so much per second two quartz clocks part: where there is no estimate, the last one is off by that much more.
constexpr double kDrift = 1e-4;

const RecordedTopic* link_topic(const Recording& recording) {
  for (const RecordedTopic& topic : recording.topics()) {
    if (topic.type_name == rtbus::SampleTraits<rtbus::NetworkStats>::kName && topic.rows > 0) return &topic;
  }
  return nullptr;
}

}  // namespace

rtbus::Result<MergedClocks, std::string> MergedClocks::of(const Recording& first, const Recording& second) {
  if (first.session() != second.session()) {
    return rtbus::Failure{first.path() + " is of session " + first.session() + ", " + second.path() + " of session " +
                          second.session() + "; merge recordings of one session, made on its two machines"};
  }
  // Either end knows the difference. That of the second needs no search for the stamp on the other clock.
  const bool by_second = link_topic(second) != nullptr;
  const Recording& source = by_second ? second : first;
  const RecordedTopic* const topic = link_topic(source);
  if (topic == nullptr) {
    return rtbus::Failure{"neither " + first.path() + " nor " + second.path() +
                          " has a topic link.stats: how far the clocks are apart is not known; record sessions with "
                          "link: dds, without --topics or with --topics link"};
  }
  const std::vector<std::uint64_t> stamps_ns = source.stamps_ns(*topic);
  const std::vector<double> offsets_s = source.column(*topic, "clock_offset_s");
  const std::vector<double> errors_s = source.column(*topic, "clock_error_s");
  MergedClocks out;
  out.source_ = source.path() + " " + topic->name;
  for (std::size_t i = 0; i < std::min({stamps_ns.size(), offsets_s.size(), errors_s.size()}); ++i) {
    if (!(errors_s[i] > 0.0) || !std::isfinite(offsets_s[i])) continue;  // nothing came yet
    const double theirs_less_own_s = offsets_s[i];
    if (by_second) {
      out.rows_.push_back({stamps_ns[i], -theirs_less_own_s, errors_s[i]});
    } else {
      const auto there_ns = static_cast<std::int64_t>(stamps_ns[i]) + std::llround(theirs_less_own_s * 1e9);
      if (there_ns > 0) out.rows_.push_back({static_cast<std::uint64_t>(there_ns), theirs_less_own_s, errors_s[i]});
    }
  }
  std::stable_sort(out.rows_.begin(), out.rows_.end(),
                   [](const Row& a, const Row& b) { return a.stamp_ns < b.stamp_ns; });
  if (out.rows_.empty()) {
    return rtbus::Failure{out.source_ + " has no estimate of the other clock: nothing came from the other machine"};
  }
  return out;
}

MergedClocks::Row MergedClocks::at(std::uint64_t stamp_ns) const {
  const auto later = std::lower_bound(rows_.begin(), rows_.end(), stamp_ns,
                                      [](const Row& row, std::uint64_t stamp) { return row.stamp_ns < stamp; });
  if (later == rows_.begin() || later == rows_.end()) {
    const Row& end = later == rows_.end() ? rows_.back() : rows_.front();
    return {stamp_ns, end.offset_s, end.error_s + kDrift * std::abs(rtbus::seconds_between(end.stamp_ns, stamp_ns))};
  }
  const Row& before = *(later - 1);
  const double gap_s = rtbus::seconds_between(before.stamp_ns, later->stamp_ns);
  const double share = gap_s > 0.0 ? rtbus::seconds_between(before.stamp_ns, stamp_ns) / gap_s : 0.0;
  return {stamp_ns, before.offset_s + share * (later->offset_s - before.offset_s),
          std::max(before.error_s, later->error_s)};
}

std::int64_t MergedClocks::on_first(std::uint64_t stamp_ns) const {
  return static_cast<std::int64_t>(stamp_ns) - std::llround(at(stamp_ns).offset_s * 1e9);
}

double MergedClocks::error_s(std::uint64_t stamp_ns) const { return at(stamp_ns).error_s; }

}  // namespace tools
