/// `rtbus evaluate EXPERIMENT`: reproducible experiments with their checks, tables and figures.
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/config/document.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/commands.hpp"
#include "tools/evaluation/drop/drop.hpp"
#include "tools/evaluation/faults/faults.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/network/network.hpp"
#include "tools/evaluation/network/real_cell.hpp"
#include "tools/evaluation/overhead/overhead.hpp"
#include "tools/evaluation/soak/soak.hpp"
#include "tools/evaluation/soft/soft.hpp"
#include "tools/evaluation/stability/stability.hpp"
#include "tools/evaluation/stack/stack.hpp"
#include "tools/evaluation/work_precision/work_precision.hpp"
#include "tools/evaluation/worst_physics/worst_physics.hpp"

namespace tools {

namespace {

struct EvaluateOptions {
  std::string experiment;
  std::string out = "out/evaluate";
  std::string config;
  std::vector<std::string> assignments;
  bool quick = false;
  bool json = false;
  double seconds = 3.0;  ///< Of work-precision with --config.
  // Of stability alone:
  std::uint64_t seed = kSecondGeneration + 1;
  std::size_t cases = 0;  ///< 0: the experiment's own number.
  int jobs = 0;           ///< 0: one per core.
  bool no_maps = false;
  std::size_t sweep = 0;  ///< Of network: seeded cases instead of the grid.
  bool real = false;      ///< Likewise: cells in real processes.
  std::string seeds;      ///< A file with one number at the beginning of each line.
  std::optional<std::uint64_t> one_case;
  double minutes = 1.0;           ///< Of soak.
  std::uint64_t soak_seed = 1;    ///< Likewise.
  bool list = false;              ///< Of faults: its rows; of network: the real cells.
  std::vector<std::string> only;  ///< Likewise: those that are run.
};

/// One experiment. Throws rtbus::config::Error when what the user asked for cannot be.
struct Row {
  const char* name;
  const char* what;  ///< For --help.
  bool takes_config;
  bool takes_set;
  void (*run)(const EvaluateOptions& options, Experiment& experiment);
  bool one_core = false;  ///< Takes one, and starts no nodes: another such may run beside it.
};

std::string session_of(const EvaluateOptions& options, const char* own) {
  return options.config.empty() ? find_config(own) : options.config;
}

void run_drop(const EvaluateOptions& options, Experiment& experiment) {
  DropOptions drop;
  drop.session_file = session_of(options, "drop_paper.yaml");
  drop.assignments = options.assignments;
  drop.real_runs = options.quick ? 1 : 5;
  evaluate_drop(drop, experiment);
}

void run_stack(const EvaluateOptions& options, Experiment& experiment) {
  const std::filesystem::path folder = std::filesystem::path(find_config("stack_125.yaml")).parent_path();
  evaluate_stack({folder.string(), options.assignments, options.quick}, experiment);
}

void run_soft(const EvaluateOptions& options, Experiment& experiment) {
  SoftOptions soft;
  soft.session_file = session_of(options, "soft.yaml");
  soft.assignments = options.assignments;
  soft.real_runs = options.quick ? 1 : 3;
  evaluate_soft(soft, experiment);
}

void run_work_precision(const EvaluateOptions& options, Experiment& experiment) {
  WorkPrecisionOptions precision;
  if (!options.config.empty()) precision.own_file = find_session(options.config);
  precision.seconds = options.seconds;
  precision.wall_file = find_config("wall.yaml");
  precision.sphere_file = find_config("sphere.yaml");
  precision.block_file = find_config("free_block.yaml");
  precision.stack_file = find_config("stack_125.yaml");
  precision.soft_file = find_config("soft.yaml");
  precision.pile_files = {precision.stack_file, find_config("stack_500.yaml")};
  precision.assignments = options.assignments;
  precision.quick = options.quick;
  evaluate_work_precision(precision, experiment);
}

void run_local_contact(const EvaluateOptions& options, Experiment& experiment) {
  const std::filesystem::path folder = std::filesystem::path(find_config("wall.yaml")).parent_path();
  evaluate_local_contact({folder.string(), options.assignments, options.quick}, experiment);
}

/// The first number of each line; other lines are comments.
std::vector<std::uint64_t> read_seeds(const std::string& name) {
  std::vector<std::uint64_t> out;
  std::ifstream file(name);
  if (!file) throw rtbus::config::Error(name + ": cannot be read; --seeds takes a file with one number per line");
  for (std::string line; std::getline(file, line);) {
    std::uint64_t seed = 0;
    if (std::istringstream(line) >> seed) out.push_back(seed);
  }
  if (out.empty()) throw rtbus::config::Error(name + ": no line begins with a number");
  return out;
}

StabilityOptions stability_of(const EvaluateOptions& options) {
  StabilityOptions stability;
  stability.session_file = session_of(options, "wall.yaml");
  stability.assignments = options.assignments;
  stability.first_seed = options.seed;
  stability.cases = options.cases != 0 ? options.cases : options.quick ? 2'000 : 100'000;
  stability.jobs = options.jobs;
  if (!options.seeds.empty()) stability.seeds = read_seeds(options.seeds);
  stability.maps = !options.no_maps;
  stability.fine_maps = !options.quick;
  return stability;
}

void run_stability(const EvaluateOptions& options, Experiment& experiment) {
  evaluate_stability(stability_of(options), experiment);
}

void run_network(const EvaluateOptions& options, Experiment& experiment) {
  NetworkExperiment network;
  network.session_file = session_of(options, "wall.yaml");
  network.assignments = options.assignments;
  network.quick = options.quick;
  network.jobs = options.jobs;
  network.sweep = options.sweep;
  network.only = options.only;
  network.programs = folder_of_this_program();
  if (options.real) return evaluate_real_network(network, experiment);
  evaluate_network(network, experiment);
}

void run_faults(const EvaluateOptions& options, Experiment& experiment) {
  FaultsOptions faults;
  faults.session_file = session_of(options, "wall_own_plant.yaml");
  faults.stand_ins = std::filesystem::path(find_config("wall_own_plant.yaml")).parent_path().string();
  faults.quick = options.quick;
  faults.program = folder_of_this_program() + "/rtbus";
  faults.runs = options.quick || !options.only.empty() ? 1 : 3;
  faults.only = options.only;
  evaluate_faults(faults, experiment);
}

void run_soak(const EvaluateOptions& options, Experiment& experiment) {
  SoakOptions soak;
  soak.program = folder_of_this_program() + "/rtbus";
  soak.session_file = session_of(options, "wall_own_plant.yaml");
  soak.minutes = options.minutes;
  soak.seed = options.soak_seed;
  evaluate_soak(soak, experiment);
}

void run_worst_physics(const EvaluateOptions& options, Experiment& experiment) {
  WorstPhysicsOptions worst;
  worst.session_file = session_of(options, "wall.yaml");
  if (options.quick) worst.answers = 500'000;
  evaluate_worst_physics(worst, experiment);
}

void run_overhead(const EvaluateOptions& options, Experiment& experiment) {
  OverheadOptions overhead{find_config("wall.yaml"), find_config("stack_125.yaml"), find_config("soft.yaml")};
  overhead.usb = RTBUS_WITH_USB;
  overhead.recorder = RTBUS_WITH_HDF5;
  if (options.quick) overhead.rounds = 2, overhead.seconds = 1.0;
  evaluate_overhead(overhead, experiment);
}

constexpr std::array kExperiments{
    Row{"drop", "free fall onto a wall (paper, Figs 8 to 11)", true, true, &run_drop},
    Row{"stack", "a push into 125, 250 and 500 cubes (Figs 12 to 16, Table I)", false, true, &run_stack},
    Row{"soft", "five soft bodies touched (Figs 17 to 19)", true, true, &run_soft},
    Row{"work-precision", "force error against run time", true, true, &run_work_precision, true},
    Row{"local-contact", "each claim of the method local_contact", false, true, &run_local_contact, true},
    Row{"stability", "seeded cases from easy to absurd, and maps", true, true, &run_stability},
    Row{"network", "delay, jitter and loss between hand and physics", true, true, &run_network},
    Row{"faults", "what the hand feels when something dies, hangs, fails or runs out", true, false, &run_faults},
    Row{"soak", "real sessions under kills, observers and E-stops at random times", true, false, &run_soak},
    Row{"worst-physics", "a physics that wants to hurt: force, energy, recovery", false, false, &run_worst_physics,
        true},
    Row{"overhead", "what each optional part costs", false, false, &run_overhead},
};
constexpr const char* kAll = "all";

/// How an experiment ended that could not be judged; of the processes of `all` among themselves. To the outside it is
/// kExitFailed.
constexpr int kNotJudged = 3;
/// Likewise of one that a signal cut short.
constexpr int kCutShort = 4;
/// What this machine has no means for; ctest's number.
constexpr int kExitSkipped = 77;
int exit_status(int ended) { return ended == kNotJudged || ended == kCutShort ? kExitFailed : ended; }

/// @returns the exit status, kNotJudged or kCutShort.
int evaluate_one(const Row& row, const EvaluateOptions& options, const std::string& command_line) {
  const std::string name = row.name;
  try {
    if (!options.config.empty() && !row.takes_config) {
      throw rtbus::config::Error("evaluate " + name + " has sessions of its own: it takes no --config" +
                                 (row.takes_set ? "; --set changes a key of all of them" : ""));
    }
    if (!options.assignments.empty() && !row.takes_set) {
      throw rtbus::config::Error("evaluate " + name + " takes no --set" +
                                 (row.takes_config ? "; write a session file and name it with --config" : ""));
    }
    const bool network = row.run == &run_network;
    if (options.real && !network) throw rtbus::config::Error("evaluate " + name + " takes no --real");
    if ((options.list || !options.only.empty()) && row.run != &run_faults && !options.real) {
      throw rtbus::config::Error(
          "evaluate " + name +
          " has no rows: --list and --only are of `evaluate faults` and `evaluate network --real`");
    }
    if (const char* const file = std::getenv(kRealRunVariable);
        network && file != nullptr && options.only.size() == 1) {
      return run_real_cell(real_cell(options.only.front()), session_of(options, "wall.yaml"), options.assignments,
                           folder_of_this_program() + "/rtbus", file);
    }
    Experiment experiment("evaluate", name, command_line, std::filesystem::path(options.out) / name);
    if (options.one_case && row.run == &run_stability) {
      return show_stability_case(stability_of(options), *options.one_case, experiment.folder());
    }
    const int status = experiment.run([&] { row.run(options, experiment); }, options.json);
    if (experiment.verdict() == Verdict::kInterrupted) return kCutShort;
    const bool not_judged = experiment.verdict() != Verdict::kPass && experiment.verdict() != Verdict::kFail;
    return status == kExitFailed && not_judged ? kNotJudged : status;
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  } catch (const NotPossibleHere& error) {
    std::printf("SKIPPED: evaluate %s: %s\n", name.c_str(), error.what());
    return kExitSkipped;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "evaluate %s: %s\n", name.c_str(), error.what());
    return kExitFailed;
  }
}

/// An experiment in a process of its own, and how it ended.
struct OneOfAll {
  std::string name;
  pid_t pid = -1;
  std::FILE* held = nullptr;  ///< What it printed, when that has to wait for its turn.
  std::uint64_t began_ns = 0;
  int status = kExitFailed;
  double wall_s = 0.0;
  double cpu_s = 0.0;  ///< Its own and of what it started.
};

/// Each begins as if it were the only one: no library is mapped that another has needed, no memory is held, and one
/// that crashes leaves the others to run.
OneOfAll start_apart(const Row& row, const EvaluateOptions& options, const std::string& command_line, bool hold) {
  OneOfAll out{row.name};
  if (hold) out.held = std::tmpfile();
  out.began_ns = rtbus::monotonic_ns();
  std::fflush(nullptr);
  out.pid = ::fork();
  if (out.pid == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (out.held != nullptr) ::dup2(::fileno(out.held), STDOUT_FILENO);
    const int status = evaluate_one(row, options, command_line);
    std::fflush(nullptr);
    ::_exit(status);
  }
  if (out.pid < 0) std::fprintf(stderr, "evaluate %s: no process: %s\n", row.name, std::strerror(errno));
  return out;
}

void finish_apart(OneOfAll& one) {
  if (one.pid < 0) return;
  // Ctrl-C reaches it by itself, a signal to this process alone does not.
  bool told = false;
  const auto tell = [&] {
    if (interrupted() && !std::exchange(told, true)) ::kill(one.pid, SIGTERM);
  };
  int status = 0;
  rusage used{};
  tell();
  while (::wait4(one.pid, &status, 0, &used) < 0 && errno == EINTR) tell();
  if (WIFEXITED(status)) {
    one.status = WEXITSTATUS(status);
  } else {
    std::fprintf(stderr, "evaluate %s: ended by signal %d\n", one.name.c_str(), WTERMSIG(status));
  }
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  one.wall_s = rtbus::seconds_between(one.began_ns, rtbus::monotonic_ns());
  one.cpu_s = seconds(used.ru_utime) + seconds(used.ru_stime);
  if (one.held == nullptr) return;
  std::rewind(one.held);
  for (int c = std::fgetc(one.held); c != EOF; c = std::fgetc(one.held)) std::putchar(c);
  std::fclose(one.held);
}

/// One after the other, but two that take one core each run beside each other; the worst status of all.
int evaluate_all(const EvaluateOptions& options, const std::string& command_line) {
  if (!options.config.empty() || !options.assignments.empty()) {
    std::fprintf(stderr, "evaluate all takes neither --config nor --set: not every experiment does\n");
    return kExitUsage;
  }
  const std::uint64_t began_ns = rtbus::monotonic_ns();
  std::vector<OneOfAll> ended;
  for (std::size_t i = 0; i < kExperiments.size(); ++i) {
    if (interrupted()) return kExitFailed;
    const bool pair = i + 1 < kExperiments.size() && kExperiments[i].one_core && kExperiments[i + 1].one_core;
    const auto head = [&](std::size_t which) {
      if (!options.json) std::printf("\n== evaluate %s\n", kExperiments[which].name);
    };
    head(i);
    ended.push_back(start_apart(kExperiments[i], options, command_line, false));
    const std::size_t first = ended.size() - 1;
    if (pair) ended.push_back(start_apart(kExperiments[i + 1], options, command_line, true));
    finish_apart(ended[first]);
    if (!pair) continue;
    head(++i);
    finish_apart(ended.back());
  }
  const double wall_s = rtbus::seconds_between(began_ns, rtbus::monotonic_ns());
  int worst = kExitFine;
  double cpu_s = 0.0;
  std::size_t passed = 0, not_judged = 0;
  std::FILE* const to = options.json ? stderr : stdout;
  std::fprintf(to, "\n  %-16s %8s %8s\n", "experiment", "wall [s]", "CPU [s]");
  for (const OneOfAll& one : ended) {
    worst = std::max(worst, exit_status(one.status));
    passed += one.status == kExitFine ? 1U : 0U;
    not_judged += one.status == kNotJudged ? 1U : 0U;
    cpu_s += one.cpu_s;
    std::fprintf(to, "  %-16s %8.0f %8.0f  %s\n", one.name.c_str(), one.wall_s, one.cpu_s,
                 one.status == kExitFine    ? "passed"
                 : one.status == kNotJudged ? "not judged: the machine was too busy or is too slow"
                 : one.status == kCutShort  ? "interrupted"
                                            : "FAILED");
  }
  std::fprintf(to, "  %-16s %8.0f %8.0f  %zu of %zu experiments passed", "all", wall_s, cpu_s, passed, ended.size());
  if (not_judged > 0) std::fprintf(to, ", %zu not judged", not_judged);
  std::fprintf(to, "\n");
  return worst;
}

int evaluate(const EvaluateOptions& options, const std::string& command_line) {
  if (options.list && options.experiment == "faults") {
    list_faults();
    return kExitFine;
  }
  if (options.list && options.real) {
    for (const RealCell& cell : real_cells()) {
      std::printf("%s: %s\n", cell.name, describe(case_of(cell)).c_str());
    }
    return kExitFine;
  }
  if (options.experiment == kAll) return evaluate_all(options, command_line);
  for (const Row& row : kExperiments) {
    if (options.experiment == row.name) return exit_status(evaluate_one(row, options, command_line));
  }
  return kExitUsage;  // the parser lets no other name through
}

}  // namespace

