// Bytes on the wire against the vectors of the published protocol; a decoder that nothing throws off for good.
#include "drivers/phantom/phantom_message.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace drivers::phantom {
namespace {

std::vector<int> hex(std::span<const std::uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

std::vector<Reply> decode(ReplyDecoder& decoder, std::string_view text, int* bad = nullptr) {
  std::vector<Reply> out;
  for (const char c : text) {
    Reply reply;
    const auto event = decoder.take(static_cast<std::uint8_t>(c), reply);
    if (event == ReplyDecoder::Event::kReply) out.push_back(reply);
    if (event == ReplyDecoder::Event::kBadReply && bad != nullptr) ++*bad;
  }
  return out;
}

TEST(Command, IsTheTextOfTheVectors) {
  Command command;
  ASSERT_TRUE(encode({0, 0, 0}, command));
  EXPECT_EQ(hex(command.span()), (std::vector<int>{0x5B, 0x30, 0x2C, 0x30, 0x2C, 0x30, 0x5D, 0x0A}));
  ASSERT_TRUE(encode({0, -659, 0}, command));
  EXPECT_EQ(hex(command.span()), (std::vector<int>{0x5B, 0x30, 0x2C, 0x2D, 0x36, 0x35, 0x39, 0x2C, 0x30, 0x5D, 0x0A}));
  ASSERT_TRUE(encode({6000, -6000, 12}, command));
  EXPECT_EQ(hex(command.span()), (std::vector<int>{0x5B, 0x36, 0x30, 0x30, 0x30, 0x2C, 0x2D, 0x36, 0x30, 0x30, 0x30,
                                                   0x2C, 0x31, 0x32, 0x5D, 0x0A}));
}

TEST(Command, BeyondTheFirmwaresLimitIsRefusedNotSent) {
  for (const int current : {6001, -6001, 2147483647, -2147483647 - 1}) {
    Command command;
    EXPECT_FALSE(encode({0, current, 0}, command));
    EXPECT_EQ(command.length, 0u);
  }
}

TEST(Reply, VectorsAreRead) {
  ReplyDecoder decoder;
  const auto replies = decode(decoder,
                              "[3,0,0,0,0,0,0,0]\n[2,1000,-1500,700,512,1023,3,0]\n[1,-8312,2000,0,512,510,515,4]\n"
                              "[3,0,0,0,0,0,0,512]\n");
  ASSERT_EQ(replies.size(), 4u);
  EXPECT_EQ(replies[0].model, 3);
  EXPECT_EQ(replies[1].model, 2);
  EXPECT_EQ(replies[1].arm, (std::array<std::int32_t, 3>{1000, -1500, 700}));
  EXPECT_EQ(replies[1].gimbal, (std::array<std::int32_t, 3>{512, 1023, 3}));
  EXPECT_EQ(replies[1].errors, 0u);
  EXPECT_EQ(replies[2].arm, (std::array<std::int32_t, 3>{-8312, 2000, 0}));
  EXPECT_EQ(replies[2].errors, kGimbal2Failed);
  EXPECT_EQ(replies[2].errors & kCommandErrors, 0u);
  EXPECT_EQ(replies[3].errors, kWrongCommaCount);
  EXPECT_EQ(decoder.garbage(), 0u);
  EXPECT_EQ(decoder.resyncs(), 0u);
}

TEST(Reply, SplitAnywhereIsStillOne) {
  const std::string text = "[2,1000,-1500,700,512,1023,3,0]\n";
  for (std::size_t cut = 0; cut <= text.size(); ++cut) {
    ReplyDecoder decoder;
    auto replies = decode(decoder, text.substr(0, cut));
    for (const Reply& reply : decode(decoder, text.substr(cut))) replies.push_back(reply);
    ASSERT_EQ(replies.size(), 1u) << cut;
    EXPECT_EQ(replies[0].arm[1], -1500);
  }
}

TEST(Reply, GarbageBeforeAndAroundIsSkippedAndCounted) {
  ReplyDecoder decoder;
  EXPECT_EQ(decode(decoder, "1,2,3]\nhello[3,1,2,3,0,0,0,0]\n").size(), 1u);
  EXPECT_EQ(decoder.resyncs(), 1u);
  EXPECT_GT(decoder.garbage(), 0u);
  int bad = 0;
  EXPECT_EQ(decode(decoder, "[3,1,2[3,1,2,3,0,0,0,0]", &bad).size(), 1u);  // a cut one costs itself alone
  EXPECT_EQ(bad, 1);
  EXPECT_EQ(decoder.resyncs(), 2u);
}

TEST(Reply, OnlyEightPlainIntegersAreOne) {
  for (const char* text : {"[]", "[1]", "[3,0,0,0,0,0,0]", "[3,0,0,0,0,0,0,0,0]", "[3,0,0,0,0,0,,0]",
                           "[3,0,0,0,0,0,-,0]", "[3,0,0,0,0,0,0,0,]", "[,3,0,0,0,0,0,0]", "[3,0,0,0,2147483648,0,0,0]",
                           "[3,0,0,0,0,0,0,-8]", "[3 ,0,0,0,0,0,0,0]", "[3,0x1,0,0,0,0,0,0]", "[3,1.5,0,0,0,0,0,0]",
                           "[3,--1,0,0,0,0,0,0]", "[3,+1,0,0,0,0,0,0]"}) {
    ReplyDecoder decoder;
    int bad = 0;
    EXPECT_EQ(decode(decoder, text, &bad).size(), 0u) << text;
    EXPECT_EQ(bad, 1) << text;
    EXPECT_EQ(decode(decoder, "\n[3,0,0,0,0,0,0,0]\n").size(), 1u) << "after " << text;
  }
}

TEST(Reply, ExtremeCountersFit) {
  ReplyDecoder decoder;
  const auto replies =
      decode(decoder, "[3,-2147483648,2147483647,-2147483648,-2147483648,-2147483648,-2147483648,2147483647]");
  ASSERT_EQ(replies.size(), 1u);
  EXPECT_EQ(replies[0].arm[0], -2147483647 - 1);
  EXPECT_EQ(replies[0].errors, 2147483647u);
}

TEST(Reply, RandomBytesNeverStopTheNextAnswer) {
  std::mt19937 random(1);
  constexpr std::string_view kLikely = "[],-0123456789\n\r [[]]";
  for (int i = 0; i < 20000; ++i) {
    ReplyDecoder decoder;
    std::string noise;
    for (auto n = random() % 200; n > 0; --n) {
      noise += random() % 4 == 0 ? static_cast<char>(random()) : kLikely[random() % kLikely.size()];
    }
    (void)decode(decoder, noise);
    const auto replies = decode(decoder, "[2,1,2,3,4,5,6,0]\n");
    ASSERT_EQ(replies.size(), 1u);
    ASSERT_EQ(replies[0].arm[2], 3);
  }
}

TEST(ErrorBits, HaveNames) {
  EXPECT_EQ(describe_errors(0), "none");
  EXPECT_EQ(describe_errors(8 | 512), "trailing characters, wrong comma count");
  EXPECT_EQ(describe_errors(4), "gimbal sensor 2 does not answer");
  EXPECT_EQ(describe_errors(1024 | 4096), "number not readable, unknown bits 4096");
}

}  // namespace
}  // namespace drivers::phantom
