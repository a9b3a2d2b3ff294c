// Names, errors, permissions and ownership of a topic's segment.
#include "rtbus/segment.hpp"

#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/users.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using test::Child;
using test::OtherProbe;
using test::Probe;
using test::ScratchSession;

TEST(Segment, NamesAreCheckedOnBothEnds) {
  for (const std::string topic : {"", "a/b", "../x", "Upper", "a b", ".hidden", "a\n"}) {
    auto writer = Writer<Probe>::create(Session{.name = "test"}, topic);
    ASSERT_FALSE(writer) << topic;
    EXPECT_EQ(writer.error(), TopicError::kBadName) << topic;
    auto reader = Reader<Probe>::open(Session{.name = "test"}, topic);
    ASSERT_FALSE(reader) << topic;
    EXPECT_EQ(reader.error(), TopicError::kBadName) << topic;
  }
  for (const std::string session : {"", "a.b", "a/b", "LAB", "abcdefghijklmnopqrstuvwxyz0123456"}) {
    auto writer = Writer<Probe>::create(Session{.name = session}, "x");
    ASSERT_FALSE(writer) << session;
    EXPECT_EQ(writer.error(), TopicError::kBadName) << session;
  }
  EXPECT_FALSE(valid_topic_name(std::string(97, 'a')));
  EXPECT_TRUE(valid_topic_name(std::string(96, 'a')));
}

TEST(Segment, OpeningWithoutAWriterIsNotFound) {
  ScratchSession session;
  auto reader = Reader<Probe>::open(session, "nobody");
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error(), TopicError::kNotFound);
}

TEST(Segment, CapacityMustBeAPowerOfTwoInRange) {
  ScratchSession session;
  for (const std::uint32_t capacity : {0u, 1u, 3u, 65u, 131072u}) {
    auto writer = Writer<Probe>::create(session, "x", {.capacity = capacity});
    EXPECT_FALSE(writer) << capacity;
    EXPECT_FALSE(session.exists("x"));
  }
  EXPECT_TRUE(Writer<Probe>::create(session, "x", {.capacity = 2}));
}

TEST(Segment, SecondWriterIsRefusedAlsoInTheSameProcess) {
  ScratchSession session;
  auto first = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(first);
  auto second = Writer<Probe>::create(session, "x");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error(), TopicError::kAlreadyOwned);
  auto other_type = Writer<OtherProbe>::create(session, "x");
  ASSERT_FALSE(other_type);
  EXPECT_EQ(other_type.error(), TopicError::kAlreadyOwned);
}

TEST(Segment, CleanExitLeavesNothing) {
  ScratchSession session;
  {
    auto writer = Writer<Probe>::create(session, "x");
    ASSERT_TRUE(writer);
    EXPECT_TRUE(session.exists("x"));
    auto moved = std::move(*writer);  // the moved-from shell must not unlink
    EXPECT_TRUE(session.exists("x"));
  }
  EXPECT_FALSE(session.exists("x"));
}

TEST(Segment, CleanExitDoesNotRemoveASuccessorsSegment) {
  ScratchSession session;
  auto first = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(first);
  ASSERT_EQ(::unlink(session.path("x").c_str()), 0);  // as a careless `rm` would
  auto second = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(second);
  { auto gone = std::move(*first); }
  EXPECT_TRUE(session.exists("x"));
}

TEST(Segment, AnotherTypeIsALayoutMismatch) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(writer);
  auto reader = Reader<OtherProbe>::open(session, "x");
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error(), TopicError::kLayoutMismatch);
}

TEST(Segment, TwoSessionsDoNotMeet) {
  ScratchSession left, right;
  auto left_writer = Writer<Probe>::create(left, "x");
  auto right_writer = Writer<Probe>::create(right, "x");
  ASSERT_TRUE(left_writer);
  ASSERT_TRUE(right_writer);
  left_writer->publish({.number = 1}, 0);
  right_writer->publish({.number = 2}, 0);
  auto reader = Reader<Probe>::open(left, "x");
  ASSERT_TRUE(reader);
  Stamped<Probe> got;
  ASSERT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 1u);
}

