// libstand_in_force_dimension.so: the functions of Force Dimension's SDK that our driver calls, over units without
// hardware. It keeps the rules that drivers must know: what it does is written at each function.
#include <algorithm>
#include <iterator>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "drivers/virtual_vendor/force_dimension/fd_unit.hpp"
#include "drivers/virtual_vendor/witness.hpp"
#include "rtbus/clock.hpp"

namespace {

using drivers::simulated::state_of;
using drivers::virtual_vendor::block_for_us;
using drivers::virtual_vendor::Plugged;
using drivers::virtual_vendor::Witness;
using drivers::virtual_vendor::force_dimension::FdUnit;
using drivers::virtual_vendor::force_dimension::Settings;
using rtbus::monotonic_ns;

enum Error : int {
  kNone = 0,
  kCom = 2,
  kNoDevice = 5,
  kNotAvailable = 6,
  kTimeout = 7,
  kExpertModeDisabled = 9,
  kDeviceNotReady = 12,
  kInvalidIndex = 15,
  kNullArgument = 17,
  kDeviceInUse = 20,
};

thread_local int last_error = kNone;
std::mutex mutex;
std::vector<std::unique_ptr<FdUnit>> units;  ///< Index = order of plugging in; an ID is the index + kFirstId.
std::unique_ptr<Witness> witness;            ///< Of the unit that was plugged in last and wants one.
bool expert = false;                         ///< Of the whole process.
int last_opened = -1;

/// IDs are no indexes: who mixes them up opens or closes the wrong device.
constexpr int kFirstId = 3;

int fail(int error) {
  last_error = error;
  return -1;
}

FdUnit* unit_at(int index) {
  return index >= 0 && index < static_cast<int>(units.size()) ? units[static_cast<std::size_t>(index)].get() : nullptr;
}

/// The open unit of an ID; null, with the error set. Valid while the lock is held: whoever has let go of it asks again,
/// since the unit may have been closed meanwhile, or another one plugged in for it.
FdUnit* open_unit(char id) {
  constexpr char kLastOpened = -1;  // where char is unsigned, 255
  FdUnit* const unit = unit_at(id == kLastOpened ? last_opened : id - kFirstId);
  if (unit != nullptr && unit->open) return unit;
  (void)fail(kInvalidIndex);
  return nullptr;
}

/// Blocks without the lock. @returns the unit that is open under the ID then; null, with the error set.
FdUnit* blocked(char id, double us, std::unique_lock<std::mutex>& lock) {
  lock.unlock();
  block_for_us(us);
  lock.lock();
  return open_unit(id);
}

/// An open unit that is plugged in; null, with the error set. Blocks as an exchange does.
FdUnit* exchange_with(char id, std::unique_lock<std::mutex>& lock) {
  FdUnit* unit = open_unit(id);
  if (unit == nullptr) return nullptr;
  unit = blocked(id, unit->blocks_us(monotonic_ns()), lock);
  if (unit == nullptr) return nullptr;
  if (!unit->unit().plugged_in(monotonic_ns())) {
    (void)fail(kCom);
    return nullptr;
  }
  return unit;
}

int open_at(int index) {
  FdUnit* const unit = unit_at(index);
  if (unit == nullptr || !unit->unit().plugged_in(monotonic_ns())) return fail(kNoDevice);
  if (unit->settings().unit.in_use) return fail(kDeviceInUse);
  last_opened = index;
  if (unit->open) return index + kFirstId;  // open already: its ID
  unit->open = true;
  unit->regulating = false;
  unit->states = 0;
  unit->brakes = true;
  unit->gravity = true;
  unit->max_force_n = 1e3;
  unit->time_guard_us = unit->settings().time_guard_us;
  unit->set_watchdog(0);
  unit->enable_force(false, monotonic_ns());
  return index + kFirstId;
}

template <class Do>
int with(char id, Do act) {
  std::unique_lock lock(mutex);
  FdUnit* const unit = exchange_with(id, lock);
  if (unit == nullptr) return -1;
  return act(*unit);
}

}  // namespace

