#include "drivers/falcon/boot_stream.hpp"

#include <gtest/gtest.h>

#include <random>

namespace drivers::falcon {
namespace {

std::vector<std::uint8_t> smallest() {
  std::vector<std::uint8_t> out{0xAA, 0x08};
  out.resize(18, 0);
  for (const int byte :
       {0x3F, 0x00, 0x02, 0x80, 0x02, 0x00, 0x3F, 0x00, 0x02, 0x80, 0x34, 0x12, 0x78, 0x56, 0x00, 0x00}) {
    out.push_back(static_cast<std::uint8_t>(byte));
  }
  return out;
}

TEST(BootStream, TheSmallestOneIsUnderstood) {
  ASSERT_EQ(smallest().size(), 34U);
  const auto read = check_boot_stream(smallest());
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->entry(), 0x3F8002U);
  EXPECT_EQ(read->blocks(), 1U);
}

TEST(BootStream, EveryTruncationAndExtensionIsRefused) {
  const auto good = smallest();
  for (std::size_t length = 0; length < good.size(); ++length) {
    const auto read = check_boot_stream(std::span(good).first(length));
    ASSERT_FALSE(read) << length;
    EXPECT_NE(read.error().find("ends in the middle"), std::string::npos);
  }
  auto longer = good;
  longer.push_back(0);
  ASSERT_FALSE(check_boot_stream(longer));
  EXPECT_NE(check_boot_stream(longer).error().find("after the end"), std::string::npos);
}

TEST(BootStream, WrongKeyAndWrongAddressesAreNamed) {
  auto bytes = smallest();
  bytes[0] = 0xAB;
  EXPECT_NE(check_boot_stream(bytes).error().find("boot key"), std::string::npos);
  bytes = smallest();
  bytes[18] = 0x40;
  EXPECT_NE(check_boot_stream(bytes).error().find("entry address"), std::string::npos);
  bytes = smallest();
  bytes[24] = 0x40;
  EXPECT_NE(check_boot_stream(bytes).error().find("22 bits"), std::string::npos);
}

TEST(BootStream, SyntheticOnesAreWellFormedAtAnySize) {
  for (const std::size_t size : {0U, 34U, 35U, 100U, 7324U, 8492U, 30000U, 1000000U}) {
    const auto bytes = synthetic_boot_stream(size);
    const auto read = check_boot_stream(bytes);
    ASSERT_TRUE(read) << size << ": " << read.error();
    if (size >= 34 && size < 32000) {
      EXPECT_LE(size - bytes.size(), 1U);
    }
  }
}

TEST(BootStream, AnyBytesAreReadWithoutHarm) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> any(0, 255);
  for (int trial = 0; trial < 2000; ++trial) {
    auto bytes = synthetic_boot_stream(200);
    for (int i = 0; i < 5; ++i)
      bytes[static_cast<std::size_t>(any(random)) % bytes.size()] = static_cast<std::uint8_t>(any(random));
    (void)check_boot_stream(bytes);
  }
}

}  // namespace
}  // namespace drivers::falcon
