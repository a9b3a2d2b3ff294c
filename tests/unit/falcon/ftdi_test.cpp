#include "drivers/falcon/ftdi.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "drivers/falcon/sha256.hpp"

namespace drivers::falcon {
namespace {

TEST(Ftdi, DivisorsOfTheRatesInUse) {
  const auto expect = [](double wanted, int value, int index, double actual) {
    const ftdi::Baud rate = ftdi::baud(wanted);
    EXPECT_EQ(rate.value, value) << wanted;
    EXPECT_EQ(rate.index, index) << wanted;
    EXPECT_NEAR(rate.actual_hz, actual, 0.5) << wanted;
  };
  expect(9600, 0x4138, 0, 9600);
  expect(140000, 0x0015, 1, 140351);
  expect(142857, 0x0015, 0, 142857);
  expect(1456312, 0x0002, 0, 1.5e6);
  expect(115200, 0x001A, 0, 115385);
  expect(57600, 0xC034, 0, 57554);
  expect(3e6, 0, 0, 3e6);
  expect(2e6, 1, 0, 2e6);
}

TEST(Ftdi, EveryDivisorReadsBackAsItsRate) {
  for (double wanted = 300; wanted < 3.2e6; wanted *= 1.01) {
    const ftdi::Baud rate = ftdi::baud(wanted);
    EXPECT_DOUBLE_EQ(ftdi::baud_of(rate.value, rate.index).actual_hz, rate.actual_hz) << wanted;
    if (wanted < 1e5) {
      EXPECT_NEAR(rate.actual_hz, wanted, 0.005 * wanted);
    }
  }
  EXPECT_EQ(ftdi::baud_of(0, 1).actual_hz, 0.0);
}

TEST(Ftdi, StatusBytesAreStrippedAtEveryPacket) {
  std::vector<std::uint8_t> transfer;
  std::vector<std::uint8_t> expected;
  for (int packet = 0; packet < 4; ++packet) {
    const int payload = packet == 3 ? 5 : 62;
    transfer.push_back(0x01);
    transfer.push_back(packet == 1 ? 0x62 : packet == 2 ? 0x68 : 0x60);
    for (int i = 0; i < payload; ++i) {
      transfer.push_back(static_cast<std::uint8_t>(16 * packet + i));
      expected.push_back(transfer.back());
    }
  }
  std::vector<std::uint8_t> payload;
  const auto sink = [&payload](std::span<const std::uint8_t> part) {
    payload.insert(payload.end(), part.begin(), part.end());
  };
  EXPECT_EQ(ftdi::for_each_payload(transfer, sink), 2U);
  EXPECT_EQ(payload, expected);
}

TEST(Ftdi, EmptyAndOddTransfersAreHarmless) {
  int calls = 0;
  const auto sink = [&calls](std::span<const std::uint8_t>) { ++calls; };
  const std::vector<std::uint8_t> idle{0x01, 0x60};
  EXPECT_EQ(ftdi::for_each_payload({}, sink), 0U);
  EXPECT_EQ(ftdi::for_each_payload(std::span(idle).first(1), sink), 0U);
  EXPECT_EQ(ftdi::for_each_payload(idle, sink), 0U);
  EXPECT_EQ(calls, 0);
}

std::string hash(const std::string& text) {
  return sha256_hex(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

// FIPS 180-4's examples, and lengths around a block's end checked with sha256sum.
TEST(Sha256, PublishedExamples) {
  EXPECT_EQ(hash(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(hash("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(hash("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(hash(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

}  // namespace
}  // namespace drivers::falcon
