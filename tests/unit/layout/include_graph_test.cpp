// Who includes whom. The rules are the table in docs/architecture.md, so page and code cannot disagree. Besides, no two
// folders include each other, not even by way of others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// Paths from the root of the tree: a file and what it includes.
using Includes = std::map<std::string, std::set<std::string>>;
/// "drivers/usb" and the rooms that it may include, "rtbus/*" among them: rtbus and all rooms in it.
using Rules = std::map<std::string, std::set<std::string>>;

std::string read(const fs::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

bool within(const std::string& path, const std::string& folder) {
  return path == folder || path.compare(0, folder.size() + 1, folder + "/") == 0;
}

/// The folder of a file. A folder `detail` belongs to the one around it.
std::string folder_of(const std::string& file) {
  std::string folder = fs::path(file).parent_path().string();
  while (fs::path(folder).filename() == "detail") folder = fs::path(folder).parent_path().string();
  return folder;
}

/// The row that a folder belongs to: the innermost; empty: none.
std::string room_of(const std::string& folder, const Rules& rules) {
  std::string room;
  for (const auto& [name, allowed] : rules) {
    if (within(folder, name) && name.size() > room.size()) room = name;
  }
  return room;
}

std::vector<std::string> in_backticks(const std::string& text) {
  std::vector<std::string> out;
  for (std::size_t at = text.find('`'); at != std::string::npos;) {
    const std::size_t end = text.find('`', at + 1);
    if (end == std::string::npos) break;
    std::string name = text.substr(at + 1, end - at - 1);
    if (name.ends_with('/')) name.pop_back();
    out.push_back(std::move(name));
    at = text.find('`', end + 1);
  }
  return out;
}

/// The rows `| rooms | what they own | what they may include |` under the heading.
Rules read_rules(const std::string& page) {
  Rules rules;
  std::istringstream lines(page.substr(std::min(page.find("## Who may include whom"), page.size())));
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line) && !line.starts_with("## ")) {
    if (!line.starts_with("| `")) continue;
    std::vector<std::string> cells;
    std::istringstream row(line.substr(1));
    for (std::string cell; std::getline(row, cell, '|');) cells.push_back(cell);
    if (cells.size() < 3) continue;
    const std::vector<std::string> allowed = in_backticks(cells[2]);
    for (const std::string& room : in_backticks(cells[0])) rules[room].insert(allowed.begin(), allowed.end());
  }
  return rules;
}

Includes read_includes(const fs::path& root, const std::set<std::string>& tops) {
  Includes out;
  for (const std::string& top : tops) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      const fs::path extension = entry.path().extension();
      if (extension != ".hpp" && extension != ".cpp" && extension != ".h") continue;
      std::set<std::string>& includes = out[fs::relative(entry.path(), root).string()];
      std::istringstream lines(read(entry.path()));
      for (std::string line; std::getline(lines, line);) {
        constexpr std::string_view kInclude = "#include \"";
        if (!line.starts_with(kInclude)) continue;
        includes.insert(line.substr(kInclude.size(), line.find('"', kInclude.size()) - kInclude.size()));
      }
    }
  }
  return out;
}

/// A sentence per include that is no path from the root, reaches into another folder's `detail`, or is not in the
/// table.
std::vector<std::string> broken_rules(const Includes& all, const Rules& rules) {
  std::vector<std::string> out;
  for (const auto& [file, includes] : all) {
    const std::string from = room_of(folder_of(file), rules);
    if (from.empty()) out.push_back(file + " is in no room of the table");
    for (const std::string& included : includes) {
      const std::string arrow = file + " includes " + included;
      if (!all.contains(included)) {
        out.push_back(arrow + ", which is no file of these rooms");
        continue;
      }
      const std::string to = room_of(folder_of(included), rules);
      const std::size_t detail = included.rfind("/detail/");
      if (detail != std::string::npos && !within(file, included.substr(0, detail))) {
        out.push_back(arrow + ", which is private to its folder");
      }
      if (from == to || from.empty() || to.empty()) continue;
      const auto& allowed = rules.at(from);
      const bool named = std::any_of(allowed.begin(), allowed.end(), [&to = to](const std::string& room) {
        return room.ends_with("/*") ? within(to, room.substr(0, room.size() - 2)) : room == to;
      });
      if (!named) out.push_back(arrow + ": " + from + " may not include " + to);
    }
  }
  return out;
}

