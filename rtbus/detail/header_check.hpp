#pragma once
/// @file header_check.hpp
/// Writes a segment's header, and reads and checks one that is not trusted. Private to rtbus.
#include <cstring>
#include <string>

#include "rtbus/detail/layout.hpp"
#include "rtbus/segment.hpp"

namespace rtbus::detail {

/// Fills in everything but the magic number, which the caller stores last.
inline void write_header(std::byte* base, const SampleDescription& sample, std::uint32_t capacity,
                         const Geometry& where) noexcept {
  auto* const header = reinterpret_cast<SegmentHeader*>(base);
  header->layout_version = kLayoutVersion;
  header->header_bytes = where.header_bytes;
  header->type_hash = sample.type_hash;
  header->sample_bytes = sample.bytes;
  header->capacity = capacity;
  header->slot_stride = where.slot_stride;
  header->field_count = static_cast<std::uint32_t>(sample.fields.size());
  header->segment_bytes = where.segment_bytes;
  header->doorbell_offset = where.doorbell_offset;
  std::memcpy(header->type_name, sample.type_name.data(), sample.type_name.size());
  auto* record = reinterpret_cast<FieldRecord*>(base + sizeof(SegmentHeader));
  for (const Field& field : sample.fields) {
    std::memcpy(record->name, field.name.data(), field.name.size());
    std::memcpy(record->unit, field.unit.data(), field.unit.size());
    record->type = static_cast<std::uint32_t>(field.type);
    record->offset = field.offset;
    record->count = field.count;
    record->inner = field.inner;
    ++record;
  }
}

/// Takes a text out of a fixed array. False when it is not ended, or holds what a terminal should not be sent.
template <std::size_t N>
[[nodiscard]] bool take_text(const char (&from)[N], std::string& out) {
  const void* end = std::memchr(from, 0, N);
  if (end == nullptr) return false;
  out.assign(from, static_cast<std::size_t>(static_cast<const char*>(end) - from));
  for (const char c : out) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return false;
  }
  return true;
}

/// A header's contents after all checks, in local memory.
struct CheckedHeader {
  Segment::Description description;
  Geometry where{};
};

/// Reads the header of a file of `file_bytes` (at least one page), of which the first kMaxHeaderBytes, or all, are
/// mapped at `base`. Each value is copied before it is checked, so a hostile writer cannot change it in between.
[[nodiscard]] inline Result<CheckedHeader, TopicError> read_header(const std::byte* base, std::uint64_t file_bytes) {
  const auto* const shared = reinterpret_cast<const SegmentHeader*>(base);
  const std::uint64_t magic = shared->magic.load(std::memory_order_acquire);
  if (magic == 0) return Failure{TopicError::kNotFound};  // its creator is not ready
  if (magic != kMagic) return Failure{TopicError::kCorrupt};

  struct Fixed {  // the header's constant part, past the magic number
    std::uint32_t layout_version, header_bytes;
    std::uint64_t type_hash;
    std::uint32_t sample_bytes, capacity, slot_stride, field_count;
    std::uint64_t segment_bytes, doorbell_offset;
    char type_name[48];
  } fixed;
  static_assert(sizeof(Fixed) == 96 && offsetof(Fixed, type_name) + 8 == offsetof(SegmentHeader, type_name));
  std::memcpy(&fixed, base + 8, sizeof fixed);

  if (fixed.layout_version != kLayoutVersion) return Failure{TopicError::kLayoutMismatch};
  if (!valid_sizes(fixed.sample_bytes, fixed.capacity, fixed.field_count)) return Failure{TopicError::kCorrupt};
  CheckedHeader checked;
  checked.where = geometry(fixed.sample_bytes, fixed.capacity, fixed.field_count, fixed.doorbell_offset != 0);
  if (fixed.header_bytes != checked.where.header_bytes || fixed.slot_stride != checked.where.slot_stride ||
      fixed.doorbell_offset != checked.where.doorbell_offset || fixed.segment_bytes != checked.where.segment_bytes ||
      fixed.segment_bytes != file_bytes) {
    return Failure{TopicError::kCorrupt};
  }
  if (shared->newest.load(std::memory_order_acquire) > kMaxSequence) return Failure{TopicError::kCorrupt};

  Segment::Description& description = checked.description;
  if (!take_text(fixed.type_name, description.type_name) || description.type_name.empty()) {
    return Failure{TopicError::kCorrupt};
  }
  description.type_hash = fixed.type_hash;
  description.sample_bytes = fixed.sample_bytes;
  description.capacity = fixed.capacity;
  description.doorbell = fixed.doorbell_offset != 0;
  for (std::uint32_t i = 0; i < fixed.field_count; ++i) {
    FieldRecord record;
    std::memcpy(&record, base + sizeof(SegmentHeader) + i * sizeof(FieldRecord), sizeof record);
    Segment::OwnedField field;
    if (!take_text(record.name, field.name) || field.name.empty() || !take_text(record.unit, field.unit)) {
      return Failure{TopicError::kCorrupt};
    }
    const std::uint32_t element_bytes = record.type > 0xff ? 0 : field_type_bytes(static_cast<FieldType>(record.type));
    if (element_bytes == 0 || record.offset > fixed.sample_bytes || record.count == 0 ||
        record.count > (fixed.sample_bytes - record.offset) / element_bytes) {
      return Failure{TopicError::kCorrupt};
    }
    field.type = static_cast<FieldType>(record.type);
    field.offset = record.offset;
    field.count = record.count;
    field.inner = record.inner != 0 && record.count % record.inner == 0 ? record.inner : 1;
    description.fields.push_back(std::move(field));
  }
  return checked;
}

}  // namespace rtbus::detail
