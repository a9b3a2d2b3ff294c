/// The same stack through this project as the physics node steps it: module, Stepper, device state from the bus, answer
/// to the bus. Threads and clocks are left out: they wait.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "physics_node/engine_registry.hpp"
#include "physics_node/stepper.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/topic.hpp"
#include "tests/overhead/stack.hpp"

namespace {

rtbus::config::Scene scene_of(const overhead::Size& size) {
  using rtbus::config::Body;
  rtbus::config::Scene scene;
  scene.file = "overhead";
  Body floor;
  floor.name = "floor";
  floor.shape = rtbus::shapes::Plane{};
  floor.friction = overhead::kFriction;
  scene.bodies.push_back(floor);
  const double pitch_m = overhead::kEdge_m + overhead::kGap_m;
  for (int i = 0; i < size.wide; ++i) {
    for (int j = 0; j < size.high; ++j) {
      for (int k = 0; k < size.deep; ++k) {
        Body cube;
        cube.name = "cube";
        cube.type = rtbus::config::BodyType::kDynamic;
        cube.mass_kg = overhead::kMass_kg;
        cube.friction = overhead::kFriction;
        cube.shape = rtbus::shapes::Box{Eigen::Vector3d::Constant(0.5 * overhead::kEdge_m)};
        cube.p_WB = {i * pitch_m, (j + 0.5) * overhead::kEdge_m, -k * pitch_m};
        scene.bodies.push_back(cube);
      }
    }
  }
  return scene;
}

struct Ours {
  physics::Stepper stepper;
  rtbus::Writer<rtbus::DeviceState> hand;
  rtbus::Reader<rtbus::DeviceState> device;
  rtbus::Writer<rtbus::ProxyState> answers;

  void step() {
    rtbus::Stamped<rtbus::DeviceState> sample;
    if (device.read_latest(sample) == rtbus::ReadStatus::kFresh) stepper.set_device(0, sample.value, sample.sequence);
    stepper.step(overhead::kStep_s);
    answers.publish(stepper.answer(0), rtbus::monotonic_ns());
  }
};

template <class T>
rtbus::Writer<T> make_topic(const rtbus::Session& session, const std::string& topic) {
  auto writer = rtbus::Writer<T>::create(session, topic, {.capacity = 1024});
  if (!writer) {
    std::fprintf(stderr, "topic %s: %s\n", topic.c_str(), rtbus::to_string(writer.error()));
    std::exit(1);
  }
  return std::move(*writer);
}

}  // namespace

/// What callgrind counts.
extern "C" __attribute__((noinline)) void measured_steps(Ours& ours, int steps) {
  for (int i = 0; i < steps; ++i) ours.step();
}

int main(int argc, char** argv) {
  const overhead::Size size = overhead::size_of(argc, argv);
  rtbus::Session session;
  session.name = "overhead_" + std::to_string(::getpid());
  physics::ProxyConfig proxy;
  proxy.device = "haptic0";
  proxy.mass_kg = overhead::kProxyMass_kg;
  proxy.radius_m = overhead::kProxyRadius_m;
  proxy.stiffness_n_per_m = overhead::kStiffness_n_per_m;
  proxy.damping_n_s_per_m = overhead::kDamping_n_s_per_m;

  auto hand = make_topic<rtbus::DeviceState>(session, "haptic0.device_state");
  auto answers = make_topic<rtbus::ProxyState>(session, "physics.proxy_state.haptic0");
  auto device = rtbus::Reader<rtbus::DeviceState>::open(session, "haptic0.device_state");
  if (!device) return 1;
  Ours ours{{physics::make_world("bullet", scene_of(size), {.solver_iterations = overhead::kIterations}), {proxy}, 1},
            std::move(hand),
            std::move(*device),
            std::move(answers)};

  rtbus::DeviceState state;
  state.target_position_m = {0, overhead::kProxyHeight_m, overhead::kProxyDistance_m};
  state.enabled = 1;
  ours.hand.publish(state, rtbus::monotonic_ns());
  for (int i = 0; i < overhead::kWarmUpSteps; ++i) ours.step();
  ours.hand.publish(state, rtbus::monotonic_ns());
  measured_steps(ours, size.steps);
  std::printf("%zu awake bodies\n", ours.stepper.world().awake_bodies());
  return 0;
}
