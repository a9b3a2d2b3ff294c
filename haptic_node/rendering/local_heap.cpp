#include "haptic_node/rendering/local_heap.hpp"

#include <algorithm>

namespace haptic {

using Eigen::Vector3d;

void LocalHeap::learn(const Vector3d& push_n, const Vector3d& speed_m_s, double hand_m_s) noexcept {
  push_n_ = push_n;
  speed_m_s_ = speed_m_s;
  const double lasting_m_s = std::max(kOwnSpeed_m_s, hand_m_s);
  if (const double speed = speed_m_s.norm(); speed > lasting_m_s) speed_m_s_ *= lasting_m_s / speed;
}

void LocalHeap::forget() noexcept {
  push_n_.setZero();
  speed_m_s_.setZero();
}

void LocalHeap::brake(double slower) noexcept {
  speed_m_s_ *= slower;
  mobility_m_s_n_ *= slower;
}

Vector3d LocalHeap::way_m(const Vector3d& impulse_n_s, double seconds) const noexcept {
  Vector3d way = mobility_m_s_n_ * impulse_n_s + seconds * free_m_s();
  const double size = push_n_.norm();
  if (size <= 0.0) return way;
  const Vector3d along = push_n_ / size;
  const double short_m = std::min(0.0, along.dot(speed_m_s_)) * seconds - along.dot(way);
  if (short_m > 0.0) way += short_m * along;
  return way;
}

}  // namespace haptic
