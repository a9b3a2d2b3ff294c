// Drivers from outside the tree: how they are found, which are refused, and what the conformance suite catches.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
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
    ::unsetenv("RTBUS_DRIVER_PATH");
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
  int conformance(const std::string& mistake) {
    write("{schema: device/1, driver: trial, mistake: " + mistake + "}");
    tests::Child run({kBin + "driver_conformance", "--gtest_filter=Drivers/*"}, output_);
    return WEXITSTATUS(run.wait());
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

TEST_F(OutsideDriver, TheSuiteCatchesWhatOtherTestsOverlook) {
  ::setenv("RTBUS_CONFORMANCE_MODULE", (kBin + "libtrial.so").c_str(), 1);
  ::setenv("RTBUS_CONFORMANCE_DEVICE", file_.c_str(), 1);
  EXPECT_EQ(conformance("none"), 0) << output();
  EXPECT_NE(conformance("oversleeps"), 0);
  EXPECT_THAT(output(), HasSubstr("sleeps beyond its deadline"));
  EXPECT_NE(conformance("slow_read"), 0);
  EXPECT_THAT(output(), HasSubstr("for one read and one write"));
  EXPECT_NE(conformance("mass_ten_times"), 0);
  EXPECT_THAT(output(), HasSubstr("ClampsTheForceKeepsItsDirectionAndCounts"));
  ::unsetenv("RTBUS_CONFORMANCE_MODULE");
  ::unsetenv("RTBUS_CONFORMANCE_DEVICE");
}

}  // namespace
