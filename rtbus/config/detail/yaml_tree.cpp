#include "rtbus/config/detail/yaml_tree.hpp"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "rtbus/config/detail/wording.hpp"
#include "rtbus/config/document.hpp"

namespace rtbus::config::detail {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail_at(const std::string& source, int line, const std::string& problem) {
  throw Error(source + ":" + std::to_string(line) + ": " + problem);
}

/// Nodes in a tree and its height, for the bounds on aliases.
struct Extent {
  std::size_t nodes = 1;
  std::size_t height = 1;
};
Extent extent_of(const Node& node) {
  Extent sum;
  const auto add = [&sum](const Node& child) {
    const Extent below = extent_of(child);
    sum.nodes += below.nodes;
    sum.height = std::max(sum.height, below.height + 1);
  };
  std::for_each(node.items.begin(), node.items.end(), add);
  std::for_each(node.entries.begin(), node.entries.end(), [&add](const Entry& entry) { add(entry.value); });
  return sum;
}

/// Takes the parser's events instead of yaml-cpp's own nodes: those drop the first of two equal keys without a word,
/// and do not tell a quoted scalar from a plain one.
class TreeBuilder : public YAML::EventHandler {
 public:
  explicit TreeBuilder(std::string source) : source_(std::move(source)) {}

  [[nodiscard]] Node take() { return std::move(root_); }

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    Node node;
    node.line = line_of(mark);
    complete(std::move(node), anchor);
  }

  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    if (tag != "?" && tag != "!") {  // what the parser calls plain and quoted
      fail_at(source_, line_of(mark), "the tag " + shown(tag) + " is not supported; leave it out");
    }
    Node node;
    node.kind = Node::Kind::kScalar;
    node.scalar = value;
    node.quoted = tag == "!";
    node.line = line_of(mark);
    complete(std::move(node), anchor);
  }

  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = anchors_.find(anchor);
    if (found == anchors_.end()) {
      fail_at(source_, line_of(mark), "this alias stands inside the value that it repeats");
    }
    // A copy, counted: aliases of aliases grow without bound otherwise.
    const Extent extent = extent_of(found->second);
    nodes_ += extent.nodes;
    check_bounds(line_of(mark), open_.size() + extent.height);
    complete(found->second, 0);
  }

  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    begin(mark, Node::Kind::kList, anchor);
  }
  void OnSequenceEnd() override { end(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    begin(mark, Node::Kind::kMap, anchor);
  }
  void OnMapEnd() override { end(); }

 private:
  struct Open {
    Node node;
    YAML::anchor_t anchor;
    bool key_pending = false;  ///< A map that has its key and waits for the value.
  };

  static int line_of(const YAML::Mark& mark) { return mark.line + 1; }

  void check_bounds(int line, std::size_t depth) const {
    if (nodes_ > kMaxNodes) {
      fail_at(source_, line,
              "more than " + std::to_string(kMaxNodes) + " values, aliases included; no configuration needs so many");
    }
    if (depth > kMaxDepth) {
      fail_at(source_, line, "nested deeper than " + std::to_string(kMaxDepth) + " levels");
    }
  }

  void begin(const YAML::Mark& mark, Node::Kind kind, YAML::anchor_t anchor) {
    Node node;
    node.kind = kind;
    node.line = line_of(mark);
    check_bounds(node.line, open_.size() + 1);
    open_.push_back({std::move(node), anchor});
  }

  void end() {
    Open closed = std::move(open_.back());
    open_.pop_back();
    complete(std::move(closed.node), closed.anchor);
  }

  /// Puts a finished value where it belongs: the document, a list, a map's key or a map's value.
  void complete(Node node, YAML::anchor_t anchor) {
    ++nodes_;
    check_bounds(node.line, open_.size());
    if (anchor != 0) {
      anchors_[anchor] = node;
    }
    if (open_.empty()) {
      root_ = std::move(node);
      return;
    }
    Open& parent = open_.back();
    if (parent.node.kind == Node::Kind::kList) {
      parent.node.items.push_back(std::move(node));
    } else if (parent.key_pending) {
      parent.node.entries.back().value = std::move(node);
      parent.key_pending = false;
    } else {
      add_key(parent, node);
    }
  }

  void add_key(Open& parent, const Node& key) {
    if (key.kind != Node::Kind::kScalar || key.scalar.empty()) {
      fail_at(source_, key.line, "a key must be a plain word");
    }
    if (const Entry* first = parent.node.find(key.scalar)) {
      fail_at(source_, key.line,
              "the key " + shown(key.scalar) + " stands here twice, first in line " + std::to_string(first->line) +
                  "; remove one");
    }
    if (parent.node.entries.size() == kMaxKeys) {
      fail_at(source_, key.line, "more than " + std::to_string(kMaxKeys) + " keys in one map");
    }
    parent.node.entries.push_back({key.scalar, key.line, {}});
    parent.key_pending = true;
  }

  std::string source_;
  std::vector<Open> open_;
  std::map<YAML::anchor_t, Node> anchors_;
  std::size_t nodes_ = 0;
  Node root_;
};

