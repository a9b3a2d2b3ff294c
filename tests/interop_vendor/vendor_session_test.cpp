// Sessions on the stand-ins for makers' devices under `rtbus run`; and a session without them, which maps nothing of
// them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/link_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/process.hpp"

namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::Child;
using tests::eventually;

const std::string kBin = std::string(RTBUS_BINARY_DIR) + "/";

std::string config(const std::string& name) { return std::string(RTBUS_SOURCE_DIR) + "/config/" + name; }

std::string text_of(const std::string& file) {
  std::ostringstream out;
  out << std::ifstream(file).rdbuf();
  return out.str();
}

constexpr const char* kMakersWords[] = {"force_dimension", "openhaptics", "haply", "websockets",
                                        "libdrd",          "libdhd",      "libHD", "stand_in"};

/// What the nodes of a session have mapped while it runs.
std::string maps_of(const std::string& file, const std::string& session, const std::vector<const char*>& nodes) {
  Child run(
      {kBin + "rtbus", "run", file, "--duration", "20", "--no-bare-loop", "--no-plots", "--set", "session=" + session},
      "/dev/null");
  rtbus::Session bus;
  bus.name = session;
  std::string out;
  for (const char* const node : nodes) {
    EXPECT_TRUE(eventually(15.0, [&] {
      auto beat = rtbus::Reader<rtbus::Heartbeat>::open(bus, std::string(node) + ".heartbeat");
      rtbus::Stamped<rtbus::Heartbeat> sample;
      if (!beat || beat->read_latest(sample) != rtbus::ReadStatus::kFresh) return false;
      if (sample.value.state != static_cast<std::uint32_t>(rtbus::NodeState::kRunning)) return false;
      const std::string maps = text_of("/proc/" + std::to_string(sample.value.pid) + "/maps");
      out += maps;
      return !maps.empty();
    })) << node;
  }
  run.end(SIGTERM);
  return out;
}

TEST(VendorMaps, ASessionThatNamesNoMakerMapsNothingOfOne) {
  const std::string maps =
      maps_of(config("wall.yaml"), "vendormaps" + std::to_string(getpid()), {"haptic0", "physics"});
  EXPECT_THAT(maps, HasSubstr("haptic_node")) << "these are the nodes' maps";
  EXPECT_THAT(maps, HasSubstr("physics_node"));
  for (const char* const word : kMakersWords) EXPECT_THAT(maps, Not(HasSubstr(word)));
}

// The control of the test above: these words are there when a session names the maker.
TEST(VendorMaps, ASessionThatNamesOneMapsThatOneAlone) {
  const std::string maps =
      maps_of(config("wall_virtual_omega.yaml"), "vendormapsfd" + std::to_string(getpid()), {"haptic0"});
  EXPECT_THAT(maps, HasSubstr("libdrivers_force_dimension.so"));
  EXPECT_THAT(maps, HasSubstr("libstand_in_force_dimension.so"));
  for (const char* const word : {"openhaptics", "haply", "websockets", "libusb"})
    EXPECT_THAT(maps, Not(HasSubstr(word)));
}

// Each process has a copy of the maker's library to itself, and one scheduler in it.
TEST(VendorProcesses, TwoNodesEachDriveADeviceThroughOpenHaptics) {
  const std::string session = "vendortwo" + std::to_string(getpid());
  const std::string file = testing::TempDir() + session + ".yaml";
  const std::string device = config("devices/virtual_touch.yaml");
  const std::string law = ", clock: device, rate_hz: 1000, method: direct, coupling: {stiffness_n_per_m: 400}}";
  std::ofstream(file) << "schema: session/1\nsession: " << session << "\nscene: " << config("scenes/wall.yaml")
                      << "\nhaptic:\n  - {name: haptic0, device: " << device << law
                      << "\n  - {name: haptic1, device: " << device << law << "\n";
  Child run({kBin + "rtbus", "run", file, "--duration", "20", "--no-bare-loop", "--no-plots"}, "/dev/null");
  rtbus::Session bus;
  bus.name = session;
  for (const char* const node : {"haptic0", "haptic1"}) {
    EXPECT_TRUE(eventually(15.0,
                           [&] {
                             auto stats = rtbus::Reader<rtbus::LoopStats>::open(bus, std::string(node) + ".loop_stats");
                             rtbus::Stamped<rtbus::LoopStats> sample;
                             return stats && stats->read_latest(sample) == rtbus::ReadStatus::kFresh &&
                                    sample.value.force_peak_n > 0.5;
                           }))
        << node << " pushes on the wall";
  }
  EXPECT_EQ(run.end(SIGTERM), 0);
  std::filesystem::remove(file);
}

