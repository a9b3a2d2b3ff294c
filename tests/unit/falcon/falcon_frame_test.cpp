#include "drivers/falcon/falcon_frame.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace drivers::falcon {
namespace {

FrameBytes hex(const std::string& text) {
  FrameBytes out{};
  for (std::size_t i = 0; i < kFrameBytes; ++i) {
    out[i] = static_cast<std::uint8_t>(std::stoi(text.substr(3 * i, 2), nullptr, 16));
  }
  return out;
}

struct HostVector {
  HostFrame frame;
  const char* bytes;
};

// The last eight were captured from the maker's own driver.
const std::vector<HostVector> kHostVectors{
    {{{0, 0, 0}, 0x00}, "3c 41 41 41 41 41 41 41 41 41 41 41 41 41 41 3e"},
    {{{0, 0, 0}, 0x03}, "3c 41 41 41 41 41 41 41 41 41 41 41 41 44 41 3e"},
    {{{0, 0, 0}, 0x09}, "3c 41 41 41 41 41 41 41 41 41 41 41 41 4a 41 3e"},
    {{{1, -1, 4095}, 0x05}, "3c 42 41 41 41 50 50 50 50 50 50 50 41 46 41 3e"},
    {{{-4095, 4095, -4096}, 0x00}, "3c 42 41 41 50 50 50 50 41 41 41 41 50 41 41 3e"},
    {{{100, -200, 300}, 0x0F}, "3c 45 47 41 41 49 44 50 50 4d 43 42 41 50 41 3e"},
    {{{4095, 3906, 4034}, 0x04}, "3c 50 50 50 41 43 45 50 41 43 4d 50 41 45 41 3e"},
    {{{2752, 2780, 2888}, 0x04}, "3c 41 4d 4b 41 4d 4e 4b 41 49 45 4c 41 45 41 3e"},
    {{{1311, 1453, 1526}, 0x04}, "3c 50 42 46 41 4e 4b 46 41 47 50 46 41 45 41 3e"},
    {{{661, 731, 766}, 0x04}, "3c 46 4a 43 41 4c 4e 43 41 4f 50 43 41 45 41 3e"},
    {{{-2900, 27, 929}, 0x04}, "3c 4d 4b 45 50 4c 42 41 41 42 4b 44 41 45 41 3e"},
    {{{399, -3087, 1135}, 0x04}, "3c 50 49 42 41 42 50 44 50 50 47 45 41 45 41 3e"},
    {{{-679, 2529, -1862}, 0x04}, "3c 4a 46 4e 50 42 4f 4a 41 4b 4c 49 50 45 41 3e"},
    {{{2481, -669, -1691}, 0x04}, "3c 42 4c 4a 41 44 47 4e 50 46 47 4a 50 45 41 3e"},
};

struct DeviceVector {
  DeviceFrame frame;
  const char* bytes;
};

const std::vector<DeviceVector> kDeviceVectors{
    {{{0, 0, 0}, 0x0, 0b000}, "3c 41 41 41 41 41 41 41 41 41 41 41 41 41 41 3e"},
    {{{1447, 0, -1447}, 0x0, 0b111}, "3c 48 4b 46 41 41 41 41 41 4a 46 4b 50 b1 41 3e"},
    {{{-1447, 1447, 0}, 0x1, 0b111}, "3c 4a 46 4b 50 48 4b 46 41 41 41 41 41 b2 41 3e"},
    {{{1000, -1000, 32767}, 0x4, 0b111}, "3c 49 4f 44 41 49 42 4d 50 50 50 50 48 b5 41 3e"},
    {{{-32768, -1, 1}, 0x8, 0b001}, "3c 41 41 41 49 50 50 50 50 42 41 41 41 59 41 3e"},
    {{{123, -456, 789}, 0xF, 0b101}, "3c 4c 48 41 41 49 44 4f 50 46 42 44 41 a0 41 3e"},
    {{{0, 0, 0}, 0xF, 0b111}, "3c 41 41 41 41 41 41 41 41 41 41 41 41 c0 41 3e"},
    {{{-2345, -338, -267}, 0x0, 0b000}, "3c 48 4e 47 50 4f 4b 4f 50 46 50 4f 50 41 41 3e"},
};

TEST(FalconFrame, HostVectorsBothWays) {
  for (const HostVector& v : kHostVectors) {
    EXPECT_EQ(encode(v.frame), hex(v.bytes));
    HostFrame back;
    ASSERT_TRUE(decode(hex(v.bytes), back));
    EXPECT_EQ(back.motor, v.frame.motor);
    EXPECT_EQ(back.flags, v.frame.flags);
  }
}

TEST(FalconFrame, DeviceVectorsBothWays) {
  for (const DeviceVector& v : kDeviceVectors) {
    EXPECT_EQ(encode(v.frame), hex(v.bytes));
    DeviceFrame back;
    ASSERT_TRUE(decode(hex(v.bytes), back));
    EXPECT_EQ(back.encoder, v.frame.encoder);
    EXPECT_EQ(back.buttons, v.frame.buttons);
    EXPECT_EQ(back.homed, v.frame.homed);
  }
}

TEST(FalconFrame, RefusesEveryByteThatCannotStandThere) {
  const FrameBytes good = encode(DeviceFrame{{1, 2, 3}, 0x5, 0x7});
  for (std::size_t at = 0; at < kFrameBytes; ++at) {
    int accepted = 0;
    for (int value = 0; value < 256; ++value) {
      FrameBytes bytes = good;
      bytes[at] = static_cast<std::uint8_t>(value);
      DeviceFrame out;
      if (decode(bytes, out)) ++accepted;
    }
    const int expected = at == 0 || at == 15 ? 1 : at == 13 ? 128 : at == 14 ? 254 : 16;
    EXPECT_EQ(accepted, expected) << "byte " << at;
  }
}

std::vector<DeviceFrame> found(FrameFinder& finder) {
  std::vector<DeviceFrame> out;
  FrameBytes bytes;
  DeviceFrame frame;
  while (finder.next(bytes)) {
    if (decode(bytes, frame)) out.push_back(frame);
  }
  return out;
}

DeviceFrame numbered(int i) { return {{static_cast<std::int16_t>(i), 0, 0}, 0, 0x7}; }

TEST(FrameFinder, FindsFramesHoweverTheStreamIsCut) {
  for (std::size_t piece = 1; piece <= 40; ++piece) {
    std::vector<std::uint8_t> stream;
    for (int i = 0; i < 10; ++i) {
      const FrameBytes bytes = encode(numbered(i));
      stream.insert(stream.end(), bytes.begin(), bytes.end());
    }
    FrameFinder finder;
    int next = 0;
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      finder.push(std::span(stream).subspan(at, std::min(piece, stream.size() - at)));
      for (const DeviceFrame& frame : found(finder)) EXPECT_EQ(frame.encoder[0], next++);
    }
    EXPECT_EQ(next, 10) << "in pieces of " << piece;
    EXPECT_EQ(finder.resyncs(), 0U);
  }
}

