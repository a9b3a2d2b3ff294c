#include "drivers/virtual_vendor/haply/service.hpp"

#include <libwebsockets.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <utility>

#include "drivers/virtual_vendor/witness.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/vector3.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::virtual_vendor::haply {
namespace {

using Eigen::Vector3d;
using nlohmann::json;

// The service's frame: x right, y away from the user, z up; D: x right, y up, z to the user.
Vector3d from_d(const Vector3d& d) { return {d.x(), -d.z(), d.y()}; }
Vector3d to_d(const Vector3d& h) { return {h.x(), h.z(), -h.y()}; }
/// Middle of the workspace, as in the maker's examples.
const Vector3d kCentre_m{0.0, -0.12, 0.15};

json xyz(const Vector3d& v) { return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}}; }

}  // namespace

struct Service::State {
  explicit State(Settings s) : settings(std::move(s)), unit(settings.unit), calibrated(settings.calibrated) {}

  void run();
  rtbus::PlantState look(std::uint64_t now_ns);
  std::string inventory();
  std::string answer(lws* client, const std::string& message);
  void take_command(lws* client, const json& message, std::uint64_t now_ns);
  void send_events(std::uint64_t now_ns);
  json inverse(bool with_config);

  Settings settings;
  std::mutex mutex;  ///< Of the unit: the witness looks at it too.
  Unit unit;
  bool calibrated;
  bool closed_once = false;
  bool stalled = false;
  Vector3d acting_n = Vector3d::Zero();  ///< The service's frame.
  lws_context* context = nullptr;
  lws_vhost* events = nullptr;
  std::atomic<bool> ends{false};
  std::atomic<int> pongs{0};
  int port = -1, events_port = -1;
  std::thread thread;

  struct Client {
    std::string incoming;
    std::string outgoing;  ///< Empty: nothing to send.
    std::size_t sent = 0;
    bool halves = false;
    bool closes = false;
    bool ping_due = false;
    bool hears_events = false;
    Vector3d force_n = Vector3d::Zero();  ///< That it commands, until so long after its last message.
    std::uint64_t until_ns = 0;
  };
  std::map<lws*, Client> clients;
  std::optional<Witness> witness;
};

rtbus::PlantState Service::State::look(std::uint64_t now_ns) {
  const std::lock_guard lock(mutex);
  unit.advance_to(now_ns);
  return simulated::state_of(unit.mechanics(), now_ns);
}

json Service::State::inverse(bool with_config) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  json out = {{"device_id", settings.unit.serial},
              {"state",
               {{"cursor_position", xyz(from_d(unit.mechanics().measure(now_ns)) + kCentre_m)},
                {"cursor_velocity", xyz(from_d(unit.mechanics().velocity_m_s()))},
                {"current_cursor_force", xyz(acting_n)},
                {"control_mode", acting_n == Vector3d::Zero() ? "idle" : "cursor_force"},
                {"transform", json::object()}}},
              {"status", {{"calibrated", calibrated}}}};
  if (with_config) out["config"] = {{"force_scale", settings.force_scale}};
  return out;
}

std::string Service::State::inventory() {
  const std::lock_guard lock(mutex);
  json out = {{"session_id", "1"}, {"inverse3", json::array()}, {"verse_grip", json::array()}};
  unit.advance_to(rtbus::monotonic_ns());
  if (settings.format_3_0) {
    out["inverse3"] = {{settings.unit.serial, inverse(true)}};
    return out.dump();
  }
  if (unit.plugged_in(rtbus::monotonic_ns())) out["inverse3"].push_back(inverse(true));
  if (!settings.grip.empty()) out["verse_grip"].push_back({{"device_id", settings.grip}});
  return out.dump();
}

// Forces of all clients add up; a message without a force ends the client's own.
void Service::State::take_command(lws* client, const json& message, std::uint64_t now_ns) {
  Client& from = clients[client];
  from.force_n.setZero();
  from.until_ns = now_ns + rtbus::ns_of(settings.idle_after_s);
  if (const auto list = message.find("inverse3"); list != message.end() && list->is_array()) {
    for (const json& each : *list) {
      if (each.value("device_id", "") != settings.unit.serial || !each.contains("commands")) continue;
      const json force = each["commands"].value("set_cursor_force", json::object());
      const json v = force.value(settings.understands, json());  // any other key: ignored without a word
      if (v.is_object()) from.force_n += Vector3d(v.value("x", 0.0), v.value("y", 0.0), v.value("z", 0.0));
    }
  }
  if (!unit.begun()) unit.begin(now_ns);
  acting_n = from_d(settings.other_client_n);
  for (const auto& [socket, each] : clients) {
    if (each.until_ns > now_ns) acting_n += each.force_n;
  }
  acting_n *= calibrated ? settings.force_scale : 0.0;
  (void)unit.mechanics().set_force(to_d(acting_n), from.until_ns);
}

