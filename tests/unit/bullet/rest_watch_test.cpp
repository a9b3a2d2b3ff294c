/// When hands and bodies count as at rest.
#include "physics_node/bullet/rest_watch.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace {

using physics::bullet::RestWatch;

/// The least and the largest share of rest.
struct Shares {
  double least = 1.0, most = 0.0;
};

/// A hand that rested for long goes at that speed for so long. The shares are those of the second half.
Shares shares_of(double speed_m_s, double seconds) {
  constexpr double kStep_s = 1e-3;
  RestWatch watch;
  Shares out;
  double x_m = 0.0;
  const auto step = [&] {
    watch.begin();
    watch.see({x_m, 0, 0});
    watch.end(kStep_s);
  };
  for (int i = 0; i < 2000; ++i) step();
  EXPECT_EQ(watch.share(), 1.0);
  const int steps = static_cast<int>(seconds / kStep_s);
  for (int i = 0; i < steps; ++i) {
    x_m += kStep_s * speed_m_s;
    step();
    if (i < steps / 2) continue;
    out.least = std::min(out.least, watch.share());
    out.most = std::max(out.most, watch.share());
  }
  return out;
}

TEST(RestWatch, WhatCreepsRestsHoweverFarItComes) {
  EXPECT_EQ(shares_of(0.5e-3, 20.0).least, 1.0);
  EXPECT_EQ(shares_of(5e-3, 20.0).most, 0.0);
}

TEST(RestWatch, WhatMovesByAMillimetreAtOnceDoesNotRest) {
  EXPECT_EQ(shares_of(0.9, 1e-3).least, 1.0);
  EXPECT_EQ(shares_of(1.1, 1e-3).most, 0.0);
}

TEST(RestWatch, ABodyThatComesOrGoesIsNoRest) {
  RestWatch watch;
  for (int i = 0; i < 2000; ++i) {
    watch.begin();
    watch.see({0, 0, 0});
    watch.end(1e-3);
  }
  watch.begin();
  watch.see({0, 0, 0});
  watch.see({1, 0, 0});
  watch.end(1e-3);
  EXPECT_EQ(watch.share(), 0.0);
}

}  // namespace
