/// What `rtbus evaluate network` runs.
#include <algorithm>
#include <cmath>

#include "tools/evaluation/network/network.hpp"

namespace tools {

namespace {

constexpr double kBegins_s = 1.7;  // the start ramp is over behind the slowest network
constexpr double kStiffness = 300.0, kDamping = 0.5;

StabilityCase cell_of(const NetworkMethod& method, const NetworkOptions& network) {
  StabilityCase out;
  out.method = method.method;
  out.bounds = method.bounds;
  out.damps = method.damps;
  out.lags = method.lags;
  out.hand = StabilityHand::kStiff;
  out.stiffness_n_per_m = kStiffness;
  out.damping_n_s_per_m = kDamping;
  out.physics_hz = 100.0;
  out.friction = 0.316;  // squared, that of block and floor: 0.1, as in config/free_block.yaml
  out.speed_m_s = 0.05;
  out.solver_iterations = StabilityEnvelope::kIterations;
  out.network = network;
  out.begins_s = kBegins_s;
  return out;
}

}  // namespace

const std::vector<NetworkMethod>& network_methods() {
  static const std::vector<NetworkMethod> methods{
      {"remote coupling, law alone", StabilityEnvelope::kRemote, false, false, false},
      {"remote coupling, damper (TDPA)", StabilityEnvelope::kRemote, false, true, false},
      {"remote coupling, set-points (PSPM)", StabilityEnvelope::kRemote, true, false, false},
      {StabilityEnvelope::kRemote, StabilityEnvelope::kRemote, true, true, true},
      {StabilityEnvelope::kLocal, StabilityEnvelope::kLocal, true, true, true},
  };
  return methods;
}

StabilityCase network_cell(const NetworkMethod& method, StabilityTask task, const NetworkOptions& network) {
  StabilityCase out = cell_of(method, network);
  out.task = task;
  out.depth_m = task == StabilityTask::kBlock ? 0.05 : 0.006;
  return out;
}

StabilityCase network_move(const NetworkMethod& method, const NetworkOptions& network) {
  StabilityCase out = cell_of(method, network);
  out.task = StabilityTask::kFree;
  out.height_m = 0.06;
  out.depth_m = 0.0;
  out.speed_m_s = 0.02;
  return out;
}

TruthError compare_runs(const std::vector<StabilityTick>& run, const std::vector<StabilityTick>& truth, double from_s) {
  TruthError out;
  double force2 = 0.0, way2 = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::min(run.size(), truth.size()); ++i) {
    if (run[i].time_s < from_s) continue;
    const double force_n = run[i].force_n - truth[i].force_n, way_m = run[i].height_m - truth[i].height_m;
    force2 += force_n * force_n;
    way2 += way_m * way_m;
    ++count;
    out.force_peak_n = std::max(out.force_peak_n, std::abs(force_n));
    out.position_peak_m = std::max(out.position_peak_m, std::abs(way_m));
    out.drift_m = std::abs(way_m);
    out.given_j = std::max(out.given_j, run[i].given_j);
  }
  if (count > 0) {
    out.force_rms_n = std::sqrt(force2 / static_cast<double>(count));
    out.position_rms_m = std::sqrt(way2 / static_cast<double>(count));
  }
  return out;
}

StabilityCase draw_network_case(std::uint64_t seed) {
  using E = NetworkEnvelope;
  // A case of the envelope, whichever number that has; then its network.
  Random random(seed);
  StabilityCase out;
  do {
    out = draw_case(kSecondGeneration + 1 + random.next() % 1'000'000'000);
  } while (!out.envelope || out.physics_hz < E::kMinPhysicsHz);
  out.seed = seed;
  if (random.chance(0.1)) out.task = StabilityTask::kPlate;
  out.jitter_s = out.lost_share = 0.0;
  out.solver_iterations = E::kIterations;
  out.network.round_trip_s = random.chance(0.1) ? 0.0 : random.log_between(0.002, E::kMaxRoundTripS);
  out.network.out_share = random.chance(0.5) ? 0.5 : random.between(0.1, 0.9);
  out.network.jitter_share = random.chance(0.3) ? 0.0 : random.between(0.0, E::kMaxJitterShare);
  out.network.reorder = random.chance(0.5);
  out.network.lost_share = random.chance(0.3) ? 0.0 : random.between(0.0, E::kMaxLostShare);
  out.network.burst_s = random.chance(0.5) ? 0.0 : random.log_between(0.005, E::kMaxBurstS);
  return out;
}

}  // namespace tools
