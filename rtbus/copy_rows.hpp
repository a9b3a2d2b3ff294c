#pragma once
/// @file copy_rows.hpp
/// What a reader of rows copies, without a ring.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "rtbus/sample.hpp"

namespace rtbus {

/// Copies the head of a sample and its rows in use, as Reader::read_latest_rows() does. What stands in the other rows
/// of `to` stays there. @realtime Yes.
template <TabularSample T>
void copy_rows(const T& from, T& to) noexcept {
  static constexpr auto kColumns = detail::columns_of<T>();
  const auto* const source = reinterpret_cast<const std::byte*>(&from);
  auto* const target = reinterpret_cast<std::byte*>(&to);
  std::memcpy(target, source, detail::head_bytes<T>());
  for (const detail::Column& column : kColumns) {
    std::uint32_t used = 0;
    std::memcpy(&used, source + column.count_offset, sizeof used);
    const std::size_t bytes = static_cast<std::size_t>(std::min(used, column.rows)) * column.row_bytes;
    std::memcpy(target + column.offset, source + column.offset, (bytes + 7) / 8 * 8);  // whole words
  }
}

}  // namespace rtbus
