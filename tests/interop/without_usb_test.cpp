// The programs where the module of the USB drivers is not: built with RTBUS_WITH_USB=OFF, or not installed. Each
// command says plainly what is missing; everything else works.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/process.hpp"

namespace {

using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

class WithoutUsb : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    fs::copy_file(std::string(RTBUS_BINARY_DIR) + "/rtbus", folder_ / "rtbus");  // without what stands beside it
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::pair<int, std::string> rtbus(std::vector<std::string> words) {
    words.insert(words.begin(), folder_ / "rtbus");
    tests::Child child(words, folder_ / "log");
    const int status = child.wait();
    std::ostringstream text;
    text << std::ifstream(folder_ / "log").rdbuf();
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text.str()};
  }

  const fs::path folder_ = fs::temp_directory_path() / ("rtbus_without_usb_" + std::to_string(getpid()));
};

TEST_F(WithoutUsb, EachCommandSaysWhatIsMissing) {
  const auto missing = AllOf(HasSubstr("libdrivers_usb.so"), HasSubstr("RTBUS_WITH_USB=ON"));
  const std::string falcon = std::string(RTBUS_SOURCE_DIR) + "/config/devices/virtual_falcon.yaml";
  const auto devices = rtbus({"devices"});
  EXPECT_EQ(devices.first, 0) << "no USB is no failure of looking";
  EXPECT_THAT(devices.second, missing);
  const auto as_json = rtbus({"devices", "--json"});
  EXPECT_EQ(as_json.first, 0);
  EXPECT_THAT(as_json.second, missing);
  const auto by_id = rtbus({"device-test", "falcon"});
  EXPECT_EQ(by_id.first, 1);
  EXPECT_THAT(by_id.second, missing);
  const auto by_file = rtbus({"device-test", falcon});
  EXPECT_EQ(by_file.first, 2);
  EXPECT_THAT(by_file.second, AllOf(missing, HasSubstr("virtual_falcon.yaml:"), HasSubstr("driver")));
  const auto calibrate = rtbus({"calibrate", "falcon"});
  EXPECT_EQ(calibrate.first, 1);
  EXPECT_THAT(calibrate.second, missing);
  const auto device = rtbus({"virtual-device", "falcon"});
  EXPECT_EQ(device.first, 1);
  EXPECT_THAT(device.second, HasSubstr("RTBUS_WITH_USB=ON"));
}

TEST_F(WithoutUsb, ASimulatedDeviceIsTestedAllTheSame) {
  const auto test = rtbus({"device-test", std::string(RTBUS_SOURCE_DIR) + "/config/devices/sim_phantom_desktop.yaml",
                           "--yes", "--seconds", "0.2"});
  EXPECT_THAT(test.second, HasSubstr("answers   ok")) << test.second;
}

// Likewise what is a program of its own. `evaluate` is in each build.
TEST_F(WithoutUsb, ACommandWhoseProgramIsNotThereAnswersHelpAndSaysHowToGetIt) {
  const auto help = rtbus({"evaluate", "--help"});
  EXPECT_EQ(help.first, 0);
  EXPECT_THAT(help.second, AllOf(HasSubstr("Run an experiment"), HasSubstr("tools/build rtbus_evaluation")));
  const auto used = rtbus({"evaluate", "drop"});
  EXPECT_EQ(used.first, 1);
  EXPECT_THAT(used.second, AllOf(HasSubstr("package rtbus"), HasSubstr("\n  tools/build rtbus_evaluation\n")));
}

}  // namespace
