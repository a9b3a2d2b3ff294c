#pragma once
/// @file layout.hpp
/// The bytes of a topic's segment, as docs/shared-memory-layout.md draws them. Private to rtbus.
///
///     0                    SegmentHeader (256 bytes)
///     256                  FieldRecord[field_count]
///     header_bytes         slots: capacity × slot_stride      (header_bytes is a multiple of 4096)
///     doorbell_offset      Doorbell, only when asked for      (the last 4096 bytes)
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace rtbus::detail {

inline constexpr std::uint64_t kMagic = 0x0000'3153'5542'5452ULL;  ///< The bytes "RTBUS1", 0, 0.
inline constexpr std::uint32_t kLayoutVersion = 1;
inline constexpr std::uint32_t kPageBytes = 4096;  ///< Unit of the layout; the kernel's page may be larger.
inline constexpr std::uint32_t kCacheLineBytes = 64;
inline constexpr std::uint32_t kMinCapacity = 2;
inline constexpr std::uint32_t kMaxCapacity = 65'536;
inline constexpr std::uint32_t kMaxSampleBytes = 1u << 20;
inline constexpr std::uint32_t kMaxFields = 1024;
inline constexpr std::uint32_t kSlotHeadBytes = 16;  ///< Sequence word and stamp word.

/// Byte locked exclusively by the writer, and byte locked shared by readers that want to be noticed. The locks carry no
/// data: they are OFD locks of the segment file, which the kernel drops when the process dies.
inline constexpr long kWriterLockByte = 0;
inline constexpr long kPresenceLockByte = 1;

using SharedU64 = std::atomic<std::uint64_t>;
using SharedU32 = std::atomic<std::uint32_t>;
static_assert(SharedU64::is_always_lock_free && sizeof(SharedU64) == 8);
static_assert(SharedU32::is_always_lock_free && sizeof(SharedU32) == 4);

struct SegmentHeader {
  SharedU64 magic;  ///< Stored last (release) by the creator: whoever sees it sees the rest.
  std::uint32_t layout_version;
  std::uint32_t header_bytes;
  std::uint64_t type_hash;
  std::uint32_t sample_bytes;
  std::uint32_t capacity;
  std::uint32_t slot_stride;
  std::uint32_t field_count;
  std::uint64_t segment_bytes;
  std::uint64_t doorbell_offset;  ///< 0: none.
  char type_name[48];
  char padding[24];
  /// Changes when another writer takes over.
  alignas(kCacheLineBytes) SharedU64 writer_start_ns;
  SharedU32 writer_pid;
  SharedU32 epoch;
  /// Changes with every sample; alone on its cache line, so that a publish disturbs no other reader of the header.
  alignas(kCacheLineBytes) SharedU64 newest;
};
static_assert(sizeof(SegmentHeader) == 256 && offsetof(SegmentHeader, type_name) == 56);
static_assert(offsetof(SegmentHeader, writer_start_ns) == 128 && offsetof(SegmentHeader, newest) == 192);

struct FieldRecord {
  char name[40];
  char unit[16];
  std::uint32_t type;
  std::uint32_t offset;
  std::uint32_t count;
  std::uint32_t inner;  ///< Field::inner; 0 from writers that do not tell it.
};
static_assert(sizeof(FieldRecord) == 72);

/// Where the fields' records end.
constexpr std::size_t header_end(std::uint32_t field_count) noexcept {
  return sizeof(SegmentHeader) + std::size_t{field_count} * sizeof(FieldRecord);
}

/// The only bytes that a reader may write, and only one that sleeps.
struct Doorbell {
  SharedU32 rings;
  SharedU32 sleepers;
};

constexpr std::uint64_t round_up(std::uint64_t value, std::uint64_t unit) noexcept {
  return (value + unit - 1) / unit * unit;
}

/// Where everything lies, for given sizes. Creator and reader both compute it; the header only repeats it.
struct Geometry {
  std::uint32_t header_bytes;
  std::uint32_t slot_stride;
  std::uint64_t doorbell_offset;
  std::uint64_t segment_bytes;
};

constexpr Geometry geometry(std::uint32_t sample_bytes, std::uint32_t capacity, std::uint32_t field_count,
                            bool doorbell) noexcept {
  Geometry g{};
  g.header_bytes = static_cast<std::uint32_t>(
      round_up(sizeof(SegmentHeader) + std::uint64_t{field_count} * sizeof(FieldRecord), kPageBytes));
  g.slot_stride = static_cast<std::uint32_t>(round_up(std::uint64_t{sample_bytes} + kSlotHeadBytes, kCacheLineBytes));
  g.segment_bytes = round_up(g.header_bytes + std::uint64_t{capacity} * g.slot_stride, kPageBytes);
  if (doorbell) {
    g.doorbell_offset = g.segment_bytes;
    g.segment_bytes += kPageBytes;
  }
  return g;
}
static_assert(geometry(256, 64, 32, false).segment_bytes == 24'576);  // 1.25 × 256 × 64 and one page

/// No header is longer.
inline constexpr std::uint64_t kMaxHeaderBytes = geometry(8, kMinCapacity, kMaxFields, false).header_bytes;

constexpr bool valid_sizes(std::uint32_t sample_bytes, std::uint32_t capacity, std::uint64_t field_count) noexcept {
  return sample_bytes >= 8 && sample_bytes <= kMaxSampleBytes && sample_bytes % 8 == 0 && capacity >= kMinCapacity &&
         capacity <= kMaxCapacity && (capacity & (capacity - 1)) == 0 && field_count >= 1 && field_count <= kMaxFields;
}

}  // namespace rtbus::detail
