#include "tools/view/recorded_bodies.hpp"

#include <algorithm>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace view {

namespace {

/// Frames farther apart than this are not joined: nobody looked meanwhile, or the node was started again.
constexpr std::uint64_t kFarthest_ns = 500 * rtbus::kNsPerMs;

}  // namespace

RecordedBodies::RecordedBodies(const rtbus::recording::Recording& recording, std::vector<std::string>& notes)
    : poses_{{recording, "physics.body_poses", notes}, {}, 1, {}, {}, SIZE_MAX, SIZE_MAX},
      nodes_{{recording, "physics.soft_nodes", notes}, {}, 1, {}, {}, SIZE_MAX, SIZE_MAX} {
  find_frames(poses_, "first_body", "bodies", rtbus::BodyPoses::kBodies);
  find_frames(nodes_, "first_node", "nodes", rtbus::SoftNodes::kNodes);
}

template <class T>
void RecordedBodies::find_frames(Frames<T>& frames, const char* first_field, const char* all_field, std::size_t items) {
  const std::vector<std::uint64_t> first = frames.track.integers(first_field), all = frames.track.integers(all_field),
                                   frame = frames.track.integers("frame");
  if (frame.empty() || first.size() != frame.size() || all.size() != frame.size()) return;
  frames.rows = std::max<std::size_t>(1, (all.front() + items - 1) / items);
  for (std::size_t i = 0; i + frames.rows <= frame.size(); ++i) {
    if (first[i] == 0 && all[i] == all.front() && frame[i + frames.rows - 1] == frame[i]) frames.starts.push_back(i);
  }
}

template <class T>
std::size_t RecordedBodies::Frames<T>::before(std::uint64_t time_ns) const {
  const auto after =
      std::upper_bound(starts.begin(), starts.end(), time_ns,
                       [this](std::uint64_t time, std::size_t row) { return time < track.stamp_ns(row); });
  return after == starts.begin() ? SIZE_MAX : static_cast<std::size_t>(after - starts.begin()) - 1;
}

template <class T>
bool RecordedBodies::Frames<T>::read(std::size_t frame, std::vector<rtbus::Stamped<T>>& out) {
  out.resize(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    if (!track.read(starts[frame] + i, out[i])) return false;
  }
  return true;
}

template <class T>
bool RecordedBodies::Frames<T>::around(std::uint64_t time_ns, double& between) {
  if (starts.empty()) return false;
  std::size_t at = before(time_ns);
  if (at == SIZE_MAX) at = 0;
  const std::size_t next = std::min(at + 1, starts.size() - 1);
  if (first_is != at && !read(first_is = at, first)) return first_is = SIZE_MAX, false;
  if (second_is != next && !read(second_is = next, second)) return second_is = SIZE_MAX, false;
  const std::uint64_t from_ns = first.front().stamp_ns, to_ns = second.front().stamp_ns;
  between = 0.0;
  if (to_ns > from_ns && to_ns - from_ns < kFarthest_ns && time_ns > from_ns) {
    between = std::min(1.0, static_cast<double>(time_ns - from_ns) / static_cast<double>(to_ns - from_ns));
  }
  return true;
}

bool RecordedBodies::poses_at(std::uint64_t time_ns, std::vector<physics::BodyPose>& out, double& simulated_s) {
  double between = 0.0;
  if (!poses_.around(time_ns, between)) return false;
  const auto& a = poses_.first;
  const auto& b = poses_.second;
  simulated_s = a.front().value.simulated_s + between * (b.front().value.simulated_s - a.front().value.simulated_s);
  out.clear();
  for (std::size_t row = 0; row < a.size(); ++row) {
    for (std::size_t i = 0; i < a[row].value.count; ++i) {
      const Eigen::Vector3d from = rtbus::vector_of(a[row].value.position_m[i]),
                            to = rtbus::vector_of(b[row].value.position_m[i]);
      out.push_back(
          {from + between * (to - from), rtbus::quaternion_of(a[row].value.orientation_wxyz[i])
                                             .slerp(between, rtbus::quaternion_of(b[row].value.orientation_wxyz[i]))});
    }
  }
  return true;
}

bool RecordedBodies::nodes_at(std::uint64_t time_ns, std::vector<Eigen::Vector3d>& out) {
  double between = 0.0;
  if (!nodes_.around(time_ns, between)) return false;
  out.clear();
  for (std::size_t row = 0; row < nodes_.first.size(); ++row) {
    const rtbus::SoftNodes &a = nodes_.first[row].value, &b = nodes_.second[row].value;
    for (std::size_t i = 0; i < a.count; ++i) {
      Eigen::Vector3d at;
      for (std::size_t k = 0; k < 3; ++k) {
        at[static_cast<Eigen::Index>(k)] =
            1e-6 * (a.position_um[i][k] + between * (b.position_um[i][k] - a.position_um[i][k]));
      }
      out.push_back(at);
    }
  }
  return true;
}

}  // namespace view
