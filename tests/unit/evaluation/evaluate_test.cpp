/// How `rtbus evaluate` answers what it cannot do: exit status 2, and a sentence that says why.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/temporary_file.hpp"
#include "tools/evaluation/commands.hpp"

namespace {

struct Answer {
  int status = -1;
  std::string words;
};

Answer evaluate(std::vector<std::string> arguments) {
  const tests::TemporaryFolder folder;
  arguments.insert(arguments.end(), {"--out", folder.path().string()});
  rtbus::CommandLine line("evaluate", "");
  const tools::Action action = tools::add_evaluate(line.root());
  std::string words;
  for (const std::string& argument : arguments) words += argument + " ";
  EXPECT_EQ(line.root().complaint_about(words), std::nullopt);
  testing::internal::CaptureStderr();
  Answer out;
  out.status = action();
  out.words = testing::internal::GetCapturedStderr();
  return out;
}

TEST(Evaluate, RefusesAnExperimentThatItDoesNotKnow) {
  rtbus::CommandLine line("evaluate", "");
  (void)tools::add_evaluate(line.root());
  EXPECT_NE(line.root().complaint_about("stacks"), std::nullopt);
}

TEST(Evaluate, NamesEveryExperimentInItsHelp) {
  rtbus::CommandLine line("evaluate", "");
  (void)tools::add_evaluate(line.root());
  for (const char* name : {"drop", "stack", "faults", "overhead"}) {
    EXPECT_NE(line.root().help().find(name), std::string::npos) << name;
  }
}

#if RTBUS_WITH_BULLET
TEST(Evaluate, NamesTheKeyThatIsNone) {
  const Answer answer = evaluate({"stack", "--quick", "--set", "haptic.0.couplin.stiffness_n_per_m=300"});
  EXPECT_EQ(answer.status, 2);
  EXPECT_NE(answer.words.find("couplin"), std::string::npos) << answer.words;
}

TEST(Evaluate, NamesTheValueThatIsTooLarge) {
  const Answer answer = evaluate({"stack", "--quick", "--set", "physics.solver_iterations=5000"});
  EXPECT_EQ(answer.status, 2);
  EXPECT_NE(answer.words.find("solver_iterations"), std::string::npos) << answer.words;
  EXPECT_NE(answer.words.find("1000"), std::string::npos) << answer.words;
}
#endif

TEST(Evaluate, RunsTheStacksFromTheirOwnFilesOnly) {
  const Answer answer = evaluate({"stack", "--config", "my_session.yaml"});
  EXPECT_EQ(answer.status, 2);
  EXPECT_NE(answer.words.find("--set"), std::string::npos) << answer.words;
}

}  // namespace
