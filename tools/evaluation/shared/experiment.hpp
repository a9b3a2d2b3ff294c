#pragma once
/// @file experiment.hpp
/// What an `evaluate` or `bench` experiment leaves behind: summary.json (schema rtbus-experiment/1), a TSV per table,
/// figures, and the checks as a table on the terminal. One writer makes them all.
#include <filesystem>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "tools/evaluation/shared/machine_load.hpp"

namespace tools {

/// A figure held against its bar.
struct Check {
  std::string id;    ///< "drop.fig8_direct.real.settling"
  std::string what;  ///< For people.
  double value = 0.0;
  std::string unit;
  std::string bar;  ///< "0.595…0.805"
  bool pass = false;
  Hindered hindered = {};  ///< Of a check that did not pass: what else than the program may be the reason.
};

/// Of one check, or of all: the worst one, a failure before what could not be judged. kInterrupted is only of all: the
/// experiment was not finished.
enum class Verdict : std::uint8_t { kPass, kMachineTooSlow, kMachineTooBusy, kFail, kInterrupted };
[[nodiscard]] const char* to_string(Verdict verdict) noexcept;  ///< As in summary.json: "machine_too_busy".
[[nodiscard]] Verdict verdict_of(const Check& check) noexcept;

using Cell = std::variant<double, std::string>;

struct Table {
  std::string name;                  ///< File name of its TSV, without the suffix.
  std::vector<std::string> columns;  ///< With units: "settling [s]".
  std::vector<std::vector<Cell>> rows;
};

/// Builds the summary of one experiment. Not thread-safe.
class Experiment {
 public:
  /// @param kind "evaluate" or "bench". @param command As the user typed it. @param folder Made when missing.
  Experiment(std::string kind, std::string name, std::string command, std::filesystem::path folder);

  /// Passes when low ≤ value ≤ high. After a signal has come, a check is neither kept nor passed: its figure belongs to
  /// a measurement that was cut short. @param during Of a figure that real time has a part in: what the machine gave
  /// while it was measured. If that was too little, a value outside its bar is no failure, and no pass. @returns
  /// whether it passes.
  bool check_between(std::string id, std::string what, double value, std::string unit, double low, double high,
                     const MachineLoad& during = {});
  bool check_at_least(std::string id, std::string what, double value, std::string unit, double low,
                      const MachineLoad& during = {});
  bool check_at_most(std::string id, std::string what, double value, std::string unit, double high,
                     const MachineLoad& during = {});

  void add_table(Table table);
  void add_figure(const std::filesystem::path& file);
  void add_run(const std::filesystem::path& report);
  /// A remark that belongs to the result: what was left out or could not be had.
  void note(std::string text);

  [[nodiscard]] const std::filesystem::path& folder() const noexcept { return folder_; }

  /// Writes summary.json and the TSVs, prints checks and tables (or, with `json`, the summary) to stdout.
  /// @returns the exit status: 0, or 1 when a check did not pass or a file could not be written. A check that could not
  /// be judged has not passed: whoever trusts status 0 may rely on every figure.
  int finish(bool json);

  /// `measure`, then finish(). What it throws once a signal has come is no fault: something that it waited for did not
  /// come.
  int run(const std::function<void()>& measure, bool json);

  /// Of all checks so far; kInterrupted once a signal has come.
  [[nodiscard]] Verdict verdict() const noexcept;

 private:
  void print() const;
  void print_interrupted() const;
  void print_not_judged() const;
  bool add_check(Check check, const MachineLoad& during);

  std::string kind_, name_, command_;
  std::filesystem::path folder_;
  std::string started_utc_;
  std::uint64_t started_ns_;
  std::vector<Check> checks_;
  std::vector<Table> tables_;
  std::vector<std::string> figures_, runs_, notes_;
};

}  // namespace tools
