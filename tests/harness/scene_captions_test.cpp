/// docs/scenes.md: what the caption of each picture says is what `rtbus still` gives.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include "rtbus/config/session.hpp"
#include "tests/support/temporary_file.hpp"
#include "tools/cli/still/still_frame.hpp"
#include "tools/harness/harness.hpp"

namespace {

const std::string kRoot = RTBUS_SOURCE_DIR;

struct Caption {
  double at_s = 0.0;
  std::string says;  ///< "0.17 N on the hand, proxy 0.6 mm from the device"
};

/// By the session's name, from lines such as "    rtbus still config/wall.yaml --at 1.2   0.19 N on the hand, …".
std::map<std::string, Caption> captions() {
  std::map<std::string, Caption> out;
  std::ifstream page(kRoot + "/docs/scenes.md");
  const std::regex caption(R"(^    rtbus still config/(\w+)\.yaml --at ([0-9.]+) +([0-9.]+ N on the hand, .*)$)");
  std::smatch part;
  for (std::string line; std::getline(page, line);) {
    if (std::regex_match(line, part, caption)) out[part[1]] = {std::stod(part[2]), part[3]};
  }
  return out;
}

/// The first block of YAML of the page.
std::string first_example() {
  std::ifstream page(kRoot + "/docs/scenes.md");
  std::string out;
  bool inside = false;
  for (std::string line; std::getline(page, line);) {
    if (inside && line == "```") break;
    if (inside) out += line + '\n';
    inside = inside || line == "```yaml";
  }
  return out;
}

/// As the picture says it (tools/cli/still/still.cpp).
std::string simulated(const std::string& session_name, double at_s) {
  auto session = rtbus::config::load_session(kRoot + "/config/" + session_name + ".yaml", {});
  const rtbus::config::Scene scene = session.scene;
  tools::Harness harness(session, {});
  std::vector<rtbus::Telemetry> last(harness.hands());
  harness.run_all(at_s, [&](std::size_t hand, const rtbus::Telemetry& tick) { last[hand] = tick; });
  const tools::StillHand hand = tools::frame_of(scene, harness, last).hands.at(0);
  char text[96];
  std::snprintf(text, sizeof text, "%.2f N on the hand, proxy %.1f mm from the device", hand.force_n.norm(),
                1e3 * (hand.proxy_m - hand.target_m).norm());
  return text;
}

class SceneCaptions : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Page, SceneCaptions,
                         testing::Values("stack_125", "stack_250", "stack_500", "mixed_sizes", "wall", "free_block",
                                         "beads_mm", "sphere", "soft"),
                         [](const auto& session) { return std::string(session.param); });

TEST_P(SceneCaptions, SayWhatTheCommandGives) {
  const std::string name = GetParam();
  const auto all = captions();
  ASSERT_TRUE(all.contains(name)) << "docs/scenes.md has no caption of " << name;
  const bool analytic = name == "wall" || name == "sphere";
  if (!analytic && !RTBUS_BULLET_OF_THE_PAGES) GTEST_SKIP() << "another Bullet or processor rounds otherwise";
  const Caption& caption = all.at(name);
  EXPECT_EQ(caption.says, simulated(name, caption.at_s))
      << "draw the picture of " << name << " anew (docs/scenes.md, Pictures), look at it, and correct the caption";
}

TEST(SceneCaptionsOfThePage, AreAllTested) { EXPECT_EQ(captions().size(), 9U); }

#if RTBUS_WITH_BULLET
TEST(SceneExampleOfThePage, IsASceneAsItStands) {
  const std::string example = first_example();
  const tests::TemporaryFolder folder;
  const std::string file = folder.write("breakfast.yaml", example);
  std::filesystem::copy(kRoot + "/config/scenes/meshes", folder.path() / "meshes");
  auto session =
      rtbus::config::load_session(kRoot + "/config/stack_125.yaml", {rtbus::config::parse_override("scene=" + file)});
  EXPECT_EQ(session.scene.name, "breakfast");
  tools::Harness harness(session, {});
  harness.run(0.1, {});
}
#endif

}  // namespace
