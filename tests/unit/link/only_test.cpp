// `--only` and `network`: who runs here, whose link leads to another machine, and what is refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rtbus/config/session.hpp"
#include "rtbus/config/shared_keys.hpp"
#include "tools/link/config/only.hpp"

namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

rtbus::config::SessionConfig wall(const std::vector<std::string>& assignments) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  return rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml", overrides);
}

/// What is wrong with it; empty: nothing.
std::string complaint(const std::vector<std::string>& assignments, const std::vector<std::string>& only = {}) {
  try {
    rtbus::config::SessionConfig session = wall(assignments);
    (void)link_dds::split_session(session, only);
    (void)rtbus::config::read_link_config(session.haptic.front().map);
  } catch (const rtbus::config::Error& error) {
    return error.what();
  }
  return "";
}

TEST(LinkOnly, DividesASessionBetweenMachines) {
  rtbus::config::SessionConfig session = wall({"haptic.0.link=dds"});
  EXPECT_THAT(link_dds::split_session(session, {}).here, ElementsAre("physics", "haptic0"));
  EXPECT_THAT(link_dds::split_session(session, {}).crossed, IsEmpty());
  for (const char* const node : {"physics", "haptic0"}) {
    const link_dds::Split split = link_dds::split_session(session, {node});
    EXPECT_THAT(split.here, ElementsAre(node));
    EXPECT_TRUE(split.crosses("haptic0"));
  }
  EXPECT_FALSE(link_dds::split_session(session, {"physics", "haptic0"}).crosses("haptic0"));
}

TEST(LinkOnly, SaysWhatDoesNotFit) {
  EXPECT_THAT(complaint({}, {"haptic0"}), HasSubstr("write link: dds"));
  EXPECT_THAT(complaint({"haptic.0.link=dds"}, {"haptic1"}), HasSubstr("it has physics, haptic0"));
  EXPECT_THAT(complaint({"haptic.0.link=dds", "network.machines.physics=10.0.0.2", "network.machines.haptic0=10.0.0.1"},
                        {"physics", "haptic0"}),
              HasSubstr("different addresses"));
  EXPECT_THAT(complaint({"haptic.0.link_round_trip_ms=50"}), HasSubstr("is for link: dds"));
  EXPECT_THAT(complaint({"haptic.0.link=dds", "haptic.0.link_round_trip_ms=5000"}), HasSubstr("link_round_trip_ms"));
}

TEST(LinkOnly, AddressesAreGivenForAllOrForNone) {
  EXPECT_EQ(wall({}).network.machine_of("physics"), "127.0.0.1");
  EXPECT_EQ(wall({}).network.domain, 77);
  const std::vector<std::string> both{"network.machines.physics=10.0.0.2", "network.machines.haptic0=10.0.0.1"};
  EXPECT_EQ(wall(both).network.machine_of("physics"), "10.0.0.2");
  EXPECT_THAT(complaint({"network.machines.physics=10.0.0.2"}), HasSubstr("haptic0"));
  EXPECT_THAT(complaint({"network.machines.physics=gpu.box", "network.machines.haptic0=10.0.0.1"}),
              HasSubstr("is no IPv4 address"));
  EXPECT_THAT(complaint({"network.domain=233"}), HasSubstr("network.domain"));
}

}  // namespace
