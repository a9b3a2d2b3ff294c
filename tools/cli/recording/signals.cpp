#include "tools/cli/recording/signals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/interrupt.hpp"

namespace tools {
namespace {

/// "a.b.field[2]" in parts.
struct Name {
  std::string topic, field;
  std::optional<std::uint32_t> element;
};

std::optional<Name> parse(const std::string& text) {
  Name name;
  std::string rest = text;
  if (const std::size_t bracket = rest.find('['); bracket != rest.npos) {
    if (!rest.ends_with(']')) return std::nullopt;
    const std::string digits = rest.substr(bracket + 1, rest.size() - bracket - 2);
    if (digits.empty() || digits.size() > 6 || digits.find_first_not_of("0123456789") != digits.npos) {
      return std::nullopt;
    }
    name.element = static_cast<std::uint32_t>(std::stoul(digits));
    rest.resize(bracket);
  }
  const std::size_t dot = rest.rfind('.');
  if (dot != rest.npos) name.topic = rest.substr(0, dot);
  name.field = rest.substr(dot == rest.npos ? 0 : dot + 1);
  return name;
}

/// Fields whose name has changed: recordings made before have the first name, those made since the second.
struct RenamedField {
  std::string_view before, now;
};
constexpr RenamedField kRenamed[] = {
    {"energy_ledger_j", "energy_observed_j"},
    {"touched_body", "hand_impulse_body"},
    {"touched_turn", "hand_impulse_generation"},
    {"touched_impulse_n_s", "hand_impulse_n_s"},
    {"touched_angular_n_m_s", "hand_angular_impulse_n_m_s"},
    {"touched_travel_n_s2", "hand_impulse_integral_n_s2"},
};

/// The other name of `field` where `sources` have that; else empty.
std::string other_name(const std::vector<SignalSource>& sources, const std::string& field) {
  for (const RenamedField& each : kRenamed) {
    if (field != each.before && field != each.now) continue;
    const std::string_view other = field == each.before ? each.now : each.before;
    for (const SignalSource& source : sources) {
      for (const auto& has : source.fields) {
        if (has.name == other) return std::string(other);
      }
    }
  }
  return {};
}

/// Telemetry says most about the hand: it comes first when a name fits several topics.
bool is_telemetry(const std::string& topic) { return topic.ends_with(".telemetry"); }

std::string nearest_field(const std::vector<SignalSource>& sources, const std::string& field) {
  std::string best;
  std::size_t fewest = std::numeric_limits<std::size_t>::max();
  for (const SignalSource& source : sources) {
    for (const auto& each : source.fields) {
      const std::size_t edits = edit_distance(each.name, field);
      if (edits < fewest) fewest = edits, best = each.name;
    }
  }
  return best;
}

}  // namespace

std::string Signal::label(bool with_topic) const {
  std::string text = with_topic ? topic + " " + field : field;
  if (elements == 3) return text + " " + "xyz"[element];
  if (elements > 1) return text + "[" + std::to_string(element) + "]";
  return text;
}

rtbus::Result<std::vector<Signal>, Refusal> choose_signals(const std::vector<SignalSource>& sources,
                                                           const std::vector<std::string>& wanted) {
  std::vector<Signal> signals;
  for (const std::string& text : wanted) {
    const auto name = parse(text);
    if (!name) return rtbus::Failure{Refusal{"\"" + text + "\" is no signal; write for example force_n or force_n[1]"}};
    std::vector<std::pair<const SignalSource*, const rtbus::Segment::OwnedField*>> found;
    for (const SignalSource& source : sources) {
      if (source.topic.find(name->topic) == std::string::npos) continue;
      for (const auto& field : source.fields) {
        if (field.name == name->field && field.type != rtbus::FieldType::kText) found.emplace_back(&source, &field);
      }
    }
    if (found.empty()) {
      if (const std::string other = other_name(sources, name->field); !other.empty()) {
        return rtbus::Failure{Refusal{"there is no signal " + text + " here; its name is " + other}};
      }
      return rtbus::Failure{Refusal{"there is no signal " + text + "; the nearest name is " +
                                    nearest_field(sources, name->field) + "; `rtbus list --fields` shows all"}};
    }
    if (found.size() > 1 &&
        std::any_of(found.begin(), found.end(), [](const auto& f) { return is_telemetry(f.first->topic); })) {
      std::erase_if(found, [](const auto& f) { return !is_telemetry(f.first->topic); });
    }
    for (const auto& [source, field] : found) {
      if (name->element && *name->element >= field->count) {
        return rtbus::Failure{
            Refusal{text + ": " + field->name + " has " + std::to_string(field->count) + " elements, from [0]"}};
      }
      for (std::uint32_t i = 0; i < field->count; ++i) {
        if (name->element && *name->element != i) continue;
        Signal& signal = signals.emplace_back();
        signal.topic = source->topic;
        signal.field = field->name;
        signal.element = i;
        signal.elements = field->count;
        signal.unit = field->unit;
      }
    }
  }
  return signals;
}

std::vector<SignalSource> sources_of(const rtbus::recording::Recording& recording) {
  std::vector<SignalSource> sources;
  for (const auto& topic : recording.topics()) sources.push_back({topic.name, topic.fields});
  return sources;
}

rtbus::Result<std::uint64_t, Refusal> common_origin_ns(const rtbus::recording::Recording& recording,
                                                       const std::optional<std::string>& mark) {
  if (mark) {
    for (const auto& each : recording.marks()) {
      if (each.text == *mark) return each.stamp_ns;
    }
    return rtbus::Failure{Refusal{recording.path() + " has no mark \"" + *mark + "\"; `rtbus export` shows its marks"}};
  }
  std::uint64_t first_ns = UINT64_MAX;
  for (const char* const subject : {".device_state", ".telemetry"}) {
    for (const auto& topic : recording.topics()) {
      if (!topic.name.ends_with(subject) || topic.rows == 0) continue;
      if (const auto stamps = recording.stamps_ns(topic, 0, 1); !stamps.empty()) {
        first_ns = std::min(first_ns, stamps.front());
      }
    }
    if (first_ns != UINT64_MAX) return first_ns;
  }
  return recording.started_monotonic_ns();
}

void leave_out_silent_elements(std::vector<Signal>& signals) {
  const auto silent = [](const Signal& s) {
    return std::all_of(s.value.begin(), s.value.end(), [](double value) { return value == 0.0; });
  };
  const auto same_field = [](const Signal& a, const Signal& b) { return a.topic == b.topic && a.field == b.field; };
  std::vector<bool> drop(signals.size());
  for (std::size_t i = 0; i < signals.size(); ++i) {
    bool element_moves = false, field_moves = false;
    for (const Signal& other : signals) {
      if (!same_field(other, signals[i]) || silent(other)) continue;
      field_moves = true;
      element_moves = element_moves || other.element == signals[i].element;
    }
    drop[i] = field_moves && !element_moves;
  }
  std::size_t at = 0;
  std::erase_if(signals, [&](const Signal&) { return drop[at++]; });
}

void load_signals(const rtbus::recording::Recording& recording, double from_s, double to_s,
                  std::vector<Signal>& signals, std::uint64_t origin_ns) {
  for (Signal& signal : signals) {
    const auto* const topic = recording.find(signal.topic);
    if (topic == nullptr) continue;
    const auto stamps = recording.stamps_ns(*topic);
    const auto time_of = [&](std::uint64_t ns) {
      return 1e-9 * static_cast<double>(static_cast<std::int64_t>(ns - origin_ns));
    };
    const auto first =
        std::partition_point(stamps.begin(), stamps.end(), [&](auto ns) { return time_of(ns) < from_s; });
    const auto last = std::partition_point(first, stamps.end(), [&](auto ns) { return time_of(ns) <= to_s; });
    const auto begin = static_cast<std::uint64_t>(first - stamps.begin());
    signal.value =
        recording.column(*topic, signal.field, signal.element, begin, static_cast<std::uint64_t>(last - first));
    signal.time_s.clear();
    for (std::size_t i = 0; i < signal.value.size(); ++i) signal.time_s.push_back(time_of(stamps[begin + i]));
  }
}

rtbus::Result<void, Refusal> watch_signals(const rtbus::Session& session, double duration_s,
                                           std::vector<Signal>& signals) {
  std::map<std::string, rtbus::RawReader> readers;
  for (const Signal& signal : signals) {
    if (readers.contains(signal.topic)) continue;
    auto reader =
        rtbus::RawReader::open(session, signal.topic, {.presence = true, .trust = rtbus::OwnerTrust::kAnyone});
    if (!reader) return rtbus::Failure{Refusal{signal.topic + ": " + rtbus::to_string(reader.error()), 1}};
    readers.emplace(signal.topic, std::move(*reader));
  }
  const std::uint64_t begin_ns = rtbus::monotonic_ns();
  while (!interrupted() && rtbus::seconds_between(begin_ns, rtbus::monotonic_ns()) < duration_s) {
    for (auto& [name, reader] : readers) {
      const auto& fields = reader.description().fields;
      for (std::uint32_t i = 0; i < reader.description().capacity; ++i) {
        if (reader.read_next() != rtbus::ReadStatus::kFresh) break;
        for (Signal& signal : signals) {
          if (signal.topic != name) continue;
          const auto field =
              std::find_if(fields.begin(), fields.end(), [&](const auto& f) { return f.name == signal.field; });
          if (field == fields.end()) continue;
          const auto value = rtbus::field_value(reader.bytes(), *field, signal.element);
          signal.time_s.push_back(rtbus::seconds_between(begin_ns, reader.stamp_ns()));
          signal.value.push_back(std::visit(
              [](const auto& v) -> double {
                if constexpr (std::is_arithmetic_v<std::decay_t<decltype(v)>>) return static_cast<double>(v);
                return std::nan("");
              },
              value));
        }
      }
      if (!reader.replaced()) continue;
      auto again = rtbus::RawReader::open(session, name, {.presence = true, .trust = rtbus::OwnerTrust::kAnyone});
      if (again) reader = std::move(*again);
    }
    sleep_unless_interrupted(20 * rtbus::kNsPerMs);
  }
  return {};
}

void thin(Signal& signal, std::size_t points) {
  const std::size_t rows = signal.value.size();
  if (rows <= points || points < 4) return;
  const std::size_t stretches = points / 2;
  std::vector<double> time, value;
  for (std::size_t s = 0; s < stretches; ++s) {
    const std::size_t begin = s * rows / stretches, end = (s + 1) * rows / stretches;
    std::size_t least = begin, greatest = begin;
    for (std::size_t i = begin; i < end; ++i) {
      if (signal.value[i] < signal.value[least]) least = i;
      if (signal.value[i] > signal.value[greatest]) greatest = i;
    }
    for (const std::size_t i : {std::min(least, greatest), std::max(least, greatest)}) {
      time.push_back(signal.time_s[i]);
      value.push_back(signal.value[i]);
      if (least == greatest) break;
    }
  }
  signal.time_s = std::move(time);
  signal.value = std::move(value);
}

}  // namespace tools
