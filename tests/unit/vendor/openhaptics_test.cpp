// Devices behind OpenHaptics on the stand-in for libHD: first what the library does to a naive caller, then what the
// driver makes of each fault.
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/openhaptics/hd.hpp"
#include "drivers/virtual_vendor/openhaptics/plug.hpp"
#include "tests/unit/vendor/desk.hpp"

namespace drivers::openhaptics {
namespace {

namespace stand_in = virtual_vendor::openhaptics;
using ::testing::HasSubstr;
using tests::Desk;
using tests::problem_of;
using tests::Trigger;

const std::string kLibrary = std::string(RTBUS_BINARY_DIR) + "/" + stand_in::kLibrary;

Hd* hd = nullptr;
Handle device = 0;

/// What a naive callback does in each tick.
enum class Naive { kNothing, kForceInEachFrame, kForceInOneFrame, kForceOutside, kTwoFrames, kInkwellAsInteger };
std::atomic<Naive> naive{Naive::kNothing};
std::atomic<int> ticks{0};
std::atomic<double> x_mm{0.0}, vx_mm_s{0.0};

std::uint32_t callback(void*) {
  const double force[3] = {1.0, 0.0, 0.0};
  const Naive now = naive.load();
  if (now == Naive::kForceOutside) hd->hdSetDoublev(kCurrentForce, force);
  hd->hdBeginFrame(device);
  double p[3] = {};
  hd->hdGetDoublev(kPosition, p);
  x_mm.store(p[0]);
  hd->hdGetDoublev(kVelocity, p);
  vx_mm_s.store(p[0]);
  int value = 0;
  if (now == Naive::kInkwellAsInteger) hd->hdGetIntegerv(kInkwellSwitch, &value);
  static int once = 0;
  if (now != Naive::kForceInOneFrame) once = 0;
  if (now == Naive::kForceInEachFrame || (now == Naive::kForceInOneFrame && once++ == 0)) {
    hd->hdSetDoublev(kCurrentForce, force);
  }
  hd->hdEndFrame(device);
  if (now == Naive::kTwoFrames) {
    hd->hdBeginFrame(device);
    hd->hdEndFrame(device);
  }
  ticks.fetch_add(1);
  return kCallbackContinue;
}

class HdLibrary : public ::testing::Test {
 protected:
  void SetUp() override {
    auto loaded = load_hd(kLibrary);
    ASSERT_TRUE(loaded) << loaded.error();
    hd_ = *loaded;
    hd = &hd_;
    stand_in::Settings settings;
    settings.unit.mechanics.mass_kg = 0.5;
    settings.unit.mechanics.coulomb_n = 0.0;
    settings.unit.mechanics.viscous_n_s_per_m = 0.0;
    settings.unit.mechanics.gravity_m_s2.setZero();
    settings.init_s = 0.0;
    settings.ramp_s = 0.0;
    settings.wrong_ticks = 5;
    void* const library = dlopen(kLibrary.c_str(), RTLD_NOW | RTLD_NOLOAD);
    const auto plug = reinterpret_cast<stand_in::PlugFunction>(dlsym(library, stand_in::kPlugSymbol));
    ASSERT_EQ(plug(settings, sizeof settings), virtual_vendor::Plugged::kYes);
    device = hd_.hdInitDevice(nullptr);
    ASSERT_LE(device, kLastPlausibleHandle);
    hd_.hdEnable(kForceOutput);
    naive.store(Naive::kNothing);
    scheduled_ = hd_.hdScheduleAsynchronous(&callback, nullptr, kDefaultPriority);
    hd_.hdStartScheduler();
    wait_ticks(20);
    while (hd_.hdGetError().code != 0) {
    }
  }
  void TearDown() override {
    hd_.hdStopScheduler();
    hd_.hdUnschedule(scheduled_);
    hd_.hdDisableDevice(device);
  }
  static void wait_ticks(int count) {
    const int from = ticks.load();
    while (ticks.load() < from + count) rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs);
  }
  /// Speed after 40 ticks of doing so [mm per tick].
  double speed_after(Naive what) {
    naive.store(what);
    wait_ticks(40);
    naive.store(Naive::kNothing);
    const double from_mm = x_mm.load();
    const int from = ticks.load();
    wait_ticks(20);
    return (x_mm.load() - from_mm) / (ticks.load() - from);
  }
  bool has_error(std::uint32_t code) {
    bool found = false;
    for (ErrorInfo error = hd_.hdGetError(); error.code != 0; error = hd_.hdGetError())
      found = found || error.code == code;
    return found;
  }

