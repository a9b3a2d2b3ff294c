#include "rtbus/config/document.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <utility>

#include "rtbus/config/detail/overrides.hpp"
#include "rtbus/config/detail/wording.hpp"
#include "rtbus/config/detail/yaml_tree.hpp"

namespace rtbus::config {

namespace fs = std::filesystem;
using detail::Detour;
using detail::Entry;
using detail::Node;
using detail::shown;

namespace {

/// One file, overrides applied. Shared by all Maps that stand in it.
struct Document {
  Node root;
  std::string file;  ///< As the user knows it.
  std::vector<Detour> detours;
};

std::shared_ptr<const Document> read_document(const std::string& file, const std::string& prefix,
                                              std::vector<detail::Assignment> assignments) {
  auto document = std::make_shared<Document>();
  document->file = file;
  document->root = detail::read_yaml_file(file, file);
  if (document->root.kind == Node::Kind::kNull) {
    throw Error(file + ": is empty; a configuration begins with its schema, for example 'schema: session/1'");
  }
  if (document->root.kind != Node::Kind::kMap) {
    throw Error(file + ":" + std::to_string(document->root.line) + ": is " + kind_of(document->root) +
                "; a configuration is a map of keys, 'key: value'");
  }
  document->detours = detail::apply(std::move(assignments), prefix, document->root);
  return document;
}

/// "number" for the error when a value is missing.
std::string wanted_number(Range range, std::string_view key) {
  return "a number, " + detail::range_text(range.low, range.high, key);
}

}  // namespace

struct Map::Impl {
  std::shared_ptr<const Document> document;
  const Node* node;  ///< In the document.
  int line;
  std::string path;
  std::vector<std::string> known;  ///< Keys asked for, in the order of asking.

  [[nodiscard]] std::string where(int at_line) const {
    return document->file + ":" + (at_line == detail::kFromOverride ? "--set" : std::to_string(at_line)) + ": ";
  }
  [[nodiscard]] std::string path_of(std::string_view key) const { return detail::path_below(path, std::string(key)); }

  /// The key's entry, unless absent or null. Asking makes it known.
  const Entry* ask(std::string_view key) {
    if (std::find(known.begin(), known.end(), key) == known.end()) {
      known.emplace_back(key);
    }
    const Entry* entry = node->find(key);
    return entry == nullptr || entry->value.kind == Node::Kind::kNull ? nullptr : entry;
  }

  /// For keys with a plain value: an override that wanted to go below it is an error.
  const Entry* ask_plain(std::string_view key) {
    const Entry* entry = ask(key);
    if (entry != nullptr) {
      refuse_detours(path_of(key), entry->value);
    }
    return entry;
  }

  void refuse_detours(const std::string& at, const Node& value) const {
    for (const Detour& detour : document->detours) {
      if (detour.at == at || detour.at.starts_with(at + ".")) {
        throw Error("--set " + shown(detour.rest.whole.path + "=" + detour.rest.whole.value) + ": leads nowhere: " +
                    shown(at) + " = " + shown(value) + " is " + kind_of(value) + " and has no keys");
      }
    }
  }

  [[noreturn]] void fail_missing(std::string_view key, const std::string& wanted) const {
    // The usual reason for a missing key is the same key with a slip: say so here, finish() will not be reached.
    std::vector<std::string> unknown;
    for (const Entry& entry : node->entries) {
      if (std::find(known.begin(), known.end(), entry.key) == known.end()) {
        unknown.push_back(entry.key);
      }
    }
    const std::optional<std::string> slip = detail::nearest(key, unknown);
    const int at_line = slip ? node->find(*slip)->line : line;  // there it is to be mended
    throw Error(where(at_line) + (path.empty() ? "this file" : path) + " needs the key " + std::string(key) + " (" +
                wanted + ")" +
                (slip ? "; unknown key " + shown(*slip) + "; did you mean " + std::string(key) + "?" : ""));
  }

  std::string value_sentence(const std::string& at, int at_line, const Node& value, const std::string& problem) const {
    return where(at_line) + at + " = " + shown(value) + " " + problem;
  }

  [[noreturn]] void fail_value(const std::string& at, int at_line, const Node& value,
                               const std::string& problem) const {
    throw Error(value_sentence(at, at_line, value, problem));
  }

