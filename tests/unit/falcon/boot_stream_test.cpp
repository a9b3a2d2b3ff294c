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

TEST(BootStream, WithoutABlockIsRefused) {
  auto bytes = smallest();
  bytes.resize(24);
  bytes[22] = bytes[23] = 0;
  ASSERT_FALSE(check_boot_stream(bytes));
  EXPECT_NE(check_boot_stream(bytes).error().find("no block"), std::string::npos);
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

/// The format once more, from its description and on the whole stream at once.
bool is_boot_stream(const std::vector<std::uint8_t>& bytes) {
  std::vector<std::uint32_t> words;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) words.push_back(bytes[i] | bytes[i + 1] << 8);
  const auto address_fits = [&](std::size_t at) { return (words[at] << 16 | words[at + 1]) < 0x400000; };
  if (bytes.size() % 2 != 0 || words.size() < 12 || words[0] != 0x08AA || !address_fits(9)) return false;
  std::size_t at = 11, blocks = 0;
  for (; at + 2 < words.size() && words[at] != 0; at += 3 + words[at], ++blocks) {
    if (!address_fits(at + 1)) return false;
  }
  return blocks > 0 && at + 1 == words.size() && words[at] == 0;
}

TEST(BootStream, OfChangedBytesExactlyTheWellFormedAreAccepted) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> any(0, 255);
  int accepted = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    auto bytes = synthetic_boot_stream(200);
    for (int i = 0; i < 5; ++i) {
      // Every second change goes to the head, where the bytes mean something.
      const std::size_t at = static_cast<std::size_t>(any(random)) % (i % 2 == 0 ? bytes.size() : std::size_t{30});
      if (any(random) < 128) bytes[at] = static_cast<std::uint8_t>(any(random));
    }
    if (any(random) < 32) bytes.resize(static_cast<std::size_t>(any(random)));
    const auto read = check_boot_stream(bytes);
    ASSERT_EQ(read.has_value(), is_boot_stream(bytes)) << trial << ": " << (read ? "accepted" : read.error());
    accepted += read ? 1 : 0;
  }
  EXPECT_GT(accepted, 200);
  EXPECT_LT(accepted, 1800);
}

}  // namespace
}  // namespace drivers::falcon
