#pragma once
/// @file topic.hpp
/// A topic is a ring of seqlock slots in POSIX shared memory: one writer, any number of readers, no locks.
/// Byte layout: docs/shared-memory-layout.md. The copying protocol and its memory-order argument:
/// rtbus/detail/seqlock.hpp.
#include <sys/types.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtbus/detail/seqlock.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/result.hpp"
#include "rtbus/sample.hpp"
#include "rtbus/sane_sample.hpp"
#include "rtbus/segment.hpp"

namespace rtbus {

/// Outcome of a realtime read. The caller counts it and acts; there is no text to allocate.
enum class ReadStatus : std::uint8_t {
  kFresh,     ///< `out` is newer than the previous read.
  kSame,      ///< Nothing new; `out` is unchanged.
  kLapped,    ///< Overwritten during each of kMaxTries copies; `out` is unchanged.
  kRefused,   ///< Not sane (sane_sample.hpp); counted in refused(), `out` is unchanged.
  kDetached,  ///< No writer has been found yet (Subscription only); `out` is unchanged.
};

/// How Writer::create() makes a topic.
struct WriterOptions {
  /// Slots in the ring, a power of two, 2…65536. Two seconds of samples suit `read_next`.
  std::uint32_t capacity = 64;
  bool doorbell = false;  ///< Adds a page with a futex for sleeping readers (Reader::wait). Off: they poll.
};

/// The writing end of a topic. Movable, not copyable. One thread per Writer.
/// Takes over the topic of a dead writer: numbering goes on, readers of the same layout notice nothing but the pause.
/// Unlinks the topic on destruction, so a clean exit leaves nothing in /dev/shm. Where somebody may delete the topic
/// meanwhile, use a Publication.
template <Sample T>
class Writer {
 public:
  /// Creates the topic, or takes it over when its writer has died. @realtime No.
  [[nodiscard]] static Result<Writer, TopicError> create(const Session& session, std::string_view topic,
                                                         WriterOptions options = {}) {
    const SampleDescription description = describe<T>();
    auto segment = Segment::create(session, topic, description, options.capacity, options.doorbell);
    if (!segment) return Failure{segment.error()};
    return Writer(std::move(*segment));
  }

  /// Makes `value` the newest sample. @realtime Yes, wait-free: one copy of sizeof(T) bytes, no system call.
  void publish(const T& value, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING {
    ring_.template publish<kWords>(&value, stamp_ns);
  }

  /// Wakes the readers that sleep in Reader::wait, if there are any. Needs WriterOptions::doorbell.
  /// @realtime No: a system call when somebody sleeps. A realtime writer leaves this to a helper thread.
  void ring_doorbell() noexcept { segment_.ring_doorbell(); }

  /// Samples published over the life of the topic, former writers included. @realtime Yes.
  [[nodiscard]] std::uint64_t published() const noexcept RTBUS_NONBLOCKING { return ring_.published(); }

  /// True while some reader asked to be noticed (ReaderOptions::presence): a node does not publish what has no
  /// observer.
  /// @realtime No: asks the kernel.
  [[nodiscard]] bool observed() const noexcept { return segment_.observed(); }

  /// The topic is gone: its name leads to another segment or to none, or somebody has shortened its file. Publication
  /// makes it anew. @realtime No.
  [[nodiscard]] bool replaced() const noexcept { return segment_.replaced(); }

  /// Restores a damaged header; true when that was needed. @realtime No.
  bool mend() noexcept { return segment_.mend(); }
  /// Removes the name if it still leads to this segment, so that the topic can be made anew. @realtime No.
  void give_up_name() noexcept { segment_.give_up_name(); }

 private:
  static constexpr std::size_t kWords = sizeof(T) / 8;
  explicit Writer(Segment segment) : segment_(std::move(segment)), ring_(segment_.ring()) {}
  Segment segment_;
  detail::RingWriter ring_;
};

/// How Reader::open() reads a topic.
struct ReaderOptions {
  bool presence = false;     ///< Hold a kernel lock that Writer::observed() sees; it dies with this process.
  bool from_oldest = false;  ///< read_next() starts at the oldest sample still held instead of the next one published.
  OwnerTrust trust = OwnerTrust::kSelfOrRoot;
};

namespace detail {

/// Samples that a read in order passes over at once.
inline constexpr int kMaxPassedOver = 64;

template <class Read>
[[nodiscard]] RingRead pass_over_refused(const Read& read) noexcept RTBUS_NONBLOCKING {
  RingRead result = read();
  for (int i = 1; i < kMaxPassedOver && result == RingRead::kRefused; ++i) result = read();
  return result;
}

}  // namespace detail

/// The reading end of a topic. Movable, not copyable. Maps the data read-only, unmaps on destruction, never unlinks.
/// Thread-safety: one thread per Reader; any number of Readers per topic.
template <Sample T>
class Reader {
 public:
  /// Copies attempted before giving up on a writer that overtakes the reader.
  static constexpr int kMaxTries = detail::kMaxTries;

