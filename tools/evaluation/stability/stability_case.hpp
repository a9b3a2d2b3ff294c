#pragma once
/// @file stability_case.hpp
/// One case of `rtbus evaluate stability`: what it is made of, drawn from one number, and the session that runs it.
#include <cstdint>
#include <string>
#include <vector>

#include "tools/harness/harness.hpp"

namespace tools {

/// What the hand does, and to what.
enum class StabilityTask : std::uint8_t {
  kDrop,        ///< Let go above the wall; nobody holds the tip.
  kPress,       ///< Into the wall, and stays there.
  kRub,         ///< The same obliquely, with friction.
  kFree,        ///< A move in free air.
  kDeep,        ///< Starts inside the wall.
  kBlock,       ///< Pushes a block over a floor (bullet).
  kStack,       ///< Presses on, or falls onto, a stack whose boxes differ in mass (bullet).
  kFall,        ///< A body falls onto the tip, from as high as its speed wants (bullet).
  kSoft,        ///< Presses a soft ball, as far as the floor (bullet's module with soft bodies).
  kPlate,       ///< Presses a plate that rises, sinks and rests by itself (bullet).
  kSecondHand,  ///< Pushes a block against another hand, which rests on the far side of it (bullet).
  kTip,         ///< Pushes a tall box at its top (bullet).
  kTable,       ///< Pushes a block over the edge of a table (bullet).
};
[[nodiscard]] const char* to_string(StabilityTask task) noexcept;

enum class StabilityHand : std::uint8_t { kNone, kSoft, kStiff };
[[nodiscard]] const char* to_string(StabilityHand hand) noexcept;

/// Of the wall. The last two are a wedge, pressed on its slope, and a round hill of triangles (bullet).
enum class StabilityShape : std::uint8_t { kPlane, kSphere, kBox, kHull, kMesh };
/// Of what kBlock, kSecondHand and kFall move. The hull is a wedge.
enum class StabilityBody : std::uint8_t { kBox, kBall, kHull };

/// The declared envelope: within it neither of the methods that are made for slow physics, one of which a session gets
/// when it names none, may have a diverged case. docs/results.md says it in words, and which cases have one still.
struct StabilityEnvelope {
  static constexpr const char* kRemote = "remote_virtual_coupling";
  static constexpr const char* kLocal = "local_contact";
  static constexpr const char* kDefault = "default";  ///< The one of them that the session gets when it names none.
  static constexpr const char* kDevice = "phantom_desktop";
  static constexpr double kMaxStiffnessNPerM = 2000.0;
  static constexpr double kMinPhysicsHz = 5.0, kMaxPhysicsHz = 1000.0;
  static constexpr double kMaxLostShare = 0.1;
  static constexpr double kMaxJitterS = 0.002;
  static constexpr double kMaxMassRatio = 100.0;  ///< Body to proxy, and proxy to device, either way.
  static constexpr double kLightestBody = 1e-3;   ///< Body to proxy, of the third generation.
  static constexpr double kMaxHandSpeedMS = 1.0;
  static constexpr int kIterations = 30;  ///< Of bullet: with 10 a stack of unequal boxes rattles by itself.
};

[[nodiscard]] const char* to_string(StabilityShape shape) noexcept;
[[nodiscard]] const char* to_string(StabilityBody body) noexcept;

/// Lengths and speeds at the device.
struct StabilityCase {
  std::uint64_t seed = 0;  ///< draw_case(seed) makes it again; 0: not drawn.
  bool envelope = false;   ///< Every figure lies in StabilityEnvelope.
  std::string method = StabilityEnvelope::kRemote;
  bool paper = false;
  StabilityTask task = StabilityTask::kDrop;
  StabilityHand hand = StabilityHand::kNone;
  StabilityShape shape = StabilityShape::kPlane;
  StabilityBody body = StabilityBody::kBox;
  double stiffness_n_per_m = 200.0;  ///< As asked for.
  double damping_n_s_per_m = 0.0;
  bool stiff_device = false;   ///< The device allows 20 000 N/m and 30 N/ms: only mass and rate lower the stiffness.
  double physics_hz = 1000.0;  ///< Throttled: one full period of latency.
  double haptic_hz = 1000.0;
  double proxy_kg = 0.1;
  double body_ratio = 1.0;  ///< Mass of a moving body over that of the proxy.
  int boxes = 1;            ///< Of a stack; every second one has the mass of the proxy.
  double friction = 0.3;
  double quantum_m = 23e-6;
  double scale = 1.0;  ///< World over device: a box of 20 mm · scale.
  double speed_m_s = 0.1;
  double height_m = 0.01;  ///< Above the surface at the start.
  double depth_m = 0.005;  ///< Below it, where the hand wants to go, or where the tip starts.
  double phase = 0.0;      ///< Of physics against the loop, in its periods.
  double jitter_s = 0.0;
  double lost_share = 0.0;
  NetworkOptions network;            ///< Between the nodes; by itself none.
  bool bounds = true, damps = true;  ///< Parts of the energy's control; neither: it is observed only.
  bool lags = true;                  ///< Over a network the set-point does, against the echo of the tip.
  double loop_pause_s = 0.0;
  double physics_pause_s = 0.0;
  int solver_iterations = 10;  ///< Of bullet. In the envelope of the second generation StabilityEnvelope::kIterations.
  /// Of kSoft; the ball weighs body_ratio times the proxy.
  struct SoftMaterial {
    int nodes = 100;
    double linear_stiffness = 0.5;
    double pose_matching_hz = 20.0;
    double bulk_modulus_pa = 5000.0;
    double damping_per_s = 4.0;
    int iterations = 4;
  } soft;

