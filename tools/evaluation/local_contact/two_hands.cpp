#include "tools/evaluation/local_contact/two_hands.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "tools/cli/common/formatted.hpp"
#include "tools/evaluation/shared/method_settings.hpp"
#include "tools/harness/harness.hpp"

namespace tools {

namespace {

/// To the block, squeeze, lift by 20 mm, then 15 mm to either side once in two seconds.
std::filesystem::path write_way(const std::filesystem::path& folder, bool left, double duration_s) {
  constexpr double kApart_m = 0.012, kSqueezed_m = 0.007, kLift_m = 0.02, kCarry_m = 0.015;
  const double sign = left ? -1.0 : 1.0;
  const std::filesystem::path file = folder / (left ? "carry_left.csv" : "carry_right.csv");
  std::ofstream out(file);
  const auto point = [&out](double t_s, double x_m, double y_m) { out << t_s << ',' << x_m << ',' << y_m << ",0\n"; };
  out << "t_s,x_m,y_m,z_m\n";
  point(0.0, sign * kApart_m, 0.0);
  point(1.0, sign * kApart_m, 0.0);
  point(2.0, -sign * kSqueezed_m, 0.0);
  point(3.0, -sign * kSqueezed_m, 0.0);
  point(4.0, -sign * kSqueezed_m, kLift_m);
  point(5.0, -sign * kSqueezed_m, kLift_m);
  double side = 1.0;
  for (double t_s = 6.0; t_s <= duration_s; t_s += 1.0, side = -side) {
    point(t_s, -sign * kSqueezed_m + side * kCarry_m, kLift_m);
  }
  return std::filesystem::absolute(file);
}

}  // namespace

TwoHandsRun carry_block(const TwoHandsSetup& setup) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : setup.assignments) {
    const std::size_t either = text.find("haptic.*.");
    if (either != 0) {
      overrides.push_back(rtbus::config::parse_override(text));
      continue;
    }
    for (const char* const hand : {"haptic.0.", "haptic.1."}) {
      overrides.push_back(rtbus::config::parse_override(hand + text.substr(9)));
    }
  }
  for (const bool left : {true, false}) {
    overrides.push_back(
        rtbus::config::parse_override(std::string("haptic.") + (left ? "0" : "1") +
                                      ".device.hand.file=" + write_way(setup.folder, left, setup.duration_s).string()));
  }
  auto session = rtbus::config::load_session(setup.config_folder + "/two_hands.yaml", overrides);
  Harness harness(session, {});
  const auto every = static_cast<std::uint64_t>(std::llround(harness.config().rate_hz / 1000.0));
  TwoHandsRun out;
  const auto observe = [&](std::size_t hand, const rtbus::Telemetry& tick) {
    if (tick.tick % every != 0) return;
    out.force_n[hand].push_back(Eigen::Vector3d(tick.force_n[0], tick.force_n[1], tick.force_n[2]));
    if (hand == 0) return;
    out.time_s.push_back(harness.now_s());
    out.height_m.push_back(harness.stepper()->world().body_pose(1).position_m.y());
  };
  harness.run_all(setup.kill_s >= 0.0 ? setup.kill_s : setup.duration_s, observe);
  if (setup.kill_s >= 0.0) {
    harness.kill(0);
    harness.run_all(setup.duration_s - setup.kill_s, observe);
  }
  out.force_n[0].resize(out.time_s.size(), Eigen::Vector3d::Zero());
  return out;
}

CarryError carry_error(const TwoHandsRun& felt, const TwoHandsRun& truth, std::size_t hand, double from_s,
                       double until_s) {
  CarryError out;
  double sum = 0.0, count = 0.0;
  for (std::size_t i = 0; i < std::min(felt.time_s.size(), truth.time_s.size()); ++i) {
    if (felt.time_s[i] < from_s || felt.time_s[i] > until_s) continue;
    const double error_n = (felt.force_n[hand][i] - truth.force_n[hand][i]).norm();
    sum += error_n * error_n;
    count += 1.0;
    out.peak_n = std::max(out.peak_n, error_n);
  }
  out.rms_n = std::sqrt(sum / std::max(count, 1.0));
  return out;
}

std::vector<std::string> converged_carry() {
  return {"haptic.*.method=local_contact", "haptic.*.rate_hz=10000", "physics.rate_hz=10000"};
}

std::vector<std::string> late_carry(const std::string& method, double physics_hz) {
  std::vector<std::string> out;
  for (const std::string& text : method_settings(method)) {
    constexpr std::string_view kFirst = "haptic.0.";
    out.push_back(text.starts_with(kFirst) ? "haptic.*." + text.substr(kFirst.size()) : text);
  }
  out.push_back(formatted("physics.throttle_hz=%g", physics_hz));
  return out;
}

}  // namespace tools