  /// Maps `topic` (for example "haptic0.device_state") and faults its pages in. @realtime No.
  [[nodiscard]] static Result<Reader, TopicError> open(const Session& session, std::string_view topic,
                                                       ReaderOptions options = {}) {
    const SampleDescription description = describe<T>();
    auto segment = Segment::open(session, topic, &description, options.trust, options.presence);
    if (!segment) return Failure{segment.error()};
    return Reader(std::move(*segment), options);
  }

  /// Copies the newest complete sample into `out`.
  /// @realtime Yes, wait-free: at most kMaxTries copies of sizeof(T) bytes.
  [[nodiscard]] ReadStatus read_latest(Stamped<T>& out) noexcept RTBUS_NONBLOCKING {
    return status(ring_.template read_latest<kWords>(&out.value, out.sequence, out.stamp_ns, judge()));
  }

  /// The same, without the rows of its tables that the sample does not count: less to fetch from the writer's cache.
  /// Those keep what they had; unless kFresh the content of `out` is undefined. @realtime Yes, wait-free.
  [[nodiscard]] ReadStatus read_latest_rows(Stamped<T>& out) noexcept RTBUS_NONBLOCKING requires TabularSample<T> {
    static constexpr auto kColumns = detail::columns_of<T>();
    const auto in_place = [&](const void*, std::uint64_t stamp_ns) noexcept { return believes(out.value, stamp_ns); };
    return status(ring_.read_latest_rows(reinterpret_cast<std::byte*>(&out.value), detail::head_bytes<T>() / 8,
                                         kColumns, out.sequence, out.stamp_ns, in_place));
  }

  /// Copies the sample after the one read before, in order. A reader that was overtaken jumps to the oldest sample
  /// that is safely held and counts what it lost in missed(). Passes over samples that are not sane, at most
  /// detail::kMaxPassedOver at once. @realtime Yes, wait-free.
  [[nodiscard]] ReadStatus read_next(Stamped<T>& out) noexcept RTBUS_NONBLOCKING {
    return status(detail::pass_over_refused(
        [&] { return ring_.template read_next<kWords>(&out.value, out.sequence, out.stamp_ns, judge()); }));
  }

  /// Samples that read_next() jumped or passed over [count]. @realtime Yes.
  [[nodiscard]] std::uint64_t missed() const noexcept RTBUS_NONBLOCKING { return ring_.missed(); }

  /// Samples that were not sane [count]. @realtime Yes.
  [[nodiscard]] std::uint64_t refused() const noexcept RTBUS_NONBLOCKING { return ring_.refused(); }

  /// Sleeps until something newer than the last read is there (true) or `deadline_ns` passes (false): on the topic's
  /// futex when it has a doorbell, else polling every 0.2 ms. @realtime No.
  [[nodiscard]] bool wait(std::uint64_t deadline_ns) noexcept {
    return segment_.wait_newer_than(ring_.last_sequence(), deadline_ns);
  }

  /// False once the writer's process has died or closed the topic: its kernel lock is gone. @realtime No.
  [[nodiscard]] bool writer_alive() const noexcept { return segment_.writer_alive(); }

  /// True when the name now belongs to another segment or to none, or the segment was shortened: time to open anew.
  /// @realtime No.
  [[nodiscard]] bool replaced() const noexcept { return segment_.replaced(); }

 private:
  static constexpr std::size_t kWords = sizeof(T) / 8;
  Reader(Segment segment, const ReaderOptions& options) : segment_(std::move(segment)), ring_(segment_.ring()) {
    ring_.start(options.from_oldest);
  }
  /// Sane, and not older than the sample before it: an old one that was put back.
  [[nodiscard]] bool believes(const T& value, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING {
    if constexpr (JudgedSample<T>) {
      if (stamp_ns < accepted_ns_ || !sane_stamp(stamp_ns) || !sane(value, stamp_ns)) return false;
      accepted_ns_ = stamp_ns;
    }
    return true;
  }
  [[nodiscard]] auto judge() noexcept RTBUS_NONBLOCKING {
    return [this](const void* payload, std::uint64_t stamp_ns) noexcept {
      if constexpr (!JudgedSample<T>) return true;
      T value;
      std::memcpy(&value, payload, sizeof value);
      return believes(value, stamp_ns);
    };
  }
  static ReadStatus status(detail::RingRead read) noexcept {
    switch (read) {
      case detail::RingRead::kFresh:
        return ReadStatus::kFresh;
      case detail::RingRead::kSame:
        return ReadStatus::kSame;
      case detail::RingRead::kRefused:
        return ReadStatus::kRefused;
      case detail::RingRead::kLapped:
        break;
    }
    return ReadStatus::kLapped;
  }
  Segment segment_;
  detail::RingReader ring_;
  std::uint64_t accepted_ns_ = 0;  ///< Stamp of the last sample that was accepted.
};

}  // namespace rtbus
