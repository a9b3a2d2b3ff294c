// Devices of Force Dimension on the stand-in for their library: first what the library does to a naive caller, then
// what the driver makes of each fault.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <thread>

#include "drivers/force_dimension/sdk.hpp"
#include "drivers/virtual_vendor/force_dimension/plug.hpp"
#include "tests/unit/vendor/desk.hpp"

#include <dlfcn.h>

namespace drivers::force_dimension {
namespace {

namespace stand_in = virtual_vendor::force_dimension;
using ::testing::HasSubstr;
using tests::Desk;
using tests::problem_of;
using tests::Trigger;

const std::string kLibrary = std::string(RTBUS_BINARY_DIR) + "/" + stand_in::kLibrary;

/// The stand-in's library as a program of one's own would call it.
class FdLibrary : public ::testing::Test {
 protected:
  void SetUp() override {
    auto sdk = load_sdk(kLibrary);
    ASSERT_TRUE(sdk) << sdk.error();
    sdk_ = *sdk;
    stand_in::Settings settings;
    settings.unit.serial = "1";
    settings.unit.mechanics.mass_kg = 0.2;
    settings.unit.mechanics.coulomb_n = 0.0;
    settings.unit.mechanics.gravity_m_s2.setZero();
    settings.unit.call_us = 50.0;
    settings.auto_init_s = 0.05;
    change(settings);
    plug(settings);
    const int id = sdk_.dhdOpenSerial(1);
    ASSERT_GE(id, 0);
    id_ = static_cast<char>(id);
  }
  void TearDown() override { (void)sdk_.dhdClose(id_); }
  virtual void change(stand_in::Settings&) {}
  static virtual_vendor::Plugged plugged(const stand_in::Settings& settings) {
    void* const library = dlopen(kLibrary.c_str(), RTLD_NOW | RTLD_NOLOAD);
    const auto function = reinterpret_cast<stand_in::PlugFunction>(dlsym(library, stand_in::kPlugSymbol));
    return function(settings, sizeof settings);
  }
  static void plug(const stand_in::Settings& settings) { ASSERT_EQ(plugged(settings), virtual_vendor::Plugged::kYes); }

  double z_m() {
    double p[3];
    (void)sdk_.dhdGetPosition(&p[0], &p[1], &p[2], id_);
    return p[2];
  }
  /// How far the tip goes while it is pushed up for 50 ms.
  double pushed_m() {
    rest();
    const double from_m = z_m();
    for (int i = 0; i < 25; ++i) {
      EXPECT_GE(sdk_.dhdSetForce(0.0, 0.0, 2.0, id_), 0);
      rtbus::sleep_until(rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs);
    }
    (void)sdk_.dhdSetForce(0.0, 0.0, 0.0, id_);
    rest();
    return z_m() - from_m;
  }
  static void rest() { rtbus::sleep_until(rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs); }
  void ready() {
    ASSERT_EQ(sdk_.dhdSetBrakes(0, id_), 0);
    ASSERT_EQ(sdk_.dhdEnableForce(1, id_), 0);
  }

