// What pages say about this tree is so: the tests that their tables name, the packages that they install, the keys.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace {

namespace fs = std::filesystem;

const fs::path kRoot = RTBUS_SOURCE_DIR;

std::string text_of(const fs::path& file) {
  std::ostringstream out;
  out << std::ifstream(file).rdbuf();
  return out.str();
}

/// "Suite.Name" of every test in tests/, and the fuzzers.
std::set<std::string> all_tests() {
  std::set<std::string> out;
  const std::regex test(R"(\bTEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\))");
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / "tests")) {
    if (entry.path().extension() != ".cpp") continue;
    const std::string text = text_of(entry.path());
    for (std::sregex_iterator it(text.begin(), text.end(), test), end; it != end; ++it) {
      out.insert((*it)[1].str() + "." + (*it)[2].str());
    }
  }
  const std::string fuzzers = text_of(kRoot / "tests/fuzz/CMakeLists.txt");
  const std::regex fuzzer(R"(\brtbus_add_fuzzer\((\w+) )");
  for (std::sregex_iterator it(fuzzers.begin(), fuzzers.end(), fuzzer), end; it != end; ++it) {
    out.insert("fuzz_" + (*it)[1].str());
  }
  return out;
}

/// What stands between `…` in the last column of tables whose last heading says "test" or "proved by".
std::vector<std::string> named_in(const fs::path& document) {
  std::vector<std::string> out;
  std::ifstream stream(document);
  const std::regex heading(R"(\|\s*(test|Test|Proved by)\s*\|\s*$)");
  const std::regex name("`([^`]+)`");
  bool inside = false;
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with("|")) inside = false;
    const std::size_t last = line.rfind('|', line.size() < 2 ? 0 : line.size() - 2);
    if (inside && last != std::string::npos) {
      const std::string cell = line.substr(last);
      for (std::sregex_iterator it(cell.begin(), cell.end(), name), end; it != end; ++it) out.push_back((*it)[1]);
    }
    if (std::regex_search(line, heading)) inside = true;
  }
  return out;
}

/// A name, a beginning of one ("Suite.Does…"), all of a suite ("Suite.*"), one of its parameters ("Suite.Name/param"),
/// or a file of wrong configurations ("Suite.…/file").
bool exists(const std::string& name, const std::set<std::string>& tests) {
  const std::string dots = "…";
  const std::size_t slash = name.find('/');
  std::string wanted = name.substr(0, slash);
  bool whole = true;
  for (const std::string& open : {dots, std::string("*")}) {
    if (!wanted.ends_with(open)) continue;
    wanted.resize(wanted.size() - open.size());
    whole = false;
  }
  if (wanted.find('.') == std::string::npos && !wanted.starts_with("fuzz_")) return false;
  if (slash != std::string::npos && wanted.ends_with(".")) {
    for (const auto& entry : fs::recursive_directory_iterator(kRoot / "tests/data/bad_configs")) {
      if (entry.path().stem() == name.substr(slash + 1)) return true;
    }
    return false;
  }
  const auto found = tests.lower_bound(wanted);
  return found != tests.end() && (whole ? *found == wanted : found->starts_with(wanted));
}

class Documents : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Tables, Documents,
                         testing::Values("bridge", "devices", "safety", "device-force-dimension", "device-haply",
                                         "device-openhaptics"),
                         [](const auto& document) {
                           std::string name = document.param;
                           std::erase(name, '-');  // not allowed in names of tests
                           return name;
                         });

TEST_P(Documents, NameTestsThatExist) {
  const auto tests = all_tests();
  ASSERT_GT(tests.size(), 500u);
  const auto named = named_in(kRoot / "docs" / (std::string(GetParam()) + ".md"));
  EXPECT_GT(named.size(), 5u);
  for (const std::string& name : named) EXPECT_TRUE(exists(name, tests)) << name;
}

/// The rows of `rtbus evaluate faults`, from its sources: those of drivers that are not built count too.
std::set<std::string> fault_rows_in_code() {
  std::set<std::string> out;
  const std::regex designated(R"re(\.name = "(\w+)")re"), listed(R"re(\{"([a-z]\w+)",\s*")re");
  for (const auto& entry : fs::directory_iterator(kRoot / "tools/evaluation/faults")) {
    const std::string file = entry.path().filename().string();
    const bool table = file == "device_faults.cpp" || file == "python_engine.cpp";
    if (!table && !file.ends_with("_faults.cpp")) continue;
    const std::string text = text_of(entry.path());
    for (std::sregex_iterator it(text.begin(), text.end(), table ? listed : designated), end; it != end; ++it) {
      out.insert((*it)[1]);
    }
  }
  return out;
}

