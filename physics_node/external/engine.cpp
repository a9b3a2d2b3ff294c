// The functions of rtbus_engine.h: a physics node around an ExternalWorld.
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "physics_node/external/engine_state.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/node_log.hpp"

namespace {

using namespace physics::external;

constexpr std::uint64_t kLongestWait_ns = 100 * rtbus::kNsPerMs;
/// How far a tool may move in two steps at this speed, at least; as physics::Stepper::contact_radius_m does.
constexpr double kLeastReach_m = 1e-3;

std::atomic<bool> g_asked_to_end{false};
void on_sigterm(int) { g_asked_to_end.store(true, std::memory_order_relaxed); }

std::string from_environment(const char* given, const char* variable) {
  if (given != nullptr) return given;
  const char* const text = std::getenv(variable);
  return text == nullptr ? "" : text;
}

std::vector<rtbus::config::Override> overrides_of(std::string_view lines) {
  std::vector<rtbus::config::Override> out;
  while (!lines.empty()) {
    const std::size_t end = std::min(lines.find('\n'), lines.size());
    if (end > 0) out.push_back(rtbus::config::parse_override(lines.substr(0, end)));
    lines.remove_prefix(std::min(end + 1, lines.size()));
  }
  return out;
}

/// `rtbus run` ends its children by SIGTERM. An engine that handles it itself keeps its handler.
void listen_for_the_end() {
  struct sigaction before {};
  if (::sigaction(SIGTERM, nullptr, &before) != 0 || before.sa_handler != SIG_DFL) return;
  struct sigaction mine {};
  mine.sa_handler = on_sigterm;
  ::sigaction(SIGTERM, &mine, nullptr);
}

int open_engine(const rtbus_engine_options& options, rtbus_engine** out) {
  const std::string file = from_environment(options.config, "RTBUS_ENGINE_CONFIG");
  if (file.empty()) {
    return fail(RTBUS_ENGINE_E_CONFIG,
                "no session: let `rtbus run` start this engine (physics.command), or name a session file");
  }
  rtbus::config::SessionConfig session =
      rtbus::config::load_session(file, overrides_of(from_environment(options.set, "RTBUS_ENGINE_SET")));
  physics::NodeConfig config = physics::read_node_config(session);
  auto made = std::make_unique<rtbus_engine>();
  made->session = config.session;
  made->step_s = config.physics.step_s() / config.physics.parts_per_step();
  made->gravity_m_s2 = config.scene.gravity_m_s2;
  made->gives_bodies = (options.gives & RTBUS_GIVES_BODIES) != 0;
  made->answer.tools.resize(config.proxies.size());
  const std::size_t bodies = options.bodies != 0 ? options.bodies : config.scene.bodies.size();
  auto world = std::make_unique<physics::ExternalWorld>(bodies, made->gives_bodies);
  made->world = world.get();
  rtbus::log_to_stderr("engine");
  auto opened = physics::Node::open(std::move(config), std::move(world));
  if (!opened) return fail(RTBUS_ENGINE_E_OWNED, opened.error().message);
  made->node = std::move(*opened);
  listen_for_the_end();
  made->node->start();
  *out = made.release();
  return RTBUS_ENGINE_OK;
}

void fill_hand(const rtbus_engine& engine, const physics::ExternalHand& hand, rtbus_engine_hand& out) {
  put(hand.parameters.device, out.name);
  out.tool = static_cast<std::uint32_t>(hand.mode);
  out.reset = hand.reset ? 1 : 0;
  out.mass_kg = hand.parameters.mass_kg;
  out.radius_m = hand.parameters.radius_m;
  out.friction = hand.parameters.friction;
  put(hand.target.position_m, out.target_position_m);
  put(hand.target.velocity_m_s, out.target_velocity_m_s);
  out.stiffness_n_per_m = hand.target.stiffness_n_per_m;
  out.damping_n_s_per_m = hand.target.damping_n_s_per_m;
  put(hand.target.force_n, out.force_n);
  out.wants_contacts = hand.mode == physics::ToolMode::kPlaced ? 1 : 0;
  const double speed_m_s = std::max(hand.target.velocity_m_s.norm(), physics::Stepper::kHandSpeed_m_s) +
                           physics::Stepper::kFall_m_s2 * engine.step_s;
  out.contact_reach_m = std::max(kLeastReach_m, 4.0 * engine.step_s * speed_m_s);
  out.pushes = static_cast<std::uint32_t>(std::min<std::size_t>(hand.pushes.size(), RTBUS_ENGINE_PUSHES));
  for (std::uint32_t i = 0; i < out.pushes; ++i) {
    out.push[i].body = static_cast<std::uint32_t>(hand.pushes[i].body);
    put(hand.pushes[i].force_n, out.push[i].force_n);
    put(hand.pushes[i].torque_n_m, out.push[i].torque_n_m);
  }
}

}  // namespace

