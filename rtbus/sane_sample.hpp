#pragma once
/// @file sane_sample.hpp
/// Which samples a reader accepts. A process that may write into a segment may write anything. So each reader of the
/// bus (Reader, Subscription, RawReader, PacketPipe) checks a sample here before it returns it, and refuses the others.
///
/// A sane sample has finite numbers of a possible magnitude, counts within its arrays, enumerators that exist, ended
/// texts, and no time later than its own stamp. It may still be wrong: the safety ladder limits its effect. The limits
/// are far above every real value, so no correct sample is refused.
#include <cstddef>
#include <cstdint>

#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/sample.hpp"

namespace rtbus {

/// A stamp may be ahead of the reader's clock, and a time in a sample ahead of its stamp, by this much: a loop that was
/// preempted between its clock and its publish.
inline constexpr std::uint64_t kMaxAhead_ns = 20 * kNsPerMs;

/// A type with rules of its own: SampleTraits<T>::sane(sample, stamp_ns), all in sane_sample.cpp. Other types are
/// opaque to the bus: every value of theirs is sane.
template <class T>
concept JudgedSample = Sample<T> && requires(const T& sample) {
  SampleTraits<T>::sane(sample, std::uint64_t{});
};

/// @realtime Yes: at most some hundred comparisons.
template <Sample T>
[[nodiscard]] bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING {
  if constexpr (JudgedSample<T>) return SampleTraits<T>::sane(sample, stamp_ns);
  return true;
}

/// True unless the stamp lies in the future. How old a sample may be is decided by the reader.
/// @realtime Yes: reads the clock.
[[nodiscard]] inline bool sane_stamp(std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING {
  return stamp_ns <= monotonic_ns() + kMaxAhead_ns;
}

/// sane() for a sample of one type in bytes, which need no alignment.
using SaneBytes = bool (*)(const void* sample, std::uint64_t stamp_ns) noexcept;

/// The rules of a type that is known only by its hash; null: there are none.
[[nodiscard]] SaneBytes rules_of(std::uint64_t type_hash, std::uint32_t sample_bytes) noexcept;

}  // namespace rtbus
