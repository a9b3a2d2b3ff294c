#include "tools/cli/common/field_format.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

namespace {

using rtbus::FieldType;
using testing::HasSubstr;

/// A sample as it lies in shared memory: three doubles, one counter, eight bytes of text.
struct Bytes {
  double position_m[3] = {0.1, -0.00171, 1.0 / 3.0};
  std::int64_t offset = -7;
  char label[8] = {'a', ',', '"', 'b', 0, 'x', 'x', 'x'};
};
const tools::FieldList kFields = {{"position_m", "m", FieldType::kF64, 0, 3},
                                  {"offset", "1", FieldType::kI64, 24, 1},
                                  {"label", "", FieldType::kText, 32, 8}};

tools::RawSample sample_of(const Bytes& bytes) { return {42, 56'000'000'007, std::as_bytes(std::span(&bytes, 1))}; }

TEST(FormatBlock, WritesYamlWithUnitsAsComments) {
  const Bytes bytes;
  EXPECT_EQ(tools::format_block(sample_of(bytes), kFields),
            "--- # 42 at 56.000000007 s\n"
            "position_m: [0.1, -0.00171, 0.333333]  # m\n"
            "offset: -7\n"
            "label: \"a,\\\"b\"\n");
}

TEST(CsvHeader, NamesEveryElementWithItsUnit) {
  EXPECT_EQ(tools::csv_header(kFields),
            "sequence [1],stamp_ns [ns],position_m[0] [m],position_m[1] [m],position_m[2] [m],offset [1],label");
}

TEST(CsvRow, HasAsManyCellsAsTheHeaderAndQuotesText) {
  const Bytes bytes;
  EXPECT_EQ(tools::csv_row(sample_of(bytes), kFields), "42,56000000007,0.1,-0.00171,0.3333333333333333,-7,\"a,\"\"b\"");
}

TEST(CsvRow, KeepsEveryBitOfADouble) {
  Bytes bytes;
  bytes.position_m[0] = 0.1 + 0.2;
  const tools::FieldList field = {{"position_m[0]", "m", FieldType::kF64, 0, 1}};
  const std::string row = tools::csv_row(sample_of(bytes), field);
  EXPECT_EQ(std::stod(row.substr(row.rfind(',') + 1)), bytes.position_m[0]);
}

TEST(JsonSample, KeepsTheOrderOfTheFields) {
  const Bytes bytes;
  EXPECT_EQ(tools::json_line(tools::json_sample(sample_of(bytes), kFields)),
            "{\"sequence\":42,\"stamp_ns\":56000000007,\"position_m\":[0.1,-0.00171,0.3333333333333333],\"offset\":-7,"
            "\"label\":\"a,\\\"b\"}");
}

TEST(JsonSample, TurnsWhatJsonCannotSayIntoNull) {
  Bytes bytes;
  bytes.position_m[0] = std::numeric_limits<double>::quiet_NaN();
  bytes.position_m[1] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(tools::json_line(tools::json_sample(sample_of(bytes), kFields)), HasSubstr("[null,null,0.333"));
}

TEST(JsonLine, ReplacesBytesThatAreNotUtf8) {
  Bytes bytes;
  std::memcpy(bytes.label, "\xff\xfe", 3);
  EXPECT_NO_THROW(EXPECT_THAT(tools::json_line(tools::json_sample(sample_of(bytes), kFields)), HasSubstr("label")));
}

TEST(SelectFields, TakesAllWhenNoneIsNamed) { EXPECT_EQ(tools::select_fields(kFields, {})->size(), 3u); }

TEST(SelectFields, KeepsTheOrderAskedFor) {
  const auto fields = tools::select_fields(kFields, {"offset", "position_m"});
  ASSERT_TRUE(fields.has_value());
  EXPECT_EQ((*fields)[0].name, "offset");
  EXPECT_EQ((*fields)[1].name, "position_m");
}

TEST(SelectFields, TakesOneElementOfAField) {
  const Bytes bytes;
  const auto fields = tools::select_fields(kFields, {"position_m[1]"});
  ASSERT_TRUE(fields.has_value());
  EXPECT_EQ(tools::csv_header(*fields), "sequence [1],stamp_ns [ns],position_m[1] [m]");
  EXPECT_EQ(tools::csv_row(sample_of(bytes), *fields), "42,56000000007,-0.00171");
}

TEST(SelectFields, RefusesAnUnknownNameAndAnElementOutside) {
  for (const char* const name :
       {"velocity", "position_m[3]", "position_m[-1]", "position_m[]", "position_m[1", "position_m[1]x"}) {
    const auto fields = tools::select_fields(kFields, {name});
    ASSERT_FALSE(fields.has_value()) << name;
    EXPECT_THAT(fields.error().message, HasSubstr("position_m[0..2], offset, label")) << name;
  }
}

TEST(FormatBlock, ReadsZeroForAFieldThatLiesOutsideTheSample) {
  const Bytes bytes;
  const tools::FieldList outside = {{"beyond", "1", FieldType::kU64, 4096, 1}};
  EXPECT_THAT(tools::format_block(sample_of(bytes), outside), HasSubstr("beyond: 0\n"));
}

}  // namespace