const char* rtbus_engine_last_error(void) { return sentence().c_str(); }
uint32_t rtbus_engine_abi_version(void) { return RTBUS_ENGINE_ABI_VERSION; }

int rtbus_engine_open(const rtbus_engine_options* options, rtbus_engine** out) {
  return guarded([&]() -> int {
    if (out == nullptr) return fail(RTBUS_ENGINE_E_ARGUMENT, "out must not be null");
    *out = nullptr;
    rtbus_engine_options given;
    (void)take_struct(options, given);
    return open_engine(given, out);
  });
}

void rtbus_engine_close(rtbus_engine* engine) {
  if (engine == nullptr) return;
  engine->world->close();
  delete engine;
}

int rtbus_engine_get_info(const rtbus_engine* engine, rtbus_engine_info* out) {
  if (engine == nullptr) return fail(RTBUS_ENGINE_E_ARGUMENT, "engine must not be null");
  rtbus_engine_info info{};
  put(engine->session.name, info.session);
  info.step_s = engine->step_s;
  put(engine->gravity_m_s2, info.gravity_m_s2);
  info.hands = static_cast<std::uint32_t>(engine->world->hands().size());
  info.bodies = static_cast<std::uint32_t>(engine->world->bodies());
  return give_struct(info, out);
}

int rtbus_engine_begin(rtbus_engine* engine, rtbus_engine_step* out) {
  return guarded([&]() -> int {
    if (engine == nullptr) return fail(RTBUS_ENGINE_E_ARGUMENT, "engine must not be null");
    if (g_asked_to_end.load(std::memory_order_relaxed)) return fail(RTBUS_ENGINE_E_ENDED, "the session ends");
    rtbus_engine_step step{};
    const auto due = engine->world->wait_for_step(rtbus::monotonic_ns() + kLongestWait_ns);
    if (due && !engine->in_step) {
      engine->in_step = true;
      engine->this_step_s = *due;
      ++engine->steps;
      engine->answer.supports.clear();
      for (auto& tool : engine->answer.tools) {
        tool.set = false;
        tool.contacts.clear();
      }
      if (const std::string& unserved = engine->world->unserved(); !unserved.empty()) {
        return fail(RTBUS_ENGINE_E_CONFIG,
                    unserved +
                        ": its method (local_contact) needs bodies and contacts, and this engine gives the tool only; "
                        "write method: remote_virtual_coupling, or let the engine give bodies");
      }
    }
    step.due = due ? 1 : 0;
    step.step_s = engine->this_step_s;
    step.step_index = engine->steps;
    return give_struct(step, out);
  });
}

int rtbus_engine_get_hand(rtbus_engine* engine, uint32_t hand, rtbus_engine_hand* out) {
  return guarded([&]() -> int {
    if (engine == nullptr || hand >= engine->world->hands().size()) {
      return fail(RTBUS_ENGINE_E_ARGUMENT, "there is no hand " + std::to_string(hand));
    }
    const physics::ExternalHand& now = engine->world->hands()[hand];
    rtbus_engine_hand filled{};
    if (engine->in_step) {
      fill_hand(*engine, now, filled);
    } else if (engine->steps == 0) {
      // What the step thread never changes.
      physics::ExternalHand before;
      before.parameters = now.parameters;
      fill_hand(*engine, before, filled);
    } else {
      return fail(RTBUS_ENGINE_E_ORDER, "no step is due: call rtbus_engine_begin() first");
    }
    return give_struct(filled, out);
  });
}

int rtbus_engine_finish(rtbus_engine* engine) {
  return guarded([&]() -> int {
    if (engine == nullptr) return fail(RTBUS_ENGINE_E_ARGUMENT, "engine must not be null");
    if (!engine->in_step) return fail(RTBUS_ENGINE_E_ORDER, "no step is due: call rtbus_engine_begin() first");
    const auto& hands = engine->world->hands();
    for (std::size_t i = 0; i < hands.size(); ++i) {
      if (hands[i].mode == physics::ToolMode::kSpring && !engine->answer.tools[i].set) {
        return fail(RTBUS_ENGINE_E_VALUE, "hand " + hands[i].parameters.device +
                                              ": its tool was not set in this step (rtbus_engine_set_tool)");
      }
    }
    const auto& bodies = std::as_const(*engine->world).state_of_bodies();
    const std::string failed = engine->shapes.publish_if_changed(
        engine->session, bodies.size(),
        [&bodies](std::uint32_t body) { return static_cast<std::uint32_t>(bodies[body].behind.kind); });
    engine->in_step = false;
    engine->world->finish(engine->answer);
    return failed.empty() ? RTBUS_ENGINE_OK : fail(RTBUS_ENGINE_E_SYSTEM, failed);
  });
}
