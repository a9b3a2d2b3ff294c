// The tools for people with a device before them, as processes on virtual devices: what is plugged in and how it is,
// the guided test by the ID that was shown, and calibration. Whatever they do, no virtual device is ever given firmware
// or motion by being looked at.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/bare_loops.hpp"
#include "tests/support/process.hpp"

namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

class DeviceTools : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  /// Runs `rtbus` with these words; its exit status. What it printed is in output().
  int rtbus(std::vector<std::string> words) {
    words.insert(words.begin(), std::string(RTBUS_BINARY_DIR) + "/rtbus");
    tests::Child child(words, log());
    const int status = child.wait();
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string output() const {
    std::ostringstream text;
    text << std::ifstream(log()).rdbuf();
    return text.str();
  }
  /// The JSON in the output, behind what was said on stderr.
  json printed() const {
    const std::string text = output();
    const std::size_t begin = text.find("{\n");
    return begin == std::string::npos ? json() : json::parse(text.substr(begin), nullptr, false);
  }
  std::string write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  static std::string shipped(const std::string& name) {
    return std::string(RTBUS_SOURCE_DIR) + "/config/devices/" + name;
  }
  std::string log() const { return folder_ / "log"; }

  const fs::path folder_ = fs::temp_directory_path() / ("rtbus_device_tools_" + std::to_string(getpid()));
};

// ---- rtbus devices

TEST_F(DeviceTools, ListTheStateOfAFalconWithoutFirmwareAndLoadNone) {
  EXPECT_EQ(rtbus({"devices", "--virtual", shipped("virtual_falcon.yaml"), "--json"}), 0);
  const json device = printed()["devices"][0];
  EXPECT_EQ(device["usb_id"], "0403:cb48");
  EXPECT_EQ(device["serial"], "VF000001");
  EXPECT_EQ(device["driver"], "falcon");
  EXPECT_TRUE(device["asked"]);
  EXPECT_EQ(device["firmware"], "not running (or no wall power)");
  EXPECT_EQ(device["homing"], "not homed");
  EXPECT_THAT(device["remedy"].get<std::string>(), HasSubstr("wall power"));
}

TEST_F(DeviceTools, ListArmsAndOneOfThemByItsSerial) {
  const std::string file = write("elsewhere.yaml",
                                 "{schema: device/1, driver: phantom, model: vintage, homing: counters, usb: {virtual: "
                                 "{serial: \"77\", start_position_m: [0.02, 0.02, 0]}}}");
  EXPECT_EQ(rtbus({"devices", "--virtual", shipped("virtual_phantom.yaml"), "--virtual", file, "--json"}), 0);
  const json devices = printed()["devices"];
  ASSERT_EQ(devices.size(), 2u);
  EXPECT_EQ(devices[0]["model"], "Vintage PHANToM");
  EXPECT_EQ(devices[1]["serial"], "77");
  EXPECT_EQ(devices[1]["homing"], "counters away from home");
  EXPECT_THAT(devices[1]["remedy"].get<std::string>(), HasSubstr("the upper arm horizontal and the forearm straight"));
  // As text; one of them by its serial.
  EXPECT_EQ(rtbus({"devices", "77", "--virtual", shipped("virtual_phantom.yaml"), "--virtual", file}), 0);
  EXPECT_THAT(output(), HasSubstr("Vintage PHANToM, firmware runs, counters away from home"));
  EXPECT_THAT(output(), Not(HasSubstr("1234560")));
  EXPECT_EQ(rtbus({"devices", "nobody", "--virtual", file}), 1);
  EXPECT_THAT(output(), HasSubstr("no device is called nobody"));
  EXPECT_EQ(rtbus({"devices", "--virtual", shipped("sim_phantom_desktop.yaml")}), 2);
  EXPECT_THAT(output(), HasSubstr("has no virtual device"));
}

TEST_F(DeviceTools, AskNothingWhenToldSo) {
  EXPECT_EQ(rtbus({"devices", "--no-ask", "--virtual", shipped("virtual_falcon.yaml"), "--json"}), 0);
  EXPECT_FALSE(printed()["devices"][0]["asked"]);
  EXPECT_TRUE(printed()["devices"][0]["firmware"].is_null());
}

// ---- rtbus device-test

