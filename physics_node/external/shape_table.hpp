#pragma once
/// @file shape_table.hpp
/// What the bodies of an external engine look like, for observers: `physics.body_shapes`.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/publication.hpp"
#include "rtbus/shape_messages.hpp"

namespace physics {

struct ToldShape {
  std::uint32_t body = 0;
  rtbus::ShapeKind kind = rtbus::ShapeKind::kPlane;
  rtbus::Vec3 size_m{}, position_m{};
  rtbus::Quat orientation_wxyz{1.0, 0.0, 0.0, 0.0};
};

/// One thread: the engine's. Without shapes there is no topic.
class ShapeTable {
 public:
  static constexpr std::size_t kMost = 1024;

  /// @returns false when there are kMost already.
  [[nodiscard]] bool add(const ToldShape& shape);
  void clear();

  /// Publishes the table when it has changed. @param kind_of A body's kind: 0 static, 1 kinematic, 2 dynamic.
  /// @returns what is wrong with the topic; empty: nothing.
  template <class KindOf>
  [[nodiscard]] std::string publish_if_changed(const rtbus::Session& session, std::size_t bodies,
                                               const KindOf& kind_of) {
    look_after();
    if (!changed_) return "";
    kinds_.clear();
    for (const ToldShape& shape : shapes_) kinds_.push_back(kind_of(shape.body));
    return publish(session, static_cast<std::uint32_t>(bodies));
  }

 private:
  /// Makes the topic anew when somebody deleted it; five times a second.
  void look_after();
  [[nodiscard]] std::string publish(const rtbus::Session& session, std::uint32_t bodies);

  std::vector<ToldShape> shapes_;
  std::vector<std::uint32_t> kinds_;  ///< Of the bodies of shapes_.
  bool changed_ = false;
  std::uint64_t epoch_ = 0, looked_ns_ = 0;
  std::optional<rtbus::Publication<rtbus::BodyShapes>> writer_;
};

}  // namespace physics
