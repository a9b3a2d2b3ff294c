#include "drivers/haply/service_messages.hpp"

#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace drivers::haply {
namespace {

using json = nlohmann::json;

constexpr const char* kGripKinds[] = {"verse_grip", "wireless_verse_grip", "custom_verse_grip"};

json parsed(std::string_view text) { return json::parse(text, nullptr, false); }

/// The member, or null for anything else.
const json& member(const json& from, const char* key) {
  static const json kNull;
  if (!from.is_object()) return kNull;
  const auto it = from.find(key);
  return it == from.end() ? kNull : *it;
}

std::optional<double> number(const json& from, const char* key) {
  const json& value = member(from, key);
  if (!value.is_number()) return std::nullopt;
  return value.get<double>();
}

std::optional<Vec3> vector(const json& from) {
  const auto x = number(from, "x"), y = number(from, "y"), z = number(from, "z");
  if (!x || !y || !z) return std::nullopt;
  return Vec3{*x, *y, *z};
}

/// Status of calibration, wherever this release has it. Absent: nothing says that it is not.
bool calibrated(const json& device) {
  const json& flag = member(member(device, "status"), "calibrated");
  if (flag.is_boolean()) return flag.get<bool>();
  const auto stage = number(member(device, "state"), "calibration_state");
  return !stage || *stage >= 2.0;
}

void find_not_neutral(const json& from, std::vector<std::string>& out) {
  struct Neutral {
    const char* key;
    double value;
  };
  constexpr Neutral kNeutral[] = {{"force_scale", 1.0}, {"force_gate", 0.0}, {"damping", 0.0}, {"scaling_factor", 1.0}};
  if (!from.is_structured()) return;
  for (const auto& item : from.items()) {
    for (const Neutral& neutral : kNeutral) {
      if (item.key() != neutral.key) continue;
      const json& value = item.value();
      const auto inner = value.is_object() ? (number(value, "scalar") ? number(value, "scalar") : number(value, "gain"))
                         : value.is_number() ? std::optional(value.get<double>())
                                             : std::nullopt;
      if (inner && std::abs(*inner - neutral.value) > 1e-6) {
        out.push_back(item.key() + " = " + json(*inner).dump());
      }
    }
    find_not_neutral(item.value(), out);
  }
}

std::uint32_t buttons_of(const json& state) {
  const json& buttons = member(state, "buttons");
  constexpr const char* kNames[][2] = {{"a", "button_0"}, {"b", "button_1"}, {"c", "button_2"}, {"home", "button_3"}};
  std::uint32_t out = 0;
  for (std::size_t i = 0; i < std::size(kNames); ++i) {
    for (const char* const name : kNames[i]) {
      const json& pressed = member(buttons.is_object() ? buttons : state, name);
      if ((pressed.is_boolean() && pressed.get<bool>()) || (pressed.is_number() && pressed.get<double>() != 0.0)) {
        out |= 1u << i;
      }
    }
  }
  return out;
}

std::string id_of(const json& device) {
  const json& id = member(device, "device_id");
  return id.is_string() ? id.get<std::string>() : "";
}

void read_grip(const json& answer, const std::string& grip, ServiceState& out) {
  for (const char* const kind : kGripKinds) {
    for (const json& each : member(answer, kind)) {
      if (id_of(each) != grip) continue;
      const json& state = member(each, "state");
      const json& q = member(state, "orientation");
      const auto w = number(q, "w"), x = number(q, "x"), y = number(q, "y"), z = number(q, "z");
      if (w && x && y && z) {
        const double norm = std::sqrt(*w * *w + *x * *x + *y * *y + *z * *z);
        if (norm > 0.5 && norm < 2.0) out.grip_wxyz = Quat{*w / norm, *x / norm, *y / norm, *z / norm};
      }
      out.buttons = buttons_of(state);
    }
  }
}

void append(std::string& out, double value) {
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed, 6);
  out.append(digits, end.ptr);
}

}  // namespace

