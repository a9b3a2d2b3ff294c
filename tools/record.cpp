// `rtbus record FILE.h5`: every sample of a session into HDF5, at full rate.
#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "tools/choose.hpp"
#include "tools/command.hpp"
#include "tools/field_format.hpp"
#include "tools/interrupt.hpp"
#include "tools/recorder.hpp"

namespace tools {
namespace {

struct RecordOptions {
  std::string file;
  std::optional<std::string> session;
  std::vector<std::string> topics;
  std::optional<double> duration_s;
  int compression = 0;
  std::uint64_t reserve_mib = rtbus::recording::kReserveBytes >> 20;
  bool json = false;
};

constexpr std::uint64_t kDrainPeriod_ns = 20 * rtbus::kNsPerMs;
constexpr std::uint64_t kFlushPeriod_ns = rtbus::kNsPerS;

double cpu_s() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// What is known while it runs and at its end.
struct Summary {
  RecorderFigures figures;
  double duration_s = 0.0;
  double cpu_per_s = 0.0;
  std::uint64_t file_bytes = 0;
};

std::string line_of(const Summary& now) {
  char text[160];
  std::snprintf(text, sizeof text, "%7.1f s  %10llu samples  %llu dropped  %llu marks  %8.1f MiB", now.duration_s,
                static_cast<unsigned long long>(now.figures.samples),
                static_cast<unsigned long long>(now.figures.dropped),
                static_cast<unsigned long long>(now.figures.marks), static_cast<double>(now.file_bytes) / (1 << 20));
  return text;
}

int finish(const RecordOptions& options, const Summary& sum, const std::optional<rtbus::recording::Fault>& fault) {
  if (options.json) {
    nlohmann::ordered_json report = {{"schema", "rtbus-record/1"},     {"file", options.file},
                                     {"duration_s", sum.duration_s},   {"topics", sum.figures.topics},
                                     {"samples", sum.figures.samples}, {"dropped", sum.figures.dropped},
                                     {"marks", sum.figures.marks},     {"file_bytes", sum.file_bytes},
                                     {"cpu_s_per_s", sum.cpu_per_s},   {"fault", nullptr}};
    if (fault) report["fault"] = fault->message;
    std::cout << json_line(report) << '\n';
  } else {
    std::printf("%s: %zu topics, %s, %.2f %% of one core\n", options.file.c_str(), sum.figures.topics,
                line_of(sum).c_str(), 100.0 * sum.cpu_per_s);
  }
  if (fault) std::cerr << "rtbus record: " << fault->message << '\n';
  return fault ? kExitFailed : kExitFine;
}

int record(const RecordOptions& options) {
  const auto session = choose_session(rtbus::list_topics(), options.session);
  if (!session) {
    std::cerr << "rtbus record: " << session.error().message << '\n';
    return session.error().exit_status;
  }
  auto about = describe_session(*session);
  about.compression = options.compression;
  about.reserve_bytes = options.reserve_mib << 20;
  auto writer = rtbus::recording::Writer::create(options.file, std::move(about));
  if (!writer) {
    std::cerr << "rtbus record: " << writer.error().message << '\n';
    return kExitFailed;
  }
  rtbus::Session where;
  where.name = *session;
  Recorder recorder(where, std::move(*writer), options.topics);
  const bool progress = ::isatty(STDOUT_FILENO) == 1 && !options.json;
  const std::uint64_t begin_ns = rtbus::monotonic_ns();
  std::uint64_t flush_ns = begin_ns + kFlushPeriod_ns;
  std::optional<rtbus::recording::Fault> fault;
  bool seen_alive = false;
  const auto summary = [&] {
    const double elapsed_s = rtbus::seconds_between(begin_ns, rtbus::monotonic_ns());
    return Summary{recorder.figures(), elapsed_s, elapsed_s > 0 ? cpu_s() / elapsed_s : 0.0, recorder.file_bytes()};
  };
  const auto keep = [&](const rtbus::Result<void, rtbus::recording::Fault>& done) {
    if (!done && !fault) fault = done.error();
    return done.has_value();
  };
  if (keep(recorder.attach()) && recorder.figures().topics == 0) {
    (void)recorder.close();
    (void)::unlink(options.file.c_str());
    std::cerr << "rtbus record: no topic of the session " << *session << " is called so; `rtbus list` shows them\n";
    return kExitUsage;
  }
  while (!fault && !interrupted()) {
    if (!keep(recorder.drain())) break;
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (options.duration_s && rtbus::seconds_between(begin_ns, now_ns) >= *options.duration_s) break;
    if (now_ns >= flush_ns) {
      flush_ns = now_ns + kFlushPeriod_ns;
      if (!keep(recorder.flush()) || !keep(recorder.attach())) break;
      const bool alive = recorder.writers_alive();
      if (seen_alive && !alive && !progress && !options.json)
        std::puts("the nodes have ended; waiting for them (Ctrl-C ends)");
      seen_alive = alive;
      if (progress) std::printf("\r%s", line_of(summary()).c_str()), std::fflush(stdout);
    }
    sleep_unless_interrupted(kDrainPeriod_ns);
  }
  if (!fault) (void)keep(recorder.drain());
  const Summary sum = summary();
  (void)keep(recorder.close());
  if (progress) std::printf("\r");
  Summary last = sum;
  last.file_bytes = recorder.file_bytes();
  return finish(options, last, fault);
}

}  // namespace

Action add_record(CLI::App& command) {
  auto options = std::make_shared<RecordOptions>();
  command.add_option("FILE", options->file, "HDF5 file to create, for example trial1.h5")->required();
  command.add_option("-s,--session", options->session, "Session; not needed while only one is live");
  command.add_option("-t,--topics", options->topics,
                     "Only topics whose names begin so (several allowed); without it all but the body poses");
  command.add_option("-d,--duration", options->duration_s, "End after so many seconds (without it: Ctrl-C)")
      ->check(CLI::PositiveNumber);
  command.add_option("--compress", options->compression, "Deflate level 0…9; costs time, saves about half the space")
      ->check(CLI::Range(0, 9))
      ->capture_default_str();
  command.add_option("--reserve", options->reserve_mib, "Ends in order when the disk has less left [MiB]")
      ->check(CLI::Range(0, 1 << 20))
      ->capture_default_str();
  command.add_flag("--json", options->json, "Only the final figures, as JSON");
  command.footer(
      "Records every tick and step of the session at full rate, and survives the nodes' restarts. What is older than\n"
      "one second survives kill -9 of this program. Read the file with `rtbus export`, `rtbus plot`, h5dump, h5py or\n"
      "MATLAB (docs/recording.md). `rtbus mark TEXT` notes an event in it.");
  return [options] { return record(*options); };
}

}  // namespace tools
