// `rtbus record FILE.h5`: every sample of a session into HDF5, at full rate.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/field_format.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/recording/recorder.hpp"
#include "tools/cli/recording/session_description.hpp"

namespace tools {
namespace {

struct RecordOptions {
  std::string file;
  std::optional<std::string> session;
  RecordedTopics topics;
  std::vector<std::string> more;  ///< --with.
  bool wait = false;
  SessionStart start;  ///< Of a session whose nodes are still to come.
  std::optional<double> duration_s;
  int compression = 0;
  std::uint64_t reserve_mib = rtbus::recording::kReserveBytes >> 20;
  bool json = false;
};

constexpr std::uint64_t kDrainPeriod_ns = 20 * rtbus::kNsPerMs;
constexpr std::uint64_t kFlushPeriod_ns = rtbus::kNsPerS;
/// A device may take some time to open.
constexpr std::uint64_t kReplayPatience_ns = 5 * rtbus::kNsPerS;
/// The rings of a node hold two seconds: a recorder that looks so often misses nothing of a node that has just begun.
constexpr std::uint64_t kAttachPeriod_ns = 200 * rtbus::kNsPerMs;

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
  std::string why_no_replay;
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
    nlohmann::ordered_json report = {{"schema", "rtbus-record/1"},
                                     {"file", options.file},
                                     {"duration_s", sum.duration_s},
                                     {"topics", sum.figures.topics},
                                     {"samples", sum.figures.samples},
                                     {"dropped", sum.figures.dropped},
                                     {"marks", sum.figures.marks},
                                     {"file_bytes", sum.file_bytes},
                                     {"cpu_s_per_s", sum.cpu_per_s},
                                     {"fault", nullptr},
                                     {"replayable", sum.why_no_replay.empty()}};
    if (!sum.why_no_replay.empty()) report["why_no_replay"] = sum.why_no_replay;
    if (fault) report["fault"] = fault->message;
    std::cout << json_line(report) << '\n';
  } else {
    std::printf("%s: %zu topics, %s, %.2f %% of one core\n", options.file.c_str(), sum.figures.topics,
                line_of(sum).c_str(), 100.0 * sum.cpu_per_s);
  }
  if (fault) std::cerr << "rtbus record: " << fault->message << '\n';
  return fault ? kExitFailed : kExitFine;
}

/// The session to record; with --wait once a node of it lives. Nothing: a signal came.
rtbus::Result<std::optional<std::string>, Refusal> find_live_session(const RecordOptions& options) {
  const bool told = options.wait && !options.json;
  for (bool first = true;; first = false) {
    const auto topics = rtbus::list_topics();
    if (!options.wait) {
      auto session = choose_session(topics, options.session);
      if (!session) return rtbus::Failure{session.error()};
      return std::optional(*session);
    }
    const auto live = sessions_in(topics, true);
    if (options.session && std::find(live.begin(), live.end(), *options.session) != live.end()) return options.session;
    if (!options.session && live.size() == 1) return std::optional(live.front());
    if (!options.session && live.size() > 1) {
      auto session = choose_session(topics, {});
      if (!session) return rtbus::Failure{session.error()};
    }
    if (first && told) {
      std::printf("waiting for %s (Ctrl-C ends)\n",
                  options.session ? ("the session " + *options.session).c_str() : "a session");
      std::fflush(stdout);
    }
    if (!sleep_unless_interrupted(kDrainPeriod_ns)) return std::optional<std::string>();
  }
}

/// Tells what is wrong with the recording for a replay, once, and again when that changes.
class ReplayWatch {
 public:
  void look(const Recorder& recorder) {
    std::string why = recorder.why_no_replay();
    // Lost samples are counted on: the first are worth a line.
    if (!why.empty() && told_.empty()) std::cerr << "rtbus record: this cannot be replayed: " << why << '\n';
    if (!why.empty()) told_ = std::move(why);
  }

 private:
  std::string told_;
};

