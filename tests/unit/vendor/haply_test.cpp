// Haply's devices: the messages of the service, and the driver on the stand-in for it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "drivers/haply/service_messages.hpp"
#include "tests/unit/vendor/desk.hpp"

namespace drivers::haply {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::Desk;
using tests::problem_of;
using tests::Trigger;

TEST(ServiceMessages, OnlyTheFirstNamesTheProgramAndTheForceIsWhereTheReleaseLooksForIt) {
  std::string out;
  write_command(out, true, "049D", "6121", "verse_grip", ForceField::kVector, {0.0, -1.5, 0.25});
  EXPECT_THAT(out, HasSubstr(R"("session":{"configure":{"profile":{"name":"rtbus"}}})"));
  EXPECT_THAT(out, HasSubstr(R"("set_cursor_force":{"vector":{"x":0.000000,"y":-1.500000,"z":0.250000}})"));
  EXPECT_THAT(out, HasSubstr(R"("verse_grip":[{"device_id":"6121","commands":{"probe_orientation":{}}}])"));
  write_command(out, false, "049D", "", "", ForceField::kValues, {1.0, 0.0, 0.0});
  EXPECT_EQ(
      out,
      R"({"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":{"values":{"x":1.000000,"y":0.000000,"z":0.000000}}}}]})");
}

TEST(ServiceMessages, ReadsIntegersExponentsNullsAndUnknownKeys) {
  const auto read = read_state(
      R"({"new":1,"inverse3":[{"device_id":"A","x":null,"state":{"cursor_position":{"x":1,"y":-2e-2,"z":0.5,"w":9},
          "current_cursor_force":null,"transform":{}},"status":{"calibrated":true}}],
          "wireless_verse_grip":[{"device_id":"G","state":{"orientation":{"w":1,"x":0,"y":0,"z":0},"button_1":1}}]})",
      "A", "G");
  ASSERT_TRUE(read) << read.error();
  ASSERT_TRUE(*read);
  EXPECT_THAT((*read)->position_m, ElementsAre(1.0, -0.02, 0.5));
  EXPECT_THAT((*read)->force_n, ElementsAre(0.0, 0.0, 0.0));
  EXPECT_TRUE(std::isnan((*read)->velocity_m_s[0])) << "the answer has none";
  EXPECT_TRUE((*read)->calibrated);
  EXPECT_EQ((*read)->buttons, 2u);
  EXPECT_TRUE((*read)->grip_wxyz);
}

TEST(ServiceMessages, TellsADeviceThatIsNotThereFromNonsense) {
  const auto gone = read_state(R"({"inverse3":[]})", "A", "");
  ASSERT_TRUE(gone);
  EXPECT_FALSE(*gone);
  EXPECT_FALSE(read_state("[1,2", "A", ""));
  EXPECT_FALSE(read_state(R"({"inverse3":[{"device_id":"A","state":{}}]})", "A", ""));
}

TEST(ServiceMessages, ReportsSettingsThatChangeTheForce) {
  const auto read = read_inventory(
      R"({"inverse3":[{"device_id":"A","config":{"force_scale":0.5,"damping":{"scalar":0.2},"filters":{"force_gate":0}}}]})");
  ASSERT_TRUE(read);
  EXPECT_THAT(read->not_neutral, ElementsAre("damping = 0.2", "force_scale = 0.5"));
}

TEST(ServiceMessages, ReadsTheVersionInAndOutOfAnEnvelope) {
  EXPECT_EQ(read_version(R"({"ok":true,"data":{"project_version":"3.5.1","git_describe":"x"}})"), (Version{3, 5}));
  EXPECT_EQ(read_version(R"({"project_version":"3.10"})"), (Version{3, 10}));
  EXPECT_GT(Version({3, 10}), Version({3, 5}));
  for (const char* const text : {"", "{}", R"({"data":{"project_version":"new"}})", R"({"project_version":3.5})"}) {
    EXPECT_FALSE(read_version(text)) << text;
  }
}

