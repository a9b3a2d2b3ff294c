// What tools see without knowing the types.
#include "rtbus/topic_directory.hpp"

#include <cstring>

#include "rtbus/messages.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using test::Child;
using test::Probe;
using test::RawFile;
using test::ScratchSession;

TEST(TopicDirectory, ListsWhatASessionHas) {
  ScratchSession session, other;
  auto b = Writer<Probe>::create(session, "b.probe", {.capacity = 4});
  auto a = Writer<LoopStats>::create(session, "a.loop_stats");
  auto elsewhere = Writer<Probe>::create(other, "c");
  for (int i = 0; i < 3; ++i) b->publish({}, 1);
  const auto topics = list_topics(session->name);
  ASSERT_EQ(topics.size(), 2u);
  EXPECT_EQ(topics[0].topic, "a.loop_stats");
  EXPECT_EQ(topics[0].type_name, "rtbus/LoopStats");
  EXPECT_EQ(topics[0].fields.size(), SampleTraits<LoopStats>::kFields.size());
  EXPECT_EQ(topics[1].session, session->name);
  EXPECT_EQ(topics[1].topic, "b.probe");
  EXPECT_EQ(topics[1].problem, "");
  EXPECT_EQ(topics[1].sample_bytes, sizeof(Probe));
  EXPECT_EQ(topics[1].capacity, 4u);
  EXPECT_EQ(topics[1].published, 3u);
  EXPECT_EQ(topics[1].epoch, 1u);
  EXPECT_EQ(topics[1].writer_pid, static_cast<std::uint32_t>(::getpid()));
  EXPECT_TRUE(topics[1].writer_alive);
  EXPECT_EQ(topics[1].owner, ::geteuid());
  EXPECT_EQ(topics[1].segment_bytes, 8192u);

  std::size_t ours = 0;
  for (const TopicInfo& topic : list_topics()) ours += topic.session == session->name || topic.session == other->name;
  EXPECT_EQ(ours, 3u);
}

TEST(TopicDirectory, NamesTheProblemOfADamagedSegment) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x");
  RawFile(session.path("x")).at<std::uint64_t>(0) = 1;
  const auto topics = list_topics(session->name);
  ASSERT_EQ(topics.size(), 1u);
  EXPECT_NE(topics[0].problem.find("not a topic of this bus"), std::string::npos) << topics[0].problem;
  EXPECT_GT(topics[0].segment_bytes, 0u);
}

TEST(TopicDirectory, RemovesDeadSegmentsAndLeavesLiveOnesAlone) {
  ScratchSession session, other;
  Child child([&] {
    auto* dead = new auto(Writer<Probe>::create(session, "dead"));
    auto* kept = new auto(Writer<Probe>::create(other, "dead"));
    return dead->has_value() && kept->has_value();
  });
  auto live = Writer<Probe>::create(session, "live");
  EXPECT_TRUE(remove_dead(session->name).names.empty());
  child.kill();
  auto topics = list_topics(session->name);
  ASSERT_EQ(topics.size(), 2u);
  EXPECT_FALSE(topics[0].writer_alive);

  const RemovedTopics removed = remove_dead(session->name);
  EXPECT_THAT(removed.names, ::testing::ElementsAre(segment_name(session->name, "dead")));
  EXPECT_EQ(removed.bytes, 8192u);
  EXPECT_FALSE(session.exists("dead"));
  EXPECT_TRUE(session.exists("live"));
  EXPECT_TRUE(other.exists("dead"));
}

TEST(TopicDirectory, RemovesTheDebrisOfADamagedOrUnfinishedSegment) {
  ScratchSession session;
  for (const off_t size : {off_t{0}, off_t{5000}}) {
    const int fd = ::open(session.path("x").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0600);
    ASSERT_EQ(::ftruncate(fd, size), 0);
    ::close(fd);
    EXPECT_EQ(list_topics(session->name).size(), 1u);
    EXPECT_EQ(remove_dead(session->name).names.size(), 1u);
    EXPECT_FALSE(session.exists("x"));
  }
}

