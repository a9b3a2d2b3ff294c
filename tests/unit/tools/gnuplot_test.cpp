#include "tools/cli/common/gnuplot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <array>
#include <fstream>
#include <iterator>
#include <string>

namespace tools {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class GnuplotTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "gnuplot_test_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    gnuplot_ = Gnuplot::find();
  }
  void TearDown() override { fs::remove_all(folder_); }

  static std::string beginning_of(const fs::path& file, std::size_t bytes) {
    std::ifstream in(file, std::ios::binary);
    std::string text(bytes, '\0');
    in.read(text.data(), static_cast<std::streamsize>(bytes));
    return text;
  }

  fs::path folder_;
  std::optional<Gnuplot> gnuplot_;
};

TEST(GnuplotQuoted, DoublesQuotesAndKeepsTheTextOnOneLine) {
  EXPECT_EQ(gnuplot_quoted("K 200 N/m"), "'K 200 N/m'");
  EXPECT_EQ(gnuplot_quoted("it's\nhere"), "'it''s here'");
}

TEST_F(GnuplotTest, DrawsBothFormatsAndLeavesTheScriptBesideThem) {
  if (!gnuplot_) GTEST_SKIP() << "gnuplot is not installed";
  std::ofstream(folder_ / "ramp.tsv") << "# time_s\tforce_n\n0\t0\n1\t2\n";
  const auto drawn =
      gnuplot_->draw(folder_, {"ramp", "set title 'a_b' noenhanced\nplot 'ramp.tsv' using 1:2 with lines\n", 400, 300});
  ASSERT_TRUE(drawn.has_value()) << drawn.error();
  ASSERT_EQ(drawn->size(), 2u);
  EXPECT_EQ(beginning_of(folder_ / "ramp.png", 8), "\x89PNG\r\n\x1a\n");
  EXPECT_THAT(beginning_of(folder_ / "ramp.svg", 400), HasSubstr("<svg"));
  EXPECT_TRUE(fs::exists(folder_ / "ramp.gp"));
  EXPECT_TRUE(fs::exists(folder_ / "ramp.tsv"));
}

TEST_F(GnuplotTest, PassesOnWhatGnuplotComplainsAbout) {
  if (!gnuplot_) GTEST_SKIP() << "gnuplot is not installed";
  const auto drawn = gnuplot_->draw(folder_, {"broken", "plot 'there_is_no_such_file.tsv'\n"});
  ASSERT_FALSE(drawn.has_value());
  EXPECT_THAT(drawn.error(), HasSubstr("broken.gp"));
  EXPECT_THAT(drawn.error(), HasSubstr("there_is_no_such_file.tsv"));
}

TEST_F(GnuplotTest, IsNotFoundOnAPathWithoutIt) {
  const char* const path = ::getenv("PATH");
  const std::string before = path == nullptr ? "" : path;
  ::setenv("PATH", folder_.c_str(), 1);
  const bool found = Gnuplot::find().has_value();
  ::setenv("PATH", before.c_str(), 1);
  EXPECT_FALSE(found);
}

TEST_F(GnuplotTest, FailsOnAFolderThatIsNotThere) {
  if (!gnuplot_) GTEST_SKIP() << "gnuplot is not installed";
  const auto drawn = gnuplot_->draw(folder_ / "nowhere", {"ramp", "plot x\n"});
  ASSERT_FALSE(drawn.has_value());
  EXPECT_THAT(drawn.error(), HasSubstr("cannot write"));
}

}  // namespace
}  // namespace tools
