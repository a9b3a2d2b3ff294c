#include "tools/experiment.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "rtbus/clock.hpp"
#include "tools/ask_kernel.hpp"
#include "tools/command.hpp"

namespace tools {

namespace {

std::string utc_now() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string text_of(const Cell& cell) {
  return std::holds_alternative<double>(cell) ? number(std::get<double>(cell)) : std::get<std::string>(cell);
}

nlohmann::json json_of(double value) {
  // JSON has no infinity and no NaN.
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json json_of(const Table& table) {
  nlohmann::json rows = nlohmann::json::array();
  for (const auto& row : table.rows) {
    nlohmann::json cells = nlohmann::json::array();
    for (const Cell& cell : row) {
      cells.push_back(std::holds_alternative<double>(cell) ? json_of(std::get<double>(cell))
                                                           : nlohmann::json(std::get<std::string>(cell)));
    }
    rows.push_back(cells);
  }
  return {{"name", table.name}, {"columns", table.columns}, {"rows", rows}};
}

/// Columns as wide as their widest cell; the first to the left, the rest to the right.
void print_aligned(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> width;
  for (const auto& row : rows) {
    width.resize(std::max(width.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) width[i] = std::max(width[i], row[i].size());
  }
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      std::printf(i == 0 ? "  %-*s" : "  %*s", static_cast<int>(width[i]), row[i].c_str());
    }
    std::printf("\n");
  }
}

}  // namespace

Experiment::Experiment(std::string kind, std::string name, std::string command, std::filesystem::path folder)
    : kind_(std::move(kind)),
      name_(std::move(name)),
      command_(std::move(command)),
      folder_(std::move(folder)),
      started_utc_(utc_now()),
      started_ns_(rtbus::monotonic_ns()) {
  std::filesystem::create_directories(folder_);
}

bool Experiment::check_between(std::string id, std::string what, double value, std::string unit, double low,
                               double high) {
  const bool pass = std::isfinite(value) && value >= low && value <= high;
  checks_.push_back(
      {std::move(id), std::move(what), value, std::move(unit), number(low) + " to " + number(high), pass});
  return pass;
}

bool Experiment::check_at_least(std::string id, std::string what, double value, std::string unit, double low) {
  const bool pass = std::isfinite(value) && value >= low;
  checks_.push_back({std::move(id), std::move(what), value, std::move(unit), "at least " + number(low), pass});
  return pass;
}

bool Experiment::check_at_most(std::string id, std::string what, double value, std::string unit, double high) {
  const bool pass = std::isfinite(value) && value <= high;
  checks_.push_back({std::move(id), std::move(what), value, std::move(unit), "at most " + number(high), pass});
  return pass;
}

void Experiment::add_table(Table table) { tables_.push_back(std::move(table)); }
void Experiment::add_figure(const std::filesystem::path& file) { figures_.push_back(file.string()); }
void Experiment::add_run(const std::filesystem::path& report) { runs_.push_back(report.string()); }
void Experiment::note(std::string text) { notes_.push_back(std::move(text)); }

void Experiment::print() const {
  for (const Table& table : tables_) {
    std::printf("\n%s\n", table.name.c_str());
    std::vector<std::vector<std::string>> rows{table.columns};
    for (const auto& row : table.rows) {
      rows.emplace_back();
      for (const Cell& cell : row) rows.back().push_back(text_of(cell));
    }
    print_aligned(rows);
  }
  std::printf("\nchecks\n");
  std::vector<std::vector<std::string>> rows{{"check", "value", "bar", "verdict"}};
  for (const Check& check : checks_) {
    rows.push_back({check.what, number(check.value) + " " + check.unit, check.bar, check.pass ? "pass" : "FAIL"});
  }
  print_aligned(rows);
  for (const std::string& note : notes_) std::printf("note: %s\n", note.c_str());
  std::printf("\nfiles in %s:", folder_.c_str());
  for (const std::string& figure : figures_) std::printf(" %s", std::filesystem::path(figure).filename().c_str());
  std::printf(" summary.json\n");
}

int Experiment::finish(bool json) {
  nlohmann::json checks = nlohmann::json::array();
  bool passed = true;
  for (const Check& check : checks_) {
    checks.push_back({{"id", check.id},
                      {"what", check.what},
                      {"value", json_of(check.value)},
                      {"unit", check.unit},
                      {"bar", check.bar},
                      {"pass", check.pass}});
    passed = passed && check.pass;
  }
  nlohmann::json tables = nlohmann::json::array();
  for (const Table& table : tables_) {
    tables.push_back(json_of(table));
    std::ofstream tsv(folder_ / (table.name + ".tsv"));
    for (std::size_t i = 0; i < table.columns.size(); ++i) tsv << (i == 0 ? "# " : "\t") << table.columns[i];
    tsv << '\n';
    for (const auto& row : table.rows) {
      for (std::size_t i = 0; i < row.size(); ++i) tsv << (i == 0 ? "" : "\t") << text_of(row[i]);
      tsv << '\n';
    }
  }
  const MachineFacts machine = ask_machine();
  const nlohmann::json summary{
      {"schema", "rtbus-experiment/1"},
      {"kind", kind_},
      {"name", name_},
      {"command", command_},
      {"version", RTBUS_VERSION},
      {"machine", {{"cpu", machine.cpu}, {"cores", machine.cores}, {"kernel", machine.kernel}}},
      {"started_utc", started_utc_},
      {"wall_s", rtbus::seconds_between(started_ns_, rtbus::monotonic_ns())},
      {"checks", checks},
      {"tables", tables},
      {"figures", figures_},
      {"runs", runs_},
      {"notes", notes_},
  };
  const std::filesystem::path file = folder_ / "summary.json";
  std::ofstream out(file);
  out << summary.dump(2) << '\n';
  out.close();
  if (json) {
    std::printf("%s\n", summary.dump(2).c_str());
  } else {
    print();
  }
  if (!out) {
    std::fprintf(stderr, "cannot write %s\n", file.c_str());
    return kExitFailed;
  }
  return passed ? kExitFine : kExitFailed;
}

}  // namespace tools