  Hd hd_;
  SchedulerHandle scheduled_ = 0;
};

// Without friction a tip on which no force acts keeps its speed, however long a busy machine makes the ticks.
TEST_F(HdLibrary, AFrameWithoutAForceSendsZero) {
  // Again where a late thread made up for lost ticks, so that the one frame lasted for no time.
  for (int i = 0; i < 100 && vx_mm_s.load() == 0.0; ++i) {
    naive.store(Naive::kNothing);
    wait_ticks(2);
    naive.store(Naive::kForceInOneFrame);
    wait_ticks(5);
  }
  const double once_mm_s = vx_mm_s.load();
  EXPECT_GT(once_mm_s, 0.0) << "it acted in the one frame";
  wait_ticks(40);
  EXPECT_NEAR(vx_mm_s.load(), once_mm_s, 1e-6) << "the naive way: set a force once, and believe that it stays";
  naive.store(Naive::kForceInEachFrame);
  wait_ticks(40);
  naive.store(Naive::kNothing);
  EXPECT_GT(vx_mm_s.load(), once_mm_s + 30.0) << "1 N at 0.5 kg gives 80 mm/s in 40 ms";
}

TEST_F(HdLibrary, AForceOutsideAFrameIsAnErrorAndDoesNothing) {
  EXPECT_LT(std::abs(speed_after(Naive::kForceOutside)), 1e-3);
  EXPECT_TRUE(has_error(0x0402));
}

TEST_F(HdLibrary, ASecondFrameInATickIsAnError) {
  (void)speed_after(Naive::kTwoFrames);
  EXPECT_TRUE(has_error(0x0400));
}

TEST_F(HdLibrary, TheInkwellSwitchIsABoolean) {
  (void)speed_after(Naive::kInkwellAsInteger);
  EXPECT_TRUE(has_error(0x0103));
}

TEST_F(HdLibrary, SchedulerHandlesDoNotFitInto32Bits) {
  EXPECT_NE(static_cast<std::uint32_t>(scheduled_), scheduled_);
  hd_.hdUnschedule(static_cast<std::uint32_t>(scheduled_));
  EXPECT_TRUE(has_error(0x0102)) << "cut to 32 bits it is unknown, and the callback stays";
  wait_ticks(5);
}

TEST_F(HdLibrary, AThreadThatChoseNoDeviceHasNone) {
  bool bad_handle = false;
  std::thread([&] {
    double p[3];
    hd_.hdGetDoublev(kPosition, p);
    bad_handle = has_error(0x0104);
  }).join();
  EXPECT_TRUE(bad_handle);
}

// --- The driver -----------------------------------------------------------------------------------------------------

std::string touch(const std::string& unit, const std::string& keys = "") {
  return "{schema: device/1, driver: openhaptics, model: touch" + (keys.empty() ? "" : ", " + keys) +
         ", virtual: {ramp_s: 0.02, mechanics: {mass_kg: 0.5, coulomb_n: 0}" + (unit.empty() ? "" : ", " + unit) + "}}";
}

TEST(OpenHaptics, PushesInTheDirectionThatIsAskedAroundTheMiddleOfItsWorkspace) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Desk desk(touch(""));
    ASSERT_EQ(desk.start(), "");
    ASSERT_TRUE(desk.ready());
    for (const double p : desk.sample.position_m) EXPECT_NEAR(p, 0.0, 1e-4) << "the library's origin is elsewhere";
    Vec3 force{};
    force[axis] = 2.0;
    // Its speed is that of its way, from one sample to the next. A machine that pauses between the look at the device
    // and the look at the clock shortens some of these times, and lengthens others.
    DeviceSample last;
    std::vector<double> shares;
    EXPECT_TRUE(desk.until(2.0, force, [&] {
      if (desk.sample.time_ns == last.time_ns) return false;
      const DeviceSample before = std::exchange(last, desk.sample);
      const double way_m = last.position_m[axis] - before.position_m[axis];
      if (before.position_m[axis] > 0.001) {
        shares.push_back(way_m / (last.velocity_m_s[axis] * rtbus::seconds_between(before.time_ns, last.time_ns)));
      }
      return last.position_m[axis] > 0.005;
    }));
    ASSERT_FALSE(shares.empty());
    std::sort(shares.begin(), shares.end());
    EXPECT_NEAR(shares[shares.size() / 2], 1.0, 0.3);
    for (std::size_t other = 0; other < 3; ++other) {
      if (other != axis) {
        EXPECT_NEAR(desk.sample.position_m[other], 0.0, 1e-4);
      }
    }
  }
}

