#pragma once
/// @file shape_messages.hpp
/// What the bodies of a world look like that is not in the scene file: an external engine tells it (rtbus_engine.h).
#include <array>
#include <cstdint>

#include "rtbus/messages.hpp"
#include "rtbus/sample.hpp"

namespace rtbus {

/// Sizes of BodyShapes. Planes, capsules and cylinders stand along y of their frame.
enum class ShapeKind : std::uint32_t {
  kPlane = 1,     ///< y = 0, the world below.
  kSphere = 2,    ///< size_m: radius.
  kBox = 3,       ///< size_m: half edges.
  kCapsule = 4,   ///< size_m: radius, length with both caps.
  kCylinder = 5,  ///< size_m: radius, length.
};

/// `physics.body_shapes`, once per change: the table of all shapes. A table of more than kShapes consists of several
/// samples in order. Where the bodies are is told by `physics.body_poses`.
struct BodyShapes {
  static constexpr std::uint32_t kShapes = 64;  ///< In one sample.
  std::uint64_t epoch = 0;                      ///< Of the table [ns, CLOCK_MONOTONIC]; a later table has a larger one.
  std::uint64_t hash =
      0;  ///< FNV-1a of all rows and of `bodies`: equal tables have equal hashes, also after a restart.
  std::uint32_t first_shape = 0;                   ///< Number in the table of this sample's first shape.
  std::uint32_t count = 0;                         ///< Shapes in this sample; the rest of the arrays is zero.
  std::uint32_t shapes = 0;                        ///< In the table.
  std::uint32_t bodies = 0;                        ///< Of the world, with and without shapes.
  std::array<std::uint32_t, kShapes> body{};       ///< That has the shape, as numbered in `physics.body_poses`.
  std::array<std::uint32_t, kShapes> body_kind{};  ///< 0 static, 1 kinematic, 2 dynamic.
  std::array<std::uint32_t, kShapes> shape{};      ///< ShapeKind.
  std::array<Vec3, kShapes> size_m{};
  std::array<Vec3, kShapes> position_m{};        ///< p_BS, in the axes of the body's pose.
  std::array<Quat, kShapes> orientation_wxyz{};  ///< q_BS.
};

template <>
struct SampleTraits<BodyShapes> {
  static constexpr std::string_view kName = "rtbus/BodyShapes";
  using T = BodyShapes;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{
      RTBUS_FIELD(T, epoch, "ns"), RTBUS_FIELD(T, hash, "1"),       RTBUS_FIELD(T, first_shape, "1"),
      RTBUS_FIELD(T, count, "1"),  RTBUS_FIELD(T, shapes, "1"),     RTBUS_FIELD(T, bodies, "1"),
      RTBUS_FIELD(T, body, "1"),   RTBUS_FIELD(T, body_kind, "1"),  RTBUS_FIELD(T, shape, "1"),
      RTBUS_FIELD(T, size_m, "m"), RTBUS_FIELD(T, position_m, "m"), RTBUS_FIELD(T, orientation_wxyz, "1")};
};
static_assert(sizeof(BodyShapes) == 5920 && Sample<BodyShapes>);

}  // namespace rtbus
