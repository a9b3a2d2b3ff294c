#pragma once
/// @file field_format.hpp
/// A sample of any topic as text, by the field descriptors that the topic carries: YAML blocks for people, CSV and JSON
/// for programs. Nothing here knows a message type.
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"
#include "tools/cli/common/choose.hpp"

namespace tools {

/// One sample, as RawReader holds it.
struct RawSample {
  std::uint64_t sequence = 0;
  std::uint64_t stamp_ns = 0;
  std::span<const std::byte> bytes;
};

using FieldList = std::vector<rtbus::Segment::OwnedField>;

/// The fields called `wanted`, in that order; all of them when it is empty. "position_m[1]" is one element of a field.
/// An unknown name is refused with those that exist.
[[nodiscard]] rtbus::Result<FieldList, Refusal> select_fields(const FieldList& fields,
                                                              const std::vector<std::string>& wanted);

/// A YAML document: figures to six digits, the unit as a comment.
///
///     --- # 1234 at 56.789012345 s
///     position_m: [0.0123, -0.00171, 0]  # m
[[nodiscard]] std::string format_block(const RawSample& sample, const FieldList& fields);

/// "sequence [1],stamp_ns [ns],position_m[0] [m],…" without line end. Text fields have no unit.
[[nodiscard]] std::string csv_header(const FieldList& fields);

/// The row to it: every double reads back to the same value; text is quoted where it must be (RFC 4180).
[[nodiscard]] std::string csv_row(const RawSample& sample, const FieldList& fields);

/// {"sequence": …, "stamp_ns": …, fields in order}; a field of several elements is an array. JSON has no NaN and no
/// infinity: they become null.
[[nodiscard]] nlohmann::ordered_json json_sample(const RawSample& sample, const FieldList& fields);

/// One line of JSON. Bytes that are not UTF-8 are replaced, never refused.
[[nodiscard]] std::string json_line(const nlohmann::ordered_json& value);

}  // namespace tools