  Sdk sdk_;
  char id_ = -1;
};

TEST_F(FdLibrary, WithoutEnablingForcesTheyAreTakenWithoutEffect) {
  ASSERT_EQ(sdk_.dhdSetBrakes(0, id_), 0);
  EXPECT_NEAR(pushed_m(), 0.0, 1e-6);
  ASSERT_EQ(sdk_.dhdEnableForce(1, id_), 0);
  EXPECT_GT(pushed_m(), 1e-3);
}

class Guarded : public FdLibrary {
  // So long that a busy machine asks again in time.
  void change(stand_in::Settings& settings) override { settings.time_guard_us = 1e6; }
};

TEST_F(Guarded, AskedAgainTooSoonItRepeatsTheOldPositionAndSaysOne) {
  ready();
  double first[3], second[3];
  ASSERT_EQ(sdk_.dhdGetPosition(&first[0], &first[1], &first[2], id_), 0);
  ASSERT_EQ(sdk_.dhdGetPosition(&second[0], &second[1], &second[2], id_), kTimeGuard);
  EXPECT_EQ(first[2], second[2]);
  // Without expert mode the guard cannot be turned off.
  EXPECT_EQ(sdk_.dhdSetTimeGuard(0, id_), -1);
  EXPECT_EQ(sdk_.dhdErrorGetLast(), 9);
}

TEST_F(FdLibrary, WatchdogEndsTheForcesAndSetForceStillSaysFine) {
  ready();
  (void)sdk_.dhdEnableExpertMode();
  ASSERT_EQ(sdk_.dhdSetWatchdog(80, id_), 0);  // 10 ms
  (void)sdk_.dhdDisableExpertMode();
  ASSERT_EQ(sdk_.dhdSetForce(0, 0, 0, id_), 0);
  rtbus::sleep_until(rtbus::monotonic_ns() + 40 * rtbus::kNsPerMs);
  EXPECT_EQ(sdk_.dhdSetForce(0, 0, 1.0, id_), 0);
  int status[kStatusRoom] = {};
  ASSERT_EQ(sdk_.dhdGetStatus(status, id_), 0);
  EXPECT_EQ(status[kStatusForce], 0);
  EXPECT_EQ(status[kStatusForceOffCause], 3);
  EXPECT_NEAR(pushed_m(), 0.0, 2e-3);
}

TEST_F(FdLibrary, HasNoVelocityBeforeItsSecondPosition) {
  double v[3] = {};
  EXPECT_EQ(sdk_.dhdGetLinearVelocity(&v[0], &v[1], &v[2], id_), -1);
  EXPECT_EQ(sdk_.dhdErrorGetLast(), kErrorTimeout);
  for (int i = 0; i < 2; ++i) {
    (void)z_m();
    rest();
  }
  EXPECT_EQ(sdk_.dhdGetLinearVelocity(&v[0], &v[1], &v[2], id_), 0);
}

TEST_F(FdLibrary, AnIdIsNoIndex) {
  unsigned short serial = 0;
  ASSERT_EQ(sdk_.dhdGetSerialNumber(&serial, id_), 0);
  EXPECT_EQ(serial, 1);
  EXPECT_EQ(sdk_.dhdOpenSerial(1), id_) << "open already: its ID";
  EXPECT_EQ(sdk_.dhdGetSerialNumber(&serial, static_cast<char>(100)), -1);
}

class Uncalibrated : public FdLibrary {
 protected:
  void change(stand_in::Settings& settings) override { settings.calibrated = false; }
};

TEST_F(Uncalibrated, AfterCalibrationRegulationHasToBeStoppedOrForcesDoNothing) {
  ready();
  EXPECT_EQ(sdk_.dhdSetForce(0, 0, 1.0, id_), -1);
  EXPECT_EQ(sdk_.dhdErrorGetLast(), kErrorNotReady);
  ASSERT_EQ(sdk_.drdAutoInit(id_), 0);
  ready();
  EXPECT_NEAR(pushed_m(), 0.0, 1e-6) << "the naive order: forces right after drdAutoInit()";
  ASSERT_EQ(sdk_.drdStop(true, id_), 0);
  EXPECT_GT(pushed_m(), 1e-3);
}

class Slow : public Uncalibrated {
  void change(stand_in::Settings& settings) override {
    Uncalibrated::change(settings);
    settings.auto_init_s = 0.3;
  }
};

// The library's calls block for long without its lock: what they find afterwards may be another unit.
TEST_F(Slow, ACallThatBlocksLooksItsUnitUpAgainAfterwards) {
  int calibrated = 0, error = 0;
  std::atomic<bool> begun{false};
  std::thread caller([&] {
    begun.store(true);
    calibrated = sdk_.drdAutoInit(id_);
    error = sdk_.dhdErrorGetLast();
  });
  while (!begun.load()) rest();
  // Closed, and replaced by a new one, while the call blocks; or before it begins, which ends it as well.
  rest();
  ASSERT_EQ(sdk_.dhdClose(id_), 0);
  stand_in::Settings fresh;
  fresh.unit.serial = "1";
  plug(fresh);
  caller.join();
  EXPECT_EQ(calibrated, -1);
  EXPECT_EQ(error, 15) << "no such device";
  ASSERT_EQ(sdk_.dhdOpenSerial(1), id_);  // for the end of the test
}

TEST_F(FdLibrary, AUnitThatIsOpenIsNotReplaced) {
  stand_in::Settings same;
  same.unit.serial = "1";
  EXPECT_EQ(plugged(same), virtual_vendor::Plugged::kInUse);
  EXPECT_GE(sdk_.dhdGetStatus(std::array<int, kStatusRoom>{}.data(), id_), 0);
}

// --- The driver -----------------------------------------------------------------------------------------------------

/// A device file of an omega.3 on the stand-in, a heavy tip that nobody holds.
std::string omega(const std::string& keys, const std::string& unit) {
  return "{schema: device/1, driver: force_dimension, model: omega3" + (keys.empty() ? "" : ", " + keys) +
         ", virtual: {mechanics: {mass_kg: 0.5, coulomb_n: 0}" + (unit.empty() ? "" : ", " + unit) + "}}";
}

TEST(ForceDimension, PushesInTheDirectionThatIsAsked) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Desk desk(omega("", ""));
    ASSERT_EQ(desk.start(), "");
    ASSERT_TRUE(desk.ready());
    const Vec3 from = desk.sample.position_m;
    Vec3 force{};
    force[axis] = 2.0;
    EXPECT_TRUE(desk.until(2.0, force, [&] { return desk.sample.position_m[axis] > from[axis] + 0.005; }));
    for (std::size_t other = 0; other < 3; ++other) {
      if (other != axis) {
        EXPECT_NEAR(desk.sample.position_m[other], from[other], 1e-4) << axis << other;
      }
    }
  }
}

