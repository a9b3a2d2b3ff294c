#include "haptic_node/rendering/impulse_history.hpp"

#include <algorithm>

#include "rtbus/clock.hpp"

namespace haptic {

void ImpulseHistory::add(std::uint64_t begin_ns, std::uint64_t end_ns, std::uint64_t apart_ns, const Impulse& before,
                         const Impulse& after) noexcept {
  if (count_ > 0) {
    const std::size_t last = (count_ - 1) % kRecords;
    const bool follows = begin_ns < end_ns_[last] + (end_ns - begin_ns);
    if (end_ns_[last] == end_ns || (follows && end_ns <= records_[last].begin_ns + apart_ns)) {
      end_ns_[last] = end_ns;
      records_[last].after = after;
      return;
    }
  }
  const std::size_t next = count_++ % kRecords;
  end_ns_[next] = end_ns;
  records_[next] = {begin_ns, before, after};
}

void ImpulseHistory::correct(std::uint64_t end_ns, const Impulse& more) noexcept {
  if (count_ == 0) return;
  const std::size_t last = (count_ - 1) % kRecords;
  if (end_ns_[last] == end_ns) records_[last].after += more;
}

std::uint64_t ImpulseHistory::record_after(std::uint64_t time_ns) const noexcept {
  // Binary search.
  std::uint64_t low = count_ > kRecords ? count_ - kRecords : 0;
  std::uint64_t high = count_;
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (end_ns_[middle % kRecords] <= time_ns)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

std::uint64_t ImpulseHistory::first_after(std::uint64_t time_ns, std::uint64_t now_ns) const noexcept {
  const std::uint64_t record = record_after(time_ns);
  return record == count_ ? now_ns : std::max(time_ns, records_[record % kRecords].begin_ns);
}

Impulse ImpulseHistory::at(std::uint64_t time_ns, const Impulse& sum) const noexcept {
  const std::uint64_t low = record_after(time_ns);
  if (low == count_) return sum;
  const Record& record = records_[low % kRecords];
  if (time_ns <= record.begin_ns) return record.before;
  const double share = rtbus::seconds_between(record.begin_ns, time_ns) /
                       rtbus::seconds_between(record.begin_ns, end_ns_[low % kRecords]);
  const Impulse all = record.after - record.before;
  Impulse out = record.before;
  out += {share * all.linear_n_s, share * all.angular_n_m_s};
  return out;
}

}  // namespace haptic