TEST(ServiceMessages, ShowsEventsThatAreNotHarmless) {
  EXPECT_EQ(read_event(R"({"name":"device-connected","level":"info","message":"here"})"), "");
  EXPECT_EQ(read_event("nonsense"), "");
  EXPECT_EQ(read_event(R"({"name":"device-calibration-failed","level":"error","data":{"reason":"pen_asleep"}})"),
            R"(the Inverse Service says device-calibration-failed {"reason":"pen_asleep"})");
}

TEST(ServiceMessages, FramesAreThereAndBack) {
  const Vec3 d{1.0, 2.0, 3.0};
  EXPECT_EQ(from_service(to_service(d)), d);
  EXPECT_LT(from_service(Vec3{0.0, -1.0, 0.0})[1], 1e-12);
  EXPECT_GT(from_service(Vec3{0.0, -1.0, 0.0})[2], 0.9) << "towards the user";
  EXPECT_GT(from_service(Vec3{0.0, 0.0, 1.0})[1], 0.9) << "up";
}

// --- The driver -----------------------------------------------------------------------------------------------------

std::string inverse3(const std::string& unit, const std::string& keys = "") {
  return "{schema: device/1, driver: haply, model: inverse3" + (keys.empty() ? "" : ", " + keys) +
         ", virtual: {mechanics: {mass_kg: 0.5, coulomb_n: 0}" + (unit.empty() ? "" : ", " + unit) + "}}";
}

class Haply : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const DriverEntry& driver : registered_drivers()) {
      if (driver.name == "haply" && !driver_present(driver)) GTEST_SKIP() << "built without libwebsockets";
    }
  }
};

TEST_F(Haply, PushesInTheDirectionThatIsAsked) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Desk desk(inverse3(""));
    ASSERT_EQ(desk.start(), "");
    ASSERT_TRUE(desk.ready());
    Vec3 force{};
    force[axis] = 2.0;
    EXPECT_TRUE(desk.until(3.0, force, [&] { return desk.sample.position_m[axis] > 0.005; })) << axis;
    // On a spring around 10 mm it goes to and fro, so that a busy machine meets it in motion sooner or later.
    const auto spring = [&](const DeviceSample& sample) {
      Vec3 n{};
      n[axis] = 2.0 - 200.0 * sample.position_m[axis];
      return n;
    };
    bool rises = false;
    double before_m = desk.sample.position_m[axis];
    for (const std::uint64_t end_ns = rtbus::monotonic_ns() + 5 * rtbus::kNsPerS;
         !rises && rtbus::monotonic_ns() < end_ns;) {
      (void)desk.cycle(spring);
      rises = desk.sample.position_m[axis] > before_m && desk.sample.velocity_m_s[axis] > 0.05;
      before_m = desk.sample.position_m[axis];
    }
    EXPECT_TRUE(rises) << axis << ": where it moves upwards, so says its velocity";
    for (std::size_t other = 0; other < 3; ++other) {
      if (other != axis) {
        EXPECT_NEAR(desk.sample.position_m[other], 0.0, 1e-4);
      }
    }
  }
}

// The naive way: send what one release understands, and believe that another does too.
TEST_F(Haply, FindsTheFieldThatTheServiceUnderstands) {
  Desk naive(inverse3("understands: values", "force_field: vector"));
  ASSERT_EQ(naive.start(), "");
  ASSERT_TRUE(naive.ready());
  EXPECT_FALSE(naive.moves({2.0, 0, 0}, 0.002, 0.5)) << "ignored without a word";
  EXPECT_THAT(naive.said, HasSubstr("renders none of the forces"));
  Desk desk(inverse3("understands: values"));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_TRUE(desk.moves({2.0, 0, 0}, 0.005, 3.0));
}

TEST_F(Haply, TheVersionSaysWhichFieldItIs) {
  Desk desk(inverse3("version: 3.3.2, understands: values"));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_TRUE(desk.moves({2.0, 0, 0}, 0.005, 3.0));
  EXPECT_EQ(desk.device->link_stats()->withheld, 0u) << "the first guess was right";
  EXPECT_THAT(problem_of(inverse3("version: 3.0.7")), HasSubstr("has version 3.0; install version 3.1 or later"));
  EXPECT_EQ(problem_of(inverse3("version: \"\"")), "") << "a service that tells no version is tried";
}

