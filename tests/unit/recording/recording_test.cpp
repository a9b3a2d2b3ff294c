// A recording gives back, bit for bit, what was put in; survives its writer; and says so when it was cut off.
#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/recording/reader.hpp"
#include "rtbus/recording/writer.hpp"
#include "tests/support/recording.hpp"
#include "tools/cli/orders/marks.hpp"

namespace {

namespace rec = rtbus::recording;
using tests::bytes_of;
using tests::description_of;

class Recordings : public ::testing::Test {
 protected:
  Recordings() {
    char name[] = "/tmp/rtbus_recording_XXXXXX";
    folder_ = ::mkdtemp(name);
  }
  ~Recordings() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::string path(const char* name = "r.h5") const { return folder_ / name; }
  std::filesystem::path folder_;
};

/// Every field of it differs from sample to sample.
rtbus::Telemetry tick(std::uint64_t i) {
  std::mt19937_64 random(i);
  rtbus::Telemetry out;
  std::vector<std::byte> bytes(sizeof out);
  for (auto& byte : bytes) byte = static_cast<std::byte>(random());
  std::memcpy(&out, bytes.data(), sizeof out);
  out.tick = i;
  return out;
}

rec::Metadata metadata() {
  rec::Metadata about;
  about.session = "lab1";
  about.version = "1.2.3";
  about.machine = "Linux";
  about.commands = {"haptic_node --config wall.yaml"};
  about.config = {{"wall.yaml", "schema: session/1\n"}, {"empty.yaml", ""}};
  return about;
}

TEST_F(Recordings, give_back_every_bit) {
  {
    auto writer = rec::Writer::create(path(), metadata());
    ASSERT_TRUE(writer) << writer.error().message;
    const auto topic = writer->add_topic("haptic0.telemetry", description_of<rtbus::Telemetry>());
    ASSERT_TRUE(topic) << topic.error().message;
    for (std::uint64_t i = 1; i <= 2500; ++i) {
      const auto sample = tick(i);
      writer->append(*topic, i, 1000 * i, bytes_of(sample));
      if (i % 700 == 0) {
        ASSERT_TRUE(writer->flush());
      }
    }
    writer->set_dropped(*topic, 7);
    writer->mark(5000, "hand on");
    ASSERT_TRUE(writer->close());
  }
  const auto recording = rec::Recording::open(path());
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_TRUE(recording->complete());
  EXPECT_EQ(recording->session(), "lab1");
  EXPECT_EQ(recording->version(), "1.2.3");
  ASSERT_EQ(recording->config().size(), 2u);
  EXPECT_EQ(recording->config()[0].path, "wall.yaml");
  EXPECT_EQ(recording->config()[0].text, "schema: session/1\n");
  ASSERT_EQ(recording->marks().size(), 1u);
  EXPECT_EQ(recording->marks()[0].text, "hand on");
  EXPECT_EQ(recording->marks()[0].stamp_ns, 5000u);
  const rec::RecordedTopic* const topic = recording->find("haptic0.telemetry");
  ASSERT_NE(topic, nullptr);
  EXPECT_EQ(topic->rows, 2500u);
  EXPECT_EQ(topic->dropped, 7u);
  EXPECT_EQ(topic->type_name, "rtbus/Telemetry");
  const auto original = description_of<rtbus::Telemetry>();
  ASSERT_EQ(topic->fields.size(), original.fields.size());
  for (std::size_t i = 0; i < original.fields.size(); ++i) {
    EXPECT_EQ(topic->fields[i].name, original.fields[i].name);
    EXPECT_EQ(topic->fields[i].unit, original.fields[i].unit);
    EXPECT_EQ(topic->fields[i].offset, original.fields[i].offset);
    EXPECT_EQ(topic->fields[i].count, original.fields[i].count);
    EXPECT_EQ(topic->fields[i].type, original.fields[i].type);
  }
  const auto samples = recording->samples(*topic);
  ASSERT_EQ(samples.size(), 2500 * sizeof(rtbus::Telemetry));
  for (std::uint64_t i = 1; i <= 2500; ++i) {
    const auto expected = tick(i);
    ASSERT_EQ(std::memcmp(samples.data() + (i - 1) * sizeof expected, &expected, sizeof expected), 0) << i;
  }
  EXPECT_EQ(recording->stamps_ns(*topic, 2499, 10), std::vector<std::uint64_t>{2'500'000});
  EXPECT_TRUE(recording->stamps_ns(*topic, 2500).empty());
  EXPECT_EQ(recording->column(*topic, "tick", 0, 9, 1), std::vector<double>{10.0});
}

TEST_F(Recordings, topics_may_come_later_and_come_back_with_other_fields) {
  auto writer = rec::Writer::create(path(), metadata());
  ASSERT_TRUE(writer);
  const auto first = writer->add_topic("a", description_of<rtbus::Heartbeat>());
  const rtbus::Heartbeat beat{.beats = 42};
  writer->append(*first, 1, 10, bytes_of(beat));
  ASSERT_TRUE(writer->flush());
  const auto second = writer->add_topic("a", description_of<rtbus::PlantCommand>());
  ASSERT_TRUE(second) << second.error().message;
  const rtbus::PlantCommand command{{1, 2, 3}};
  writer->append(*second, 1, 20, bytes_of(command));
  writer->append(*first, 2, 30, bytes_of(beat));
  ASSERT_TRUE(writer->close());
  const auto recording = rec::Recording::open(path());
  ASSERT_TRUE(recording);
  ASSERT_NE(recording->find("a"), nullptr);
  ASSERT_NE(recording->find("a~2"), nullptr);
  EXPECT_EQ(recording->find("a")->rows, 2u);
  EXPECT_EQ(recording->column(*recording->find("a"), "beats"), (std::vector<double>{42, 42}));
  EXPECT_EQ(recording->column(*recording->find("a~2"), "force_n", 1), std::vector<double>{2.0});
}

TEST_F(Recordings, what_was_flushed_survives_kill_9) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto writer = rec::Writer::create(path(), metadata());
    const auto topic = writer->add_topic("t", description_of<rtbus::Telemetry>());
    for (std::uint64_t i = 1; i <= 1500; ++i) {
      writer->append(*topic, i, i, bytes_of(tick(i)));
      if (i % 100 == 0) (void)writer->flush();
    }
    writer->append(*topic, 1501, 1501, bytes_of(tick(1501)));  // never flushed
    ::raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  const auto recording = rec::Recording::open(path());
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_FALSE(recording->complete());
  const rec::RecordedTopic* const topic = recording->find("t");
  ASSERT_NE(topic, nullptr);
  ASSERT_EQ(topic->rows, 1500u);
  const auto samples = recording->samples(*topic);
  for (std::uint64_t i = 1; i <= 1500; ++i) {
    const auto expected = tick(i);
    ASSERT_EQ(std::memcmp(samples.data() + (i - 1) * sizeof expected, &expected, sizeof expected), 0) << i;
  }
}

