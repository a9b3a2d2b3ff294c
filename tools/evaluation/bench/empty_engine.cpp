// The engine of an empty world in C++: for `rtbus bench external`, beside the one in C.
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include "physics_node/external/rtbus_engine.h"

namespace {

struct Closer {
  void operator()(rtbus_engine* engine) const noexcept { rtbus_engine_close(engine); }
};

template <class T>
T sized() {
  T out{};
  out.struct_bytes = sizeof out;
  return out;
}

}  // namespace

int main() {
  rtbus_engine* opened = nullptr;
  if (rtbus_engine_open(nullptr, &opened) < 0) return EXIT_FAILURE;
  const std::unique_ptr<rtbus_engine, Closer> engine(opened);
  auto info = sized<rtbus_engine_info>();
  if (rtbus_engine_get_info(engine.get(), &info) < 0) return EXIT_FAILURE;
  std::vector<rtbus_engine_hand> hands(info.hands, sized<rtbus_engine_hand>());
  auto step = sized<rtbus_engine_step>();
  while (rtbus_engine_begin(engine.get(), &step) >= 0) {
    if (step.due == 0) continue;
    for (std::uint32_t i = 0; i < info.hands; ++i) {
      if (rtbus_engine_get_hand(engine.get(), i, &hands[i]) < 0) return EXIT_FAILURE;
      auto tool = sized<rtbus_engine_tool>();
      for (int axis = 0; axis < 3; ++axis) tool.position_m[axis] = hands[i].target_position_m[axis];
      if (rtbus_engine_set_tool(engine.get(), i, &tool) < 0) return EXIT_FAILURE;
    }
    if (rtbus_engine_finish(engine.get()) < 0) return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
