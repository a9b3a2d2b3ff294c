#pragma once
/// @file segment.hpp
/// A topic's POSIX shared-memory segment: creation, ownership, checks, and the non-realtime questions about it.
/// Boost.Interprocess stays behind this header. Nothing here is for the realtime context.
#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtbus/detail/seqlock.hpp"
#include "rtbus/result.hpp"
#include "rtbus/sample.hpp"

namespace rtbus {

/// Why a topic could not be opened.
enum class TopicError : std::uint8_t {
  kNotFound,        ///< The writer has not started yet. Worth retrying.
  kAlreadyOwned,    ///< A live writer holds the topic. Stop it, or choose another session.
  kLayoutMismatch,  ///< Version, size or type hash differ. Rebuild both ends.
  kPermission,      ///< The segment belongs to somebody else, or its mode forbids it. Same user, or set bus.group.
  kBadName,         ///< Session or topic has characters that a segment name may not have.
  kCorrupt,         ///< Not a segment of this bus, or one whose header contradicts its size. `rtbus clean` removes it.
  kSystem,          ///< A system call failed; errno says why.
};

/// One sentence for people.
[[nodiscard]] const char* to_string(TopicError error) noexcept;

/// Whose segments a reader accepts. The contents are checked in any case.
enum class OwnerTrust : std::uint8_t {
  kSelfOrRoot,  ///< Mine or root's: for nodes. With Session::group also those of that group's members.
  kAnyone,      ///< Whoever lets me read: for tools that only print.
};

/// Keeps set-ups apart: topics of one session never meet those of another.
struct Session {
  std::string name = "default";  ///< [a-z0-9_-], 1…32 characters.
  mode_t mode = 0600;            ///< Permissions of new segments; the umask does not weaken or strengthen them.
  std::optional<gid_t> group{};  ///< Group of new segments; none: the creator's own.

  [[nodiscard]] static bool valid_name(std::string_view name) noexcept;
};

/// Name, size, hash and fields of a sample type, without the type.
struct SampleDescription {
  std::string_view type_name;
  std::uint32_t bytes;
  std::uint64_t type_hash;
  std::span<const Field> fields;
};

template <Sample T>
[[nodiscard]] constexpr SampleDescription describe() noexcept {
  return {SampleTraits<T>::kName, sizeof(T), type_hash<T>(), SampleTraits<T>::kFields};
}

/// True for [a-z0-9_.-], 1…96 characters, not beginning with a dot.
[[nodiscard]] bool valid_topic_name(std::string_view topic) noexcept;

/// "rtbus.<session>.<topic>", as it appears in /dev/shm.
[[nodiscard]] std::string segment_name(std::string_view session, std::string_view topic);

/// A mapped segment. Movable, not copyable. The writer's end unlinks it on destruction.
class Segment {
 public:
  /// Writer's end: creates the segment, or takes it over from a dead writer (same layout: in place, numbering goes on;
  /// another layout: a new segment under the same name). The ownership lock dies with the process.
  [[nodiscard]] static Result<Segment, TopicError> create(const Session& session, std::string_view topic,
                                                          const SampleDescription& description, std::uint32_t capacity,
                                                          bool doorbell);

  /// Reader's end. `expected` null accepts any type (generic tools).
  [[nodiscard]] static Result<Segment, TopicError> open(const Session& session, std::string_view topic,
                                                        const SampleDescription* expected, OwnerTrust trust,
                                                        bool presence);

  Segment(Segment&&) noexcept;
  Segment& operator=(Segment&&) noexcept;
  ~Segment();

  /// Validated view of the ring; stays valid while the Segment lives, also when it is moved.
  [[nodiscard]] detail::RingView ring() const noexcept;

  [[nodiscard]] bool writer_alive()
      const noexcept;                            ///< Somebody holds the writer's lock; true on the writer's own end.
  [[nodiscard]] bool observed() const noexcept;  ///< Another open end holds a presence lock.
  /// The topic is gone from here: its name leads to another segment or to none, or the file has another length or
  /// holes.
  [[nodiscard]] bool replaced() const noexcept;
  [[nodiscard]] std::size_t bytes() const noexcept;         ///< Size of the file.
  [[nodiscard]] std::uint32_t writer_pid() const noexcept;  ///< As the writer wrote it: for people, not for decisions.
  [[nodiscard]] std::uint32_t epoch() const noexcept;       ///< Writers this segment has had, from 1.
  [[nodiscard]] std::uint64_t writer_start_ns() const noexcept;  ///< CLOCK_MONOTONIC when the present writer took it.
  [[nodiscard]] uid_t owner() const noexcept;                    ///< User the file belonged to when it was opened.

  /// Writer's end: puts the header back as it was made, if somebody has changed it; true when that was needed. `newest`
  /// and the slots are not touched: the next publish makes them right.
  bool mend() noexcept;
  void give_up_name() noexcept;  ///< Writer's end: removes the name if it still leads here, as the destructor does.

  void ring_doorbell() noexcept;  ///< Writer's end: wakes sleepers; a system call only when there are any.
  /// Reader's end: sleeps until a sample after `sequence` is complete (true) or `deadline_ns` passes (false).
  [[nodiscard]] bool wait_newer_than(std::uint64_t sequence, std::uint64_t deadline_ns) noexcept;

  /// One field of the sample, as the segment describes it.
  struct OwnedField {
    std::string name;
    std::string unit;
    FieldType type = FieldType::kF64;
    std::uint32_t offset = 0;
    std::uint32_t count = 0;
    std::uint32_t inner = 1;  ///< As Field::inner.
  };
  /// What the header says about the topic, copied out and checked: sizes agree with each other and with the file,
  /// fields lie within the sample, texts are printable.
  struct Description {
    std::string type_name;
    std::uint64_t type_hash = 0;
    std::uint32_t sample_bytes = 0;
    std::uint32_t capacity = 0;
    std::vector<OwnedField> fields;
    bool doorbell = false;
  };
  [[nodiscard]] const Description& description() const noexcept;

 private:
  struct Impl;
  explicit Segment(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtbus
