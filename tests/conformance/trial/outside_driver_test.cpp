// Drivers from outside the tree: how they are found, which are refused, and what the conformance suite catches.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "drivers/registry/registry.hpp"
#include "tests/support/process.hpp"

namespace {

using ::testing::HasSubstr;

const std::string kBin = std::string(RTBUS_BINARY_DIR) + "/";

class OutsideDriver : public ::testing::Test {
 protected:
  void TearDown() override {
    std::filesystem::remove(file_);
    std::filesystem::remove(output_);
    for (const char* const name : {"RTBUS_DRIVER_PATH", "RTBUS_CONFORMANCE_MODULE", "RTBUS_CONFORMANCE_DEVICE"}) {
      ::unsetenv(name);
    }
  }
  void write(const std::string& yaml) { std::ofstream(file_) << yaml << "\n"; }
  /// What parsing the device file says; empty: it is fine.
  std::string problem(const std::string& yaml) {
    write(yaml);
    try {
      auto map = rtbus::config::load(file_);
      return drivers::parse_device(map)->info().model == "toy" ? "" : "another driver";
    } catch (const rtbus::config::Error& error) {
      return error.what();
    }
  }
  /// Lets one test of the suite judge the trial driver; empty: all. True: it passed.
  bool passes(const std::string& mistake, const std::string& test = "") {
    ::setenv("RTBUS_CONFORMANCE_MODULE", (kBin + "libtrial.so").c_str(), 1);
    ::setenv("RTBUS_CONFORMANCE_DEVICE", file_.c_str(), 1);
    write("{schema: device/1, driver: trial, mistake: " + mistake + "}");
    tests::Child run(
        {kBin + "driver_conformance", "--gtest_filter=Drivers/*" + (test.empty() ? "" : "." + test + "/*")}, output_);
    const int status = run.wait();
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }
  std::string output() const {
    std::ostringstream out;
    out << std::ifstream(output_).rdbuf();
    return out.str();
  }

  const std::string file_ = testing::TempDir() + "/outside" + std::to_string(getpid()) + ".yaml";
  const std::string output_ = testing::TempDir() + "/outside" + std::to_string(getpid()) + ".txt";
};

TEST_F(OutsideDriver, IsFoundByItsFileAndOnThePath) {
  const std::string module = kBin + "libtrial.so";
  EXPECT_EQ(problem("{schema: device/1, driver: {module: " + module + "}, mistake: none}"), "");
  EXPECT_THAT(problem("{schema: device/1, driver: trial, mistake: none}"),
              HasSubstr("driver = \"trial\" is not known"));
  ::setenv("RTBUS_DRIVER_PATH", ("/nowhere:" + std::string(RTBUS_BINARY_DIR)).c_str(), 1);
  EXPECT_EQ(problem("{schema: device/1, driver: trial, mistake: none}"), "");
}

TEST_F(OutsideDriver, OfAnotherVersionIsRefusedWithBothVersions) {
  const std::string said = problem("{schema: device/1, driver: {module: " + kBin + "libstale_driver.so}}");
  EXPECT_THAT(said, HasSubstr("it has ABI version " + std::to_string(drivers::kDriverAbiVersion + 1000)));
  EXPECT_THAT(said, HasSubstr("this program " + std::to_string(drivers::kDriverAbiVersion)));
  EXPECT_THAT(problem("{schema: device/1, driver: {module: " + kBin + "libstand_in_openhaptics.so}}"),
              HasSubstr("does not export rtbus_driver_module"));
}

/// A mistake of the trial driver, the test of the suite that catches it, and what that says.
struct Mistake {
  const char* name;
  const char* test;
  const char* says;
};
void PrintTo(const Mistake& mistake, std::ostream* out) { *out << mistake.name; }

constexpr const char* kInfo = "InfoHasSaneLimits";
constexpr const char* kLife = "IsLostBeforeStartAndAfterStop";
constexpr const char* kSamples = "SamplesAreFiniteStampedAndNeverFromTheFuture";
constexpr const char* kClamps = "ClampsTheForceKeepsItsDirectionAndCounts";
constexpr const char* kNotFinite = "TakesANonFiniteForceAsZeroAndCounts";
constexpr const char* kStops = "StopIsIdempotentAndLeavesNoForce";
constexpr const char* kQuick = "ReadAndWriteAreQuick";
constexpr const char* kAllocates = "ReadAndWriteDoNotAllocate";
constexpr const char* kWaits = "WaitBringsAFreshSampleOrEndsAtItsDeadline";

constexpr Mistake kMistakes[] = {
    {"mass_ten_times", kClamps, "way.norm()"},
    {"no_model", kInfo, "info.model.empty()"},
    {"five_dof", kInfo, "info.dof_sensed"},
    {"no_stiffness", kInfo, "info.max_stiffness_n_per_m"},
    {"continuous_above_peak", kInfo, "info.continuous_force_n"},
    {"slew_too_slow", kInfo, "info.max_slew_n_per_ms"},
    {"negative_friction", kInfo, "info.coulomb_friction_n"},
    {"workspace_reversed", kInfo, "info.workspace_min_m"},
    {"timeout_of_a_second", kInfo, "info.force_timeout_s"},
    {"reads_before_start", kLife, "device_->read"},
    {"reads_after_stop", kLife, "device_->read"},
    {"writes_before_start", kLife, "device_->write"},
    {"no_stamp", kSamples, "measured 100 ms ago or never"},
    {"stamp_of_the_future", kSamples, "measured in the future"},
    {"stamp_a_second_old", kSamples, "measured 100 ms ago or never"},
    {"stamp_goes_back", kSamples, "older than the sample before"},
    {"position_not_a_number", kSamples, "std::isfinite(p)"},
    {"orientation_of_zeros", kSamples, "no unit quaternion"},
    {"never_fresh", kSamples, "read() never said kOk"},
    {"position_in_mm", kClamps, "way.norm()"},
    {"does_not_clamp", kClamps, "device_->clamped()"},
    {"clamps_uncounted", kClamps, "device_->clamped()"},
    {"clamps_each_axis", kClamps, "way.normalized()"},
    {"pushes_twice_as_hard", kClamps, "way.norm()"},
    {"force_reversed", kClamps, "way.normalized()"},
    {"axes_swapped", kClamps, "way.normalized()"},
    {"counts_the_limit", "AcceptsTheLimitItselfUncounted", "device_->clamped()"},
    {"takes_not_a_number", kNotFinite, "device_->clamped()"},
    {"looks_at_the_first_axis_alone", kNotFinite, "device_->clamped()"},
    {"force_never_ends", "ForceEndsByItselfWhenWritesStop", "longer than force_timeout_s"},
    {"force_survives_stop", kStops, "from before stop() was still there"},
    {"second_stop_aborts", kStops, ""},  // ends the whole suite
    {"count_survives_stop", kStops, "clamped() counts since start()"},
    {"starts_only_once", kStops, "it was started before"},
    {"allocates_in_read", kAllocates, "allocations"},
    {"allocates_in_write", kAllocates, "allocations"},
    {"slow_read", kQuick, "for one read and one write"},
    {"slow_write", kQuick, "for one read and one write"},
    {"oversleeps", "WaitEndsAtItsDeadline", "sleeps beyond its deadline"},
    {"wait_always_times_out", kWaits, "wait_sample"},
    {"wait_works_before_start", kWaits, "wait_sample"},
    {"wait_does_not_wait", kWaits, "sample.time_ns"},
};

TEST_F(OutsideDriver, WithoutAMistakePassesTheWholeSuite) { EXPECT_TRUE(passes("none")) << output(); }

TEST_F(OutsideDriver, EachMistakeOfTheTrialDriverIsInTheTable) {
  const std::string known = problem("{schema: device/1, driver: {module: " + kBin + "libtrial.so}, mistake: another}");
  for (const Mistake& each : kMistakes) EXPECT_THAT(known, HasSubstr(each.name));
  // "… choose none, a, b": as many as the table has, and `none`.
  EXPECT_EQ(std::count(known.begin(), known.end(), ','), std::ssize(kMistakes)) << known;
}

class TrialMistake : public OutsideDriver, public ::testing::WithParamInterface<Mistake> {};

TEST_P(TrialMistake, IsCaughtByItsTest) {
  const bool passed = passes(GetParam().name, GetParam().test);
  if (passed && output().find("machine too busy: ") != std::string::npos) GTEST_SKIP() << output();
  EXPECT_FALSE(passed);
  EXPECT_THAT(output(), HasSubstr(GetParam().says));
  EXPECT_THAT(output(), HasSubstr(GetParam().test)) << "the filter has found the test";
}

INSTANTIATE_TEST_SUITE_P(Table, TrialMistake, ::testing::ValuesIn(kMistakes),
                         [](const auto& mistake) { return std::string(mistake.param.name); });

}  // namespace
