#include "drivers/falcon/falcon_frame.hpp"

#include <algorithm>

namespace drivers::falcon {
namespace {

constexpr std::uint8_t kZero = 'A';
constexpr std::size_t kFlagByte = 13;
constexpr std::size_t kUnusedByte = 14;

FrameBytes encode(const std::array<std::int16_t, 3>& numbers, std::uint8_t flags) noexcept {
  FrameBytes out{};
  out.front() = kFrameBegin;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto number = static_cast<std::uint16_t>(numbers[i]);
    for (std::size_t nibble = 0; nibble < 4; ++nibble) {
      out[1 + 4 * i + nibble] = static_cast<std::uint8_t>(kZero + ((number >> (4 * nibble)) & 0xFU));
    }
  }
  out[kFlagByte] = static_cast<std::uint8_t>(kZero + flags);
  out[kUnusedByte] = kZero;
  out.back() = kFrameEnd;
  return out;
}

bool decode(std::span<const std::uint8_t, kFrameBytes> bytes, std::uint8_t max_flags,
            std::array<std::int16_t, 3>& numbers, std::uint8_t& flags) noexcept {
  if (bytes[0] != kFrameBegin || bytes[kFrameBytes - 1] != kFrameEnd) return false;
  std::array<std::int16_t, 3> found{};
  for (std::size_t i = 0; i < 3; ++i) {
    unsigned number = 0;
    for (std::size_t nibble = 0; nibble < 4; ++nibble) {
      const unsigned digit = static_cast<unsigned>(bytes[1 + 4 * i + nibble]) - kZero;  // wraps below 'A'
      if (digit > 0xFU) return false;
      number |= digit << (4 * nibble);
    }
    found[i] = static_cast<std::int16_t>(static_cast<std::uint16_t>(number));
  }
  const unsigned found_flags = static_cast<unsigned>(bytes[kFlagByte]) - kZero;
  if (found_flags > max_flags) return false;
  const std::uint8_t unused = bytes[kUnusedByte];  // its meaning is not known: anything but the marks
  if (unused == kFrameBegin || unused == kFrameEnd) return false;
  numbers = found;
  flags = static_cast<std::uint8_t>(found_flags);
  return true;
}

}  // namespace

FrameBytes encode(const HostFrame& frame) noexcept { return encode(frame.motor, frame.flags & 0x0FU); }

FrameBytes encode(const DeviceFrame& frame) noexcept {
  return encode(frame.encoder, static_cast<std::uint8_t>((frame.buttons & 0x0FU) | ((frame.homed & 0x07U) << 4)));
}

bool decode(std::span<const std::uint8_t, kFrameBytes> bytes, HostFrame& out) noexcept {
  return decode(bytes, 0x0F, out.motor, out.flags);
}

bool decode(std::span<const std::uint8_t, kFrameBytes> bytes, DeviceFrame& out) noexcept {
  std::uint8_t flags = 0;
  if (!decode(bytes, 0x7F, out.encoder, flags)) return false;
  out.buttons = flags & 0x0FU;
  out.homed = static_cast<std::uint8_t>(flags >> 4);
  return true;
}

void FrameFinder::push(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() > kCapacity) {
    skip(size_);
    skipped_bytes_ += bytes.size() - kCapacity;
    bytes = bytes.last(kCapacity);
  }
  if (size_ + bytes.size() > kCapacity) skip(size_ + bytes.size() - kCapacity);
  std::copy(bytes.begin(), bytes.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(size_));
  size_ += bytes.size();
}

void FrameFinder::skip(std::size_t count) noexcept {
  if (count == 0) return;
  if (in_step_) ++resyncs_;
  in_step_ = false;
  skipped_bytes_ += count;
  std::copy(bytes_.begin() + static_cast<std::ptrdiff_t>(count), bytes_.begin() + static_cast<std::ptrdiff_t>(size_),
            bytes_.begin());
  size_ -= count;
}

bool FrameFinder::next(FrameBytes& out) noexcept {
  for (;;) {
    const auto begin = bytes_.begin();
    const auto end = begin + static_cast<std::ptrdiff_t>(size_);
    skip(static_cast<std::size_t>(std::find(begin, end, kFrameBegin) - begin));
    if (size_ == 0) return false;
    // A mark where none may be ends this candidate at once: a frame cut short does not swallow the next one.
    const std::size_t known = std::min(size_, kFrameBytes);
    std::size_t good = 1;
    while (good < known && bytes_[good] != kFrameBegin && (bytes_[good] == kFrameEnd) == (good == kFrameBytes - 1)) {
      ++good;
    }
    if (good < known) {
      skip(1);
      continue;
    }
    if (size_ < kFrameBytes) return false;
    std::copy_n(begin, kFrameBytes, out.begin());
    std::copy(begin + kFrameBytes, end, begin);
    size_ -= kFrameBytes;
    in_step_ = true;
    return true;
  }
}

}  // namespace drivers::falcon
