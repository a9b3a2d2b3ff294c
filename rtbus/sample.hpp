#pragma once
/// @file sample.hpp
/// What may travel over a topic, and how a sample describes itself so that generic tools can print it.
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>

namespace rtbus {

/// The scalar types a field may have. The numbers are part of the shared-memory layout.
enum class FieldType : std::uint8_t {
  kF64 = 1,
  kU64 = 2,
  kI64 = 3,
  kU32 = 4,
  kI32 = 5,
  kU8 = 6,
  kText = 7,  ///< `count` bytes of UTF-8, ended by a zero byte unless full.
};

/// Bytes of one element of `type`; 0 for a value that is not in the list (a corrupt segment).
[[nodiscard]] constexpr std::uint32_t field_type_bytes(FieldType type) noexcept {
  switch (type) {
    case FieldType::kF64:
    case FieldType::kU64:
    case FieldType::kI64:
      return 8;
    case FieldType::kU32:
    case FieldType::kI32:
      return 4;
    case FieldType::kU8:
    case FieldType::kText:
      return 1;
  }
  return 0;
}

/// One field of a sample: `count` elements of `type` that start `offset` bytes into it.
struct Field {
  std::string_view name;  ///< Carries its unit as suffix, for example "position_m". At most 39 bytes.
  std::string_view unit;  ///< "m", "N", "ns", "1" for a pure number, "" for text. At most 15 bytes.
  FieldType type;
  std::uint32_t offset;
  std::uint32_t count;
  /// Elements of the last dimension of an array of arrays: 3 of 64 positions, whose count is 192. 1: no such shape.
  std::uint32_t inner = 1;
};

namespace detail {

template <class M>
struct FieldShape;  // maps a member's C++ type to (FieldType, count, inner)
template <FieldType kScalar>
struct ScalarShape {
  static constexpr FieldType kType = kScalar;
  static constexpr std::uint32_t kCount = 1;
  static constexpr std::uint32_t kInner = 1;
};
template <>
struct FieldShape<double> : ScalarShape<FieldType::kF64> {};
template <>
struct FieldShape<std::uint64_t> : ScalarShape<FieldType::kU64> {};
template <>
struct FieldShape<std::int64_t> : ScalarShape<FieldType::kI64> {};
template <>
struct FieldShape<std::uint32_t> : ScalarShape<FieldType::kU32> {};
template <>
struct FieldShape<std::int32_t> : ScalarShape<FieldType::kI32> {};
template <>
struct FieldShape<std::uint8_t> : ScalarShape<FieldType::kU8> {};
template <>
struct FieldShape<char> : ScalarShape<FieldType::kText> {};
template <class E, std::size_t N>
struct FieldShape<std::array<E, N>> {
  static constexpr FieldType kType = FieldShape<E>::kType;
  static constexpr std::uint32_t kCount = static_cast<std::uint32_t>(N) * FieldShape<E>::kCount;
  static constexpr std::uint32_t kInner = FieldShape<E>::kInner > 1 ? FieldShape<E>::kInner : FieldShape<E>::kCount;
};

}  // namespace detail

/// A row of SampleTraits<T>::kFields: name, type, count and offset come from the member itself.
// (Version 14 of clang-format takes the angle brackets of a macro for comparisons.)
// clang-format off
#define RTBUS_FIELD(Type, member, unit)                                                          \
  ::rtbus::Field {                                                                               \
    #member, unit, ::rtbus::detail::FieldShape<decltype(Type::member)>::kType,                   \
        static_cast<std::uint32_t>(offsetof(Type, member)),                                      \
        ::rtbus::detail::FieldShape<decltype(Type::member)>::kCount,                             \
        ::rtbus::detail::FieldShape<decltype(Type::member)>::kInner                              \
  }
// clang-format on

/// Specialise for every sample: `static constexpr std::string_view kName` (at most 47 bytes) and
/// `static constexpr std::array kFields{RTBUS_FIELD(…), …}`, in the order of the members.
template <class T>
struct SampleTraits;

namespace detail {

/// True when the fields follow each other without a gap and fill the sample: no hidden padding, nothing undescribed.
template <class T>
consteval bool fields_tile_sample() {
  std::uint32_t end = 0;
  for (const Field& field : SampleTraits<T>::kFields) {
    if (field.offset != end || field.name.size() > 39 || field.unit.size() > 15) return false;
    end += field.count * field_type_bytes(field.type);
  }
  return end == sizeof(T);
}

/// FNV-1a, 64 bit (Fowler, Noll, Vo: draft-eastlake-fnv).
constexpr std::uint64_t fnv1a(std::string_view text, std::uint64_t hash) noexcept {
  for (const char c : text) hash = (hash ^ static_cast<std::uint8_t>(c)) * 0x100000001b3ULL;
  return hash;
}
constexpr std::uint64_t fnv1a(std::uint64_t number, std::uint64_t hash) noexcept {
  for (int i = 0; i < 8; ++i, number >>= 8) hash = (hash ^ (number & 0xff)) * 0x100000001b3ULL;
  return hash;
}

}  // namespace detail

/// Trivially copyable, pointer-free, a multiple of 8 bytes, every byte described by a field.
// clang-format off
template <class T>
concept Sample = std::is_trivially_copyable_v<T> && std::is_standard_layout_v<T> &&
                 std::is_default_constructible_v<T> && sizeof(T) % 8 == 0 && alignof(T) <= 8 && requires {
                   SampleTraits<T>::kName;
                   SampleTraits<T>::kFields;
                 } && detail::fields_tile_sample<T>();
// clang-format on

/// Consecutive fields of a sample that are the columns of one table: arrays of `rows` entries, of which the first ones
/// carry something, as many as the u32 at `count_offset` says. A reader may leave out the others.
struct Table {
  std::uint32_t count_offset;
  std::uint32_t begin_offset;  ///< Of the first column.
  std::uint32_t end_offset;    ///< Behind the last.
  std::uint32_t rows;
};

/// A row of SampleTraits<T>::kTables.
#define RTBUS_TABLE(Type, count, first, last, rows)                                                       \
  ::rtbus::Table {                                                                                        \
    static_cast<std::uint32_t>(offsetof(Type, count)), static_cast<std::uint32_t>(offsetof(Type, first)), \
        static_cast<std::uint32_t>(offsetof(Type, last) + sizeof(Type::last)), rows                       \
  }

namespace detail {

/// One column of a table, and where its number of used rows stands.
struct Column {
  std::uint32_t offset, row_bytes, rows, count_offset;
};

/// Bytes before the first table.
template <class T>
consteval std::uint32_t head_bytes() {
  return SampleTraits<T>::kTables.front().begin_offset;
}

/// True when the tables fill the sample behind its head without a gap, whose fields hold their counts.
template <class T>
consteval bool tables_fit_sample() {
  std::uint32_t end = head_bytes<T>();
  for (const Table& table : SampleTraits<T>::kTables) {
    if (table.begin_offset != end || table.rows == 0 || table.count_offset % 4 != 0 ||
        table.count_offset + 4 > head_bytes<T>()) {
      return false;
    }
    bool counted = false;
    for (const Field& field : SampleTraits<T>::kFields) {
      counted |= field.offset == table.count_offset && field.type == FieldType::kU32 && field.count == 1;
      if (field.offset < table.begin_offset || field.offset >= table.end_offset) continue;
      if (field.offset % 8 != 0 || field.count % table.rows != 0) return false;
    }
    if (!counted) return false;
    end = table.end_offset;
  }
  return end == sizeof(T) && head_bytes<T>() % 8 == 0;
}

/// The columns of all tables.
template <class T>
consteval auto columns_of() {
  constexpr std::size_t kColumns = [] {
    std::size_t count = 0;
    for (const Field& field : SampleTraits<T>::kFields) count += field.offset >= head_bytes<T>() ? 1 : 0;
    return count;
  }();
  std::array<Column, kColumns> out{};
  std::size_t next = 0;
  for (const Field& field : SampleTraits<T>::kFields) {
    for (const Table& table : SampleTraits<T>::kTables) {
      if (field.offset < table.begin_offset || field.offset >= table.end_offset) continue;
      out[next++] = {field.offset, field.count / table.rows * field_type_bytes(field.type), table.rows,
                     table.count_offset};
    }
  }
  return out;
}

}  // namespace detail

/// A sample that is a head and tables.
template <class T>
concept TabularSample = Sample<T> && requires {
  SampleTraits<T>::kTables;
} && detail::tables_fit_sample<T>();

/// Of a type that is known by its description only.
constexpr std::uint64_t type_hash(std::string_view name, std::uint32_t bytes, std::span<const Field> fields) noexcept {
  std::uint64_t hash = detail::fnv1a(name, 0xcbf29ce484222325ULL);
  hash = detail::fnv1a(bytes, hash);
  for (const Field& field : fields) {
    hash = detail::fnv1a(field.name, hash);
    hash = detail::fnv1a(field.unit, hash);
    hash = detail::fnv1a(static_cast<std::uint64_t>(field.type), hash);
    hash = detail::fnv1a(field.offset, hash);
    hash = detail::fnv1a(field.count, hash);
  }
  return hash;
}

/// Changes whenever name, size or any field of T changes; both ends of a topic compare it.
template <Sample T>
consteval std::uint64_t type_hash() {
  return type_hash(SampleTraits<T>::kName, sizeof(T), SampleTraits<T>::kFields);
}

/// A sample as it comes off a topic.
template <class T>
struct Stamped {
  std::uint64_t sequence = 0;  ///< Number of this sample in its topic, from 1; a new writer goes on counting.
  std::uint64_t stamp_ns = 0;  ///< CLOCK_MONOTONIC at publish, as given by the writer [ns].
  T value{};
};

}  // namespace rtbus