TEST_F(DeviceTools, TestAFalconByItsUsbId) {
  const std::string waypoints =
      write("circle.csv", "t_s,x_m,y_m,z_m\n0,0,0,0\n0.5,0.02,0,0\n1,0,0.02,0\n1.5,0,0,0.02\n2,0,0,0\n");
  const std::string file =
      write("falcon.yaml",
            "{schema: device/1, driver: falcon, firmware: synthetic, grip_mass_kg: 0.14, usb: {virtual: "
            "{hand: {type: waypoints, file: circle.csv, loop: true, impedance: firm, buttons: [{time_s: "
            "0.5, button: 2}, {time_s: 3, button: 2, pressed: false}, {time_s: 5, button: 1}, {time_s: "
            "60, button: 1, pressed: false}]}}}}");
  // A Falcon without an answer for 20 ms is let go at once. One thread or two may have waited for that.
  constexpr double kLate_ms = 10.0;
  const tests::BareLoops machine(tests::BareScheduling::kRealtime, kLate_ms);
  const int status = rtbus({"device-test", "0403:CB48", "--virtual", file, "--yes", "--seconds", "4", "--json"});
  const bool lost = output().find("the device was lost meanwhile") != std::string::npos;
  if (lost && machine.pauses() > 0) GTEST_SKIP() << machine.text();
  EXPECT_EQ(status, 0) << output();
  const json report = printed();
  EXPECT_TRUE(report["pass"]) << report.dump(1);
  EXPECT_EQ(report["device"], "novint_falcon");
  EXPECT_EQ(report["steps"].size(), 5u);
  EXPECT_THAT(output(), HasSubstr("home the Falcon"));
}

TEST_F(DeviceTools, TestAnArmByItsSerialAndByItsDriver) {
  const std::string waypoints =
      write("circle.csv", "t_s,x_m,y_m,z_m\n0,0,0,0\n0.5,0.02,0,0\n1,0,0.02,0\n1.5,0,0,0.02\n2,0,0,0\n");
  const std::string file = write("arm.yaml",
                                 "{schema: device/1, driver: phantom, model: vintage, homing: counters, usb: {virtual: "
                                 "{serial: \"4711\", hand: {type: waypoints, file: circle.csv, loop: true}}}}");
  for (const char* const id : {"4711", "phantom", "16c0:0483:4711"}) {
    EXPECT_EQ(rtbus({"device-test", id, "--virtual", file, "--yes", "--seconds", "3"}), 0) << id << "\n" << output();
    EXPECT_THAT(output(), HasSubstr("force     ok"));
  }
  EXPECT_EQ(rtbus({"device-test", "4712", "--virtual", file, "--yes"}), 1);
  EXPECT_THAT(output(), HasSubstr("no file and no device is called 4712; there is: 16c0:0483:4711"));
  EXPECT_EQ(rtbus({"device-test", "16c0:0483", "--virtual", file, "--virtual", shipped("virtual_phantom.yaml")}), 1);
  EXPECT_THAT(output(), HasSubstr("is the ID of several devices"));
}

// ---- rtbus calibrate

// The virtual motors need half as much again as the driver thinks; a mass finds that out. The hand takes the
// grip to its ends, waits, and then lets 0.2 kg hang on it: a spring so far away that it slips at its weight. It waits
// for two waves more than the grip alone takes, since a machine that pauses lets waves go uncounted.
TEST_F(DeviceTools, CalibrateFindsTheForceOfAFalconByAKnownMass) {
  std::string way = "t_s,x_m,y_m,z_m\n0,0,0,0\n";
  double t_s = 0.0;
  const auto go = [&](double x, double y, double z) {
    way +=
        std::to_string(t_s += 0.5) + "," + std::to_string(x) + "," + std::to_string(y) + "," + std::to_string(z) + "\n";
  };
  go(0, 0, 0.033);
  go(0, 0, -0.033);
  // Towards and away from each of the three arms, which stand at 105, -15 and -135 degrees.
  for (const double degrees : {105.0, -15.0, -135.0}) {
    const double c = std::cos(degrees * M_PI / 180.0), s = std::sin(degrees * M_PI / 180.0);
    go(0.027 * c, 0.027 * s, 0.01);
    go(-0.027 * c, -0.027 * s, 0.01);
  }
  way += std::to_string(t_s + 0.6) + ",0,0,0\n19,0,0,0\n19.6,0,-0.45,0\n";
  write("way.csv", way);
  const std::string file = write(
      "falcon.yaml",
      "{schema: device/1, driver: falcon, firmware: synthetic, grip_mass_kg: 0.0, usb: {virtual: {force_gain: "
      "libnifalcon, mechanics: {gravity_m_s2: [0, 0, 0]}, start_position_m: [0, 0, 0], hand: {type: waypoints, "
      "file: way.csv, interpolation: linear, stiffness_n_per_m: 700, damping_n_s_per_m: 2, max_force_n: 1.962}}}}");
  const std::string out = folder_ / "mine.yaml";
  const std::vector<std::string> words{"calibrate", file, "--mass", "0.2",      "--yes",
                                       "--seconds", "9",  "--json", "--output", out};
  ASSERT_EQ(rtbus(words), 0) << output();
  const json report = printed();
  EXPECT_TRUE(report["pass"]);
  // 6616 counts per N·m by the driver, 10000 by the motors.
  const double factor = std::stod(report["changes"]["force_calibration"].get<std::string>());
  EXPECT_NEAR(factor, 10000.0 * 1.9835e-5 * 7.62, 0.06) << report.dump(1);
  EXPECT_EQ(report["written"], out);
  // A device file that can be used, with the way it refers to.
  std::ostringstream text;
  text << std::ifstream(out).rdbuf();
  EXPECT_THAT(text.str(), HasSubstr("force_calibration: " + report["changes"]["force_calibration"].get<std::string>()));
  EXPECT_THAT(text.str(), HasSubstr("# Written by `rtbus calibrate`"));
  EXPECT_THAT(text.str(), HasSubstr((folder_ / "way.csv").string()));
  EXPECT_EQ(rtbus({"devices", "--virtual", out, "--json"}), 0) << output();
  // It is not replaced unless that is asked for.
  EXPECT_EQ(rtbus(words), 1);
  EXPECT_THAT(output(), HasSubstr("exists; name another file, or replace it with --overwrite"));
}