TEST(OpenHaptics, TheForceOfASampleLeavesInItsFrame) {
  Desk desk(touch(""));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  EXPECT_TRUE(desk.until(20.0, {}, [&] { return desk.device->link_stats()->exchanges > 1000; }));
  const auto link = desk.device->link_stats();
  ASSERT_TRUE(link);
  EXPECT_GT(link->sample_to_wire_p50_us, 0.0);
  EXPECT_LT(link->sample_to_wire_p50_us, 400.0) << "the callback waits 300 us at most";
}

TEST(OpenHaptics, SaysWhyTheDeviceCannotBeInitialised) {
  EXPECT_THAT(problem_of(touch("init: fails")), HasSubstr("DEVICE_FAULT"));
  EXPECT_THAT(problem_of(touch("init: fails_silently")), HasSubstr("cannot be initialised"));
  EXPECT_THAT(problem_of(touch("init: busy")), HasSubstr("COMM_CONFIG_ERROR"));
  const std::string other_name = problem_of(touch("name: right_hand", "name: left_hand"));
  EXPECT_THAT(other_name, HasSubstr("the device \"left_hand\" cannot be initialised"));
  EXPECT_THAT(other_name, HasSubstr("there is: right_hand; name one of them by `name:`"));
  EXPECT_THAT(problem_of(touch("model_type: PHANTOM Desktop")), HasSubstr("set model: desktop"));
  EXPECT_THAT(problem_of("{schema: device/1, driver: openhaptics, model: touch}"),
              HasSubstr("install OpenHaptics 3.4 and the device driver package TouchDriver"));
}

TEST(OpenHaptics, SaysWhichLibraryIsMissingOrWrong) {
  const auto with = [](const std::string& library) {
    return problem_of("{schema: device/1, driver: openhaptics, model: touch, library: " + library + "}");
  };
  EXPECT_THAT(with("/nowhere/libHD.so"), HasSubstr("none of /nowhere/libHD.so is there; correct `library:`"));
  EXPECT_THAT(with(tests::ForeignLibrary().file), HasSubstr("it was made for another kind of computer"));
  EXPECT_THAT(with(std::string(RTBUS_BINARY_DIR) + "/libstand_in_force_dimension.so"),
              HasSubstr("has no function hdInitDevice; it is not libHD of OpenHaptics 3"));
  const std::string needs_another = with(std::string(RTBUS_BINARY_DIR) + "/libstand_in_openhaptics_alone.so");
  EXPECT_THAT(needs_another, HasSubstr("libPhantomIOLib42.so: cannot open shared object file"));
  EXPECT_THAT(needs_another, HasSubstr("install the device driver package TouchDriver"));
}