TEST(ForceDimension, TurnsTheWristAboutTheVertical) {
  Desk desk(
      "{schema: device/1, driver: force_dimension, model: omega6, virtual: {wrist_rad: 0.5, mechanics: {mass_kg: 1}}}");
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  const Quat& q = desk.sample.orientation_wxyz;
  EXPECT_NEAR(q[0], std::cos(0.25), 1e-9);
  EXPECT_NEAR(q[2], std::sin(0.25), 1e-9) << "the maker's z is our y";
  EXPECT_EQ(desk.config->info().dof_sensed, 6);
}

TEST(ForceDimension, ReadsItsGripperAndWhenAskedForItsVelocity) {
  Desk desk(
      "{schema: device/1, driver: force_dimension, model: omega7, read_velocity: true, virtual: {gripper_m: 0.012, "
      "mechanics: {mass_kg: 0.5, coulomb_n: 0}}}");
  EXPECT_TRUE(desk.config->info().measures_velocity);
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_TRUE(desk.until(2.0, {0, 2.0, 0}, [&] { return desk.sample.velocity_m_s[1] > 0.05; })) << "the maker's z";
  EXPECT_NEAR(desk.sample.velocity_m_s[0], 0.0, 1e-3);
  EXPECT_EQ(desk.sample.gripper_m, 0.012);
}

TEST(ForceDimension, ReadsNeitherGripperNorVelocityUnasked) {
  Desk plain(omega("", "gripper_m: 0.012"));
  ASSERT_EQ(plain.start(), "");
  ASSERT_TRUE(plain.ready());
  (void)plain.until(0.05, {0, 2.0, 0}, [] { return false; });
  EXPECT_FALSE(plain.config->info().measures_velocity);
  EXPECT_EQ(plain.sample.velocity_m_s, (Vec3{})) << "a call less in each period";
  EXPECT_EQ(plain.sample.gripper_m, 0.0) << "an omega.3 has none";
}

TEST(ForceDimension, CalibratesItselfOnlyWithConsent) {
  EXPECT_THAT(problem_of(omega("", "calibrated: false")), HasSubstr("auto_init: true"));
  Desk desk(omega("auto_init: true", "calibrated: false, auto_init_s: 0.1"));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_TRUE(desk.moves({2.0, 0, 0}, 0.005, 2.0)) << "regulation was stopped: forces act";
}