/// What stands between `…` in the third column of the table whose heading is "Promise | Condition | Row | Figure".
std::set<std::string> fault_rows_in(const std::string& document) {
  std::set<std::string> out;
  std::istringstream stream(document);
  const std::regex heading(R"(^\|\s*Promise\s*\|\s*Condition\s*\|\s*Row\s*\|\s*Figure\s*\|\s*$)");
  const std::regex cells(R"(^\|[^|]*\|[^|]*\|([^|]*)\|[^|]*\|\s*$)"), name("`(\\w+)`");
  bool inside = false;
  std::smatch row;
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with("|")) inside = false;
    if (std::regex_match(line, heading)) inside = true;
    if (!inside || !std::regex_match(line, row, cells)) continue;
    const std::string cell = row[1];
    for (std::sregex_iterator it(cell.begin(), cell.end(), name), end; it != end; ++it) out.insert((*it)[1]);
  }
  return out;
}

TEST(SafetyTable, NamesEachRowOfTheFaultsAndNoOther) {
  const std::set<std::string> code = fault_rows_in_code();
  EXPECT_GT(code.size(), 45u);
  EXPECT_TRUE(code.contains("physics_killed") && code.contains("omega_silent") && code.contains("python_raises"));
  EXPECT_EQ(fault_rows_in(text_of(kRoot / "docs/safety.md")), code);
}

TEST(SafetyTable, IsReadByItsHeading) {
  EXPECT_EQ(
      fault_rows_in("| Promise | Condition | Row | Figure |\n|---|---|---|---|\n| zero | `x` | `one`, `two` | 3 |\n"
                    "\n| a | b | `three` | c |\n"),
      (std::set<std::string>{"one", "two"}));
}

TEST(DocumentTables, AWrongNameWouldBeSeen) {
  const std::set<std::string> tests{"Suite.DoesThis", "fuzz_stream"};
  EXPECT_TRUE(exists("Suite.DoesThis", tests));
  EXPECT_TRUE(exists("Suite.Does…", tests));
  EXPECT_TRUE(exists("Suite.*", tests));
  EXPECT_TRUE(exists("Suite.DoesThis/Fast", tests));
  EXPECT_TRUE(exists("fuzz_stream", tests));
  EXPECT_FALSE(exists("Suite.Does", tests));
  EXPECT_FALSE(exists("Suite.Done…", tests));
  EXPECT_FALSE(exists("Other.*", tests));
  EXPECT_FALSE(exists("DoesThis…", tests));
  EXPECT_FALSE(exists("BadSuite.…/no_such_file", tests));
}

