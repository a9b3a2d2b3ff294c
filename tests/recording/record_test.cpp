/// `rtbus record` beside a live session: what it writes is what was there, whatever happens to it and to the nodes.
#include <sys/mount.h>
#include <sys/stat.h>

#include <filesystem>
#include <vector>

#include "tests/recording/recorded_session.hpp"

namespace {

using rtbus::recording::Recording;
using tests::Child;
using tests::eventually;
using tests::Reader;
using tests::ReadStatus;
using tests::Stamped;
using tests::Telemetry;
using tests::values;
using RecordTest = tests::RecordedSession;

TEST_F(RecordTest, KeepsWhatAnotherReaderSawSampleBySample) {
  start_physics();
  start_haptic();
  auto reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader);
  ASSERT_NO_FATAL_FAILURE(start_recorder(file()));
  (void)ticks(*reader, 2500);  // what came until the recorder was there, and a little more
  const auto seen = ticks(*reader, 2000);
  EXPECT_EQ(tool({"mark", "hand off, \"quoted\"", "-s", bus_.name}), 0) << text_of("tool.txt");
  ASSERT_EQ(end_recorder(), 0) << said();
  EXPECT_NE(said().find(" 0 dropped"), std::string::npos) << said();

  const auto recording = Recording::open(file());
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_TRUE(recording->complete());
  const auto* const topic = recording->find("haptic0.telemetry");
  ASSERT_NE(topic, nullptr);
  const auto sequences = recording->sequences(*topic);
  const auto stamps = recording->stamps_ns(*topic);
  const auto rows = values<Telemetry>(*recording, "haptic0.telemetry");
  ASSERT_EQ(rows.size(), sequences.size());
  ASSERT_EQ(seen.size(), 2000u);
  std::size_t row = 0;
  for (const Stamped<Telemetry>& sample : seen) {
    while (row < rows.size() && sequences[row] < sample.sequence) ++row;
    ASSERT_LT(row, rows.size());
    ASSERT_EQ(sequences[row], sample.sequence);
    ASSERT_EQ(stamps[row], sample.stamp_ns);
    ASSERT_EQ(std::memcmp(&rows[row], &sample.value, sizeof(Telemetry)), 0) << "sample " << sample.sequence;
  }
  // The rest of the session is there too, and so is what it was started with.
  for (const char* other : {"haptic0.device_state", "physics.proxy_state.haptic0"}) {
    ASSERT_NE(recording->find(other), nullptr) << other;
    EXPECT_GT(recording->find(other)->rows, 1000u) << other;
  }
  EXPECT_EQ(recording->find("physics.body_poses"), nullptr);
  bool has_session_file = false;
  for (const auto& config : recording->config()) has_session_file |= config.path.ends_with("config/wall.yaml");
  EXPECT_TRUE(has_session_file);
  ASSERT_GE(recording->marks().size(), 2u);
  EXPECT_EQ(recording->marks().back().text, "hand off, \"quoted\"");
}

// A disk that others write to may hold it for longer. The shortest ring, of the steps of physics, holds a second.
TEST_F(RecordTest, LosesNothingWhileItIsHeldForHalfASecond) {
  start_physics();
  start_haptic();
  auto reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader);
  ASSERT_NO_FATAL_FAILURE(start_recorder(file()));
  (void)ticks(*reader, 500);
  recorder_->signal(SIGSTOP);
  (void)ticks(*reader, 500);
  recorder_->signal(SIGCONT);
  (void)ticks(*reader, 500);
  ASSERT_EQ(end_recorder(), 0) << said();
  EXPECT_NE(said().find(" 0 dropped"), std::string::npos) << said();
}

