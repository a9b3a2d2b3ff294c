#pragma once
/// @file wording.hpp
/// How values, ranges, units and suggestions look in messages.
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtbus/config/detail/yaml_tree.hpp"

namespace rtbus::config::detail {

/// Text made safe for a terminal: control characters escaped, at most 60 bytes.
[[nodiscard]] std::string shown(std::string_view text);

/// A value as it was written: numbers and words of YAML bare, text in quotes, a map as "{…}".
[[nodiscard]] std::string shown(const Node& value);

/// Shortest decimal form that reads back as the same number: "0.5", "20000".
[[nodiscard]] std::string shown(double number);

/// "a number", "text", "a list", … for messages.
[[nodiscard]] std::string kind_of(const Node& value);

/// A plain decimal number, '.' as the point in every locale; none when `text` is anything else. May be infinite or NaN.
[[nodiscard]] std::optional<double> parse_number(std::string_view text);

/// Unit from a key's suffix: " Hz" for rate_hz, " N/m" for stiffness_n_per_m; empty when it has none.
[[nodiscard]] std::string unit_of(std::string_view key);

/// "1…20000 Hz", "at least 0 N", "a finite number".
[[nodiscard]] std::string range_text(double low, double high, std::string_view key);

/// The candidate with the fewest letters to change, if few enough for a slip. The same for candidates in any order.
[[nodiscard]] std::optional<std::string> nearest(std::string_view word, const std::vector<std::string>& candidates);

/// "; did you mean rate_hz?", or empty when nothing is near.
[[nodiscard]] std::string did_you_mean(std::string_view word, const std::vector<std::string>& candidates);

/// "a, b, c"
[[nodiscard]] std::string joined(const std::vector<std::string>& words);

}  // namespace rtbus::config::detail
