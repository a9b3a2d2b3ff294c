#pragma once
/// @file document.hpp
/// Checked reading of YAML: every key is asked for by name, type, unit and range; what nobody asked for is an error
/// that suggests the nearest known key. Errors name file, line, key, value, limit and remedy, once.
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace rtbus::config {

/// What is wrong with a configuration; `what()` is the whole sentence for the user:
/// `scenes/wall.yaml:14: physics.rate_hz = 0 is below 1; choose 1…20000 Hz`.
/// Thrown inside the readers, caught in main() and tests.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An assignment from the command line, `--set key.path=value`. List items are named by index or by their `name`:
/// `haptic.0.rate_hz=2000` or `haptic.haptic1.rate_hz=2000`. A path may lead into a file that the document refers to:
/// `haptic.0.device.hand.type=none`. The value is read as YAML: `2000`, `fast`, `[0, 1, 0]`, `null`. It replaces what
/// stands there or creates the key; whether that key makes sense is judged like any other by the reader of its map.
/// Short paths are applied first, so `haptic.0.device=…` and `haptic.0.device.model=…` may come in any order.
struct Override {
  std::string path;
  std::string value;
};

/// Splits "key.path=value"; throws Error with the usage when there is no '='.
[[nodiscard]] Override parse_override(std::string_view text);

/// Both ends belong to the range.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};

/// A YAML map that is being read. Keys are consumed by asking; finish() complains about the rest. A key whose value is
/// null counts as absent. Keeps its document alive; copies nothing. Numbers are finite, with '.' as point in any
/// locale.
class Map {
 public:
  struct Impl;  ///< Private to document.cpp.

  Map(Map&&) noexcept;
  Map& operator=(Map&&) noexcept;
  ~Map();

  /// True when the key is there and not null. Asking makes the key a known one.
  [[nodiscard]] bool has(std::string_view key) const;

  /// True when a map stands at the key, and not a plain value.
  [[nodiscard]] bool has_map(std::string_view key) const;

  /// The keys that are there, in the file's order. Asking for this list does not make them known.
  [[nodiscard]] std::vector<std::string> keys() const;

  /// Required values: a missing key is an error that says what belongs there.
  [[nodiscard]] double number(std::string_view key, Range range);
  [[nodiscard]] std::string text(std::string_view key);
  [[nodiscard]] std::string choice(std::string_view key, const std::vector<std::string>& allowed);
  [[nodiscard]] std::vector<double> numbers(std::string_view key, std::size_t count, Range range = {});
  [[nodiscard]] Map map(std::string_view key);

  /// Optional values with their default.
  [[nodiscard]] double number(std::string_view key, Range range, double fallback);
  [[nodiscard]] std::int64_t integer(std::string_view key, std::int64_t low, std::int64_t high, std::int64_t fallback);
  [[nodiscard]] bool boolean(std::string_view key, bool fallback);
  [[nodiscard]] std::string text(std::string_view key, std::string_view fallback);
  [[nodiscard]] std::string choice(std::string_view key, const std::vector<std::string>& allowed,
                                   std::string_view fallback);
  [[nodiscard]] std::vector<double> numbers(std::string_view key, std::size_t count, Range range,
                                            std::vector<double> fallback);
  /// A list of words, each of them one of `allowed`; empty when the key is absent.
  [[nodiscard]] std::vector<std::string> choices(std::string_view key, const std::vector<std::string>& allowed);
  [[nodiscard]] std::optional<Map> optional_map(std::string_view key);
  [[nodiscard]] std::vector<Map> list_of_maps(std::string_view key);   ///< Empty when the key is absent.
  [[nodiscard]] std::vector<std::string> texts(std::string_view key);  ///< Likewise: a list of texts.

  /// The map behind `key`: written in place, or in the file whose name stands there (relative to this file's folder).
  [[nodiscard]] Map file_or_map(std::string_view key);

  /// A path that stands at `key`, relative to this file's folder, made absolute; the file must exist.
  [[nodiscard]] std::string existing_file(std::string_view key);

  /// Error at `key` (its line if it is there, else this map's): "<file>:<line>: <path.key> = <value> <problem>".
  [[noreturn]] void fail(std::string_view key, const std::string& problem) const;

  /// The sentence that fail() would throw, for a warning.
  [[nodiscard]] std::string sentence(std::string_view key, const std::string& problem) const;

  /// "<file>:<line>: <path>": where this map stands, for a message about all of it.
  [[nodiscard]] std::string place() const;

  /// Error when keys are left that nobody asked for, or when an override led below a value that has nothing below it.
  /// Call it at the end of every reader.
  void finish();

  [[nodiscard]] std::string path() const;  ///< "haptic.0.device", for messages.
  [[nodiscard]] std::string file() const;  ///< Name of the file this map stands in, as given by the user.

 private:
  friend Map load(const std::string& file, const std::vector<Override>& overrides);
  explicit Map(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl_;
};

/// Reads `file` and applies the overrides. One that names a list item which does not exist fails here; one with a wrong
/// key fails in finish() of the map it led to, so that each program judges the part that it reads.
[[nodiscard]] Map load(const std::string& file, const std::vector<Override>& overrides = {});

}  // namespace rtbus::config
