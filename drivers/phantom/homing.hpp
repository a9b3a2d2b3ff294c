#pragma once
/// @file homing.hpp
/// Homing of the arm. The counters are zero at power-up in any pose, and the calibration button sets them to zero
/// again; the protocol does not tell which of the two happened. With a wrong zero every force has a wrong direction. So
/// there is no force until the counters are confirmed:
///
/// - `at_start`: the user states that the arm was plugged in (or its button pressed) in the home pose and is held there
///   at start. Checked: all three counters are near zero for 0.3 s. Otherwise there is no force until the arm is
///   brought home.
/// - `button`: the user presses the button with the arm at home. Seen as all counters jumping to zero within one
///   exchange, faster than an arm can move, and staying there for 0.3 s.
/// - `counters`: the user states that the unit was calibrated since power-up and its counters are true wherever the arm
///   is now. Not checked; for restarts of the software.
///
/// Each statement is about the start. After a loss of the connection the board may have been without power. Its
/// counters are then accepted only if they continue where they stopped, away from zero; otherwise the button must be
/// pressed. The same holds after a jump of the counters, and after an impossible pose.
///
/// One thread; realtime-safe but for remedy().
#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "drivers/phantom/phantom_kinematics.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::phantom {

enum class HomingMode : std::uint8_t { kAtStart, kButton, kCounters };

class Homing {
 public:
  /// Held near zero for so long means: at home.
  static constexpr std::uint64_t kHoldNs = 300'000'000;
  /// Impossible poses in a row after which the counters are no longer accepted.
  static constexpr int kImpossiblePoses = 20;

  /// @param tolerance_rad Per joint, around the home pose.
  Homing(const Kinematics& kinematics, HomingMode mode, double tolerance_rad);

  /// A connection begins; `counts` is its first answer.
  void begin(std::uint64_t now_ns, const Counts& counts) noexcept RTBUS_NONBLOCKING;

  enum class Verdict : std::uint8_t {
    kHomed,
    kNotHomed,
    kGlitch,  ///< Counters that no arm can have reached. Alone they are a damaged answer; a second one makes it a jump.
  };

  /// Each later answer. @param possible The linkage can have this pose.
  Verdict update(std::uint64_t now_ns, const Counts& counts, bool possible) noexcept RTBUS_NONBLOCKING;

  /// The firmware's own word that its button was pressed just now (it showed no counters before).
  void pressed(std::uint64_t now_ns, const Counts& counts) noexcept RTBUS_NONBLOCKING;

  /// The connection was lost: the board may have been without power.
  void lost() noexcept RTBUS_NONBLOCKING { was_lost_ = true; }

  [[nodiscard]] bool homed() const noexcept { return homed_; }
  /// The counters of an arm that was zeroed at home and is there now.
  [[nodiscard]] bool near_zero(const Counts& counts) const noexcept;
  /// What the user has to do while not homed; one sentence.
  [[nodiscard]] std::string remedy() const;
  /// "hold the arm with … and press its button": how a true zero is made. A button that is pressed in another pose
  /// makes a wrong one that nothing on the wire tells, so the pose is always said.
  [[nodiscard]] std::string press_at_home() const;

 private:
  enum class Waits : std::uint8_t { kForHome, kForButton, kPowerLost, kJumped, kImpossible };

  struct Seen {
    Counts counts{};
    std::uint64_t time_ns = 0;
  };
  [[nodiscard]] bool jumped(const Seen& from, const Seen& to) const noexcept;
  void wait_for(Waits what) noexcept;

  HomingMode mode_;
  std::string_view home_;  ///< Model::home.
  Eigen::Vector3d counts_per_rad_;
  double tolerance_rad_;

  bool homed_ = false;
  bool ever_homed_ = false;
  bool was_lost_ = false;
  Waits waits_ = Waits::kForHome;
  bool holding_ = false;  ///< Near zero since hold_since_ns_, for a reason that counts.
  std::uint64_t hold_since_ns_ = 0;
  int impossible_ = 0;
  Seen last_;
  Seen suspect_;
  bool suspicious_ = false;  ///< The last answer was suspect_.
  Counts believed_{};        ///< The last counters while homed.
};

}  // namespace drivers::phantom
