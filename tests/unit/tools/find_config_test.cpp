/// Which file a name means, and what the shell is told could come next.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "rtbus/config/document.hpp"
#include "tests/support/temporary_file.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"

namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// Runs the test in a folder of its own.
class FindConfig : public testing::Test {
 protected:
  FindConfig() : before_(std::filesystem::current_path()) { std::filesystem::current_path(folder_.path()); }
  ~FindConfig() override { std::filesystem::current_path(before_); }

  tests::TemporaryFolder folder_;

 private:
  std::filesystem::path before_;
};

TEST_F(FindConfig, FindsTheProjectsOwnFilesFromAnyFolder) {
  EXPECT_EQ(tools::find_session("wall"), RTBUS_SOURCE_DIR "/config/wall.yaml");
  EXPECT_EQ(tools::find_config("devices/sim_falcon.yaml"), RTBUS_SOURCE_DIR "/config/devices/sim_falcon.yaml");
}

TEST_F(FindConfig, PrefersTheFolderConfigOfTheUser) {
  folder_.write("config/wall.yaml", "mine");
  EXPECT_EQ(tools::find_session("wall"), std::filesystem::canonical("config/wall.yaml"));
  EXPECT_EQ(tools::find_session("stack_125"), RTBUS_SOURCE_DIR "/config/stack_125.yaml");
}

TEST_F(FindConfig, TakesAPathAsItIs) {
  EXPECT_EQ(tools::find_session("config/wall.yaml"), "config/wall.yaml");  // not there: the reader says so
  folder_.write("wall", "a file without extension");
  EXPECT_EQ(tools::find_session("wall"), "wall");
}

TEST_F(FindConfig, DoesNotTakeAFolderOfResultsForASession) {
  std::filesystem::create_directory("wall");
  EXPECT_EQ(tools::find_session("wall"), RTBUS_SOURCE_DIR "/config/wall.yaml");
}

TEST_F(FindConfig, NamesTheSessionsThatExist) {
  try {
    (void)tools::find_session("wal");
    FAIL() << "found something";
  } catch (const rtbus::config::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("there is no session file wal; name a file, or one of"));
    EXPECT_THAT(error.what(), HasSubstr("stack_125"));
  }
}

TEST(Completions, ProposeCommandsOptionsAndValues) {
  rtbus::CommandLine line("rtbus", "");
  std::string session, kind;
  bool quick = false;
  const rtbus::Command run = line.add_command("run", "");
  rtbus::Command edit = run;
  edit.option("session", session, "").type_name("FILE|NAME");
  edit.option("--kind", kind, "").one_of({"drop", "stack"});
  edit.flag("--quick", quick, "");
  const std::vector<std::pair<std::string, rtbus::Command>> commands = {{"record", line.add_command("record", "")},
                                                                        {"run", run}};
  const auto after = [&](std::vector<std::string> words) { return tools::completions(commands, words); };
  EXPECT_THAT(after({"r"}), ElementsAre("record", "run"));
  EXPECT_THAT(after({"run", "--"}), ElementsAre("--help", "--kind", "--quick"));
  EXPECT_THAT(after({"run", "--kind", ""}), ElementsAre("drop", "stack"));
  EXPECT_THAT(after({"run", "stack_1"}), ElementsAre("stack_125"));
  EXPECT_THAT(after({"run", "--quick", "stack_1"}), ElementsAre("stack_125"));
  EXPECT_THAT(after({"record", ""}), IsEmpty());
  EXPECT_THAT(after({"nonsense", ""}), IsEmpty());
}

}  // namespace
