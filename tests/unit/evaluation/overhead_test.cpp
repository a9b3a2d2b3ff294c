/// What `rtbus evaluate overhead` is going to run.
#include "tools/evaluation/overhead/overhead_parts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

#include "tools/cli/run/run_plan.hpp"

namespace {

#if RTBUS_WITH_BULLET

tools::OverheadPlan plan() {
  const std::string folder = std::string(RTBUS_SOURCE_DIR) + "/config/";
  tools::OverheadOptions options{folder + "wall.yaml", folder + "stack_125.yaml", folder + "soft.yaml"};
  options.usb = RTBUS_WITH_USB;
  return tools::overhead_plan(options);
}

TEST(Overhead, SpeaksOfEveryPartInEverySession) {
  std::multiset<std::string> spoken_of;
  for (const tools::OverheadPart& part : plan().parts) {
    for (const char* word : {"engine", "soft solver", "torque", "passivity", "deactivation", "USB", "recorder"}) {
      if (part.name.find(word) != std::string::npos) spoken_of.insert(part.session + " " + word);
    }
  }
  for (const char* session : {"wall ", "stack_125 ", "soft "}) {
    for (const char* word : {"engine", "soft solver", "torque", "passivity", "deactivation", "USB", "recorder"}) {
      EXPECT_EQ(spoken_of.count(std::string(session) + word), 1U) << session << word;
    }
  }
}

TEST(Overhead, EveryVariantIsASessionThatCanRun) {
  const tools::OverheadPlan all = plan();
  for (const tools::LiveVariant& variant : all.variants) {
    const tools::RunPlan run = tools::make_run_plan(variant.session_file, variant.assignments);
    EXPECT_FALSE(run.nodes.empty());
  }
}

TEST(Overhead, EveryPartIsHeldAgainstAnotherVariantAndSaysHowItShows) {
  const tools::OverheadPlan all = plan();
  std::set<std::size_t> used;
  for (const tools::OverheadPart& part : all.parts) {
    if (!part.absent.empty()) continue;
    EXPECT_NE(part.left_out, part.forced_on) << part.session << ", " << part.name;
    const tools::PartSigns& s = part.signs;
    EXPECT_TRUE(!s.library.empty() || !s.thread.empty() || !s.topic.empty() || !s.silent_topic.empty() || s.process ||
                s.step_ratio > 0.0)
        << part.session << ", " << part.name;
    used.insert({part.left_out, part.forced_on});
  }
  EXPECT_EQ(used.size(), all.variants.size()) << "a variant runs for nothing, or twice";
}

#endif

TEST(Overhead, SpreadsAreOverThePairs) {
  tools::OverheadPart part;
  for (const double without : {3.0, 1.0, 2.0}) {
    part.without.emplace_back().tick_ns = without;
    part.with.emplace_back().tick_ns = without * without;  // 9, 1, 4: 6, 0, 2 more
  }
  const auto tick = [](const tools::LiveFigures& f) { return f.tick_ns; };
  EXPECT_EQ(tools::left_out(part, tick).median, 2.0);
  EXPECT_EQ(tools::saving(part, tick).median, 2.0);
  EXPECT_EQ(tools::saving(part, tick).low, 0.0);
  EXPECT_EQ(tools::saving(part, tick).high, 6.0);
}

}  // namespace
