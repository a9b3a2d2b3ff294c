#pragma once
/// @file ladder_share.hpp
/// What easing and safety ladder add to the contact impulses of a body. SI units.
#include <algorithm>

#include "haptic_node/rendering/impulse_history.hpp"

namespace haptic {

/// A step knows its share only when it is over, so that the body gets it in the next one. What has lasted for two steps
/// is expected in the third as well. Otherwise a body that was just re-simulated would get, in the step after that, all
/// that the spring has, though the ladder lets little of it through. One thread. @realtime Everything.
class LadderShare {
 public:
  /// In a step: once more of it.
  void add(const Impulse& more) noexcept { last_ += more; }
  /// For the next step: what is expected in it, and what was not expected in the last one.
  [[nodiscard]] Impulse due() const noexcept {
    Impulse out = last_ - expected_;
    return out += expects();
  }
  /// The body has got what was due.
  void step() noexcept {
    expected_ = expects();
    before_ = last_;
    last_ = Impulse{};
  }
  /// The body was re-simulated with all that there has been so far.
  void replayed() noexcept { expected_ = last_; }

 private:
  /// As much of the last share as the one before had of it.
  [[nodiscard]] Impulse expects() const noexcept {
    const double size = last_.linear_n_s.squaredNorm();
    const double part = size > 0.0 ? std::clamp(before_.linear_n_s.dot(last_.linear_n_s) / size, 0.0, 1.0) : 0.0;
    return {part * last_.linear_n_s, part * last_.angular_n_m_s};
  }

  Impulse last_, before_, expected_;
};

}  // namespace haptic
