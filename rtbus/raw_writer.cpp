#include "rtbus/raw_writer.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/detail/layout.hpp"

namespace rtbus {
namespace {

std::vector<Field> views_of(const RawType& type) {
  std::vector<Field> out;
  for (const Segment::OwnedField& field : type.fields) {
    out.push_back({field.name, field.unit, field.type, field.offset, field.count, field.inner});
  }
  return out;
}

bool printable(const std::string& text) {
  return std::none_of(text.begin(), text.end(),
                      [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

std::string problem_of(const Segment::OwnedField& field, std::uint32_t expected_offset, std::uint32_t bytes) {
  const std::string name = "field '" + field.name + "'";
  if (field.name.empty() || field.name.size() > 39 || !printable(field.name)) {
    return name + " has a name that is empty, longer than 39 bytes or not printable";
  }
  if (field.unit.size() > 15 || !printable(field.unit)) {
    return name + " has a unit that is longer than 15 bytes or not printable";
  }
  const std::uint32_t element = field_type_bytes(field.type);
  if (element == 0) return name + " has an unknown type; use a number of rtbus_field_type";
  if (field.offset != expected_offset) {
    return name + " begins at byte " + std::to_string(field.offset) + ", and the field before it ends at byte " +
           std::to_string(expected_offset) + "; give padding a field of its own";
  }
  if (field.count == 0 || field.count > (bytes - std::min(bytes, field.offset)) / element) {
    return name + " has " + std::to_string(field.count) + " elements, which do not fit into the sample of " +
           std::to_string(bytes) + " bytes";
  }
  if (field.inner == 0 || field.count % field.inner != 0) {
    return name + " has " + std::to_string(field.count) + " elements, which is no multiple of its inner length " +
           std::to_string(field.inner);
  }
  return "";
}

}  // namespace

std::string problem_of(const RawType& type) {
  if (type.name.empty() || type.name.size() > 47 || !printable(type.name)) {
    return "the type's name is empty, longer than 47 bytes or not printable";
  }
  if (!detail::valid_sizes(type.bytes, detail::kMinCapacity, type.fields.size())) {
    return "a sample has 1…1024 fields and a multiple of 8 bytes up to 1 MiB, and this one " +
           std::to_string(type.fields.size()) + " fields and " + std::to_string(type.bytes) + " bytes";
  }
  std::uint32_t end = 0;
  for (const Segment::OwnedField& field : type.fields) {
    if (std::string problem = problem_of(field, end, type.bytes); !problem.empty()) return problem;
    end += field.count * field_type_bytes(field.type);
  }
  if (end != type.bytes) {
    return "the fields end at byte " + std::to_string(end) + " of " + std::to_string(type.bytes) +
           "; give padding a field of its own";
  }
  return "";
}

std::uint64_t type_hash(const RawType& type) { return type_hash(type.name, type.bytes, views_of(type)); }

std::string not_finite(std::span<const std::byte> sample, const std::vector<Segment::OwnedField>& fields) {
  for (const Segment::OwnedField& field : fields) {
    if (field.type != FieldType::kF64) continue;
    for (std::uint32_t i = 0; i < field.count; ++i) {
      const std::size_t at = field.offset + std::size_t{8} * i;
      double value = 0.0;
      if (at + sizeof value > sample.size()) break;
      std::memcpy(&value, sample.data() + at, sizeof value);
      if (std::isfinite(value)) continue;
      return field.count == 1 ? field.name : field.name + "[" + std::to_string(i) + "]";
    }
  }
  return "";
}

std::string impossible_field(std::span<const std::byte> sample, const RawType& type, std::uint64_t stamp_ns) {
  const SaneBytes sane = rules_of(type_hash(type), type.bytes);
  if (sane == nullptr || sample.size() != type.bytes) return "";
  // Zero suits each count and each time, one each number: a scale is not zero.
  std::vector<std::byte> harmless(type.bytes);
  for (const Segment::OwnedField& field : type.fields) {
    if (field.type != FieldType::kF64) continue;
    constexpr double kOne = 1.0;
    for (std::uint32_t i = 0; i < field.count; ++i) {
      std::memcpy(harmless.data() + field.offset + sizeof kOne * i, &kOne, sizeof kOne);
    }
  }
  for (const Segment::OwnedField& field : type.fields) {
    // A text is one thing.
    const std::size_t bytes = field.type == FieldType::kText ? field.count : field_type_bytes(field.type);
    for (std::size_t at = 0; at < std::size_t{field.count} * field_type_bytes(field.type); at += bytes) {
      std::vector<std::byte> tried = harmless;
      std::copy_n(sample.begin() + static_cast<std::ptrdiff_t>(field.offset + at), bytes,
                  tried.begin() + static_cast<std::ptrdiff_t>(field.offset + at));
      if (sane(tried.data(), stamp_ns)) continue;
      return field.count == 1 || bytes == field.count ? field.name
                                                      : field.name + "[" + std::to_string(at / bytes) + "]";
    }
  }
  return "";
}

Result<RawWriter::End, TopicError> RawWriter::open() const {
  const std::vector<Field> fields = views_of(type_);
  auto segment = Segment::create(session_, topic_, {type_.name, type_.bytes, type_hash(type_), fields},
                                 options_.capacity, options_.doorbell);
  if (!segment) return Failure{segment.error()};
  detail::RingWriter ring(segment->ring());
  return End{std::move(*segment), ring};
}

Result<RawWriter, TopicError> RawWriter::create(Session session, std::string topic, RawType type,
                                                WriterOptions options) {
  RawWriter writer(std::move(session), std::move(topic), std::move(type), options);
  auto end = writer.open();
  if (!end) return Failure{end.error()};
  writer.current_.emplace(std::move(*end));
  writer.sane_ = rules_of(type_hash(writer.type_), writer.type_.bytes);
  return writer;
}

void RawWriter::look_after(std::uint64_t now_ns) {
  if (now_ns < look_ns_) return;
  look_ns_ = now_ns + kLook_ns;
  if (former_ && now_ns >= hand_over_ends_ns_) former_.reset();
  if (!current_->segment.replaced()) {
    (void)current_->segment.mend();
    return;
  }
  current_->segment.give_up_name();
  auto fresh = open();
  if (!fresh) {
    look_ns_ = now_ns + kNsPerS;
    return;
  }
  former_ = std::move(current_);
  current_.emplace(std::move(*fresh));
  hand_over_ends_ns_ = now_ns + kHandOver_ns;
}

bool RawWriter::publish(const void* sample, std::uint64_t stamp_ns) {
  if (sane_ != nullptr && !sane_(sample, stamp_ns)) return false;
  look_after(monotonic_ns());
  current_->ring.publish(sample, stamp_ns);
  if (former_) former_->ring.publish(sample, stamp_ns);
  if (options_.doorbell) current_->segment.ring_doorbell();
  return true;
}

bool RawWriter::observed() {
  look_after(monotonic_ns());
  return current_->segment.observed() || (former_ && former_->segment.observed());
}

std::uint64_t RawWriter::published() const noexcept { return current_->ring.published(); }

}  // namespace rtbus
