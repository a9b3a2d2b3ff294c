#include "physics_node/external/shape_table.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "rtbus/clock.hpp"

namespace physics {

namespace {

/// Two whole tables, so that a reader of one is not lapped by the next.
constexpr std::uint32_t kCapacity = 2 * ShapeTable::kMost / rtbus::BodyShapes::kShapes;

std::uint64_t fnv1a(std::uint64_t hash, const void* data, std::size_t bytes) {
  const auto* const first = static_cast<const unsigned char*>(data);
  for (std::size_t i = 0; i < bytes; ++i) hash = (hash ^ first[i]) * 0x100000001b3;
  return hash;
}

}  // namespace

bool ShapeTable::add(const ToldShape& shape) {
  if (shapes_.size() == kMost) return false;
  shapes_.push_back(shape);
  changed_ = true;
  return true;
}

void ShapeTable::clear() {
  changed_ = changed_ || !shapes_.empty();
  shapes_.clear();
}

void ShapeTable::look_after() {
  if (!writer_ || rtbus::monotonic_ns() < looked_ns_ + 200 * rtbus::kNsPerMs) return;
  looked_ns_ = rtbus::monotonic_ns();
  writer_->maintain();
}

std::string ShapeTable::publish(const rtbus::Session& session, std::uint32_t bodies) {
  if (!writer_) {
    auto made = rtbus::Publication<rtbus::BodyShapes>::create(session, "physics.body_shapes", {.capacity = kCapacity});
    if (!made) return "topic physics.body_shapes: " + std::string(rtbus::to_string(made.error()));
    writer_.emplace(std::move(*made));
  }
  changed_ = false;
  epoch_ = std::max(epoch_ + 1, rtbus::monotonic_ns());
  std::uint64_t hash = fnv1a(0xcbf29ce484222325, &bodies, sizeof bodies);
  std::vector<rtbus::BodyShapes> parts;
  for (std::size_t i = 0; i < shapes_.size() || parts.empty(); i += rtbus::BodyShapes::kShapes) {
    rtbus::BodyShapes part;
    part.epoch = epoch_;
    part.first_shape = static_cast<std::uint32_t>(i);
    part.shapes = static_cast<std::uint32_t>(shapes_.size());
    part.count = std::min(rtbus::BodyShapes::kShapes, part.shapes - part.first_shape);
    part.bodies = bodies;
    for (std::uint32_t row = 0; row < part.count; ++row) {
      const ToldShape& shape = shapes_[i + row];
      part.body[row] = shape.body;
      part.body_kind[row] = kinds_[i + row];
      part.shape[row] = static_cast<std::uint32_t>(shape.kind);
      part.size_m[row] = shape.size_m;
      part.position_m[row] = shape.position_m;
      part.orientation_wxyz[row] = shape.orientation_wxyz;
    }
    // From the first row on: not the epoch, which differs after a restart.
    hash = fnv1a(hash, &part.body, sizeof part - offsetof(rtbus::BodyShapes, body));
    parts.push_back(part);
  }
  for (rtbus::BodyShapes& part : parts) {
    part.hash = hash;
    writer_->publish(part, epoch_);
  }
  return "";
}

}  // namespace physics
