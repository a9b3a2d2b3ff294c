/// Claim i of `rtbus evaluate local-contact`: two hands at one body.
#include <algorithm>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/local_contact/two_hands.hpp"
#include "tools/evaluation/shared/method_settings.hpp"

namespace tools {

namespace {

constexpr double kCarryError_n = 0.02, kHeld_m = 0.03, kKill_s = 8.0;

PanelLine carry_line(const TwoHandsRun& run, std::size_t hand, PanelLine line) {
  for (std::size_t i = 0; i < run.time_s.size(); ++i) {
    line.x.push_back(run.time_s[i]);
    line.y.push_back(run.force_n[hand][i].norm());
  }
  return line;
}

}  // namespace

void claim_two_hands(const LocalContactOptions& options, Experiment& experiment) {
  TwoHandsSetup setup;
  setup.config_folder = options.config_folder;
  setup.folder = experiment.folder();
  const auto run = [&](std::vector<std::string> assignments) {
    assignments.insert(assignments.end(), options.assignments.begin(), options.assignments.end());
    setup.assignments = std::move(assignments);
    return carry_block(setup);
  };
  Table table{"local_contact_two_hands",
              {"physics [Hz]", "method", "left, force RMS [N]", "right, force RMS [N]", "peak [N]", "lowest [mm]"},
              {}};
  const TwoHandsRun truth = run(converged_carry());
  Panel left{"Force on the left hand, physics 18 Hz", "time [s]", "force [N]", {}, "set yrange [0:4]"};
  left.lines.push_back(carry_line(truth, 0, {"10 kHz, no delay", "lc rgb 'black'", {}, {}, false}));
  for (const double physics_hz : {100.0, 43.0, 18.0}) {
    for (const char* const method : kAllCompared) {
      if (interrupted()) return;
      const TwoHandsRun felt = run(late_carry(method, physics_hz));
      const CarryError first = carry_error(felt, truth, 0, TwoHandsRun::kCarried_s, setup.duration_s);
      const CarryError second = carry_error(felt, truth, 1, TwoHandsRun::kCarried_s, setup.duration_s);
      const auto carried = std::lower_bound(felt.time_s.begin(), felt.time_s.end(), TwoHandsRun::kCarried_s);
      const double lowest_m =
          *std::min_element(felt.height_m.begin() + (carried - felt.time_s.begin()), felt.height_m.end());
      table.rows.push_back({physics_hz, std::string(method), first.rms_n, second.rms_n,
                            std::max(first.peak_n, second.peak_n), 1e3 * lowest_m});
      if (physics_hz == 18.0) left.lines.push_back(carry_line(felt, 0, method_line(method)));
      if (std::string(method) != kLocalContact) continue;
      const std::string id = formatted("local-contact.two_hands.%ghz", physics_hz);
      const std::string what = formatted("two hands carry 0.1 kg, physics %g Hz: ", physics_hz);
      experiment.check_at_most(id, what + "force error, RMS", std::max(first.rms_n, second.rms_n), "N", kCarryError_n);
      experiment.check_at_least(id + ".held", what + "lowest place of the block in 9.5 s", 1e3 * lowest_m, "mm",
                                1e3 * kHeld_m);
    }
  }
  setup.kill_s = kKill_s;
  setup.duration_s = kKill_s + 0.1;  // then the block lies somewhere else
  const TwoHandsRun alone = run(converged_carry());
  for (const double physics_hz : {100.0, 43.0, 18.0}) {
    if (interrupted()) return;
    const TwoHandsRun felt = run(late_carry(kLocalContact, physics_hz));
    const CarryError error = carry_error(felt, alone, 1, kKill_s + 1.0 / physics_hz, setup.duration_s);
    experiment.check_at_most(formatted("local-contact.two_hands.killed.%ghz", physics_hz),
                             formatted("left node killed, physics %g Hz: force error of the right hand from one period "
                                       "later, RMS",
                                       physics_hz),
                             error.rms_n, "N", kCarryError_n);
  }
  experiment.add_table(std::move(table));
  draw_panels(experiment, "local_contact_two_hands",
              "Two hands squeeze a block of 0.1 kg, lift it and carry it; physics one full period late", {left});
}

}  // namespace tools
