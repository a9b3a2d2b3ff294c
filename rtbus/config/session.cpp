#include "rtbus/config/session.hpp"

#include <arpa/inet.h>
#include <grp.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <utility>

namespace rtbus::config {
namespace {

constexpr std::size_t kMaxHapticNodes = 16;
constexpr std::size_t kMaxNodeName = 15;  // of a Linux thread

/// `mode: "0640"`: octal, owner always reads and writes, others never write.
mode_t read_mode(Map& bus) {
  const std::string text = bus.text("mode", "0600");
  unsigned mode = 0;
  const char* const end = text.data() + text.size();
  const auto [last, error] = std::from_chars(text.data(), end, mode, 8);
  if (error != std::errc{} || last != end || text.size() < 3 || text.size() > 4 || mode > 0777U) {
    bus.fail("mode", "is not a file mode; write it in octal, for example \"0600\" or \"0660\"");
  }
  if ((mode & 0600U) != 0600U) {
    bus.fail("mode", "keeps the owner out; the first digit must be 6, for example \"0600\"");
  }
  if ((mode & 0111U) != 0) {
    bus.fail("mode", "makes shared memory executable; use the digits 0, 4 and 6 only");
  }
  if ((mode & 0002U) != 0) {
    bus.fail("mode", "lets everybody write forces; at most \"0664\", or name a group");
  }
  return static_cast<mode_t>(mode);
}

/// `group: haptics`: a name of /etc/group or whatever the system's directory knows.
std::optional<gid_t> read_group(Map& bus, mode_t mode) {
  if (!bus.has("group")) {
    return std::nullopt;
  }
  const std::string name = bus.text("group");
  if ((mode & 0060U) == 0) {
    bus.fail("group", "has no effect: bus.mode gives a group no rights; set mode to \"0640\" or \"0660\"");
  }
  std::vector<char> buffer(1024);
  group entry{};
  group* found = nullptr;
  // A group with many members needs a larger buffer; a megabyte of them is no group of a laboratory.
  while (getgrnam_r(name.c_str(), &entry, buffer.data(), buffer.size(), &found) == ERANGE &&
         buffer.size() < (1U << 20)) {
    buffer.resize(buffer.size() * 2);
  }
  if (found == nullptr) {
    bus.fail("group", "is no group of this machine; 'getent group' lists them");
  }
  return found->gr_gid;
}

rtbus::Session read_bus(Map& root) {
  rtbus::Session session;
  session.name = root.text("session", session.name);
  if (!rtbus::Session::valid_name(session.name)) {
    root.fail("session", "is not a name; use 1…32 of a-z, 0-9, '_' and '-'");
  }
  if (std::optional<Map> bus = root.optional_map("bus")) {
    session.mode = read_mode(*bus);
    session.group = read_group(*bus, session.mode);
    bus->finish();
  }
  return session;
}

SuperviseConfig read_supervise(Map& root) {
  SuperviseConfig out;
  std::optional<Map> map = root.optional_map("supervise");
  if (!map) return out;
  out.restart = map->boolean("restart", out.restart);
  out.first_delay_s = map->number("first_delay_s", {0.1, 60.0}, out.first_delay_s);
  out.longest_delay_s = map->number("longest_delay_s", {0.1, 3600.0}, std::max(out.longest_delay_s, out.first_delay_s));
  if (out.longest_delay_s < out.first_delay_s) {
    map->fail("longest_delay_s", "is below supervise.first_delay_s; make it at least as long");
  }
  out.good_life_s = map->number("good_life_s", {0.1, 86400.0}, out.good_life_s);
  out.restarts = static_cast<int>(map->integer("restarts", 1, 1000, out.restarts));
  out.window_s = map->number("window_s", {1.0, 86400.0}, out.window_s);
  map->finish();
  return out;
}

bool valid_node_name(const std::string& name) {
  return !name.empty() && name.size() <= kMaxNodeName && name.front() >= 'a' && name.front() <= 'z' &&
         std::all_of(name.begin(), name.end(),
                     [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_'; });
}

std::vector<HapticEntry> read_haptic(Map& root) {
  std::vector<HapticEntry> out;
  for (Map& map : root.list_of_maps("haptic")) {
    std::string name = map.text("name");
    if (!valid_node_name(name)) {
      map.fail("name", "is not a node's name; use 1…15 of a-z, 0-9 and '_', a letter first, for example haptic0");
    }
    if (name == "physics") {
      map.fail("name", "is the physics node's; choose another, for example haptic0");
    }
    if (std::any_of(out.begin(), out.end(), [&name](const HapticEntry& other) { return other.name == name; })) {
      map.fail("name", "is taken by another haptic node; names are unique in a session");
    }
    out.push_back({std::move(name), std::move(map)});
  }
  if (out.empty()) {
    root.fail("haptic", "needs at least one haptic node: a list with '- name: haptic0', its device and its coupling");
  }
  if (out.size() > kMaxHapticNodes) {
    root.fail("haptic", "has more than " + std::to_string(kMaxHapticNodes) + " nodes");
  }
  return out;
}

/// "10.0.0.2": four numbers of 0 to 255. Names would ask a server, which a link must not wait for.
bool is_address(const std::string& text) {
  in_addr parsed{};
  return inet_pton(AF_INET, text.c_str(), &parsed) == 1;
}

NetworkConfig read_network(Map& root, bool physics, const std::vector<HapticEntry>& haptic) {
  NetworkConfig out;
  std::optional<Map> map = root.optional_map("network");
  if (!map) return out;
  out.domain = static_cast<int>(map->integer("domain", 0, 232, out.domain));
  if (std::optional<Map> machines = map->optional_map("machines")) {
    const auto read = [&](const std::string& node) {
      if (!machines->has(node)) {
        machines->fail(node, "is missing: where some machines are named, each node needs its machine's address");
      }
      out.machines[node] = machines->text(node);
      if (!is_address(out.machines[node])) {
        machines->fail(node, "is no IPv4 address of a machine; write one, for example 192.168.1.2");
      }
    };
    if (physics) read("physics");
    for (const HapticEntry& entry : haptic) read(entry.name);
    machines->finish();
  }
  map->finish();
  return out;
}

}  // namespace

HapticEntry* SessionConfig::find_haptic(std::string_view name) {
  const auto found =
      std::find_if(haptic.begin(), haptic.end(), [name](const HapticEntry& e) { return e.name == name; });
  return found == haptic.end() ? nullptr : &*found;
}

SessionConfig load_session(const std::string& file, const std::vector<Override>& overrides) {
  Map root = load(file, overrides);
  (void)root.choice("schema", {"session/1"});
  rtbus::Session session = read_bus(root);
  SuperviseConfig supervise = read_supervise(root);
  Map scene_map = root.file_or_map("scene");
  Scene scene = read_scene(scene_map);
  std::optional<Map> physics = root.optional_map("physics");
  std::vector<HapticEntry> haptic = read_haptic(root);
  NetworkConfig network = read_network(root, physics.has_value(), haptic);
  std::optional<Map> bridge = root.optional_map("bridge");
  root.finish();
  return {std::move(session), supervise,          std::move(scene),  std::move(physics),
          std::move(haptic),  std::move(network), std::move(bridge), file};
}

}  // namespace rtbus::config
