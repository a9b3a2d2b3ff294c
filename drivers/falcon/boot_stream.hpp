#pragma once
/// @file boot_stream.hpp
/// The format of a Falcon firmware file: the stream that the boot ROM of TI's C28x processors reads from its serial
/// port. 16-bit words, low byte first: 0x08AA, eight reserved words, the entry address (high word first), then blocks
/// {size in words, destination (high word first), data}; a size of 0 ends it. Source: TI SPRU095 and its successors.
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "rtbus/result.hpp"

namespace drivers::falcon {

/// Reads a boot stream byte by byte, as the processor does.
class BootStreamReader {
 public:
  enum class State : std::uint8_t {
    kReading,
    kComplete,   ///< The byte that ended the stream has been read.
    kMalformed,  ///< See problem(). Further bytes change nothing.
  };

  State feed(std::uint8_t byte) noexcept;

  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] const char* problem() const noexcept { return problem_; }  ///< "" unless malformed.
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }      ///< Read so far.
  [[nodiscard]] std::size_t blocks() const noexcept { return blocks_; }
  [[nodiscard]] std::uint32_t entry() const noexcept { return entry_; }

 private:
  void take_word(std::uint16_t word) noexcept;
  void fail(const char* problem) noexcept;

  State state_ = State::kReading;
  const char* problem_ = "";
  std::size_t bytes_ = 0;
  std::uint8_t low_byte_ = 0;
  std::size_t header_words_ = 0;
  std::uint32_t entry_ = 0;
  std::size_t blocks_ = 0;
  int address_words_left_ = 0;  ///< Of the block's destination.
  std::size_t data_words_left_ = 0;
};

/// Whether the bytes are one boot stream from the first to the last; else what is wrong, and at which byte.
[[nodiscard]] rtbus::Result<BootStreamReader, std::string> check_boot_stream(std::span<const std::uint8_t> bytes);

/// A boot stream of about `bytes` bytes (at least 34) with made-up content, for virtual devices and tests. It does
/// nothing on a real Falcon: its entry is 0x3F8002 and its data a fixed pattern.
[[nodiscard]] std::vector<std::uint8_t> synthetic_boot_stream(std::size_t bytes);

}  // namespace drivers::falcon