void Service::State::send_events(std::uint64_t now_ns) {
  if (settings.stall_at_s < 0.0 || unit.age_s(now_ns) < settings.stall_at_s || stalled) return;
  stalled = true;
  const json event = {{"name", "device-safety-triggered"},
                      {"category", "device"},
                      {"level", "warning"},
                      {"data", {{"device_id", settings.unit.serial}, {"safety_type", "stall_detected"}}},
                      {"message", "a motor stalls"}};
  for (auto& [socket, client] : clients) {
    if (!client.hears_events) continue;
    client.outgoing = event.dump();
    lws_callback_on_writable(socket);
  }
}

std::string Service::State::answer(lws* client, const std::string& text) {
  const std::lock_guard lock(mutex);
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  unit.advance_to(now_ns);
  if (settings.uncalibrate_at_s >= 0.0 && unit.age_s(now_ns) > settings.uncalibrate_at_s) calibrated = false;
  const json message = json::parse(text, nullptr, false);
  if (message.is_object() && unit.plugged_in(now_ns)) take_command(client, message, now_ns);
  json out = {{"inverse3", json::array()}, {"verse_grip", json::array()}};
  if (unit.plugged_in(now_ns)) out["inverse3"].push_back(inverse(false));
  if (!settings.grip.empty()) {
    const double half = 0.5 * settings.grip_rad;
    const std::uint32_t buttons = unit.mechanics().buttons();
    out["verse_grip"].push_back(
        {{"device_id", settings.grip},
         {"state",
          {{"orientation", {{"w", std::cos(half)}, {"x", 0}, {"y", 0}, {"z", std::sin(half)}}},
           {"buttons", {{"a", (buttons & 1u) != 0}, {"b", (buttons & 2u) != 0}, {"c", (buttons & 4u) != 0}}},
           {"battery_level", 0.8}}},
         {"status", {{"awake", true}}}});
  }
  std::string reply = out.dump();
  const auto wanted = static_cast<std::size_t>(settings.answer_bytes);
  if (constexpr std::string_view kPadding = ",\"padding\":\"\""; reply.size() + kPadding.size() <= wanted) {
    const std::string fill(wanted - reply.size() - kPadding.size(), 'x');
    reply.insert(reply.size() - 1, ",\"padding\":\"" + fill + "\"");
  }
  return reply;
}

