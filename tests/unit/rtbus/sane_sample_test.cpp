// What a reader believes: every rule of sane_sample.hpp once from either side.
#include "rtbus/sane_sample.hpp"

#include <cstring>
#include <limits>
#include <vector>

#include "rtbus/contact_messages.hpp"
#include "rtbus/link_messages.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/shape_messages.hpp"
#include "rtbus/topic_directory.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using test::RawFile;
using test::ScratchSession;

template <class T>
class SaneSample : public testing::Test {};
using Messages =
    testing::Types<DeviceState, ProxyState, Heartbeat, NodeInfo, LoopStats, Telemetry, StepStats, BodyPoses, SoftNodes,
                   PlantCommand, PlantState, ProxyContacts, LinkStats, Orders, BodyOrders, ContactPoints, BodyShapes>;
TYPED_TEST_SUITE(SaneSample, Messages);

/// With every table full, so that no row is left out of the judgement.
template <class T>
T full() {
  T sample;
  if constexpr (std::is_same_v<T, ProxyContacts>) {
    sample.contacts = sample.bodies = kContactSlots;
    sample.supports = kSupportSlots;
    sample.yields = kYieldSlots;
    sample.contact_normal.fill({0.0, 1.0, 0.0});
    sample.support_normal.fill({0.0, 1.0, 0.0});
  }
  if constexpr (std::is_same_v<T, ContactPoints>) sample.count = kContactSlots;
  if constexpr (std::is_same_v<T, BodyPoses>) sample.count = sample.bodies = T::kBodies;
  if constexpr (std::is_same_v<T, BodyOrders>) sample.count = T::kBodies;
  if constexpr (std::is_same_v<T, BodyShapes>) sample.count = sample.shapes = T::kShapes;
  return sample;
}

template <class T>
T with(T sample, const Field& field, std::uint32_t element, double value) {
  std::memcpy(reinterpret_cast<std::byte*>(&sample) + field.offset + std::size_t{8} * element, &value, sizeof value);
  return sample;
}

TYPED_TEST(SaneSample, IsTheDefaultOne) {
  EXPECT_TRUE(sane(TypeParam{}, 1));
  EXPECT_TRUE(sane(full<TypeParam>(), 1));
}

TYPED_TEST(SaneSample, HasNoNumberThatIsNoneOrThatNobodyCanMean) {
  for (const Field& field : SampleTraits<TypeParam>::kFields) {
    if (field.type != FieldType::kF64) continue;
    for (std::uint32_t i = 0; i < field.count; ++i) {
      for (const double wild : {std::nan(""), std::numeric_limits<double>::infinity(),
                                -std::numeric_limits<double>::infinity(), 1e300, -1e300}) {
        EXPECT_FALSE(sane(with(full<TypeParam>(), field, i, wild), 1)) << field.name << "[" << i << "] = " << wild;
      }
    }
  }
}

TYPED_TEST(SaneSample, MayHoldDenormals) {
  for (const Field& field : SampleTraits<TypeParam>::kFields) {
    if (field.type != FieldType::kF64 || field.name.ends_with("_scale")) continue;  // gains are divided by scales
    if (field.name == "proxy_radius_m") continue;                                   // a size, or none
    EXPECT_TRUE(sane(with(full<TypeParam>(), field, 0, std::numeric_limits<double>::denorm_min()), 1)) << field.name;
  }
}

TYPED_TEST(SaneSample, IsJudgedTheSameAsBytes) {
  const SaneBytes rules = rules_of(type_hash<TypeParam>(), sizeof(TypeParam));
  ASSERT_NE(rules, nullptr);
  const TypeParam good = full<TypeParam>();
  EXPECT_TRUE(rules(&good, 1));
  std::vector<std::byte> ones(sizeof(TypeParam), std::byte{0xff});
  EXPECT_EQ(rules(ones.data(), 1), false);
  EXPECT_EQ(rules_of(type_hash<TypeParam>(), sizeof(TypeParam) + 8), nullptr) << "another type under this hash";
}

template <class T, class Change>
bool stays_sane(const Change& change) {
  T sample = full<T>();
  change(sample);
  return sane(sample, 1000);
}

