// Every shape that a scene may have, and several hands, by their pixels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>

#include "tests/view/view_fixture.hpp"

namespace {

using nlohmann::json;
using testing::HasSubstr;
using tests::Tab;
using tests::View;
using tests::ViewServer;

/// The name of what is drawn where the page projects `p`, an expression in W.
json picked(Tab& tab, const std::string& p) {
  return tab.evaluate("(() => { const t = rtbusTest, c = t.page.camera, at = c.project(" + p +
                      "); return t.page.renderer.pick(c, at[0], at[1], performance.now()); })()");
}

/// A viewer of the scripted session on a scene of its own.
TEST_F(View, FiveThousandBodiesTakeAtMostFourDrawCalls) {
  const std::string file = std::string(testing::TempDir()) + bus_.name + ".yaml";
  std::ofstream(file) << "schema: session/1\nsession: many\nscene:\n  schema: scene/1\n  bodies:\n"
                         "  - {name: floor, type: static, shape: {plane: {}}}\n"
                         "  - name: cube\n    type: static\n    shape: {box: {size_m: [0.02, 0.02, 0.02]}}\n"
                         "    position_m: [-0.26, 0.01, -0.26]\n"
                         "    grid: {count: [25, 8, 25], spacing_m: [0.021, 0.021, 0.021]}\n"
                         "physics: {engine: bullet, rate_hz: 500}\nhaptic:\n- {name: haptic0, device: "
                      << RTBUS_SOURCE_DIR
                      << "/config/devices/sim_phantom_desktop_drop.yaml, rate_hz: 1000,\n"
                         "   coupling: {stiffness_n_per_m: 200, damping_n_s_per_m: 0.02}, proxy: {mass_kg: 0.1}}\n";
  scripted_ = std::make_unique<tests::ScriptedSession>(bus_.name);
  const ViewServer server(bus_.name, {"--config", file});
  Tab tab(*browser_);
  tab.open(server.url());
  expect_ready(tab);
  EXPECT_EQ(tab.evaluate("rtbusTest.page.scene.bodies.length"), 5001);
  EXPECT_LE(tab.evaluate("rtbusTest.drawCalls()").get<int>(), 4);
  // The rate with a software renderer is told, not judged.
  const int before = tab.evaluate("rtbusTest.pictures()").get<int>();
  (void)tab.becomes("false", 4.0);
  std::printf("5001 bodies: %.1f pictures/s at 960 x 540\n",
              (tab.evaluate("rtbusTest.pictures()").get<int>() - before) / 4.0);
  keep(tab, "many");
  std::filesystem::remove(file);
}

#if RTBUS_WITH_BULLET
TEST_F(View, DrawsEveryShapeWhereItIs) {
  session_file_ = "mixed_sizes.yaml";
  start_physics();
  const ViewServer server(bus_.name);
  Tab tab(*browser_);
  tab.open(server.url());
  expect_ready(tab);
  EXPECT_LE(tab.evaluate("rtbusTest.drawCalls()").get<int>(), 7);  // seven kinds
  // From above, where none of them hides another as long as no hand pushes them about.
  tab.evaluate("(() => { const c = rtbusTest.page.camera; c.elevation = 1.5; c.azimuth = 0; })()");
  for (const std::string name : {"slab", "die", "tin", "pill", "ball"}) {
    EXPECT_EQ(picked(tab, "rtbusTest.bodyAt('" + name + "')"), name);
  }
  // Origins of hull and mesh are those of their files: the middle of their vertices.
  for (const std::string name : {"gem", "hill"}) {
    const std::string middle =
        "(() => { const s = rtbusTest.page.scene, i = s.bodies.findIndex((b) => b.name === '" + name +
        "'), m = rtbusTest.page.renderer.bodies.meshes[s.shapes[s.bodies[i].shape].mesh].vertices3, sum = [0, 0, 0]; "
        "m.forEach((x, k) => { sum[k % 3] += x / (m.length / 3); }); const p = rtbusTest.bodyAt('" +
        name + "'); return p.map((x, k) => x + sum[k]); })()";
    EXPECT_EQ(picked(tab, middle), name);
  }
  EXPECT_EQ(picked(tab, "[-0.12, 0, 0.1]"), "floor");
  // The smallest lies on top of the slab. Pushed over it, it is drawn where it comes to.
  const std::string die = "rtbusTest.bodyAt('die')";
  const auto die_z_m = [&] { return tab.evaluate(die + "[2]").get<double>(); };
  const double at_rest_m = die_z_m();
  start_haptic();
  EXPECT_TRUE(tests::eventually(30.0, [&] { return die_z_m() < at_rest_m - 5e-3 && picked(tab, die) == "die"; }))
      << die_z_m() << ' ' << picked(tab, die);
  keep(tab, "shapes");
}

TEST_F(View, DrawsSoftBodiesByTheirNodes) {
  start_nodes("soft.yaml");
  const ViewServer server(bus_.name);
  Tab tab(*browser_);
  tab.open(server.url());
  expect_ready(tab);
  ASSERT_TRUE(tab.becomes("rtbusTest.page.renderer.bodies.soft.length === 5"));
  tab.evaluate("(() => { const c = rtbusTest.page.camera; c.elevation = 1.5; c.azimuth = 0; })()");  // from above
  for (int i = 0; i < 5; ++i) {
    const std::string body = "rtbusTest.page.scene.soft[" + std::to_string(i) + "]";
    const std::string middle =
        "(() => { const b = " + body +
        ", n = rtbusTest.page.lastNodes.subarray(3 * b.first, 3 * (b.first + b.nodes)), sum = [0, "
        "0, 0]; n.forEach((x, k) => { sum[k % 3] += 1e-6 * x / b.nodes; }); return sum; })()";
    ASSERT_TRUE(tab.becomes("rtbusTest.page.lastNodes"));
    EXPECT_EQ(picked(tab, middle), tab.evaluate(body + ".name")) << i;
  }
  keep(tab, "soft");
}

TEST_F(View, ShowsTwoHandsInTheirColours) {
  session_file_ = "two_hands.yaml";
  start_physics();
  haptic_.emplace(command("haptic_node", {"--name", "left"}), "/dev/null");
  tests::Child right(command("haptic_node", {"--name", "right"}), "/dev/null");
  const ViewServer server(bus_.name);
  Tab tab(*browser_);
  tab.open(server.url());
  expect_ready(tab);
  ASSERT_TRUE(
      tab.becomes("rtbusTest.page.hands.now.length === 2 && rtbusTest.page.hands.now.every((h) => h.radius > 0)"));
  // From above the block hides neither. Somewhere around their middles the balls are not behind the arrows: blue the
  // one, green the other.
  tab.evaluate("(() => { const c = rtbusTest.page.camera; c.elevation = 1.5; c.azimuth = 0; })()");
  for (const int hand : {0, 1}) {
    const json seen = colours(tab,
                              "[-6, -3, 0, 3, 6].flatMap((x) => [-6, -3, 0, 3, 6].map((y) => { const p = "
                              "rtbusTest.proxyOnScreen(" +
                                  std::to_string(hand) + "); return [p[0] + x, p[1] + y]; }))");
    const std::size_t main = hand == 0 ? 2 : 1;
    EXPECT_TRUE(std::any_of(seen["colours"].begin(), seen["colours"].end(), [main](const json& rgb) {
      return rgb[main].get<int>() > rgb[0].get<int>() + 40;
    })) << seen;
  }
  EXPECT_EQ(tab.evaluate("document.getElementById('hand').options.length"), 2);
  keep(tab, "two_hands");
  right.end(SIGTERM);
}

TEST_F(View, SaysThatAMeshIsMissing) {
  const std::string folder = std::string(testing::TempDir()) + bus_.name;
  std::filesystem::copy(std::string(RTBUS_SOURCE_DIR) + "/config", folder, std::filesystem::copy_options::recursive);
  session_file_ = "../../../../../../../../../.." + folder + "/mixed_sizes.yaml";
  start_physics();
  start_haptic();
  ASSERT_TRUE(reader<rtbus::Telemetry>("haptic0.telemetry"));
  std::filesystem::remove(folder + "/scenes/meshes/wedge.obj");
  const ViewServer server(bus_.name);
  Tab tab(*browser_, 320, 240);
  tab.open(server.url());
  EXPECT_TRUE(tab.becomes("window.rtbusTest && rtbusTest.reason().includes('wedge.obj')"))
      << tab.evaluate("document.body.innerText");
  std::filesystem::remove_all(folder);
}
#endif

}  // namespace
