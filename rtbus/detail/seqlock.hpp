#pragma once
// The figures of the proof keep their columns.
// clang-format off
/// @file seqlock.hpp
/// The copying protocol of a topic. Private to rtbus. After H.-J. Boehm, "Can seqlocks get along with programming
/// language memory models?", MSPC 2012: the payload moves as atomic words, so no read is a data race. Unlike the
/// paper's versions it needs no stand-alone fence (ThreadSanitizer does not model those): every payload word is stored
/// with release and loaded with acquire, which costs nothing on x86-64 and one stlr/ldar per word on AArch64.
///
/// Sample n (from 1) lives in slot (n − 1) mod capacity. The slot's sequence word is 2n − 1 while n is being written,
/// 2n when it is complete, so it names the sample as well as its state. `newest` is the last complete sample.
///
///     writer, sample n                         reader of sample n
///     W1  seq    = 2n − 1      relaxed         R1  n = newest                acquire
///     W2  word_i = payload_i   release, all i  R2  seq == 2n ?               acquire
///     W3  seq    = 2n          release         R3  copy_i = word_i           acquire, all i
///     W4  newest = n           release         R4  seq == 2n still ?         relaxed
///
/// Why an accepted copy is whole. Let the reader see 2n in R2 and in R4.
///  * No word is older than n: R2 read the value of W3, release/acquire makes W2 of sample n happen before R3, and
///    coherence forbids R3 to return anything earlier in that word's modification order.
///  * No word is newer: suppose R3 read a word of sample m = n + k·capacity. That was W2 of m, a release store that
///    comes after W1 of m in its thread; R3 acquires it, so W1 of m happens before R4, and by coherence R4 returns
///    2m − 1 or later. Not 2n.
///
///         writer of m    W1: seq = 2m − 1  ──>  W2: word_i = payload_i
///                                                         │ R3 reads what W2 wrote: synchronises with it
///                                                         v
///         reader of n    R2: seq == 2n  ──────>  R3: copy_i = word_i  ──>  R4: seq is 2m − 1: the copy is rejected
///
///    x86-64 keeps stores in order and loads in order by itself; only the compiler has to be held. AArch64 reorders
///    both: W2's stlr keeps W1 before the words, W3's keeps the words before 2n; R3's ldar keeps R4 after the words.
///
/// Death and take-over. A writer that dies leaves at worst slot N + 1 half written, or complete but not announced, with
/// `newest` = N. No reader looks at N + 1 before `newest` says so, and readers of the sample that was in that slot
/// before see a different sequence word and reject. The next writer owns the kernel's lock, which orders its accesses
/// after all of the dead one's, loads `newest` and writes N + 1 again from W1. Readers learn of N + 1 only from its W4,
/// which is after its W2 and W3: the dead writer's words of the same number can no longer be seen. (Rewriting N itself
/// would be wrong: a reader may have passed R2 of N with the dead writer's 2N and would meet the same 2N again in R4.)
/// tests/model/bus.pml checks all of this by exhaustion.
///
/// Nothing found in the segment is trusted: the slot index is masked by the locally held capacity, a number above
/// kMaxSequence is never followed, and every loop has a bound. A number behind what was already read is damage, there
/// or earlier: it is followed once it has grown kGrownBehind times, so that one wild number that was believed does not
/// silence a reader for ever.
// clang-format on
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "rtbus/detail/layout.hpp"
#include "rtbus/realtime.hpp"

namespace rtbus::detail {

/// Copies attempted before giving up on a writer that overtakes the reader.
inline constexpr int kMaxTries = 3;
/// A counter that grew so often behind what was read before is the writer's own, and what was read before was damage.
inline constexpr int kGrownBehind = 3;
/// A number that 10 kHz reaches after 14 million years: anything above is damage, and 2n must not wrap.
inline constexpr std::uint64_t kMaxSequence = std::uint64_t{1} << 62;
/// A writer that finds a higher counter begins anew: it is damage, and these numbers would end before the writer does.
inline constexpr std::uint64_t kMaxTakenOver = kMaxSequence / 2;

/// A segment's ring, as checked on opening. The numbers are local copies: later damage in the segment cannot change
/// them.
struct RingView {
  SharedU64* newest = nullptr;
  std::byte* slots = nullptr;
  std::uint32_t capacity = 0;     ///< Power of two.
  std::uint32_t slot_stride = 0;  ///< Bytes from slot to slot, a multiple of the cache line.
  std::uint32_t words = 0;        ///< Payload words of 8 bytes.

