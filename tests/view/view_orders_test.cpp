// What the page orders: it reaches the session and the device.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>

#include "tests/view/view_fixture.hpp"

namespace {

using nlohmann::json;
using testing::HasSubstr;
using tests::Child;
using tests::norm;
using tests::Tab;
using tests::View;
using tests::ViewServer;

/// `rtbus run` of the wall with a hand that presses and stays, a page of it, and the ticks of the haptic node.
class ViewOrders : public View {
 protected:
  void SetUp() override {
    View::SetUp();
    if (IsSkipped()) return;
    folder_ = std::string(testing::TempDir()) + bus_.name;
    std::filesystem::create_directory(folder_);
    std::ofstream(folder_ + "/device.yaml")
        << "schema: device/1\ndriver: simulated\nmodel: phantom_desktop\nmechanics: {coulomb_n: 0}\n"
        << "hand: {type: push, impedance: normal, start_m: [0, 0.020, 0], direction: [0, -1, 0], distance_m: 0.025, "
        << "speed_m_s: 0.05, start_s: 0.2}\n";
    run_.emplace(
        std::vector<std::string>{binary("rtbus"), "run", std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml", "--set",
                                 "session=" + bus_.name, "--set", "haptic.0.device=" + folder_ + "/device.yaml",
                                 "--set", "haptic.0.adjustable=[coupling.stiffness_n_per_m]"},
        folder_ + "/run.txt");
    ticks_ = reader<rtbus::Telemetry>("haptic0.telemetry");
    ASSERT_TRUE(ticks_);
    ASSERT_TRUE(follow(*ticks_, 10.0, [](const auto& tick) { return norm(tick.value.force_n) > 0.5; }));
  }
  void TearDown() override {
    ticks_.reset();
    if (run_) run_->end(SIGINT);
    View::TearDown();
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }
  std::unique_ptr<ViewServer> server(std::vector<std::string> more = {}) {
    more.insert(more.end(), {"--record-to", folder_});
    return std::make_unique<ViewServer>(bus_.name, more);
  }
  static void press(Tab& tab, const std::string& id) {
    const json at = tab.evaluate("(() => { const r = document.getElementById('" + id +
                                 "').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()");
    for (const char* const type : {"mousePressed", "mouseReleased"}) {
      tab.call("Input.dispatchMouseEvent",
               {{"type", type}, {"x", at[0]}, {"y", at[1]}, {"button", "left"}, {"clickCount", 1}});
    }
  }
  static std::string answer(Tab& tab) {
    return tab.evaluate("document.getElementById('answer').textContent").get<std::string>();
  }
  bool no_force(double timeout_s) {
    return follow(*ticks_, timeout_s, [](const auto& tick) { return norm(tick.value.force_n) == 0.0; });
  }

