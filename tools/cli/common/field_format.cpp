#include "tools/cli/common/field_format.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <variant>

#include "rtbus/topic_directory.hpp"

namespace tools {

namespace {

using rtbus::FieldValue;
using Field = rtbus::Segment::OwnedField;

/// `value` for the eye: six digits say more than seventeen.
std::string short_text(const FieldValue& value) {
  if (const auto* const number = std::get_if<double>(&value)) {
    char text[40];
    std::snprintf(text, sizeof text, "%.6g", *number);
    return text;
  }
  if (const auto* const text = std::get_if<std::string>(&value))
    return json_line(*text);  // quoted as YAML wants it too
  return rtbus::to_text(value);
}

std::string csv_cell(const FieldValue& value) {
  std::string text = rtbus::to_text(value);
  if (!std::holds_alternative<std::string>(value) || text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

nlohmann::ordered_json json_value(const FieldValue& value) {
  return std::visit([](const auto& each) { return nlohmann::ordered_json(each); }, value);
}

/// "position_m[1]" → its element 1, as a field of its own; false when it does not name one.
bool element_of(const Field& field, std::string_view wanted, Field& out) {
  const std::size_t bracket = wanted.find('[');
  if (bracket == std::string_view::npos || wanted.substr(0, bracket) != field.name || !wanted.ends_with(']'))
    return false;
  const std::string_view digits = wanted.substr(bracket + 1, wanted.size() - bracket - 2);
  std::uint32_t index = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), index);
  if (error != std::errc{} || end != digits.data() + digits.size() || index >= rtbus::field_elements(field))
    return false;
  out = field;
  if (field.type != rtbus::FieldType::kText) {
    out.name = wanted;
    out.offset += index * rtbus::field_type_bytes(field.type);
    out.count = 1;
  }
  return true;
}

}  // namespace

rtbus::Result<FieldList, Refusal> select_fields(const FieldList& fields, const std::vector<std::string>& wanted) {
  if (wanted.empty()) return fields;
  FieldList selected;
  for (const std::string& name : wanted) {
    Field element;
    const auto found = std::find_if(fields.begin(), fields.end(), [&](const Field& field) {
      if (field.name != name) return element_of(field, name, element);
      element = field;
      return true;
    });
    if (found == fields.end()) {
      std::string names;
      for (const Field& field : fields) {
        names += (names.empty() ? "" : ", ") + field.name;
        const std::uint32_t count = rtbus::field_elements(field);
        if (count > 1) names += "[0.." + std::to_string(count - 1) + "]";
      }
      return rtbus::Failure{Refusal{"there is no field '" + name + "'; there is: " + names}};
    }
    selected.push_back(std::move(element));
  }
  return selected;
}

std::string format_block(const RawSample& sample, const FieldList& fields) {
  char head[80];
  std::snprintf(head, sizeof head, "--- # %llu at %llu.%09llu s\n", static_cast<unsigned long long>(sample.sequence),
                static_cast<unsigned long long>(sample.stamp_ns / 1'000'000'000),
                static_cast<unsigned long long>(sample.stamp_ns % 1'000'000'000));
  std::string text = head;
  for (const Field& field : fields) {
    const std::uint32_t count = rtbus::field_elements(field);
    // A single element keeps an index in its key only when it was asked for by it; YAML then wants quotes.
    const bool indexed = field.name.find('[') != std::string::npos;
    text += (indexed ? "\"" + field.name + "\"" : field.name) + ": ";
    if (count > 1) text += "[";
    for (std::uint32_t i = 0; i < count; ++i) {
      text += (i == 0 ? "" : ", ") + short_text(rtbus::field_value(sample.bytes, field, i));
    }
    if (count > 1) text += "]";
    if (!field.unit.empty() && field.unit != "1") text += "  # " + field.unit;
    text += "\n";
  }
  return text;
}

std::string csv_header(const FieldList& fields) {
  std::string text = "sequence [1],stamp_ns [ns]";
  for (const Field& field : fields) {
    const std::uint32_t count = rtbus::field_elements(field);
    for (std::uint32_t i = 0; i < count; ++i) {
      text += "," + field.name;
      if (count > 1) text += "[" + std::to_string(i) + "]";
      if (!field.unit.empty()) text += " [" + field.unit + "]";
    }
  }
  return text;
}

std::string csv_row(const RawSample& sample, const FieldList& fields) {
  std::string text = std::to_string(sample.sequence) + "," + std::to_string(sample.stamp_ns);
  for (const Field& field : fields) {
    const std::uint32_t count = rtbus::field_elements(field);
    for (std::uint32_t i = 0; i < count; ++i) text += "," + csv_cell(rtbus::field_value(sample.bytes, field, i));
  }
  return text;
}

nlohmann::ordered_json json_sample(const RawSample& sample, const FieldList& fields) {
  nlohmann::ordered_json object;
  object["sequence"] = sample.sequence;
  object["stamp_ns"] = sample.stamp_ns;
  for (const Field& field : fields) {
    const std::uint32_t count = rtbus::field_elements(field);
    if (count == 1) {
      object[field.name] = json_value(rtbus::field_value(sample.bytes, field, 0));
      continue;
    }
    auto elements = nlohmann::ordered_json::array();
    for (std::uint32_t i = 0; i < count; ++i)
      elements.push_back(json_value(rtbus::field_value(sample.bytes, field, i)));
    object[field.name] = std::move(elements);
  }
  return object;
}

std::string json_line(const nlohmann::ordered_json& value) {
  return value.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace tools
