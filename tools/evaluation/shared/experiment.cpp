#include "tools/evaluation/shared/experiment.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <nlohmann/json.hpp>

#include "rtbus/clock.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/common/utc_now.hpp"
#include "tools/cli/host/ask_kernel.hpp"

namespace tools {

namespace {

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

/// For the table on the terminal.
const char* word_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kPass:
      return "pass";
    case Verdict::kMachineTooSlow:
      return "machine too slow";
    case Verdict::kMachineTooBusy:
      return "machine too busy";
    case Verdict::kInterrupted:
    case Verdict::kFail:
      break;
  }
  return "FAIL";
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

const char* to_string(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kPass:
      return "pass";
    case Verdict::kMachineTooSlow:
      return "machine_too_slow";
    case Verdict::kMachineTooBusy:
      return "machine_too_busy";
    case Verdict::kInterrupted:
      return "interrupted";
    case Verdict::kFail:
      break;
  }
  return "fail";
}

Verdict verdict_of(const Check& check) noexcept {
  if (check.pass) return Verdict::kPass;
  switch (check.hindered.by) {
    case Hindrance::kMachineTooSlow:
      return Verdict::kMachineTooSlow;
    case Hindrance::kMachineTooBusy:
      return Verdict::kMachineTooBusy;
    case Hindrance::kNone:
      break;
  }
  return Verdict::kFail;
}

Experiment::Experiment(std::string kind, std::string name, std::string command, std::filesystem::path folder)
    : kind_(std::move(kind)),
      name_(std::move(name)),
      command_(std::move(command)),
      folder_(std::move(folder)),
      started_utc_(utc_now()),
      started_ns_(rtbus::monotonic_ns()) {
  std::filesystem::create_directories(folder_);
}

bool Experiment::add_check(Check check, const MachineLoad& during) {
  if (interrupted()) return false;
  check.pass = check.pass && std::isfinite(check.value);
  if (!check.pass) check.hindered = hindered_by(during);
  checks_.push_back(std::move(check));
  return checks_.back().pass;
}

bool Experiment::check_between(std::string id, std::string what, double value, std::string unit, double low,
                               double high, const MachineLoad& during) {
  return add_check({std::move(id), std::move(what), value, std::move(unit), number(low) + " to " + number(high),
                    value >= low && value <= high},
                   during);
}

bool Experiment::check_at_least(std::string id, std::string what, double value, std::string unit, double low,
                                const MachineLoad& during) {
  return add_check({std::move(id), std::move(what), value, std::move(unit), "at least " + number(low), value >= low},
                   during);
}

bool Experiment::check_at_most(std::string id, std::string what, double value, std::string unit, double high,
                               const MachineLoad& during) {
  return add_check({std::move(id), std::move(what), value, std::move(unit), "at most " + number(high), value <= high},
                   during);
}

Verdict Experiment::verdict() const noexcept {
  if (interrupted()) return Verdict::kInterrupted;
  Verdict worst = Verdict::kPass;
  for (const Check& check : checks_) worst = std::max(worst, verdict_of(check));
  return worst;
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
    rows.push_back({check.what, number(check.value) + " " + check.unit, check.bar, word_of(verdict_of(check))});
  }
  print_aligned(rows);
  print_not_judged();
  for (const std::string& note : notes_) std::printf("note: %s\n", note.c_str());
  std::printf("\nfiles in %s:", folder_.c_str());
  for (const std::string& figure : figures_) std::printf(" %s", std::filesystem::path(figure).filename().c_str());
  std::printf(" summary.json\n");
}

void Experiment::print_interrupted() const {
  std::printf("interrupted after %.0f s: %s %s has no verdict; what it measured until then is in %s\n",
              rtbus::seconds_between(started_ns_, rtbus::monotonic_ns()), kind_.c_str(), name_.c_str(),
              folder_.c_str());
}

void Experiment::print_not_judged() const {
  const auto not_judged = [](const Check& check) { return check.hindered.by != Hindrance::kNone; };
  const auto count = std::count_if(checks_.begin(), checks_.end(), not_judged);
  if (count == 0) return;
  std::printf("\n%td of %zu checks are not judged: this machine could not do what they ask for\n", count,
              checks_.size());
  bool busy = false;
  for (const Check& check : checks_) {
    if (!not_judged(check)) continue;
    busy = busy || check.hindered.by == Hindrance::kMachineTooBusy;
    std::printf("  %s: %s\n", check.id.c_str(), check.hindered.evidence.c_str());
  }
  std::printf("%s, then run the experiment again. A check that is not judged has not passed: exit status 1.\n",
              busy ? "End what else runs on this machine" : "Take a faster machine");
}

int Experiment::finish(bool json) {
  const Verdict ended = verdict();  // once: a signal that comes now is too late to cut anything short
  if (ended == Verdict::kInterrupted) notes_.insert(notes_.begin(), "interrupted: tables and checks are not complete");
  nlohmann::json checks = nlohmann::json::array();
  for (const Check& check : checks_) {
    checks.push_back({{"id", check.id},
                      {"what", check.what},
                      {"value", json_of(check.value)},
                      {"unit", check.unit},
                      {"bar", check.bar},
                      {"pass", check.pass},
                      {"verdict", to_string(verdict_of(check))},
                      {"evidence", check.hindered.evidence}});
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
      {"verdict", to_string(ended)},
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
  } else if (ended == Verdict::kInterrupted) {
    print_interrupted();
  } else {
    print();
  }
  if (!out) {
    std::fprintf(stderr, "cannot write %s\n", file.c_str());
    return kExitFailed;
  }
  return ended == Verdict::kPass ? kExitFine : kExitFailed;
}

int Experiment::run(const std::function<void()>& measure, bool json) {
  try {
    measure();
  } catch (const std::exception&) {
    if (!interrupted()) throw;
  }
  return finish(json);
}

}  // namespace tools
