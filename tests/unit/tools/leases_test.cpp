// What holds only while somebody renews it, and who holds an E-stop.
#include "tools/cli/run/leases.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tools {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(Leases, AreToldOnceWhenTheirTimeIsOver) {
  Leases leases;
  leases.renew("a", 100);
  leases.renew("b", 200);
  EXPECT_THAT(leases.take_expired(99), IsEmpty());
  leases.renew("a", 150);
  EXPECT_THAT(leases.take_expired(149), IsEmpty());
  EXPECT_THAT(leases.take_expired(150), ElementsAre("a"));
  EXPECT_THAT(leases.take_expired(199), IsEmpty());
  EXPECT_THAT(leases.take_expired(1000), ElementsAre("b"));
}

TEST(Leases, AreEndedByWhoeverTookThem) {
  Leases leases;
  leases.renew("a", 100);
  leases.end("a");
  leases.end("never");
  EXPECT_THAT(leases.take_expired(1000), IsEmpty());
}

TEST(Holders, LetGoEachForItself) {
  Holders holders;
  holders.hold("bridge");
  holders.hold("");
  holders.hold("bridge");
  EXPECT_THAT(holders.all(), ElementsAre("bridge", ""));
  holders.let_go("bridge");
  EXPECT_TRUE(holders.any());
  EXPECT_FALSE(holders.holds("bridge"));
  holders.let_go("");
  EXPECT_FALSE(holders.any());
}

}  // namespace
}  // namespace tools
