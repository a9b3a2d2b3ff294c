// The driver's end of the bracket protocol, sentence by sentence, against a device that says what the test wants.
#include "drivers/phantom/phantom_protocol.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rtbus/clock.hpp"
#include "tests/unit/phantom/scripted_channel.hpp"

namespace drivers::phantom {
namespace {

using ::testing::HasSubstr;
using testing::ScriptedChannel;
using usb::ExchangeStatus;

const char* const kHome = "[2,0,0,0,0,0,0,0]\n";

class PhantomProtocolTest : public ::testing::Test {
 protected:
  PhantomProtocolTest() { use(ModelId::kVintage, HomingMode::kCounters); }

  void use(ModelId id, HomingMode mode) {
    PhantomSettings settings;
    settings.model = *find_model(static_cast<int>(id));
    settings.homing = mode;
    homing_ = std::make_shared<Homing>(Kinematics(settings.model), mode, settings.home_tolerance_rad);
    protocol_ = std::make_unique<PhantomProtocol>(settings, homing_);
  }

  std::string bring_up() {
    const auto done = protocol_->bring_up(channel_);
    return done ? "" : done.error().message;
  }

  ExchangeStatus exchange(const Vec3& force_n = {0.0, 1.0, 0.0}) {
    (void)protocol_->send(channel_, force_n, 1e-3, channel_.now_ns() + 10 * rtbus::kNsPerMs);
    const auto got = protocol_->receive(channel_, sample_, channel_.now_ns() + 12 * rtbus::kNsPerMs);
    (void)channel_.sleep_until(channel_.now_ns() + rtbus::kNsPerMs);
    return got;
  }