/// The packages of this build and what each needs of the others, from cmake/packaging.cmake.
std::map<std::string, std::set<std::string>> packages_in(const std::string& cmake) {
  std::map<std::string, std::string> names;  // by the component
  const std::regex name(R"re(set\(CPACK_DEBIAN_(\w+)_PACKAGE_NAME ([\w-]+)\))re");
  for (std::sregex_iterator it(cmake.begin(), cmake.end(), name), end; it != end; ++it) names[(*it)[1]] = (*it)[2];
  std::map<std::string, std::set<std::string>> out;
  for (const auto& [component, package] : names) out[package];
  const std::regex depends(R"re(set\(CPACK_DEBIAN_(\w+)_PACKAGE_DEPENDS "([^"]*)"\))re"),
      word(R"re(([a-z][\w-]*) \()re");
  for (std::sregex_iterator it(cmake.begin(), cmake.end(), depends), end; it != end; ++it) {
    const std::string needed = (*it)[2];
    for (std::sregex_iterator one(needed.begin(), needed.end(), word); one != end; ++one) {
      if (out.contains((*one)[1])) out[names[(*it)[1]]].insert((*one)[1]);
    }
  }
  return out;
}

/// What each `apt install` of files in a page names, as the shell expands "{rtbus,librtbus1}_*.deb".
std::vector<std::set<std::string>> installed_by(const std::string& page) {
  std::vector<std::set<std::string>> out;
  const std::regex command(R"re(apt install [^\n`#]*_\*\.deb)re"), file(R"re(([\w-]+|\{[\w,-]+\})_\*\.deb)re"),
      word(R"re([\w-]+)re");
  for (std::sregex_iterator it(page.begin(), page.end(), command), end; it != end; ++it) {
    const std::string line = it->str();
    std::set<std::string> packages;
    for (std::sregex_iterator one(line.begin(), line.end(), file); one != end; ++one) {
      const std::string list = (*one)[1];
      for (std::sregex_iterator each(list.begin(), list.end(), word); each != end; ++each) packages.insert(each->str());
    }
    out.push_back(packages);
  }
  return out;
}

TEST(Pages, InstallThePackagesThatAPackageNeeds) {
  const auto packages = packages_in(text_of(kRoot / "cmake/packaging.cmake"));
  EXPECT_EQ(packages.at("librtbus-dev"), std::set<std::string>{"librtbus1"});
  EXPECT_EQ(packages.at("rtbus-mujoco"), (std::set<std::string>{"librtbus1", "rtbus"}));
  int seen = 0;
  for (const char* const page : {"README.md", "docs/bridge.md", "docs/examples/README.md", "docs/packages.md",
                                 "docs/python.md", "docs/writing-a-driver.md", "docs/your-own-physics.md"}) {
    for (const std::set<std::string>& together : installed_by(text_of(kRoot / page))) {
      ++seen;
      for (const std::string& package : together) {
        ASSERT_TRUE(packages.contains(package)) << page << " installs " << package << ", which is not made";
        for (const std::string& needed : packages.at(package)) {
          EXPECT_TRUE(together.contains(needed)) << page << " installs " << package << " without " << needed;
        }
      }
    }
  }
  EXPECT_GE(seen, 6);
}

TEST(Pages, AMissingPackageWouldBeSeen) {
  const auto packages = packages_in(
      "set(CPACK_DEBIAN_A_PACKAGE_NAME a)\nset(CPACK_DEBIAN_B_PACKAGE_NAME lib-b)\n"
      "set(CPACK_DEBIAN_A_PACKAGE_DEPENDS \"python3 (>= 3.9), lib-b (= ${PROJECT_VERSION})\")");
  EXPECT_EQ(packages, (std::map<std::string, std::set<std::string>>{{"a", {"lib-b"}}, {"lib-b", {}}}));
  EXPECT_THAT(installed_by("    sudo apt install ./a_*.deb ./lib-b_*.deb g++\nso `apt install ./out/{a,lib-b}_*.deb`"),
              testing::ElementsAre(std::set<std::string>{"a", "lib-b"}, std::set<std::string>{"a", "lib-b"}));
}

/// The keys of a session file as config/README.md writes them: "engine", "coupling.stiffness_n_per_m". Those of a
/// section follow its name; keys behind a "# " are left out by the file, and count.
std::vector<std::string> keys_in(const std::string& yaml) {
  std::vector<std::pair<std::size_t, std::string>> above;  // columns and names
  std::vector<std::string> out;
  const std::regex key(R"re(^( *)(- |# )?( *)(\w+):( .*)?$)re");
  std::istringstream stream(yaml);
  std::smatch part;
  for (std::string line; std::getline(stream, line);) {
    if (!std::regex_match(line, part, key)) continue;
    const std::size_t column = part[1].length() + (part[2] == "- " ? 2 : 0) + part[3].length();
    while (!above.empty() && above.back().first >= column) above.pop_back();
    std::string path;
    for (const auto& [at, name] : above) path += name + ".";
    path += part[4];
    for (const std::string& section : {std::string("physics."), std::string("haptic.")}) {
      if (path.starts_with(section)) path.erase(0, section.size());
    }
    above.emplace_back(column, part[4]);
    out.push_back(path);
  }
  return out;
}

TEST(Configuration, TheTableHasEachKeyOfEveryKey) {
  const std::vector<std::string> keys = keys_in(text_of(kRoot / "config/every_key.yaml"));
  EXPECT_THAT(keys, testing::IsSupersetOf({"bus.mode", "command", "coupling.stiffness_n_per_m",
                                           "workspace_walls.margin_m", "realtime.spin_us"}));
  const std::string table = text_of(kRoot / "config/README.md");
  for (const std::string& key : keys) {
    const bool section =
        std::any_of(keys.begin(), keys.end(), [&](const auto& each) { return each.starts_with(key + "."); });
    EXPECT_TRUE(section || table.find("\n| `" + key + "` |") != std::string::npos) << "no row for " << key;
  }
}

TEST(Configuration, KeysAreFoundInSectionsListsAndBehindAHash) {
  EXPECT_THAT(keys_in("a: 1\nhaptic:  # list\n  - name: x\n    # walls:    # none\n    #   margin_m: 1\n    b: {c: "
                      "2}\n# No key: here.\n"),
              testing::ElementsAre("a", "haptic", "name", "walls", "walls.margin_m", "b"));
}

}  // namespace
