#pragma once
/// @file experiment.hpp
/// What an `evaluate` or `bench` experiment leaves behind: summary.json (schema rtbus-experiment/1), a TSV per table,
/// figures, and the checks as a table on the terminal. One writer makes them all.
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

namespace tools {

/// A figure held against its bar.
struct Check {
  std::string id;    ///< "drop.fig8_direct.real.settling"
  std::string what;  ///< For people.
  double value = 0.0;
  std::string unit;
  std::string bar;  ///< "0.595…0.805"
  bool pass = false;
};

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

  /// Passes when low ≤ value ≤ high. @returns whether it does.
  bool check_between(std::string id, std::string what, double value, std::string unit, double low, double high);
  bool check_at_least(std::string id, std::string what, double value, std::string unit, double low);
  bool check_at_most(std::string id, std::string what, double value, std::string unit, double high);

  void add_table(Table table);
  void add_figure(const std::filesystem::path& file);
  void add_run(const std::filesystem::path& report);
  /// A remark that belongs to the result: what was left out or could not be had.
  void note(std::string text);

  [[nodiscard]] const std::filesystem::path& folder() const noexcept { return folder_; }

  /// Writes summary.json and the TSVs, prints checks and tables (or, with `json`, the summary) to stdout.
  /// @returns the exit status: 0, or 1 when a check failed or a file could not be written.
  int finish(bool json);

 private:
  void print() const;

  std::string kind_, name_, command_;
  std::filesystem::path folder_;
  std::string started_utc_;
  std::uint64_t started_ns_;
  std::vector<Check> checks_;
  std::vector<Table> tables_;
  std::vector<std::string> figures_, runs_, notes_;
};

}  // namespace tools
