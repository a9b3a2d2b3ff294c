#include "tools/cli/top/top_view.hpp"

#include <algorithm>
#include <cmath>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/top/top_marks.hpp"
#include "tools/cli/top/top_node_lines.hpp"

namespace tools {

namespace {

/// Cuts or fills `lines` to the window and puts `footer` on its last line.
void fit(Lines& lines, const TopChoice& choice, int width, int height, const char* footer) {
  if (height > 0) {
    lines.resize(static_cast<std::size_t>(std::max(0, height - 1)));
    lines.emplace_back(footer, Tone::kDim);
  }
  for (ViewLine& line : lines) line.fit(static_cast<std::size_t>(std::max(0, width)), choice.utf8);
}

ViewLine title(const TopSnapshot& snapshot, const TopChoice& choice) {
  ViewLine line("rtbus top  session " + snapshot.session, Tone::kHeading);
  if (choice.paused) line.add("  PAUSED", Tone::kWarn);
  line.add("  up " + clock_text(snapshot.uptime_s));
  line.add(formatted("  %zu haptic, %zu physics, %zu topics", snapshot.haptic.size(), snapshot.physics.size(),
                     snapshot.topics.size()));
  return line;
}

Lines waiting_lines(const TopSnapshot& snapshot, int width) {
  Lines lines = {ViewLine("rtbus top: waiting for a session", Tone::kHeading), ViewLine()};
  if (snapshot.sessions.size() > 1) {
    add_wrapped(lines, "Several sessions are live; press the number of the one to look at:", width);
    for (std::size_t i = 0; i < snapshot.sessions.size() && i < 9; ++i)
      lines.emplace_back(formatted("  %zu  %s", i + 1, snapshot.sessions[i].c_str()), Tone::kHeading);
    return lines;
  }
  add_wrapped(lines, snapshot.message, width);
  lines.emplace_back();
  add_wrapped(lines, "Start one in another terminal, for example:", width);
  lines.emplace_back("  rtbus run wall", Tone::kHeading);
  lines.emplace_back("  rtbus run stack_125", Tone::kHeading);
  add_wrapped(lines, "It appears here by itself.", width);
  return lines;
}

/// Each node at its detail: the chosen haptic node at `chosen`, the others at `others`.
Lines node_lines(const TopSnapshot& snapshot, const TopChoice& choice, Detail chosen, Detail others,
                 const LineStyle& style) {
  Lines lines;
  const auto append = [&](Lines more) { lines.insert(lines.end(), more.begin(), more.end()); };
  const std::size_t at = chosen_index(snapshot.haptic, choice.node);
  for (std::size_t i = 0; i < snapshot.haptic.size(); ++i) {
    append(haptic_lines(snapshot.haptic[i], i == at ? chosen : others, i == at && snapshot.haptic.size() > 1, style));
  }
  for (const PhysicsView& view : snapshot.physics) append(physics_lines(view, chosen, style));
  return lines;
}

Lines nodes_that_fit(const TopSnapshot& snapshot, const TopChoice& choice, int room, const LineStyle& style) {
  constexpr std::pair<Detail, Detail> kSteps[] = {
      {Detail::kRoomy, Detail::kRoomy},   {Detail::kRoomy, Detail::kTight},    {Detail::kDrawn, Detail::kDrawn},
      {Detail::kDrawn, Detail::kTight},   {Detail::kSketched, Detail::kTight}, {Detail::kFigures, Detail::kFigures},
      {Detail::kFigures, Detail::kTight}, {Detail::kTight, Detail::kTight}};
  // With several hands the drawings of the chosen one are worth more than topics.
  const int some_topics =
      room < 20 || snapshot.haptic.size() > 1 ? 1 : std::min(3, static_cast<int>(snapshot.topics.size()) + 1);
  Lines lines;
  for (const auto& [chosen, others] : kSteps) {
    lines = node_lines(snapshot, choice, chosen, others, style);
    // Topics have a page of their own: they step back before figures do, and in a small window before drawings.
    const int for_topics = chosen >= Detail::kSketched ? some_topics : 1;
    if (room < 0 || static_cast<int>(lines.size()) <= room - for_topics) break;
  }
  return lines;
}

Tone topic_tone(const TopicView& topic) {
  return !topic.writer_alive || !topic.problem.empty() ? Tone::kBad : Tone::kPlain;
}

std::string rate_text(const TopicView& topic) {
  if (!topic.problem.empty()) return "?";
  if (!topic.writer_alive) return "dead";
  return topic.rate_hz ? formatted("%.1f", *topic.rate_hz) : "-";
}

ViewLine topic_row(const TopicView& topic, std::size_t name_width, bool chosen) {
  ViewLine line(formatted("  %-*s", static_cast<int>(name_width), topic.name.c_str()),
                chosen ? Tone::kChosen : topic_tone(topic));
  if (!topic.problem.empty()) return line.add(" " + topic.problem, Tone::kBad);
  line.add(formatted(" %9s", rate_text(topic).c_str()), topic_tone(topic));
  return line.add(formatted(" %11llu", count(topic.published))).add(formatted(" %8u", topic.writer_pid));
}

std::size_t name_width_of(const std::vector<TopicView>& topics) {
  std::size_t width = 20;
  for (const TopicView& topic : topics) width = std::max(width, topic.name.size());
  return std::min<std::size_t>(width, 40);
}

ViewLine topic_heading(std::size_t name_width) {
  ViewLine line(formatted("%-*s", static_cast<int>(name_width) + 2, "topics"), Tone::kHeading);
  return line.add("        Hz", Tone::kHeading).add("   published", Tone::kHeading).add("   writer", Tone::kHeading);
}

/// @param room Lines there are, the heading among them; negative: any number.
void add_topics(Lines& lines, const std::vector<TopicView>& topics, int room, int width) {
  if (topics.empty() || room == 0) return;
  if (room == 1) {
    lines.emplace_back(formatted("topics: %zu, press t", topics.size()), Tone::kDim);
    return;
  }
  const std::size_t name_width = name_width_of(topics);
  if (room < 0 || static_cast<int>(topics.size()) < room) {
    lines.push_back(topic_heading(name_width));
    for (const TopicView& topic : topics) lines.push_back(topic_row(topic, name_width, false));
    return;
  }
  // Not one line for each: names and rates in columns.
  const std::size_t cell = name_width + 11;
  const std::size_t columns = width > 0 ? std::max<std::size_t>(1, static_cast<std::size_t>(width) / cell) : 1;
  const auto rows = static_cast<std::size_t>(room - 1);
  const std::size_t shown = std::min(topics.size(), rows * columns);
  ViewLine heading("topics, Hz", Tone::kHeading);
  if (shown < topics.size()) heading.add(formatted("   + %zu more: press t", topics.size() - shown), Tone::kDim);
  lines.push_back(std::move(heading));
  const std::size_t used_rows = (shown + columns - 1) / columns;
  for (std::size_t row = 0; row < used_rows; ++row) {
    ViewLine line;
    for (std::size_t i = row; i < shown; i += used_rows) {
      line.add(
          formatted("  %-*s %7s ", static_cast<int>(name_width), topics[i].name.c_str(), rate_text(topics[i]).c_str()),
          topic_tone(topics[i]));
    }
    lines.push_back(std::move(line));
  }
}

/// The unit and factor in which a field is shown: SI as it comes, or as people speak.
std::pair<double, std::string> shown_unit(const std::string& unit, bool si) {
  if (!si && unit == "m") return {1e3, "mm"};
  if (!si && unit == "m/s") return {1e3, "mm/s"};
  if (!si && unit == "s") return {1e3, "ms"};
  return {1.0, unit == "1" ? std::string() : unit};
}

std::string value_text(const rtbus::FieldValue& value, double factor) {
  if (const auto* const number = std::get_if<double>(&value)) return formatted("%.6g", *number * factor);
  if (const auto* const text = std::get_if<std::string>(&value)) return *text;
  return rtbus::to_text(value);
}

Lines field_lines(const SampleView& sample, const TopChoice& choice) {
  std::size_t name_width = 12;
  for (const FieldView& field : sample.fields) name_width = std::max(name_width, field.name.size());
  Lines lines;
  for (const FieldView& field : sample.fields) {
    const auto [factor, unit] = shown_unit(field.unit, choice.si);
    ViewLine line(formatted("  %-*s ", static_cast<int>(name_width), field.name.c_str()), Tone::kDim);
    for (const rtbus::FieldValue& value : field.values) {
      const bool text = std::holds_alternative<std::string>(value);
      line.add(" " + (text ? value_text(value, factor) : formatted("%11s", value_text(value, factor).c_str())));
    }
    if (!unit.empty()) line.add(" " + unit, Tone::kDim);
    lines.push_back(std::move(line));
  }
  return lines;
}

constexpr const char* kOverviewKeys = "q quit  E E-stop  p pause  t topics  u units  Tab node  ? help";
constexpr const char* kTopicKeys = "q quit  E E-stop  p pause  t back  u units  Up/Down topic  PgUp/PgDn fields";

}  // namespace

Lines overview_lines(const TopSnapshot& snapshot, const TopChoice& choice, int width, int height) {
  Lines lines;
  if (snapshot.session.empty()) {
    lines = waiting_lines(snapshot, width);
  } else {
    lines.push_back(title(snapshot, choice));
    const LineStyle style{width, choice.utf8, {choice.si}};
    const int body = height > 0 ? std::max(0, height - 2) : -1;
    const Lines middle = nodes_that_fit(snapshot, choice, body, style);
    lines.insert(lines.end(), middle.begin(), middle.end());
    add_topics(lines, snapshot.topics, body < 0 ? -1 : std::max(0, body - static_cast<int>(middle.size())), width);
  }
  fit(lines, choice, width, height, choice.notice.empty() ? kOverviewKeys : choice.notice.c_str());
  return lines;
}

Lines topic_lines(const TopSnapshot& snapshot, const std::optional<SampleView>& sample, const TopChoice& choice,
                  int width, int height) {
  if (snapshot.session.empty()) return overview_lines(snapshot, choice, width, height);
  Lines lines = {title(snapshot, choice)};
  const std::size_t at = chosen_index(snapshot.topics, choice.topic);
  const std::size_t name_width = name_width_of(snapshot.topics);
  // A third of the window for the list, which follows the chosen one; the rest for the fields.
  const std::size_t all = snapshot.topics.size();
  const std::size_t rows =
      height > 0 ? std::min<std::size_t>(all, static_cast<std::size_t>(std::max(3, height / 3))) : all;
  const std::size_t first = std::min(at < rows / 2 ? 0 : at - rows / 2, all - rows);
  lines.push_back(topic_heading(name_width));
  if (rows < all) lines.back().add(formatted("   %zu of %zu", at + 1, all), Tone::kDim);
  for (std::size_t i = first; i < first + rows; ++i)
    lines.push_back(topic_row(snapshot.topics[i], name_width, i == at));
  if (sample) {
    ViewLine head(sample->topic, Tone::kHeading);
    if (!sample->problem.empty()) {
      head.add("  " + sample->problem, Tone::kWarn);
    } else {
      head.add("  " + sample->type_name).add(formatted("  #%llu", count(sample->sequence)));
      head.add(formatted("  %.3f s old", sample->age_s), sample->age_s > 2.0 ? Tone::kWarn : Tone::kPlain);
    }
    const Lines fields = field_lines(*sample, choice);
    // At least the last field stays in view however far one scrolls.
    const std::size_t skipped = std::min(choice.scroll, fields.empty() ? 0 : fields.size() - 1);
    const int room = height > 0 ? height - 2 - static_cast<int>(lines.size()) : -1;
    const std::size_t left = fields.size() - skipped;
    if (skipped > 0) head.add(formatted("  + %zu above", skipped), Tone::kDim);
    if (room >= 0 && left > static_cast<std::size_t>(room))
      head.add(formatted("  + %zu below", left - static_cast<std::size_t>(room)), Tone::kDim);
    lines.push_back(std::move(head));
    lines.insert(lines.end(), fields.begin() + static_cast<std::ptrdiff_t>(skipped), fields.end());
  }
  fit(lines, choice, width, height, choice.notice.empty() ? kTopicKeys : choice.notice.c_str());
  return lines;
}

Lines help_lines(int width, int height) {
  Lines lines = {
      ViewLine("rtbus top: observes, and stops; what each line means is in docs/monitoring.md", Tone::kHeading)};
  for (const char* const text : {"  q  quit       p  pause: the screen waits, the nodes go on     ? h  this page",
                                 "  t  topics     u  mm, ms, us or SI     Tab, arrows  other node or topic",
                                 "  E  E-stop: zero force in this session, held     R  re-arm: force ramps up",
                                 "",
                                 "alive      heartbeat younger than 60 ms",
                                 "STALE      process stopped, starved or in a debugger: forces fade to zero",
                                 "GONE       process has died; restarted, or `rtbus clean` removes its rest",
                                 "rate       reached in the last second, of the rate asked for",
                                 "overruns   periods without a cycle since start",
                                 "wake-up    how late cycles begin; percentiles since start",
                                 "jitter     wake-ups of the last 10 s by lateness; one-line bars are logarithmic",
                                 "compute    method and safety, without the device",
                                 "proxy age  age of the physics answer that a force is made from",
                                 "force      RMS of the last 0.4 s against the limit; the mark is the peak",
                                 "           since start; below it the largest force of each 0.1 s",
                                 "energy     work of the hand on the device's force; MADE: more was given than",
                                 "           taken, which the passivity damper works against",
                                 "safety     ticks since start in which a stage changed the force",
                                 "last cut   when the force was last faded out or cut, why, and for how long",
                                 "late       physics steps that took longer than their period",
                                 "left out   what this session did not need and did not load"}) {
    lines.emplace_back(std::string(text));
  }
  fit(lines, {}, width, height, "any key: back");
  return lines;
}

Lines page_lines(const TopSnapshot& snapshot, const std::optional<SampleView>& sample, const TopChoice& choice,
                 int width, int height) {
  switch (choice.page) {
    case TopPage::kHelp:
      return help_lines(width, height);
    case TopPage::kTopics:
      return topic_lines(snapshot, sample, choice, width, height);
    case TopPage::kOverview:
      break;
  }
  return overview_lines(snapshot, choice, width, height);
}

std::optional<double> force_between(const rtbus::LoopStats& before, const rtbus::LoopStats& now) {
  if (now.ticks <= before.ticks) return std::nullopt;
  const auto square_sum = [](const rtbus::LoopStats& stats) {
    return stats.force_rms_n * stats.force_rms_n * static_cast<double>(stats.ticks);
  };
  // Rounding may leave a tiny negative difference when no force acted.
  const double difference = std::max(0.0, square_sum(now) - square_sum(before));
  return std::sqrt(difference / static_cast<double>(now.ticks - before.ticks));
}

}  // namespace tools
