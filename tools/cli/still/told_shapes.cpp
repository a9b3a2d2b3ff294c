#include "tools/cli/still/told_shapes.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "rtbus/eigen.hpp"

namespace tools {

namespace {

using rtbus::BodyShapes;
using rtbus::ShapeKind;
using rtbus::config::BodyShape;
using rtbus::config::BodyType;

/// None: a kind that this version does not know.
std::optional<BodyShape> shape_of(std::uint32_t kind, const rtbus::Vec3& size_m) {
  switch (static_cast<ShapeKind>(kind)) {
    case ShapeKind::kPlane:
      return rtbus::shapes::Plane{};
    case ShapeKind::kSphere:
      return rtbus::shapes::Sphere{size_m[0]};
    case ShapeKind::kBox:
      return rtbus::shapes::Box{rtbus::vector_of(size_m)};
    case ShapeKind::kCapsule:
      return rtbus::config::Capsule{size_m[0], size_m[1]};
    case ShapeKind::kCylinder:
      return rtbus::config::Cylinder{size_m[0], size_m[1]};
  }
  return std::nullopt;
}

BodyType type_of(std::uint32_t kind) {
  return kind == 0 ? BodyType::kStatic : kind == 1 ? BodyType::kKinematic : BodyType::kDynamic;
}

ToldShapes table_of(const std::vector<BodyShapes>& parts) {
  ToldShapes out;
  out.hash = parts.front().hash;
  out.bodies = parts.front().bodies;
  for (const BodyShapes& part : parts) {
    for (std::uint32_t i = 0; i < part.count; ++i) {
      auto shape = shape_of(part.shape[i], part.size_m[i]);
      if (!shape || part.body[i] >= out.bodies) continue;
      rtbus::config::Body body;
      body.name = "body " + std::to_string(part.body[i]);
      body.type = type_of(part.body_kind[i]);
      body.shape = std::move(*shape);
      out.shown.push_back(std::move(body));
      out.body_of.push_back(part.body[i]);
      out.in_body.push_back({rtbus::vector_of(part.position_m[i]), rtbus::quaternion_of(part.orientation_wxyz[i])});
    }
  }
  return out;
}

}  // namespace

std::vector<physics::BodyPose> ToldShapes::placed(const std::vector<physics::BodyPose>& poses) const {
  std::vector<physics::BodyPose> out;
  out.reserve(body_of.size());
  for (std::size_t i = 0; i < body_of.size(); ++i) {
    const physics::BodyPose& body = poses[body_of[i]];
    out.push_back(
        {body.position_m + body.orientation * in_body[i].position_m, body.orientation * in_body[i].orientation});
  }
  return out;
}

bool ToldShapesTable::take(const BodyShapes& part) {
  std::size_t rows = 0;
  for (const BodyShapes& each : parts_) rows += each.count;
  if (part.first_shape == 0) {
    parts_.clear();
  } else if (parts_.empty() || part.epoch != parts_.front().epoch || part.first_shape != rows) {
    parts_.clear();  // a part was lost: the next table will be whole
    return false;
  }
  parts_.push_back(part);
  if (part.first_shape + part.count != part.shapes) return false;
  if (told_ && told_->hash == part.hash) return false;
  told_ = table_of(parts_);
  return true;
}

bool ToldShapesReader::follow() {
  if (!reader_ || reader_->replaced()) {
    reader_.reset();
    auto opened = rtbus::Reader<BodyShapes>::open(session_, "physics.body_shapes", {.from_oldest = true});
    if (opened) {
      reader_.emplace(std::move(*opened));
      table_.begin_anew();
    }
  }
  bool fresh = false;
  rtbus::Stamped<BodyShapes> sample;
  while (reader_ && reader_->read_next(sample) == rtbus::ReadStatus::kFresh) fresh = table_.take(sample.value) || fresh;
  return fresh;
}

}  // namespace tools
