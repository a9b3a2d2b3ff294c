#pragma once
/// @file told_shapes.hpp
/// The world of an external engine, as it tells it on `physics.body_shapes`: it takes the place of the scene file's
/// bodies.
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "physics_node/engine/world.hpp"
#include "rtbus/config/scene.hpp"
#include "rtbus/shape_messages.hpp"
#include "rtbus/topic.hpp"

namespace tools {

struct ToldShapes {
  std::uint64_t hash = 0;
  std::size_t bodies = 0;                  ///< Of the engine's world.
  std::vector<rtbus::config::Body> shown;  ///< A body per shape, at the origin.
  std::vector<std::uint32_t> body_of;      ///< Likewise: which body of the engine has it …
  std::vector<physics::BodyPose> in_body;  ///< … and where in that body's frame it lies.

  /// Poses of the shapes by those of the engine's bodies. @pre As many as `bodies`.
  [[nodiscard]] std::vector<physics::BodyPose> placed(const std::vector<physics::BodyPose>& poses) const;
};

/// Puts complete tables together from the samples of the topic.
class ToldShapesTable {
 public:
  /// The samples in their order. @returns true when a table is complete and the world looks otherwise than before.
  bool take(const rtbus::BodyShapes& part);
  /// Another writer: its tables begin anew.
  void begin_anew() noexcept { parts_.clear(); }
  [[nodiscard]] const std::optional<ToldShapes>& told() const noexcept { return told_; }

 private:
  std::vector<rtbus::BodyShapes> parts_;
  std::optional<ToldShapes> told_;
};

/// The tables of a running session. One thread.
class ToldShapesReader {
 public:
  explicit ToldShapesReader(std::string session) { session_.name = std::move(session); }
  [[nodiscard]] const std::string& session() const noexcept { return session_.name; }

  /// Takes in what is new. @returns true when the world looks otherwise than before.
  bool follow();
  /// None: the engine tells nothing, its world is that of the scene file.
  [[nodiscard]] const std::optional<ToldShapes>& told() const noexcept { return table_.told(); }

 private:
  rtbus::Session session_;
  std::optional<rtbus::Reader<rtbus::BodyShapes>> reader_;
  ToldShapesTable table_;
};

}  // namespace tools
