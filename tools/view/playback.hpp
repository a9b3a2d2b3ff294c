#pragma once
/// @file playback.hpp
/// The clock of a recording that is shown: plays, stands, jumps. Pure; one thread.
#include <cstdint>

#include <nlohmann/json.hpp>

namespace view {

/// Times in seconds since the beginning of the recording.
class Playback {
 public:
  static constexpr double kSlowest = 0.01, kFastest = 4.0;

  explicit Playback(double length_s) : length_s_(length_s) {}

  /// A page's message `play` (docs/viewer-protocol.md). Unknown or senseless keys are ignored.
  void take(const nlohmann::json& play, std::uint64_t now_ns);

  /// The clock goes on. It stands at the end.
  void advance(std::uint64_t now_ns);
  [[nodiscard]] double at_s() const noexcept { return at_s_; }
  /// Goes to `at_s`. A jump when the curves have to begin anew: backwards, or over more than the eye follows.
  void go_to(double at_s, bool jump);
  /// Ticks to go forward (or back) from here, once.
  [[nodiscard]] int take_steps() noexcept;

  [[nodiscard]] bool playing() const noexcept { return playing_; }
  [[nodiscard]] double speed() const noexcept { return speed_; }
  [[nodiscard]] double length_s() const noexcept { return length_s_; }
  [[nodiscard]] std::uint32_t jumps() const noexcept { return jumps_; }

 private:
  double length_s_;
  double at_s_ = 0.0, speed_ = 1.0;
  bool playing_ = true;
  int steps_ = 0;
  std::uint32_t jumps_ = 0;
  std::uint64_t advanced_ns_ = 0;  ///< 0: never.
};

}  // namespace view