  [[nodiscard]] bool moves_bodies() const noexcept { return task >= StabilityTask::kBlock; }
  [[nodiscard]] bool needs_bullet() const noexcept { return moves_bodies() || shape >= StabilityShape::kHull; }
  /// The hand pushes along −z; else along −y.
  [[nodiscard]] bool along_z() const noexcept {
    return task == StabilityTask::kBlock || task >= StabilityTask::kSecondHand;
  }
  [[nodiscard]] double longest_round_trip_s() const noexcept {
    return (1.0 + network.jitter_share) * network.round_trip_s;
  }
  /// When the motion begins: the start ramp is over, whatever the rate of physics and the network.
  [[nodiscard]] double start_s() const noexcept {
    return begins_s > 0.0 ? begins_s : 0.25 + 2.5 / physics_hz + 2.0 * longest_round_trip_s();
  }
  double begins_s = 0.0;  ///< Instead, where runs over several networks are held against each other; 0: start_s().
  /// Until a hand that is pushed has come to where it goes.
  [[nodiscard]] double way_s() const noexcept;
  /// When the script has ended, or a free tip has had its time to fall.
  [[nodiscard]] double end_s() const noexcept;
};

/// Numbers from here on are drawn by the second generation of the rules: local_contact, soft bodies, falling bodies,
/// hands up to 10 m/s. Those below mean what they always meant, so that what failed once can be tested for ever.
inline constexpr std::uint64_t kSecondGeneration = 10'000'000;
/// And from here on by the third: all shapes, boxes that tip or leave a table, two hands, soft balls and light bodies
/// in the envelope, and the method that a session gets when it names none.
inline constexpr std::uint64_t kThirdGeneration = 2'000'000'000;
/// The case of that number.
[[nodiscard]] StabilityCase draw_case(std::uint64_t seed);

/// `--set` for config/wall.yaml.
[[nodiscard]] std::vector<std::string> assignments_of(const StabilityCase& each);
[[nodiscard]] HarnessOptions link_of(const StabilityCase& each);

/// The same wall and hand rendered directly at 10 kHz, with the gains that `each` rendered. Not for moving bodies.
[[nodiscard]] StabilityCase direct_reference(const StabilityCase& each, double stiffness_n_per_m,
                                             double damping_n_s_per_m);

/// One line: "K 1500 B 2 physics 20 Hz …".
[[nodiscard]] std::string describe(const StabilityCase& each);

}  // namespace tools