TEST(SaneSampleRules, CountsStayWithinTheirArrays) {
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.contacts = kContactSlots + 1; }));
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.bodies = 0xffffffff; }));
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.supports = kSupportSlots + 1; }));
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.contact_body[3] = kContactSlots; }));
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.support_body[0] = kContactSlots; }));
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.body_kind[0] = 4; }));
  EXPECT_TRUE(stays_sane<ProxyContacts>([](auto& s) { s.contacts = 2, s.contact_body[3] = 99; })) << "an unused row";
  EXPECT_FALSE(stays_sane<ContactPoints>([](auto& s) { s.count = kContactSlots + 1; }));
  EXPECT_FALSE(stays_sane<BodyPoses>([](auto& s) { s.count = BodyPoses::kBodies + 1; }));
  EXPECT_FALSE(stays_sane<BodyPoses>([](auto& s) { s.first_body = 1; })) << "more bodies than the frame has";
  EXPECT_FALSE(stays_sane<BodyShapes>([](auto& s) { s.count = BodyShapes::kShapes + 1; }));
  EXPECT_FALSE(stays_sane<BodyShapes>([](auto& s) { s.first_shape = 1; })) << "more shapes than the table has";
  EXPECT_FALSE(stays_sane<BodyShapes>([](auto& s) { s.shape[63] = 6; })) << "no such kind";
  EXPECT_FALSE(stays_sane<SoftNodes>([](auto& s) { s.count = SoftNodes::kNodes + 1; }));
}

// A word of an answer that is written over is next to zero half of the time. Such a plane or proxy touches nothing.
TEST(SaneSampleRules, NormalsHaveTheirLengthAndAProxyIsNotNextToNothing) {
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.contact_normal[2] = {0.0, 1e-30, 0.0}; }));
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.contact_normal[0] = {1.0, 1.0, 0.0}; }));
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.support_normal[kSupportSlots - 1] = {0.0, 0.6, 0.0}; }));
  EXPECT_TRUE(stays_sane<ProxyContacts>([](auto& s) { s.contact_normal[0] = {0.6, 0.0, 0.80001}; })) << "rounded";
  EXPECT_TRUE(stays_sane<ProxyContacts>([](auto& s) {
    s.contacts = 1;
    s.contact_normal[1] = {};
  })) << "an unused row";
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.proxy_radius_m = 1e-30; }));
  EXPECT_FALSE(stays_sane<ProxyContacts>([](auto& s) { s.proxy_radius_m = -0.01; }));
  EXPECT_TRUE(stays_sane<ProxyContacts>([](auto& s) { s.proxy_radius_m = 0.0; })) << "a point";
  EXPECT_TRUE(stays_sane<ProxyContacts>([](auto& s) { s.proxy_radius_m = 0.005; }));
}

TEST(SaneSampleRules, TimesDoNotLieAheadOfTheStamp) {
  EXPECT_TRUE(stays_sane<ProxyState>([](auto& s) { s.device_time_ns = 1000 + kMaxAhead_ns; }));
  EXPECT_FALSE(stays_sane<ProxyState>([](auto& s) { s.device_time_ns = 1001 + kMaxAhead_ns; }));
  EXPECT_FALSE(stays_sane<Telemetry>([](auto& s) { s.due_ns = ~std::uint64_t{0}; }));
  EXPECT_FALSE(stays_sane<DeviceState>([](auto& s) { s.sample_time_ns = std::uint64_t{1} << 63; }));
  EXPECT_TRUE(sane_stamp(monotonic_ns()));
  EXPECT_FALSE(sane_stamp(monotonic_ns() + kNsPerS));
}

TEST(SaneSampleRules, EnumeratorsExistTextsEndScalesArePositive) {
  EXPECT_FALSE(stays_sane<Heartbeat>([](auto& s) { s.state = 3; }));
  EXPECT_FALSE(stays_sane<LinkStats>([](auto& s) { s.state = 5; }));
  EXPECT_FALSE(stays_sane<Orders>([](auto& s) { s.estop = 2; }));
  EXPECT_FALSE(stays_sane<Orders>([](auto& s) { s.extra_force_n[1] = std::nan(""); }));
  EXPECT_FALSE(stays_sane<Orders>([](auto& s) { s.extra_force_until_ns = ~std::uint64_t{0}; }));
  EXPECT_FALSE(stays_sane<Orders>([](auto& s) { s.clutched_until_ns = ~std::uint64_t{0}; }));
  EXPECT_FALSE(stays_sane<NodeInfo>([](auto& s) { s.role.fill('x'); }));
  EXPECT_FALSE(stays_sane<NodeInfo>([](auto& s) { s.kind = {'\x1b', '[', 'J'}; }));
  EXPECT_TRUE(stays_sane<NodeInfo>([](auto& s) { s.core = 0xffffffff; })) << "not pinned";
  EXPECT_FALSE(stays_sane<NodeInfo>([](auto& s) { s.core = 0x7fffffff; }));
  EXPECT_FALSE(stays_sane<DeviceState>([](auto& s) { s.position_scale = 0.0; }));
  EXPECT_FALSE(stays_sane<DeviceState>([](auto& s) { s.force_scale = -1.0; }));
  EXPECT_FALSE(stays_sane<DeviceState>([](auto& s) { s.force_scale = std::numeric_limits<double>::denorm_min(); }));
  EXPECT_FALSE(stays_sane<Telemetry>([](auto& s) { s.gate = 1.01; }));
}