// A hand may be on it: it must not move by itself although auto_init was agreed to for the start.
TEST(ForceDimension, NeverMovesByItselfWhenItLosesItsCalibrationInMidRun) {
  const Trigger trigger;
  Desk desk(omega("auto_init: true", "auto_init_s: 0.1, lose_calibration_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("lost its calibration"));
  EXPECT_FALSE(desk.until(1.0, {1.0, 0, 0}, [&] { return desk.answered; }));
}

TEST(ForceDimension, ItsForceButtonTurnsForcesOffAndOn) {
  const Trigger trigger;
  Desk desk(omega("", "force_button_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  bool lost = false;  // the second press comes when the driver has learned of the first, and not sooner
  EXPECT_TRUE(desk.until(5.0, {}, [&] {
    lost = lost || desk.read == IoStatus::kLost;
    return lost && desk.said.find("force button") != std::string::npos;
  })) << desk.said;
  EXPECT_TRUE(desk.ready()) << "pressed again";
}

TEST(ForceDimension, UnpluggedAndPluggedInItComesBackWithASoftStart) {
  const Trigger trigger;
  Desk desk(omega("", trigger.key("unplug_at_s: 0, replug_after_s: 0.5")));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("unplugged"));
  EXPECT_TRUE(desk.says("the device is back", 10.0));
  EXPECT_TRUE(desk.ready());
}

TEST(ForceDimension, ACallThatBlocksForLongerThanAPeriodCostsSamplesNotTheForce) {
  Desk desk(omega("", "call_us: 1500"));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_TRUE(desk.moves({2.0, 0, 0}, 0.005, 3.0));
}

TEST(ForceDimension, WhileACallHangsTheDevicesOwnWatchdogEndsTheForce) {
  const Trigger trigger;
  Desk desk(omega("", "block_at_s: 0, block_s: 0.3, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("watchdog", 5.0, {1.0, 0, 0})) << desk.said;
  EXPECT_TRUE(desk.until(5.0, {}, [&] { return desk.answered; })) << "the driver turns forces on again by itself";
}

TEST(ForceDimension, UnpluggedForGoodItSaysWhatToCheck) {
  const Trigger trigger;
  Desk desk(omega("", trigger.key("unplug_at_s: 0")));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("no Force Dimension device")) << desk.said;
}

TEST(ForceDimension, SaysWhatIsWrongBeforeAnythingStarts) {
  EXPECT_THAT(problem_of(omega("", "in_use: true")), HasSubstr("another program has the device"));
  EXPECT_THAT(problem_of(omega("", "system_type: 104")),
              HasSubstr("the device is a sigma.7, the device file says model: omega3"));
  EXPECT_THAT(problem_of(omega("serial: 99", "serial: \"4711\"")),
              HasSubstr("no device with serial number 99 opens: no device found (error 5); there is: omega.3 with "
                        "serial 4711; correct `serial:`"));
  EXPECT_THAT(problem_of(omega("serial: 99", "in_use: true")),
              HasSubstr("there is: one that does not open: the device is in use"));
  EXPECT_THAT(problem_of("{schema: device/1, driver: force_dimension, model: delta3, auto_init: true}"),
              HasSubstr("calibrated by moving it by hand"));
  EXPECT_THAT(problem_of("{schema: device/1, driver: force_dimension, model: omega3, limits: {max_force_n: 13}}"),
              HasSubstr("max_force_n"));
}

TEST(ForceDimension, SaysWhichLibraryIsMissingWrongOrOld) {
  const auto with = [](const std::string& library) {
    return problem_of("{schema: device/1, driver: force_dimension, model: omega3, library: " + library + "}");
  };
  EXPECT_THAT(with("/nowhere/libdrd.so"), HasSubstr("none of /nowhere/libdrd.so is there; correct `library:`"));
  EXPECT_THAT(with(kLibrary.substr(0, kLibrary.rfind('.')) + "_old.so"),
              HasSubstr("has no function dhdGetPositionAndOrientationFrame; it belongs to an SDK before 3.7"));
  EXPECT_THAT(with(tests::ForeignLibrary().file), HasSubstr("it was made for another kind of computer"));
  // Nothing of the vendor is on this machine: the usual names are tried, and the message says what to install.
  EXPECT_THAT(problem_of("{schema: device/1, driver: force_dimension, model: omega3}"),
              HasSubstr("install the Force Dimension SDK"));
}

}  // namespace
}  // namespace drivers::force_dimension
