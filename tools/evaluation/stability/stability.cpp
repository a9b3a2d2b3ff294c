#include "tools/evaluation/stability/stability.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <thread>

#include "tools/cli/common/command.hpp"
#include "tools/cli/common/gnuplot.hpp"
#include "tools/cli/common/run_progress.hpp"
#include "tools/evaluation/stability/parallel_cases.hpp"

namespace tools {

namespace {

int jobs_of(const StabilityOptions& options) {
  return options.jobs > 0 ? options.jobs : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

}  // namespace

void evaluate_stability(const StabilityOptions& options, Experiment& experiment) {
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  RunProgress progress(terminal, !terminal);
  const std::size_t cases = options.seeds.empty() ? options.cases : options.seeds.size();
  const auto seed_of = [&](std::size_t i) { return options.seeds.empty() ? options.first_seed + i : options.seeds[i]; };
  const std::size_t tell_every = std::max<std::size_t>(cases / 20, 1);  // where no bar is drawn
  std::vector<StabilityResult> results(cases);
  std::size_t done = 0;
  const auto work = [&](std::size_t i) {
    return run_case(draw_case(seed_of(i)), options.session_file, options.assignments);
  };
  const bool whole = run_cases(cases, jobs_of(options), work, [&](const StabilityResult& result) {
    StabilityResult& kept = results[result.index] = result;
    kept.seed = seed_of(result.index);
    ++done;
    const std::string told = std::to_string(done) + " of " + std::to_string(cases) + " cases";
    if (done % 20 == 0) progress.show_share(static_cast<double>(done) / static_cast<double>(cases), told);
    if (done % tell_every == 0) progress.log(told);
  });
  progress.clear();
  if (!whole) throw std::runtime_error("interrupted after " + std::to_string(done) + " cases");

  if (options.maps) {
    std::vector<StabilityResult> cells;
    const auto show = [&](std::size_t ready, std::size_t of) {
      progress.show_share(static_cast<double>(ready) / static_cast<double>(of),
                          std::to_string(ready) + " of " + std::to_string(of) + " cells of the maps");
    };
    draw_maps(experiment, run_maps(options, jobs_of(options), show, cells));
    progress.clear();
    experiment.note(std::to_string(cells.size()) + " more cases are in the maps");
  }

  report_cases(results, experiment);
}

int show_stability_case(const StabilityOptions& options, std::uint64_t seed, const std::filesystem::path& folder) {
  const StabilityCase each = draw_case(seed);
  std::printf("case %llu: %s\n", static_cast<unsigned long long>(seed), describe(each).c_str());
  for (const std::string& text : assignments_of(each)) std::printf("  --set '%s'\n", text.c_str());
  std::vector<StabilityTick> ticks;
  const StabilityResult r = run_case(each, options.session_file, options.assignments, true, &ticks);
  std::printf(
      "%s%s; swing %.4g N, %.4g mm p-p; direct at 10 kHz %.4g N, %.4g mm; peak %.4g N, clamped %.3g s\n"
      "rendered %.4g N/m, %.4g N s/m; observed energy at least %.4g mJ (bar %.4g), in deficit %.4g s; true work of the "
      "plant "
      "%.4g mJ, observed energy off by %.3g mJ; settled after %.3g s of %.3g s%s%s\n",
      to_string(r.outcome), r.growing ? ", growing" : "", r.swing_n, r.swing_m * 1e3, r.reference_n,
      r.reference_m * 1e3, r.peak_n, r.clamped_s, r.rendered_n_per_m, r.rendered_n_s_per_m, r.lowest_observed_j * 1e3,
      r.deficit_bar_j() * 1e3, r.deficit_s, r.plant_work_j * 1e3, r.observed_error_j * 1e3, r.settled_s, r.simulated_s,
      r.error[0] != 0 ? "; " : "", r.error);
  const std::string stem = "case_" + std::to_string(seed);
  std::ofstream tsv(folder / (stem + ".tsv"));
  tsv << "# time [s]\ttip [mm]\tforce [N]\tproxy [mm]\tobserved energy [mJ]\tforce of the method [N]\n";
  for (const StabilityTick& t : ticks) {
    tsv << t.time_s << '\t' << t.height_m * 1e3 << '\t' << t.force_n << '\t' << t.proxy_m * 1e3 << '\t'
        << t.observed_j * 1e3 << '\t' << t.method_n << '\n';
  }
  tsv.close();
  if (const auto gnuplot = Gnuplot::find()) {
    Figure figure;
    figure.stem = stem;
    figure.height_px = 900;
    const std::string file = gnuplot_quoted(stem + ".tsv");
    figure.body = "set multiplot layout 3,1 title " +
                  gnuplot_quoted("case " + std::to_string(seed) + ", " + to_string(r.outcome)) +
                  "\nset grid lc rgb 'gray80'\nset lmargin 9\nset ylabel 'position [mm]'\nplot " + file +
                  " using 1:2 with lines lw 2 title 'tip', '' using 1:4 with lines title 'proxy'\n"
                  "set ylabel 'force [N]'\nplot " +
                  file +
                  " using 1:3 with lines lw 2 title 'sent', '' using 1:(abs($6)<20?$6:NaN) with lines title 'method'\n"
                  "set ylabel 'observed energy [mJ]'\nset xlabel 'time [s]'\nplot " +
                  file + " using 1:5 with lines notitle\nunset multiplot\n";
    const auto drawn = gnuplot->draw(folder, figure);
    if (drawn) std::printf("drawn: %s\n", drawn->front().c_str());
  }
  return r.outcome == StabilityOutcome::kFailed ? kExitFailed : kExitFine;
}

}  // namespace tools