/// One cycle between folders, "a → b (file includes file) → a …"; empty: there is none.
std::string cycle(const Includes& all) {
  std::map<std::string, std::map<std::string, std::string>> arrows;  // folder → folder → by which files
  for (const auto& [file, includes] : all) {
    for (const std::string& included : includes) {
      const std::string from = folder_of(file), to = folder_of(included);
      if (from != to) arrows[from].emplace(to, file + " includes " + included);
    }
  }
  // A folder that includes nothing any more is in no cycle.
  for (bool fewer = true; fewer;) {
    fewer = false;
    for (auto& [from, to] : arrows) {
      fewer |= std::erase_if(to, [&](const auto& arrow) {
                 const auto next = arrows.find(arrow.first);
                 return next == arrows.end() || next->second.empty();
               }) > 0;
    }
    std::erase_if(arrows, [](const auto& arrow) { return arrow.second.empty(); });
  }
  if (arrows.empty()) return {};
  // From each folder that is left an arrow leads to another one that is left: follow them until one comes again.
  std::string folder = arrows.begin()->first, text;
  for (std::set<std::string> seen; seen.insert(folder).second;) folder = arrows[folder].begin()->first;
  const std::string first = folder;
  do {
    const auto& [to, files] = *arrows[folder].begin();
    text += folder + " → " + to + " (" + files + ")\n";
    folder = to;
  } while (folder != first);
  return text;
}

const fs::path kRoot = RTBUS_SOURCE_DIR;
const std::set<std::string> kTops{"rtbus", "drivers", "haptic_node", "physics_node", "tools"};

TEST(Rooms, IncludeOnlyWhomTheTableNames) {
  const Rules rules = read_rules(read(kRoot / "docs/architecture.md"));
  ASSERT_GE(rules.size(), 20u) << "the table in docs/architecture.md is not read any more";
  for (const auto& [room, allowed] : rules) EXPECT_TRUE(fs::is_directory(kRoot / room)) << room << " is no folder";
  const Includes all = read_includes(kRoot, kTops);
  ASSERT_GE(all.size(), 300u);
  EXPECT_THAT(broken_rules(all, rules), IsEmpty());
}

TEST(Rooms, HaveNoCycle) {
  const std::string found = cycle(read_includes(kRoot, kTops));
  EXPECT_TRUE(found.empty()) << found;
}

// The arrows that stay, whatever the table says.
TEST(Rooms, KeepTheNodesApart) {
  const Rules rules = read_rules(read(kRoot / "docs/architecture.md"));
  const std::set<std::string> join_both{"tools/harness", "tools/cli/run", "tools/cli/still", "tools/evaluation",
                                        "tools/view"};
  for (const auto& [room, allowed] : rules) {
    bool haptic = false, physics = false;
    for (const std::string& other : allowed) {
      const std::string arrow = room + " may include " + other;
      const bool in_bus = within(other, "rtbus"), in_drivers = within(other, "drivers");
      const bool in_haptic = within(other, "haptic_node"), in_physics = within(other, "physics_node");
      haptic |= in_haptic;
      physics |= in_physics;
      EXPECT_TRUE(!within(room, "rtbus") || in_bus) << arrow;
      EXPECT_TRUE(!within(room, "drivers") || in_bus || in_drivers) << arrow;
      EXPECT_TRUE(!within(room, "haptic_node") || in_bus || in_drivers || in_haptic) << arrow;
      EXPECT_TRUE(!within(room, "physics_node") || in_bus || in_physics) << arrow;
      EXPECT_TRUE(!within(room, "tools/harness") || !within(other, "tools")) << arrow;
      EXPECT_TRUE(!within(room, "tools/cli") || !(within(other, "tools/evaluation") || other == "tools/*")) << arrow;
    }
    EXPECT_TRUE(!haptic || !physics || join_both.contains(room)) << room << " may include both nodes";
  }
}

