#pragma once
/// @file run_stills.hpp
/// The stills of a run: its hardest push and its end.
#include <filesystem>
#include <optional>

#include "tools/cli/run/run_plan.hpp"
#include "tools/cli/still/still.hpp"
#include "tools/cli/still/still_frame.hpp"

namespace tools {

/// Looks at the scene for as long as it lives: physics publishes body poses (30 Hz) meanwhile. One thread.
class RunStills {
 public:
  explicit RunStills(const RunPlan& plan);

  /// Opens the topics. @returns false while some are not there.
  [[nodiscard]] bool attach() { return source_.attach(); }
  /// Takes in what is new. @param elapsed_s Since all nodes ran.
  void drain(double elapsed_s);
  /// Draws what was kept; takes some seconds.
  [[nodiscard]] StillsOutcome draw(const std::filesystem::path& folder);

 private:
  BusFrames source_;
  std::optional<StillFrame> hardest_, end_;
  double hardest_n_ = 0.0;
};

}  // namespace tools
