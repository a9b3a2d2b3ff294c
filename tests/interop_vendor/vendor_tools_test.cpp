// `rtbus devices`, `device-test` and `calibrate` on the stand-ins for makers' devices, as programs.
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/process.hpp"

namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class VendorTools : public testing::Test {
 protected:
  /// @returns the exit status of `rtbus WORDS…`.
  int rtbus(std::vector<std::string> words) {
    // Without standard input: who is asked gets no answer.
    words.insert(words.begin(), {"sh", "-c", "exec \"$@\" </dev/null", "sh", std::string(RTBUS_BINARY_DIR) + "/rtbus"});
    tests::Child child(words, output_file_);
    return WEXITSTATUS(child.wait());
  }
  std::string output() const {
    std::ostringstream out;
    out << std::ifstream(output_file_).rdbuf();
    return out.str();
  }
  void TearDown() override { std::filesystem::remove(output_file_); }
  static std::string device(const std::string& name) {
    return std::string(RTBUS_SOURCE_DIR) + "/config/devices/" + name;
  }

  const std::string output_file_ = testing::TempDir() + "/vendortools" + std::to_string(getpid());
};

TEST_F(VendorTools, DevicesListsStandInsAsIfPluggedIn) {
  ASSERT_EQ(rtbus({"devices", "--virtual", device("virtual_omega.yaml"), "--virtual", device("virtual_touch.yaml"),
                   "--json"}),
            0)
      << output();
  const auto report = nlohmann::json::parse(output());
  ASSERT_EQ(report["devices"].size(), 2u);
  EXPECT_EQ(report["devices"][0]["driver"], "force_dimension");
  EXPECT_EQ(report["devices"][1]["driver"], "openhaptics");
}

TEST_F(VendorTools, DevicesWithAllSaysWhatIsNotInstalledAndHowToGetIt) {
  ASSERT_EQ(rtbus({"devices", "--all", "--json"}), 0) << output();
  const auto report = nlohmann::json::parse(output());
  EXPECT_THAT(report["vendors"].dump(), HasSubstr("install OpenHaptics 3.4"));
  EXPECT_THAT(report["vendors"].dump(), HasSubstr("install the Force Dimension SDK"));
  ASSERT_EQ(rtbus({"devices", "--json"}), 0);
  EXPECT_TRUE(nlohmann::json::parse(output())["vendors"].empty()) << "no library of a maker is mapped unless asked for";
}

// The stand-in under the name of the maker's library, and the files that its setup tool writes.
TEST_F(VendorTools, DevicesWithAllFindsADeviceThatWasNeverSetUp) {
  namespace fs = std::filesystem;
  const fs::path home = testing::TempDir() + "vendorhome" + std::to_string(getpid());
  fs::create_directories(home / ".3dsystems/config");
  fs::create_symlink(std::string(RTBUS_BINARY_DIR) + "/libstand_in_openhaptics.so", home / "libHD.so");
  std::ofstream(home / ".3dsystems/config/Default Device.config") << "ModelType=OMNI\nChannel=300\n";
  const auto look = [&](const std::string& gtdd_home) {
    tests::Child child({"env", "LD_LIBRARY_PATH=" + home.string(), "HOME=" + home.string(), "GTDD_HOME=" + gtdd_home,
                        std::string(RTBUS_BINARY_DIR) + "/rtbus", "devices", "--all"},
                       output_file_);
    return child.wait();
  };
  EXPECT_EQ(look(""), 0);
  EXPECT_THAT(output(), HasSubstr("Channel 300, never set up: run Touch_HeadlessSetup or Touch_Setup"));
  EXPECT_THAT(output(), HasSubstr("export GTDD_HOME=" + (home / ".3dsystems").string()));
  std::ofstream(home / ".3dsystems/config/Default Device.config") << "ModelType=OMNI\nChannel=0\n";
  EXPECT_EQ(look((home / ".3dsystems").string()), 0);
  EXPECT_THAT(output(), Not(HasSubstr("Channel 300")));
  EXPECT_THAT(output(), Not(HasSubstr("export GTDD_HOME")));
  fs::remove_all(home);
}

