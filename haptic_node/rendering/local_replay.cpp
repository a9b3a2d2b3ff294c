/// LocalWorld::catch_up(): from the instant that an answer describes to now.
#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"

namespace haptic {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Every body that moves, and is not of a heap, goes on from the answer's instant to now.
void LocalWorld::catch_up(const rtbus::ProxyContacts& answer, std::uint64_t now_ns) noexcept {
  if (answer.device_time_ns >= now_ns) return;
  int rows = static_cast<int>(support_count_);
  for (std::size_t row = 0; row < rigid_rows_; ++row) rows += bodies_[slot_of_row_[row]].moves ? 1 : 0;
  const auto ticks =
      static_cast<int>(std::min(1e3, std::ceil(rtbus::seconds_between(answer.device_time_ns, now_ns) / tick_s_ - 0.1)));
  const int parts = std::clamp(std::min(ticks, kReplayRows / std::max(1, rows)), 1, kReplayParts);
  for (std::size_t row = 0; row < rigid_rows_; ++row) {
    const Body& body = bodies_[slot_of_row_[row]];
    if (body.moves && !body.jammed) replay(slot_of_row_[row], answer.device_time_ns, now_ns, parts, turned_since_[row]);
  }
}

/// One body, under its forces and on its supports, with the impulses that the proxy gave it meanwhile: as integrate()
/// would have moved it, in fewer and longer steps.
void LocalWorld::replay(std::size_t slot, std::uint64_t from_ns, std::uint64_t now_ns, int parts,
                        Quaterniond& turned) noexcept {
  Body& body = bodies_[slot];
  const ImpulseHistory& history = given_[slot];
  Impulse before = history.at(from_ns, body.given);
  const double h = rtbus::seconds_between(from_ns, now_ns) / parts;
  const double tick_s = std::min(h, tick_s_);
  std::array<std::size_t, kSupports> source;
  std::size_t rows = 0;
  if (body.motion.inverse_mass_per_kg > 0.0) {
    for (std::size_t i = 0; i < support_count_; ++i) {
      if (supports_[i].body != slot) continue;
      rows_[rows] = support_row(supports_[i], h);
      rows_[rows].softness_per_kg *= tick_s / h;  // gives way as fast as it does tick by tick
      rows_[rows].impulse_n_s = supports_[i].force_n * h * supports_[i].normal;
      rows_[rows].torsion_n_m_s = 0.0;
      source[rows++] = i;
    }
  }
  prepare_contacts(&body.motion, rows_.data(), rows);
  turned.setIdentity();
  for (int part = 1; part <= parts; ++part) {
    const std::uint64_t until_ns = from_ns + (now_ns - from_ns) * static_cast<std::uint64_t>(part) / parts;
    const Impulse after = history.at(until_ns, body.given);
    SolverBody next = body.motion;
    next.velocity_m_s += next.inverse_mass_per_kg * (h * body.force_n + after.linear_n_s - before.linear_n_s);
    next.angular_velocity_rad_s +=
        next.inverse_inertia_per_kg_m2 * (h * body.torque_n_m + after.angular_n_m_s - before.angular_n_m_s);
    if (rows > 0) relax_contacts(&next, rows_.data(), rows, kSweeps);
    // Impulses came evenly over the part, each at the beginning of its tick.
    const Vector3d faster_m_s = next.velocity_m_s - body.motion.velocity_m_s;
    body.centre_m += h * (body.motion.velocity_m_s + 0.5 * faster_m_s) + 0.5 * tick_s * faster_m_s;
    turned = turn_of(0.5 * (body.motion.angular_velocity_rad_s + next.angular_velocity_rad_s), h) * turned;
    body.motion.velocity_m_s = next.velocity_m_s;
    body.motion.angular_velocity_rad_s = next.angular_velocity_rad_s;
    before = after;
  }
  turned.normalize();
  if (turned.vec().isZero(0.0)) return;
  const Matrix3d R = turned.toRotationMatrix();
  body.motion.inverse_inertia_per_kg_m2 = R * body.motion.inverse_inertia_per_kg_m2 * R.transpose();
  if (body.ball) return;  // it rolls over what holds it: the support stays below the centre
  for (std::size_t i = 0; i < rows; ++i) {
    supports_[source[i]].from_centre_m = turned * supports_[source[i]].from_centre_m;
  }
}

}  // namespace haptic