extern "C" {

Plugged rtbus_plug_force_dimension(const Settings& settings, std::size_t bytes) {
  if (bytes != sizeof(Settings)) return Plugged::kOtherBuild;
  static std::mutex plugging;  // the witness ends without the lock that it takes itself
  const std::lock_guard one_by_one(plugging);
  const auto find_same = [&] {
    return std::find_if(units.begin(), units.end(),
                        [&](const auto& unit) { return unit->settings().unit.serial == settings.unit.serial; });
  };
  {
    const std::lock_guard lock(mutex);
    if (const auto same = find_same(); same != units.end() && (*same)->open) return Plugged::kInUse;
  }
  witness.reset();
  const std::lock_guard lock(mutex);
  auto fresh = std::make_unique<FdUnit>(settings);
  FdUnit* const seen = fresh.get();  // lives until the next one is plugged in, and the witness ends before that
  // What nobody has open has been pulled out for it: IDs and indexes begin anew.
  if (std::none_of(units.begin(), units.end(), [](const auto& unit) { return unit->open; })) units.clear();
  if (const auto same = find_same(); same == units.end()) {
    units.push_back(std::move(fresh));
  } else {
    *same = std::move(fresh);
  }
  witness = std::make_unique<Witness>(settings.unit, [seen](std::uint64_t now_ns) {
    const std::lock_guard looks(mutex);
    seen->advance_to(now_ns);
    return state_of(seen->unit().mechanics(), now_ns);
  });
  return Plugged::kYes;
}

void dhdGetSDKVersion(int* major, int* minor, int* release, int* revision) {
  *major = 3;
  *minor = 16;
  *release = 1;
  *revision = 0;
}

int dhdGetDeviceCount() {
  const std::lock_guard lock(mutex);
  int count = 0;
  for (const auto& unit : units) count += unit->unit().plugged_in(monotonic_ns());
  return count;
}

int dhdGetAvailableCount() {
  const std::lock_guard lock(mutex);
  int count = 0;
  for (const auto& unit : units) {
    count += unit->unit().plugged_in(monotonic_ns()) && !unit->settings().unit.in_use && !unit->open;
  }
  return count;
}

int dhdOpenID(char index) {
  const std::lock_guard lock(mutex);
  return open_at(index);
}

int dhdOpenSerial(int serial) {
  const std::lock_guard lock(mutex);
  for (std::size_t i = 0; i < units.size(); ++i) {
    if (units[i]->settings().unit.serial == std::to_string(serial)) return open_at(static_cast<int>(i));
  }
  return fail(kNoDevice);
}

// Works for a device that is gone.
int dhdClose(char id) {
  const std::lock_guard lock(mutex);
  FdUnit* const unit = open_unit(id);
  if (unit == nullptr) return -1;
  if (unit->unit().plugged_in(monotonic_ns())) unit->enable_force(false, monotonic_ns());  // else it does not hear it
  unit->open = false;
  return 0;
}

int dhdGetSystemType(char id) {
  return with(id, [](FdUnit& unit) { return unit.settings().type; });
}

const char* dhdGetSystemName(char id) {
  std::unique_lock lock(mutex);
  FdUnit* const unit = exchange_with(id, lock);
  return unit == nullptr ? nullptr : unit->settings().name;
}

// A Falcon has none.
int dhdGetSerialNumber(unsigned short* out, char id) {
  return with(id, [&](FdUnit& unit) {
    *out = unit.settings().type == 60 ? 65535 : static_cast<unsigned short>(std::stoi(unit.settings().unit.serial));
    return 0;
  });
}

// Sooner after the last one than the time guard allows: the old position, and 1.
int dhdGetPosition(double* x, double* y, double* z, char id) {
  return with(id, [&](FdUnit& unit) {
    const std::uint64_t now_ns = monotonic_ns();
    const bool too_soon = static_cast<double>(now_ns - unit.last_state_ns) < 1e3 * unit.time_guard_us;
    if (!too_soon) {
      unit.last_position = unit.position(now_ns);
      unit.last_state_ns = now_ns;
      ++unit.states;
    }
    Eigen::Vector3d told = unit.last_position;
    unit.unit().spoil(told.data(), now_ns);
    *x = told.x();
    *y = told.y();
    *z = told.z();
    return too_soon ? 1 : 0;
  });
}

#ifndef RTBUS_STAND_IN_OLD  // the variant without it stands for an old SDK
int dhdGetPositionAndOrientationFrame(double* x, double* y, double* z, double (*frame)[3], char id) {
  const int status = dhdGetPosition(x, y, z, id);
  if (status < 0) return status;
  const std::lock_guard lock(mutex);
  FdUnit* const unit = open_unit(id);
  if (unit == nullptr) return -1;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(unit->settings().wrist_rad, Eigen::Vector3d::UnitZ()).matrix();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) frame[row][column] = turn(row, column);
  }
  return status;
}
#endif

// Before the second position: TIMEOUT, and no velocity.
int dhdGetLinearVelocity(double* x, double* y, double* z, char id) {
  return with(id, [&](FdUnit& unit) {
    if (unit.states < 2) return fail(kTimeout);
    const Eigen::Vector3d v = unit.velocity();
    *x = v.x();
    *y = v.y();
    *z = v.z();
    return 0;
  });
}

int dhdGetGripperGap(double* gap_m, char id) {
  return with(id, [&](FdUnit& unit) {
    constexpr int kWithGripper[] = {35, 37, 104, 105, 108, 109};
    const int type = unit.settings().type;
    if (std::find(std::begin(kWithGripper), std::end(kWithGripper), type) == std::end(kWithGripper)) {
      return fail(kNotAvailable);
    }
    *gap_m = unit.settings().gripper_m;
    return 0;
  });
}

// Without dhdEnableForce(), with brakes on, or while the arm is regulated, it is taken without effect.
int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double, double, double, double, char id) {
  return with(id, [&](FdUnit& unit) {
    const int status = unit.set_force({fx, fy, fz}, monotonic_ns());
    return status < 0 ? fail(kDeviceNotReady) : status;
  });
}

