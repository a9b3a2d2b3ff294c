// Runs the readers of this library over the tables of wrong files in tests/data/bad_configs.
#include "tests/support/bad_config.hpp"

#include <gtest/gtest.h>

#include "rtbus/config/scene.hpp"
#include "rtbus/config/session.hpp"

namespace {

using rtbus::config::Map;
using rtbus::config::Override;
using tests::BadConfig;

class BadDocument : public testing::TestWithParam<BadConfig> {};
TEST_P(BadDocument, IsRefusedWithItsReason) {
  EXPECT_TRUE(tests::fails_as_expected(GetParam(), [](const std::string& file, const std::vector<Override>& sets) {
    (void)rtbus::config::load(file, sets);
  }));
}
INSTANTIATE_TEST_SUITE_P(Files, BadDocument, testing::ValuesIn(tests::bad_configs("document")), tests::bad_config_name);

class BadScene : public testing::TestWithParam<BadConfig> {};
TEST_P(BadScene, IsRefusedWithItsReason) {
  EXPECT_TRUE(tests::fails_as_expected(GetParam(), [](const std::string& file, const std::vector<Override>& sets) {
    Map map = rtbus::config::load(file, sets);
    (void)rtbus::config::read_scene(map);
  }));
}
INSTANTIATE_TEST_SUITE_P(Files, BadScene, testing::ValuesIn(tests::bad_configs("scene")), tests::bad_config_name);

class BadSession : public testing::TestWithParam<BadConfig> {};
TEST_P(BadSession, IsRefusedWithItsReason) {
  EXPECT_TRUE(tests::fails_as_expected(GetParam(), [](const std::string& file, const std::vector<Override>& sets) {
    (void)rtbus::config::load_session(file, sets);
  }));
}
INSTANTIATE_TEST_SUITE_P(Files, BadSession, testing::ValuesIn(tests::bad_configs("session")), tests::bad_config_name);

TEST(BadConfigTable, IsNotEmpty) {
  for (const char* folder : {"document", "scene", "session"}) {
    EXPECT_GE(tests::bad_configs(folder).size(), 10U) << folder;
  }
}

TEST(BadConfigTable, NoticesAFileThatIsAcceptedAndAMessageThatDiffers) {
  const BadConfig bad{"/x.yaml", "is below", {}};
  EXPECT_FALSE(tests::fails_as_expected(bad, [](const std::string&, const std::vector<Override>&) {}));
  EXPECT_FALSE(tests::fails_as_expected(
      bad, [](const std::string&, const std::vector<Override>&) { throw rtbus::config::Error("/x.yaml: is above"); }));
  EXPECT_TRUE(tests::fails_as_expected(
      bad, [](const std::string&, const std::vector<Override>&) { throw rtbus::config::Error("/x.yaml: is below"); }));
}

}  // namespace