TEST_F(RecordTest, KilledIsInvisibleToTheNodesAndLeavesWhatWasFlushed) {
  start_physics();
  start_haptic();
  auto reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader);
  ASSERT_NO_FATAL_FAILURE(start_recorder(file()));
  (void)ticks(*reader, 1);
  const auto before = ticks(*reader, 3500);  // the recorder flushes every second
  (void)recorder_->end(SIGKILL);
  recorder_.reset();
  const auto after = ticks(*reader, 1500);
  ASSERT_EQ(after.size(), 1500u);
  // Not one tick is missing, and physics goes on answering.
  EXPECT_EQ(after.front().value.tick, before.back().value.tick + 1);
  for (std::size_t i = 1; i < after.size(); ++i) ASSERT_EQ(after[i].value.tick, after[i - 1].value.tick + 1);
  EXPECT_GT(after.back().value.proxy_sequence, before.back().value.proxy_sequence);

  const auto recording = Recording::open(file());
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_FALSE(recording->complete());
  const auto rows = values<Telemetry>(*recording, "haptic0.telemetry");
  ASSERT_GT(rows.size(), 1500u);
  for (std::size_t i = 1; i < rows.size(); ++i) ASSERT_EQ(rows[i].tick, rows[i - 1].tick + 1);
}

TEST_F(RecordTest, FollowsNodesThatAreRestarted) {
  start_physics();
  start_haptic();
  auto reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader);
  ASSERT_NO_FATAL_FAILURE(start_recorder(file()));
  std::vector<std::uint64_t> seen;  // the last tick of each life that another reader saw
  const auto live = [&] {
    const auto life = ticks(*reader, 1000);
    ASSERT_EQ(life.size(), 1000u);
    seen.push_back(life.back().value.tick);
  };
  ASSERT_NO_FATAL_FAILURE(live());
  for (const int how : {SIGTERM, SIGKILL}) {
    (void)haptic_->end(how);  // in order: its topics go; killed: they are taken over
    reader.reset();
    start_haptic();
    reader = this->reader<Telemetry>("haptic0.telemetry");
    ASSERT_TRUE(reader);
    ASSERT_NO_FATAL_FAILURE(live());
  }
  ASSERT_EQ(end_recorder(), 0) << said();
  const auto recording = Recording::open(file());
  ASSERT_TRUE(recording) << recording.error().message;
  const auto* const topic = recording->find("haptic0.telemetry");
  ASSERT_NE(topic, nullptr);
  EXPECT_EQ(recording->find("haptic0.telemetry~2"), nullptr);
  EXPECT_EQ(topic->dropped, 0u);
  const auto rows = values<Telemetry>(*recording, "haptic0.telemetry");
  const auto stamps = recording->stamps_ns(*topic);
  ASSERT_EQ(rows.size(), stamps.size());
  std::size_t lives = 1;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    ASSERT_GT(stamps[i], stamps[i - 1]) << i;
    if (rows[i].tick == rows[i - 1].tick + 1) continue;
    ASSERT_LT(lives, seen.size()) << "a tick is missing at row " << i;
    EXPECT_GE(rows[i - 1].tick, seen[lives - 1]) << i;
    ++lives;  // counts from one again
    EXPECT_LT(rows[i].tick, 1000u) << i;
  }
  EXPECT_EQ(lives, 3u);
  EXPECT_GE(rows.back().tick, seen.back());
}

