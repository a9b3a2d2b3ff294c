#pragma once
/// @file protocol.hpp
/// The binary messages to the page, little-endian; docs/viewer-protocol.md has the bytes. Pure.
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tools/view/frame_source.hpp"

namespace view {

inline constexpr std::uint32_t kFrameMagic = 0x31564252;  ///< "RBV1"
inline constexpr std::uint32_t kMeshMagic = 0x314d4252;   ///< "RBM1"
inline constexpr std::uint16_t kProtocol = 1;
inline constexpr std::size_t kHeaderBytes = 64, kBodyBytes = 28, kNodeBytes = 12, kContactBytes = 32, kHandBytes = 64,
                             kTickBytes = 4 * (1 + kTickFloats);
/// Ticks of one hand in one message; a page that lags behind gets the rest with the next.
inline constexpr std::size_t kTicksPerFrame = 8192;
/// Larger meshes are shown as boxes.
inline constexpr std::size_t kMostTriangles = 200'000;

/// What one page has got.
struct FrameCursor {
  std::uint64_t number = 0;
  std::uint64_t poses = 0;
  std::vector<std::uint64_t> ticks;  ///< Of each hand: number of the next one.
};

/// Bytes of a message after room for what the server writes before it.
using Message = std::vector<unsigned char>;
inline constexpr std::size_t kMessageRoom = 64;

/// All of `frame` that is newer than `cursor`, which moves on.
/// @param now_s The clock of the frame's times. @param sent The number that the page acknowledges.
[[nodiscard]] Message encode_frame(const ViewScene& scene, const ViewFrame& frame, double now_s, std::uint64_t sent,
                                   FrameCursor& cursor);

/// Mesh `index` of the scene.
[[nodiscard]] Message encode_mesh(const ViewScene& scene, std::size_t index);

}  // namespace view
