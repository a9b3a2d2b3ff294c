#pragma once
/// @file falcon_frame.hpp
/// The 16-byte frames between host and Falcon, and how to find them in a stream of bytes. A frame is `<`, three int16
/// as four nibble characters each (least significant first, 'A' = 0 … 'P' = 15), one flag character ('A' + flags), one
/// unused character, `>`. Sources: README.md, "frames".
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace drivers::falcon {

inline constexpr std::size_t kFrameBytes = 16;
inline constexpr std::uint8_t kFrameBegin = '<';
inline constexpr std::uint8_t kFrameEnd = '>';
inline constexpr int kMaxCommand = 4095;  ///< Largest meaningful motor command [count], both signs.

using FrameBytes = std::array<std::uint8_t, kFrameBytes>;

/// Flags of a host frame.
enum HostFlag : std::uint8_t { kHoming = 0x01, kGreenLed = 0x02, kBlueLed = 0x04, kRedLed = 0x08 };

/// Host → Falcon. Motors from the front: 1 top, then clockwise 2 right, 3 left.
struct HostFrame {
  std::array<std::int16_t, 3> motor{};  ///< Commands [count]; positive pulls the grip towards the body.
  std::uint8_t flags = 0;               ///< HostFlag.
};

/// Falcon → host.
struct DeviceFrame {
  std::array<std::int16_t, 3> encoder{};  ///< [count]
  std::uint8_t buttons = 0;               ///< Bits 0…3: plus (right), forward (top), centre, minus (left).
  std::uint8_t homed = 0;                 ///< Bit i: axis i + 1 has passed its reference.
};

inline constexpr std::uint8_t kAllHomed = 0x07;

[[nodiscard]] FrameBytes encode(const HostFrame& frame) noexcept;
[[nodiscard]] FrameBytes encode(const DeviceFrame& frame) noexcept;

/// False, and `out` untouched, unless the bytes are a whole well-formed frame.
[[nodiscard]] bool decode(std::span<const std::uint8_t, kFrameBytes> bytes, HostFrame& out) noexcept;
[[nodiscard]] bool decode(std::span<const std::uint8_t, kFrameBytes> bytes, DeviceFrame& out) noexcept;

/// Finds frames in a stream that may begin anywhere, break anywhere and hold anything. Bytes that belong to no frame
/// are skipped one by one, so that one wrong byte costs at most the frame it stands in. One thread; no allocation.
class FrameFinder {
 public:
  /// Takes the next bytes of the stream. What is older than the last 256 bytes and was not asked for is dropped.
  void push(std::span<const std::uint8_t> bytes) noexcept;

  /// The next frame's bytes; false when more bytes are needed first. They begin with `<` and end with `>` and have
  /// neither in between; decode() may still refuse them.
  [[nodiscard]] bool next(FrameBytes& out) noexcept;

  void clear() noexcept { size_ = 0; }

  [[nodiscard]] std::uint64_t skipped_bytes() const noexcept { return skipped_bytes_; }
  /// Times that the frame boundary was lost and searched for.
  [[nodiscard]] std::uint64_t resyncs() const noexcept { return resyncs_; }

 private:
  void skip(std::size_t count) noexcept;

  static constexpr std::size_t kCapacity = 256;
  std::array<std::uint8_t, kCapacity> bytes_{};
  std::size_t size_ = 0;
  bool in_step_ = true;  ///< The last byte taken ended a frame, or the stream is new.
  std::uint64_t skipped_bytes_ = 0;
  std::uint64_t resyncs_ = 0;
};

}  // namespace drivers::falcon