TEST_F(RecordTest, LosesAndDoublesNothingWhenATopicIsDeletedUnderItsWriter) {
  start_physics();
  start_haptic();
  auto reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader);
  ASSERT_NO_FATAL_FAILURE(start_recorder(file()));
  const auto until_there = ticks(*reader, 2500);  // what came until the recorder was there, and a little more
  ASSERT_FALSE(until_there.empty());
  Stamped<Telemetry> newest = until_there.back();
  (void)reader->read_latest(newest);  // this reader may be behind
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(ticks(*reader, 700).size(), 700u);
    std::filesystem::remove("/dev/shm/rtbus." + bus_.name + ".haptic0.telemetry");
    ASSERT_TRUE(eventually(5.0, [&] {
      auto anew = Reader<Telemetry>::open(bus_, "haptic0.telemetry", {.presence = true});
      if (anew) reader.emplace(std::move(*anew));
      return anew.has_value();
    }));
  }
  const auto seen = ticks(*reader, 700);
  ASSERT_EQ(seen.size(), 700u);
  ASSERT_EQ(end_recorder(), 0) << said();
  const auto recording = Recording::open(file());
  ASSERT_TRUE(recording) << recording.error().message;
  ASSERT_NE(recording->find("haptic0.telemetry"), nullptr);
  EXPECT_EQ(recording->find("haptic0.telemetry")->dropped, 0u);
  const auto rows = values<Telemetry>(*recording, "haptic0.telemetry");
  ASSERT_FALSE(rows.empty());
  EXPECT_LE(rows.front().tick, newest.value.tick);
  EXPECT_GE(rows.back().tick, seen.back().value.tick);
  for (std::size_t i = 1; i < rows.size(); ++i) ASSERT_EQ(rows[i].tick, rows[i - 1].tick + 1) << "row " << i;
}

/// A small file system in memory; mounting one needs root.
class SmallDisk {
 public:
  explicit SmallDisk(const std::string& folder, const std::string& size) : folder_(folder) {
    ::mkdir(folder.c_str(), 0700);
    mounted_ = ::mount("rtbus-test", folder.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  ~SmallDisk() {
    if (mounted_) (void)::umount2(folder_.c_str(), MNT_DETACH);
  }
  [[nodiscard]] bool mounted() const { return mounted_; }

 private:
  std::string folder_;
  bool mounted_ = false;
};

TEST_F(RecordTest, EndsWithAClearMessageBeforeTheDiskIsFull) {
  const SmallDisk disk(file("disk"), "13m");
  if (!disk.mounted()) GTEST_SKIP() << "cannot mount a small disk; needs root";
  start_physics();
  start_haptic();
  auto reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader);
  const std::string path = file("disk/r.h5");
  ASSERT_NO_FATAL_FAILURE(start_recorder(path, {"--reserve", "4"}));
  int status = 0;
  ASSERT_TRUE(eventually(60.0, [&] { return recorder_->has_ended(status); })) << said();
  recorder_.reset();
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_NE(said().find("the disk of " + path + " is nearly full"), std::string::npos) << said();
  const auto recording = Recording::open(path);
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_TRUE(recording->complete());
  const auto rows = values<Telemetry>(*recording, "haptic0.telemetry");
  ASSERT_GT(rows.size(), 500u);
  for (std::size_t i = 1; i < rows.size(); ++i) ASSERT_EQ(rows[i].tick, rows[i - 1].tick + 1);
  EXPECT_EQ(ticks(*reader, 100).size(), 100u);  // the session goes on
}

TEST_F(RecordTest, KeepsTheFileReadableWhenTheDiskIsFullWithoutAWord) {
  const SmallDisk disk(file("disk"), "9m");
  if (!disk.mounted()) GTEST_SKIP() << "cannot mount a small disk; needs root";
  start_physics();
  start_haptic();
  auto reader = this->reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(reader);
  const std::string path = file("disk/r.h5");
  ASSERT_NO_FATAL_FAILURE(start_recorder(path, {"--reserve", "0"}));
  int status = 0;
  ASSERT_TRUE(eventually(60.0, [&] { return recorder_->has_ended(status); })) << said();
  recorder_.reset();
  ASSERT_TRUE(WIFEXITED(status)) << "killed by signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_NE(said().find("cannot write to " + path), std::string::npos) << said();
  const auto recording = Recording::open(path);
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_FALSE(recording->complete());
  const auto rows = values<Telemetry>(*recording, "haptic0.telemetry");
  for (std::size_t i = 1; i < rows.size(); ++i) ASSERT_EQ(rows[i].tick, rows[i - 1].tick + 1);
  EXPECT_EQ(ticks(*reader, 100).size(), 100u);
}

}  // namespace
