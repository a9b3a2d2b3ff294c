#include "rtbus/config/document.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <locale>
#include <string>
#include <vector>

#include "tests/support/temporary_file.hpp"

namespace rtbus::config {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;

/// A file with the given text, read; lives as long as the fixture.
class Document : public testing::Test {
 protected:
  Map read(const std::string& text) { return load(folder_.write("x.yaml", text)); }

  /// The message without the folder, "" when nothing is thrown.
  template <class F>
  std::string error_of(F&& action) {
    try {
      action();
    } catch (const Error& error) {
      std::string message = error.what();
      const std::string prefix = folder_.path().string() + "/";
      for (std::size_t at; (at = message.find(prefix)) != std::string::npos;) {
        message.erase(at, prefix.size());
      }
      return message;
    }
    return "";
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Document, ReadsNumbersInTheWaysYamlWritesThem) {
  Map map = read("{a: 1, b: -0.5, c: +2.5e3, d: .5, e: 5., f: 1E-3, g: -0}");
  EXPECT_EQ(map.number("a", {}), 1.0);
  EXPECT_EQ(map.number("b", {}), -0.5);
  EXPECT_EQ(map.number("c", {}), 2500.0);
  EXPECT_EQ(map.number("d", {}), 0.5);
  EXPECT_EQ(map.number("e", {}), 5.0);
  EXPECT_EQ(map.number("f", {}), 1e-3);
  EXPECT_EQ(map.number("g", {}), 0.0);
  EXPECT_NO_THROW(map.finish());
}

TEST_F(Document, RefusesWhatIsNoFiniteNumber) {
  for (const char* word : {"fast", "1,5", "0x10", "1e", "--1", "+-1", "1 2", "1_000", "infinity", "nanny", "e5"}) {
    Map map = read("rate_hz: " + std::string(word));
    EXPECT_THAT(error_of([&] { (void)map.number("rate_hz", {}); }), HasSubstr("is not a number")) << word;
  }
  for (const char* word : {".inf", "-.INF", ".nan", "nan", "inf", "-inf", "1e999", "-1e999"}) {
    Map map = read("rate_hz: " + std::string(word));
    EXPECT_THAT(error_of([&] { (void)map.number("rate_hz", {}); }), HasSubstr("is not a finite number")) << word;
  }
}

TEST_F(Document, SaysRangeUnitAndRemedy) {
  Map map = read("schema: x\nphysics:\n  rate_hz: 0\n  mass_kg: 7\n");
  Map physics = map.map("physics");
  EXPECT_EQ(error_of([&] {
              (void)physics.number("rate_hz", {1, 20000});
            }),
            "x.yaml:3: physics.rate_hz = 0 is below 1; choose 1…20000 Hz");
  EXPECT_EQ(error_of([&] {
              (void)physics.number("mass_kg", {0.001, 5}, 0.1);
            }),
            "x.yaml:4: physics.mass_kg = 7 is above 5; choose 0.001…5 kg");
  EXPECT_EQ(physics.number("rate_hz", {0, 0}), 0.0);  // both ends belong to the range
}

TEST_F(Document, TellsTheUnitFromTheLongestSuffix) {
  Map map = read("{damping_n_s_per_m: -1, slew_n_per_ms: -1, spin_us: -1, ratio: -1}");
  EXPECT_THAT(error_of([&] { (void)map.number("damping_n_s_per_m", {0, 5}); }), EndsWith("choose 0…5 N·s/m"));
  EXPECT_THAT(error_of([&] { (void)map.number("slew_n_per_ms", {0, 5}); }), EndsWith("choose 0…5 N/ms"));
  EXPECT_THAT(error_of([&] { (void)map.number("spin_us", {0}); }), EndsWith("choose at least 0 µs"));
  EXPECT_THAT(error_of([&] { (void)map.number("ratio", {0, 5}); }), EndsWith("choose 0…5"));
}

TEST_F(Document, SaysWhatBelongsWhereAKeyIsMissing) {
  Map map = read("schema: x\nphysics:\n  engine: analytic\n");
  Map physics = map.map("physics");
  EXPECT_EQ(error_of([&] {
              (void)physics.number("rate_hz", {1, 20000});
            }),
            "x.yaml:2: physics needs the key rate_hz (a number, 1…20000 Hz)");
  EXPECT_EQ(error_of([&] { (void)map.text("scene"); }), "x.yaml:1: this file needs the key scene (text)");
  EXPECT_THAT(error_of([&] { (void)map.choice("mode", {"a", "b"}); }), HasSubstr("(one of a, b)"));
  EXPECT_THAT(error_of([&] { (void)map.numbers("v", 3); }), HasSubstr("(a list of 3 numbers)"));
  EXPECT_THAT(error_of([&] { (void)map.map("m"); }), HasSubstr("(a map)"));
  EXPECT_THAT(error_of([&] { (void)map.file_or_map("f"); }), HasSubstr("(a map, or the name of a YAML file)"));
  EXPECT_THAT(error_of([&] { (void)map.existing_file("f"); }), HasSubstr("(the name of a file)"));
}

TEST_F(Document, PointsFromAMissingKeyToItsMisspelling) {
  Map map = read("rat_hz: 5");
  EXPECT_EQ(error_of([&] {
              (void)map.number("rate_hz", {1, 9});
            }),
            "x.yaml:1: this file needs the key rate_hz (a number, 1…9 Hz); unknown key rat_hz; did you mean rate_hz?");
}

TEST_F(Document, SuggestsTheNearestKeyForAnUnknownOne) {
  Map map = read("haptic:\n  - name: haptic0\n    rat_hz: 5\n");
  std::vector<Map> haptic = map.list_of_maps("haptic");
  (void)haptic.at(0).text("name");
  (void)haptic.at(0).number("rate_hz", {}, 1000.0);
  EXPECT_EQ(error_of([&] { haptic[0].finish(); }),
            "x.yaml:3: haptic.0.rat_hz is not a known key; did you mean rate_hz? (known here: name, rate_hz)");
  EXPECT_NO_THROW(map.finish());
}

TEST_F(Document, SuggestsNothingForAWordUnlikeAllOthers) {
  Map map = read("colour: red");
  (void)map.number("rate_hz", {}, 1.0);
  EXPECT_EQ(error_of([&] { map.finish(); }), "x.yaml:1: colour is not a known key (known here: rate_hz)");
}

TEST_F(Document, SuggestsTheSameWhateverOrderKeysWereAskedIn) {
  for (const bool swapped : {false, true}) {
    Map map = read("core_x: 1");
    (void)map.has(swapped ? "core_b" : "core_a");
    (void)map.has(swapped ? "core_a" : "core_b");
    EXPECT_THAT(error_of([&] { map.finish(); }), HasSubstr("did you mean core_a?"));
  }
}

TEST_F(Document, ReadsWholeNumbersExactly) {
  Map map = read("{a: 9007199254740993, b: -3, c: 2.0, d: 1.5, e: 9}");
  EXPECT_EQ(map.integer("a", 0, std::int64_t{1} << 60, 0), 9007199254740993);
  EXPECT_EQ(map.integer("b", -5, 5, 0), -3);
  EXPECT_EQ(map.integer("c", 0, 5, 0), 2);
  EXPECT_EQ(map.integer("absent", 0, 5, 4), 4);
  EXPECT_EQ(error_of([&] { (void)map.integer("d", 0, 5, 0); }), "x.yaml:1: d = 1.5 is not a whole number; choose 0…5");
  EXPECT_EQ(error_of([&] { (void)map.integer("e", 0, 5, 0); }), "x.yaml:1: e = 9 is above 5; choose 0…5");
}

TEST_F(Document, TellsQuotedTextFromNumbersAndTruthValues) {
  Map map = read("{a: '5', b: 'true', c: true, d: yes, e: 0600}");
  EXPECT_EQ(error_of([&] { (void)map.number("a", {}); }),
            "x.yaml:1: a = \"5\" is not a number but text; remove the quotes");
  EXPECT_EQ(error_of([&] { (void)map.boolean("b", true); }),
            "x.yaml:1: b = \"true\" is not a truth value; choose true or false");
  EXPECT_TRUE(map.boolean("c", false));
  EXPECT_THAT(error_of([&] { (void)map.boolean("d", true); }), HasSubstr("choose true or false"));
  EXPECT_FALSE(map.boolean("absent", false));
  EXPECT_EQ(map.text("e"), "0600");  // as it was written
  EXPECT_EQ(map.text("absent", "fallback"), "fallback");
}

TEST_F(Document, OffersTheWordsOfAChoice) {
  Map map = read("clock: timr\nschema: scene/2\nlist: [1]\n");
  EXPECT_EQ(error_of([&] {
              (void)map.choice("clock", {"timer", "device"}, "timer");
            }),
            "x.yaml:1: clock = \"timr\" is not known; did you mean timer?; choose timer, device");
  EXPECT_EQ(error_of([&] { (void)map.choice("schema", {"scene/1"}); }),
            "x.yaml:2: schema = \"scene/2\" is not supported; this build knows scene/1");
  EXPECT_EQ(error_of([&] { (void)map.choice("list", {"a", "b"}); }), "x.yaml:3: list = [1] is not a word; choose a, b");
  EXPECT_EQ(map.choice("absent", {"a", "b"}, "b"), "b");
}

TEST_F(Document, ReadsListsOfNumbersOfTheRightLength) {
  Map map = read("good: [1, 2, 3]\nshort: [1, 2]\nword: [1, up, 3]\nscalar: 1\nlow_m: [1, -2, 3]\n");
  EXPECT_THAT(map.numbers("good", 3), ElementsAre(1, 2, 3));
  EXPECT_THAT(map.numbers("absent", 2, {}, {7, 8}), ElementsAre(7, 8));
  EXPECT_EQ(error_of([&] { (void)map.numbers("short", 3); }),
            "x.yaml:2: short = [1, 2] is not a list of 3 numbers; write short: [x, y, z]");
  EXPECT_THAT(error_of([&] { (void)map.numbers("word", 3); }), HasSubstr("word.1 = \"up\" is not a number"));
  EXPECT_THAT(error_of([&] { (void)map.numbers("scalar", 3); }), HasSubstr("is not a list of 3 numbers"));
  EXPECT_THAT(error_of([&] {
                (void)map.numbers("low_m", 3, {0, 5});
              }),
              EndsWith("low_m.1 = -2 is below 0; choose 0…5 m"));
}

TEST_F(Document, GivesMapsAndListsOfMaps) {
  Map map = read("m: {a: 1}\nl:\n  - {n: 1}\n  - {n: 2}\nscalar: 3\nmixed: [{a: 1}, 2]\nempty: []\n");
  EXPECT_EQ(map.map("m").path(), "m");
  EXPECT_TRUE(map.optional_map("m").has_value());
  EXPECT_FALSE(map.optional_map("absent").has_value());
  std::vector<Map> list = map.list_of_maps("l");
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[1].path(), "l.1");
  EXPECT_EQ(list[1].number("n", {}), 2.0);
  EXPECT_TRUE(map.list_of_maps("absent").empty());
  EXPECT_TRUE(map.list_of_maps("empty").empty());
  EXPECT_THAT(error_of([&] { (void)map.map("scalar"); }), HasSubstr("scalar = 3 is not a map"));
  EXPECT_THAT(error_of([&] { (void)map.list_of_maps("m"); }), HasSubstr("m = {…} is not a list"));
  EXPECT_THAT(error_of([&] { (void)map.list_of_maps("mixed"); }), HasSubstr("mixed.1 = 2 is not a map"));
  EXPECT_THAT(error_of([&] { (void)map.number("m", {}); }), HasSubstr("m = {…} is not a number"));
  EXPECT_THAT(error_of([&] { (void)map.text("l"); }), HasSubstr("is not text"));
}

TEST_F(Document, TakesNullForAbsent) {
  Map map = read("a: null\nb: ~\nc:\n");
  EXPECT_FALSE(map.has("a"));
  EXPECT_EQ(map.number("a", {}, 3.0), 3.0);
  EXPECT_FALSE(map.optional_map("b").has_value());
  EXPECT_THAT(error_of([&] { (void)map.number("c", {}); }), HasSubstr("needs the key c"));
  EXPECT_NO_THROW(map.finish());  // asked for, hence known
}

TEST_F(Document, ComplainsAboutAnUnknownKeyEvenWhenItIsNull) {
  Map map = read("throtle_hz: null");
  (void)map.has("throttle_hz");
  EXPECT_THAT(error_of([&] { map.finish(); }), HasSubstr("did you mean throttle_hz?"));
}

TEST_F(Document, ListsItsKeysInOrderWithoutMakingThemKnown) {
  Map map = read("{b: 1, a: 2}");
  EXPECT_THAT(map.keys(), ElementsAre("b", "a"));
  EXPECT_THROW(map.finish(), Error);
}

TEST_F(Document, FailsAtAKeyWithItsLineAndValue) {
  Map map = read("schema: x\nm:\n  k: 5\n  l: {a: 1}\n");
  const Map inner = map.map("m");
  EXPECT_EQ(error_of([&] { inner.fail("k", "is odd"); }), "x.yaml:3: m.k = 5 is odd");
  EXPECT_EQ(error_of([&] { inner.fail("l", "is odd"); }), "x.yaml:4: m.l is odd");
  EXPECT_EQ(error_of([&] { inner.fail("absent", "is needed"); }), "x.yaml:2: m.absent is needed");
  EXPECT_EQ(error_of([&] { inner.fail("", "is odd"); }), "x.yaml:2: m is odd");
  EXPECT_EQ(error_of([&] { map.fail("", "is odd"); }), "x.yaml:1: is odd");
}

TEST_F(Document, FollowsFileNamesRelativeToTheFileTheyStandIn) {
  folder_.write("devices/a.yaml", "# first line\nmodel: m\nnext: ../b.yaml\n");
  folder_.write("b.yaml", "deep: 1\n");
  Map map = read("device: devices/a.yaml\ninline: {model: n}\n");
  Map device = map.file_or_map("device");
  EXPECT_THAT(device.file(), EndsWith("/devices/a.yaml"));
  EXPECT_EQ(device.path(), "device");
  EXPECT_EQ(device.text("model"), "m");
  EXPECT_EQ(device.file_or_map("next").number("deep", {}), 1.0);
  EXPECT_EQ(map.file_or_map("inline").text("model"), "n");
  EXPECT_EQ(error_of([&] { device.fail("model", "is odd"); }), "devices/a.yaml:2: device.model = \"m\" is odd");
  EXPECT_NO_THROW(device.finish());
}

TEST_F(Document, NamesTheFileThatIsNotThereAndItsNeighbour) {
  folder_.write("devices/phantom.yaml", "a: 1\n");
  Map map = read("schema: x\ndevice: devices/phantm.yaml\n");
  EXPECT_EQ(
      error_of([&] { (void)map.file_or_map("device"); }),
      "x.yaml:2: device = \"devices/phantm.yaml\" cannot be read: devices/phantm.yaml: there is no such file (looked "
      "for devices/phantm.yaml); did you mean phantom.yaml?; check the name and the current folder");
}

TEST_F(Document, GivesAnExistingFileAsAbsolutePath) {
  const std::string points = folder_.write("devices/p.csv", "0,0,0\n");
  Map map = read("file: devices/p.csv\ngone: devices/q.csv\nfolder: devices\n");
  EXPECT_EQ(map.existing_file("file"), points);
  EXPECT_THAT(error_of([&] { (void)map.existing_file("gone"); }), HasSubstr("gone = \"devices/q.csv\" names no file"));
  EXPECT_THAT(error_of([&] { (void)map.existing_file("folder"); }), HasSubstr("names no file"));
}

TEST_F(Document, RefusesWhatIsNoConfigurationFile) {
  const auto load_it = [](const std::string& file) { return [file] { (void)load(file); }; };
  EXPECT_THAT(error_of(load_it(folder_.path() / "absent.yaml")), HasSubstr("absent.yaml: there is no such file"));
  EXPECT_THAT(error_of(load_it(folder_.path())), HasSubstr("is a folder"));
  EXPECT_THAT(error_of(load_it("/dev/zero")), HasSubstr("is not a regular file"));
  EXPECT_THAT(error_of(load_it("")), HasSubstr("its name is empty"));
  EXPECT_EQ(error_of(load_it(folder_.write("big.yaml", "a: " + std::string(1 << 20, 'x')))),
            "big.yaml: is larger than 1 MiB; is this the right file?");
}

TEST_F(Document, OutlivesTheMapsItWasTakenFrom) {
  std::vector<Map> kept;
  {
    Map map = read("a: {b: {c: 5}}");
    kept.push_back(map.map("a").map("b"));
  }
  EXPECT_EQ(kept[0].number("c", {}), 5.0);
}

/// As in German or French: 1.5 is written 1,5 and thousands are grouped.
class CommaPoint : public std::numpunct<char> {
 protected:
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

TEST_F(Document, ReadsAndWritesNumbersAlikeInEveryLocale) {
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new CommaPoint));
  std::string message;
  double a = 0.0;
  try {
    Map map = read("{a: 12345.5, rate_hz: 0.5}");
    a = map.number("a", {});
    message = error_of([&] { (void)map.number("rate_hz", {1.5, 20000}); });
  } catch (const Error& error) {
    message = error.what();
  }
  std::locale::global(before);
  EXPECT_EQ(a, 12345.5);
  EXPECT_EQ(message, "x.yaml:1: rate_hz = 0.5 is below 1.5; choose 1.5…20000 Hz");
}

TEST_F(Document, EscapesWhatATerminalWouldObey) {
  Map map = read("name: \"a\\x1b[2Jb\\nc\"");
  EXPECT_EQ(error_of([&] { map.fail("name", "is odd"); }), "x.yaml:1: name = \"a\\x1b[2Jb\\x0ac\" is odd");
}

TEST_F(Document, ShortensLongValuesInMessages) {
  Map map = read("a: " + std::string(5000, 'x'));
  EXPECT_LT(error_of([&] { (void)map.number("a", {}); }).size(), 200U);
}

}  // namespace
}  // namespace rtbus::config
