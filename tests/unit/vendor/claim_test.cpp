// Two sessions that want one device: who is told what, and when a claim ends.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>
#include <utility>

#include "drivers/vendor/claim.hpp"
#include "tests/unit/vendor/desk.hpp"

namespace drivers::vendor {
namespace {

using ::testing::HasSubstr;
using tests::problem_of;

/// No other run of these tests, on this machine at this time, uses it.
const std::string kUnit = std::to_string(::getpid() % 60000 + 1);
const std::string kDevice = "test device " + kUnit;

TEST(Claim, TheSecondIsToldWhoseItIsUntilThatOneLetsGo) {
  auto first = Claim::take(kDevice, "session wall, node haptic0");
  ASSERT_TRUE(first);
  EXPECT_TRUE(first->held());
  const auto second = Claim::take(kDevice, "session other");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error(), "session wall, node haptic0 (pid " + std::to_string(::getpid()) + ")");
  EXPECT_TRUE(Claim::take(kDevice + "0", "session other")) << "a device whose name begins alike";
  first->release();
  EXPECT_TRUE(Claim::take(kDevice, "session other"));
}

TEST(Claim, MovesWithItsObject) {
  auto taken = Claim::take(kDevice, "session wall");
  ASSERT_TRUE(taken);
  {
    const Claim moved = std::move(*taken);
    EXPECT_FALSE(Claim::take(kDevice, "session other"));
  }
  EXPECT_TRUE(Claim::take(kDevice, "session other"));
}

TEST(Claim, EndsWithItsProcessHoweverThatEnds) {
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const auto claim = Claim::take(kDevice, "session of the child");
    (void)!::write(ready[1], claim ? "y" : "n", 1);
    for (;;) ::pause();
  }
  char took = 0;
  ASSERT_EQ(::read(ready[0], &took, 1), 1);
  EXPECT_EQ(took, 'y');
  const auto mine = Claim::take(kDevice, "mine");
  ASSERT_FALSE(mine);
  EXPECT_EQ(mine.error(), "session of the child (pid " + std::to_string(child) + ")");
  EXPECT_THAT(other_owner("test device "), HasSubstr("session of the child"));
  ASSERT_EQ(::kill(child, SIGKILL), 0);
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
  EXPECT_TRUE(Claim::take(kDevice, "mine"));
  ::close(ready[0]);
  ::close(ready[1]);
}

std::string unit(const std::string& driver) {
  return "{schema: device/1, driver: " + driver + ", virtual: {serial: \"" + kUnit + "\", one_session: true}}";
}

TEST(Claim, EachDriverRefusesADeviceThatAnotherSessionHas) {
  const std::pair<const char*, const char*> kDrivers[] = {{"force_dimension", "force_dimension, model: omega3"},
                                                          {"openhaptics", "openhaptics, model: touch"},
                                                          {"haply", "haply, model: inverse3"}};
  for (const auto& [name, device] : kDrivers) {
    for (const DriverEntry& driver : registered_drivers()) {
      if (driver.name != name || !driver_present(driver)) continue;
      auto other = Claim::take(std::string(name) + " virtual " + kUnit, "session wall, node haptic0");
      ASSERT_TRUE(other);
      EXPECT_THAT(problem_of(unit(device)), HasSubstr("session wall, node haptic0 (pid ")) << name;
      other->release();
      EXPECT_EQ(problem_of(unit(device)), "") << name;
      EXPECT_TRUE(Claim::take(std::string(name) + " virtual " + kUnit, "a third")) << name << " has let go of it";
    }
  }
}

}  // namespace
}  // namespace drivers::vendor
