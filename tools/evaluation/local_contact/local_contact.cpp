#include "tools/evaluation/local_contact/local_contact.hpp"

#include <unistd.h>

#include "tools/cli/common/interrupt.hpp"

namespace tools {

std::vector<rtbus::Telemetry> record_hand(const LocalContactOptions& options, const std::string& session,
                                          const std::vector<std::string>& assignments, double duration_s) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  for (const std::string& text : options.assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto settings = rtbus::config::load_session(options.config_folder + "/" + session, overrides);
  Harness harness(settings, {});
  std::vector<rtbus::Telemetry> ticks;
  ticks.reserve(static_cast<std::size_t>(duration_s * harness.config().rate_hz) + 1);
  harness.run(duration_s, [&](const rtbus::Telemetry& tick) { ticks.push_back(tick); });
  return ticks;
}

PanelLine method_line(const std::string& method, const std::string& name) {
  PanelLine line;
  line.name = name.empty() ? method : name;
  line.style = method_style(method);
  return line;
}

PanelLine converged_line() { return {"10 kHz, no delay", "lc rgb 'black'", {}, {}, false}; }

void evaluate_local_contact(const LocalContactOptions& options, Experiment& experiment) {
  RunProgress progress(::isatty(STDERR_FILENO) == 1, false);
  claim_free_air(options, experiment);
  claim_sliding(options, experiment);
  claim_wall(options, experiment);
  if (!interrupted()) claim_shapes(options, experiment);
  if (!interrupted()) claim_free_bodies(options, experiment);
  if (!interrupted()) claim_friction(options, experiment);
  if (!interrupted()) claim_yields(options, experiment);
  if (!interrupted()) claim_two_hands(options, experiment);
  if (!interrupted()) claim_block(options, experiment, progress);
  if (!interrupted()) claim_rates(options, experiment, progress);
  if (!interrupted()) claim_rough(options, experiment, progress);
  if (!interrupted()) claim_third_law(options, experiment);
  progress.clear();
  experiment.note(
      "simulated Desktop; each result of physics reaches the loop one full period after the hand's sample that it "
      "answers");
}

}  // namespace tools