  std::string folder_;
  std::optional<Child> run_;
  std::optional<rtbus::Reader<rtbus::Telemetry>> ticks_;
};

TEST_F(ViewOrders, EstopReachesTheDeviceAndIsHeldUntilRearmed) {
  const auto view = server();
  Tab tab(*browser_);
  tab.open(view->url());
  expect_ready(tab);
  ASSERT_TRUE(tab.becomes("!document.getElementById('mark').hidden")) << answer(tab);
  press(tab, "estop");
  EXPECT_TRUE(no_force(3.0));
  EXPECT_TRUE(tab.becomes("rtbusTest.word() === 'E-STOP' && rtbusTest.reason().includes('rtbus view')"))
      << tab.evaluate("rtbusTest.word() + rtbusTest.reason()") << answer(tab);
  EXPECT_TRUE(tab.becomes("document.getElementById('answer').textContent.includes('zero force')")) << answer(tab);
  EXPECT_TRUE(tab.becomes("!document.getElementById('rearm').hidden"));
  keep(tab, "estop");
  EXPECT_FALSE(follow(*ticks_, 0.5, [](const auto& tick) { return norm(tick.value.force_n) > 0.0; }));
  press(tab, "rearm");
  EXPECT_TRUE(follow(*ticks_, 3.0, [](const auto& tick) { return norm(tick.value.force_n) > 0.5; }));
  EXPECT_TRUE(tab.becomes("rtbusTest.word() === 'NORMAL'")) << tab.evaluate("rtbusTest.word()");
}

TEST_F(ViewOrders, AGainReachesTheHand) {
  const auto view = server();
  Tab tab(*browser_);
  tab.open(view->url());
  expect_ready(tab);
  ASSERT_TRUE(tab.becomes("document.querySelector('#gains input')")) << answer(tab);
  const std::string slider = "document.querySelector('#gains input')";
  const double before = tab.evaluate(slider + ".valueAsNumber").get<double>();
  const double wanted = 2.0 * before;
  double force_n = 0.0;
  ASSERT_TRUE(follow(*ticks_, 2.0, [&](const auto& tick) { return (force_n = norm(tick.value.force_n)) > 0.0; }));
  tab.evaluate("(() => { const s = " + slider + "; s.value = " + std::to_string(wanted) +
               "; s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change')); })()");
  EXPECT_TRUE(follow(*ticks_, 4.0, [&](const auto& tick) { return norm(tick.value.force_n) > 1.05 * force_n; }))
      << answer(tab);
  EXPECT_TRUE(tab.becomes("document.getElementById('answer').textContent.includes('coupling.stiffness_n_per_m')"))
      << answer(tab);
  keep(tab, "gains");
}

#if RTBUS_WITH_HDF5
TEST_F(ViewOrders, RecordsAndMarks) {
  const auto view = server();
  Tab tab(*browser_);
  tab.open(view->url());
  expect_ready(tab);
  ASSERT_TRUE(tab.becomes("!document.getElementById('record').hidden")) << answer(tab);
  press(tab, "record");
  ASSERT_TRUE(tab.becomes("document.getElementById('record').textContent === 'end recording'")) << answer(tab);
  // The recorder needs a moment to listen for marks.
  EXPECT_TRUE(tests::eventually(5.0, [&] {
    tab.evaluate(
        "(() => { document.getElementById('mark-text').value = 'a mark of the page'; "
        "document.getElementById('mark').requestSubmit(); })()");
    return tab.becomes("document.getElementById('answer').textContent.includes('marked')", 0.5);
  })) << answer(tab);
  press(tab, "record");
  EXPECT_TRUE(tab.becomes("document.getElementById('answer').textContent.includes('topics')")) << answer(tab);
  std::string file;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    if (entry.path().extension() == ".h5") file = entry.path().string();
  }
  ASSERT_NE(file, "");
  const std::string said = folder_ + "/export.txt";
  Child({binary("rtbus"), "export", file}, said).wait();
  std::ifstream in(said);
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  EXPECT_THAT(text, HasSubstr("a mark of the page"));
  EXPECT_THAT(text, HasSubstr("complete"));
}
#endif

TEST_F(ViewOrders, ShowsContactsOfAMethodThatAsksForNone) {
  const auto view = server();
  Tab tab(*browser_);
  tab.open(view->url());
  expect_ready(tab);
  EXPECT_TRUE(
      tab.becomes("rtbusTest.page.hands.contacts.some((c) => c.normal[1] > 0.99 && Math.abs(c.point[1]) < 1e-6)"))
      << tab.evaluate("JSON.stringify(rtbusTest.page.hands.contacts)");
  tab.evaluate("rtbusTest.page.key('c')");
  keep(tab, "contacts");
}

TEST_F(ViewOrders, ReadOnlyLeavesOnlyEstop) {
  const auto view = server({"--read-only"});
  Tab tab(*browser_);
  tab.open(view->url());
  expect_ready(tab);
  ASSERT_TRUE(tab.becomes("rtbusTest.page.orders.session !== ''"));
  for (const char* const id : {"mark", "record", "rearm"}) {
    EXPECT_EQ(tab.evaluate("document.getElementById('" + std::string(id) + "').hidden"), true) << id;
  }
  tab.evaluate("rtbusTest.page.orders.order({ order: 'mark', text: 'x' })");
  EXPECT_TRUE(tab.becomes("document.getElementById('answer').textContent.includes('--read-only')")) << answer(tab);
  press(tab, "estop");
  EXPECT_TRUE(no_force(3.0)) << answer(tab);
}

TEST_F(ViewOrders, EstopWorksAlsoWhenTheSupervisorIsStopped) {
  const auto view = server();
  Tab tab(*browser_);
  tab.open(view->url());
  expect_ready(tab);
  run_->signal(SIGSTOP);
  press(tab, "estop");
  EXPECT_TRUE(tests::eventually(5.0, [&] { return !ticks_->writer_alive(); }));
  EXPECT_TRUE(tab.becomes("document.getElementById('answer').textContent.includes('ended 1 haptic node')"))
      << answer(tab);
  run_->signal(SIGCONT);
}

}  // namespace
