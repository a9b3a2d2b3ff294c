#pragma once
/// @file hull.hpp
/// The convex hull of a few points, and its point nearest to a query that moves little from one call to the next.
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace rtbus::shapes {

/// Points whose hull is meant, in the body's frame [m]. Inner and repeated ones do no harm.
struct Hull {
  static constexpr std::size_t kMost = 256;  ///< Each is looked at in each query: about 0.3 µs.
  std::vector<Eigen::Vector3d> points_m;
};

/// The feature that was nearest in the last query: the points that span it. A hint, never wrong.
struct NearestFeature {
  std::array<std::uint32_t, 4> points{};
  std::uint32_t count = 0;
};

/// The point of the hull nearest to `p`, by P. Wolfe, "Finding the nearest point in a polytope", Math. Programming 11,
/// 1976: exact after finitely many steps, begun at `feature` and left there for the next call.
/// @returns false where `p` is inside, on the surface (nearer than 1e-12 of the hull's size), or the hull is empty;
/// then `out_m` is unchanged. @realtime Yes: bounded, no allocation.
[[nodiscard]] bool nearest_point(const Hull& hull, const Eigen::Vector3d& p, NearestFeature& feature,
                                 Eigen::Vector3d& out_m) noexcept;

}  // namespace rtbus::shapes