TEST_F(Recordings, can_be_read_while_they_grow) {
  auto writer = rec::Writer::create(path(), metadata());
  ASSERT_TRUE(writer);
  const auto topic = writer->add_topic("t", description_of<rtbus::Heartbeat>());
  const rtbus::Heartbeat beat{};
  writer->append(*topic, 1, 1, bytes_of(beat));
  ASSERT_TRUE(writer->flush());
  // Another process would; HDF5 keeps one open file per process.
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::execlp("h5ls", "h5ls", "-r", path().c_str(), nullptr);
    ::_exit(127);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  writer->append(*topic, 2, 2, bytes_of(beat));
  EXPECT_TRUE(writer->flush());
}

TEST_F(Recordings, end_in_order_when_the_disk_is_nearly_full) {
  auto about = metadata();
  about.reserve_bytes = UINT64_MAX;  // more than any disk has
  auto writer = rec::Writer::create(path(), about);
  ASSERT_TRUE(writer);
  const auto topic = writer->add_topic("t", description_of<rtbus::Telemetry>());
  writer->append(*topic, 1, 1, bytes_of(tick(1)));
  const auto flushed = writer->flush();
  ASSERT_FALSE(flushed);
  EXPECT_NE(flushed.error().message.find(path() + " is nearly full"), std::string::npos) << flushed.error().message;
  ASSERT_TRUE(writer->close());
  const auto recording = rec::Recording::open(path());
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_TRUE(recording->complete());
  ASSERT_EQ(recording->find("t")->rows, 1u);  // what it had is in there
}

TEST_F(Recordings, keep_their_memory_however_long_they_are) {
  auto writer = rec::Writer::create(path(), metadata());
  ASSERT_TRUE(writer);
  const auto topic = writer->add_topic("haptic0.telemetry", description_of<rtbus::Telemetry>());
  const auto heap = [] {
    const struct mallinfo2 now = ::mallinfo2();
    return static_cast<double>(now.uordblks + now.hblkhd) / (1 << 20);
  };
  double early_mib = 0.0;
  for (std::uint64_t i = 1; i <= 60'000; ++i) {
    writer->append(*topic, i, 1000 * i, bytes_of(tick(i)));
    if (i % 1000 == 0) {
      ASSERT_TRUE(writer->flush());
    }
    if (i == 15'000) early_mib = heap();
  }
  // 11 MiB went through in between, and some hundred bytes of index for each chunk of 32 KiB.
  EXPECT_LT(heap() - early_mib, 0.25);
  ASSERT_TRUE(writer->close());
}

TEST_F(Recordings, do_not_overwrite) {
  std::ofstream(path()) << "precious";
  const auto writer = rec::Writer::create(path(), metadata());
  ASSERT_FALSE(writer);
  EXPECT_NE(writer.error().message.find("exists already"), std::string::npos);
}

TEST_F(Recordings, other_files_are_refused_with_a_reason) {
  std::ofstream(path()) << "no HDF5 at all";
  const auto recording = rec::Recording::open(path());
  ASSERT_FALSE(recording);
  EXPECT_NE(recording.error().message.find("is no recording"), std::string::npos);
  EXPECT_FALSE(rec::Recording::open(path("missing.h5")));
}

TEST(Marks, reach_the_recorders_of_their_session_only) {
  const std::string session = "marktest" + std::to_string(::getpid());
  EXPECT_EQ(tools::send_mark(session, {1, "nobody"}), 0);
  {
    tools::MarkInbox here(session), other(session + "2");
    EXPECT_EQ(tools::send_mark(session, {123, "hand off, \"quoted\""}), 1);
    const auto mark = here.take();
    ASSERT_TRUE(mark);
    EXPECT_EQ(mark->stamp_ns, 123u);
    EXPECT_EQ(mark->text, "hand off, \"quoted\"");
    EXPECT_FALSE(here.take());
    EXPECT_FALSE(other.take());
    EXPECT_EQ(tools::send_mark(session, {5, std::string(1000, 'x')}), 1);
    EXPECT_EQ(here.take()->text.size(), 255u);
  }
  EXPECT_EQ(tools::send_mark(session, {1, "gone"}), 0);
}

}  // namespace