TEST_F(DeviceTools, CalibrateSaysWhenTheGripWasNotMovedToItsEnds) {
  const std::string out = folder_ / "mine.yaml";
  EXPECT_EQ(rtbus({"calibrate", shipped("virtual_falcon.yaml"), "--yes", "--seconds", "2", "-o", out}), 1);
  EXPECT_THAT(output(), HasSubstr("move the grip to all its ends"));
  EXPECT_THAT(output(), HasSubstr("nothing was written"));
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(DeviceTools, CalibrateFindsModelCountersAndStylusOfAnArmAndPushesItNowhere) {
  write("way.csv",
        "t_s,x_m,y_m,z_m\n0,0,-0.015,0\n4,0,-0.015,0\n5,0.04,0.03,0.02\n6,-0.04,0.03,-0.02\n7,0,-0.015,0\n60,0,-0."
        "015,0\n");
  const std::string file = write(
      "arm.yaml",
      "{schema: device/1, driver: phantom, model: woodenhaptics, usb: {virtual: {model: vintage, serial: \"4711\", "
      "gimbal_rad: [0.1, -0.2, 0.05], hand: {type: waypoints, file: way.csv, interpolation: linear, impedance: "
      "firm}}}}");
  const std::string out = folder_ / "mine.yaml";
  ASSERT_EQ(rtbus({"calibrate", file, "--yes", "--seconds", "20", "--json", "-o", out}), 0) << output();
  const json report = printed();
  EXPECT_TRUE(report["pass"]) << report.dump(1);
  EXPECT_EQ(report["changes"]["model"], "vintage");
  const json zero = json::parse(report["changes"]["gimbal.zero_rad"].get<std::string>());
  ASSERT_EQ(zero.size(), 3u);
  EXPECT_NEAR(zero[0], 0.1, 0.004);
  EXPECT_NEAR(zero[1], -0.2, 0.004);
  EXPECT_NEAR(zero[2], 0.05, 0.004);
  EXPECT_EQ(rtbus({"device-test", "4711", "--virtual", out, "--set", "homing=counters", "--yes", "--seconds", "0.2"}),
            1);
  EXPECT_THAT(output(), HasSubstr("answers   ok")) << "the file that was written is one that the driver takes";
}

TEST_F(DeviceTools, CalibrateBelievesNoZeroThatIsNotOne) {
  const std::string file = write("arm.yaml",
                                 "{schema: device/1, driver: phantom, model: vintage, usb: {virtual: {counters: "
                                 "from_home, start_position_m: [0.03, 0.02, 0]}}}");
  EXPECT_EQ(rtbus({"calibrate", file, "--yes", "--seconds", "1.5"}), 1);
  EXPECT_THAT(output(), HasSubstr("home      FAIL"));
  EXPECT_THAT(output(), HasSubstr("the upper arm horizontal and the forearm straight down"));
}

TEST_F(DeviceTools, CalibrateRefusesWhatHasNoUsb) {
  EXPECT_EQ(rtbus({"calibrate", shipped("sim_phantom_desktop.yaml")}), 1);
  EXPECT_THAT(output(), HasSubstr("only real devices are calibrated"));
}

}  // namespace
