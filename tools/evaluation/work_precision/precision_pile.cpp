#include "tools/evaluation/work_precision/precision_pile.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string_view>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/shared/force_profile.hpp"
#include "tools/evaluation/shared/median.hpp"
#include "tools/evaluation/shared/method_settings.hpp"
#include "tools/evaluation/work_precision/precision_run.hpp"
#include "tools/evaluation/work_precision/precision_stack.hpp"

namespace tools {

namespace {

constexpr double kSlowPile_hz = 18.0, kPileDamping = 0.5;
constexpr double kStartsApart_s = 0.0037;
constexpr double kFirmHand = 700.0, kSoftestHand = 40.0, kEqualMean = 0.10;
constexpr int kHands = 4;
/// Of the truth and of local_contact; medians of three were off by a factor of 1.6.
constexpr int kFewStarts = 3;
/// Of what is measured over a few starts of something chaotic: no rougher than the truth means up to this.
constexpr double kNoRougher = 1.5;

struct PileRow {
  const char* name;
  const char* method;
  const char* form;  ///< nullptr: the method's own.
  double physics_hz;
  bool late;
};
constexpr PileRow kTruth{"full rate, no latency", "local_contact", nullptr, kPileRate_hz, false};
constexpr PileRow kMethods[] = {
    {"local_contact", "local_contact", nullptr, kSlowPile_hz, true},
    {"remote_virtual_coupling", "remote_virtual_coupling", nullptr, kSlowPile_hz, true},
    {kLeadingCoupling, kLeadingCoupling, nullptr, kSlowPile_hz, true},
    {"remote_virtual_coupling, form: paper", "remote_virtual_coupling", "paper", kSlowPile_hz, true},
};

struct Calm {
  std::vector<double> mean, increments, vibration;  ///< Of each start.
  double hand_n_per_m = kFirmHand;
};

Calm push_pile(const PrecisionPileOptions& options, const std::string& file, double stiffness, const PileRow& row,
               double hand_n_per_m, int starts, RunProgress& progress, double share) {
  Calm out;
  out.hand_n_per_m = hand_n_per_m;
  for (int start = 0; start < starts && !interrupted(); ++start) {
    progress.show_share(share, std::filesystem::path(file).stem().string() + ", " + row.name);
    PrecisionScene scene;
    scene.session_file = file;
    scene.axis = 2;
    scene.until_s = kPileEnd_s;
    // Each start a little aside and a little later.
    scene.assignments = {formatted("haptic.0.device.hand.start_m=[%.6g, 0, 0.015]", 1e-4 * (start - starts / 2)),
                         formatted("haptic.0.device.hand.start_s=%.9g", kPileBegin_s + kStartsApart_s * start),
                         formatted("haptic.0.device.hand.speed_m_s=%.9g", kPilePush_m_s),
                         formatted("haptic.0.device.hand.stiffness_n_per_m=%.9g", hand_n_per_m),
                         "haptic.0.device.mechanics.position_quantum_m=0",
                         "haptic.0.device.mechanics.force_step_n=0",
                         formatted("haptic.0.coupling.stiffness_n_per_m=%g", stiffness),
                         formatted("haptic.0.coupling.damping_n_s_per_m=%g", kPileDamping)};
    // The default depends on the rate of physics, and the window that is it at a low one has nothing to adapt to on a
    // device without encoder steps. The truth and what is made of it are to differ in nothing else.
    if (std::string_view(row.method) == kTruth.method) {
      scene.assignments.emplace_back("haptic.0.velocity_estimator=low_pass");
    }
    if (row.form != nullptr) scene.assignments.push_back(std::string("haptic.0.form=") + row.form);
    scene.assignments.insert(scene.assignments.end(), options.assignments.begin(), options.assignments.end());
    const PrecisionTrace trace =
        run_precisely(scene, {row.method, row.physics_hz, kPileRate_hz, kPileRate_hz, 0, row.late});
    std::vector<double> force_n;
    for (std::size_t i = 0; i < trace.time_s.size(); ++i) {
      if (trace.time_s[i] >= kPileContact_s + kStartsApart_s * start) force_n.push_back(trace.force_n[i]);
    }
    const Roughness rough = roughness(force_n, kPileRate_hz);
    out.mean.push_back(rough.mean_n);
    out.increments.push_back(rough.increment_rms_n);
    out.vibration.push_back(std::sqrt(rough.power_above_30hz_n2));
  }
  return out;
}

double apart_n(const Calm& calm, const Calm& other) {
  return std::abs(mean_interval(calm.mean).mean - mean_interval(other.mean).mean);
}

/// Within 10 %, or as equal as so few starts can tell.
double equal_within_n(const Calm& calm, const Calm& truth) {
  const MeanInterval a = mean_interval(calm.mean), b = mean_interval(truth.mean);
  return std::max(kEqualMean * b.mean, std::hypot(a.half_width, b.half_width));
}

bool equal(const Calm& calm, const Calm& truth) { return apart_n(calm, truth) <= equal_within_n(calm, truth); }

/// With the hand that comes nearest to the mean force of the truth: the firm one, or one found by halving.
Calm at_equal_mean(const Calm& truth, const auto& push_with) {
  Calm best = push_with(kFirmHand);
  const double mean_n = mean_interval(truth.mean).mean;
  if (mean_interval(best.mean).mean <= mean_n) return best;  // no hand is firmer
  double soft = kSoftestHand, firm = kFirmHand;
  for (int i = 1; i < kHands && !equal(best, truth) && !interrupted(); ++i) {
    const Calm next = push_with(std::sqrt(soft * firm));
    (mean_interval(next.mean).mean > mean_n ? firm : soft) = next.hand_n_per_m;
    if (apart_n(next, truth) < apart_n(best, truth)) best = next;
  }
  return best;
}

void add_row(Table& table, const std::string& pile, double stiffness, const PileRow& row, const Calm& calm,
             bool equal_mean) {
  table.rows.push_back({pile, stiffness, std::string(row.name), row.physics_hz, calm.hand_n_per_m,
                        interval_text(mean_interval(calm.mean), 1.0), std::string(equal_mean ? "yes" : "no"),
                        interval_text(mean_interval(calm.increments), 1e3), 1e3 * median(calm.increments),
                        interval_text(mean_interval(calm.vibration), 1e3), 1e3 * median(calm.vibration)});
}

}  // namespace

void evaluate_precision_pile(const PrecisionPileOptions& options, Experiment& experiment, RunProgress& progress) {
  Table table{"work_precision_pile",
              {"pile", "K [N/m]", "method", "physics [Hz]", "hand [N/m]", "mean force [N]", "equal mean",
               "change per ms, RMS [mN]", "median", "above 30 Hz, RMS [mN]", "median "},
              {}};
  const int others = options.quick ? kFewStarts : kPileStarts;  // of methods that have no bar here
  const std::vector<double> stiffnesses = options.quick ? std::vector<double>{300} : std::vector<double>{300, 500};
  const std::size_t piles = options.quick ? 1 : options.session_files.size();
  const auto all = static_cast<double>(piles * stiffnesses.size() * (1 + std::size(kMethods)));
  double done = 0.0;
  for (std::size_t i = 0; i < piles; ++i) {
    const std::string& file = options.session_files[i];
    const std::string pile = std::filesystem::path(file).stem().string();
    for (const double stiffness : stiffnesses) {
      const Calm truth = push_pile(options, file, stiffness, kTruth, kFirmHand, kPileStarts, progress, done++ / all);
      if (interrupted()) return;
      add_row(table, pile, stiffness, kTruth, truth, true);
      for (const PileRow& row : kMethods) {
        const double share = done++ / all;
        const int starts = &row == &kMethods[0] ? kPileStarts : others;
        const auto with_hand = [&](double hand_n_per_m) {
          return push_pile(options, file, stiffness, row, hand_n_per_m, starts, progress, share);
        };
        // The mean of local_contact is looked at itself.
        const Calm calm = &row == &kMethods[0] ? with_hand(kFirmHand) : at_equal_mean(truth, with_hand);
        if (interrupted()) return;
        add_row(table, pile, stiffness, row, calm, equal(calm, truth));
        if (&row != &kMethods[0]) continue;
        const std::string id = "work-precision." + pile + "." + formatted("%g", stiffness);
        const std::string what =
            pile + ", " + formatted("%g", stiffness) + " N/m, local_contact at 18 Hz over the truth: ";
        experiment.check_at_most(id + ".mean",
                                 what + "mean force off by, of 10 % or the 95 % interval of the difference",
                                 apart_n(calm, truth) / equal_within_n(calm, truth), "1", 1.0);
        experiment.check_at_most(id + ".increments", what + "change per ms, median",
                                 median(calm.increments) / median(truth.increments), "1", kNoRougher);
        experiment.check_at_most(id + ".vibration", what + "above 30 Hz, median",
                                 median(calm.vibration) / median(truth.vibration), "1", kNoRougher);
      }
    }
  }
  experiment.add_table(std::move(table));
}

}  // namespace tools
