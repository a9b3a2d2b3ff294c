#include "tools/cli/run/run_stills.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>
#include <vector>

namespace tools {

namespace {

constexpr double kLeastForce_n = 0.05;  // below it nobody pushes

std::vector<StillHandConfig> hands_of(const RunPlan& plan) {
  std::vector<StillHandConfig> hands;
  for (const haptic::HapticConfig& haptic : plan.haptic) {
    hands.push_back(hand_config(haptic, plan.physics ? &*plan.physics : nullptr));
  }
  return hands;
}

void name(StillFrame& frame, const char* stem, double elapsed_s, const char* what) {
  char text[64];
  std::snprintf(text, sizeof text, "%.2f s into the run: %s", elapsed_s, what);
  frame.stem = stem;
  frame.moment = text;
}

}  // namespace

RunStills::RunStills(const RunPlan& plan) : source_(plan.session, plan.world, hands_of(plan)) {}

void RunStills::drain(double elapsed_s) {
  if (!source_.drain()) return;
  const StillFrame& now = source_.frame();
  double force_n = 0.0;
  for (const StillHand& hand : now.hands) force_n = std::max(force_n, hand.force_n.norm());
  if (force_n > std::max(hardest_n_, kLeastForce_n)) {
    hardest_n_ = force_n;
    hardest_ = now;
    name(*hardest_, "still_1_push", elapsed_s, "hardest push");
  }
  end_ = now;
  name(*end_, "still_2_end", elapsed_s, "end");
}

StillsOutcome RunStills::draw(const std::filesystem::path& folder) {
  std::vector<StillFrame> frames;
  for (const auto* frame : {&hardest_, &end_}) {
    // An external engine may have told another world since.
    if (*frame && (*frame)->poses.size() == source_.scene().bodies.size()) frames.push_back(**frame);
  }
  if (frames.empty()) return {{}, "no stills: nothing of the scene was seen"};
  return draw_stills(folder, source_.scene(), frames, {});
}

}  // namespace tools