/// Waits for a tick of the session's loop of which `done` is true.
template <class Done>
bool follow(const std::string& session, double seconds, Done done) {
  rtbus::Session bus;
  bus.name = session;
  std::optional<rtbus::Reader<rtbus::Telemetry>> ticks;
  return eventually(seconds, [&] {
    if (!ticks) {
      auto opened = rtbus::Reader<rtbus::Telemetry>::open(bus, "haptic0.telemetry", {.presence = true});
      if (opened) ticks.emplace(std::move(*opened));
    }
    rtbus::Stamped<rtbus::Telemetry> tick;
    while (ticks && ticks->read_next(tick) == rtbus::ReadStatus::kFresh) {
      const rtbus::Vec3& f = tick.value.force_n;
      if (done(std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]))) return true;
    }
    return false;
  });
}

class VendorSession : public testing::TestWithParam<const char*> {};

TEST_P(VendorSession, RunsObeysTheEmergencyStopAndReportsItsLink) {
  const std::string session = std::string(GetParam()) + std::to_string(getpid());
  const std::string file = testing::TempDir() + session + ".json";
  const std::string log = testing::TempDir() + session + ".log";
  Child run({kBin + "rtbus", "run", config(std::string("wall_virtual_") + GetParam() + ".yaml"), "--duration", "60",
             "--report", file, "--no-plots", "--no-bare-loop", "--set", "session=" + session},
            log);
  EXPECT_TRUE(follow(session, 20.0, [](double force_n) { return force_n > 0.5; })) << "the hand pushes into the wall";
  Child stop({kBin + "rtbus", "estop", "-s", session}, "/dev/null");
  EXPECT_EQ(stop.wait(), 0);
  EXPECT_TRUE(follow(session, 2.0, [](double force_n) { return force_n == 0.0; }));
  rtbus::Session bus;
  bus.name = session;
  EXPECT_TRUE(eventually(20.0, [&] {  // however slow this machine is
    auto link = rtbus::Reader<rtbus::LinkStats>::open(bus, "haptic0.link_stats");
    rtbus::Stamped<rtbus::LinkStats> sample;
    return link && link->read_latest(sample) == rtbus::ReadStatus::kFresh && sample.value.exchanges > 1000;
  }));
  EXPECT_EQ(run.end(SIGTERM), 0) << text_of(log);
  const json report = json::parse(text_of(file), nullptr, false);
  ASSERT_TRUE(report.is_object()) << text_of(log);
  const json& haptic = report["haptic"][0];
  EXPECT_GT(haptic["link"]["exchanges"], 1000);
  EXPECT_GT(haptic["link"]["sample_to_wire_us"]["p99"], 0.0);
  EXPECT_GT(haptic["force_n"]["peak"], 0.5) << "the hand pushes into the wall";
  EXPECT_EQ(haptic["safety"]["nonfinite"], 0);
  std::filesystem::remove(file);
  std::filesystem::remove(log);
}

/// One session at a time may have a unit: the second learns whose it is, and nothing of it starts.
TEST_P(VendorSession, ASecondOneOnTheSameDeviceIsRefusedWithTheFirstsName) {
  const std::string serial = std::to_string(getpid() % 60000 + 1);
  const std::string first = "vendorfirst" + std::string(GetParam()) + serial, second = "vendorsecond" + serial;
  const std::string device = testing::TempDir() + first + ".device.yaml", log = testing::TempDir() + second + ".log";
  const std::string model = GetParam() == std::string("omega")   ? "force_dimension, model: omega3"
                            : GetParam() == std::string("touch") ? "openhaptics, model: touch"
                                                                 : "haply, model: inverse3";
  std::ofstream(device) << "{schema: device/1, driver: " << model << ", virtual: {serial: \"" << serial
                        << "\", one_session: true}}\n";
  const auto command = [&](const std::string& session) {
    return std::vector<std::string>{kBin + "rtbus",
                                    "run",
                                    config(std::string("wall_virtual_") + GetParam() + ".yaml"),
                                    "--duration",
                                    "60",
                                    "--no-plots",
                                    "--no-bare-loop",
                                    "--set",
                                    "session=" + session,
                                    "--set",
                                    "haptic.0.device=" + device};
  };
  Child run(command(first), "/dev/null");
  EXPECT_TRUE(follow(first, 20.0, [](double) { return true; })) << "its loop ticks";
  Child refused(command(second), log);
  EXPECT_NE(refused.wait(), 0);
  EXPECT_THAT(text_of(log), HasSubstr("session " + first + ", node haptic0 (pid "));
  EXPECT_TRUE(follow(first, 5.0, [](double) { return true; })) << "the first goes on";
  EXPECT_EQ(run.end(SIGTERM), 0);
  std::filesystem::remove(device);
  std::filesystem::remove(log);
}

std::vector<const char*> stand_ins() {
  std::vector<const char*> out{"omega", "touch"};
  if (RTBUS_WITH_HAPLY) out.push_back("inverse3");
  return out;
}

INSTANTIATE_TEST_SUITE_P(StandIns, VendorSession, testing::ValuesIn(stand_ins()),
                         [](const auto& name) { return std::string(name.param); });

}  // namespace
