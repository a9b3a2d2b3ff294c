#include "drivers/falcon/boot_stream.hpp"

#include <algorithm>

namespace drivers::falcon {
namespace {

constexpr std::uint16_t kKey = 0x08AA;
constexpr std::size_t kReservedWords = 8;
constexpr std::size_t kHeaderWords = 1 + kReservedWords + 2;
constexpr std::uint32_t kAddressLimit = 0x400000;  // the C28x addresses 22 bits

}  // namespace

BootStreamReader::State BootStreamReader::feed(std::uint8_t byte) noexcept {
  if (state_ != State::kReading) return state_;
  if (bytes_++ % 2 == 0) {
    low_byte_ = byte;
  } else {
    take_word(static_cast<std::uint16_t>(low_byte_ | (byte << 8)));
  }
  return state_;
}

void BootStreamReader::fail(const char* problem) noexcept {
  state_ = State::kMalformed;
  problem_ = problem;
}

void BootStreamReader::take_word(std::uint16_t word) noexcept {
  if (header_words_ < kHeaderWords) {
    const std::size_t index = header_words_++;
    if (index == 0 && word != kKey) return fail("does not begin with the boot key AA 08");
    if (index >= kHeaderWords - 2) entry_ = (entry_ << 16) | word;
    if (index == kHeaderWords - 1 && entry_ >= kAddressLimit) fail("has an entry address beyond 22 bits");
    return;
  }
  if (address_words_left_ > 0) {
    if (--address_words_left_ == 1 && word >= kAddressLimit >> 16) fail("has a block for an address beyond 22 bits");
    return;
  }
  if (data_words_left_ > 0) {
    --data_words_left_;
    return;
  }
  if (word == 0) {
    state_ = State::kComplete;
    return;
  }
  ++blocks_;
  address_words_left_ = 2;
  data_words_left_ = word;
}

rtbus::Result<BootStreamReader, std::string> check_boot_stream(std::span<const std::uint8_t> bytes) {
  BootStreamReader reader;
  for (const std::uint8_t byte : bytes) {
    if (reader.state() != BootStreamReader::State::kReading) break;
    reader.feed(byte);
  }
  const std::string at = " (byte " + std::to_string(reader.bytes()) + " of " + std::to_string(bytes.size()) + ")";
  switch (reader.state()) {
    case BootStreamReader::State::kReading:
      return rtbus::Failure{"ends in the middle of the boot stream" + at};
    case BootStreamReader::State::kMalformed:
      return rtbus::Failure{reader.problem() + at};
    case BootStreamReader::State::kComplete:
      break;
  }
  if (reader.bytes() < bytes.size()) return rtbus::Failure{"has bytes after the end of the boot stream" + at};
  if (reader.blocks() == 0) return rtbus::Failure{std::string("holds no block: there is nothing to load")};
  return reader;
}

std::vector<std::uint8_t> synthetic_boot_stream(std::size_t bytes) {
  constexpr std::size_t kAround = 2 * kHeaderWords + 2 * 3 + 2;  // header, one block's head, the end
  constexpr std::size_t kMaxWords = 0x3FFF;
  const std::size_t words =
      std::clamp<std::size_t>((std::max<std::size_t>(bytes, kAround + 4) - kAround) / 2, 2, kMaxWords);
  std::vector<std::uint8_t> out;
  const auto put = [&out](std::size_t word) {
    out.push_back(static_cast<std::uint8_t>(word));
    out.push_back(static_cast<std::uint8_t>(word >> 8));
  };
  put(kKey);
  for (std::size_t i = 0; i < kReservedWords; ++i) put(0);
  for (const std::size_t word :
       {std::size_t{0x003F}, std::size_t{0x8002}, words, std::size_t{0x003F}, std::size_t{0x8002}})
    put(word);
  for (std::size_t i = 0; i < words; ++i) put((0x1234 + 0x4444 * i) & 0xFFFF);  // every byte value occurs
  put(0);
  return out;
}

}  // namespace drivers::falcon
