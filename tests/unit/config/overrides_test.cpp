#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rtbus/config/document.hpp"
#include "tests/support/temporary_file.hpp"

namespace rtbus::config {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

constexpr const char* kSession = R"(schema: session/1
physics: {rate_hz: 1000}
gravity_m_s2: [0, -9.81, 0]
haptic:
  - name: haptic0
    device: devices/a.yaml
  - name: haptic1
    device: {model: inline}
)";

class Overrides : public testing::Test {
 protected:
  Overrides() {
    folder_.write("devices/a.yaml", "model: a\nhand: {type: drop, script: s.csv}\nbodies: [{name: peg, mass_kg: 1}]\n");
    folder_.write("devices/b.yaml", "model: b\n");
  }

  Map read(const std::vector<std::string>& sets) {
    std::vector<Override> overrides;
    for (const std::string& set : sets) {
      overrides.push_back(parse_override(set));
    }
    return load(folder_.write("x.yaml", kSession), overrides);
  }

  template <class F>
  static std::string error_of(F&& action) {
    try {
      action();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  tests::TemporaryFolder folder_;
};

TEST(ParseOverride, SplitsAtTheFirstEqualsSign) {
  const Override override = parse_override("a.b=c=d");
  EXPECT_EQ(override.path, "a.b");
  EXPECT_EQ(override.value, "c=d");
}

TEST(ParseOverride, ExplainsItselfWhenItCannot) {
  for (const char* text : {"rate_hz", "=5", "a..b=5", ".a=5", "a.=5", ""}) {
    try {
      (void)parse_override(text);
      ADD_FAILURE() << text << " was accepted";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), StartsWith("--set "));
      EXPECT_THAT(error.what(), HasSubstr("write --set key.path=value"));
    }
  }
}

TEST_F(Overrides, ReplaceAValueAndAreJudgedLikeOne) {
  EXPECT_EQ(read({"physics.rate_hz=500"}).map("physics").number("rate_hz", {}), 500.0);
  Map map = read({"physics.rate_hz=0"});
  EXPECT_THAT(error_of([&] {
                (void)map.map("physics").number("rate_hz", {1, 20000});
              }),
              EndsWith("/x.yaml:--set: physics.rate_hz = 0 is below 1; choose 1…20000 Hz"));
}

TEST_F(Overrides, AreTypedAsYaml) {
  Map map = read({"gravity_m_s2=[0,1,0]", "a=null", "b='5'", "c=true", "physics={rate_hz: 7}", "d="});
  EXPECT_THAT(map.numbers("gravity_m_s2", 3), ElementsAre(0, 1, 0));
  EXPECT_FALSE(map.has("a"));
  EXPECT_EQ(map.text("b"), "5");
  EXPECT_TRUE(map.boolean("c", false));
  EXPECT_EQ(map.map("physics").number("rate_hz", {}), 7.0);
  EXPECT_FALSE(map.has("d"));
}

TEST_F(Overrides, ReachListItemsByIndexAndByName) {
  Map map = read({"haptic.0.rate_hz=2000", "haptic.haptic1.rate_hz=3000", "gravity_m_s2.1=-5"});
  std::vector<Map> haptic = map.list_of_maps("haptic");
  EXPECT_EQ(haptic.at(0).number("rate_hz", {}), 2000.0);
  EXPECT_EQ(haptic.at(1).number("rate_hz", {}), 3000.0);
  EXPECT_THAT(map.numbers("gravity_m_s2", 3), ElementsAre(0, -5, 0));
}

TEST_F(Overrides, SayWhichItemsAListHas) {
  EXPECT_EQ(error_of([&] { (void)read({"haptic.2.rate_hz=1"}); }),
            "--set haptic.2.rate_hz=1: haptic has no item 2; its items are 0 haptic0, 1 haptic1");
  EXPECT_EQ(error_of([&] { (void)read({"haptic.left.rate_hz=1"}); }),
            "--set haptic.left.rate_hz=1: haptic has no item left; its items are 0 haptic0, 1 haptic1");
}

TEST_F(Overrides, CreateAbsentKeysAndMaps) {
  Map map = read({"haptic.0.safety.max_force_n=3"});
  EXPECT_EQ(map.list_of_maps("haptic").at(0).map("safety").number("max_force_n", {}), 3.0);
}