TEST(Segment, PermissionsAreExactlyAsConfiguredWhateverTheUmask) {
  ScratchSession session;
  for (const mode_t mask : {mode_t{0}, mode_t{0077}, mode_t{0777}}) {
    for (const mode_t mode : {mode_t{0600}, mode_t{0640}, mode_t{0660}}) {
      session->mode = mode;
      const mode_t before = ::umask(mask);
      auto writer = Writer<Probe>::create(session, "x");
      ::umask(before);
      ASSERT_TRUE(writer);
      struct stat status {};
      ASSERT_EQ(::stat(session.path("x").c_str(), &status), 0);
      EXPECT_EQ(status.st_mode & 07777, mode);
    }
  }
}

TEST(Segment, GroupIsAsConfigured) {
  if (::geteuid() != 0 || tests::is_root_alone()) GTEST_SKIP() << "needs root to choose any group";
  ScratchSession session;
  session->group = 12345;
  session->mode = 0640;
  auto writer = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(writer);
  struct stat status {};
  ASSERT_EQ(::stat(session.path("x").c_str(), &status), 0);
  EXPECT_EQ(status.st_gid, 12345u);
}

TEST(Segment, StrangersSegmentsAreRefusedUnlessTrusted) {
  if (::geteuid() != 0 || tests::is_root_alone()) GTEST_SKIP() << "needs root to give a file away";
  ScratchSession session;
  Child child([&] {
    auto* writer = new auto(Writer<Probe>::create(session, "x"));
    return writer->has_value() && ::chown(session.path("x").c_str(), 4711, 4712) == 0;
  });
  ASSERT_TRUE(child.succeeded());
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error(), TopicError::kPermission);
  EXPECT_TRUE(Reader<Probe>::open(session, "x", {.trust = OwnerTrust::kAnyone}));
  session->group = 4712;
  EXPECT_TRUE(Reader<Probe>::open(session, "x"));
  session->group = 4713;
  EXPECT_FALSE(Reader<Probe>::open(session, "x"));

  // The dead stranger's segment is not continued but replaced, since root may.
  child.kill();
  session->group.reset();
  auto writer = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(writer);
  struct stat status {};
  ASSERT_EQ(::stat(session.path("x").c_str(), &status), 0);
  EXPECT_EQ(status.st_uid, 0u);
}

TEST(Segment, ForbiddenFileIsAPermissionError) {
  if (tests::is_root_alone()) GTEST_SKIP() << "root is forbidden nothing, and can become nobody else";
  ScratchSession session;
  Child child([&] {
    if (::geteuid() == 0) {
      // A root-owned topic, then ask for it as nobody.
      auto writer = Writer<Probe>::create(session, "x");
      if (!writer || ::setresgid(65534, 65534, 65534) != 0 || ::setresuid(65534, 65534, 65534) != 0) return false;
      auto reader = Reader<Probe>::open(session, "x");
      auto second = Writer<Probe>::create(session, "x");
      return !reader && reader.error() == TopicError::kPermission && !second &&
             second.error() == TopicError::kPermission;
    }
    auto writer = Writer<Probe>::create(session, "x");
    if (!writer || ::chmod(session.path("x").c_str(), 0) != 0) return false;
    auto reader = Reader<Probe>::open(session, "x");
    return !reader && reader.error() == TopicError::kPermission;
  });
  EXPECT_TRUE(child.succeeded());
}

TEST(Segment, SymbolicLinkIsNeverFollowed) {
  ScratchSession session;
  const std::string victim = "/tmp/rtbus-victim-" + std::to_string(::getpid());
  const int fd = ::open(victim.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0600);
  ASSERT_GE(fd, 0);
  ASSERT_EQ(::symlink(victim.c_str(), session.path("x").c_str()), 0);
  auto writer = Writer<Probe>::create(session, "x");
  auto reader = Reader<Probe>::open(session, "x");
  struct stat status {};
  ASSERT_EQ(::fstat(fd, &status), 0);
  ::close(fd);
  ::unlink(victim.c_str());
  ::unlink(session.path("x").c_str());
  ASSERT_FALSE(writer);
  EXPECT_EQ(writer.error(), TopicError::kCorrupt);
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error(), TopicError::kCorrupt);
  EXPECT_EQ(status.st_size, 0) << "something was written through the link";
}

