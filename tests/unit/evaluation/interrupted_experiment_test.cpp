// An experiment that a signal cuts short has no verdict, whatever its half measurements would say.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tests/support/temporary_file.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/shared/experiment.hpp"

namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// In a process of its own: the flag of a signal stays up.
[[noreturn]] void cut_short(const std::filesystem::path& folder) {
  ::dup2(STDERR_FILENO, STDOUT_FILENO);
  tools::catch_interrupts();
  tools::Experiment experiment("evaluate", "test", "rtbus evaluate test", folder);
  const auto measure = [&] {
    experiment.check_at_least("test.mean", "a mean", 2.0, "N", 1.0);
    std::raise(SIGINT);
    experiment.check_at_least("test.rate", "a rate", std::numeric_limits<double>::quiet_NaN(), "Hz", 97.0);
    throw std::runtime_error("an answer did not come");
  };
  const int status = experiment.run(measure, false);
  std::fflush(stdout);
  std::_Exit(status);
}

TEST(InterruptedExperiment, HasNoVerdictAndNoFailures) {
  const tests::TemporaryFolder folder;
  EXPECT_EXIT(cut_short(folder.path()), testing::ExitedWithCode(1),
              AllOf(HasSubstr("interrupted after 0 s: evaluate test has no verdict"), Not(HasSubstr("FAIL")),
                    Not(HasSubstr("nan"))));
  std::ifstream file(folder.path() / "summary.json");
  const nlohmann::json summary = nlohmann::json::parse(file);
  EXPECT_EQ(summary["verdict"], "interrupted");
  ASSERT_EQ(summary["checks"].size(), 1u) << "of what was measured in full";
  EXPECT_EQ(summary["checks"][0]["id"], "test.mean");
  EXPECT_EQ(summary["checks"][0]["pass"], true);
}

TEST(Experiment, ThatFailsWithoutASignalTellsWhy) {
  const tests::TemporaryFolder folder;
  tools::Experiment experiment("evaluate", "test", "rtbus evaluate test", folder.path());
  EXPECT_THROW(experiment.run([] { throw std::runtime_error("a fault"); }, false), std::runtime_error);
}

}  // namespace
