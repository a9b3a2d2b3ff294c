/// How `rtbus evaluate` answers what it cannot do: exit status 2, and a sentence that says why.
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "tests/support/temporary_file.hpp"
#include "tools/command.hpp"

namespace {

struct Answer {
  int status = -1;
  std::string words;
};

Answer evaluate(std::vector<std::string> arguments) {
  const tests::TemporaryFolder folder;
  arguments.insert(arguments.end(), {"--out", folder.path().string()});
  CLI::App app;
  const tools::Action action = tools::add_evaluate(app);
  std::vector<const char*> words{"evaluate"};
  for (const std::string& argument : arguments) words.push_back(argument.c_str());
  app.parse(static_cast<int>(words.size()), words.data());
  testing::internal::CaptureStderr();
  Answer out;
  out.status = action();
  out.words = testing::internal::GetCapturedStderr();
  return out;
}

TEST(Evaluate, RefusesAnExperimentThatItDoesNotKnow) {
  CLI::App app;
  (void)tools::add_evaluate(app);
  const char* words[] = {"evaluate", "stacks"};
  EXPECT_THROW(app.parse(2, words), CLI::ValidationError);
}

TEST(Evaluate, NamesEveryExperimentInItsHelp) {
  CLI::App app;
  (void)tools::add_evaluate(app);
  for (const char* name : {"drop", "stack", "faults", "overhead"}) {
    EXPECT_NE(app.help().find(name), std::string::npos) << name;
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