TEST_F(Overrides, WithAMisspeltKeyAreUnknownKeys) {
  Map map = read({"physics.rat_hz=5"});
  Map physics = map.map("physics");
  (void)physics.number("rate_hz", {});
  EXPECT_THAT(error_of([&] { physics.finish(); }),
              EndsWith("x.yaml:--set: physics.rat_hz is not a known key; did you mean rate_hz? (known here: rate_hz)"));
}

TEST_F(Overrides, GoOnInAFileThatIsReferredTo) {
  Map map = read(
      {"haptic.haptic0.device.hand.type=none", "haptic.0.device.bodies.peg.mass_kg=2", "haptic.1.device.model=other"});
  std::vector<Map> haptic = map.list_of_maps("haptic");
  Map device = haptic.at(0).file_or_map("device");
  EXPECT_EQ(device.map("hand").text("type"), "none");
  EXPECT_EQ(device.list_of_maps("bodies").at(0).number("mass_kg", {}), 2.0);
  EXPECT_EQ(haptic.at(1).file_or_map("device").text("model"), "other");
}

TEST_F(Overrides, JudgeAValueInsideAReferredFileThere) {
  Map map = read({"haptic.0.device.hand.typ=none"});
  std::vector<Map> haptic = map.list_of_maps("haptic");
  Map device = haptic.at(0).file_or_map("device");
  Map hand = device.map("hand");
  (void)hand.text("type");
  (void)hand.text("script");
  EXPECT_THAT(error_of([&] { hand.finish(); }),
              EndsWith("/devices/a.yaml:--set: haptic.0.device.hand.typ is not a known key; did you mean type? (known "
                       "here: type, script)"));
}

TEST_F(Overrides, ChooseTheFileBeforeTheyChangeIt) {
  for (const bool swapped : {false, true}) {
    std::vector<std::string> sets = {"haptic.0.device=devices/b.yaml", "haptic.0.device.model=changed"};
    if (swapped) {
      std::swap(sets[0], sets[1]);
    }
    Map map = read(sets);
    Map device = map.list_of_maps("haptic").at(0).file_or_map("device");
    EXPECT_THAT(device.file(), EndsWith("/devices/b.yaml"));
    EXPECT_EQ(device.text("model"), "changed");
  }
}

TEST_F(Overrides, LetTheLastOfTwoEqualsWin) {
  EXPECT_EQ(read({"physics.rate_hz=1", "physics.rate_hz=2"}).map("physics").number("rate_hz", {}), 2.0);
}

TEST_F(Overrides, BelowAPlainValueAreAnError) {
  Map map = read({"physics.rate_hz.low=5"});
  Map physics = map.map("physics");
  EXPECT_EQ(error_of([&] { (void)physics.number("rate_hz", {}); }),
            "--set physics.rate_hz.low=5: leads nowhere: physics.rate_hz = 1000 is a number and has no keys");
  Map list = read({"gravity_m_s2.1.x=5"});
  EXPECT_THAT(error_of([&] { (void)list.numbers("gravity_m_s2", 3); }), HasSubstr("leads nowhere"));
  Map text = read({"haptic.0.device.hand.script.x=5"});
  std::vector<Map> haptic = text.list_of_maps("haptic");
  Map hand = haptic.at(0).file_or_map("device").map("hand");
  EXPECT_THAT(error_of([&] { (void)hand.text("script"); }),
              HasSubstr("haptic.0.device.hand.script = \"s.csv\" is text"));
}

TEST_F(Overrides, WithBrokenYamlAreAnErrorThatNamesThem) {
  EXPECT_THAT(error_of([&] { (void)read({"gravity_m_s2=[0,1"}); }), StartsWith("--set gravity_m_s2=[0,1: "));
  EXPECT_THAT(error_of([&] { (void)read({"a=\x01"}); }), StartsWith("--set a=\\x01: "));
}

TEST_F(Overrides, CannotBuildATreeOfAnyDepth) {
  std::string path = "a";
  for (int i = 0; i < 50'000; ++i) {
    path += ".a";
  }
  EXPECT_THAT(error_of([&] { (void)read({path + "=1"}); }), HasSubstr("deeper than 32 levels"));
}

}  // namespace
}  // namespace rtbus::config