Action add_evaluate(rtbus::Command command) {
  auto options = std::make_shared<EvaluateOptions>();
  std::vector<std::string> names;
  std::string help;
  for (const Row& row : kExperiments) {
    names.emplace_back(row.name);
    help += std::string(row.name) + ": " + row.what + "; ";
  }
  names.emplace_back(kAll);
  command.option("experiment", options->experiment, help + "all: each of them").required().one_of(names);
  command.flag("--quick", options->quick, "Fewer runs");
  command
      .option("--set", options->assignments,
              "Change a key of the session: --set haptic.0.coupling.stiffness_n_per_m=400")
      .take_all();
  command.option("--config", options->config, "Session file; default: the experiment's own");
  command.option("--out", options->out, "Folder for the results").show_default();
  command.flag("--json", options->json, "Print summary.json instead of tables");
  command.option("--seconds", options->seconds, "work-precision: with --config, how long the session is looked at [s]")
      .range(0.1, 60.0)
      .show_default();
  command.option("--seed", options->seed, "stability: number of the first case; below 10000000 as first drawn")
      .show_default();
  command.option("--cases", options->cases, "stability: how many [100000; with --quick 2000]");
  command.option("--jobs", options->jobs, "stability, network: processes at a time [one per core]");
  command.option("--seeds", options->seeds,
                 "stability: the cases whose numbers begin the lines of this file (a stability_cases.tsv)");
  command.flag("--no-maps", options->no_maps, "stability: the cases alone");
  command.option("--case", options->one_case, "stability: this case alone, with a figure of force and position");
  command.option("--sweep", options->sweep, "network: so many seeded cases instead of the grid");
  command.option("--minutes", options->minutes, "soak: how long [min]").range(0.1, 10000.0).show_default();
  command.option("--soak-seed", options->soak_seed, "soak: of the events and their times").show_default();
  command.flag("--real", options->real,
               "network: twelve cells in real processes on two machines, which are namespaces (status 77: not possible "
               "here)");
  command.flag("--list", options->list, "faults, network --real: print the rows and run nothing");
  command.option("--only", options->only, "faults, network --real: these rows alone, each once")
      .take_all()
      .type_name("ROW");
  return [options] {
    std::string line = "rtbus evaluate " + options->experiment;
    if (options->quick) line += " --quick";
    if (options->real) line += " --real";
    if (options->experiment == "stability") line += " --seed " + std::to_string(options->seed);
    if (options->sweep != 0) line += " --sweep " + std::to_string(options->sweep);
    if (options->cases != 0) line += " --cases " + std::to_string(options->cases);
    for (const std::string& text : options->assignments) line += " --set " + text;
    for (const std::string& row : options->only) line += " --only " + row;
    return evaluate(*options, line);
  };
}

}  // namespace tools
