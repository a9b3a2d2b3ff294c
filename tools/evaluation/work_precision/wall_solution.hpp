#pragma once
/// @file wall_solution.hpp
/// The exact motion of a device against a spring-damper wall: the reference that every rendering method is measured
/// against (`rtbus evaluate work-precision`). One dimension, y up, wall at y = 0, time since the release.
///
///     (m + m_h) y'' = −m g − b y' − f_c sgn(y') + F + K_h (y_h − y) + B_h (y_h' − y')
///     F = K(−y) − B y'  where y < 0 and this is positive, else 0           (what `direct` renders, without sampling)
///
/// Between two events (contact made or broken, the motion reverses, sticks or slips, the hand's script turns a page)
/// this is a linear equation with constant coefficients and a polynomial on the right: its solution is written down,
/// not integrated. Events are found to 1e-13 s. At y' = 0 dry friction holds whatever is below f_c.
#include <array>
#include <complex>
#include <vector>

namespace tools {

struct WallParameters {
  double mass_kg = 0.041;               ///< Of the tip; gravity acts on it.
  double viscous_n_s_per_m = 0.05;      ///< b.
  double coulomb_n = 0.06;              ///< f_c.
  double gravity_m_s2 = 9.81;           ///< Downwards.
  double stiffness_n_per_m = 200.0;     ///< K of the wall.
  double damping_n_s_per_m = 0.0;       ///< B of the wall.
  double hand_stiffness_n_per_m = 0.0;  ///< K_h; with all three 0 nobody holds the tip.
  double hand_damping_n_s_per_m = 0.0;  ///< B_h.
  double hand_mass_kg = 0.0;            ///< m_h; its weight is carried by the arm.
};

/// Σ c[i]·tⁱ.
using Quartic = std::array<double, 5>;

/// One page of the hand's script: where it wants to be from `begin_s` on.
struct HandPage {
  double begin_s = 0.0;
  Quartic position_m{};  ///< In the time since begin_s.
};

/// The script of a hand that rests at `start_m`, moves by `way_m` (signed) at `speed_m_s` > 0 with smoothstep ramps of
/// `ramp_s`, and rests: drivers::simulated::PushMotion in one dimension, beginning at time 0. The way must be long
/// enough for both ramps.
[[nodiscard]] std::vector<HandPage> push_pages(double start_m, double way_m, double speed_m_s, double ramp_s);

struct WallMoment {
  double height_m = 0.0;
  double velocity_m_s = 0.0;
  double force_n = 0.0;  ///< Of the wall, upwards.
};

/// Built once, then asked at any time in its span. Not realtime.
class WallSolution {
 public:
  /// From rest at `start_m` at time 0. @param hand In order of time, the first one at 0 or earlier; ignored when nobody
  /// holds the tip.
  WallSolution(const WallParameters& parameters, double start_m, const std::vector<HandPage>& hand, double end_s);

  /// @param time_s Clamped to 0…end_s.
  [[nodiscard]] WallMoment at(double time_s) const;

  /// Number of events between the pieces.
  [[nodiscard]] std::size_t events() const noexcept { return pieces_.size() - 1; }

 private:
  enum class Motion { kUp, kDown, kStuck };
  /// y(t) = Re(a e^{λ₁t} + b e^{λ₂t}) + polynomial, t since begin_s; stuck: y is constant.
  struct Piece {
    double begin_s = 0.0;
    Motion motion = Motion::kStuck;
    bool contact = false;
    std::complex<double> lambda[2], weight[2];
    std::array<double, 7> polynomial{};
    double stuck_m = 0.0;
    Quartic push_n{};  ///< Everything that does not depend on the motion, friction excepted.
  };
  [[nodiscard]] Piece begin_piece(double begin_s, double y, double v, bool contact, const HandPage* page) const;
  [[nodiscard]] bool contact_changes(const Piece& piece, const WallMoment& now) const;
  [[nodiscard]] bool turns(const Piece& piece, const WallMoment& now) const;
  void solve(Piece& piece, double y, double v, double stiffness, double damping) const;
  [[nodiscard]] WallMoment moment(const Piece& piece, double since_s) const;
  [[nodiscard]] double net_at_rest(const Piece& piece, double since_s) const;
  [[nodiscard]] bool ends(const Piece& piece, double since_s) const;
  [[nodiscard]] bool held() const noexcept {
    return p_.hand_stiffness_n_per_m > 0.0 || p_.hand_damping_n_s_per_m > 0.0 || p_.hand_mass_kg > 0.0;
  }

  WallParameters p_;
  double end_s_;
  std::vector<Piece> pieces_;
};

}  // namespace tools
