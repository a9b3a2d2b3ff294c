// `rtbus echo TOPIC`: the samples of one topic, as text.
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/field_format.hpp"
#include "tools/cli/common/interrupt.hpp"

namespace tools {

namespace {

constexpr double kUsualRate_hz = 10.0;  // of --latest

struct EchoOptions {
  std::string topic;
  std::optional<std::string> session;
  std::vector<std::string> fields;
  bool json = false, csv = false;
  bool latest = false, all = false;
  std::optional<double> rate_hz;
  std::optional<std::uint64_t> count;
  std::optional<double> duration_s;
  std::optional<double> timeout_s;

  /// People want to see what is now; programs want everything.
  [[nodiscard]] bool in_order() const { return all || (!latest && !rate_hz && (json || csv)); }
};

/// One run of the command: a reader that follows its topic through restarts of the writer, and what it printed.
class Echo {
 public:
  Echo(const EchoOptions& options, Choice choice) : options_(options), choice_(std::move(choice)) {}

  int run() {
    if (!open(false)) return fail(rtbus::to_string(error_));
    if (!choose_fields()) return kExitUsage;
    if (options_.csv) std::cout << csv_header(fields_) << '\n';
    const bool left_behind = !reader_->writer_alive();
    if (left_behind) {
      std::cerr << "rtbus: the writer of " << choice_.topic << " is gone; showing what it left\n";
      if (options_.in_order() && !open(true))
        return fail(rtbus::to_string(error_));  // what it left begins at the oldest
    }
    const std::uint64_t begin_ns = rtbus::monotonic_ns();
    last_fresh_ns_ = begin_ns;
    while (!interrupted() && !enough()) {
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      if (options_.duration_s && rtbus::seconds_between(begin_ns, now_ns) >= *options_.duration_s) break;
      if (print_what_is_there()) {
        last_fresh_ns_ = now_ns;
      } else if (left_behind) {
        break;
      } else if (options_.timeout_s && rtbus::seconds_between(last_fresh_ns_, now_ns) >= *options_.timeout_s) {
        report_missed();
        return fail("nothing new for " + std::to_string(*options_.timeout_s) + " s");
      } else if (!follow()) {
        return kExitFailed;
      }
      std::cout.flush();
      if (!std::cout) return kExitFailed;  // nobody takes the output any more
      // Polling: a reader that slept on the topic would cost its writer a system call.
      sleep_unless_interrupted(options_.in_order()
                                   ? 5 * rtbus::kNsPerMs
                                   : static_cast<std::uint64_t>(1e9 / options_.rate_hz.value_or(kUsualRate_hz)));
    }
    report_missed();
    if (printed_ == 0 && left_behind) return fail("nothing was ever published");
    return kExitFine;
  }

 private:
  bool open(bool from_oldest) {
    auto reader =
        rtbus::RawReader::open(choice_.session, choice_.topic,
                               {.presence = true, .from_oldest = from_oldest, .trust = rtbus::OwnerTrust::kAnyone});
    if (!reader) {
      error_ = reader.error();
      return false;
    }
    reader_.emplace(std::move(*reader));
    return true;
  }

  bool choose_fields() {
    auto fields = select_fields(reader_->description().fields, options_.fields);
    if (!fields) {
      std::cerr << "rtbus echo: " << choice_.topic << ": " << fields.error().message << '\n';
      return false;
    }
    fields_ = std::move(*fields);
    type_hash_ = reader_->description().type_hash;
    return true;
  }

  /// After a restart of the writer the name may lead to another segment. @return false: its layout is another one.
  bool follow() {
    if (!reader_->replaced()) return true;
    const std::uint64_t missed = reader_->missed(), refused = reader_->refused(), until_ns = reader_->stamp_ns();
    if (!open(true)) return true;  // not there yet: keep the old one and look again
    missed_before_ += missed;
    refused_before_ += refused;
    printed_until_ns_ = until_ns;  // a writer that makes its topic anew writes both segments for a while
    if (reader_->description().type_hash == type_hash_) return true;
    std::cerr << "rtbus echo: " << choice_.topic << " has come back with other fields; start echo again\n";
    return false;
  }