  double to_number(const std::string& at, int at_line, const Node& value, Range range, std::string_view key) const {
    const std::optional<double> parsed =
        value.kind == Node::Kind::kScalar ? detail::parse_number(value.scalar) : std::nullopt;
    const std::string choose = "; choose " + detail::range_text(range.low, range.high, key);
    if (!parsed) {
      fail_value(at, at_line, value, "is not a number" + choose);
    }
    const double number = parsed.value_or(0.0);
    if (value.quoted) {
      fail_value(at, at_line, value, "is not a number but text; remove the quotes");
    }
    if (!std::isfinite(number)) {
      fail_value(at, at_line, value, "is not a finite number" + choose);
    }
    if (number < range.low) {
      fail_value(at, at_line, value, "is below " + shown(range.low) + choose);
    }
    if (number > range.high) {
      fail_value(at, at_line, value, "is above " + shown(range.high) + choose);
    }
    return number;
  }

  const std::string& to_text(const Entry& entry, const std::string& problem) const {
    if (entry.value.kind != Node::Kind::kScalar) {
      fail_value(path_of(entry.key), entry.line, entry.value, problem);
    }
    return entry.value.scalar;
  }

  std::string to_choice(const Entry& entry, const std::vector<std::string>& allowed) const {
    const std::string list = detail::joined(allowed);
    const std::string& word = to_text(entry, "is not a word; choose " + list);
    if (std::find(allowed.begin(), allowed.end(), word) == allowed.end()) {
      fail_value(path_of(entry.key), entry.line, entry.value,
                 allowed.size() == 1 ? "is not supported; this build knows " + list
                                     : "is not known" + detail::did_you_mean(word, allowed) + "; choose " + list);
    }
    return word;
  }

  std::vector<std::string> to_choices(const Entry& entry, const std::vector<std::string>& allowed) const {
    const std::string at = path_of(entry.key), list = detail::joined(allowed);
    if (entry.value.kind != Node::Kind::kList) {
      fail_value(at, entry.line, entry.value, "is not a list; write " + entry.key + ": [" + allowed.front() + "]");
    }
    std::vector<std::string> out;
    for (std::size_t i = 0; i < entry.value.items.size(); ++i) {
      const Node& item = entry.value.items[i];
      const bool is_known =
          item.kind == Node::Kind::kScalar && std::find(allowed.begin(), allowed.end(), item.scalar) != allowed.end();
      if (!is_known) {
        fail_value(detail::path_below(at, std::to_string(i)), item.line, item,
                   "is not known" + detail::did_you_mean(item.scalar, allowed) + "; choose " + list);
      }
      out.push_back(item.scalar);
    }
    return out;
  }

  std::vector<double> to_numbers(const Entry& entry, std::size_t count, Range range) const {
    const std::string at = path_of(entry.key);
    if (entry.value.kind != Node::Kind::kList || entry.value.items.size() != count) {
      fail_value(at, entry.line, entry.value,
                 "is not a list of " + std::to_string(count) + " numbers; write " + entry.key + ": [" +
                     (count == 3   ? "x, y, z"
                      : count == 4 ? "w, x, y, z"
                                   : "…") +
                     "]");
    }
    std::vector<double> out;
    for (std::size_t i = 0; i < count; ++i) {
      const Node& item = entry.value.items[i];
      out.push_back(to_number(detail::path_below(at, std::to_string(i)), item.line, item, range, entry.key));
    }
    return out;
  }

  Map to_map(const Entry& entry) const {
    if (entry.value.kind != Node::Kind::kMap) {
      fail_value(path_of(entry.key), entry.line, entry.value, "is not a map; write its keys indented below it");
    }
    return make(document, entry.value, entry.line, path_of(entry.key));
  }

  /// The file that a value names, relative to the folder of the file it stands in.
  std::string to_file_name(const Entry& entry) const {
    const std::string& name = to_text(entry, "is not the name of a file");
    if (name.empty()) {
      fail_value(path_of(entry.key), entry.line, entry.value, "is not the name of a file");
    }
    return (fs::path(document->file).parent_path() / name).lexically_normal().string();
  }