rtbus::Result<Inventory, std::string> read_inventory(std::string_view text) {
  const json all = parsed(text);
  const json& inverses = member(all, "inverse3");
  if (inverses.is_object()) {
    return rtbus::Failure{std::string("the service speaks the format of version 3.0; install version 3.1 or later")};
  }
  if (!all.is_object())
    return rtbus::Failure{std::string("what answers is no Inverse Service: its first message is no JSON")};
  Inventory out;
  for (const json& each : inverses) out.inverses.push_back({id_of(each), calibrated(each)});
  for (const char* const kind : kGripKinds) {
    for (const json& each : member(all, kind)) out.grips.push_back(std::string(kind) + ":" + id_of(each));
  }
  find_not_neutral(all, out.not_neutral);
  return out;
}

rtbus::Result<std::optional<ServiceState>, std::string> read_state(std::string_view text, const std::string& device,
                                                                   const std::string& grip) {
  const json all = parsed(text);
  if (!all.is_object()) return rtbus::Failure{std::string("the service's answer is no JSON")};
  for (const json& each : member(all, "inverse3")) {
    if (id_of(each) != device) continue;
    const json& state = member(each, "state");
    const auto position = vector(member(state, "cursor_position"));
    if (!position) return rtbus::Failure{std::string("the service's answer has no cursor_position")};
    ServiceState out;
    out.position_m = *position;
    out.force_n = vector(member(state, "current_cursor_force")).value_or(Vec3{});
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    out.velocity_m_s = vector(member(state, "cursor_velocity")).value_or(Vec3{kNone, kNone, kNone});
    out.calibrated = calibrated(each);
    if (!grip.empty()) read_grip(all, grip, out);
    return std::optional(out);
  }
  return std::optional<ServiceState>();
}

std::optional<Version> read_version(std::string_view text) {
  const json all = parsed(text);
  const json& inner = member(all, "data").is_object() ? member(all, "data") : all;
  const json& version = member(inner, "project_version");
  if (!version.is_string()) return std::nullopt;
  const std::string words = version.get<std::string>();
  Version out;
  const char* const end = words.data() + words.size();
  const auto major = std::from_chars(words.data(), end, out.major);
  if (major.ec != std::errc() || major.ptr == end || *major.ptr != '.') return std::nullopt;
  const auto minor = std::from_chars(major.ptr + 1, end, out.minor);
  return minor.ec == std::errc() ? std::optional(out) : std::nullopt;
}

std::string read_event(std::string_view text) {
  const json event = parsed(text);
  const auto words = [&](const char* key) {
    const json& value = member(event, key);
    return value.is_string() ? value.get<std::string>() : std::string();
  };
  const std::string name = words("name"), level = words("level");
  // What the service itself calls harmless: connections, deprecated routes, sleep.
  if (name.empty() || level == "info" || level == "debug" || level == "trace") return {};
  std::string out = "the Inverse Service says " + name;
  if (const std::string message = words("message"); !message.empty()) out += ": " + message;
  if (const json& data = member(event, "data"); data.is_object() && !data.empty()) out += " " + data.dump();
  return out;
}

void write_command(std::string& out, bool first, const std::string& device, const std::string& grip,
                   std::string_view grip_kind, ForceField field, const Vec3& force_n) {
  out.assign("{");
  if (first) out += R"("session":{"configure":{"profile":{"name":"rtbus"}}},)";
  out += R"("inverse3":[{"device_id":")" + device + R"(","commands":{"set_cursor_force":{")";
  out += field == ForceField::kVector ? "vector" : "values";
  out += R"(":{"x":)";
  append(out, force_n[0]);
  out += R"(,"y":)";
  append(out, force_n[1]);
  out += R"(,"z":)";
  append(out, force_n[2]);
  out += "}}}}]";
  if (!grip.empty()) {
    out += ",\"";
    out += grip_kind;
    out += R"(":[{"device_id":")" + grip + R"(","commands":{"probe_orientation":{}}}])";
  }
  out += "}";
}

}  // namespace drivers::haply
