#include "haptic_node/rendering/impulse_history.hpp"

#include <algorithm>

#include "rtbus/clock.hpp"

namespace haptic {

void ImpulseHistory::add(std::uint64_t begin_ns, std::uint64_t end_ns, std::uint64_t apart_ns, const Impulse& before,
                         const Impulse& after) noexcept {
  bool follows = false;
  if (count_ > 0 && end_ns < time_ns_[(count_ - 1) % kRecords]) forget();  // a clock that was set back
  if (count_ > 0) {
    const std::size_t last = (count_ - 1) % kRecords;
    follows = begin_ns < time_ns_[last] + (end_ns - begin_ns);
    // The record before it is where the last step began.
    const bool near = follows && time_ns_[last] < time_ns_[(count_ - 2) % kRecords] + apart_ns;
    if (time_ns_[last] == end_ns || near) {
      time_ns_[last] = end_ns;
      sum_[last] = after;
      return;
    }
  }
  if (!follows) put(begin_ns, before);
  put(end_ns, after);
}

void ImpulseHistory::put(std::uint64_t time_ns, const Impulse& sum) noexcept {
  const std::size_t next = count_++ % kRecords;
  time_ns_[next] = time_ns;
  sum_[next] = sum;
}

void ImpulseHistory::correct(std::uint64_t end_ns, const Impulse& more) noexcept {
  if (count_ == 0) return;
  const std::size_t last = (count_ - 1) % kRecords;
  if (time_ns_[last] == end_ns) sum_[last] += more;
}

std::uint64_t ImpulseHistory::record_after(std::uint64_t time_ns) const noexcept {
  // Binary search.
  std::uint64_t low = oldest();
  std::uint64_t high = count_;
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (time_ns_[middle % kRecords] <= time_ns)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

std::uint64_t ImpulseHistory::first_after(std::uint64_t time_ns, std::uint64_t now_ns) const noexcept {
  const std::uint64_t record = record_after(time_ns);
  if (record == count_) return now_ns;
  const auto stands_still = [this](std::uint64_t number) {
    return (sum_[number % kRecords] - sum_[(number - 1) % kRecords]).is_zero();
  };
  const bool gives = record > oldest() && !stands_still(record);
  return gives ? time_ns : time_ns_[record % kRecords];
}

Impulse ImpulseHistory::at(std::uint64_t time_ns, const Impulse& sum) const noexcept {
  const std::uint64_t after = record_after(time_ns);
  if (after == count_) return sum;
  const std::size_t end = after % kRecords;
  if (after == oldest()) return sum_[end];
  const std::size_t begin = (after - 1) % kRecords;
  const double share =
      rtbus::seconds_between(time_ns_[begin], time_ns) / rtbus::seconds_between(time_ns_[begin], time_ns_[end]);
  const Impulse all = sum_[end] - sum_[begin];
  Impulse out = sum_[begin];
  out += {share * all.linear_n_s, share * all.angular_n_m_s};
  return out;
}

}  // namespace haptic
