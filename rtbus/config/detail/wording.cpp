#include "rtbus/config/detail/wording.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numeric>
#include <utility>

namespace rtbus::config::detail {
namespace {

constexpr std::size_t kShownBytes = 60;

/// Levenshtein: insertions, deletions and replacements that turn one word into the other.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row[b.size()];
}

/// Longest suffix first: damping_n_s_per_m ends in _m too.
constexpr std::array<std::pair<std::string_view, std::string_view>, 22> kUnits{{
    {"_n_s_per_m", "N·s/m"},
    {"_n_per_ms", "N/ms"},
    {"_n_per_m", "N/m"},
    {"_rad_s", "rad/s"},
    {"_m_s2", "m/s²"},
    {"_m_s", "m/s"},
    {"_mib", "MiB"},
    {"_deg", "°"},
    {"_rad", "rad"},
    {"_hz", "Hz"},
    {"_kg", "kg"},
    {"_mm", "mm"},
    {"_um", "µm"},
    {"_ms", "ms"},
    {"_us", "µs"},
    {"_ns", "ns"},
    {"_n_m", "N·m"},
    {"_j", "J"},
    {"_w", "W"},
    {"_n", "N"},
    {"_s", "s"},
    {"_m", "m"},
}};

/// "mass" of "mass_kg".
std::string_view without_unit(std::string_view key) {
  for (const auto& entry : kUnits) {
    if (key.ends_with(entry.first)) return key.substr(0, key.size() - entry.first.size());
  }
  return key;
}

}  // namespace

std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (out.size() >= kShownBytes && (byte & 0xc0U) != 0x80U) {  // never cuts within a UTF-8 sequence
      return out + "…";
    }
    if (byte < 0x20U || byte == 0x7fU) {
      constexpr std::string_view kHex = "0123456789abcdef";
      out += {'\\', 'x', kHex[byte >> 4U], kHex[byte & 15U]};
    } else {
      out += c;
    }
  }
  return out;
}

std::string shown(double number) {
  std::array<char, 32> digits{};
  const double magnitude = std::abs(number);
  // Fixed where a person would write it so; to_chars alone prefers 2e+04 to 20000.
  const bool fixed = number == 0.0 || (magnitude >= 1e-5 && magnitude < 1e9);
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), number,
                                          fixed ? std::chars_format::fixed : std::chars_format::general);
  return error == std::errc{} ? std::string(digits.data(), end) : std::to_string(number);
}

std::string shown(const Node& value) {
  switch (value.kind) {
    case Node::Kind::kNull:
      return "null";
    case Node::Kind::kMap:
      return "{…}";
    case Node::Kind::kList: {
      std::vector<std::string> words;
      for (const Node& item : value.items) {
        words.push_back(item.kind == Node::Kind::kList ? "[…]" : shown(item));
      }
      return shown("[" + joined(words) + "]");
    }
    case Node::Kind::kScalar:
      break;
  }
  const bool bare = !value.quoted && (kind_of(value) != "text");
  return bare ? shown(value.scalar) : "\"" + shown(value.scalar) + "\"";
}

std::string kind_of(const Node& value) {
  switch (value.kind) {
    case Node::Kind::kNull:
      return "null";
    case Node::Kind::kMap:
      return "a map";
    case Node::Kind::kList:
      return "a list";
    case Node::Kind::kScalar:
      break;
  }
  if (!value.quoted && parse_number(value.scalar)) {
    return "a number";
  }
  return !value.quoted && (value.scalar == "true" || value.scalar == "false") ? "true or false" : "text";
}

std::optional<double> parse_number(std::string_view text) {
  const bool negative = !text.empty() && text.front() == '-';
  std::string_view digits = text;
  if (!digits.empty() && (digits.front() == '-' || digits.front() == '+')) {
    digits.remove_prefix(1);
  }
  // YAML's own spellings of what is no finite number; callers refuse them with a reason.
  if (digits == ".inf" || digits == ".Inf" || digits == ".INF" || digits == "inf") {
    return negative ? -HUGE_VAL : HUGE_VAL;
  }
  if (text == ".nan" || text == ".NaN" || text == ".NAN" || text == "nan") {
    return std::nan("");
  }
  // from_chars also reads "infinity" and a second sign; a number starts with a digit or a point.
  if (digits.empty() || !((digits.front() >= '0' && digits.front() <= '9') || digits.front() == '.')) {
    return std::nullopt;
  }
  double magnitude = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), magnitude);
  if (end != digits.data() + digits.size() || error == std::errc::invalid_argument) {
    return std::nullopt;
  }
  if (error == std::errc::result_out_of_range) {
    magnitude = HUGE_VAL;  // also for 1e-999: a number that cannot be held is refused, not rounded
  }
  return negative ? -magnitude : magnitude;
}

std::string unit_of(std::string_view key) {
  for (const auto& [suffix, unit] : kUnits) {
    if (key.ends_with(suffix)) {
      return " " + std::string(unit);
    }
  }
  return "";
}

std::string range_text(double low, double high, std::string_view key) {
  if (std::isinf(low) && std::isinf(high)) {
    const std::string unit = unit_of(key);
    return unit.empty() ? "a finite number" : "a finite number of" + unit;
  }
  if (std::isinf(high)) {
    return "at least " + shown(low) + unit_of(key);
  }
  if (std::isinf(low)) {
    return "at most " + shown(high) + unit_of(key);
  }
  return shown(low) + "…" + shown(high) + unit_of(key);
}

std::optional<std::string> nearest(std::string_view word, const std::vector<std::string>& candidates) {
  const std::string* best = nullptr;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;  // farther is no likely slip
  for (const std::string& candidate : candidates) {
    if (candidate.size() > 200 || word.size() > 200) {
      continue;
    }
    // A key without its unit, or with another one, is the likeliest slip, however long the unit is.
    const bool same_but_unit = word != candidate && without_unit(word) == without_unit(candidate);
    const std::size_t distance = same_but_unit ? 1 : edit_distance(word, candidate);
    // A word replaced letter by letter is no suggestion; the alphabet decides between equals, not the order given.
    const bool some_letter_kept = distance < std::max(word.size(), candidate.size());
    if (some_letter_kept &&
        (distance < best_distance || (best != nullptr && distance == best_distance && candidate < *best))) {
      best = &candidate;
      best_distance = distance;
    }
  }
  return best == nullptr ? std::nullopt : std::optional(*best);
}

std::string did_you_mean(std::string_view word, const std::vector<std::string>& candidates) {
  const std::optional<std::string> best = nearest(word, candidates);
  return best ? "; did you mean " + shown(*best) + "?" : "";
}

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& word : words) {
    out += (out.empty() ? "" : ", ") + word;
  }
  return out;
}

}  // namespace rtbus::config::detail
