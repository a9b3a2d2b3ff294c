// `rtbus list`: which sessions there are, and what is on them.
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/field_format.hpp"
#include "tools/cli/common/text_table.hpp"
#include "tools/cli/topics/topic_rate.hpp"

namespace tools {

namespace {

struct ListOptions {
  std::optional<std::string> session;
  bool json = false;
  bool fields = false;
};

/// A topic and how fast it moves.
struct Row {
  rtbus::TopicInfo info;
  TopicRate rate;
};

std::string writer_text(const rtbus::TopicInfo& info) {
  return std::to_string(info.writer_pid) + (info.writer_alive ? " alive" : " dead");
}

std::string rate_text(const Row& row) {
  if (!row.info.writer_alive || !row.rate.rate_hz) return "-";
  return fixed(*row.rate.rate_hz, 1);
}

const char* type_text(rtbus::FieldType type) {
  switch (type) {
    case rtbus::FieldType::kF64:
      return "f64";
    case rtbus::FieldType::kU64:
      return "u64";
    case rtbus::FieldType::kI64:
      return "i64";
    case rtbus::FieldType::kU32:
      return "u32";
    case rtbus::FieldType::kI32:
      return "i32";
    case rtbus::FieldType::kU8:
      return "u8";
    case rtbus::FieldType::kText:
      return "text";
  }
  return "?";
}

void print_session(const std::string& name, const std::vector<const Row*>& rows, bool with_fields) {
  bool live = false, readable = false;
  std::uint64_t bytes = 0;
  for (const Row* const row : rows) {
    live = live || row->info.writer_alive;
    readable = readable || row->info.problem.empty();
    bytes += row->info.segment_bytes;
  }
  std::printf("session %s: %s, %zu topic%s, %s\n", name.c_str(),
              live       ? "live"
              : readable ? "dead"
                         : "not readable",
              rows.size(), rows.size() == 1 ? "" : "s", human_bytes(bytes).c_str());
  using enum TextTable::Align;
  TextTable table({{"TOPIC", kLeft},
                   {"TYPE", kLeft},
                   {"SAMPLE B", kRight},
                   {"SLOTS", kRight},
                   {"PUBLISHED", kRight},
                   {"RATE Hz", kRight},
                   {"WRITER", kLeft},
                   {"SIZE", kRight}});
  for (const Row* const row : rows) {
    const rtbus::TopicInfo& info = row->info;
    if (!info.problem.empty()) continue;
    table.add({info.topic, info.type_name, std::to_string(info.sample_bytes), std::to_string(info.capacity),
               std::to_string(info.published), rate_text(*row), writer_text(info), human_bytes(info.segment_bytes)});
  }
  if (!table.empty()) {
    for (const std::string& line : table.lines()) std::printf("  %s\n", line.c_str());
  }
  for (const Row* const row : rows) {
    if (row->info.problem.empty()) continue;
    std::printf("  %s: %s (%s, owner uid %u)\n", row->info.topic.c_str(), row->info.problem.c_str(),
                human_bytes(row->info.segment_bytes).c_str(), row->info.owner);
  }
  if (!with_fields) return;
  for (const Row* const row : rows) {
    if (!row->info.problem.empty()) continue;
    std::printf("\n  %s (%s)\n", row->info.topic.c_str(), row->info.type_name.c_str());
    TextTable fields({{"", kLeft}, {"FIELD", kLeft}, {"UNIT", kLeft}, {"TYPE", kLeft}, {"COUNT", kRight}});
    for (const auto& field : row->info.fields) {
      fields.add({" ", field.name, field.unit, type_text(field.type), std::to_string(field.count)});
    }
    for (const std::string& line : fields.lines()) std::printf("  %s\n", line.c_str());
  }
}

nlohmann::ordered_json to_json(const Row& row) {
  const rtbus::TopicInfo& info = row.info;
  nlohmann::ordered_json topic = {{"name", info.topic}};
  topic["problem"] = info.problem.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(info.problem);
  topic["segment_bytes"] = info.segment_bytes;
  topic["owner_uid"] = info.owner;
  if (!info.problem.empty()) return topic;
  topic["type"] = info.type_name;
  topic["sample_bytes"] = info.sample_bytes;
  topic["capacity"] = info.capacity;
  topic["published"] = info.published;
  topic["rate_hz"] = row.rate.rate_hz ? nlohmann::ordered_json(*row.rate.rate_hz) : nlohmann::ordered_json(nullptr);
  topic["newest_age_s"] = row.rate.age_s ? nlohmann::ordered_json(*row.rate.age_s) : nlohmann::ordered_json(nullptr);
  topic["writer"] = {{"pid", info.writer_pid}, {"alive", info.writer_alive}, {"epoch", info.epoch}};
  auto fields = nlohmann::ordered_json::array();
  for (const auto& field : info.fields) {
    fields.push_back(
        {{"name", field.name}, {"unit", field.unit}, {"type", type_text(field.type)}, {"count", field.count}});
  }
  topic["fields"] = std::move(fields);
  return topic;
}

int list(const ListOptions& options) {
  std::vector<rtbus::TopicInfo> topics = rtbus::list_topics();
  if (options.session) {
    const auto session = choose_session(topics, options.session);
    if (!session) {
      std::cerr << "rtbus list: " << session.error().message << '\n';
      return session.error().exit_status;
    }
    std::erase_if(topics, [&](const rtbus::TopicInfo& info) { return info.session != *session; });
  }
  std::vector<Row> rows;
  for (rtbus::TopicInfo& info : topics) {
    const TopicRate rate = info.problem.empty() ? recent_rate(info.session, info.topic) : TopicRate{};
    rows.push_back({std::move(info), rate});
  }
  std::map<std::string, std::vector<const Row*>> sessions;
  for (const Row& row : rows) sessions[row.info.session].push_back(&row);

  if (options.json) {
    nlohmann::ordered_json report = {{"schema", "rtbus-list/1"}, {"sessions", nlohmann::ordered_json::array()}};
    for (const auto& [name, of_session] : sessions) {
      nlohmann::ordered_json session = {{"name", name}, {"live", false}, {"bytes", 0}};
      std::uint64_t bytes = 0;
      auto its_topics = nlohmann::ordered_json::array();
      for (const Row* const row : of_session) {
        bytes += row->info.segment_bytes;
        if (row->info.writer_alive) session["live"] = true;
        its_topics.push_back(to_json(*row));
      }
      session["bytes"] = bytes;
      session["topics"] = std::move(its_topics);
      report["sessions"].push_back(std::move(session));
    }
    std::cout << report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
    return kExitFine;
  }
  if (sessions.empty()) std::puts("no session is running; start one, for example with `rtbus run wall`");
  bool first = true;
  for (const auto& [name, of_session] : sessions) {
    if (!first) std::puts("");
    first = false;
    print_session(name, of_session, options.fields);
  }
  return kExitFine;
}

}  // namespace

Action add_list(rtbus::Command command) {
  auto options = std::make_shared<ListOptions>();
  command.option("-s,--session", options->session, "Only this session").type_name("SESSION");
  command.flag("-f,--fields", options->fields, "Also the fields of every topic, with type and unit");
  command.flag("--json", options->json, "As JSON, schema rtbus-list/1, fields included");
  return [options] { return list(*options); };
}

}  // namespace tools
