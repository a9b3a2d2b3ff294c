// A reader believes nothing it finds: each line damages one thing.
#include <cstring>

#include "rtbus/detail/layout.hpp"
#include "rtbus/topic.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using detail::FieldRecord;
using detail::SegmentHeader;
using test::Probe;
using test::RawFile;
using test::ScratchSession;

struct Damage {
  const char* what;
  std::size_t offset;
  std::size_t bytes;
  std::uint64_t value;
  TopicError expected;
};

constexpr std::size_t field(std::size_t member, std::size_t index = 0) {
  return sizeof(SegmentHeader) + index * sizeof(FieldRecord) + member;
}

const Damage kDamages[] = {
    {"magic of something else", 0, 8, 0x1234, TopicError::kCorrupt},
    {"magic not written yet", 0, 8, 0, TopicError::kNotFound},
    {"newer layout version", offsetof(SegmentHeader, layout_version), 4, 2, TopicError::kLayoutMismatch},
    {"header of zero bytes", offsetof(SegmentHeader, header_bytes), 4, 0, TopicError::kCorrupt},
    {"header beyond the file", offsetof(SegmentHeader, header_bytes), 4, 0xfffff000, TopicError::kCorrupt},
    {"another type hash", offsetof(SegmentHeader, type_hash), 8, 42, TopicError::kLayoutMismatch},
    {"sample of zero bytes", offsetof(SegmentHeader, sample_bytes), 4, 0, TopicError::kCorrupt},
    {"sample of odd size", offsetof(SegmentHeader, sample_bytes), 4, 41, TopicError::kCorrupt},
    {"sample larger than its slot", offsetof(SegmentHeader, sample_bytes), 4, 4096, TopicError::kCorrupt},
    {"sample of 4 GiB", offsetof(SegmentHeader, sample_bytes), 4, 0xfffffff8, TopicError::kCorrupt},
    {"no slots", offsetof(SegmentHeader, capacity), 4, 0, TopicError::kCorrupt},
    {"one slot", offsetof(SegmentHeader, capacity), 4, 1, TopicError::kCorrupt},
    {"three slots", offsetof(SegmentHeader, capacity), 4, 3, TopicError::kCorrupt},
    {"more slots than the file holds", offsetof(SegmentHeader, capacity), 4, 65536, TopicError::kCorrupt},
    {"fewer slots than the file holds", offsetof(SegmentHeader, capacity), 4, 2, TopicError::kCorrupt},
    {"2^31 slots", offsetof(SegmentHeader, capacity), 4, 1u << 31, TopicError::kCorrupt},
    {"slot stride of zero", offsetof(SegmentHeader, slot_stride), 4, 0, TopicError::kCorrupt},
    {"unaligned slot stride", offsetof(SegmentHeader, slot_stride), 4, 63, TopicError::kCorrupt},
    {"huge slot stride", offsetof(SegmentHeader, slot_stride), 4, 0xffffffc0, TopicError::kCorrupt},
    {"no fields", offsetof(SegmentHeader, field_count), 4, 0, TopicError::kCorrupt},
    {"fields beyond the header", offsetof(SegmentHeader, field_count), 4, 1000, TopicError::kCorrupt},
    {"2^32 fields", offsetof(SegmentHeader, field_count), 4, 0xffffffff, TopicError::kCorrupt},
    {"another segment size", offsetof(SegmentHeader, segment_bytes), 8, 1 << 20, TopicError::kCorrupt},
    {"doorbell outside", offsetof(SegmentHeader, doorbell_offset), 8, 1 << 20, TopicError::kCorrupt},
    {"doorbell inside the slots", offsetof(SegmentHeader, doorbell_offset), 8, 4096, TopicError::kCorrupt},
    {"empty type name", offsetof(SegmentHeader, type_name), 1, 0, TopicError::kCorrupt},
    {"escape sequence as type name", offsetof(SegmentHeader, type_name), 1, 0x1b, TopicError::kCorrupt},
    {"counter beyond reason", offsetof(SegmentHeader, newest), 8, ~0ull, TopicError::kCorrupt},
    {"nameless field", field(offsetof(FieldRecord, name), 1), 1, 0, TopicError::kCorrupt},
    {"control character in a field", field(offsetof(FieldRecord, name)), 1, '\n', TopicError::kCorrupt},
    {"unknown field type", field(offsetof(FieldRecord, type)), 4, 99, TopicError::kCorrupt},
    {"field type zero", field(offsetof(FieldRecord, type)), 4, 0, TopicError::kCorrupt},
    {"field type that is known modulo 256", field(offsetof(FieldRecord, type)), 4, 257, TopicError::kCorrupt},
    {"field past the sample", field(offsetof(FieldRecord, offset)), 4, 48, TopicError::kCorrupt},
    {"field offset that wraps", field(offsetof(FieldRecord, offset)), 4, 0xfffffff8, TopicError::kCorrupt},
    {"field of no elements", field(offsetof(FieldRecord, count)), 4, 0, TopicError::kCorrupt},
    {"field count that wraps", field(offsetof(FieldRecord, count)), 4, 0x20000001, TopicError::kCorrupt},
};

