/// `rtbus run --record`, recordings by order, `rtbus record --wait`, and what `rtbus compare` makes of them.
#include <nlohmann/json.hpp>

#include "rtbus/clock.hpp"
#include "tests/recording/recorded_session.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace {

using nlohmann::json;
using rtbus::recording::Recording;
using testing::HasSubstr;
using testing::Not;
using tests::Child;
using tests::eventually;
using tests::Telemetry;
using tests::values;

class RunRecord : public tests::RecordedSession {
 protected:
  std::vector<std::string> run_words(const std::string& session_file, std::vector<std::string> more) const {
    std::vector<std::string> words{"run", std::string(RTBUS_SOURCE_DIR) + "/config/" + session_file, "--set",
                                   "session=" + bus_.name};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
};

TEST_F(RunRecord, HasEveryTickFromTheFirstAndComparesWithItsReplay) {
  ASSERT_EQ(tool(run_words("wall.yaml", {"--duration", "3", "--record", file("a.h5")}), "a.txt"), 0)
      << text_of("a.txt");
  {
    const auto recording = Recording::open(file("a.h5"));
    ASSERT_TRUE(recording) << recording.error().message;
    EXPECT_TRUE(recording->complete());
    for (const char* const topic : {"haptic0.telemetry", "haptic0.device_state", "physics.proxy_state.haptic0"}) {
      ASSERT_NE(recording->find(topic), nullptr) << topic;
      const auto sequences = recording->sequences(*recording->find(topic));
      const auto stamps_ns = recording->stamps_ns(*recording->find(topic));
      ASSERT_FALSE(sequences.empty()) << topic;
      EXPECT_EQ(sequences.front(), 1u) << topic;
      EXPECT_EQ(sequences.back(), sequences.size()) << topic << ": none is missing";
      EXPECT_GT(rtbus::seconds_between(stamps_ns.front(), stamps_ns.back()), 2.5) << topic;
      EXPECT_EQ(recording->find(topic)->dropped, 0u) << topic;
    }
    EXPECT_EQ(values<Telemetry>(*recording, "haptic0.telemetry").front().tick, 1u);
    EXPECT_EQ(recording->find("physics.body_poses"), nullptr);
    ASSERT_FALSE(recording->body_names().empty());
    EXPECT_FALSE(recording->config().empty());
  }
  EXPECT_THAT(text_of("a.txt"), Not(HasSubstr("cannot be replayed")));
  // A second run does not write over it.
  EXPECT_EQ(tool(run_words("wall.yaml", {"--duration", "1", "--record", file("a.h5")}), "again.txt"), 1);
  EXPECT_THAT(text_of("again.txt"), HasSubstr("exists already"));

  ASSERT_EQ(tool(run_words("wall.yaml",
                           {"--duration", "3", "--record", file("b.h5"), "--set", "haptic.0.device=devices/replay.yaml",
                            "--set", "haptic.0.device.file=" + file("a.h5")}),
                 "b.txt"),
            0)
      << text_of("b.txt");
  ASSERT_EQ(tool({"compare", file("a.h5"), file("b.h5"), "--json"}, "compare.json"), 0) << text_of("compare.json");
  const json compared = json::parse(text_of("compare.json"));
  EXPECT_EQ(compared["schema"], "rtbus-compare/1");
  bool seen = false;
  for (const json& signal : compared["signals"]) {
    if (signal["signal"] != "haptic0.telemetry position_m") continue;
    seen = true;
    EXPECT_GT(signal["samples"], 2000);
    // The same motion, a few ticks apart; the hand fell at up to 0.2 m/s.
    EXPECT_LT(signal["rms"], 2e-3);
    EXPECT_GT(signal["reference_rms"], 5e-3);
  }
  EXPECT_TRUE(seen);
  ASSERT_EQ(tool({"compare", file("a.h5"), file("a.h5")}, "same.txt"), 0);
  EXPECT_THAT(text_of("same.txt"), HasSubstr("haptic0.telemetry force_n"));
  EXPECT_EQ(tool({"compare", file("a.h5"), file("b.h5"), "--shift", "100"}, "far.txt"), 1);
  EXPECT_THAT(text_of("far.txt"), HasSubstr("no time in common"));
  EXPECT_EQ(tool({"compare", file("a.h5"), file("b.h5"), "--signals", "force_"}, "wrong.txt"), 2);
  EXPECT_THAT(text_of("wrong.txt"), HasSubstr("force_n"));
  if (std::system("gnuplot --version > /dev/null 2>&1") == 0) {
    ASSERT_EQ(tool({"plot", file("a.h5"), file("b.h5"), "--signals", "force_n[1]", "-o", file("ab.svg")}), 0)
        << text_of("tool.txt");
    EXPECT_THAT(text_of("ab.svg"), HasSubstr("a: "));
    EXPECT_THAT(text_of("ab.svg"), HasSubstr("b: "));
  }
}

TEST_F(RunRecord, StartsAndEndsByOrder) {
  Child session(
      [&] {
        auto words = run_words("wall.yaml", {});
        words.insert(words.begin(), binary("rtbus"));
        return words;
      }(),
      file("run.txt"));
  ASSERT_TRUE(reader<Telemetry>("haptic0.telemetry"));
  const auto order = [&](const json& text) {
    auto answer = tools::send_order(bus_.name, text, 5.0);
    return answer ? *answer : json{{"ok", false}, {"error", answer.error()}};
  };
  ASSERT_TRUE(eventually(10.0, [&] { return order({{"order", "state"}})["ok"] == true; }));
  EXPECT_EQ(order({{"order", "end_recording"}})["ok"], false);
  const json began = order({{"order", "record"}, {"file", file("o.h5")}});
  ASSERT_EQ(began["ok"], true) << began;
  EXPECT_EQ(began["recording"], file("o.h5"));
  EXPECT_EQ(order({{"order", "record"}, {"file", file("p.h5")}})["ok"], false) << "one at a time";
  ASSERT_TRUE(eventually(10.0, [&] { return order({{"order", "mark"}, {"text", "here"}})["ok"] == true; }));
  EXPECT_EQ(order({{"order", "end_recording"}})["ok"], true);
  ASSERT_TRUE(eventually(10.0, [&] { return order({{"order", "state"}})["recording"] == ""; }));
  const auto recording = Recording::open(file("o.h5"));
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_TRUE(recording->complete());
  ASSERT_FALSE(recording->marks().empty());
  EXPECT_EQ(recording->marks().front().text, "here");
  const int status = session.end(SIGINT);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << text_of("run.txt");
  EXPECT_THAT(text_of("run.txt"), HasSubstr("recording: " + file("o.h5")));
}

TEST_F(RunRecord, GoesOnWithoutItsRecorderAndFailsAtItsEnd) {
  Child session(
      [&] {
        auto words = run_words("wall.yaml", {"--duration", "3", "--record", file("k.h5")});
        words.insert(words.begin(), binary("rtbus"));
        return words;
      }(),
      file("run.txt"));
  auto ticking = reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(ticking);
  ASSERT_EQ(ticks(*ticking, 500).size(), 500u);
  ASSERT_EQ(std::system(("pkill -KILL -f 'rtbus [r]ecord " + file("k.h5") + "'").c_str()), 0);
  EXPECT_EQ(ticks(*ticking, 1000).size(), 1000u);
  const int status = session.wait();
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1);
  EXPECT_THAT(text_of("run.txt"), HasSubstr("the recorder of " + file("k.h5") + " was killed"));
}

