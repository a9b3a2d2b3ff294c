/// mujoco_engine: MuJoCo in the place of physics_node, by the same interface as a stranger's engine (rtbus_engine.h).
/// `rtbus run` starts it for `physics: {engine: mujoco}`.
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "physics_node/external/rtbus_engine.h"
#include "physics_node/mujoco/simulation.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/config/shared_keys.hpp"

namespace {

constexpr int kExitFailed = 1;
constexpr int kExitUsage = 2;

int failed(const char* what, int status) {
  std::fprintf(stderr, "mujoco_engine: %s: %s\n", what, rtbus_engine_last_error());
  return status == RTBUS_ENGINE_E_CONFIG ? kExitUsage : kExitFailed;
}

rtbus::config::SessionConfig read_session() {
  const char* const file = std::getenv("RTBUS_ENGINE_CONFIG");
  if (file == nullptr) {
    throw rtbus::config::Error("mujoco_engine is started by `rtbus run` for sessions with physics: {engine: mujoco}");
  }
  std::vector<rtbus::config::Override> overrides;
  const char* const set = std::getenv("RTBUS_ENGINE_SET");
  for (std::string_view lines = set == nullptr ? "" : set; !lines.empty();) {
    const std::size_t end = std::min(lines.find('\n'), lines.size());
    if (end > 0) overrides.push_back(rtbus::config::parse_override(lines.substr(0, end)));
    lines.remove_prefix(std::min(end + 1, lines.size()));
  }
  return rtbus::config::load_session(file, overrides);
}

std::vector<mujoco::ToolShape> tools_of(rtbus::config::SessionConfig& session) {
  std::vector<mujoco::ToolShape> out;
  for (rtbus::config::HapticEntry& entry : session.haptic) {
    rtbus::config::ProxyBodyConfig body;
    if (auto proxy = entry.map.optional_map("proxy")) body = rtbus::config::read_proxy_body(*proxy);
    out.push_back({body.radius_m, body.mass_kg});
  }
  return out;
}

/// One step: hands in, world on, answers out. @returns a status.
int take_step(rtbus_engine* engine, mujoco::Simulation& world, std::uint32_t hands) {
  rtbus_engine_hand hand{};
  hand.struct_bytes = sizeof hand;
  std::vector<bool> wants(hands);
  for (std::uint32_t i = 0; i < hands; ++i) {
    if (const int status = rtbus_engine_get_hand(engine, i, &hand); status < 0) return status;
    world.set_hand(i, hand);
    wants[i] = hand.wants_contacts != 0;
  }
  world.step();
  for (std::uint32_t i = 0; i < world.bodies(); ++i) {
    const rtbus_engine_body body = world.body(i);
    if (const int status = rtbus_engine_set_body(engine, i, &body); status < 0) return status;
  }
  bool any = false;
  for (std::uint32_t i = 0; i < hands; ++i) {
    const rtbus_engine_tool tool = world.tool(i);
    if (const int status = rtbus_engine_set_tool(engine, i, &tool); status < 0) return status;
    if (!wants[i]) continue;
    any = true;
    for (const rtbus_engine_contact& contact : world.contacts(i)) {
      if (const int status = rtbus_engine_add_contact(engine, i, &contact); status < 0) return status;
    }
  }
  if (any) {
    for (const rtbus_engine_support& support : world.supports()) {
      if (const int status = rtbus_engine_add_support(engine, &support); status < 0) return status;
    }
  }
  return rtbus_engine_finish(engine);
}

int run(rtbus_engine* engine, mujoco::Simulation& world, std::uint32_t hands) {
  rtbus_engine_step step{};
  step.struct_bytes = sizeof step;
  int overflows = 0;
  for (int status = 0; (status = rtbus_engine_begin(engine, &step)) != RTBUS_ENGINE_E_ENDED;) {
    if (status < 0) return failed("begin", status);
    if (step.due == 0) continue;
    if (status = take_step(engine, world, hands); status < 0) return failed("step", status);
    if (world.overflows() > overflows) {
      overflows = world.overflows();
      std::fprintf(stderr, "mujoco_engine: contacts without room were left out %d times so far\n", overflows);
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && (std::string_view(argv[1]) == "--help" || std::string_view(argv[1]) == "-h")) {
    std::puts(
        "mujoco_engine: MuJoCo in the place of physics_node. `rtbus run SESSION` starts it when the session says\n"
        "physics: {engine: mujoco}. It takes no arguments.");
    return 0;
  }
  mujoco::take_errors();
  rtbus_engine* engine = nullptr;
  int status = 0;
  try {
    rtbus::config::SessionConfig session = read_session();
    const std::vector<mujoco::ToolShape> tools = tools_of(session);
    rtbus_engine_options options{};
    options.struct_bytes = sizeof options;
    options.gives = RTBUS_GIVES_BODIES;
    if (status = rtbus_engine_open(&options, &engine); status < 0) return failed("open", status);
    rtbus_engine_info info{};
    info.struct_bytes = sizeof info;
    if (status = rtbus_engine_get_info(engine, &info); status < 0) return failed("info", status);
    // As far as a hand at 0.5 m/s gets in two steps, and a little.
    mujoco::Simulation world(session.scene, tools, info.step_s, std::max(2e-3, 2.0 * info.step_s * 0.5));
    status = run(engine, world, info.hands);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    status = kExitUsage;
  }
  rtbus_engine_close(engine);
  return status;
}
