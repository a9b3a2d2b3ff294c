#include "drivers/virtual_devices/falcon/falcon_arm.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "drivers/falcon/falcon_frame.hpp"
#include "drivers/simulated/models.hpp"

namespace drivers::virtual_usb {
namespace {

using Eigen::Vector3d;

// An axis is homed when it has been this far out and then passes its reference, count 0, inwards. Where the real
// firmware sets the marks is not known; the motion that passes them is.
constexpr double kOuterCount = 300.0;
// Smaller pieces of time in which the axes are looked at while the hand homes them.
constexpr std::uint64_t kLookNs = 1'000'000;

// Out, in, and to where the script begins.
simulated::Hand homing_hand(const Vector3d& from, const Vector3d& to, double& duration_s) {
  using simulated::Waypoint;
  const Vector3d outer(0.0, 0.0, 0.0345);
  const Vector3d inner(0.0, 0.0, -0.030);
  std::vector<Waypoint> way{{0.0, from}, {0.5, outer}, {0.7, outer}, {1.3, inner}, {1.5, inner}, {2.1, to}, {2.3, to}};
  duration_s = way.back().time_s;
  const simulated::HandImpedance firm{2000.0, 20.0, 0.15, 40.0};
  return {simulated::WaypointPath(std::move(way), simulated::Interpolation::kLinear, false), firm};
}

}  // namespace

FalconArmSettings default_falcon_arm() {
  FalconArmSettings out;
  const auto models = simulated::models();
  const auto model = std::find_if(models.begin(), models.end(), [](const auto& each) { return each.name == "falcon"; });
  out.mechanics = model->mechanics;
  out.mechanics.max_force_n = 100.0;  // what limits is the size of a command
  out.mechanics.force_step_n = 0.0;   // commands are whole numbers already
  out.mechanics.position_quantum_m = 0.0;
  out.mechanics.workspace_min_m = {-0.040, -0.040, -0.035};
  out.mechanics.workspace_max_m = {0.040, 0.040, 0.035};
  return out;
}

FalconArm::FalconArm(FalconArmSettings settings)
    : settings_(std::move(settings)), kinematics_(settings_.geometry), mechanics_(settings_.mechanics, {}) {}

void FalconArm::power_up(std::uint64_t now_ns) {
  mechanics_ = simulated::Mechanics(settings_.mechanics, {});
  mechanics_.reset(now_ns);
  phase_ = Phase::kAlone;
  script_began_ns_ = 0;
  force_until_ns_ = 0;
  was_outside_ = 0;
  homed_ = 0;
  look_at_references();
}

void FalconArm::take_in_hand(simulated::Hand hand, std::uint64_t now_ns) {
  const Vector3d position_m = mechanics_.position_m();
  const Vector3d velocity_m_s = mechanics_.velocity_m_s();
  const Vector3d force_n = mechanics_.applied_force_n();
  mechanics_ = simulated::Mechanics(settings_.mechanics, std::move(hand));
  mechanics_.reset(now_ns);
  mechanics_.place(position_m, velocity_m_s);
  if (now_ns < force_until_ns_) mechanics_.set_force(force_n, force_until_ns_);
  mechanics_.begin_script(now_ns);
}

void FalconArm::begin_script(std::uint64_t now_ns) {
  take_in_hand(settings_.hand, now_ns);
  phase_ = Phase::kScript;
  script_began_ns_ = now_ns;
}

void FalconArm::frame_received(bool homing_asked, std::uint64_t now_ns) {
  advance_to(now_ns);
  if (settings_.homing == FalconHoming::kDone) {
    homed_ = falcon::kAllHomed;
    if (phase_ == Phase::kAlone) begin_script(now_ns);
  } else if (settings_.homing == FalconHoming::kByHand && homing_asked && homed_ != falcon::kAllHomed &&
             phase_ != Phase::kHoming) {
    was_outside_ = 0;
    double duration_s = 0.0;
    take_in_hand(homing_hand(mechanics_.position_m(), settings_.mechanics.start_position_m, duration_s), now_ns);
    phase_ = Phase::kHoming;
    homing_ends_ns_ = now_ns + static_cast<std::uint64_t>(duration_s * 1e9);
  }
}

void FalconArm::advance_to(std::uint64_t now_ns) {
  while (phase_ == Phase::kHoming && mechanics_.time_ns() < std::min(now_ns, homing_ends_ns_)) {
    const std::uint64_t before_ns = mechanics_.time_ns();
    mechanics_.advance_to(std::min({now_ns, homing_ends_ns_, before_ns + kLookNs}));
    if (mechanics_.time_ns() == before_ns) break;  // less than a step is left
    look_at_references();
  }
  if (phase_ == Phase::kHoming && now_ns >= homing_ends_ns_) begin_script(homing_ends_ns_);
  mechanics_.advance_to(now_ns);
  mechanics_.expire_force(now_ns);
  look_at_references();
}

void FalconArm::look_at_references() noexcept {
  const auto angles_rad = kinematics_.inverse_rad(mechanics_.position_m() + settings_.centre_m);
  if (!angles_rad) return;  // beyond its reach the linkage stays where it was
  const Vector3d counts = kinematics_.counts(*angles_rad);
  for (int axis = 0; axis < 3; ++axis) {
    const auto bit = static_cast<std::uint8_t>(1 << axis);
    if (counts[axis] >= kOuterCount) was_outside_ |= bit;
    if (phase_ == Phase::kHoming && (was_outside_ & bit) != 0 && counts_[axis] > 0.0 && counts[axis] <= 0.0) {
      homed_ |= bit;
    }
  }
  counts_ = counts;
}

void FalconArm::set_commands(const std::array<std::int16_t, 3>& count, std::uint64_t now_ns) {
  advance_to(now_ns);
  const Vector3d position_m = mechanics_.position_m() + settings_.centre_m;
  const auto angles_rad = kinematics_.inverse_rad(position_m);
  const Vector3d force_n =
      angles_rad ? falcon::force_of_commands(kinematics_, position_m, *angles_rad, count, settings_.command_gain)
                 : Vector3d::Zero();
  force_until_ns_ = now_ns + settings_.torque_timeout_ns;
  mechanics_.set_force(force_n, force_until_ns_);
}

std::array<std::int16_t, 3> FalconArm::encoders() const noexcept {
  std::array<std::int16_t, 3> out{};
  for (int axis = 0; axis < 3; ++axis) {
    if ((homed_ & (1 << axis)) == 0) continue;
    const double count = std::clamp(std::round(counts_[axis]), -32768.0, 32767.0);
    out[static_cast<std::size_t>(axis)] = static_cast<std::int16_t>(count);
  }
  return out;
}

}  // namespace drivers::virtual_usb