namespace {

Service::State& state_of(lws* socket) {
  return *static_cast<Service::State*>(lws_context_user(lws_get_context(socket)));
}

int write_out(Service::State& state, lws* socket) {
  auto& client = state.clients[socket];
  if (client.closes) {
    if (state.settings.close_code != 0) {
      std::string reason = "restarting";
      lws_close_reason(socket, static_cast<lws_close_status>(state.settings.close_code),
                       reinterpret_cast<unsigned char*>(reason.data()), reason.size());
    }
    return -1;
  }
  if (std::exchange(client.ping_due, false)) {
    std::array<unsigned char, LWS_PRE + 5> ping{};
    std::memcpy(ping.data() + LWS_PRE, "there", 5);
    if (lws_write(socket, ping.data() + LWS_PRE, 5, LWS_WRITE_PING) < 0) return -1;
    lws_callback_on_writable(socket);
    return 0;
  }
  if (client.outgoing.empty()) return 0;
  const std::size_t all = client.outgoing.size();
  const bool halves = client.halves && client.sent == 0 && all > 2;
  const std::size_t bytes = halves ? all / 2 : all - client.sent;
  std::string frame(LWS_PRE, '\0');
  frame.append(client.outgoing, client.sent, bytes);
  const bool last = client.sent + bytes == all;
  const lws_write_protocol kind = state.settings.binary ? LWS_WRITE_BINARY : LWS_WRITE_TEXT;
  const int mode = (client.sent == 0 ? static_cast<int>(kind) : static_cast<int>(LWS_WRITE_CONTINUATION)) |
                   (last ? 0 : static_cast<int>(LWS_WRITE_NO_FIN));
  const int wrote = lws_write(socket, reinterpret_cast<unsigned char*>(frame.data()) + LWS_PRE, bytes,
                              static_cast<lws_write_protocol>(mode));
  if (wrote < 0) return -1;
  client.sent += bytes;
  if (last) {
    client.outgoing.clear();
    client.sent = 0;
  } else {
    client.ping_due = state.settings.ping_within;
    lws_callback_on_writable(socket);
  }
  return 0;
}

void take(Service::State& state, lws* socket) {
  auto& client = state.clients[socket];
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (client.hears_events) return;  // read-only
  std::string reply = state.answer(socket, client.incoming);
  client.incoming.clear();
  double t_s = 0.0, late_us = 0.0;
  bool halves = false;
  {
    const std::lock_guard lock(state.mutex);
    state.send_events(now_ns);
    t_s = state.unit.age_s(now_ns);
    late_us = state.unit.late_us(now_ns);
    halves = state.settings.fragments || state.unit.splits(now_ns);
    if (state.unit.garbles(now_ns)) {
      reply[state.unit.draw(reply.size())] ^= static_cast<char>(1u << state.unit.draw(8));
    }
  }
  const Settings& set = state.settings;
  const bool speaks_again = set.mute_for_s >= 0.0 && t_s > set.mute_at_s + set.mute_for_s;
  if (set.mute_at_s >= 0.0 && t_s > set.mute_at_s && !speaks_again) return;
  if (t_s < 0.0) state.closed_once = false;
  if (state.settings.close_at_s >= 0.0 && t_s >= state.settings.close_at_s && !state.closed_once) {
    state.closed_once = client.closes = true;
  }
  block_for_us(state.settings.slow_reply_us + late_us);
  client.outgoing = std::move(reply);
  client.halves = halves;
  lws_callback_on_writable(socket);
}

/// GET /version, and nothing else.
int answer_http(const Service::State& state, lws* socket, const char* path) {
  if (std::string_view(path) != "/version" || state.settings.version.empty()) {
    return lws_return_http_status(socket, HTTP_STATUS_NOT_FOUND, nullptr) == 0 ? 0 : -1;
  }
  const std::string body = json{{"ok", true}, {"data", {{"project_version", state.settings.version}}}}.dump();
  std::array<unsigned char, LWS_PRE + 1024> room{};
  unsigned char* const begin = room.data() + LWS_PRE;
  unsigned char* at = begin;
  unsigned char* const end = room.data() + room.size() - 1;
  if (lws_add_http_common_headers(socket, HTTP_STATUS_OK, "application/json", body.size(), &at, end) != 0 ||
      lws_finalize_write_http_header(socket, begin, &at, end) != 0) {
    return -1;
  }
  std::memcpy(begin, body.data(), body.size());
  if (lws_write(socket, begin, body.size(), LWS_WRITE_HTTP_FINAL) < 0) return -1;
  return lws_http_transaction_completed(socket) != 0 ? -1 : 0;
}

int on_event(lws* socket, lws_callback_reasons reason, void*, void* in, std::size_t bytes) {
  switch (reason) {
    case LWS_CALLBACK_HTTP:
      return answer_http(state_of(socket), socket, static_cast<const char*>(in));
    case LWS_CALLBACK_ESTABLISHED: {
      auto& client = state_of(socket).clients[socket];
      client.hears_events = lws_get_vhost(socket) == state_of(socket).events;
      if (client.hears_events) return 0;
      client.outgoing = state_of(socket).inventory();
      lws_callback_on_writable(socket);
      return 0;
    }
    case LWS_CALLBACK_CLOSED:
      state_of(socket).clients.erase(socket);
      return 0;
    case LWS_CALLBACK_SERVER_WRITEABLE:
      return write_out(state_of(socket), socket);
    case LWS_CALLBACK_RECEIVE_PONG:
      ++state_of(socket).pongs;
      return 0;
    case LWS_CALLBACK_RECEIVE:
      if (lws_frame_is_binary(socket) != 0) {
        std::string why = "text frames alone";
        lws_close_reason(socket, LWS_CLOSE_STATUS_UNACCEPTABLE_OPCODE, reinterpret_cast<unsigned char*>(why.data()),
                         why.size());
        return -1;
      }
      state_of(socket).clients[socket].incoming.append(static_cast<const char*>(in), bytes);
      if (lws_is_final_fragment(socket) != 0 && lws_remaining_packet_payload(socket) == 0)
        take(state_of(socket), socket);
      return 0;
    default:
      return 0;
  }
}

constexpr lws_protocols kProtocols[] = {{"", &on_event, 0, 65536, 0, nullptr, 0},
                                        {nullptr, nullptr, 0, 0, 0, nullptr, 0}};

}  // namespace

