// `rtbus export FILE.h5`: what a recording holds, as text; `--episodes`: cut into demonstrations.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "rtbus/recording/reader.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/field_format.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/recording/export_bodies.hpp"
#include "tools/cli/recording/merged_clocks.hpp"

namespace tools {
namespace {

using rtbus::recording::RecordedTopic;
using rtbus::recording::Recording;

struct ExportOptions {
  std::string file;
  std::vector<std::string> merge;
  std::vector<std::string> topics;
  std::string output, episodes, haptic = "haptic0";
  std::optional<std::uint64_t> button;
  bool csv = false;
};

constexpr std::uint64_t kRowsAtOnce = 8192;

/// @param clocks Its stamps go onto the clock of the recording that it is merged with; null: they stay.
bool write_csv(const Recording& recording, const RecordedTopic& topic, std::ostream& out,
               const MergedClocks* clocks = nullptr) {
  if (clocks == nullptr && has_named_bodies(recording, topic)) {
    (void)write_named_bodies(recording, topic, out);
    return static_cast<bool>(out);
  }
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
      const std::int64_t stamp_ns =
          clocks != nullptr ? clocks->on_first(stamps[i]) : static_cast<std::int64_t>(stamps[i]);
      if (stamp_ns < 0) continue;  // before the other machine was started
      out << csv_row({sequences[i], static_cast<std::uint64_t>(stamp_ns), bytes}, topic.fields) << '\n';
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

/// Becomes the Python package's rtbus.episodes, which does it.
int cut_into_episodes(const ExportOptions& options) {
  const char* const finds_it =
      "import sys\n"
      "try:\n"
      "    import h5py, rtbus.episodes\n"
      "except ImportError as error:\n"
      "    sys.exit(f'rtbus export --episodes: {error}; install python3-rtbus and python3-h5py')\n"
      "sys.exit(rtbus.episodes.main())";
  // The one that the packages are for. Python finds its packages by its own name: a short one is looked for in the
  // PATH.
  const char* const python = "/usr/bin/python3";
  std::vector<std::string> words{python,           "-c",       finds_it,      options.file, "-o",
                                 options.episodes, "--haptic", options.haptic};
  if (options.button) words.insert(words.end(), {"--button", std::to_string(*options.button)});
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  ::execv(python, arguments.data());
  std::fprintf(stderr, "rtbus export --episodes: %s: %s\n", python, std::strerror(errno));
  return kExitFailed;
}

bool wanted(const ExportOptions& options, const RecordedTopic& topic) {
  return options.topics.empty() || std::any_of(options.topics.begin(), options.topics.end(), [&](const auto& name) {
           return topic.name.find(name) != std::string::npos;
         });
}

/// Two recordings of one session, made on its two machines, on the clock of the first.
int merge(const ExportOptions& options) {
  if (options.merge.size() != 2) {
    std::cerr << "rtbus export: --merge takes two recordings, one of each machine: --merge HERE.h5 THERE.h5\n";
    return kExitUsage;
  }
  const auto failed = [](const std::string& why) {
    std::cerr << "rtbus export: " << why << '\n';
    return kExitFailed;
  };
  const auto first = Recording::open(options.merge[0]);
  if (!first) return failed(first.error().message);
  const auto second = Recording::open(options.merge[1]);
  if (!second) return failed(second.error().message);
  const auto clocks = MergedClocks::of(*first, *second);
  if (!clocks) return failed(clocks.error());

  const std::filesystem::path folder = options.output.empty() ? "merged" : std::filesystem::path(options.output);
  std::uint64_t from_ns = UINT64_MAX, until_ns = 0;
  double error_s = 0.0;
  for (const auto& [recording, name, shift] : {std::tuple(&*first, "first", static_cast<const MergedClocks*>(nullptr)),
                                               std::tuple(&*second, "second", &*clocks)}) {
    std::error_code error;
    std::filesystem::create_directories(folder / name, error);
    if (error) return failed("cannot make the folder " + (folder / name).string() + ": " + error.message());
    for (const RecordedTopic& topic : recording->topics()) {
      if (!wanted(options, topic)) continue;
      const std::filesystem::path path = folder / name / (topic.name + ".csv");
      std::ofstream out(path);
      if (!write_csv(*recording, topic, out, shift) || !out.flush()) return failed("cannot write " + path.string());
      std::printf("%s  %llu rows\n", path.c_str(), static_cast<unsigned long long>(topic.rows));
      if (shift == nullptr) continue;
      for (const std::uint64_t stamp_ns : recording->stamps_ns(topic)) {
        from_ns = std::min(from_ns, stamp_ns);
        until_ns = std::max(until_ns, stamp_ns);
        error_s = std::max(error_s, clocks->error_s(stamp_ns));
      }
    }
  }
  if (until_ns == 0) return failed(second->path() + " has no such topic");
  const auto less_s = [&](std::uint64_t stamp_ns) {
    return 1e-9 * static_cast<double>(static_cast<std::int64_t>(stamp_ns) - clocks->on_first(stamp_ns));
  };
  std::printf(
      "the stamps of %s are on the clock of %s: less %.6f s at its beginning and %.6f s at its end, off by at most "
      "%.6f s (%s)\n",
      second->path().c_str(), first->path().c_str(), less_s(from_ns), less_s(until_ns), error_s,
      clocks->source().c_str());
  return kExitFine;
}

int run_export(const ExportOptions& options) {
  if (!options.merge.empty()) return merge(options);
  if (options.file.empty()) {
    std::cerr << "rtbus export: which recording? rtbus export FILE.h5, or --merge HERE.h5 THERE.h5\n";
    return kExitUsage;
  }
  if (!options.episodes.empty()) return cut_into_episodes(options);
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
    if (wanted(options, topic)) chosen.push_back(&topic);
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

Action add_export(rtbus::Command command) {
  auto options = std::make_shared<ExportOptions>();
  command.option("FILE", options->file, "Recording made by `rtbus record`");
  command
      .option("--merge", options->merge,
              "Two recordings of one session, made on its two machines: CSV files of both, on the clock of the first")
      .type_name("HERE.h5 THERE.h5");
  command.flag("--csv", options->csv, "A CSV file per topic; without it: what the recording holds");
  command.option("-t,--topics", options->topics, "Only topics whose names contain this (several allowed)");
  command.option("-o,--output", options->output,
                 "Folder for the CSV files, or - for the standard output (default: FILE without .h5)");
  command
      .option("--episodes", options->episodes,
              "Write demonstrations for robot learning, one from each mark to the next, into this HDF5 file")
      .type_name("OUT.h5");
  command.option("--button", options->button, "With --episodes: one for each time that this button is held");
  command.option("--haptic", options->haptic, "With --episodes: whose hand").show_default();
  return [options] { return run_export(*options); };
}

}  // namespace tools
