// Whatever stands in a file, reading it ends with a configuration or an Error: no crash, no hang, no other exception.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <string_view>

#include "rtbus/config/session.hpp"
#include "tests/support/temporary_file.hpp"

namespace rtbus::config {
namespace {

std::string whole_file(const std::string& name) {
  std::ifstream stream(std::string(RTBUS_SOURCE_DIR) + "/" + name, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Changes a few bytes, or moves, doubles or drops a piece. Prefers the characters that mean something in YAML.
void mutate(std::string& text, std::mt19937& random) {
  constexpr std::string_view kTelling = "{}[]:,-#&*!|>'\"%@`?~ \n\t\\.=<0179eE+\x01\x7f\xc3\xff";
  const std::size_t changes = 1 + random() % 6;
  for (std::size_t i = 0; i < changes && !text.empty(); ++i) {
    const std::size_t at = random() % text.size();
    const std::size_t length = 1 + random() % 30;
    const char c = random() % 4 == 0 ? static_cast<char>(random() % 256) : kTelling[random() % kTelling.size()];
    switch (random() % 5) {
      case 0:
        text[at] = c;
        break;
      case 1:
        text.insert(at, 1, c);
        break;
      case 2:
        text.erase(at, length);
        break;
      case 3:
        text.insert(random() % text.size(), text.substr(at, length));
        break;
      default:
        text.insert(at, length, c);
    }
  }
}

/// Counts how reading ends; anything but the two ways it may end fails the test by itself.
struct Outcomes {
  int accepted = 0;
  int refused = 0;
};

template <class Read>
Outcomes fuzz(const std::string& valid, int runs, unsigned seed, const Read& read) {
  std::mt19937 random(seed);
  Outcomes out;
  for (int i = 0; i < runs; ++i) {
    std::string text = valid;
    mutate(text, random);
    try {
      read(text);
      ++out.accepted;
    } catch (const Error& error) {
      EXPECT_STRNE(error.what(), "");
      ++out.refused;
    }
  }
  return out;
}

TEST(Fuzz, SessionFilesAreReadOrRefused) {
  const tests::TemporaryFolder folder;
  folder.write("scenes/wall.yaml", whole_file("config/scenes/wall.yaml"));
  const Outcomes out = fuzz(whole_file("config/wall.yaml"), 3000, 1,
                            [&folder](const std::string& text) { (void)load_session(folder.write("x.yaml", text)); });
  // Most of a session is comments and the nodes' own keys, so that both ways are common.
  EXPECT_GT(out.accepted, 100);
  EXPECT_GT(out.refused, 100);
}

TEST(Fuzz, SceneFilesAreReadOrRefused) {
  const tests::TemporaryFolder folder;
  const Outcomes out = fuzz(whole_file("config/scenes/box.yaml"), 3000, 2, [&folder](const std::string& text) {
    Map map = load(folder.write("x.yaml", text));
    (void)read_scene(map);
  });
  EXPECT_GT(out.accepted, 100);
  EXPECT_GT(out.refused, 100);
}

TEST(Fuzz, OverridesAreAppliedOrRefused) {
  const tests::TemporaryFolder folder;
  const std::string file = folder.write(
      "x.yaml",
      "schema: session/1\nscene: {schema: scene/1, bodies: [{name: a, type: static, shape: {plane: {}}}]}\n"
      "haptic: [{name: haptic0}]\n");
  const Outcomes out = fuzz("scene.bodies.a.position_m=[0, 1.5, 0]", 3000, 3,
                            [&file](const std::string& text) { (void)load_session(file, {parse_override(text)}); });
  EXPECT_GT(out.accepted, 10);
  EXPECT_GT(out.refused, 100);
}

}  // namespace
}  // namespace rtbus::config
