#pragma once
/// @file overhead_parts.hpp
/// What a session can do without, how to leave it out and force it on, and runs of both in turn.
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "tools/evaluation/overhead/live_pair.hpp"
#include "tools/evaluation/overhead/overhead.hpp"

namespace tools {

/// How a part that is there shows itself; what is empty is not looked for.
struct PartSigns {
  std::string library = {};       ///< Part of the file name of a library that it maps.
  std::string thread = {};        ///< Name of a thread that it starts.
  std::string topic = {};         ///< A topic that exists for it alone.
  std::string silent_topic = {};  ///< One that is there anyway, in which nothing is published without it …
  double low_hz = 0.0;            ///< … and with it so often.
  double high_hz = 0.0;
  bool process = false;     ///< One process more.
  double step_ratio = 0.0;  ///< A step with it takes at least so many times that without; 0: nothing said.
};

/// Something a session can do without.
struct OverheadPart {
  std::string session;                      ///< "wall", "stack_125", "soft".
  std::string name;                         ///< "engine (Bullet)".
  std::string absent = {};                  ///< Why it has no meaning here, in a few words; then the rest is empty.
  std::size_t left_out = 0, forced_on = 0;  ///< Of OverheadPlan::variants.
  PartSigns signs = {};
  std::vector<LiveFigures> without = {}, with = {};  ///< Pair by pair.
};

/// Parts, and each way to run a session once, however many parts are held against it.
struct OverheadPlan {
  std::vector<LiveVariant> variants;
  std::vector<OverheadPart> parts;
};

[[nodiscard]] OverheadPlan overhead_plan(const OverheadOptions& options);

/// Runs every variant once per round, every second round the other way round: a machine that slows down or warms up
/// favours neither.
void measure_parts(OverheadPlan& plan, const OverheadOptions& options);

/// One figure of a run, and its middle and ends over the pairs.
using LiveFigure = std::function<double(const LiveFigures&)>;
struct Spread {
  double median, low, high;
};
[[nodiscard]] Spread left_out(const OverheadPart& part, const LiveFigure& figure);
/// Forced on minus left out, within each pair.
[[nodiscard]] Spread saving(const OverheadPart& part, const LiveFigure& figure);

/// Under the simulated clock: each part's force against the one without it, bit for bit, and what the parts cost that
/// no session can leave out. Wants a process that has mapped no engine and no driver yet.
void check_overhead_bits(const OverheadOptions& options, Experiment& experiment);

}  // namespace tools