TEST_F(Haply, EventsOfTheServiceAreShown) {
  const Trigger trigger;
  Desk desk(inverse3("stall_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("device-safety-triggered"));
  EXPECT_THAT(desk.said, HasSubstr("a motor stalls"));
  EXPECT_TRUE(desk.ready()) << "an event is a message, no fault";
  EXPECT_EQ(desk.device->link_stats()->losses, 0u);
}

// The naive way: believe that the force is one's own.
TEST_F(Haply, MoreForceThanToldIsAFault) {
  Desk desk(inverse3("other_client_n: [1.5, 0, 0]"));
  ASSERT_EQ(desk.start(), "");
  EXPECT_TRUE(desk.says("another program commands"));
}

TEST_F(Haply, SlowAnswersCostSamplesNotTheForce) {
  Desk desk(inverse3("slow_reply_us: 3000"));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_TRUE(desk.moves({2.0, 0, 0}, 0.005, 3.0));
  EXPECT_THAT(desk.said, Not(HasSubstr("does not answer")));
}

TEST_F(Haply, AServiceThatRendersNothingIsAFault) {
  Desk desk(inverse3("force_scale: 0"));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_TRUE(desk.until(5.0, {2.0, 0, 0}, [&] { return desk.said.find("force_scale 0") != std::string::npos; }));
  EXPECT_THAT(desk.said, HasSubstr("force_scale = 0"));
}

TEST_F(Haply, ReadsGripOrientationAboutTheVertical) {
  Desk desk(inverse3("grip_rad: 0.5"));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_NEAR(desk.sample.orientation_wxyz[0], std::cos(0.25), 1e-6);
  EXPECT_NEAR(desk.sample.orientation_wxyz[2], std::sin(0.25), 1e-6) << "the service's z is our y";
}

TEST_F(Haply, AnswersInFragmentsAreOneAnswer) {
  Desk desk(inverse3("fragments: true"));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_TRUE(desk.moves({2.0, 0, 0}, 0.005, 3.0));
}

TEST_F(Haply, SaysWhatIsWrongBeforeAnythingStarts) {
  EXPECT_THAT(problem_of("{schema: device/1, driver: haply, model: inverse3, port: 1}"),
              HasSubstr("sudo systemctl start haply-inverse-service"));
  EXPECT_THAT(problem_of(inverse3("format_3_0: true")), HasSubstr("install version 3.1 or later"));
  EXPECT_THAT(problem_of(inverse3("", "device_id: FFFF")), HasSubstr("no Inverse3 has the id FFFF; there is: 049D"));
  EXPECT_THAT(problem_of(inverse3("", "grip_id: \"9\"")),
              HasSubstr("no VerseGrip has the id 9; there is: verse_grip:6121"));
}

TEST_F(Haply, UncalibratedItHasNoForceAndSaysHowToCalibrate) {
  const Trigger trigger;
  Desk desk(inverse3("uncalibrate_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("magnet"));
  EXPECT_TRUE(desk.until(5.0, {}, [&] { return desk.read == IoStatus::kLost; }));
}

TEST_F(Haply, UnpluggedItIsLostAndComesBack) {
  const Trigger trigger;
  Desk desk(inverse3(trigger.key("unplug_at_s: 0, replug_after_s: 0.5")));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("unplugged"));
  EXPECT_TRUE(desk.says("the device is back", 10.0)) << desk.said;
  EXPECT_TRUE(desk.ready());
}

TEST_F(Haply, AServiceThatFallsSilentIsLost) {
  const Trigger trigger;
  Desk desk(inverse3("mute_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("does not answer any more"));
}

TEST_F(Haply, AConnectionThatIsClosedIsOpenedAnew) {
  const Trigger trigger;
  Desk desk(inverse3("close_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("closed the connection"));
  EXPECT_TRUE(desk.ready(10.0)) << desk.said;
}

}  // namespace
}  // namespace drivers::haply
