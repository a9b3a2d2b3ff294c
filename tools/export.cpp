// `rtbus export FILE.h5 --csv`: a recording as text.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "rtbus/recording/reader.hpp"
#include "tools/command.hpp"
#include "tools/field_format.hpp"
#include "tools/interrupt.hpp"

namespace tools {
namespace {

using rtbus::recording::RecordedTopic;
using rtbus::recording::Recording;

struct ExportOptions {
  std::string file;
  std::vector<std::string> topics;
  std::string output;
  bool csv = false;
};

constexpr std::uint64_t kRowsAtOnce = 8192;

bool write_csv(const Recording& recording, const RecordedTopic& topic, std::ostream& out) {
  out << csv_header(topic.fields) << '\n';
  for (std::uint64_t first = 0; first < topic.rows && !interrupted(); first += kRowsAtOnce) {
    const auto stamps = recording.stamps_ns(topic, first, kRowsAtOnce);
    const auto sequences = recording.sequences(topic, first, kRowsAtOnce);
    const auto samples = recording.samples(topic, first, kRowsAtOnce);
    if (stamps.empty() || sequences.size() != stamps.size() || samples.size() != stamps.size() * topic.sample_bytes) {
      return false;
    }
    for (std::size_t i = 0; i < stamps.size(); ++i) {
      const std::span<const std::byte> bytes(samples.data() + i * topic.sample_bytes, topic.sample_bytes);
      out << csv_row({sequences[i], stamps[i], bytes}, topic.fields) << '\n';
    }
  }
  return static_cast<bool>(out);
}

void print_contents(const Recording& recording) {
  std::printf("%s: session %s, started %s, version %s, %s\n", recording.path().c_str(), recording.session().c_str(),
              recording.started_utc().c_str(), recording.version().c_str(),
              recording.complete() ? "complete" : "cut off or still growing");
  for (const RecordedTopic& topic : recording.topics()) {
    std::printf("  %-32s %-22s %10llu rows  %llu dropped\n", topic.name.c_str(), topic.type_name.c_str(),
                static_cast<unsigned long long>(topic.rows), static_cast<unsigned long long>(topic.dropped));
  }
  for (const auto& mark : recording.marks()) {
    std::printf("  mark at %10.3f s  %s\n",
                1e-9 * static_cast<double>(static_cast<std::int64_t>(mark.stamp_ns - recording.started_monotonic_ns())),
                mark.text.c_str());
  }
}

int run_export(const ExportOptions& options) {
  const auto recording = Recording::open(options.file);
  if (!recording) {
    std::cerr << "rtbus export: " << recording.error().message << '\n';
    return kExitFailed;
  }
  if (!options.csv) {
    print_contents(*recording);
    return kExitFine;
  }
  std::vector<const RecordedTopic*> chosen;
  for (const RecordedTopic& topic : recording->topics()) {
    const bool wanted = options.topics.empty() ||
                        std::any_of(options.topics.begin(), options.topics.end(),
                                    [&](const auto& name) { return topic.name.find(name) != std::string::npos; });
    if (wanted) chosen.push_back(&topic);
  }
  if (chosen.empty()) {
    std::cerr << "rtbus export: " << options.file << " has no such topic; it has:\n";
    for (const RecordedTopic& topic : recording->topics()) std::cerr << "  " << topic.name << '\n';
    return kExitUsage;
  }
  if (options.output == "-") {
    if (chosen.size() > 1) {
      std::cerr << "rtbus export: only one topic fits onto the standard output; choose with --topics\n";
      return kExitUsage;
    }
    return write_csv(*recording, *chosen[0], std::cout) ? kExitFine : kExitFailed;
  }
  const std::filesystem::path folder = options.output.empty()
                                           ? std::filesystem::path(options.file).replace_extension("")
                                           : std::filesystem::path(options.output);
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) {
    std::cerr << "rtbus export: cannot make the folder " << folder.string() << ": " << failed.message() << '\n';
    return kExitFailed;
  }
  for (const RecordedTopic* const topic : chosen) {
    const std::filesystem::path path = folder / (topic->name + ".csv");
    std::ofstream out(path);
    if (!write_csv(*recording, *topic, out) || !out.flush()) {
      std::cerr << "rtbus export: cannot write " << path.string() << '\n';
      return kExitFailed;
    }
    std::printf("%s  %llu rows\n", path.c_str(), static_cast<unsigned long long>(topic->rows));
  }
  if (const auto marks = recording->marks(); !marks.empty()) {
    std::ofstream out(folder / "marks.csv");
    out << "stamp_ns [ns],text\n";
    for (const auto& mark : marks) {
      std::string quoted;
      for (const char c : mark.text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
      out << mark.stamp_ns << ",\"" << quoted << "\"\n";
    }
    std::printf("%s  %zu rows\n", (folder / "marks.csv").c_str(), marks.size());
  }
  return kExitFine;
}

}  // namespace

Action add_export(CLI::App& command) {
  auto options = std::make_shared<ExportOptions>();
  command.add_option("FILE", options->file, "Recording made by `rtbus record`")->required();
  command.add_flag("--csv", options->csv, "A CSV file per topic; without it: what the recording holds");
  command.add_option("-t,--topics", options->topics, "Only topics whose names contain this (several allowed)");
  command.add_option("-o,--output", options->output,
                     "Folder for the CSV files, or - for the standard output (default: FILE without .h5)");
  return [options] { return run_export(*options); };
}

}  // namespace tools
