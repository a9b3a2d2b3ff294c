#pragma once
/// @file raw_writer.hpp
/// Writes a topic whose type is known at run time only: for generic tools and other languages. Readers see no
/// difference to a Writer<T>.
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtbus/result.hpp"
#include "rtbus/sane_sample.hpp"
#include "rtbus/segment.hpp"
#include "rtbus/topic.hpp"

namespace rtbus {

/// A type that is described at run time. Fields in the order of their offsets, without gaps, as Sample demands it.
struct RawType {
  std::string name;  ///< At most 47 bytes.
  std::uint32_t bytes = 0;
  std::vector<Segment::OwnedField> fields;
};

/// What is wrong with a type: a sentence that names the field and the remedy; empty: nothing.
[[nodiscard]] std::string problem_of(const RawType& type);

/// The hash that a Writer<T> of the same fields has.
[[nodiscard]] std::uint64_t type_hash(const RawType& type);

/// The first field of `sample` with a number that is not finite, as "position_m[1]"; empty: there is none.
[[nodiscard]] std::string not_finite(std::span<const std::byte> sample, const std::vector<Segment::OwnedField>& fields);

/// The first field of a sample of a known type that its rules refuse for itself, as not_finite() names it; empty: none
/// does, or the type is not known. Each field is tried among harmless others.
[[nodiscard]] std::string impossible_field(std::span<const std::byte> sample, const RawType& type,
                                           std::uint64_t stamp_ns);

/// The writing end. Movable, not copyable. One thread. A topic whose file was deleted or shortened is made anew, as a
/// Publication does; publish() and observed() look after it themselves, every kLook_ns. @realtime No.
class RawWriter {
 public:
  static constexpr std::uint64_t kLook_ns = 20 * kNsPerMs;
  /// Both rings are written for so long after that.
  static constexpr std::uint64_t kHandOver_ns = 250 * kNsPerMs;

  /// Creates the topic, or takes it over when its writer has died. `type` must have no problem_of().
  [[nodiscard]] static Result<RawWriter, TopicError> create(Session session, std::string topic, RawType type,
                                                            WriterOptions options = {});

  /// Makes `sample`, which has type().bytes, the newest one. False: it is not sane (sane_sample.hpp), nothing was
  /// published.
  [[nodiscard]] bool publish(const void* sample, std::uint64_t stamp_ns);

  [[nodiscard]] bool observed();                                        ///< As Writer::observed().
  [[nodiscard]] std::uint64_t published() const noexcept;               ///< As Writer::published().
  [[nodiscard]] const RawType& type() const noexcept { return type_; }  ///< As given to create().

 private:
  RawWriter(Session session, std::string topic, RawType type, WriterOptions options)
      : session_(std::move(session)), topic_(std::move(topic)), type_(std::move(type)), options_(options) {}
  struct End {
    Segment segment;
    detail::RingWriter ring;
  };
  [[nodiscard]] Result<End, TopicError> open() const;
  void look_after(std::uint64_t now_ns);

  Session session_;
  std::string topic_;
  RawType type_;
  WriterOptions options_;
  std::optional<End> current_, former_;
  std::uint64_t look_ns_ = 0, hand_over_ends_ns_ = 0;
  SaneBytes sane_ = nullptr;
};

}  // namespace rtbus