void Service::State::run() {
  rtbus::name_this_thread("haply_stand_in");
  // A device does not wait for this machine's other programs.
  (void)rtbus::enter_realtime({.priority = 70, .core = 0, .lock_memory = false, .hold_dma_latency = false});
  while (!ends.load() && lws_service(context, 0) >= 0) {
  }
}

Service::Service(Settings settings) : state_(std::make_unique<State>(std::move(settings))) {
  lws_set_log_level(0, nullptr);
  lws_context_creation_info info{};
  info.port = 0;  // any
  info.iface = "127.0.0.1";
  info.protocols = kProtocols;
  info.user = state_.get();
  info.options = LWS_SERVER_OPTION_DISABLE_IPV6 | LWS_SERVER_OPTION_EXPLICIT_VHOSTS;
  state_->context = lws_create_context(&info);
  if (state_->context == nullptr) return;
  info.vhost_name = "devices";
  lws_vhost* const devices = lws_create_vhost(state_->context, &info);
  info.vhost_name = "events";
  state_->events = lws_create_vhost(state_->context, &info);
  if (devices == nullptr || state_->events == nullptr) return;
  state_->port = lws_get_vhost_listen_port(devices);
  state_->events_port = lws_get_vhost_listen_port(state_->events);
  state_->thread = std::thread([this] { state_->run(); });
  state_->witness.emplace(state_->settings.unit, [this](std::uint64_t now_ns) { return state_->look(now_ns); });
}

Service::~Service() {
  state_->witness.reset();
  state_->ends.store(true);
  if (state_->context != nullptr) lws_cancel_service(state_->context);
  if (state_->thread.joinable()) state_->thread.join();
  if (state_->context != nullptr) lws_context_destroy(state_->context);
}

int Service::port() const noexcept { return state_->port; }
int Service::pongs() const noexcept { return state_->pongs.load(); }
int Service::events_port() const noexcept { return state_->events_port; }

Settings read(rtbus::config::Map& map, const DeviceInfo& info) {
  Settings out;
  out.unit = default_unit(info);
  out.unit.serial = "049D";
  out.unit.call_us = 0.0;
  read_unit(map, out.unit, true);
  out.grip = map.text("grip", out.grip);
  out.understands = map.choice("understands", {"vector", "values", "neither"}, out.understands);
  out.format_3_0 = map.boolean("format_3_0", out.format_3_0);
  out.calibrated = map.boolean("calibrated", out.calibrated);
  out.uncalibrate_at_s = map.number("uncalibrate_at_s", {-1.0, 1e6}, out.uncalibrate_at_s);
  out.idle_after_s = map.number("idle_after_s", {0.005, 10.0}, out.idle_after_s);
  out.force_scale = map.number("force_scale", {0.0, 1.0}, out.force_scale);
  out.slow_reply_us = map.number("slow_reply_us", {0.0, 1e6}, out.slow_reply_us);
  out.mute_at_s = map.number("mute_at_s", {-1.0, 1e6}, out.mute_at_s);
  out.mute_for_s = map.number("mute_for_s", {-1.0, 1e6}, out.mute_for_s);
  out.close_at_s = map.number("close_at_s", {-1.0, 1e6}, out.close_at_s);
  out.close_code = static_cast<int>(map.integer("close_code", 0, 4999, out.close_code));
  out.fragments = map.boolean("fragments", out.fragments);
  out.ping_within = map.boolean("ping_within", out.ping_within);
  out.answer_bytes = static_cast<int>(map.integer("answer_bytes", 0, 2'000'000, out.answer_bytes));
  out.binary = map.boolean("binary", out.binary);
  out.version = map.text("version", out.version);
  out.stall_at_s = map.number("stall_at_s", {-1.0, 1e6}, out.stall_at_s);
  out.other_client_n = rtbus::config::read_vector3(map, "other_client_n", {-10.0, 10.0}, out.other_client_n);
  out.grip_rad = map.number("grip_rad", {-3.2, 3.2}, out.grip_rad);
  return out;
}

}  // namespace drivers::virtual_vendor::haply
