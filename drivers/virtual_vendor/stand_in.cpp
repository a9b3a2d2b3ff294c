#include "drivers/virtual_vendor/stand_in.hpp"

#include <unistd.h>

#include <limits>

#include "drivers/simulated/simulated_config.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/vector3.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::virtual_vendor {

using rtbus::config::Map;
using rtbus::config::read_vector3;

std::string explain(Plugged outcome, const char* library) {
  switch (outcome) {
    case Plugged::kYes:
      return {};
    case Plugged::kOtherBuild:
      return std::string(library) + " belongs to another build of this program; build both again";
    case Plugged::kInUse:
      break;
  }
  return "another device of this process has the stand-in's unit; stop that one, or give this one another "
         "virtual.serial";
}

UnitSettings default_unit(const DeviceInfo& info) {
  UnitSettings out;
  simulated::MechanicsParameters& m = out.mechanics;
  m.mass_kg = info.apparent_mass_kg;
  m.viscous_n_s_per_m = 0.3;  // own choice, as the friction below
  m.coulomb_n = 0.05;
  m.gravity_m_s2 = Eigen::Vector3d::Zero();
  m.max_force_n = info.max_force_n;
  m.position_quantum_m = info.position_quantum_m;
  m.workspace_min_m = rtbus::vector_of(info.workspace_min_m);
  m.workspace_max_m = rtbus::vector_of(info.workspace_max_m);
  return out;
}

void read_unit(Map& map, UnitSettings& unit, bool frames) {
  unit.serial = map.text("serial", unit.serial);
  unit.call_us = map.number("call_us", {0.0, 20000.0}, unit.call_us);
  unit.in_use = map.boolean("in_use", unit.in_use);
  unit.one_session = map.boolean("one_session", unit.one_session);
  unit.publish_state = map.boolean("publish_state", unit.publish_state);
  simulated::MechanicsParameters& m = unit.mechanics;
  if (auto mechanics = map.optional_map("mechanics")) {
    m.mass_kg = mechanics->number("mass_kg", {0.005, 5.0}, m.mass_kg);
    m.viscous_n_s_per_m = mechanics->number("viscous_n_s_per_m", {0.0, 50.0}, m.viscous_n_s_per_m);
    m.coulomb_n = mechanics->number("coulomb_n", {0.0, 5.0}, m.coulomb_n);
    m.gravity_m_s2 = read_vector3(*mechanics, "gravity_m_s2", {-30.0, 30.0}, m.gravity_m_s2);
    m.position_quantum_m = mechanics->number("position_quantum_m", {0.0, 0.005}, m.position_quantum_m);
    mechanics->finish();
  }
  if (map.has("hand")) {
    Map hand = map.file_or_map("hand");
    unit.hand = simulated::parse_hand(hand, m.start_position_m);
    hand.finish();
  }
  m.start_position_m = read_vector3(map, "start_position_m", {-0.5, 0.5}, m.start_position_m);
  if ((m.start_position_m.array() < m.workspace_min_m.array()).any() ||
      (m.start_position_m.array() > m.workspace_max_m.array()).any()) {
    map.fail(map.has("start_position_m") ? "start_position_m" : "hand",
             "lets the tip start outside the workspace (limits.workspace_min_m…max_m); move it inside");
  }
  if (auto faults = map.optional_map("faults")) {
    unit.unplug_at_s = faults->number("unplug_at_s", {-1.0, 1e6}, unit.unplug_at_s);
    unit.replug_after_s = faults->number("replug_after_s", {-1.0, 1e6}, unit.replug_after_s);
    unit.late_reply = faults->number("late_reply", {0.0, 1.0}, unit.late_reply);
    unit.late_ms = faults->number("late_ms", {0.0, 1000.0}, unit.late_ms);
    unit.garbage = faults->number("garbage", {0.0, 1.0}, unit.garbage);
    if (frames) unit.split_reply = faults->number("split_reply", {0.0, 1.0}, unit.split_reply);
    unit.for_s = faults->number("for_s", {-1.0, 1e6}, unit.for_s);
    unit.trigger = faults->text("trigger", unit.trigger);
    faults->finish();
  }
}

void Unit::begin(std::uint64_t now_ns) {
  if (begun()) return;
  advance_to(now_ns);
  begin_ns_ = now_ns;
  mechanics_.begin_script(now_ns);
}

double Unit::age_s(std::uint64_t now_ns) const noexcept {
  const std::uint64_t from_ns = settings_.trigger.empty() ? begin_ns_ : triggered_ns_;
  if (from_ns == 0) return -1.0;
  return now_ns > from_ns ? rtbus::seconds_between(from_ns, now_ns) : 0.0;
}

bool Unit::happens(double share, std::uint64_t now_ns) noexcept {
  const double t_s = age_s(now_ns);
  if (share <= 0.0 || t_s < 0.0 || (settings_.for_s >= 0.0 && t_s >= settings_.for_s)) return false;
  constexpr std::uint64_t kParts = 1'000'000;
  return static_cast<double>(draw(kParts)) < share * static_cast<double>(kParts);
}

double Unit::late_us(std::uint64_t now_ns) noexcept {
  return happens(settings_.late_reply, now_ns) ? 1e3 * settings_.late_ms : 0.0;
}

bool Unit::garbles(std::uint64_t now_ns) noexcept { return happens(settings_.garbage, now_ns); }

bool Unit::splits(std::uint64_t now_ns) noexcept { return happens(settings_.split_reply, now_ns); }

void Unit::spoil(double* position, std::uint64_t now_ns, double metre) noexcept {
  if (!garbles(now_ns)) return;
  double& one = position[spoilt_ % 3];
  switch (spoilt_++ / 3 % 3) {
    case 0:
      one = std::numeric_limits<double>::quiet_NaN();
      break;
    case 1:
      one = 1e30;
      break;
    default:
      one += 0.4 * metre;
  }
}

bool Unit::plugged_in(std::uint64_t now_ns) noexcept {
  const double t_s = age_s(now_ns);
  if (t_s < 0.0 || settings_.unplug_at_s < 0.0 || t_s < settings_.unplug_at_s) return true;
  if (missed_ns_ == 0) missed_ns_ = now_ns;
  return settings_.replug_after_s >= 0.0 && now_ns >= missed_ns_ + rtbus::ns_of(settings_.replug_after_s);
}

void Unit::advance_to(std::uint64_t now_ns) {
  if (!running_) mechanics_.reset(now_ns);
  running_ = true;
  mechanics_.advance_to(now_ns);
  mechanics_.expire_force(now_ns);
  if (settings_.trigger.empty()) return;
  const bool triggered = ::access(settings_.trigger.c_str(), F_OK) == 0;
  if (!triggered) {
    triggered_ns_ = missed_ns_ = 0;
  } else if (triggered_ns_ == 0) {
    triggered_ns_ = now_ns;
  }
}

void block_for_us(double us) {
  if (us > 0.0) rtbus::sleep_until(rtbus::monotonic_ns() + static_cast<std::uint64_t>(us * 1e3));
}

}  // namespace drivers::virtual_vendor
