#pragma once
/// @file recorded_bodies.hpp
/// Bodies and soft nodes of a recording at an instant, between the two frames around it.
#include <cstdint>
#include <string>
#include <vector>

#include "physics_node/engine/world.hpp"
#include "rtbus/messages.hpp"
#include "tools/view/recorded_track.hpp"

namespace view {

/// One thread.
class RecordedBodies {
 public:
  /// @param recording Outlives this. @param notes Gets sentences about what cannot be shown.
  RecordedBodies(const rtbus::recording::Recording& recording, std::vector<std::string>& notes);

  [[nodiscard]] bool any_poses() const noexcept { return !poses_.starts.empty(); }

  /// @returns false where none were recorded; `out` is then as it was.
  [[nodiscard]] bool poses_at(std::uint64_t time_ns, std::vector<physics::BodyPose>& out, double& simulated_s);
  [[nodiscard]] bool nodes_at(std::uint64_t time_ns, std::vector<Eigen::Vector3d>& out);

 private:
  /// A frame is several rows, the first of which has 0 in `first_body` or `first_node`.
  template <class T>
  struct Frames {
    RecordedTrack<T> track;
    std::vector<std::size_t> starts;  ///< Their first rows; complete frames only.
    std::size_t rows = 1;             ///< Of one frame.

    /// Number of the last frame that is not after `time_ns`; SIZE_MAX: none.
    [[nodiscard]] std::size_t before(std::uint64_t time_ns) const;
    [[nodiscard]] bool read(std::size_t frame, std::vector<rtbus::Stamped<T>>& out);
    /// The frames before and after, and how far between them the instant is, 0…1. One frame twice at the ends.
    [[nodiscard]] bool around(std::uint64_t time_ns, double& between);
    std::vector<rtbus::Stamped<T>> first, second;  ///< Of around().
    std::size_t first_is = SIZE_MAX, second_is = SIZE_MAX;
  };
  template <class T>
  static void find_frames(Frames<T>& frames, const char* first_field, const char* all_field, std::size_t items);

  Frames<rtbus::BodyPoses> poses_;
  Frames<rtbus::SoftNodes> nodes_;
};

}  // namespace view
