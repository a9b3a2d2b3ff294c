#include "haptic_node/rendering/other_hands.hpp"

#include <algorithm>

#include "rtbus/eigen.hpp"

namespace haptic {
namespace {

/// A hand has ended that was not heard for so many times as long as it goes on: what it was taken to give is taken
/// back.
constexpr double kEnded = 3.0;

Impulse told_in(const rtbus::DeviceState& state, std::size_t row) noexcept {
  return {rtbus::vector_of(state.hand_impulse_n_s[row]), rtbus::vector_of(state.hand_angular_impulse_n_m_s[row])};
}

}  // namespace

/// Without a copy: the history is long.
void OtherHands::Row::begin(std::uint32_t for_body, std::uint32_t of_generation) noexcept {
  body = for_body;
  generation = of_generation;
  told = given = last = booked = booked_before = Impulse{};
  history.forget();
}

/// A sample that is repeated stands for one more tick, which the next one does not count again (LocalContact::step_to).
void OtherHands::learn(Hand& hand, const OtherHand& heard, std::uint64_t apart_ns) noexcept {
  const rtbus::DeviceState& state = heard.state.value;
  const bool gives = (state.wants & rtbus::kOwnsProxy) != 0 && state.enabled != 0;
  const bool goes_on =
      hand.time_ns != 0 && state.mapping_epoch == hand.mapping_epoch && state.sample_time_ns >= hand.time_ns;
  hand.number = heard.number;
  if (!gives || !goes_on) {  // physics too drops what lies in between
    hand.mapping_epoch = state.mapping_epoch;
    hand.time_ns = hand.until_ns = state.sample_time_ns;
    for (std::size_t i = 0; i < hand.rows.size(); ++i) {
      hand.rows[i].begin(state.hand_impulse_body[i], state.hand_impulse_generation[i]);
      hand.rows[i].told = told_in(state, i);
    }
    return;
  }
  for (std::size_t i = 0; i < hand.rows.size(); ++i) learn_row(hand, i, state, apart_ns);
  const std::uint64_t gap_ns = state.sample_time_ns - hand.time_ns;
  if (gap_ns == 0) {
    hand.until_ns += hand.tick_ns;
    return;
  }
  hand.tick_ns = state.sample_time_ns - std::min(hand.until_ns, hand.time_ns + gap_ns / 2);
  hand.gap.add(gap_ns);
  hand.time_ns = hand.until_ns = state.sample_time_ns;
}

void OtherHands::learn_row(Hand& hand, std::size_t index, const rtbus::DeviceState& state,
                           std::uint64_t apart_ns) noexcept {
  Row& row = hand.rows[index];
  if (row.generation != state.hand_impulse_generation[index] || row.body != state.hand_impulse_body[index]) {
    row.begin(state.hand_impulse_body[index], state.hand_impulse_generation[index]);
  }
  const Impulse told = told_in(state, index);
  row.last = told - row.told;
  row.told = told;
  if (row.last.is_zero()) return;
  const Impulse before = row.given;
  row.given += row.last;
  if (state.sample_time_ns > hand.time_ns) {
    row.history.add(hand.time_ns, state.sample_time_ns, apart_ns, before, row.given);
  } else {
    row.history.correct(state.sample_time_ns, row.last);
  }
}

Impulse OtherHands::book(const Hand& hand, Row& row, std::uint64_t now_ns) noexcept {
  row.booked_before = row.booked;
  row.booked = row.given;
  if (hand.tick_ns > 0 && now_ns > hand.until_ns) {
    const auto silent_ns = static_cast<double>(now_ns - hand.until_ns);
    const auto goes_on_ns = static_cast<double>(hand.gap.goes_on_ns(hand.tick_ns));
    const bool ended = silent_ns > kEnded * goes_on_ns;
    const double share = ended ? 0.0 : std::min(silent_ns, goes_on_ns) / static_cast<double>(hand.tick_ns);
    row.booked += {share * row.last.linear_n_s, share * row.last.angular_n_m_s};
  }
  return row.booked - row.booked_before;
}

template <class At>
Impulse OtherHands::Since::sum(At&& at) const noexcept {
  Impulse out;
  const std::size_t told = std::min<std::size_t>(answer_.hands, rtbus::kHandSlots);
  for (const Hand& hand : others_.hands_) {
    const std::uint64_t from_ns = hand.number < told ? answer_.hand_time_ns[hand.number] : 0;
    if (from_ns == 0) continue;  // physics has nothing of that hand
    for (const Row& row : hand.rows) {
      if (row.generation != 0 && row.body == body_) out += at(row, from_ns) - row.history.at(from_ns, row.given);
    }
  }
  return out;
}

Impulse OtherHands::Since::until(std::uint64_t time_ns) const noexcept {
  return sum([time_ns](const Row& row, std::uint64_t from_ns) {
    return row.history.at(std::max(time_ns, from_ns), row.given);
  });
}

Impulse OtherHands::Since::until_now() const noexcept {
  return sum([](const Row& row, std::uint64_t) { return row.booked_before; });
}

}  // namespace haptic
