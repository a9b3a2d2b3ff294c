#include "tools/evaluation/conformance/outside_engine.hpp"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/run/run_plan.hpp"

namespace tools {

namespace {

constexpr double kStart_s = 30.0, kAnswer_s = 10.0;
constexpr std::uint64_t kLook_ns = 20 * rtbus::kNsPerMs, kPoll_ns = 30'000;
/// After 100 ms without a sample physics takes a hand for gone.
constexpr std::uint64_t kLongestPause_ns = 80 * rtbus::kNsPerMs;

std::string session_name() {
  static int count = 0;
  return "conformance-" + std::to_string(::getpid()) + "-" + std::to_string(++count);
}

}  // namespace

OutsideEngine::OutsideEngine(const EngineFile& engine, const OutsideSetup& setup)
    : engine_(engine), setup_(setup), supervisor_([](const std::string&, std::string_view) {}) {
  session_.name = session_name();
  const RunPlan plan = make_run_plan(write_session(), {});
  auto hand = rtbus::Publication<rtbus::DeviceState>::create(session_, "haptic0.device_state");
  if (!hand) throw EngineFailed("haptic0.device_state: " + std::string(rtbus::to_string(hand.error())));
  hand_.emplace(std::move(*hand));
  answers_.emplace(session_, "physics.proxy_state.haptic0");
  contacts_.emplace(session_, "physics.contacts.haptic0");
  if (plan.nodes.empty() || plan.nodes.front().stage != Stage::kPhysics) {
    throw EngineFailed("the session starts no engine");
  }
  if (auto started = supervisor_.start(plan.nodes.front()); !started) throw EngineFailed(started.error());
  // It finds the hand by and by, and sees one sample of several.
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(kStart_s * 1e9);
  rtbus::Stamped<rtbus::ProxyState> answer;
  while (answers_->read_latest(answer) != rtbus::ReadStatus::kFresh || !contacts_->attached()) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (now_ns > end_ns) throw EngineFailed("no answer within " + std::to_string(static_cast<int>(kStart_s)) + " s");
    hand_->publish(state_of({Eigen::Vector3d(0, 0.1, 0)}), now_ns);
    ++sent_;
    looked_ns_ = 0;
    look_after();
    rtbus::sleep_until(now_ns + kLook_ns);
  }
}

OutsideEngine::~OutsideEngine() {
  (void)supervisor_.end_all();
  contacts_.reset();
  answers_.reset();
  hand_.reset();
  rtbus::remove_dead(session_.name);
}

std::string OutsideEngine::write_session() const {
  std::string file = setup_.folder + "/" + session_.name + ".yaml";
  const double rate_hz = 1.0 / setup_.step_s;
  std::ofstream out(file);
  out.precision(17);
  out << "schema: session/1\nsession: " << session_.name << "\nscene: {schema: scene/1, name: conformance, bodies: ["
      << setup_.bodies << "]}\nphysics:\n  engine: " << engine_.engine << '\n';
  if (!engine_.command.empty()) {
    out << "  command: [";
    for (const std::string& part : engine_.command)
      out << (&part == engine_.command.data() ? "\"" : ", \"") << part << '"';
    out << "]\n";
  }
  out << "  rate_hz: " << rate_hz << "\n  step_on: packet\n  contacts: on\n  contact_radius_m: " << kContactRadius_m
      << "\nhaptic:\n  - name: haptic0\n    link_rate_hz: " << rate_hz
      << "\n    device: {schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: drop, position_m: "
         "[0, 0, 0]}}\n"
      << "    method: remote_virtual_coupling\n    coupling: {stiffness_n_per_m: " << kToolStiffness_n_per_m
      << ", damping_n_s_per_m: 0.5}\n    proxy: {mass_kg: " << kToolMass_kg << ", radius_m: " << kToolRadius_m
      << ", friction: " << kToolFriction << "}\n";
  return file;
}

rtbus::DeviceState OutsideEngine::state_of(const OutsideHand& hand) const {
  rtbus::DeviceState state;
  state.target_position_m = rtbus::array_of(hand.target_m);
  state.target_velocity_m_s = rtbus::array_of(hand.velocity_m_s);
  state.position_m = state.target_position_m;
  state.velocity_m_s = state.target_velocity_m_s;
  // The stiffness in the world is the session's times force_scale / position_scale.
  state.force_scale = hand.stiffness_n_per_m / kToolStiffness_n_per_m;
  state.sample_time_ns = rtbus::monotonic_ns();
  state.mapping_epoch = epoch_;
  state.enabled = 1;
  if (hand.placed) {
    state.wants = rtbus::kWantsContacts | rtbus::kOwnsProxy;
    state.hand_impulse_body[0] = hand.pushed_body;
    state.hand_impulse_generation[0] = 1;
    state.hand_impulse_n_s[0] = rtbus::array_of(hand.impulse_n_s);
  }
  return state;
}

void OutsideEngine::look_after() {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (now_ns < looked_ns_ + kLook_ns) return;
  looked_ns_ = now_ns;
  answers_->maintain();
  contacts_->maintain();
  if (const auto ended = supervisor_.poll()) {
    std::string said = "the engine " + ended->how();
    for (const std::string& line : ended->last_words) said += "\n  " + line;
    throw EngineFailed(said);
  }
}

void OutsideEngine::publish(const OutsideHand& hand) {
  published_ns_ = rtbus::monotonic_ns();
  hand_->publish(state_of(hand), published_ns_);
  ++sent_;
}

rtbus::ProxyState OutsideEngine::step(const OutsideHand& hand) {
  const std::uint64_t began_ns = rtbus::monotonic_ns();
  const auto give_up = [this](std::uint64_t since_ns) {
    published_ns_ = 0;
    throw HandPaused(1e-6 * static_cast<double>(rtbus::monotonic_ns() - since_ns));
  };
  if (published_ns_ != 0 && began_ns > published_ns_ + kLongestPause_ns) give_up(published_ns_);
  publish(hand);
  const std::uint64_t sequence = sent_;
  const std::uint64_t end_ns = began_ns + static_cast<std::uint64_t>(kAnswer_s * 1e9);
  rtbus::Stamped<rtbus::ProxyState> answer;
  while (answers_->read_latest(answer) != rtbus::ReadStatus::kFresh || answer.value.device_sequence < sequence) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (now_ns > end_ns) {
      throw EngineFailed("no answer within " + std::to_string(static_cast<int>(kAnswer_s)) + " s");
    }
    // An engine that paused finds an old sample, takes the hand for gone and waits for it: is it there still?
    if (now_ns > published_ns_ + kLongestPause_ns) publish(hand);
    look_after();
    rtbus::sleep_until(rtbus::monotonic_ns() + kPoll_ns);
  }
  if (sent_ != sequence) give_up(began_ns);
  step_index_ = answer.value.step_index;
  return answer.value;
}

rtbus::ProxyContacts OutsideEngine::contacts() {
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(kAnswer_s * 1e9);
  rtbus::Stamped<rtbus::ProxyContacts> set;
  while (contacts_->read_latest(set) != rtbus::ReadStatus::kFresh || set.value.step_index != step_index_) {
    if (rtbus::monotonic_ns() > end_ns) throw EngineFailed("no contacts came with the answer");
    look_after();
    rtbus::sleep_until(rtbus::monotonic_ns() + kPoll_ns);
  }
  return set.value;
}

}  // namespace tools
