// `rtbus view FILE.h5`: a recording in the browser.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>

#include "rtbus/clock.hpp"
#include "rtbus/recording/reader.hpp"
#include "tests/view/view_fixture.hpp"

#if RTBUS_WITH_HDF5
namespace {

using nlohmann::json;
using testing::HasSubstr;
using tests::Child;
using tests::Tab;
using tests::View;
using tests::ViewServer;

class ViewRecording : public View {
 protected:
  void SetUp() override {
    View::SetUp();
    if (IsSkipped()) return;
    folder_ = std::string(testing::TempDir()) + bus_.name;
    std::filesystem::create_directory(folder_);
  }
  void TearDown() override {
    View::TearDown();
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }
  /// Of the running session, with its bodies.
  [[nodiscard]] std::string record(double duration_s, int signal) {
    return record(signal, [duration_s] { ::usleep(static_cast<useconds_t>(1e6 * duration_s)); });
  }
  /// While `meanwhile` runs.
  [[nodiscard]] std::string record(int signal, const std::function<void()>& meanwhile) {
    std::string file = folder_ + "/trial.h5";
    Child recorder({binary("rtbus"), "record", file, "--session", bus_.name, "--topics", "haptic0", "physics"},
                   "/dev/null");
    meanwhile();
    recorder.end(signal);
    return file;
  }
  static double at(Tab& tab) {
    return tab.evaluate("rtbusTest.page.newest.now - rtbusTest.page.playback.about.begin_s").get<double>();
  }
  int status_of(const std::string& file, std::string& said) {
    const std::string output = folder_ + "/said.txt";
    const int status = Child({binary("rtbus"), "view", file, "--port", "0"}, output).wait();
    std::ifstream in(output);
    said.assign((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  std::string folder_;
};

#if RTBUS_WITH_BULLET
TEST_F(ViewRecording, PlaysStepsAndJumps) {
  start_nodes("stack_125.yaml");
  ASSERT_TRUE(reader<rtbus::Telemetry>("haptic0.telemetry"));
  const std::string file = record(4.0, SIGINT);
  haptic_.reset();
  physics_.reset();
  const ViewServer server("", {file});
  Tab tab(*browser_);
  tab.open(server.url());
  expect_ready(tab);
  EXPECT_EQ(tab.evaluate("rtbusTest.page.scene.bodies.length"), 126);
  EXPECT_EQ(tab.evaluate("document.getElementById('estop').hidden"), true);
  const double length_s = tab.evaluate("rtbusTest.page.playback.about.length_s").get<double>();
  EXPECT_GT(length_s, 2.0);

  // It plays by itself, to its end, where it stands.
  EXPECT_TRUE(tab.becomes("!rtbusTest.page.playback.about.playing"));
  EXPECT_TRUE(tab.becomes("rtbusTest.page.newest.now - rtbusTest.page.playback.about.begin_s > " +
                          std::to_string(length_s - 1e-3)))
      << at(tab);
  EXPECT_EQ(tab.evaluate("rtbusTest.page.scene.notes.length"), 0) << tab.evaluate("rtbusTest.page.scene.notes");

  // A jump back: the curves end there.
  tab.evaluate("rtbusTest.page.link.play({ at: 1.5, playing: false })");
  ASSERT_TRUE(tab.becomes("Math.abs(rtbusTest.page.newest.now - rtbusTest.page.playback.about.begin_s - 1.5) < 1e-6"));
  EXPECT_TRUE(
      tab.becomes("rtbusTest.page.curves.history().count > 1000 && Math.abs("
                  "rtbusTest.page.curves.history().newest_s - rtbusTest.page.newest.now) < 0.005"));
  // Single ticks: one row of the curves each.
  const double before_s = tab.evaluate("rtbusTest.page.curves.history().newest_s").get<double>();
  tab.evaluate("document.getElementById('tick-on').click()");
  EXPECT_TRUE(tab.becomes("rtbusTest.page.curves.history().newest_s > " + std::to_string(before_s) + " + 0.0005"));
  const auto recording = rtbus::recording::Recording::open(file);
  ASSERT_TRUE(recording);
  const std::vector<std::uint64_t> stamps_ns = recording->stamps_ns(*recording->find("haptic0.telemetry"));
  const auto next = std::upper_bound(stamps_ns.begin(), stamps_ns.end(),
                                     static_cast<std::uint64_t>(std::llround((before_s + 0.0002) * 1e9)));
  ASSERT_NE(next, stamps_ns.end());  // a busy machine makes ticks late, or the recorder loses some
  EXPECT_NEAR(tab.evaluate("rtbusTest.page.curves.history().newest_s").get<double>(), static_cast<double>(*next) * 1e-9,
              0.0008);
  // Slowly.
  const double slow_s = at(tab);
  const std::uint64_t began_ns = rtbus::monotonic_ns();
  tab.evaluate("rtbusTest.page.link.play({ speed: 0.01, playing: true })");
  EXPECT_TRUE(tab.becomes("rtbusTest.page.newest.now - rtbusTest.page.playback.about.begin_s > " +
                          std::to_string(slow_s + 0.004)));  // a busy machine draws when it can
  const double gone_s = at(tab) - slow_s;
  EXPECT_LT(gone_s, 0.01 * rtbus::seconds_between(began_ns, rtbus::monotonic_ns()) + 0.04);
  keep(tab, "recording");
}

/// A hand on a plate that moves by itself: proxy and plate, by their pixels, at the proxy's lowest and highest instant.
TEST_F(ViewRecording, ProxyAndMovingPlateAreWhereTheyWere) {
  start_nodes("moving_plate.yaml");
  auto live = reader<rtbus::Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(live);
  const std::string file = record(SIGINT, [&] {
    // Until the plate has lifted the proxy by its 10 mm: on a busy machine physics falls behind the clock.
    std::vector<double> y_m;
    (void)follow(*live, 60.0, [&](const rtbus::Stamped<rtbus::Telemetry>& tick) {
      y_m.push_back(tick.value.proxy_position_m[1]);
      if (y_m.size() < 4000 || y_m.size() % 100 != 0) return false;
      const auto [low, high] =
          std::minmax_element(y_m.begin() + static_cast<std::ptrdiff_t>(y_m.size() / 2), y_m.end());
      return *high - *low > 0.0099;
    });
  });
  haptic_.reset();
  physics_.reset();
  const auto recording = rtbus::recording::Recording::open(file);
  ASSERT_TRUE(recording);
  const rtbus::recording::RecordedTopic* const ticks = recording->find("haptic0.telemetry");
  ASSERT_NE(ticks, nullptr);
  const std::vector<std::uint64_t> stamps_ns = recording->stamps_ns(*ticks);
  const std::vector<double> proxy_y_m = recording->column(*ticks, "proxy_position_m", 1);
  ASSERT_GT(proxy_y_m.size(), 1000U);
  // When the hand rests on the plate, and the plate moves.
  const auto [lowest, highest] =
      std::minmax_element(proxy_y_m.begin() + static_cast<std::ptrdiff_t>(proxy_y_m.size() / 2), proxy_y_m.end());
  ASSERT_GT(*highest - *lowest, 0.009);

  const ViewServer server("", {file});
  Tab tab(*browser_);
  tab.open(server.url());
  expect_ready(tab);
  constexpr double kMappedBy_m = 0.005;  // telemetry is in the device's frame
  // Bodies are shown between the two frames around the instant. A small scene is one row of the topic.
  const rtbus::recording::RecordedTopic* const bodies = recording->find("physics.body_poses");
  ASSERT_NE(bodies, nullptr);
  const std::vector<std::uint64_t> frames_ns = recording->stamps_ns(*bodies);
  constexpr std::uint32_t kPlate = 1;  // in the scene's order
  const std::vector<double> plate_y_m = recording->column(*bodies, "position_m", 3 * kPlate + 1);
  const auto plate_at_m = [&](std::uint64_t time_ns) {
    const auto after =
        std::clamp<std::ptrdiff_t>(std::upper_bound(frames_ns.begin(), frames_ns.end(), time_ns) - frames_ns.begin(), 1,
                                   std::ssize(frames_ns) - 1);
    const auto next = static_cast<std::size_t>(after);
    const double share = rtbus::seconds_between(frames_ns[next - 1], time_ns) /
                         rtbus::seconds_between(frames_ns[next - 1], frames_ns[next]);
    return std::lerp(plate_y_m[next - 1], plate_y_m[next], std::clamp(share, 0.0, 1.0));
  };
  std::vector<double> proxy_px, plate_px, plate_m;
  for (const auto& y_m : {lowest, highest}) {
    const std::uint64_t time_ns = stamps_ns[static_cast<std::size_t>(y_m - proxy_y_m.begin())];
    const std::string time_s = std::to_string(static_cast<double>(time_ns) * 1e-9);
    tab.evaluate("rtbusTest.page.link.play({ at: " + time_s +
                 " - rtbusTest.page.playback.about.begin_s, playing: false })");
    const double drawn_m = *y_m + kMappedBy_m;
    ASSERT_TRUE(tab.becomes("Math.abs(rtbusTest.page.hands.now[0].proxy[1] - " + std::to_string(drawn_m) + ") < 2e-4"))
        << drawn_m << ' ' << tab.evaluate("rtbusTest.page.hands.now[0].proxy[1]");
    // Bodies come by themselves, some frames after the hand.
    plate_m.push_back(plate_at_m(time_ns));
    EXPECT_TRUE(tab.becomes("Math.abs(rtbusTest.bodyAt('plate')[1] - " + std::to_string(plate_m.back()) + ") < 1e-4"))
        << plate_m.back() << ' ' << tab.evaluate("rtbusTest.bodyAt('plate')[1]");
    const json seen = colours(tab, "[rtbusTest.proxyOnScreen()]");
    const json& rgb = seen["colours"][0];
    EXPECT_GT(rgb[2].get<int>(), rgb[0].get<int>() + 40) << seen;  // blue
    proxy_px.push_back(seen["at"][0][1]);
    // Beside the hand, on the plate's upper face.
    const std::string face =
        "(() => { const p = rtbusTest.bodyAt('plate'); return [p[0] + 0.035, p[1] + 0.01, p[2] + 0.035]; })()";
    const json at = tab.evaluate("rtbusTest.page.camera.project(" + face + ")");
    EXPECT_EQ(tab.evaluate("rtbusTest.page.renderer.pick(rtbusTest.page.camera, " + at[0].dump() + ", " + at[1].dump() +
                           ", performance.now())"),
              "plate");
    plate_px.push_back(at[1]);
  }
  EXPECT_LT(proxy_px[1], proxy_px[0] - 10.0);                             // up on the screen
  const double share = (plate_m[1] - plate_m[0]) / (*highest - *lowest);  // 1 while the hand rests on it
  EXPECT_NEAR(plate_px[1] - plate_px[0], share * (proxy_px[1] - proxy_px[0]), 0.35 * (proxy_px[0] - proxy_px[1]));
  keep(tab, "moving_plate");
}
#endif

TEST_F(ViewRecording, ShowsOneThatWasCutShort) {
  start_nodes("wall.yaml");
  ASSERT_TRUE(reader<rtbus::Telemetry>("haptic0.telemetry"));
  const std::string file = record(3.5, SIGKILL);
  const ViewServer server("", {file});
  Tab tab(*browser_, 320, 240);
  tab.open(server.url());
  expect_ready(tab);
  EXPECT_THAT(tab.evaluate("document.getElementById('notes').textContent").get<std::string>(), HasSubstr("cut short"));
}

TEST_F(ViewRecording, SaysWhatIsWrongWithTheFile) {
  std::string said;
  EXPECT_EQ(status_of(folder_ + "/none.h5", said), 1);
  EXPECT_THAT(said, HasSubstr("cannot read"));
  std::ofstream(folder_ + "/text.h5") << "no recording";
  EXPECT_EQ(status_of(folder_ + "/text.h5", said), 1);
  EXPECT_THAT(said, HasSubstr("no recording"));
}

}  // namespace
#endif
