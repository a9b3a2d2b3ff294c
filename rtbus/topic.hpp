#pragma once
/// @file topic.hpp
/// A topic is a ring of seqlock slots in POSIX shared memory: one writer, any number of readers, no locks.
/// Byte layout: docs/shared-memory-layout.md. The copying protocol and its memory-order argument:
/// rtbus/detail/seqlock.hpp.
#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtbus/detail/seqlock.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/result.hpp"
#include "rtbus/sample.hpp"
#include "rtbus/segment.hpp"

namespace rtbus {

/// Outcome of a realtime read. The caller counts it and acts; there is no text to allocate.
enum class ReadStatus : std::uint8_t {
  kFresh,     ///< `out` is newer than the previous read.
  kSame,      ///< Nothing new; `out` is unchanged.
  kLapped,    ///< Overwritten during each of kMaxTries copies; `out` is unchanged.
  kDetached,  ///< No writer has been found yet (Subscription only); `out` is unchanged.
};

struct WriterOptions {
  std::uint32_t capacity =
      64;                 ///< Slots in the ring, a power of two, 2…65536. Two seconds of samples suit `read_next`.
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

  /// True while some reader asked to be noticed (ReaderOptions::presence): lets a node skip what nobody looks at.
  /// @realtime No: asks the kernel.
  [[nodiscard]] bool observed() const noexcept { return segment_.observed(); }

  /// The name leads to another segment or to none: somebody has deleted the topic, and newcomers do not find it.
  /// Publication makes it anew. @realtime No.
  [[nodiscard]] bool replaced() const noexcept { return segment_.replaced(); }

 private:
  static constexpr std::size_t kWords = sizeof(T) / 8;
  explicit Writer(Segment segment) : segment_(std::move(segment)), ring_(segment_.ring()) {}
  Segment segment_;
  detail::RingWriter ring_;
};

struct ReaderOptions {
  bool presence = false;     ///< Hold a kernel lock that Writer::observed() sees; it dies with this process.
  bool from_oldest = false;  ///< read_next() starts at the oldest sample still held instead of the next one published.
  OwnerTrust trust = OwnerTrust::kSelfOrRoot;
};

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
    return status(ring_.template read_latest<kWords>(&out.value, out.sequence, out.stamp_ns));
  }

  /// The same, without the rows of its tables that the sample does not count: less to fetch from the writer's cache.
  /// Those keep what they had; unless kFresh `out` is scribbled on. @realtime Yes, wait-free.
  [[nodiscard]] ReadStatus read_latest_rows(Stamped<T>& out) noexcept RTBUS_NONBLOCKING requires TabularSample<T> {
    static constexpr auto kColumns = detail::columns_of<T>();
    return status(ring_.read_latest_rows(reinterpret_cast<std::byte*>(&out.value), detail::head_bytes<T>() / 8,
                                         kColumns, out.sequence, out.stamp_ns));
  }

  /// Copies the sample after the one read before, in order. A reader that was overtaken jumps to the oldest sample
  /// that is safely held and counts what it lost in missed(). @realtime Yes, wait-free.
  [[nodiscard]] ReadStatus read_next(Stamped<T>& out) noexcept RTBUS_NONBLOCKING {
    return status(ring_.template read_next<kWords>(&out.value, out.sequence, out.stamp_ns));
  }

  /// Samples that read_next() jumped over [count]. @realtime Yes.
  [[nodiscard]] std::uint64_t missed() const noexcept RTBUS_NONBLOCKING { return ring_.missed(); }

  /// Sleeps until something newer than the last read is there (true) or `deadline_ns` passes (false): on the topic's
  /// futex when it has a doorbell, else polling every 0.2 ms. @realtime No.
  [[nodiscard]] bool wait(std::uint64_t deadline_ns) noexcept {
    return segment_.wait_newer_than(ring_.last_sequence(), deadline_ns);
  }

  /// False once the writer's process has died or closed the topic: its kernel lock is gone. @realtime No.
  [[nodiscard]] bool writer_alive() const noexcept { return segment_.writer_alive(); }

  /// True when the name now belongs to another segment, or to none: time to open anew. @realtime No.
  [[nodiscard]] bool replaced() const noexcept { return segment_.replaced(); }

 private:
  static constexpr std::size_t kWords = sizeof(T) / 8;
  Reader(Segment segment, const ReaderOptions& options) : segment_(std::move(segment)), ring_(segment_.ring()) {
    ring_.start(options.from_oldest);
  }
  static ReadStatus status(detail::RingRead read) noexcept {
    switch (read) {
      case detail::RingRead::kFresh:
        return ReadStatus::kFresh;
      case detail::RingRead::kSame:
        return ReadStatus::kSame;
      case detail::RingRead::kLapped:
        break;
    }
    return ReadStatus::kLapped;
  }
  Segment segment_;
  detail::RingReader ring_;
};

}  // namespace rtbus