  bool print_what_is_there() {
    bool any = false;
    while (!interrupted() && !enough()) {
      const rtbus::ReadStatus status = options_.in_order() ? reader_->read_next() : reader_->read_latest();
      if (status != rtbus::ReadStatus::kFresh) break;
      if (reader_->stamp_ns() <= printed_until_ns_) {
        if (!options_.in_order()) break;
        continue;
      }
      print({reader_->sequence(), reader_->stamp_ns(), reader_->bytes()});
      any = true;
      if (!options_.in_order()) break;
    }
    return any;
  }

  void print(const RawSample& sample) {
    ++printed_;
    if (options_.json) {
      std::cout << json_line(json_sample(sample, fields_)) << '\n';
    } else if (options_.csv) {
      std::cout << csv_row(sample, fields_) << '\n';
    } else {
      std::cout << format_block(sample, fields_);
    }
  }

  [[nodiscard]] bool enough() const { return options_.count && printed_ >= *options_.count; }

  void report_missed() const {
    std::cout.flush();
    if (!options_.in_order()) return;
    const std::uint64_t missed = missed_before_ + reader_->missed();
    const std::uint64_t refused = refused_before_ + reader_->refused();
    std::cerr << "rtbus: " << printed_ << " samples, " << missed << " missed"
              << (missed > refused ? " (the output was slower than the ring is long)" : "");
    if (refused > 0) std::cerr << ", " << refused << " refused (not finite, out of all measure, or not of now)";
    std::cerr << '\n';
  }

  int fail(const std::string& why) const {
    std::cerr << "rtbus echo: " << choice_.session.name << " " << choice_.topic << ": " << why << '\n';
    return kExitFailed;
  }

  const EchoOptions& options_;
  Choice choice_;
  std::optional<rtbus::RawReader> reader_;
  rtbus::TopicError error_ = rtbus::TopicError::kNotFound;
  FieldList fields_;
  std::uint64_t type_hash_ = 0;
  std::uint64_t printed_ = 0;
  std::uint64_t missed_before_ = 0;     ///< By readers of former segments.
  std::uint64_t refused_before_ = 0;    ///< Likewise.
  std::uint64_t printed_until_ns_ = 0;  ///< Likewise.
  std::uint64_t last_fresh_ns_ = 0;
};

int echo(const EchoOptions& options) {
  auto choice = choose(options.session, options.topic);
  if (!choice) {
    std::cerr << "rtbus echo: " << choice.error().message << '\n';
    return choice.error().exit_status;
  }
  return Echo(options, std::move(*choice)).run();
}

}  // namespace

Action add_echo(rtbus::Command command) {
  auto options = std::make_shared<EchoOptions>();
  command.option("TOPIC", options->topic, "Name, its beginning or a part of it, as long as it is unique").required();
  command.option("-s,--session", options->session, "Session; not needed while only one is live").type_name("SESSION");
  const rtbus::Option json = command.flag("--json", options->json, "One JSON object per line");
  command.flag("--csv", options->csv, "CSV with the header `name [unit]`").excludes(json);
  const rtbus::Option latest = command.flag("--latest", options->latest,
                                            "The newest sample, --rate times a second "
                                            "(default, without --json and --csv)");
  const rtbus::Option all =
      command.flag("--all", options->all, "Every sample in order (default with --json and --csv)").excludes(latest);
  command
      .option("--rate", options->rate_hz, "So many samples a second, each the newest: --latest with this rate [Hz; 10]")
      .range(0.01, 1000.0)
      .excludes(all);
  command.option("-f,--fields", options->fields, "Only these, as a,b or position_m[1]").delimiter(',');
  command.option("-n,--count", options->count, "End after so many samples").positive();
  command.option("-d,--duration", options->duration_s, "End after so many seconds").positive();
  command.option("--timeout", options->timeout_s, "Fail when nothing new comes for so many seconds").positive();
  return [options] { return echo(*options); };
}

}  // namespace tools
