// A session with a virtual USB device under `rtbus run`, and what watches it: how the link does is in the monitor and
// in the report. Every other session has no such topic.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/process.hpp"

namespace {

using nlohmann::json;
using tests::Child;
using tests::eventually;

json read_json(const std::string& file) {
  std::ifstream stream(file);
  return json::parse(stream, nullptr, false);
}

TEST(UsbSession, MonitorAndReportShowTheLink) {
  const std::string bin = std::string(RTBUS_BINARY_DIR) + "/";
  const std::string session = "usbsession" + std::to_string(getpid());
  const std::string folder = testing::TempDir() + "/" + session;
  ASSERT_EQ(::system(("mkdir -p " + folder).c_str()), 0);
  const std::string report_file = folder + "/report.json", top_file = folder + "/top.json";
  Child run({bin + "rtbus", "run", std::string(RTBUS_SOURCE_DIR) + "/config/wall_virtual_phantom.yaml", "--duration",
             "4", "--report", report_file, "--no-plots", "--set", "session=" + session},
            folder + "/run.log");
  json top;
  EXPECT_TRUE(eventually(20.0, [&] {
    Child look({bin + "rtbus", "top", "--once", "--json", "--session", session}, top_file);
    look.wait();
    top = read_json(top_file);
    return top.is_object() && !top["haptic"].empty() && top["haptic"][0].contains("link") &&
           top["haptic"][0]["link"]["state"] == "running" && top["haptic"][0]["link"]["exchanges"] > 100;
  })) << top.dump(1);
  run.wait();
  const json report = read_json(report_file);
  ASSERT_TRUE(report.is_object());
  const json& haptic = report["haptic"][0];
  ASSERT_TRUE(haptic["link"].is_object()) << haptic.dump(1);
  EXPECT_GT(haptic["link"]["exchanges"], 1000);
  EXPECT_GT(haptic["link"]["sample_to_wire_us"]["p99"], 0.0);
  bool topic = false;
  for (const json& each : report["bus"]["topics"]) topic = topic || each["name"] == "haptic0.link_stats";
  EXPECT_TRUE(topic) << report["bus"]["topics"].dump(1);
  ASSERT_EQ(::system(("rm -r " + folder).c_str()), 0);
}

}  // namespace