TEST(Segment, LinkToARealSegmentIsRefusedByTheOpenItself) {
  // The look before the open could be raced; shm_open's own O_NOFOLLOW must hold as well.
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "real");
  ASSERT_TRUE(writer);
  ASSERT_EQ(::symlink(session.path("real").c_str(), session.path("link").c_str()), 0);
  const std::string name = "/" + segment_name(session->name, "link");
  errno = 0;
  const int fd = ::shm_open(name.c_str(), O_RDONLY, 0);
  const int number = errno;
  ::unlink(session.path("link").c_str());
  EXPECT_EQ(fd, -1);
  EXPECT_EQ(number, ELOOP);
}

TEST(Segment, FifoDoesNotBlockAReader) {
  ScratchSession session;
  ASSERT_EQ(::mkfifo(session.path("x").c_str(), 0600), 0);
  auto reader = Reader<Probe>::open(session, "x");
  ::unlink(session.path("x").c_str());
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error(), TopicError::kCorrupt);
}

TEST(Segment, ReadersMappingCannotBeWritten) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(writer);
  auto segment = Segment::open(session, "x", nullptr, OwnerTrust::kSelfOrRoot, false);
  ASSERT_TRUE(segment);
  EXPECT_DEATH(segment->ring().newest->store(1), "");
}

TEST(Segment, ObservedWhileAReaderAsksToBeNoticed) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(writer);
  EXPECT_FALSE(writer->observed());
  {
    auto silent = Reader<Probe>::open(session, "x");
    ASSERT_TRUE(silent);
    EXPECT_FALSE(writer->observed());
    auto noticed = Reader<Probe>::open(session, "x", {.presence = true});
    ASSERT_TRUE(noticed);
    EXPECT_TRUE(writer->observed());
  }
  EXPECT_FALSE(writer->observed());
}

TEST(Segment, PresenceDiesWithTheReadersProcess) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(writer);
  Child child([&] { return (new auto(Reader<Probe>::open(session, "x", {.presence = true})))->has_value(); });
  ASSERT_TRUE(child.succeeded());
  EXPECT_TRUE(writer->observed());
  child.kill();
  EXPECT_FALSE(writer->observed());
}

TEST(Segment, CostsOnePageAndASlackOfAQuarter) {
  ScratchSession session;
  auto writer = Writer<LoopStats>::create(session, "stats", {.capacity = 64});
  ASSERT_TRUE(writer);
  struct stat status {};
  ASSERT_EQ(::stat(session.path("stats").c_str(), &status), 0);
  EXPECT_LE(status.st_size, 256 * 64 * 5 / 4 + 4096);
}

TEST(Segment, DescribesTheSampleToStrangers) {
  ScratchSession session;
  auto writer = Writer<LoopStats>::create(session, "stats");
  ASSERT_TRUE(writer);
  auto segment = Segment::open(session, "stats", nullptr, OwnerTrust::kSelfOrRoot, false);
  ASSERT_TRUE(segment);
  const auto& description = segment->description();
  EXPECT_EQ(description.type_name, "rtbus/LoopStats");
  EXPECT_EQ(description.type_hash, type_hash<LoopStats>());
  EXPECT_EQ(description.sample_bytes, sizeof(LoopStats));
  ASSERT_EQ(description.fields.size(), SampleTraits<LoopStats>::kFields.size());
  for (std::size_t i = 0; i < description.fields.size(); ++i) {
    const Field& expected = SampleTraits<LoopStats>::kFields[i];
    EXPECT_EQ(description.fields[i].name, expected.name);
    EXPECT_EQ(description.fields[i].unit, expected.unit);
    EXPECT_EQ(description.fields[i].type, expected.type);
    EXPECT_EQ(description.fields[i].offset, expected.offset);
    EXPECT_EQ(description.fields[i].count, expected.count);
  }
}

}  // namespace
}  // namespace rtbus
