#pragma once
/// @file load_shares.hpp
/// What each corner of a contact bears of a load.
#include <array>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"
#include "rtbus/shapes/face_points.hpp"

namespace haptic {

/// Shares of a load at `at_m` [1]: none is negative, their sum is 1, and their centre is `at_m` as seen along the
/// normal if that lies between the corners. Of all such shares those with the least sum of squares, found by leaving
/// out one after the other the corner that would pull the most. @param corners At least one. @param at_m In W.
/// @realtime Yes.
[[nodiscard]] std::array<double, rtbus::shapes::FacePoints::kMost> load_shares(
    const rtbus::shapes::FacePoints& corners, const Eigen::Vector3d& at_m) noexcept RTBUS_NONBLOCKING;

}  // namespace haptic