TEST(CorruptSegment, EachDamageIsFoundOnOpening) {
  ScratchSession session;
  for (const Damage& damage : kDamages) {
    auto writer = Writer<Probe>::create(session, "x", {.capacity = 256});
    ASSERT_TRUE(writer) << damage.what;
    ASSERT_TRUE(Reader<Probe>::open(session, "x")) << damage.what;
    RawFile file(session.path("x"));
    std::memcpy(&file.at<std::byte>(damage.offset), &damage.value, damage.bytes);
    auto reader = Reader<Probe>::open(session, "x");
    ASSERT_FALSE(reader) << damage.what;
    EXPECT_EQ(reader.error(), damage.expected) << damage.what << ": " << to_string(reader.error());
    if (damage.expected != TopicError::kLayoutMismatch) {
      auto any = Segment::open(session, "x", nullptr, OwnerTrust::kAnyone, false);
      EXPECT_FALSE(any) << damage.what;
    }
  }
}

TEST(CorruptSegment, TextWithoutEndIsFound) {
  ScratchSession session;
  for (const auto& [offset, bytes] :
       {std::pair{offsetof(SegmentHeader, type_name), 48u}, std::pair{field(offsetof(FieldRecord, name)), 40u},
        std::pair{field(offsetof(FieldRecord, unit)), 16u}}) {
    auto writer = Writer<Probe>::create(session, "x");
    ASSERT_TRUE(writer);
    RawFile file(session.path("x"));
    std::memset(&file.at<std::byte>(offset), 'a', bytes);
    EXPECT_FALSE(Segment::open(session, "x", nullptr, OwnerTrust::kAnyone, false)) << offset;
  }
}

TEST(CorruptSegment, FilesOfAnyOtherLengthAreRefused) {
  ScratchSession session;
  for (const off_t change : {-12288 + 1, -4096, -1, 1, 4096}) {
    auto writer = Writer<Probe>::create(session, "x");
    ASSERT_TRUE(writer);
    struct stat status {};
    ASSERT_EQ(::stat(session.path("x").c_str(), &status), 0);
    ASSERT_EQ(::truncate(session.path("x").c_str(), std::max<off_t>(1, status.st_size + change)), 0);
    auto reader = Reader<Probe>::open(session, "x");
    ASSERT_FALSE(reader) << change;
    EXPECT_EQ(reader.error(), TopicError::kCorrupt);
  }
}

TEST(CorruptSegment, SparseFileWithAGoodHeaderIsNotFaultedIn) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.capacity = 1024});
  ASSERT_TRUE(writer);
  const int fd = ::open(session.path("x").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_EQ(::fallocate(fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 8192, 8192), 0);
  ::close(fd);
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error(), TopicError::kCorrupt);
}

TEST(CorruptSegment, DamageAfterOpeningNeitherCrashesNorHangsAReader) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.capacity = 4});
  ASSERT_TRUE(writer);
  for (std::uint64_t n = 1; n <= 10; ++n) writer->publish({.number = n}, n);
  auto reader = Reader<Probe>::open(session, "x", {.from_oldest = true});
  ASSERT_TRUE(reader);
  Stamped<Probe> got;
  ASSERT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  RawFile file(session.path("x"));
  auto& newest = file.at<std::uint64_t>(offsetof(SegmentHeader, newest));
  for (const std::uint64_t wild : {std::uint64_t{0}, std::uint64_t{3}, std::uint64_t{11}, std::uint64_t{1} << 40,
                                   std::uint64_t{1} << 62, std::uint64_t{1} << 63, ~std::uint64_t{0}}) {
    newest = wild;
    EXPECT_NE(reader->read_latest(got), ReadStatus::kFresh) << wild;
    EXPECT_NE(reader->read_next(got), ReadStatus::kFresh) << wild;
    EXPECT_EQ(got.sequence, 10u);
    EXPECT_EQ(got.value.number, 10u);
  }
  // Sizes in the header are not asked again.
  for (std::size_t offset = 8; offset < 64; offset += 8) file.at<std::uint64_t>(offset) = ~std::uint64_t{0};
  newest = 10;
  writer->publish({.number = 11}, 11);
  ASSERT_EQ(reader->read_next(got), ReadStatus::kFresh) << "damage that passed has cost nothing";
  EXPECT_EQ(got.value.number, 11u);
  EXPECT_EQ(reader->missed(), 0u);
}

}  // namespace
}  // namespace rtbus