int dhdSetForce(double fx, double fy, double fz, char id) {
  return dhdSetForceAndTorqueAndGripperForce(fx, fy, fz, 0, 0, 0, 0, id);
}

int dhdEnableForce(unsigned char on, char id) {
  return with(id, [&](FdUnit& unit) {
    unit.enable_force(on != 0, monotonic_ns());
    return 0;
  });
}

int dhdSetBrakes(int on, char id) {
  return with(id, [&](FdUnit& unit) {
    unit.brakes = on != 0;
    return 0;
  });
}

int dhdSetMaxForce(double newton, char id) {
  return with(id, [&](FdUnit& unit) {
    unit.max_force_n = newton < 0.0 ? 1e3 : newton;
    return 0;
  });
}

int dhdSetGravityCompensation(int on, char id) {
  return with(id, [&](FdUnit& unit) {
    unit.gravity = on != 0;
    return 0;
  });
}

int dhdGetButton(int index, char id) {
  return with(id, [&](FdUnit& unit) { return static_cast<int>(unit.unit().mechanics().buttons() >> index & 1u); });
}

unsigned dhdGetButtonMask(char id) {
  std::unique_lock lock(mutex);
  FdUnit* const unit = exchange_with(id, lock);
  return unit == nullptr ? 0 : unit->unit().mechanics().buttons();
}

// 17 entries: who gives it an array of 16 is written over.
int dhdGetStatus(int* status, char id) {
  return with(id, [&](FdUnit& unit) {
    unit.advance_to(monotonic_ns());
    for (int i = 0; i < 17; ++i) status[i] = 0;
    status[0] = status[1] = status[2] = 1;
    status[3] = !unit.calibrated();
    status[4] = unit.calibrated() && !unit.force_on();
    status[5] = unit.force_on();
    status[6] = unit.brakes;
    status[10] = unit.gravity;
    status[11] = unit.time_guard_us > 0.0;
    status[14] = static_cast<int>(unit.force_off_cause());
    unit.cause_told(monotonic_ns());
    return 0;
  });
}

// Of the calling thread.
int dhdErrorGetLast() { return last_error; }

const char* dhdErrorGetStr(int error) {
  switch (error) {
    case kNone:
      return "no error";
    case kCom:
      return "communication with the device failed";
    case kNoDevice:
      return "no device found";
    case kExpertModeDisabled:
      return "expert mode is off";
    case kDeviceNotReady:
      return "the device is not ready";
    case kInvalidIndex:
      return "no such device";
    case kDeviceInUse:
      return "the device is in use";
    default:
      return "some error";
  }
}

int dhdEnableExpertMode() {
  const std::lock_guard lock(mutex);
  expert = true;
  return 0;
}

int dhdDisableExpertMode() {
  const std::lock_guard lock(mutex);
  expert = false;
  return 0;
}

int dhdSetTimeGuard(int us, char id) {
  return with(id, [&](FdUnit& unit) {
    if (!expert) return fail(kExpertModeDisabled);
    unit.time_guard_us = us < 0 ? unit.settings().time_guard_us : us;
    return 0;
  });
}

int dhdSetWatchdog(unsigned char steps, char id) {
  return with(id, [&](FdUnit& unit) {
    if (!expert) return fail(kExpertModeDisabled);
    if (!unit.settings().has_watchdog) return fail(kNotAvailable);
    unit.set_watchdog(steps);
    return 0;
  });
}

int drdOpenID(char index) { return dhdOpenID(index); }
int drdClose(char id) { return dhdClose(id); }

bool drdIsSupported(char id) {
  return with(id, [](FdUnit& unit) { return unit.settings().type == 60 ? 0 : 1; }) == 1;
}

bool drdIsInitialized(char id) {
  return with(id, [](FdUnit& unit) { return unit.calibrated() ? 1 : 0; }) == 1;
}

bool drdIsRunning(char id) {
  return with(id, [](FdUnit& unit) { return unit.regulating ? 1 : 0; }) == 1;
}

// Moves the arm by itself, for seconds, and then holds it: regulation goes on until drdStop().
int drdAutoInit(char id) {
  std::unique_lock lock(mutex);
  FdUnit* unit = exchange_with(id, lock);
  if (unit == nullptr) return -1;
  unit = blocked(id, 1e6 * unit->settings().auto_init_s, lock);
  if (unit == nullptr) return -1;
  if (!unit->unit().plugged_in(monotonic_ns())) return fail(kCom);
  unit->auto_init(monotonic_ns());
  return 0;
}

// Without keep_force the brakes follow.
int drdStop(bool keep_force, char id) {
  return with(id, [&](FdUnit& unit) {
    unit.regulating = false;
    if (!keep_force) {
      unit.enable_force(false, monotonic_ns());
      unit.brakes = true;
    }
    return 0;
  });
}

}  // extern "C"
