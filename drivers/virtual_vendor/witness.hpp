#pragma once
/// @file witness.hpp
/// What the hand feels at a unit, published as the simulated plant publishes it: `<node>.plant_state`, 1000 times a
/// second, by a thread of its own. It goes on while nobody calls the library, as after an unplug or while a call hangs.
#include <atomic>
#include <cstdint>
#include <functional>
#include <thread>

#include "drivers/simulated/plant_state.hpp"
#include "drivers/virtual_vendor/stand_in.hpp"
#include "rtbus/messages.hpp"

namespace drivers::virtual_vendor {

class Witness {
 public:
  /// Lets the time of the unit pass and shows its mechanics. Called by the witness's thread: it takes the unit's lock.
  using Look = std::function<rtbus::PlantState(std::uint64_t now_ns)>;

  /// Starts with `unit.publish_state` only.
  Witness(const UnitSettings& unit, Look look);
  ~Witness();
  Witness(const Witness&) = delete;
  Witness& operator=(const Witness&) = delete;

 private:
  void run();

  const UnitSettings unit_;
  const Look look_;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace drivers::virtual_vendor
