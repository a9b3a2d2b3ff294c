#pragma once
/// @file stack.hpp
/// `rtbus evaluate stack`: the stacks of He & Choi (2013), section V.B, Figs 12 to 16 and Table I. A hand pushes into
/// 125, 250 and 500 cubes. Rates and step times come from real processes, beside a bare loop; which method is the
/// smoother one at equal mean force comes from the harness, where it is the same on every machine.
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/evaluation/shared/experiment.hpp"
#include "tools/evaluation/stack/push.hpp"

namespace tools {

struct StackOptions {
  std::string config_folder;             ///< Where stack_125.yaml and its sisters are.
  std::vector<std::string> assignments;  ///< `--set`; stronger than what the experiment sets.
  bool quick = false;                    ///< A shorter push, fewer real runs, no stills, no larger stacks.

  [[nodiscard]] double push_s() const noexcept { return quick ? kShortPush_s : kPaperPush_s; }
  static constexpr double kPaperPush_s = 20.0;
  static constexpr double kShortPush_s = 7.0;  ///< Begins nearer to the stack.
};

/// One stack on one kind of machine.
struct StackCell {
  const char* id;  ///< "125_at_100hz"
  int cubes;
  bool pipe;           ///< The paper's whole loop: `form: paper` over a named pipe, 50 packets per second.
  double throttle_hz;  ///< Imitates the paper's machine; 0: this machine's own speed.
  double parts_hz;     ///< The longest part of a step is one over this; 0: as the session's file says.
  double stiffness_n_per_m;
  bool compared;  ///< Both methods, in the harness too.
};
[[nodiscard]] std::span<const StackCell> stack_cells() noexcept;
/// Of the pipe one stack tells enough for a quick look.
[[nodiscard]] bool in_real_processes(const StackOptions& options, const StackCell& cell) noexcept;

/// Of the hand's spring, a light grip, before means are made equal.
inline constexpr double kStackHand_n_per_m = 100.0;

/// As Table I and Fig. 13 print it.
struct PublishedStack {
  int cubes;
  double step_ms, simulation_hz, haptic_hz;
};
[[nodiscard]] std::span<const PublishedStack> published_stacks() noexcept;

/// The session of a cell for one method. @param hand_n_per_m Stiffness with which the hand pushes.
/// @param push_s StackOptions::kShortPush_s or kPaperPush_s.
[[nodiscard]] PushSetup stack_setup(const StackOptions& options, const StackCell& cell, const char* method,
                                    double hand_n_per_m, double push_s);

/// Both methods at equal mean force, under the simulated clock.
struct StackPair {
  PushFigures interpolation, remote;
  PushFigures remote_same_hand;  ///< Before the means were made equal.
  double hand_interpolation_n_per_m = 0.0, hand_remote_n_per_m = 0.0;
  PushTrace interpolation_trace, remote_trace;

  [[nodiscard]] double mean_ratio() const noexcept;  ///< Remote over interpolation, likewise below.
  [[nodiscard]] double increment_ratio() const noexcept;
  [[nodiscard]] double vibration_ratio() const noexcept;  ///< RMS of what lies above 30 Hz.
};

/// Means within this share of each other are called equal.
inline constexpr double kEqualMean = 0.10;

/// The push whose mean force is `mean_n` within kEqualMean: as long as it is not, the hand pushes the harder or softer,
/// four times at most.
struct PushAtMean {
  PushTrace trace;
  PushFigures figures;
  PushFigures first;  ///< With kStackHand_n_per_m.
  double hand_n_per_m = kStackHand_n_per_m;
};
[[nodiscard]] PushAtMean push_at_mean(const StackOptions& options, const StackCell& cell, const char* method,
                                      double mean_n, const HarnessOptions& link);

/// Runs interpolation, then remote coupling at its mean force, both for the short push: in 20 s an interpolation that
/// vibrates over the pipe leaves the stack for good, and no mean is left to be equal to.
[[nodiscard]] StackPair compare_at_equal_mean(const StackOptions& options, const StackCell& cell);

/// Runs all of it, draws it, and checks it.
void evaluate_stack(const StackOptions& options, Experiment& experiment);

/// Real processes: rates beside the bare loop.
struct StackRun {
  const StackCell* cell = nullptr;
  const char* method = "";
  LivePush push;
  PushFigures figures;
  bool counted = false;  ///< The machine did not pause meanwhile.
};
[[nodiscard]] std::vector<StackRun> run_stacks(const StackOptions& options, const std::vector<StackPair>& pairs,
                                               Experiment& experiment);
/// Stacks beyond the paper's: what this machine makes of 1000, 2000 and 5000 cubes.
[[nodiscard]] Table larger_stacks(const StackOptions& options);

void draw_stack(Experiment& experiment, const std::vector<StackPair>& pairs, const std::vector<StackRun>& runs);

}  // namespace tools