TEST(SaneReading, PassesOverWhatIsRefusedAndGoesOn) {
  ScratchSession session;
  auto writer = Writer<PlantCommand>::create(session, "x");
  auto reader = Reader<PlantCommand>::open(session, "x");
  auto raw = RawReader::open(session, "x");
  ASSERT_TRUE(writer && reader && raw);
  const double wild[] = {1.0, std::nan(""), 1e300, 4.0};
  for (const double force_n : wild) writer->publish({{force_n, 0, 0}}, monotonic_ns());
  Stamped<PlantCommand> got;
  for (const double expected : {1.0, 4.0}) {
    ASSERT_EQ(reader->read_next(got), ReadStatus::kFresh);
    EXPECT_EQ(got.value.force_n[0], expected);
    ASSERT_EQ(raw->read_next(), ReadStatus::kFresh);
    double first = 0.0;
    std::memcpy(&first, raw->bytes().data(), sizeof first);
    EXPECT_EQ(first, expected);
  }
  EXPECT_EQ(reader->read_next(got), ReadStatus::kSame);
  EXPECT_EQ(reader->refused(), 2u);
  EXPECT_EQ(reader->missed(), 2u);
  EXPECT_EQ(raw->refused(), 2u);
}

TEST(SaneReading, RefusesTheFutureAndWhatIsOlderThanTheSampleBefore) {
  ScratchSession session;
  auto writer = Writer<PlantCommand>::create(session, "x");
  auto reader = Reader<PlantCommand>::open(session, "x");
  ASSERT_TRUE(writer && reader);
  Stamped<PlantCommand> got;
  const std::uint64_t now_ns = monotonic_ns();
  writer->publish({}, now_ns);
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  writer->publish({}, now_ns - 1);
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kRefused);
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kRefused);
  EXPECT_EQ(reader->refused(), 1u) << "the same sample";
  writer->publish({}, now_ns + 10 * kNsPerS);
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kRefused);
  EXPECT_EQ(got.stamp_ns, now_ns) << "the output is left alone";
  writer->publish({}, now_ns + 1);
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kFresh);
}

/// A counter and a slot that fit each other: a reader has to believe them.
void forge(RawFile& file, std::uint64_t n, std::uint32_t capacity, std::uint64_t stamp_ns) {
  const detail::Geometry where = detail::geometry(sizeof(PlantCommand), capacity, 1, false);
  const std::size_t slot = where.header_bytes + ((n - 1) & (capacity - 1)) * where.slot_stride;
  file.at<std::uint64_t>(slot) = 2 * n;
  file.at<std::uint64_t>(slot + 8) = stamp_ns;
  file.at<std::uint64_t>(offsetof(detail::SegmentHeader, newest)) = n;
}

TEST(SaneReading, AForgedNumberDoesNotSilenceAReaderForEver) {
  ScratchSession session;
  constexpr std::uint32_t kCapacity = 8;
  auto writer = Writer<PlantCommand>::create(session, "x", {.capacity = kCapacity});
  auto latest = Reader<PlantCommand>::open(session, "x");
  auto ordered = Reader<PlantCommand>::open(session, "x", {.from_oldest = true});
  ASSERT_TRUE(writer && latest && ordered);
  RawFile file(session.path("x"));
  Stamped<PlantCommand> got;
  for (const std::uint64_t wild : {std::uint64_t{100}, std::uint64_t{1} << 40, std::uint64_t{1} << 62}) {
    forge(file, wild, kCapacity, monotonic_ns());
    ASSERT_EQ(latest->read_latest(got), ReadStatus::kFresh) << wild;
    EXPECT_EQ(got.sequence, wild);
    for (int i = 0; i < 3 * static_cast<int>(kCapacity) && ordered->read_next(got) != ReadStatus::kFresh; ++i) {
    }
    bool latest_back = false, ordered_back = false;
    for (int i = 0; i < 3 * detail::kGrownBehind; ++i) {
      writer->publish({}, monotonic_ns());
      const bool fresh = latest->read_latest(got) == ReadStatus::kFresh;
      latest_back = latest_back || (fresh && got.sequence == writer->published());
      ordered_back =
          (ordered->read_next(got) == ReadStatus::kFresh && got.sequence <= writer->published()) || ordered_back;
    }
    EXPECT_TRUE(latest_back) << wild;
    EXPECT_TRUE(ordered_back) << wild;
  }
}

}  // namespace
}  // namespace rtbus
