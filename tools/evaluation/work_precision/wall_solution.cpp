#include "tools/evaluation/work_precision/wall_solution.hpp"

#include <algorithm>
#include <cmath>

namespace tools {

namespace {

/// Events nearer to each other than this may be missed; a bounce takes milliseconds.
constexpr double kScan_s = 20e-6;
constexpr int kHalvings = 40;  // of kScan_s: 2e-17 s
/// Below this a speed at an event is the rounding of the zero that it is.
constexpr double kRest_m_s = 1e-11;

template <std::size_t N>
double value_of(const std::array<double, N>& c, double t) {
  double out = 0.0;
  for (std::size_t i = N; i-- > 0;) out = out * t + c[i];
  return out;
}

template <std::size_t N>
double slope_of(const std::array<double, N>& c, double t) {
  double out = 0.0;
  for (std::size_t i = N; i-- > 1;) out = out * t + static_cast<double>(i) * c[i];
  return out;
}

/// c(t + shift) as a polynomial in t.
Quartic shifted(const Quartic& c, double shift) {
  Quartic out{};
  for (std::size_t i = c.size(); i-- > 0;) {
    for (std::size_t j = c.size() - 1; j > 0; --j) out[j] = out[j] * shift + out[j - 1];
    out[0] = out[0] * shift + c[i];
  }
  return out;
}

}  // namespace

std::vector<HandPage> push_pages(double start_m, double way_m, double speed_m_s, double ramp_s) {
  const double v = std::copysign(speed_m_s, way_m);
  const double total_s = std::abs(way_m) / speed_m_s + ramp_s;
  // The integral of smoothstep is u³ − u⁴/2, u the time over the ramp's.
  const double r2 = ramp_s * ramp_s;
  std::vector<HandPage> pages;
  pages.push_back({0.0, {start_m, 0.0, 0.0, v / r2, -0.5 * v / (r2 * ramp_s)}});
  pages.push_back({ramp_s, {start_m + 0.5 * v * ramp_s, v, 0.0, 0.0, 0.0}});
  // The last ramp is the first one, backwards in time from the end.
  Quartic back{start_m + way_m, 0.0, 0.0, -v / r2, 0.5 * v / (r2 * ramp_s)};  // in u = time that is left
  back = shifted(back, ramp_s);                                               // … which begins at ramp_s
  for (std::size_t i = 1; i < back.size(); i += 2) back[i] = -back[i];        // … and runs backwards
  // Σ c (ramp − t)ⁱ = shifted by ramp in −t.
  pages.push_back({total_s - ramp_s, back});
  pages.push_back({total_s, {start_m + way_m, 0.0, 0.0, 0.0, 0.0}});
  return pages;
}

WallSolution::WallSolution(const WallParameters& parameters, double start_m, const std::vector<HandPage>& hand,
                           double end_s)
    : p_(parameters), end_s_(end_s) {
  std::size_t page = 0;
  double t = 0.0, y = start_m, v = 0.0;
  bool contact = y < 0.0;
  while (true) {
    while (held() && page + 1 < hand.size() && hand[page + 1].begin_s <= t + 1e-15) ++page;
    const double page_end_s = held() && page + 1 < hand.size() ? hand[page + 1].begin_s : end_s;
    const Piece piece = begin_piece(t, y, v, contact, held() && !hand.empty() ? &hand[page] : nullptr);
    pieces_.push_back(piece);
    // Coarse steps to the first one that is beyond an event, then halves.
    const double span_s = std::min(page_end_s, end_s) - t;
    double low = 0.0, high = span_s;
    bool found = false;
    for (double s = kScan_s; s < span_s + kScan_s && !found; s += kScan_s) {
      const double here = std::min(s, span_s);
      found = ends(piece, here);
      if (found) {
        high = here;
      } else {
        low = here;
      }
    }
    for (int i = 0; found && i < kHalvings; ++i) {
      const double middle = 0.5 * (low + high);
      (ends(piece, middle) ? high : low) = middle;
    }
    const WallMoment last = moment(piece, high);
    t += high;
    y = last.height_m;
    v = turns(piece, last) || std::abs(last.velocity_m_s) < kRest_m_s ? 0.0 : last.velocity_m_s;
    contact = piece.motion == Motion::kStuck ? y < 0.0 : piece.contact != contact_changes(piece, last);
    if (!found && t >= end_s - 1e-15) break;
  }
}

WallSolution::Piece WallSolution::begin_piece(double begin_s, double y, double v, bool contact,
                                              const HandPage* page) const {
  Piece piece;
  piece.begin_s = begin_s;
  piece.stuck_m = y;
  piece.push_n = {-p_.mass_kg * p_.gravity_m_s2, 0.0, 0.0, 0.0, 0.0};
  if (page != nullptr) {
    const Quartic target = shifted(page->position_m, begin_s - page->begin_s);
    for (std::size_t i = 0; i < target.size(); ++i) {
      piece.push_n[i] += p_.hand_stiffness_n_per_m * target[i];
      if (i + 1 < target.size())
        piece.push_n[i] += p_.hand_damping_n_s_per_m * static_cast<double>(i + 1) * target[i + 1];
    }
  }
  const double net = net_at_rest(piece, 0.0);
  if (v == 0.0 && std::abs(net) <= p_.coulomb_n * (1.0 + 1e-12)) {
    piece.motion = Motion::kStuck;
    return piece;
  }
  const bool up = v != 0.0 ? v > 0.0 : net > 0.0;
  piece.motion = up ? Motion::kUp : Motion::kDown;
  piece.contact = contact;
  const double stiffness = p_.hand_stiffness_n_per_m + (piece.contact ? p_.stiffness_n_per_m : 0.0);
  const double damping =
      p_.viscous_n_s_per_m + p_.hand_damping_n_s_per_m + (piece.contact ? p_.damping_n_s_per_m : 0.0);
  Piece moving = piece;
  moving.push_n[0] += up ? -p_.coulomb_n : p_.coulomb_n;
  solve(moving, y, v, stiffness, damping);
  moving.push_n = piece.push_n;
  return moving;
}

void WallSolution::solve(Piece& piece, double y, double v, double k, double c) const {
  const double m = p_.mass_kg + p_.hand_mass_kg;
  std::array<double, 7>& q = piece.polynomial;
  const Quartic& f = piece.push_n;
  if (k > 0.0) {
    for (std::size_t i = f.size(); i-- > 0;) {
      const double n = static_cast<double>(i);
      q[i] = (f[i] - c * (n + 1.0) * q[i + 1] - m * (n + 2.0) * (n + 1.0) * q[i + 2]) / k;
    }
  } else if (c > 0.0) {
    std::array<double, 6> speed{};
    for (std::size_t i = f.size(); i-- > 0;) speed[i] = (f[i] - m * static_cast<double>(i + 1) * speed[i + 1]) / c;
    for (std::size_t i = 0; i < f.size(); ++i) q[i + 1] = speed[i] / static_cast<double>(i + 1);
  } else {
    for (std::size_t i = 0; i < f.size(); ++i) q[i + 2] = f[i] / m / static_cast<double>((i + 1) * (i + 2));
  }
  const double y0 = y - q[0], v0 = v - q[1];
  if (k <= 0.0 && c <= 0.0) {
    q[0] += y0;
    q[1] += v0;
    return;
  }
  const std::complex<double> root = std::sqrt(std::complex<double>(c * c - 4.0 * m * k, 0.0));
  // The larger one first, the other from their product: no cancellation.
  piece.lambda[0] = -(c + root) / (2.0 * m);
  piece.lambda[1] = piece.lambda[0] == 0.0 ? 0.0 : (k / m) / piece.lambda[0];
  if (std::abs(piece.lambda[0] - piece.lambda[1]) < 1e-6 * std::abs(piece.lambda[0])) {
    // Critical damping to six digits: a pair that near would lose them; move it apart by as little.
    piece.lambda[0] *= 1.0 + 1e-6;
    piece.lambda[1] *= 1.0 - 1e-6;
  }
  piece.weight[0] = (v0 - piece.lambda[1] * y0) / (piece.lambda[0] - piece.lambda[1]);
  piece.weight[1] = y0 - piece.weight[0];
}

WallMoment WallSolution::moment(const Piece& piece, double t) const {
  WallMoment out;
  if (piece.motion == Motion::kStuck) {
    out.height_m = piece.stuck_m;
    if (out.height_m < 0.0) out.force_n = -p_.stiffness_n_per_m * out.height_m;
    return out;
  }
  out.height_m = value_of(piece.polynomial, t);
  out.velocity_m_s = slope_of(piece.polynomial, t);
  for (int i = 0; i < 2; ++i) {
    const std::complex<double> wave = piece.weight[i] * std::exp(piece.lambda[i] * t);
    out.height_m += wave.real();
    out.velocity_m_s += (piece.lambda[i] * wave).real();
  }
  if (piece.contact) {
    out.force_n = std::max(0.0, -p_.stiffness_n_per_m * out.height_m - p_.damping_n_s_per_m * out.velocity_m_s);
  }
  return out;
}

double WallSolution::net_at_rest(const Piece& piece, double t) const {
  const double y = piece.stuck_m;
  return value_of(piece.push_n, t) - p_.hand_stiffness_n_per_m * y + (y < 0.0 ? -p_.stiffness_n_per_m * y : 0.0);
}

bool WallSolution::ends(const Piece& piece, double t) const {
  if (piece.motion == Motion::kStuck) return std::abs(net_at_rest(piece, t)) > p_.coulomb_n * (1.0 + 1e-9);
  const WallMoment now = moment(piece, t);
  return turns(piece, now) || contact_changes(piece, now);
}

bool WallSolution::turns(const Piece& piece, const WallMoment& now) const {
  if (piece.motion == Motion::kStuck) return false;
  return piece.motion == Motion::kUp ? now.velocity_m_s <= 0.0 : now.velocity_m_s >= 0.0;
}

bool WallSolution::contact_changes(const Piece& piece, const WallMoment& now) const {
  const double wall_n = -p_.stiffness_n_per_m * now.height_m - p_.damping_n_s_per_m * now.velocity_m_s;
  return piece.contact ? now.height_m > 0.0 || wall_n < 0.0 : now.height_m < 0.0 && wall_n > 0.0;
}

WallMoment WallSolution::at(double time_s) const {
  const double t = std::clamp(time_s, 0.0, end_s_);
  const auto next =
      std::upper_bound(pieces_.begin(), pieces_.end(), t, [](double s, const Piece& p) { return s < p.begin_s; });
  const Piece& piece = next == pieces_.begin() ? *next : *(next - 1);
  return moment(piece, t - piece.begin_s);
}

}  // namespace tools