/// Refuses what the parser would misread silently: control characters (one of them ends its input), text that is not
/// UTF-8, tabs as indentation.
void check_text(std::string_view text, const std::string& source) {
  int line = 1;
  bool indentation = true;
  bool tab_in_indentation = false;
  std::size_t continuation = 0;  // bytes of a UTF-8 sequence still to come
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_continuation = (byte & 0xc0U) == 0x80U;
    if (is_continuation != (continuation > 0) || byte >= 0xf8U) {
      fail_at(source, line, "is not UTF-8 text; save the file as UTF-8");
    }
    if (is_continuation) {
      --continuation;
    } else if (byte >= 0xc0U) {
      continuation = byte >= 0xf0U ? 3 : byte >= 0xe0U ? 2 : 1;
    }
    if ((byte < 0x20U && c != '\t' && c != '\n' && c != '\r') || byte == 0x7fU) {
      fail_at(source, line, "has a control character; is this a YAML text file?");
    }
    if (c == '\n') {
      ++line;
      indentation = true;
      tab_in_indentation = false;
    } else if (indentation && c == '\t') {
      tab_in_indentation = true;
    } else if (indentation && c != ' ' && c != '\r') {
      indentation = false;
      if (tab_in_indentation) {
        fail_at(source, line, "is indented by a tab; YAML wants spaces");
      }
    }
  }
  if (continuation > 0) {
    fail_at(source, line, "is not UTF-8 text; save the file as UTF-8");
  }
}

}  // namespace

const Entry* Node::find(std::string_view key) const {
  const auto found =
      std::find_if(entries.begin(), entries.end(), [key](const Entry& entry) { return entry.key == key; });
  return found == entries.end() ? nullptr : &*found;
}

Entry* Node::find(std::string_view key) {
  return const_cast<Entry*>(static_cast<const Node*>(this)->find(key));  // NOLINT: the object itself is not const
}

Node parse_yaml(std::string_view text, const std::string& source) {
  check_text(text, source);
  // yaml-cpp takes the end of the input for the missing quote when white space stands before it.
  const std::size_t last = text.find_last_not_of(" \t\r\n");
  text = text.substr(0, last == std::string_view::npos ? 0 : last + 1);
  try {
    std::istringstream stream{std::string(text)};
    YAML::Parser parser(stream);
    TreeBuilder builder(source);
    if (!parser.HandleNextDocument(builder)) {
      return {};
    }
    Node root = builder.take();
    TreeBuilder second(source);
    if (parser.HandleNextDocument(second)) {
      throw Error(source + ": holds more than one YAML document ('---' begins a new one); one file is one document");
    }
    return root;
  } catch (const YAML::Exception& error) {
    fail_at(source, error.mark.is_null() ? 1 : error.mark.line + 1, "is not valid YAML: " + error.msg);
  }
}

Node read_yaml_file(const std::string& path, const std::string& source) {
  if (path.empty()) {
    throw Error("a configuration file is needed, but its name is empty; name one, for example config/wall.yaml");
  }
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  if (!fs::exists(status)) {
    std::vector<std::string> names;
    const fs::path folder = fs::absolute(path).parent_path();
    for (fs::directory_iterator it(folder, ignored), last; !ignored && it != last; it.increment(ignored)) {
      names.push_back(it->path().filename().string());
    }
    throw Error(source + ": there is no such file (looked for " + fs::absolute(path).lexically_normal().string() + ")" +
                did_you_mean(fs::path(path).filename().string(), names) + "; check the name and the current folder");
  }
  if (fs::is_directory(status)) {
    throw Error(source + ": is a folder; name the YAML file in it");
  }
  if (!fs::is_regular_file(status)) {
    throw Error(source + ": is not a regular file; a configuration is read from a YAML file");
  }

  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    throw Error(source + ": cannot be opened: " + std::strerror(errno));
  }
  // Counted while reading: the size that the folder names may have changed since.
  std::string text;
  std::array<char, 16384> piece{};
  while (stream.read(piece.data(), piece.size()), stream.gcount() > 0) {
    text.append(piece.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > kMaxFileBytes) {
      throw Error(source + ": is larger than 1 MiB; is this the right file?");
    }
  }
  return parse_yaml(text, source);
}

}  // namespace rtbus::config::detail
