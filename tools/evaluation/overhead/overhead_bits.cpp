#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/usb_module/usb_module.hpp"
#include "haptic_node/safety.hpp"
#include "physics_node/frame_publisher.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/publication.hpp"
#include "tools/cli/host/ask_kernel.hpp"
#include "tools/evaluation/overhead/overhead_parts.hpp"
#include "tools/harness/harness.hpp"

namespace tools {

namespace {

/// The hand has met the stack, the rabbit, the wall by then.
constexpr double kWall_s = 3.0, kStack_s = 1.5, kSoft_s = 2.5;
/// A stack pushed at once instead of after seconds.
const std::vector<std::string> kAtOnce{"haptic.0.device.hand.start_s=0.3", "haptic.0.device.hand.speed_m_s=0.05"};

struct Felt {
  std::vector<rtbus::Telemetry> ticks;
  std::uint64_t hash = 0;
  double rate_hz = 0.0;
  haptic::PassivityConfig passivity;
  int actuated_axes = 0;
};

/// Called for each tick, after the loop has written its force.
using Look = std::function<void(const Harness&, const rtbus::Telemetry&)>;

/// The first seconds of a session under the simulated clock.
Felt feel(const std::string& file, double seconds, const std::vector<std::string>& assignments = {},
          const Look& look = {}, bool passivity = true) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto session = rtbus::config::load_session(file, overrides);
  Harness harness(session, {.passivity = passivity});
  Felt out;
  harness.run(seconds, [&](const rtbus::Telemetry& tick) {
    out.ticks.push_back(tick);
    if (look) look(harness, tick);
  });
  out.hash = harness.hash();
  out.rate_hz = harness.config().rate_hz;
  out.passivity = harness.config().safety.passivity;
  out.actuated_axes = harness.config().device->info().dof_actuated;
  return out;
}

std::uint64_t now_ns(const Harness& harness) {
  return rtbus::kNsPerS + static_cast<std::uint64_t>(harness.now_s() * 1e9);
}

/// A publisher of the physics node on a real topic, with a reader, and how many samples that reader has got.
template <class Publisher, class Message>
class Watched {
 public:
  Watched(const rtbus::Session& bus, std::string topic) : bus_(bus), topic_(std::move(topic)) {}
  void operator()(const Harness& harness, std::size_t count) {
    if (!publisher_) {
      auto created = Publisher::create(bus_, count);
      if (!created) return;
      publisher_ = std::move(*created);
      auto opened = rtbus::Reader<Message>::open(bus_, topic_, {.presence = true});
      if (opened) reader_.emplace(std::move(*opened));
    }
    publisher_->maintain();
    publisher_->publish_if_due(*harness.stepper(), now_ns(harness));
    while (reader_ && reader_->read_next(sample_) == rtbus::ReadStatus::kFresh) frames_ = sample_.value.frame;
  }
  [[nodiscard]] double frames() const { return static_cast<double>(frames_); }

 private:
  const rtbus::Session& bus_;
  std::string topic_;
  std::unique_ptr<Publisher> publisher_;
  std::optional<rtbus::Reader<Message>> reader_;
  rtbus::Stamped<Message> sample_;
  std::uint64_t frames_ = 0;
};

class Bits {
 public:
  explicit Bits(Experiment& experiment) : experiment_(experiment) {
    bus_.name = "overhead-" + std::to_string(::getpid());
  }

  void same(const char* id, const std::string& what, const Felt& without, const Felt& with) {
    experiment_.check_between("overhead.bits." + std::string(id), what + ": force bit-identical",
                              without.hash == with.hash && !without.ticks.empty() ? 1.0 : 0.0, "1", 1.0, 1.0);
  }

  /// Libraries of this process: this tool itself links HDF5, but neither an engine nor a driver.
  void mapped(const char* id, const char* part, std::size_t least, std::size_t most) {
    LiveFigures self;
    self.libraries = mapped_libraries(::getpid());
    experiment_.check_between(
        "overhead.bits." + std::string(id), std::string("libraries of this process named ") + part,
        static_cast<double>(self.libraries_named(part)), "1", static_cast<double>(least), static_cast<double>(most));
  }

  void seen(const char* id, const char* what, double count, double low, double high) {
    experiment_.check_between("overhead.bits." + std::string(id), what, count, "1", low, high);
  }