constexpr const char* kPage =
    "# A page\n| `a/` | before | `b/` |\n## Who may include whom\n| Room | Owns | May include |\n|---|---|---|\n"
    "| `a/` | something | |\n| `a/in/` | | `a/` |\n| `b/`, `c/` | others | `a/*` |\n## Next\n| `d/` | after | `a/` |\n";

TEST(RoomRules, AreTheRowsUnderTheHeading) {
  EXPECT_EQ(read_rules(kPage), (Rules{{"a", {}}, {"a/in", {"a"}}, {"b", {"a/*"}}, {"c", {"a/*"}}}));
}

TEST(RoomRules, RefuseAnArrowThatIsNotInTheTable) {
  const Rules rules = read_rules(kPage);
  EXPECT_THAT(broken_rules({{"a/x.hpp", {}}, {"a/in/y.hpp", {"a/x.hpp"}}, {"b/more/z.cpp", {"a/in/y.hpp"}}}, rules),
              IsEmpty());
  EXPECT_THAT(broken_rules({{"a/x.hpp", {"b/z.hpp"}}, {"b/z.hpp", {}}}, rules),
              ElementsAre("a/x.hpp includes b/z.hpp: a may not include b"));
  EXPECT_THAT(broken_rules({{"a/x.hpp", {"a/in/y.hpp"}}, {"a/in/y.hpp", {}}}, rules),
              ElementsAre(HasSubstr("a may not include a/in")));
  EXPECT_THAT(broken_rules({{"b/x.hpp", {"c/y.hpp"}}, {"c/y.hpp", {}}}, rules),
              ElementsAre(HasSubstr("b may not include c")));
}

TEST(RoomRules, RefuseWhatIsPrivateOrNoFile) {
  const Rules rules = read_rules(kPage);
  EXPECT_THAT(broken_rules({{"a/x.hpp", {"a/detail/y.hpp"}}, {"a/detail/y.hpp", {}}}, rules), IsEmpty());
  EXPECT_THAT(broken_rules({{"b/x.hpp", {"a/detail/y.hpp"}}, {"a/detail/y.hpp", {}}}, rules),
              ElementsAre(HasSubstr("private")));
  EXPECT_THAT(broken_rules({{"a/x.hpp", {"x.hpp"}}}, rules), ElementsAre(HasSubstr("no file")));
  EXPECT_THAT(broken_rules({{"d/x.hpp", {}}}, rules), ElementsAre("d/x.hpp is in no room of the table"));
}

TEST(RoomRules, FindACycleByWayOfOthers) {
  EXPECT_EQ(cycle({{"a/x.hpp", {"b/y.hpp"}}, {"b/y.hpp", {"c/z.hpp"}}, {"c/z.hpp", {}}}), "");
  EXPECT_EQ(cycle({{"a/x.hpp", {"a/detail/y.hpp"}}, {"a/detail/y.hpp", {"a/x.hpp"}}}), "");
  const std::string found = cycle({{"a/x.hpp", {"b/y.hpp"}}, {"b/y2.hpp", {"c/z.hpp"}}, {"c/z.hpp", {"a/x.hpp"}}});
  EXPECT_THAT(found, HasSubstr("a → b (a/x.hpp includes b/y.hpp)"));
  EXPECT_THAT(found, HasSubstr("c → a (c/z.hpp includes a/x.hpp)"));
}

}  // namespace
