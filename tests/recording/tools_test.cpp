/// What is done with a recording: export, plots, replay; and the stream of a live session.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "tests/recording/recorded_session.hpp"

namespace {

using nlohmann::json;
using rtbus::recording::Recording;
using testing::HasSubstr;
using testing::StartsWith;
using tests::Child;
using tests::eventually;
using tests::Telemetry;
using tests::values;
using RecordingTools = tests::RecordedSession;

std::size_t lines_of(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

TEST_F(RecordingTools, ShowTheSamplesOfARecording) {
  start_physics();
  start_haptic();
  auto reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader);
  ASSERT_NO_FATAL_FAILURE(start_recorder(file()));
  ASSERT_EQ(ticks(*reader, 3000).size(), 3000u);
  EXPECT_EQ(tool({"mark", "in contact", "-s", bus_.name}), 0);
  ASSERT_EQ(end_recorder(), 0) << said();
  std::uint64_t rows = 0;
  {
    const auto recording = Recording::open(file());
    ASSERT_TRUE(recording) << recording.error().message;
    rows = recording->find("haptic0.telemetry")->rows;
  }
  // The header and a line for each row.
  ASSERT_EQ(tool({"export", file(), "--csv", "-t", "haptic0.telemetry", "-o", file("csv")}), 0) << text_of("tool.txt");
  const std::string csv = text_of("csv/haptic0.telemetry.csv");
  EXPECT_EQ(lines_of(csv), rows + 1);
  EXPECT_THAT(csv, HasSubstr("force_n[1] [N]"));
  ASSERT_EQ(tool({"export", file()}, "contents.txt"), 0);
  EXPECT_THAT(text_of("contents.txt"), HasSubstr("in contact"));

  if (std::system("gnuplot --version > /dev/null 2>&1") == 0) {
    ASSERT_EQ(tool({"plot", file(), "-o", file("p.png")}), 0) << text_of("tool.txt");
    EXPECT_THAT(text_of("p.png"), StartsWith("\x89PNG"));
    ASSERT_EQ(tool({"plot", file(), "--signals", "force_n[1]", "-o", file("p.svg")}), 0) << text_of("tool.txt");
    EXPECT_THAT(text_of("p.svg"), HasSubstr("<svg"));
    EXPECT_THAT(text_of("p.svg"), HasSubstr("in contact"));
    ASSERT_EQ(tool({"plot", "--live", "0.5", "-s", bus_.name, "-o", file("live.svg")}), 0) << text_of("tool.txt");
    EXPECT_THAT(text_of("live.svg"), HasSubstr("<svg"));
  }
  if (std::system("h5dump --version > /dev/null 2>&1") == 0) {
    Child dump({"h5dump", "-H", file()}, file("dump.txt"));
    EXPECT_EQ(dump.wait(), 0) << text_of("dump.txt");
    EXPECT_THAT(text_of("dump.txt"), HasSubstr("GROUP \"haptic0.telemetry\""));
  }
}

TEST_F(RecordingTools, ReplayAsALiveDevice) {
  start_physics();
  start_haptic();
  auto reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader);
  ASSERT_NO_FATAL_FAILURE(start_recorder(file()));
  ASSERT_EQ(ticks(*reader, 4000).size(), 4000u);
  const auto maps = [](const Child& child) {
    std::ifstream in("/proc/" + std::to_string(child.pid()) + "/maps");
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  EXPECT_THAT(maps(*haptic_), testing::Not(HasSubstr("hdf5")));  // nobody named it
  ASSERT_EQ(end_recorder(), 0) << said();
  (void)haptic_->end(SIGTERM);
  haptic_.emplace(command("haptic_node",
                          {"--set", "haptic.0.device=devices/replay.yaml", "--set", "haptic.0.device.file=" + file()}),
                  file("haptic.txt"));
  reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader) << text_of("haptic.txt");
  EXPECT_THAT(maps(*haptic_), HasSubstr("hdf5"));
  const auto again = ticks(*reader, 2000);
  ASSERT_EQ(again.size(), 2000u);
  const auto recording = Recording::open(file());
  ASSERT_TRUE(recording) << recording.error().message;
  const auto motion = values<rtbus::DeviceState>(*recording, "haptic0.device_state");
  // Where it is now is where the hand was then: every position comes out of the recording, in order.
  std::size_t at = 0, served = 0;
  for (const auto& tick : again) {
    std::size_t next = at;
    while (next < motion.size() && motion[next].position_m != tick.value.position_m) ++next;
    if (next == motion.size()) continue;
    at = next;
    ++served;
  }
  EXPECT_EQ(served, again.size());
}

TEST_F(RecordingTools, StreamJsonDatagramsWithTheirTime) {
  start_physics();
  start_haptic();
  ASSERT_TRUE(this->reader<Telemetry>("haptic0.telemetry"));
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in here{};
  here.sin_family = AF_INET;
  here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof here;
  ASSERT_EQ(::bind(socket, reinterpret_cast<sockaddr*>(&here), sizeof here), 0);
  ASSERT_EQ(::getsockname(socket, reinterpret_cast<sockaddr*>(&here), &length), 0);
  const timeval patience{10, 0};
  ::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  Child stream({binary("rtbus"), "stream", "--plotjuggler", "udp://127.0.0.1:" + std::to_string(ntohs(here.sin_port)),
                "-s", bus_.name},
               file("stream.txt"));
  std::size_t telemetry = 0;
  double last_s = 0.0;
  for (int i = 0; i < 2000 && telemetry < 200; ++i) {
    std::string datagram(65536, '\0');
    const ssize_t bytes = ::recv(socket, datagram.data(), datagram.size(), 0);
    ASSERT_GT(bytes, 0) << text_of("stream.txt");
    datagram.resize(static_cast<std::size_t>(bytes));
    const json sample = json::parse(datagram, nullptr, false);
    ASSERT_FALSE(sample.is_discarded()) << datagram;
    ASSERT_TRUE(sample.contains("timestamp") && sample["timestamp"].is_number()) << datagram;
    if (!sample.contains(json::json_pointer("/haptic0/telemetry"))) continue;
    const double time_s = sample["timestamp"];
    EXPECT_GT(time_s, last_s);
    EXPECT_NEAR(time_s, 1e-9 * static_cast<double>(rtbus::monotonic_ns()), 10.0);
    EXPECT_TRUE(sample.at(json::json_pointer("/haptic0/telemetry/force_n")).is_array()) << datagram;
    last_s = time_s;
    ++telemetry;
  }
  EXPECT_EQ(telemetry, 200u);
  EXPECT_EQ(stream.end(SIGINT), 0);
  ::close(socket);
}

}  // namespace