TEST(TopicDirectory, RemovesNothingThatIsNotOurs) {
  const std::string mine = std::to_string(::getpid());
  const std::string paths[] = {"/dev/shm/other." + mine, "/dev/shm/rtbus." + mine, "/dev/shm/rtbus.UPPER.x" + mine,
                               "/dev/shm/rtbusx." + mine + ".y"};
  for (const auto& path : paths) ::close(::open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0600));
  const std::string link = "/dev/shm/rtbus.link" + mine + ".x";
  ASSERT_EQ(::symlink("/etc/hostname", link.c_str()), 0);
  EXPECT_TRUE(remove_dead(mine).names.empty());
  EXPECT_TRUE(remove_dead("link" + mine).names.empty());
  for (const auto& path : paths) EXPECT_EQ(::unlink(path.c_str()), 0) << path;
  EXPECT_EQ(::unlink(link.c_str()), 0);
}

TEST(RawReader, ReadsAnyTopicByItsOwnDescription) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x");
  auto reader = RawReader::open(session, "x");
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->read_latest(), ReadStatus::kSame);
  writer->publish({7, -0.25, {1, 2, 1e-9}}, 123);
  ASSERT_EQ(reader->read_next(), ReadStatus::kFresh);
  EXPECT_EQ(reader->sequence(), 1u);
  EXPECT_EQ(reader->stamp_ns(), 123u);
  std::string line;
  visit_fields(reader->bytes(), reader->description(),
               [&](const std::string& label, const std::string& unit, const FieldValue& value) {
                 line += label + "=" + to_text(value) + unit + " ";
               });
  EXPECT_EQ(line, "number=71 value=-0.25m vector[0]=1N vector[1]=2N vector[2]=1e-09N ");
  EXPECT_EQ(reader->read_latest(), ReadStatus::kSame);
}

TEST(RawReader, KeepsTheLastSampleAcrossAFailedRead) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.capacity = 2});
  auto reader = RawReader::open(session, "x");
  writer->publish({.number = 1}, 1);
  ASSERT_EQ(reader->read_latest(), ReadStatus::kFresh);
  RawFile(session.path("x")).at<std::uint64_t>(offsetof(detail::SegmentHeader, newest)) = 40;
  EXPECT_EQ(reader->read_latest(), ReadStatus::kLapped);
  std::uint64_t number = 0;
  std::memcpy(&number, reader->bytes().data(), 8);
  EXPECT_EQ(number, 1u);
  EXPECT_EQ(reader->sequence(), 1u);
}

TEST(FieldValue, EveryTypeIsDecoded) {
  std::vector<std::byte> sample(64);
  const auto value = [&](FieldType type, auto number) {
    std::memcpy(sample.data() + 8, &number, sizeof number);
    return to_text(field_value(sample, {"f", "", type, 8, 1}, 0));
  };
  EXPECT_EQ(value(FieldType::kF64, 0.1), "0.1");
  EXPECT_EQ(value(FieldType::kU64, ~std::uint64_t{0}), "18446744073709551615");
  EXPECT_EQ(value(FieldType::kI64, std::int64_t{-5}), "-5");
  EXPECT_EQ(value(FieldType::kU32, std::uint32_t{4'000'000'000}), "4000000000");
  EXPECT_EQ(value(FieldType::kI32, std::int32_t{-7}), "-7");
  EXPECT_EQ(value(FieldType::kU8, std::uint8_t{200}), "200");
  std::memcpy(sample.data() + 8, "ab\x1b\0cd", 6);
  EXPECT_EQ(to_text(field_value(sample, {"f", "", FieldType::kText, 8, 6}, 0)), "ab?");
  EXPECT_EQ(to_text(field_value(sample, {"f", "", FieldType::kText, 60, 100}, 0)), "");
  EXPECT_EQ(to_text(field_value(sample, {"f", "", FieldType::kF64, 0, 100}, 99)), "0");
}

}  // namespace
}  // namespace rtbus