  [[nodiscard]] const rtbus::Session& bus() const { return bus_; }
  [[nodiscard]] Experiment& experiment() { return experiment_; }

 private:
  Experiment& experiment_;
  rtbus::Session bus_;
};

/// Each tick goes out on a real topic, and whoever records takes it from there.
void check_recorder(Bits& bits, const OverheadOptions& options, const Felt& wall) {
  auto writer = rtbus::Publication<rtbus::Telemetry>::create(bits.bus(), "haptic0.telemetry", {.capacity = 2048});
  auto reader = rtbus::Reader<rtbus::Telemetry>::open(bits.bus(), "haptic0.telemetry", {.presence = true});
  if (!writer || !reader) return bits.seen("recorder.topic", "wall, recorder: topic opened", 0.0, 1.0, 1.0);
  std::uint64_t taken = 0;
  rtbus::Stamped<rtbus::Telemetry> sample;
  const Felt recorded = feel(options.wall_file, kWall_s, {}, [&](const Harness& harness, const rtbus::Telemetry& tick) {
    writer->publish(tick, now_ns(harness));
    while (reader->read_next(sample) == rtbus::ReadStatus::kFresh) ++taken;
  });
  bits.seen("recorder.taken", "wall: ticks that a reader took in the harness", static_cast<double>(taken),
            static_cast<double>(wall.ticks.size()), static_cast<double>(wall.ticks.size()));
  bits.same("recorder", "wall, every tick recorded", wall, recorded);
}

/// What the observed energy and its limits cost per tick, on the ticks of a run.
double passivity_ns(const Felt& felt) {
  constexpr int kRounds = 9;
  std::vector<double> rounds;
  double kept_n = 0.0;  // so that the work is done
  const double dt_s = 1.0 / felt.rate_hz;
  for (int round = 0; round < kRounds; ++round) {
    haptic::Passivity passivity(felt.passivity);
    Eigen::Vector3d sent_n = Eigen::Vector3d::Zero();
    const std::uint64_t began_ns = rtbus::monotonic_ns();
    for (const rtbus::Telemetry& tick : felt.ticks) {
      bool limited = false, damped = false;
      const Eigen::Vector3d velocity_m_s = rtbus::vector_of(tick.velocity_m_s);
      passivity.observe(sent_n, rtbus::vector_of(tick.position_m), dt_s);
      passivity.give(0.0);
      const Eigen::Vector3d whole_n = rtbus::vector_of(tick.rendered_force_n);
      sent_n = passivity.limit(whole_n, whole_n.norm(), velocity_m_s, limited);
      sent_n = passivity.control(sent_n, velocity_m_s, dt_s, damped);
    }
    const std::uint64_t ended_ns = rtbus::monotonic_ns();
    kept_n += sent_n.norm();
    rounds.push_back(static_cast<double>(ended_ns - began_ns) / static_cast<double>(felt.ticks.size()));
  }
  std::nth_element(rounds.begin(), rounds.begin() + kRounds / 2, rounds.end());
  return std::isfinite(kept_n) ? rounds[kRounds / 2] : std::numeric_limits<double>::quiet_NaN();
}

/// No session can leave passivity out; the harness can. It may change nothing before it has something to do.
void check_passivity(Bits& bits, const char* scene, const Felt& with, const Felt& without, Table& table) {
  std::size_t acted = with.ticks.size(), before = 0, all = 0;
  for (std::size_t i = 0; i < with.ticks.size(); ++i) {
    if ((with.ticks[i].safety & haptic::kPassivity) == 0) continue;
    acted = std::min(acted, i);
    ++all;
  }
  for (std::size_t i = 0; i < acted; ++i) before += with.ticks[i].force_n != without.ticks[i].force_n ? 1U : 0U;
  const double first_s =
      acted == with.ticks.size() ? std::numeric_limits<double>::quiet_NaN() : static_cast<double>(acted) / with.rate_hz;
  bits.seen(("passivity." + std::string(scene)).c_str(),
            (std::string(scene) + ": ticks with another force without passivity, before it first acts").c_str(),
            static_cast<double>(before), 0.0, 0.0);
  table.rows.push_back({std::string(scene), passivity_ns(with), static_cast<double>(with.ticks.size()),
                        static_cast<double>(all), std::isfinite(first_s) ? Cell(first_s) : Cell(std::string("never"))});
}

}  // namespace

