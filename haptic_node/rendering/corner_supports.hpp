#pragma once
/// @file corner_supports.hpp
/// What a box, a hull, or a cylinder that stands is on where the scene tells its shape and what holds it: its corners,
/// or four points of its rim, on the faces of that, or the corners of that on its own face. Frame W, SI units.
#include <array>
#include <cstddef>
#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "haptic_node/rendering/body_motion.hpp"
#include "haptic_node/rendering/support.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/shapes/face_points.hpp"
#include "rtbus/shapes/hull_points.hpp"
#include "rtbus/shapes/known_shape.hpp"

namespace haptic {

/// So many rows of the pool for each face as it may have corners. A corner that is not there is far from it.
/// @realtime Yes.
class CornerSupports {
 public:
  /// Of a face.
  static constexpr std::size_t kCorners = rtbus::shapes::FacePoints::kMost;

  /// @param shape Of the body; nullptr: nobody knows it. @param origin_B_m Of a hull's frame, from the centre.
  void be(const rtbus::shapes::KnownShape* shape, const Eigen::Vector3d& origin_B_m) noexcept;

  [[nodiscard]] bool lies() const noexcept { return lies_; }
  /// Whether no face holds it at three corners: it may tip.
  [[nodiscard]] bool leans(const SupportPool& supports) const noexcept RTBUS_NONBLOCKING;
  /// Sine of the angle by which a cylinder tilts on what it stood on; 0: it is none.
  [[nodiscard]] double rim_tilt(const Eigen::Quaterniond& q_WB) const noexcept;

  void leave() noexcept { lies_ = false; }
  /// Leaves. @returns its rows in `old`, the pool before this answer, if it lay there.
  std::span<const Support> leave(const SupportPool& old) noexcept RTBUS_NONBLOCKING;

  /// Puts corners in the place of what an answer tells: the last rows of the pool, from `first` on.
  /// @param before What leave() gave: each corner begins with what it bore.
  /// @returns false, and changes no row, where a shape is not known, or the pool has no room.
  bool lie_down(const ToldBody& body, const SinceAnswer& since, const BodyMotion& motion,
                std::span<const Support> before, std::size_t first, SupportPool& supports) noexcept RTBUS_NONBLOCKING;

  /// What holds it and moves is where `*motion_of(slot)` has it; nullptr: where it was, nothing free is there any more.
  template <class MotionOf>
  void place_holders(const MotionOf& motion_of) noexcept {
    for (std::size_t i = 0; lies_ && i < face_count_; ++i) {
      if (faces_[i].holder == Support::kStands) continue;
      const BodyMotion* const motion = motion_of(faces_[i].holder);
      if (motion == nullptr) continue;
      faces_[i].moves.q_WB = motion->q_WB;
      faces_[i].moves.p_WB = motion->centre_m;
    }
  }

  /// The corners of all faces, where the body is now.
  void find(const Eigen::Vector3d& centre_m, const Eigen::Quaterniond& q_WB,
            SupportPool& supports) const noexcept RTBUS_NONBLOCKING;

 private:
  static constexpr double kOneFace = 0.995;  ///< Parts of a mesh whose normals are nearer (a cosine) are one.
  struct Face {
    const rtbus::shapes::PlacedShape* stands = nullptr;  ///< What holds; nullptr: a body that moves …
    int holder = Support::kStands;                       ///< … in that slot of the local world; kStands: a mesh …
    rtbus::shapes::PlacedShape moves{};                  ///< … which is there.
    Eigen::Vector3d normal = Eigen::Vector3d::UnitY();   ///< As it was found: a hull that leaves it takes no other.
    std::array<double, kCorners> rest_gap_m{};           ///< Where physics has each row touch.

    [[nodiscard]] const rtbus::shapes::PlacedShape& placed() const noexcept { return stands ? *stands : moves; }
    [[nodiscard]] bool is_of(const Face& other) const noexcept {
      const bool mesh = stands == nullptr && holder == Support::kStands;
      return stands == other.stands && holder == other.holder && (!mesh || normal.dot(other.normal) > kOneFace);
    }
  };
  static constexpr std::size_t kFaces = 4;

  bool stands_upright(const BodyMotion& motion, std::size_t first, const SupportPool& supports) noexcept;
  bool find_holder(const ToldBody& body, const SinceAnswer& since, const BodyMotion& motion, const Support& told,
                   Face& face, rtbus::shapes::FacePoints& corners) const noexcept;
  bool find_mesh(const SinceAnswer& since, const BodyMotion& motion, const Support& told, Face& face,
                 rtbus::shapes::FacePoints& corners) const noexcept;
  bool place_holder(const ToldBody& body, const SinceAnswer& since, std::size_t row, Face& face) const noexcept;
  void add_near_bodies(const ToldBody& body, const SinceAnswer& since, const BodyMotion& motion, std::size_t most_faces,
                       std::span<Support, kFaces> held, std::span<rtbus::shapes::FacePoints, kFaces> found) noexcept;
  /// Of the body, on what holds it. @param way A hull's face of that looks there; nullptr: to the body's centre.
  /// @returns whether they are known: what holds is a plane or a box, and no corner of a hull is beyond its edges.
  bool corners_on(const rtbus::shapes::PlacedShape& holder, const Eigen::Vector3d& centre_m,
                  const Eigen::Quaterniond& q_WB, rtbus::shapes::FacePoints& out,
                  const Eigen::Vector3d* way = nullptr) const noexcept;
  void add_walls(const SinceAnswer& since, const BodyMotion& motion, double friction, std::size_t most_faces,
                 std::span<Support, kFaces> held, std::span<rtbus::shapes::FacePoints, kFaces> found) noexcept;
  void lie_on(std::size_t face, const Support& told, const rtbus::shapes::FacePoints& corners,
              std::span<const Support> bore, const Eigen::Vector3d& centre_m, double tick_s, bool tilts,
              SupportPool& supports) noexcept;
  void put(std::size_t face, const rtbus::shapes::FacePoints& corners, const Eigen::Vector3d& centre_m,
           SupportPool& supports) const noexcept;

  const rtbus::shapes::Box* box_ = nullptr;
  const rtbus::shapes::Hull* hull_ = nullptr;
  const rtbus::shapes::Cylinder* cylinder_ = nullptr;
  Eigen::Vector3d tips_B_ = Eigen::Vector3d::Zero();  ///< Where a cylinder would tip: there it bears the most.
  Eigen::Vector3d origin_B_m_ = Eigen::Vector3d::Zero();
  bool lies_ = false;
  std::size_t first_ = 0;  ///< Of its rows in the pool.
  std::array<Face, kFaces> faces_{};
  std::size_t face_count_ = 0;
};

}  // namespace haptic