TEST(FrameFinder, LosesOnlyTheFrameThatMissesBytes) {
  const FrameBytes bytes = encode(numbered(1));
  for (std::size_t kept = 0; kept < kFrameBytes; ++kept) {
    FrameFinder finder;
    finder.push(std::span(bytes).first(kept));  // cut short, as a 14-byte reply is
    EXPECT_TRUE(found(finder).empty());
    finder.push(encode(numbered(2)));
    finder.push(encode(numbered(3)));
    const auto frames = found(finder);
    ASSERT_EQ(frames.size(), 2U) << "after " << kept << " bytes";
    EXPECT_EQ(frames[0].encoder[0], 2);
    EXPECT_EQ(frames[1].encoder[0], 3);
    EXPECT_EQ(finder.resyncs(), kept == 0 ? 0U : 1U);
    EXPECT_EQ(finder.skipped_bytes(), kept);
  }
}

TEST(FrameFinder, RecoversFromNoiseWithinOneFrame) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> any(0, 255);
  for (int trial = 0; trial < 2000; ++trial) {
    FrameFinder finder;
    std::vector<std::uint8_t> noise(static_cast<std::size_t>(any(random)));
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(any(random));
    finder.push(noise);
    (void)found(finder);
    for (int i = 0; i < 3; ++i) finder.push(encode(numbered(i)));
    // A chance '<' near the end of the noise may swallow nothing of the frames that follow: '<' ends it.
    const auto frames = found(finder);
    ASSERT_GE(frames.size(), 3U);
    EXPECT_EQ(frames.back().encoder[0], 2);
  }
}

TEST(FrameFinder, NeverHoldsMoreThanItsBuffer) {
  FrameFinder finder;
  const std::vector<std::uint8_t> junk(1000, 'A');
  finder.push(junk);
  for (int i = 0; i < 50; ++i) finder.push(encode(numbered(i)));
  const auto frames = found(finder);
  ASSERT_FALSE(frames.empty());
  EXPECT_EQ(frames.back().encoder[0], 49);
}

}  // namespace
}  // namespace drivers::falcon