TEST_F(VendorTools, DeviceTestFindsAStandInByItsDriver) {
  EXPECT_EQ(
      rtbus({"device-test", "force_dimension", "--virtual", device("virtual_omega.yaml"), "--yes", "--seconds", "0.5"}),
      1)
      << "nobody moves the handle along all axes";
  EXPECT_THAT(output(), HasSubstr("ready     ok"));
  EXPECT_THAT(output(), HasSubstr("answers   ok"));
}

TEST_F(VendorTools, CalibrateMovesTheArmAfterConsentOnly) {
  const std::vector<std::string> command{"calibrate", device("virtual_omega.yaml"), "--set", "virtual.calibrated=false",
                                         "--set",     "virtual.auto_init_s=0.1"};
  EXPECT_EQ(rtbus(command), 1) << "standard input is at its end: nobody agrees";
  EXPECT_THAT(output(), HasSubstr("nothing moved"));
  auto agreed = command;
  agreed.emplace_back("--yes");
  EXPECT_EQ(rtbus(agreed), 0) << output();
  EXPECT_THAT(output(), HasSubstr("it has calibrated itself"));
}

// The guided tools do the driver's housekeeping: there a Touch that waits for its inkwell goes on.
TEST_F(VendorTools, CalibrateGuidesATouchThroughItsInkwell) {
  const std::string docks = testing::TempDir() + "vendordocks" + std::to_string(getpid());
  tests::Child child({std::string(RTBUS_BINARY_DIR) + "/rtbus", "calibrate", device("virtual_touch.yaml"), "--set",
                      "virtual.calibration=needs_inkwell", "--set", "virtual.docked_at_s=0", "--set",
                      "virtual.faults.trigger=" + docks, "--yes"},
                     output_file_);
  EXPECT_TRUE(tests::eventually(20.0, [&] {
    return output().find("put the stylus into its inkwell") != std::string::npos;
  })) << output();
  std::ofstream(docks) << "now";
  EXPECT_EQ(child.wait(), 0) << output();
  EXPECT_THAT(output(), HasSubstr("ready     ok"));
  std::filesystem::remove(docks);
}

// What a set-up lacks is told without libHD too: it may be all that is left to do.
TEST_F(VendorTools, DevicesWithAllLooksAtTheSetUpThoughLibHdIsNotThere) {
  namespace fs = std::filesystem;
  const fs::path home = testing::TempDir() + "vendornolib" + std::to_string(getpid());
  fs::create_directories(home / ".3dsystems/config");
  std::ofstream(home / ".3dsystems/config/Left.config") << "ModelType=OMNI\nChannel=300\n";
  const auto look = [&](const std::string& gtdd_home) {
    tests::Child child({"env", "HOME=" + home.string(), "GTDD_HOME=" + gtdd_home,
                        std::string(RTBUS_BINARY_DIR) + "/rtbus", "devices", "--all"},
                       output_file_);
    return child.wait();
  };
  EXPECT_EQ(look(""), 0);
  EXPECT_THAT(output(), HasSubstr("install OpenHaptics 3.4"));
  EXPECT_THAT(output(), HasSubstr("Left.config: Channel 300, never set up: run Touch_HeadlessSetup or Touch_Setup"));
  EXPECT_THAT(output(), HasSubstr("export GTDD_HOME=" + (home / ".3dsystems").string()));
  EXPECT_EQ(look((home / "nowhere").string()), 0);
  EXPECT_THAT(output(), HasSubstr("none is set up for this user: run Touch_Setup"));
  void* const ncurses = dlopen("libncurses.so.5", RTLD_LAZY);
  void* const tinfo = dlopen("libtinfo.so.5", RTLD_LAZY);
  if (ncurses == nullptr || tinfo == nullptr) {
    EXPECT_THAT(output(), HasSubstr("needs the packages libncurses5 and libtinfo5"));
  } else {
    EXPECT_THAT(output(), Not(HasSubstr("libncurses5")));
  }
  fs::remove_all(home);
}

TEST_F(VendorTools, DoctorWithVendorsAddsTheirState) {
  (void)rtbus({"doctor", "--vendors", "--duration", "0.1"});
  EXPECT_THAT(output(), HasSubstr("OpenHaptics"));
}

}  // namespace