TEST(OpenHaptics, AnInitialisationThatTakesSecondsEndsAsCancelled) {
  Desk desk(touch("init_s: 0.5"));
  // Again and again, as the node does: a start() that has not begun does not hear it.
  std::atomic<bool> returned{false};
  std::thread cancel([&] {
    while (!returned.load()) {
      desk.device->cancel_start();
      rtbus::sleep_until(rtbus::monotonic_ns() + 20 * rtbus::kNsPerMs);
    }
  });
  const auto started = desk.device->start(0);
  returned.store(true);
  cancel.join();
  ASSERT_FALSE(started);
  EXPECT_THAT(started.error().message, HasSubstr("stopped"));
  EXPECT_EQ(desk.start(), "") << "and may be started again";
}

TEST(OpenHaptics, OneDevicePerProcess) {
  Desk first(touch(""));
  ASSERT_EQ(first.start(), "");
  EXPECT_THAT(problem_of(touch("serial: \"2\"")), HasSubstr("a haptic node of its own"));
  EXPECT_TRUE(first.ready());
}

TEST(OpenHaptics, WaitsForTheInkwellWithoutForce) {
  const Trigger trigger;
  Desk desk(touch("calibration: needs_inkwell, docked_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  EXPECT_TRUE(desk.says("into its inkwell", 3.0));
  EXPECT_FALSE(desk.until(0.2, {1.0, 0, 0}, [&] { return desk.answered; }));
  trigger.pull();
  EXPECT_TRUE(desk.ready()) << desk.said;
  EXPECT_TRUE(desk.says("the device is calibrated")) << desk.said;
}

TEST(OpenHaptics, CalibratesWhatCalibratesItself) {
  Desk desk(touch("calibration: needs_update"));
  ASSERT_EQ(desk.start(), "");
  EXPECT_TRUE(desk.ready());
}

TEST(OpenHaptics, CalibrationLostInMidRunMeansNoForce) {
  const Trigger trigger;
  Desk desk(touch("uncalibrate_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  double farthest_m = 0.0;  // the stand-in's pose is wrong by 40 mm from then on
  EXPECT_TRUE(desk.until(5.0, {}, [&] {
    farthest_m = std::max(farthest_m, std::abs(desk.sample.position_m[0]));
    return !desk.answered && desk.said.find("inkwell") != std::string::npos;
  }));
  EXPECT_LT(farthest_m, 0.001) << "the naive way: ask now and then, and believe the poses in between";
}

TEST(OpenHaptics, UnpluggedItIsLostAndSaysHowToGoOn) {
  const Trigger trigger;
  Desk desk(touch(trigger.key("unplug_at_s: 0")));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("COMM_ERROR"));
  EXPECT_THAT(desk.said, HasSubstr("replug it"));
  EXPECT_TRUE(desk.until(5.0, {}, [&] { return desk.read == IoStatus::kLost; }));
}

TEST(OpenHaptics, AServoThreadThatStopsIsLostAndSaid) {
  const Trigger trigger;
  Desk desk(touch("stop_ticks_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("has stopped"));
  EXPECT_TRUE(desk.until(5.0, {}, [&] { return desk.read == IoStatus::kLost; }));
}

TEST(OpenHaptics, WarmMotorsAreToldAndItGoesOn) {
  const Trigger trigger;
  Desk desk(touch("warm_at_s: 0, " + trigger.key()));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  trigger.pull();
  EXPECT_TRUE(desk.says("WARM_MOTORS"));
  EXPECT_TRUE(desk.ready());
}

TEST(OpenHaptics, AForceErrorMakesTheForceReturnByItsRamp) {
  Desk desk(touch("too_fast_m_s: 0.05"));
  ASSERT_EQ(desk.start(), "");
  ASSERT_TRUE(desk.ready());
  bool refused = false;
  EXPECT_TRUE(desk.until(3.0, {1.0, 0, 0}, [&] {
    refused = refused || desk.wrote == IoStatus::kLost;
    return refused && desk.said.find("EXCEEDED_MAX_VELOCITY") != std::string::npos;
  }));
}

}  // namespace
}  // namespace drivers::openhaptics