  ScriptedChannel::Device device_ = [](const std::string&) { return kHome; };
  ScriptedChannel channel_{[this](const std::string& command) { return device_(command); }};
  std::shared_ptr<Homing> homing_;
  std::unique_ptr<PhantomProtocol> protocol_;
  DeviceSample sample_;
};

TEST_F(PhantomProtocolTest, SetsTheLineAndNever134Baud) {
  ASSERT_EQ(bring_up(), "");
  ASSERT_EQ(channel_.controls.size(), 2u);
  EXPECT_EQ(channel_.controls[0].setup.request_type, 0x21);
  EXPECT_EQ(channel_.controls[0].setup.request, 0x20);
  EXPECT_EQ(channel_.controls[0].data, (std::vector<int>{0x00, 0xC2, 0x01, 0x00, 0x00, 0x00, 0x08}));
  EXPECT_EQ(channel_.controls[1].setup.request, 0x22);
  EXPECT_EQ(channel_.controls[1].setup.value, 0x0003);
}

TEST_F(PhantomProtocolTest, ProbesWithZeroCurrent) {
  ASSERT_EQ(bring_up(), "");
  ASSERT_GE(channel_.commands.size(), 2u);
  EXPECT_EQ(channel_.commands[0], "[0,0,0]");
  EXPECT_EQ(channel_.commands[1], "[0,0,0]");
  EXPECT_EQ(channel_.commands.back(), "[0,0,0]");
}

TEST_F(PhantomProtocolTest, SaysWhyItCannotBeBroughtUp) {
  device_ = [](const std::string&) { return ""; };
  EXPECT_THAT(bring_up(), HasSubstr("does not answer"));
  device_ = [](const std::string&) { return "hello world\n"; };
  EXPECT_THAT(bring_up(), HasSubstr("not in the bracket protocol"));
  device_ = [](const std::string&) { return "[3,0,0,0,0,0,0,0]\n"; };
  EXPECT_THAT(bring_up(), HasSubstr("is a WoodenHaptics (model 3), the device file says vintage"));
  device_ = [](const std::string&) { return "[9,0,0,0,0,0,0,0]\n"; };
  EXPECT_THAT(bring_up(), HasSubstr("answers as model 9"));
  device_ = [](const std::string&) { return "[2,0,0,0,0,0,0,512]\n"; };
  EXPECT_THAT(bring_up(), HasSubstr("wrong comma count"));
  channel_.control_status = usb::UsbStatus::kStall;
  EXPECT_THAT(bring_up(), HasSubstr("serial line"));
  channel_.control_status = usb::UsbStatus::kOk;
  channel_.lost = true;
  EXPECT_THAT(bring_up(), HasSubstr("unplugged"));
}

TEST_F(PhantomProtocolTest, ModelThatChangesBetweenProbesIsNotAccepted) {
  int n = 0;
  device_ = [&](const std::string&) { return ++n % 2 == 0 ? "[3,0,0,0,0,0,0,0]\n" : kHome; };
  EXPECT_NE(bring_up(), "");
}

TEST_F(PhantomProtocolTest, HalfALineFromBeforeCostsOneProbe) {
  bool first = true;
  device_ = [&](const std::string&) { return std::exchange(first, false) ? "[2,0,0,0,0,0,0,512]\n" : kHome; };
  EXPECT_EQ(bring_up(), "");
}

TEST_F(PhantomProtocolTest, SendsTheCurrentsOfTheVectors) {
  ASSERT_EQ(bring_up(), "");
  ASSERT_EQ(exchange({0.0, 0.0, 0.0}), ExchangeStatus::kSample);
  EXPECT_NEAR(sample_.position_m[0], 0.0, 1e-9);
  EXPECT_NEAR(sample_.position_m[1], -0.015, 1e-9);  // up: z of the maker
  EXPECT_NEAR(sample_.position_m[2], 0.0, 1e-9);
  (void)exchange({0.0, 0.0, 1.0});  // towards the user: x of the maker
  EXPECT_EQ(channel_.commands.back(), "[0,0,-622]");
  (void)exchange({1.0, 0.0, 0.0});
  EXPECT_EQ(channel_.commands.back(), "[-655,0,0]");
  (void)exchange({0.0, 1.0, 0.0});
  EXPECT_EQ(channel_.commands.back(), "[0,-766,0]");
}

TEST_F(PhantomProtocolTest, ClampsBelowTheFirmwaresLimitAlongTheForce) {
  ASSERT_EQ(bring_up(), "");
  (void)exchange({0.0, 0.0, 0.0});
  (void)exchange({0.0, 30.0, 10.0});
  EXPECT_EQ(protocol_->last_currents_ma()[1], -5999);
  EXPECT_NEAR(protocol_->last_currents_ma()[2], -621.601 / 3.0 * 5999.0 / 765.901, 1.0);
  EXPECT_EQ(protocol_->counters().clamped, 1u);
}

TEST_F(PhantomProtocolTest, NeverPipelines) {
  ASSERT_EQ(bring_up(), "");
  channel_.extra_delay_ns = 3 * rtbus::kNsPerMs;  // answers come late, the loop keeps asking
  for (int i = 0; i < 50; ++i) {
    (void)protocol_->send(channel_, {}, 1e-3, channel_.now_ns() + rtbus::kNsPerMs);
    (void)protocol_->receive(channel_, sample_, channel_.now_ns() + rtbus::kNsPerMs / 2);
  }
  EXPECT_EQ(channel_.pipelined, 0);
  EXPECT_EQ(protocol_->counters().lost_frames, 0u);
  EXPECT_GT(protocol_->counters().exchanges, 5u);
}

TEST_F(PhantomProtocolTest, SilenceMeansZeroWithinTwentyMilliseconds) {
  ASSERT_EQ(bring_up(), "");
  (void)exchange();
  (void)exchange();
  ASSERT_EQ(channel_.commands.back(), "[0,-766,0]");
  device_ = [](const std::string&) { return ""; };
  const std::uint64_t silent_ns = channel_.now_ns();
  while (channel_.commands.back() != "[0,0,0]" && channel_.now_ns() < silent_ns + 100 * rtbus::kNsPerMs) {
    (void)protocol_->send(channel_, {0.0, 1.0, 0.0}, 1e-3, channel_.now_ns() + rtbus::kNsPerMs);
    (void)protocol_->receive(channel_, sample_, channel_.now_ns() + rtbus::kNsPerMs);
  }
  EXPECT_EQ(channel_.commands.back(), "[0,0,0]");
  EXPECT_LT(channel_.now_ns() - silent_ns, 20 * rtbus::kNsPerMs);
  EXPECT_GE(protocol_->counters().lost_frames, 1u);
  device_ = [](const std::string&) { return kHome; };
  for (int i = 0; i < 20; ++i) (void)exchange();
  EXPECT_EQ(channel_.commands.back(), "[0,-766,0]");  // and it comes back
}

TEST_F(PhantomProtocolTest, LateAnswerDoesNotShiftTheSequence) {
  ASSERT_EQ(bring_up(), "");
  (void)exchange();
  // One answer comes so late that its command is given up; then all answers carry a count.
  int count = 0;
  device_ = [&](const std::string&) { return "[2," + std::to_string(++count) + ",0,0,0,0,0,0]\n"; };
  channel_.extra_delay_ns = 12 * rtbus::kNsPerMs;
  EXPECT_EQ(exchange(), ExchangeStatus::kNothing);
  channel_.extra_delay_ns = 0;
  for (int i = 0; i < 5; ++i) (void)exchange();
  EXPECT_EQ(protocol_->last_reply().arm[0], count);  // the newest, not the one before
  EXPECT_EQ(protocol_->counters().lost_frames, 1u);
}

TEST_F(PhantomProtocolTest, ErrorBitsOfTheCommandMeanZeroNextAndNoSample) {
  ASSERT_EQ(bring_up(), "");
  (void)exchange();
  for (const std::uint32_t error : {8u, 128u, 256u, 512u, 1024u, 4096u}) {
    const std::uint64_t before = protocol_->counters().line_errors;
    bool once = true;
    device_ = [&](const std::string&) {
      return std::exchange(once, false) ? "[2,99,0,0,0,0,0," + std::to_string(error) + "]\n" : kHome;
    };
    EXPECT_EQ(exchange(), ExchangeStatus::kNothing) << error;
    EXPECT_EQ(protocol_->counters().line_errors, before + 1);
    EXPECT_EQ(exchange(), ExchangeStatus::kSample);
    EXPECT_EQ(channel_.commands.back(), "[0,0,0]") << error;
    (void)exchange();
    EXPECT_EQ(channel_.commands.back(), "[0,-766,0]") << error;
  }
}

// Whoever asked must know that nothing came of it: else the force would be back at once, without its ramp.
TEST_F(PhantomProtocolTest, TellsEachForceThatItWithholds) {
  bool error = false;
  device_ = [&](const std::string&) { return error ? "[2,0,0,0,0,0,0,8]\n" : kHome; };
  ASSERT_EQ(bring_up(), "");
  ASSERT_EQ(exchange(), ExchangeStatus::kSample);
  (void)exchange();
  EXPECT_FALSE(protocol_->withheld());
  EXPECT_NE(channel_.commands.back(), "[0,0,0]");
  error = true;
  (void)exchange();
  error = false;
  (void)exchange();  // the answer before was an error
  EXPECT_EQ(channel_.commands.back(), "[0,0,0]");
  EXPECT_TRUE(protocol_->withheld());
  (void)exchange();
  EXPECT_FALSE(protocol_->withheld());
  // Nobody asked: nothing is withheld.
  error = true;
  (void)exchange({0.0, 0.0, 0.0});
  (void)exchange({0.0, 0.0, 0.0});
  EXPECT_FALSE(protocol_->withheld());
  // Silence.
  error = false;
  (void)exchange();
  (void)exchange();
  ASSERT_FALSE(protocol_->withheld());
  device_ = [](const std::string&) { return ""; };
  (void)exchange();  // its answer never comes
  (void)exchange();
  EXPECT_EQ(channel_.commands.back(), "[0,0,0]");
  EXPECT_TRUE(protocol_->withheld());
}

TEST_F(PhantomProtocolTest, NotHomedWithholds) {
  use(ModelId::kVintage, HomingMode::kAtStart);
  device_ = [](const std::string&) { return "[2,1500,300,0,0,0,0,0]\n"; };
  ASSERT_EQ(bring_up(), "");
  (void)exchange();
  EXPECT_TRUE(protocol_->withheld());
}

TEST_F(PhantomProtocolTest, GimbalErrorsKeepTheOrientationAndThePosition) {
  device_ = [](const std::string&) { return "[2,0,0,0,100,200,300,0]\n"; };
  ASSERT_EQ(bring_up(), "");
  (void)exchange();
  const Quat before = sample_.orientation_wxyz;
  EXPECT_LT(before[0], 0.99);
  device_ = [](const std::string&) { return "[2,5,0,0,0,0,0,2]\n"; };
  EXPECT_EQ(exchange(), ExchangeStatus::kSample);
  EXPECT_EQ(sample_.orientation_wxyz, before);
  EXPECT_NE(sample_.position_m[0], 0.0);
  EXPECT_EQ(protocol_->counters().line_errors, 1u);
  (void)exchange();
  EXPECT_NE(channel_.commands.back(), "[0,0,0]");  // the force stays
}

TEST_F(PhantomProtocolTest, ImpossiblePoseKeepsTheLastOneAndCommandsZero) {
  use(ModelId::kPolhem, HomingMode::kCounters);
  device_ = [](const std::string&) { return "[1,-8312,2000,0,0,0,0,0]\n"; };
  ASSERT_EQ(bring_up(), "");
  (void)exchange();
  (void)exchange();
  const Vec3 before = sample_.position_m;
  EXPECT_NE(channel_.commands.back(), "[0,0,0]");
  // No arm goes there within a millisecond: first a damaged answer, then no home any more.
  device_ = [](const std::string&) { return "[1,-8312,0,-4000,0,0,0,0]\n"; };
  EXPECT_EQ(exchange(), ExchangeStatus::kNothing);
  EXPECT_EQ(exchange(), ExchangeStatus::kSample);
  EXPECT_EQ(channel_.commands.back(), "[0,0,0]");
  EXPECT_EQ(protocol_->readiness(), usb::Readiness::kNotHomed);
  EXPECT_EQ(sample_.position_m, before);
  EXPECT_GE(protocol_->impossible_poses(), 2u);
}

TEST_F(PhantomProtocolTest, NoForceBeforeItIsHomed) {
  use(ModelId::kVintage, HomingMode::kAtStart);
  device_ = [](const std::string&) { return "[2,1500,300,0,0,0,0,0]\n"; };
  ASSERT_EQ(bring_up(), "");
  for (int i = 0; i < 500; ++i) {
    (void)exchange();
    ASSERT_EQ(channel_.commands.back(), "[0,0,0]");
  }
  EXPECT_EQ(protocol_->readiness(), usb::Readiness::kNotHomed);
  EXPECT_THAT(protocol_->remedy(), HasSubstr("at home, with "));
}

TEST_F(PhantomProtocolTest, CalibrationNeededFirmwareIsNoticedAndWaitedFor) {
  use(ModelId::kVintage, HomingMode::kAtStart);
  bool calibrated = false;
  device_ = [&](const std::string& command) {
    if (calibrated) return std::string(kHome);
    return "[2,8000," + command.substr(1, command.find(',') - 1) + ",0,0,0,0,0]\n";
  };
  ASSERT_EQ(bring_up(), "");
  for (int i = 0; i < 1000; ++i) (void)exchange();
  EXPECT_EQ(protocol_->readiness(), usb::Readiness::kNotHomed);
  EXPECT_THAT(protocol_->remedy(), HasSubstr("shows no counters before it was calibrated"));
  calibrated = true;
  for (int i = 0; i < 400; ++i) (void)exchange();
  EXPECT_EQ(protocol_->readiness(), usb::Readiness::kReady);
  EXPECT_EQ(channel_.commands.back(), "[0,-766,0]");
}

TEST_F(PhantomProtocolTest, AnotherModelInMidRunIsAFault) {
  ASSERT_EQ(bring_up(), "");
  device_ = [](const std::string&) { return "[3,0,0,0,0,0,0,0]\n"; };
  EXPECT_EQ(exchange(), ExchangeStatus::kNothing);
  EXPECT_EQ(exchange(), ExchangeStatus::kNothing);
  EXPECT_EQ(exchange(), ExchangeStatus::kFault);
  EXPECT_THAT(protocol_->fault(), HasSubstr("model 3 instead of 2"));
}

TEST_F(PhantomProtocolTest, ShutDownSendsZeroAndLowersTheLine) {
  ASSERT_EQ(bring_up(), "");
  (void)exchange();
  (void)exchange();
  const std::uint64_t before_ns = channel_.now_ns();
  protocol_->shut_down(channel_);
  EXPECT_EQ(channel_.commands.back(), "[0,0,0]");
  EXPECT_EQ(channel_.controls.back().setup.request, 0x22);
  EXPECT_EQ(channel_.controls.back().setup.value, 0x0000);
  EXPECT_EQ(channel_.pipelined, 0);
  EXPECT_LT(channel_.now_ns() - before_ns, 50 * rtbus::kNsPerMs);
}

TEST_F(PhantomProtocolTest, ShutDownOfASilentDeviceIsBounded) {
  ASSERT_EQ(bring_up(), "");
  device_ = [](const std::string&) { return ""; };
  (void)protocol_->send(channel_, {}, 1e-3, channel_.now_ns() + rtbus::kNsPerMs);
  const std::uint64_t before_ns = channel_.now_ns();
  protocol_->shut_down(channel_);
  EXPECT_LE(channel_.now_ns() - before_ns, 50 * rtbus::kNsPerMs);
}

}  // namespace
}  // namespace drivers::phantom
