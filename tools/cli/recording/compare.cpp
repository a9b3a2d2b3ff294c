// `rtbus compare REF.h5 B.h5`: how far two recordings of the same motion are apart.
#include <cmath>
#include <cstdio>
#include <iostream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/cli/common/command.hpp"
#include "tools/cli/common/field_format.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/text_table.hpp"
#include "tools/cli/recording/difference.hpp"
#include "tools/cli/recording/signals.hpp"

namespace tools {
namespace {

using rtbus::recording::Recording;

struct CompareOptions {
  std::string reference, other;
  std::vector<std::string> signals;
  double from_s = -std::numeric_limits<double>::infinity();
  double to_s = std::numeric_limits<double>::infinity();
  double shift_s = 0.0;
  std::optional<std::string> mark;
  bool json = false;
};

const std::vector<std::string> kComparedByDefault{"telemetry.force_n", "telemetry.position_m",
                                                  "telemetry.proxy_position_m"};

int not_compared(const Refusal& refusal) {
  std::cerr << "rtbus compare: " << refusal.message << '\n';
  return refusal.exit_status;
}

/// One field of both recordings.
struct Row {
  std::string name, unit;
  Difference difference;
};

/// The elements of one field, which follow each other in `signals` from `first`.
Track track_of(const std::vector<Signal>& signals, std::size_t first, std::size_t elements) {
  Track out;
  out.elements = elements;
  out.time_s = signals[first].time_s;
  out.value.resize(out.time_s.size() * elements);
  for (std::size_t e = 0; e < elements; ++e) {
    for (std::size_t k = 0; k < out.time_s.size(); ++k) out.value[k * elements + e] = signals[first + e].value[k];
  }
  return out;
}

rtbus::Result<std::vector<Signal>, Refusal> load(const Recording& recording, const CompareOptions& options,
                                                 bool is_reference) {
  const auto origin = common_origin_ns(recording, options.mark);
  if (!origin) return rtbus::Failure{origin.error()};
  auto signals = choose_signals(sources_of(recording), options.signals.empty() ? kComparedByDefault : options.signals);
  if (!signals) return rtbus::Failure{Refusal{recording.path() + ": " + signals.error().message}};
  const double infinity = std::numeric_limits<double>::infinity();
  load_signals(recording, is_reference ? options.from_s : -infinity, is_reference ? options.to_s : infinity, *signals,
               *origin);
  if (!is_reference && options.shift_s != 0.0) {
    for (Signal& signal : *signals) {
      for (double& time_s : signal.time_s) time_s += options.shift_s;
    }
  }
  return signals;
}

rtbus::Result<std::vector<Row>, Refusal> rows_of(const std::vector<Signal>& reference, const std::vector<Signal>& b) {
  std::vector<Row> rows;
  if (reference.size() != b.size()) {
    return rtbus::Failure{Refusal{"the recordings do not have the same signals; name one topic with --signals", 1}};
  }
  for (std::size_t first = 0, end = 0; first < reference.size(); first = end) {
    const auto same_field = [&](std::size_t i) {
      return reference[i].topic == reference[first].topic && reference[i].field == reference[first].field;
    };
    for (end = first; end < reference.size() && same_field(end);) ++end;
    const bool single = end - first == 1;
    rows.push_back({single ? reference[first].label(true) : reference[first].topic + " " + reference[first].field,
                    reference[first].unit,
                    compare(track_of(reference, first, end - first), track_of(b, first, end - first))});
  }
  return rows;
}

std::string figure(double value) { return formatted("%.4g", value); }

void print_table(const CompareOptions& options, const std::vector<Row>& rows) {
  using Align = TextTable::Align;
  TextTable table({{"difference", Align::kLeft},
                   {"unit", Align::kLeft},
                   {"rms", Align::kRight},
                   {"peak", Align::kRight},
                   {"at s", Align::kRight},
                   {"per ms", Align::kRight},
                   {"at s", Align::kRight},
                   {"rms of REF", Align::kRight},
                   {"from s", Align::kRight},
                   {"to s", Align::kRight}});
  for (const Row& row : rows) {
    const Difference& d = row.difference;
    if (d.samples == 0) {
      table.add({row.name, row.unit, "no time in common"});
      continue;
    }
    table.add({row.name, row.unit, figure(d.rms), figure(d.peak), fixed(d.peak_s, 3), figure(d.jump_per_ms),
               fixed(d.jump_s, 3), figure(d.reference_rms), fixed(d.from_s, 3), fixed(d.to_s, 3)});
  }
  std::printf("REF %s\nB   %s\ntime 0 is %s of each\n\n", options.reference.c_str(), options.other.c_str(),
              options.mark ? ("the mark \"" + *options.mark + "\"").c_str() : "the first tick");
  for (const std::string& line : table.lines()) std::printf("%s\n", line.c_str());
}

void print_json(const CompareOptions& options, const std::vector<Row>& rows) {
  nlohmann::ordered_json out = {{"schema", "rtbus-compare/1"},
                                {"reference", options.reference},
                                {"other", options.other},
                                {"signals", nlohmann::ordered_json::array()}};
  for (const Row& row : rows) {
    const Difference& d = row.difference;
    out["signals"].push_back({{"signal", row.name},
                              {"unit", row.unit},
                              {"samples", d.samples},
                              {"from_s", d.from_s},
                              {"to_s", d.to_s},
                              {"rms", d.rms},
                              {"peak", d.peak},
                              {"peak_s", d.peak_s},
                              {"jump_per_ms", d.jump_per_ms},
                              {"jump_s", d.jump_s},
                              {"reference_rms", d.reference_rms},
                              {"reference_peak", d.reference_peak}});
  }
  std::cout << json_line(out) << '\n';
}

int run_compare(const CompareOptions& options) {
  const auto reference = Recording::open(options.reference);
  if (!reference) return not_compared({reference.error().message, 1});
  const auto other = Recording::open(options.other);
  if (!other) return not_compared({other.error().message, 1});
  const auto own = load(*reference, options, true), theirs = load(*other, options, false);
  if (!own) return not_compared(own.error());
  if (!theirs) return not_compared(theirs.error());
  const auto rows = rows_of(*own, *theirs);
  if (!rows) return not_compared(rows.error());
  options.json ? print_json(options, *rows) : print_table(options, *rows);
  for (const Row& row : *rows) {
    if (row.difference.samples > 0) return kExitFine;
  }
  return not_compared({"the recordings have no time in common; --shift or --mark moves B", 1});
}

}  // namespace

Action add_compare(rtbus::Command command) {
  auto options = std::make_shared<CompareOptions>();
  command.option("REF", options->reference, "Recording to compare with").required().type_name("REF.h5");
  command.option("B", options->other, "Recording to judge").required().type_name("B.h5");
  command.option("--signals", options->signals,
                 "What to compare: force_n, force_n[1], telemetry.position_m, …\n"
                 "(default: force, position and proxy of the first hand)");
  command.option("--from", options->from_s, "First second to compare");
  command.option("--to", options->to_s, "Last second (default: the end of the shorter)");
  command.option("--mark", options->mark, "Time 0 is this mark in both, instead of the first tick").type_name("TEXT");
  command.option("--shift", options->shift_s, "Adds so many seconds to the times of B").show_default();
  command.flag("--json", options->json, "As JSON (schema rtbus-compare/1)");
  command.footer(
      "The difference B - REF at the times of REF; of a vector its length. B is interpolated between its samples.\n"
      "\"per ms\" is the largest change of the difference within a millisecond: what a hand feels as a click.\n"
      "`rtbus plot REF.h5 B.h5` draws both on one axis.");
  return [options] { return run_compare(*options); };
}

}  // namespace tools