void check_overhead_bits(const OverheadOptions& options, Experiment& experiment) {
  Bits bits(experiment);
  bits.mapped("nothing_yet.bullet", "bullet", 0, 0);
  bits.mapped("nothing_yet.usb", "usb", 0, 0);
  const Felt wall = feel(options.wall_file, kWall_s);
  bits.mapped("wall.bullet", "bullet", 0, 0);
  const Felt stack = feel(options.stack_file, kStack_s, kAtOnce);
  bits.mapped("stack.bullet", "bullet", 1, 20);
  bits.mapped("stack.soft", "bulletsoftbody", 0, 0);
  bits.same("engine", "wall, Bullet mapped", wall, feel(options.wall_file, kWall_s));

  // The soft solver, mapped by another session. In a scene a soft body is a part of the world: Bullet's lengths are
  // scaled by the smallest one, and the order in which contacts are solved is another.
  const Felt soft = feel(options.soft_file, kSoft_s);
  bits.mapped("soft.soft", "bulletsoftbody", 1, 1);
  bits.same("soft", "stack_125, soft solver mapped", stack, feel(options.stack_file, kStack_s, kAtOnce));

  if (options.usb) {
    const bool loaded = drivers::usb::load_usb_module().has_value();
    bits.mapped("usb.mapped", "libusb", loaded ? 1 : 2, 2);
    bits.same("usb", "wall, USB drivers mapped", wall, feel(options.wall_file, kWall_s));
  }

  std::vector<std::string> contacts = kAtOnce;
  contacts.emplace_back("physics.contacts=on");
  bits.same("contacts", "stack_125, contact constraints", stack, feel(options.stack_file, kStack_s, contacts));

  Watched<physics::PosePublisher, rtbus::BodyPoses> poses(bits.bus(), "physics.body_poses");
  const auto look_at_bodies = [&](const Harness& harness, const rtbus::Telemetry&) {
    poses(harness, harness.stepper()->world().bodies());
  };
  bits.same("poses", "stack_125, body poses observed", stack,
            feel(options.stack_file, kStack_s, kAtOnce, look_at_bodies));
  bits.seen("poses.frames", "stack_125: frames of body poses seen in the harness", poses.frames(), 25.0 * kStack_s,
            31.0 * kStack_s);
  Watched<physics::SoftNodePublisher, rtbus::SoftNodes> nodes(bits.bus(), "physics.soft_nodes");
  const auto look_at_nodes = [&](const Harness& harness, const rtbus::Telemetry&) {
    nodes(harness, harness.stepper()->world().soft_nodes());
  };
  bits.same("soft_nodes", "soft, nodes observed", soft, feel(options.soft_file, kSoft_s, {}, look_at_nodes));
  bits.seen("soft_nodes.frames", "soft: frames of nodes seen in the harness", nodes.frames(), 25.0 * kSoft_s,
            31.0 * kSoft_s);
  check_recorder(bits, options, wall);

  // A hand that is not there feels nothing of whether bodies are put to rest.
  const std::vector<std::string> away{"haptic.0.mapping.offset_m=[0, 0.3, 0.3]"};
  std::vector<std::string> awake = away;
  awake.emplace_back("scene.deactivation.enabled=false");
  bits.same("deactivation", "stack_125, hand away, no body put to rest", feel(options.stack_file, kStack_s, away),
            feel(options.stack_file, kStack_s, awake));

  Table table{"overhead_passivity", {"session", "passivity [ns/tick]", "ticks", "it acted in", "first at [s]"}, {}};
  check_passivity(bits, "wall", wall, feel(options.wall_file, kWall_s, {}, {}, false), table);
  check_passivity(bits, "stack_125", stack, feel(options.stack_file, kStack_s, kAtOnce, {}, false), table);
  check_passivity(bits, "soft", soft, feel(options.soft_file, kSoft_s, {}, {}, false), table);
  experiment.add_table(std::move(table));

  int axes = 0;
  for (const Felt* each : {&wall, &stack, &soft}) axes = std::max(axes, each->actuated_axes);
  bits.seen("torque", "actuated axes of the devices of these sessions", axes, 1.0, 3.0);
}

}  // namespace tools