  static Map make(std::shared_ptr<const Document> document, const Node& node, int line, std::string path) {
    return Map(std::make_shared<Impl>(Impl{std::move(document), &node, line, std::move(path), {}}));
  }
};

Map::Map(Map&&) noexcept = default;
Map& Map::operator=(Map&&) noexcept = default;
Map::~Map() = default;
Map::Map(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}

bool Map::has(std::string_view key) const { return impl_->ask(key) != nullptr; }

bool Map::has_map(std::string_view key) const {
  const Entry* const entry = impl_->ask(key);
  return entry != nullptr && entry->value.kind == Node::Kind::kMap;
}

std::vector<std::string> Map::keys() const {
  std::vector<std::string> out;
  for (const Entry& entry : impl_->node->entries) {
    out.push_back(entry.key);
  }
  return out;
}

double Map::number(std::string_view key, Range range) {
  const Entry* entry = impl_->ask_plain(key);
  if (entry == nullptr) {
    impl_->fail_missing(key, wanted_number(range, key));
  }
  return impl_->to_number(impl_->path_of(key), entry->line, entry->value, range, key);
}

double Map::number(std::string_view key, Range range, double fallback) {
  return has(key) ? number(key, range) : fallback;
}

std::int64_t Map::integer(std::string_view key, std::int64_t low, std::int64_t high, std::int64_t fallback) {
  const Entry* entry = impl_->ask_plain(key);
  if (entry == nullptr) {
    return fallback;
  }
  const Range range{static_cast<double>(low), static_cast<double>(high)};
  const double number = impl_->to_number(impl_->path_of(key), entry->line, entry->value, range, key);
  // Only the digits themselves carry all 64 bits; 2.0 and 2e3 are whole numbers as well.
  std::int64_t whole = 0;
  const std::string& text = entry->value.scalar;
  const char* const end = text.data() + text.size();
  if (const auto [last, error] = std::from_chars(text.data(), end, whole); error != std::errc{} || last != end) {
    constexpr double kExact = 9007199254740992.0;  // 2^53
    if (number != std::floor(number) || std::abs(number) > kExact) {
      impl_->fail_value(impl_->path_of(key), entry->line, entry->value,
                        "is not a whole number; choose " + detail::range_text(range.low, range.high, key));
    }
    whole = static_cast<std::int64_t>(number);
  }
  return std::clamp(whole, low, high);  // the range was checked in double, which rounds beyond 2^53
}

bool Map::boolean(std::string_view key, bool fallback) {
  const Entry* entry = impl_->ask_plain(key);
  if (entry == nullptr) {
    return fallback;
  }
  const Node& value = entry->value;
  if (value.kind != Node::Kind::kScalar || value.quoted || (value.scalar != "true" && value.scalar != "false")) {
    impl_->fail_value(impl_->path_of(key), entry->line, value, "is not a truth value; choose true or false");
  }
  return value.scalar == "true";
}

std::string Map::text(std::string_view key) {
  const Entry* entry = impl_->ask_plain(key);
  if (entry == nullptr) {
    impl_->fail_missing(key, "text");
  }
  return impl_->to_text(*entry, "is not text");
}

std::string Map::text(std::string_view key, std::string_view fallback) {
  return has(key) ? text(key) : std::string(fallback);
}

std::string Map::choice(std::string_view key, const std::vector<std::string>& allowed) {
  const Entry* entry = impl_->ask_plain(key);
  if (entry == nullptr) {
    impl_->fail_missing(key, (allowed.size() == 1 ? "" : "one of ") + detail::joined(allowed));
  }
  return impl_->to_choice(*entry, allowed);
}

std::string Map::choice(std::string_view key, const std::vector<std::string>& allowed, std::string_view fallback) {
  return has(key) ? choice(key, allowed) : std::string(fallback);
}

std::vector<std::string> Map::choices(std::string_view key, const std::vector<std::string>& allowed) {
  const Entry* entry = impl_->ask_plain(key);
  return entry == nullptr ? std::vector<std::string>{} : impl_->to_choices(*entry, allowed);
}

std::vector<double> Map::numbers(std::string_view key, std::size_t count, Range range) {
  const Entry* entry = impl_->ask_plain(key);
  if (entry == nullptr) {
    impl_->fail_missing(key, "a list of " + std::to_string(count) + " numbers");
  }
  return impl_->to_numbers(*entry, count, range);
}

std::vector<double> Map::numbers(std::string_view key, std::size_t count, Range range, std::vector<double> fallback) {
  return has(key) ? numbers(key, count, range) : std::move(fallback);
}

std::vector<std::string> Map::texts(std::string_view key) {
  std::vector<std::string> out;
  const Entry* entry = impl_->ask(key);
  if (entry == nullptr) return out;
  const char* const wanted = "is not a list of texts; write for example [python3, wall.py]";
  if (entry->value.kind != Node::Kind::kList) {
    impl_->fail_value(impl_->path_of(key), entry->line, entry->value, wanted);
  }
  for (const Node& item : entry->value.items) {
    if (item.kind != Node::Kind::kScalar || item.scalar.empty()) {
      impl_->fail_value(impl_->path_of(key), item.line, item, wanted);
    }
    out.push_back(item.scalar);
  }
  return out;
}

Map Map::map(std::string_view key) {
  const Entry* entry = impl_->ask(key);
  if (entry == nullptr) {
    impl_->fail_missing(key, "a map");
  }
  return impl_->to_map(*entry);
}

std::optional<Map> Map::optional_map(std::string_view key) {
  return has(key) ? std::optional<Map>(map(key)) : std::nullopt;
}

std::vector<Map> Map::list_of_maps(std::string_view key) {
  std::vector<Map> out;
  const Entry* entry = impl_->ask(key);
  if (entry == nullptr) {
    return out;
  }
  const std::string at = impl_->path_of(key);
  if (entry->value.kind != Node::Kind::kList) {
    impl_->fail_value(at, entry->line, entry->value, "is not a list; write one '- …' line per item");
  }
  for (std::size_t i = 0; i < entry->value.items.size(); ++i) {
    const Node& item = entry->value.items[i];
    const std::string item_path = detail::path_below(at, std::to_string(i));
    if (item.kind != Node::Kind::kMap) {
      impl_->fail_value(item_path, item.line, item, "is not a map of keys");
    }
    out.push_back(Impl::make(impl_->document, item, item.line, item_path));
  }
  return out;
}

Map Map::file_or_map(std::string_view key) {
  const Entry* entry = impl_->ask(key);
  if (entry == nullptr) {
    impl_->fail_missing(key, "a map, or the name of a YAML file");
  }
  if (entry->value.kind == Node::Kind::kMap) {
    return impl_->to_map(*entry);
  }
  const std::string at = impl_->path_of(key);
  const std::string file = impl_->to_file_name(*entry);
  std::vector<detail::Assignment> assignments;
  for (const Detour& detour : impl_->document->detours) {
    if (detour.at == at) {
      assignments.push_back(detour.rest);
    }
  }
  // A name that leads nowhere is a mistake in this file; what is wrong inside the other is told with that file's line.
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) {
    try {
      (void)read_document(file, at, {});
    } catch (const Error& error) {
      impl_->fail_value(at, entry->line, entry->value, "cannot be read: " + std::string(error.what()));
    }
  }
  std::shared_ptr<const Document> document = read_document(file, at, std::move(assignments));
  const Node& root = document->root;
  return Impl::make(std::move(document), root, root.line, at);
}

