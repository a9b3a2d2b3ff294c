#include "rtbus/config/detail/overrides.hpp"

#include <algorithm>
#include <charconv>
#include <optional>

#include "rtbus/config/detail/wording.hpp"

namespace rtbus::config::detail {
namespace {

std::string text_of(const Override& override) { return "--set " + shown(override.path + "=" + override.value); }

/// Marks everything in a value as given on the command line.
void mark_as_override(Node& node) {
  node.line = kFromOverride;
  for (Node& item : node.items) {
    mark_as_override(item);
  }
  for (Entry& entry : node.entries) {
    entry.line = kFromOverride;
    mark_as_override(entry.value);
  }
}

Node value_of(const Override& override) {
  Node value;
  try {
    value = parse_yaml(override.value, "value");
  } catch (const Error& error) {
    throw Error(text_of(override) + ": " + error.what() + "; quote text with special characters");
  }
  mark_as_override(value);
  return value;
}

/// The item that `word` names: by index, or by its key `name`.
std::optional<std::size_t> find_item(const Node& list, const std::string& word) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), index);
  if (error == std::errc{} && end == word.data() + word.size()) {
    return index < list.items.size() ? std::optional(index) : std::nullopt;
  }
  for (std::size_t i = 0; i < list.items.size(); ++i) {
    const Entry* name = list.items[i].find("name");
    if (name != nullptr && name->value.kind == Node::Kind::kScalar && name->value.scalar == word) {
      return i;
    }
  }
  return std::nullopt;
}

[[noreturn]] void fail_no_item(const Override& override, const std::string& path, const Node& list,
                               const std::string& word) {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < list.items.size() && i < 20; ++i) {
    const Entry* name = list.items[i].find("name");
    known.push_back(std::to_string(i) + (name == nullptr ? "" : " " + shown(name->value.scalar)));
  }
  throw Error(text_of(override) + ": " + path + " has no item " + shown(word) +
              (known.empty() ? "; it is empty" : "; its items are " + joined(known)));
}

std::optional<Detour> apply_one(const Assignment& assignment, const std::string& prefix, Node& root) {
  Node* at = &root;
  std::string path = prefix;
  for (std::size_t i = 0; i < assignment.way.size(); ++i) {
    const std::string& word = assignment.way[i];
    switch (at->kind) {
      case Node::Kind::kScalar:
        return Detour{
            path, {{assignment.way.begin() + static_cast<std::ptrdiff_t>(i), assignment.way.end()}, assignment.whole}};
      case Node::Kind::kList: {
        const std::optional<std::size_t> item = find_item(*at, word);
        if (!item) {
          fail_no_item(assignment.whole, path, *at, word);
        }
        at = &at->items[*item];
        path = path_below(path, std::to_string(*item));
        break;
      }
      case Node::Kind::kNull:
        at->kind = Node::Kind::kMap;
        at->line = kFromOverride;
        [[fallthrough]];
      case Node::Kind::kMap: {
        Entry* entry = at->find(word);
        if (entry == nullptr) {
          entry = &at->entries.emplace_back(Entry{word, kFromOverride, {}});
        }
        if (i + 1 == assignment.way.size()) {
          entry->line = kFromOverride;
        }
        at = &entry->value;
        path = path_below(path, word);
        break;
      }
    }
  }
  *at = value_of(assignment.whole);
  return std::nullopt;
}

}  // namespace

std::string path_below(const std::string& path, const std::string& key) {
  return path.empty() ? key : path + "." + key;
}

std::vector<std::string> split_path(const std::string& path) {
  std::vector<std::string> words(1);
  for (const char c : path) {
    if (c == '.') {
      words.emplace_back();
    } else {
      words.back() += c;
    }
  }
  return words;
}

std::vector<Detour> apply(std::vector<Assignment> assignments, const std::string& prefix, Node& root) {
  // Short ways first: a file's name is set before a key inside that file. Equal ways keep their order: the last one
  // wins.
  std::stable_sort(assignments.begin(), assignments.end(),
                   [](const Assignment& a, const Assignment& b) { return a.way.size() < b.way.size(); });
  std::vector<Detour> detours;
  for (const Assignment& assignment : assignments) {
    if (assignment.way.size() > kMaxDepth) {
      throw Error(text_of(assignment.whole) + ": leads deeper than " + std::to_string(kMaxDepth) + " levels");
    }
    if (std::optional<Detour> detour = apply_one(assignment, prefix, root)) {
      detours.push_back(std::move(*detour));
    }
  }
  return detours;
}

}  // namespace rtbus::config::detail

namespace rtbus::config {

Override parse_override(std::string_view text) {
  const std::string usage = "; write --set key.path=value, for example --set haptic.0.rate_hz=2000";
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos) {
    throw Error("--set " + detail::shown(text) + ": there is no '='" + usage);
  }
  Override out{std::string(text.substr(0, equals)), std::string(text.substr(equals + 1))};
  for (const std::string& word : detail::split_path(out.path)) {
    if (word.empty()) {
      throw Error("--set " + detail::shown(text) + ": the path has an empty part" + usage);
    }
  }
  return out;
}

}  // namespace rtbus::config