TEST_F(RunRecord, WaitsForASession) {
  recorder_.emplace(
      std::vector<std::string>{binary("rtbus"), "record", file("w.h5"), "-s", bus_.name, "--wait", "--with", "bodies"},
      file("record.txt"));
  ASSERT_TRUE(
      eventually(10.0, [&] { return said().find("waiting for the session " + bus_.name) != std::string::npos; }));
  session_file_ = "free_block.yaml";
  start_physics();
  start_haptic();
  auto ticking = reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(ticking);
  ASSERT_EQ(ticks(*ticking, 1000).size(), 1000u);
  ASSERT_EQ(end_recorder(), 0) << said();
  const auto recording = Recording::open(file("w.h5"));
  ASSERT_TRUE(recording) << recording.error().message;
  ASSERT_NE(recording->find("haptic0.device_state"), nullptr);
  EXPECT_EQ(recording->sequences(*recording->find("haptic0.device_state"), 0, 1).front(), 1u);
  ASSERT_NE(recording->find("physics.body_poses"), nullptr);
  ASSERT_EQ(tool({"export", file("w.h5"), "--csv", "-t", "body_poses", "-o", file("csv")}), 0) << text_of("tool.txt");
  const std::string csv = text_of("csv/physics.body_poses.csv");
  EXPECT_THAT(csv, HasSubstr(recording->body_names().back() + ".x [m]"));
  EXPECT_GT(std::count(csv.begin(), csv.end(), '\n'), 10);
}

TEST_F(RunRecord, SaysWhatCannotBeReplayed) {
  start_physics();
  start_haptic();
  ASSERT_TRUE(reader<Telemetry>("haptic0.telemetry"));
  ASSERT_NO_FATAL_FAILURE(start_recorder(file("n.h5"), {"--topics", "physics"}));
  EXPECT_TRUE(eventually(15.0, [&] { return said().find("cannot be replayed") != std::string::npos; })) << said();
  EXPECT_EQ(end_recorder(), 0);
}

}  // namespace