std::string Map::existing_file(std::string_view key) {
  const Entry* entry = impl_->ask_plain(key);
  if (entry == nullptr) {
    impl_->fail_missing(key, "the name of a file");
  }
  const std::string file = impl_->to_file_name(*entry);
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) {
    impl_->fail_value(impl_->path_of(key), entry->line, entry->value,
                      "names no file (looked for " + fs::absolute(file).lexically_normal().string() +
                          "); names are relative to the folder of " + impl_->document->file);
  }
  return fs::absolute(file).lexically_normal().string();
}

std::string Map::sentence(std::string_view key, const std::string& problem) const {
  const Entry* entry = impl_->node->find(key);
  const std::string at = key.empty() ? impl_->path : impl_->path_of(key);
  if (entry == nullptr) return impl_->where(impl_->line) + (at.empty() ? "" : at + " ") + problem;
  if (entry->value.kind == Node::Kind::kMap) return impl_->where(entry->line) + at + " " + problem;
  return impl_->value_sentence(at, entry->line, entry->value, problem);
}

std::string Map::place() const { return impl_->where(impl_->line) + impl_->path; }

void Map::fail(std::string_view key, const std::string& problem) const { throw Error(sentence(key, problem)); }

void Map::finish() {
  for (const Entry& entry : impl_->node->entries) {
    if (std::find(impl_->known.begin(), impl_->known.end(), entry.key) == impl_->known.end()) {
      const std::string known =
          impl_->known.empty() ? "no key is known here" : "known here: " + detail::joined(impl_->known);
      throw Error(impl_->where(entry.line) + shown(impl_->path_of(entry.key)) + " is not a known key" +
                  detail::did_you_mean(entry.key, impl_->known) + " (" + known + ")");
    }
  }
}

std::string Map::path() const { return impl_->path; }
std::string Map::file() const { return impl_->document->file; }

Map load(const std::string& file, const std::vector<Override>& overrides) {
  std::vector<detail::Assignment> assignments;
  assignments.reserve(overrides.size());
  for (const Override& override : overrides) {
    assignments.push_back({detail::split_path(override.path), override});
  }
  std::shared_ptr<const Document> document = read_document(file, "", std::move(assignments));
  const Node& root = document->root;
  return Map::Impl::make(std::move(document), root, root.line, "");
}

}  // namespace rtbus::config