  /// First word of sample n's slot: sequence, stamp, payload words.
  [[nodiscard]] SharedU64* slot(std::uint64_t n) const noexcept RTBUS_NONBLOCKING {
    const std::uint64_t index = (n - 1) & (capacity - 1);
    return reinterpret_cast<SharedU64*>(slots + index * slot_stride);
  }
};

/// The writing end; one thread. @realtime publish() and published().
class RingWriter {
 public:
  RingWriter() = default;
  explicit RingWriter(const RingView& view) noexcept
      : view_(view), newest_(view.newest->load(std::memory_order_acquire)) {
    if (newest_ > kMaxTakenOver) newest_ = 0;
  }

  template <std::size_t kWords>
  void publish(const void* source, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING {
    write(source, kWords, stamp_ns);
  }
  /// The same for a size known only at run time: view.words × 8 bytes.
  void publish(const void* source, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING {
    write(source, view_.words, stamp_ns);
  }
  [[nodiscard]] std::uint64_t published() const noexcept RTBUS_NONBLOCKING { return newest_; }

 private:
  [[gnu::always_inline]] void write(const void* source, std::size_t words,
                                    std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING {
    const std::uint64_t n = newest_ + 1;
    SharedU64* const slot = view_.slot(n);
    slot[0].store(2 * n - 1, std::memory_order_relaxed);  // W1; ordered by the release of the first W2
    slot[1].store(stamp_ns, std::memory_order_release);   // W2, the stamp being the first payload word
    const auto* bytes = static_cast<const std::byte*>(source);
    for (std::size_t i = 0; i < words; ++i) {
      std::uint64_t word;
      std::memcpy(&word, bytes + 8 * i, 8);
      slot[2 + i].store(word, std::memory_order_release);
    }
    slot[0].store(2 * n, std::memory_order_release);    // W3
    view_.newest->store(n, std::memory_order_release);  // W4
    newest_ = n;
  }

  RingView view_;
  std::uint64_t newest_ = 0;  ///< Local: what the segment says later is not asked again.
};

/// A judge of samples (RingReader) that refuses none.
struct BelievesAll {
  bool operator()(const void*, std::uint64_t) const noexcept { return true; }
};

enum class RingRead : std::uint8_t { kFresh, kSame, kLapped, kRefused };

/// The reading end; one thread. Never stores into the segment. @realtime everything.
///
/// Each read takes a judge, `bool(const void* payload, std::uint64_t stamp_ns)`: a whole copy that it does not believe
/// is refused. read_next() passes over such a sample; read_latest() waits for the one after it.
class RingReader {
 public:
  RingReader() = default;
  explicit RingReader(const RingView& view) noexcept : view_(view) {
    // A read_next() that was overtaken restarts this many samples before the oldest slot is due to be overwritten,
    // so that it is not overtaken again while it copies.
    const std::uint32_t margin = view.capacity / 8 < 16 ? view.capacity / 8 : 16;
    held_safely_ = view.capacity - (margin > 0 ? margin : 1);
  }

  /// Sets where read_next() begins: at the oldest sample still held, or at the next one to be published.
  void start(bool from_oldest) noexcept {
    const std::uint64_t newest = view_.newest->load(std::memory_order_acquire);
    next_ = from_oldest ? oldest_safe(newest) : (newest < kMaxSequence ? newest + 1 : 1);
  }

  /// Copies the newest sample to `out` (kWords × 8 bytes); `out`, `sequence`, `stamp_ns` change only on kFresh.
  template <std::size_t kWords, class Judge = BelievesAll>
  [[nodiscard]] RingRead read_latest(void* out, std::uint64_t& sequence, std::uint64_t& stamp_ns,
                                     const Judge& judge = {}) noexcept RTBUS_NONBLOCKING {
    std::uint64_t words[kWords];
    const RingRead result = latest(FirstWords{words, kWords}, words, judge, sequence, stamp_ns);
    if (result == RingRead::kFresh) std::memcpy(out, words, sizeof words);
    return result;
  }
  template <std::size_t kWords, class Judge = BelievesAll>
  [[nodiscard]] RingRead read_next(void* out, std::uint64_t& sequence, std::uint64_t& stamp_ns,
                                   const Judge& judge = {}) noexcept RTBUS_NONBLOCKING {
    std::uint64_t words[kWords];
    const RingRead result = next(FirstWords{words, kWords}, words, judge, sequence, stamp_ns);
    if (result == RingRead::kFresh) std::memcpy(out, words, sizeof words);
    return result;
  }

  /// The same for a size known only at run time. `words` holds view.words and is scribbled on unless kFresh.
  template <class Judge = BelievesAll>
  [[nodiscard]] RingRead read_latest(std::uint64_t* words, std::uint64_t& sequence, std::uint64_t& stamp_ns,
                                     const Judge& judge = {}) noexcept RTBUS_NONBLOCKING {
    return latest(FirstWords{words, view_.words}, words, judge, sequence, stamp_ns);
  }
  template <class Judge = BelievesAll>
  [[nodiscard]] RingRead read_next(std::uint64_t* words, std::uint64_t& sequence, std::uint64_t& stamp_ns,
                                   const Judge& judge = {}) noexcept RTBUS_NONBLOCKING {
    return next(FirstWords{words, view_.words}, words, judge, sequence, stamp_ns);
  }

  /// Copies of the newest sample its first `head_words` and, of each column, the rows that the head counts: any part of
  /// a sample that was read between R2 and R4 is whole. `out` has room for a sample, is scribbled on unless kFresh, and
  /// keeps what it had in the rows left out.
  template <class Columns, class Judge>
  [[nodiscard]] RingRead read_latest_rows(std::byte* out, std::size_t head_words, const Columns& columns,
                                          std::uint64_t& sequence, std::uint64_t& stamp_ns,
                                          const Judge& judge) noexcept RTBUS_NONBLOCKING {
    const auto copy_words = [out](const SharedU64* payload, std::size_t first, std::size_t count) noexcept {
      for (std::size_t i = first; i < first + count; ++i) {
        const std::uint64_t word = payload[i].load(std::memory_order_acquire);
        std::memcpy(out + 8 * i, &word, 8);
      }
    };
    const auto head_and_rows = [&](const SharedU64* payload) noexcept {
      copy_words(payload, 0, head_words);
      for (const auto& column : columns) {
        std::uint32_t count;
        std::memcpy(&count, out + column.count_offset, sizeof count);
        const std::size_t rows = count < column.rows ? count : column.rows;
        copy_words(payload, column.offset / 8, (rows * column.row_bytes + 7) / 8);
      }
    };
    return latest(head_and_rows, out, judge, sequence, stamp_ns);
  }

  [[nodiscard]] std::uint64_t missed() const noexcept RTBUS_NONBLOCKING { return missed_; }
  /// Samples that a judge refused.
  [[nodiscard]] std::uint64_t refused() const noexcept RTBUS_NONBLOCKING { return refused_; }
  /// Number of the last sample read, or of the last one before start(): what a sleeper has to see surpassed.
  [[nodiscard]] std::uint64_t last_sequence() const noexcept RTBUS_NONBLOCKING { return next_ - 1; }

 private:
  /// R3 of so many words; always inlined, so that a number known when this is compiled stays one.
  struct FirstWords {
    std::uint64_t* out;
    std::size_t count;
    [[gnu::always_inline]] void operator()(const SharedU64* payload) const noexcept {
      for (std::size_t i = 0; i < count; ++i) out[i] = payload[i].load(std::memory_order_acquire);
    }
  };

  /// R2…R4; `take` is R3 of the payload. False when the slot holds another sample, or began to while it was copied.
  template <class Take>
  [[gnu::always_inline]] bool copy(std::uint64_t n, const Take& take,
                                   std::uint64_t& stamp_ns) const noexcept RTBUS_NONBLOCKING {
    const SharedU64* const slot = view_.slot(n);
    if (slot[0].load(std::memory_order_acquire) != 2 * n) return false;  // R2
    stamp_ns = slot[1].load(std::memory_order_acquire);                  // R3
    take(slot + 2);
    return slot[0].load(std::memory_order_relaxed) == 2 * n;  // R4; kept behind R3 by R3's acquire
  }

  /// `copied` is where `take` puts the payload.
  template <class Take, class Judge>
  [[gnu::always_inline]] RingRead latest(const Take& take, void* copied, const Judge& judge, std::uint64_t& sequence,
                                         std::uint64_t& stamp_ns) noexcept RTBUS_NONBLOCKING {
    for (int attempt = 0; attempt < kMaxTries; ++attempt) {
      const std::uint64_t n = view_.newest->load(std::memory_order_acquire);  // R1
      if (n < last_ && went_back(n)) last_ = n - 1;
      if (n <= last_) return RingRead::kSame;
      if (n > kMaxSequence) return RingRead::kLapped;
      std::uint64_t stamp;
      if (!copy(n, take, stamp)) continue;
      if (judge(copied, stamp)) return accept(n, stamp, sequence, stamp_ns);
      if (std::exchange(last_refused_, n) != n) ++refused_;
      return RingRead::kRefused;
    }
    return RingRead::kLapped;
  }

  template <class Take, class Judge>
  [[gnu::always_inline]] RingRead next(const Take& take, void* copied, const Judge& judge, std::uint64_t& sequence,
                                       std::uint64_t& stamp_ns) noexcept RTBUS_NONBLOCKING {
    // The jump is taken over only with a good copy: a counter or a slot that is damaged for a while costs nothing.
    std::uint64_t wanted = next_;
    for (int attempt = 0; attempt < kMaxTries; ++attempt) {
      const std::uint64_t newest = view_.newest->load(std::memory_order_acquire);  // R1
      if (newest < wanted - 1 && went_back(newest)) wanted = next_ = newest;
      if (newest < wanted) return RingRead::kSame;
      if (newest > kMaxSequence) return RingRead::kLapped;
      if (newest - wanted >= view_.capacity) wanted = oldest_safe(newest);
      std::uint64_t stamp;
      if (copy(wanted, take, stamp)) {
        missed_ += wanted - next_;
        if (judge(copied, stamp)) return accept(wanted, stamp, sequence, stamp_ns);
        ++missed_;
        ++refused_;
        next_ = wanted + 1;
        return RingRead::kRefused;
      }
      // Overtaken while copying. One further on at least: a damaged slot does not hold the reader up.
      const std::uint64_t safe = oldest_safe(view_.newest->load(std::memory_order_acquire));
      wanted = safe > wanted ? safe : wanted + 1;
    }
    return RingRead::kLapped;
  }

  [[gnu::always_inline]] RingRead accept(std::uint64_t n, std::uint64_t stamp, std::uint64_t& sequence,
                                         std::uint64_t& stamp_ns) noexcept RTBUS_NONBLOCKING {
    last_ = n;
    next_ = n + 1;
    behind_ = 0;
    grown_behind_ = 0;
    sequence = n;
    stamp_ns = stamp;
    return RingRead::kFresh;
  }

  /// `newest` is behind what was read. True once it has grown there often enough to be the writer's own.
  [[nodiscard]] bool went_back(std::uint64_t newest) noexcept RTBUS_NONBLOCKING {
    if (newest < behind_) grown_behind_ = 0;
    if (newest > behind_) ++grown_behind_;
    behind_ = newest;
    return grown_behind_ >= kGrownBehind;
  }

  /// Where a reader that was overtaken goes on: some slots away from the one to be overwritten next.
  [[nodiscard]] std::uint64_t oldest_safe(std::uint64_t newest) const noexcept RTBUS_NONBLOCKING {
    if (newest > kMaxSequence) return 1;
    return newest >= held_safely_ ? newest - held_safely_ + 1 : 1;
  }

  RingView view_;
  std::uint64_t held_safely_ = 1;
  std::uint64_t last_ = 0;  ///< Last sample accepted; 0: none, so the first read_latest() takes whatever is there.
  std::uint64_t next_ = 1;  ///< What read_next() wants.
  std::uint64_t missed_ = 0;
  std::uint64_t refused_ = 0;
  std::uint64_t last_refused_ = 0;  ///< By read_latest(), which may meet it again.
  std::uint64_t behind_ = 0;        ///< The newest counter seen behind what was read; 0: none since the last sample.
  int grown_behind_ = 0;            ///< How often it grew there.
};

}  // namespace rtbus::detail
