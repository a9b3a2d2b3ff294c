#include "tools/cli/topics/topic_rate.hpp"

#include <algorithm>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"

namespace tools {

TopicRate judge_rate(const IntervalStats& held, std::uint64_t newest_stamp_ns, std::uint64_t now_ns) {
  TopicRate rate;
  if (held.samples() == 0) return rate;
  rate.age_s = std::max(0.0, rtbus::seconds_between(newest_stamp_ns, now_ns));
  if (held.rate_hz() <= 0.0) return rate;
  const double silent_after_s = std::max({0.2, 5.0 / held.rate_hz(), 2.0 * held.max_s()});
  rate.rate_hz = *rate.age_s > silent_after_s ? 0.0 : held.rate_hz();
  return rate;
}

TopicRate recent_rate(const std::string& session, const std::string& topic) {
  rtbus::Session where;
  where.name = session;
  auto reader = rtbus::RawReader::open(where, topic, {.from_oldest = true, .trust = rtbus::OwnerTrust::kAnyone});
  if (!reader) return {};
  // A writer that took over from a dead one left its samples in the ring; the pause in between is no period.
  const std::uint64_t since_ns = reader->segment().writer_start_ns();
  IntervalStats held;
  // Bounded by the ring as it is now: a writer faster than this loop would otherwise keep it here for ever.
  for (std::uint32_t i = 0; i < reader->description().capacity; ++i) {
    if (reader->read_next() != rtbus::ReadStatus::kFresh) break;
    if (reader->stamp_ns() >= since_ns) held.add(reader->sequence(), reader->stamp_ns());
  }
  return judge_rate(held, reader->stamp_ns(), rtbus::monotonic_ns());
}

}  // namespace tools
