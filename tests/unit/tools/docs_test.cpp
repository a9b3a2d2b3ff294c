// The tables of the documents that name a test for each fault name tests that exist.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>
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

}  // namespace