int record(const RecordOptions& options) {
  const auto found = find_live_session(options);
  if (!found) {
    std::cerr << "rtbus record: " << found.error().message << '\n';
    return found.error().exit_status;
  }
  if (!*found) return kExitFine;
  const std::string& session = **found;
  // The others of its nodes are about to come; what they write meanwhile stays in their rings.
  if (options.wait && options.start.file.empty() && !sleep_unless_interrupted(kAttachPeriod_ns)) return kExitFine;
  auto about = options.start.file.empty() ? describe_session(session) : describe_session(session, options.start);
  about.compression = options.compression;
  about.reserve_bytes = options.reserve_mib << 20;
  auto writer = rtbus::recording::Writer::create(options.file, std::move(about));
  if (!writer) {
    std::cerr << "rtbus record: " << writer.error().message << '\n';
    return kExitFailed;
  }
  rtbus::Session where;
  where.name = session;
  Recorder recorder(where, std::move(*writer), options.topics);
  const bool progress = ::isatty(STDOUT_FILENO) == 1 && !options.json;
  const std::uint64_t begin_ns = rtbus::monotonic_ns();
  std::uint64_t flush_ns = begin_ns + kFlushPeriod_ns;
  std::optional<rtbus::recording::Fault> fault;
  bool seen_alive = false;
  const auto summary = [&] {
    const double elapsed_s = rtbus::seconds_between(begin_ns, rtbus::monotonic_ns());
    return Summary{recorder.figures(), elapsed_s, elapsed_s > 0 ? cpu_s() / elapsed_s : 0.0, recorder.file_bytes(),
                   recorder.why_no_replay()};
  };
  const auto keep = [&](const rtbus::Result<void, rtbus::recording::Fault>& done) {
    if (!done && !fault) fault = done.error();
    return done.has_value();
  };
  if (keep(recorder.attach()) && recorder.figures().topics == 0 && !options.wait) {
    (void)recorder.close();
    (void)::unlink(options.file.c_str());
    std::cerr << "rtbus record: no topic of the session " << session << " is called so; `rtbus list` shows them\n";
    return kExitUsage;
  }
  ReplayWatch replay;
  std::uint64_t attach_ns = begin_ns + kAttachPeriod_ns;
  while (!fault && !interrupted()) {
    if (!keep(recorder.drain())) break;
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (options.wait && now_ns >= attach_ns) {  // nodes that are started now are heard from their first sample
      attach_ns = now_ns + kAttachPeriod_ns;
      if (!keep(recorder.attach())) break;
    }
    if (options.duration_s && rtbus::seconds_between(begin_ns, now_ns) >= *options.duration_s) break;
    if (now_ns >= flush_ns) {
      flush_ns = now_ns + kFlushPeriod_ns;
      if (!keep(recorder.flush()) || !keep(recorder.attach())) break;
      const bool alive = recorder.writers_alive();
      if (seen_alive && !alive && !progress && !options.json)
        std::puts("the nodes have ended; waiting for them (Ctrl-C ends)");
      seen_alive = alive;
      if (now_ns >= begin_ns + kReplayPatience_ns) replay.look(recorder);
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

Action add_record(rtbus::Command command) {
  auto options = std::make_shared<RecordOptions>();
  command.option("FILE", options->file, "HDF5 file to create, for example trial1.h5").required();
  command.option("-s,--session", options->session, "Session; not needed while only one is live").type_name("SESSION");
  command.option("-t,--topics", options->topics.names,
                 "Only topics whose names begin so (several allowed); without it all but bodies and contacts");
  command.option("--with", options->more, "Also what is left out without it: bodies (their poses), contacts")
      .one_of({"bodies", "contacts"})
      .take_all();
  command.flag("-w,--wait", options->wait, "Wait for the session, and record it from its first sample");
  command.option("--config", options->start.file, "With --wait: the session file that the nodes will be started with")
      .type_name("FILE");
  command.option("--set", options->start.assignments, "With --config: as for the nodes").take_all();
  command.option("-d,--duration", options->duration_s, "End after so many seconds (without it: Ctrl-C)").positive();
  command.option("--compress", options->compression, "Deflate level 0…9; costs time, saves about half the space")
      .whole_range(0, 9)
      .show_default();
  command.option("--reserve", options->reserve_mib, "Ends in order when the disk has less left [MiB]")
      .whole_range(0, 1 << 20)
      .show_default();
  command.flag("--json", options->json, "Only the final figures, as JSON");
  command.footer(
      "Records every tick and step of the session at full rate, and survives the nodes' restarts. What is older than\n"
      "one second survives kill -9 of this program. Read the file with `rtbus export`, `rtbus plot`, h5dump, h5py or\n"
      "MATLAB (docs/recording.md). `rtbus mark TEXT` notes an event in it.");
  return [options] {
    for (const std::string& word : options->more) {
      (word == "bodies" ? options->topics.bodies : options->topics.contacts) = true;
    }
    options->topics.from_first = options->wait;
    return record(*options);
  };
}

}  // namespace tools
