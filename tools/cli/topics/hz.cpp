// `rtbus hz TOPIC`: rate and jitter of a topic, from the stamps of its samples.
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/topics/interval_stats.hpp"

namespace tools {

namespace {

struct HzOptions {
  std::string topic;
  std::optional<std::string> session;
  std::optional<std::uint64_t> count;
  std::optional<double> duration_s;
  double window_s = 1.0;
  double timeout_s = 3.0;
  bool json = false;
};

nlohmann::ordered_json json_of(const IntervalStats& stats) {
  return {{"rate_hz", stats.rate_hz()},
          {"intervals", stats.intervals()},
          {"period_us",
           {{"mean", stats.mean_s() * 1e6},
            {"min", stats.min_s() * 1e6},
            {"max", stats.max_s() * 1e6},
            {"std", stats.jitter_s() * 1e6}}},
          {"missed", stats.missed()}};
}

void print_row(const char* label, const IntervalStats& stats) {
  std::printf("%8s %11.3f %11.1f %11.1f %11.1f %8llu\n", label, stats.rate_hz(), stats.min_s() * 1e6,
              stats.max_s() * 1e6, stats.jitter_s() * 1e6, static_cast<unsigned long long>(stats.missed()));
  std::fflush(stdout);
}

/// Feeds everything that is there and later than `after_ns`. @return whether there was anything.
bool take(rtbus::RawReader& reader, const HzOptions& options, std::uint64_t after_ns, IntervalStats& window,
          IntervalStats& total) {
  bool any = false;
  while ((!options.count || total.samples() < *options.count) && reader.read_next() == rtbus::ReadStatus::kFresh) {
    if (reader.stamp_ns() <= after_ns) continue;
    window.add(reader.sequence(), reader.stamp_ns());
    total.add(reader.sequence(), reader.stamp_ns());
    any = true;
  }
  return any;
}

int finish(const HzOptions& options, const Choice& choice, const IntervalStats& total) {
  if (options.json) {
    nlohmann::ordered_json report = {{"session", choice.session.name}, {"topic", choice.topic}};
    report.update(json_of(total));
    std::cout << report.dump(2) << '\n';
  } else if (total.intervals() > 0) {
    print_row("all", total);
  }
  if (total.intervals() > 0) return kExitFine;
  std::cerr << "rtbus hz: " << choice.session.name << " " << choice.topic << ": "
            << (total.samples() == 0 ? "nothing arrives" : "a single sample has no rate; measure longer") << '\n';
  return kExitFailed;
}

int measure(const HzOptions& options, const Choice& choice) {
  const rtbus::ReaderOptions reader_options{.presence = true, .trust = rtbus::OwnerTrust::kAnyone};
  auto reader = rtbus::RawReader::open(choice.session, choice.topic, reader_options);
  if (!reader) {
    std::cerr << "rtbus hz: " << choice.session.name << " " << choice.topic << ": " << rtbus::to_string(reader.error())
              << '\n';
    return kExitFailed;
  }
  if (!options.json) {
    std::printf("%s %s\n%8s %11s %11s %11s %11s %8s\n", choice.session.name.c_str(), choice.topic.c_str(), "time s",
                "rate Hz", "min us", "max us", "std us", "missed");
    std::fflush(stdout);
  }
  IntervalStats window, total;
  const std::uint64_t begin_ns = rtbus::monotonic_ns();
  std::uint64_t window_begin_ns = begin_ns, last_fresh_ns = begin_ns;
  std::uint64_t counted_until_ns = 0;  // by the readers of former segments
  while (!interrupted() && (!options.count || total.samples() < *options.count)) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    const double elapsed_s = rtbus::seconds_between(begin_ns, now_ns);
    if (take(*reader, options, counted_until_ns, window, total)) {
      last_fresh_ns = now_ns;
    } else if (reader->replaced()) {
      // The writer was started anew, or has made its topic anew: go on with the new segment. A writer that does the
      // latter writes both for a while: count each sample once.
      auto opened = rtbus::RawReader::open(
          choice.session, choice.topic, {.presence = true, .from_oldest = true, .trust = rtbus::OwnerTrust::kAnyone});
      if (opened) {
        counted_until_ns = reader->stamp_ns();
        reader = std::move(opened);
      }
    }
    if (options.duration_s && elapsed_s >= *options.duration_s) break;
    if (rtbus::seconds_between(last_fresh_ns, now_ns) >= options.timeout_s && total.intervals() == 0) break;
    if (rtbus::seconds_between(window_begin_ns, now_ns) >= options.window_s) {
      char time[32];
      std::snprintf(time, sizeof time, "%.1f", elapsed_s);
      if (!options.json && window.intervals() > 0) print_row(time, window);
      if (!options.json && window.intervals() == 0) std::printf("%8s  nothing new\n", time), std::fflush(stdout);
      window.begin_window();
      window_begin_ns = now_ns;
    }
    sleep_unless_interrupted(5 * rtbus::kNsPerMs);  // polls: a sleeping reader would cost the writer a system call
  }
  return finish(options, choice, total);
}

}  // namespace

Action add_hz(rtbus::Command command) {
  auto options = std::make_shared<HzOptions>();
  command.option("TOPIC", options->topic, "Name, its beginning or a part of it, as long as it is unique").required();
  command.option("-s,--session", options->session, "Session; not needed while only one is live").type_name("SESSION");
  command.option("-n,--count", options->count, "End after so many samples").range(2.0, 1e12);
  command.option("-d,--duration", options->duration_s, "End after so many seconds (without either: Ctrl-C)").positive();
  command.option("-w,--window", options->window_s, "A line every so many seconds").range(0.1, 3600.0).show_default();
  command.option("--timeout", options->timeout_s, "Fail when nothing arrives for so many seconds at the start")
      .positive()
      .show_default();
  command.flag("--json", options->json, "Only the final figures, as JSON");
  return [options] {
    auto choice = choose(options->session, options->topic);
    if (!choice) {
      std::cerr << "rtbus hz: " << choice.error().message << '\n';
      return choice.error().exit_status;
    }
    return measure(*options, *choice);
  };
}

}  // namespace tools
