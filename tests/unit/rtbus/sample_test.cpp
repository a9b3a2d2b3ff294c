// The type hash is the contract between two builds: everything that changes the bytes or their meaning changes it.
#include "rtbus/sample.hpp"

#include <gtest/gtest.h>

#include <set>

#include "rtbus/messages.hpp"

namespace rtbus {
namespace {

struct Base {
  double a;
  std::uint64_t b;
};
struct Renamed {
  double c;
  std::uint64_t b;
};
struct Retyped {
  double a;
  std::int64_t b;
};
struct Swapped {
  std::uint64_t b;
  double a;
};
struct Longer {
  double a;
  std::uint64_t b;
  double c;
};
struct AsArray {
  std::array<double, 1> a;
  std::uint64_t b;
};
struct TwoInOne {
  std::array<double, 2> a;
};
struct OtherUnit {
  double a;
  std::uint64_t b;
};
struct OtherName {
  double a;
  std::uint64_t b;
};
struct Padded {
  std::uint32_t a;
  double b;
};

}  // namespace

#define RTBUS_TEST_TRAITS(Type, name, ...)            \
  template <>                                         \
  struct SampleTraits<Type> {                         \
    static constexpr std::string_view kName = name;   \
    static constexpr std::array kFields{__VA_ARGS__}; \
  }
RTBUS_TEST_TRAITS(Base, "t", RTBUS_FIELD(Base, a, "m"), RTBUS_FIELD(Base, b, "1"));
RTBUS_TEST_TRAITS(Renamed, "t", RTBUS_FIELD(Renamed, c, "m"), RTBUS_FIELD(Renamed, b, "1"));
RTBUS_TEST_TRAITS(Retyped, "t", RTBUS_FIELD(Retyped, a, "m"), RTBUS_FIELD(Retyped, b, "1"));
RTBUS_TEST_TRAITS(Swapped, "t", RTBUS_FIELD(Swapped, b, "1"), RTBUS_FIELD(Swapped, a, "m"));
RTBUS_TEST_TRAITS(Longer, "t", RTBUS_FIELD(Longer, a, "m"), RTBUS_FIELD(Longer, b, "1"), RTBUS_FIELD(Longer, c, "1"));
RTBUS_TEST_TRAITS(TwoInOne, "t", RTBUS_FIELD(TwoInOne, a, "m"));
RTBUS_TEST_TRAITS(OtherUnit, "t", RTBUS_FIELD(OtherUnit, a, "mm"), RTBUS_FIELD(OtherUnit, b, "1"));
RTBUS_TEST_TRAITS(OtherName, "u", RTBUS_FIELD(OtherName, a, "m"), RTBUS_FIELD(OtherName, b, "1"));
RTBUS_TEST_TRAITS(AsArray, "t", RTBUS_FIELD(AsArray, a, "m"), RTBUS_FIELD(AsArray, b, "1"));
RTBUS_TEST_TRAITS(Padded, "t", RTBUS_FIELD(Padded, a, "m"), RTBUS_FIELD(Padded, b, "1"));

namespace {

TEST(TypeHash, ChangesWithNameUnitTypeOrderAndLength) {
  const std::set<std::uint64_t> hashes = {type_hash<Base>(),      type_hash<Renamed>(),  type_hash<Retyped>(),
                                          type_hash<Swapped>(),   type_hash<Longer>(),   type_hash<TwoInOne>(),
                                          type_hash<OtherUnit>(), type_hash<OtherName>()};
  EXPECT_EQ(hashes.size(), 8u);
}

TEST(TypeHash, SameBytesAndMeaningAreTheSameType) { EXPECT_EQ(type_hash<Base>(), type_hash<AsArray>()); }

TEST(TypeHash, MessagesDiffer) {
  const std::set<std::uint64_t> hashes = {type_hash<DeviceState>(), type_hash<ProxyState>(),   type_hash<Heartbeat>(),
                                          type_hash<NodeInfo>(),    type_hash<LoopStats>(),    type_hash<Telemetry>(),
                                          type_hash<StepStats>(),   type_hash<PlantCommand>(), type_hash<PlantState>()};
  EXPECT_EQ(hashes.size(), 9u);
}

TEST(Sample, HiddenPaddingAndUndescribedBytesAreRejected) {
  EXPECT_TRUE(Sample<Base>);
  EXPECT_FALSE(Sample<Padded>);
  EXPECT_FALSE(Sample<int>);
}

}  // namespace
}  // namespace rtbus
