// libstand_in_openhaptics.so: the functions of the HDAPI that our driver calls, over a unit without hardware. A servo
// thread of its own calls the scheduled callbacks about 1000 times a second.
#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Geometry>

#include "drivers/virtual_vendor/openhaptics/hd_unit.hpp"
#include "drivers/virtual_vendor/witness.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace {

using drivers::simulated::state_of;
using drivers::virtual_vendor::Plugged;
using drivers::virtual_vendor::Witness;
using drivers::virtual_vendor::openhaptics::Calibration;
using drivers::virtual_vendor::openhaptics::ErrorInfo;
using drivers::virtual_vendor::openhaptics::ErrorStack;
using drivers::virtual_vendor::openhaptics::HdUnit;
using drivers::virtual_vendor::openhaptics::Init;
using drivers::virtual_vendor::openhaptics::Settings;
using rtbus::monotonic_ns;

using Callback = std::uint32_t (*)(void*);
constexpr std::uint32_t kNoHandle = 0xFFFFFFFF;
constexpr std::uint32_t kHandle = 7;
/// High bits that a 32-bit variable would lose.
constexpr unsigned long kFirstScheduled = 0x0000'1234'0000'0001UL;

struct Scheduled {
  unsigned long handle;
  Callback callback;
  void* user_data;
  unsigned short priority;
};

std::mutex mutex;
ErrorStack errors;
std::unique_ptr<HdUnit> unit;
bool initialising = false;  ///< hdInitDevice() blocks without the lock.
std::vector<Scheduled> callbacks;
unsigned long next_scheduled = kFirstScheduled;
std::thread servo;
std::atomic<bool> servo_runs{false};
std::unique_ptr<Witness> witness;
thread_local std::uint32_t current = kNoHandle;  ///< Each thread has one of its own.

/// The current device of this thread; null, with the error on the stack.
HdUnit* current_unit() {
  if (unit != nullptr && unit->initialised && current == unit->handle) return unit.get();
  errors.push(0x0104, 0, current);
  return nullptr;
}

void run_servo() {
  rtbus::name_this_thread("hd_servo");
  std::uint64_t due_ns = monotonic_ns();
  std::uint64_t random = 1;
  while (servo_runs.load()) {
    due_ns += rtbus::kNsPerMs;
    std::vector<Scheduled> todo;
    double jitter_us = 0.0, late_us = 0.0;
    bool late = false;
    {
      const std::lock_guard lock(mutex);
      random = random * 6364136223846793005ULL + 1442695040888963407ULL;
      const double share = static_cast<double>(random >> 33) / static_cast<double>(1ULL << 31);
      jitter_us = share * unit->settings().jitter_us;
      late = share < unit->settings().late_tick;
      late_us = unit->unit().late_us(due_ns);
    }
    rtbus::sleep_until(due_ns + static_cast<std::uint64_t>(1e3 * jitter_us) + (late ? 3 * rtbus::kNsPerMs : 0));
    drivers::virtual_vendor::block_for_us(late_us);
    due_ns = std::max(due_ns, monotonic_ns() - 2 * rtbus::kNsPerMs);
    {
      const std::lock_guard lock(mutex);
      if (unit->ticks_stop(monotonic_ns())) continue;
      unit->begin_tick(monotonic_ns());
      todo = callbacks;
    }
    for (const Scheduled& each : todo) {
      if (each.callback(each.user_data) != 0) continue;
      const std::lock_guard lock(mutex);
      std::erase_if(callbacks, [&](const Scheduled& s) { return s.handle == each.handle; });
    }
  }
}

}  // namespace

extern "C" {

Plugged rtbus_plug_openhaptics(const Settings& settings, std::size_t bytes) {
  if (bytes != sizeof(Settings)) return Plugged::kOtherBuild;
  {
    const std::lock_guard lock(mutex);
    if (servo_runs.load() || initialising || (unit != nullptr && unit->initialised)) return Plugged::kInUse;
  }
  witness.reset();
  const std::lock_guard lock(mutex);
  errors.clear();
  unit = std::make_unique<HdUnit>(settings, errors);
  witness = std::make_unique<Witness>(settings.unit, [](std::uint64_t now_ns) {
    const std::lock_guard looks(mutex);
    unit->unit().advance_to(now_ns);
    return state_of(unit->unit().mechanics(), now_ns);
  });
  return Plugged::kYes;
}

// Takes its time and cannot be ended; makes the device current. May fail with an error, and without one.
std::uint32_t hdInitDevice(const char* name) {
  std::unique_lock lock(mutex);
  if (unit == nullptr) {
    errors.push(0x0300, 0, kNoHandle);
    return kNoHandle;
  }
  if (unit->initialised) {
    errors.push(0x0301, 0, unit->handle);
    return kNoHandle;
  }
  const Settings settings = unit->settings();
  initialising = true;  // nobody replaces the unit meanwhile
  lock.unlock();
  drivers::virtual_vendor::block_for_us(1e6 * settings.init_s);
  lock.lock();
  initialising = false;
  if (settings.init == Init::kFailsSilently) return kNoHandle;
  const bool other = name != nullptr && name != settings.name;
  if (settings.init != Init::kWorks || other) {
    errors.push(settings.init == Init::kBusy ? 0x0303 : 0x0300, -1, kNoHandle);
    return kNoHandle;
  }
  unit->initialised = true;
  unit->handle = kHandle;
  current = kHandle;
  errors.push(0x0103, 0, kHandle);  // as reported of real ones, and harmless
  return kHandle;
}

void hdDisableDevice(std::uint32_t handle) {
  const std::lock_guard lock(mutex);
  if (unit == nullptr || unit->handle != handle) {
    errors.push(0x0104, 0, handle);
    return;
  }
  unit->initialised = false;
  unit->handle = kNoHandle;
  if (current == handle) current = kNoHandle;
}

void hdMakeCurrentDevice(std::uint32_t handle) {
  const std::lock_guard lock(mutex);
  if (unit == nullptr || unit->handle != handle) errors.push(0x0104, 0, handle);
  current = handle;
}

// Makes the device current.
void hdBeginFrame(std::uint32_t handle) {
  const std::lock_guard lock(mutex);
  current = handle;
  if (HdUnit* const u = current_unit()) u->begin_frame();
}

void hdEndFrame(std::uint32_t handle) {
  const std::lock_guard lock(mutex);
  current = handle;
  if (HdUnit* const u = current_unit()) u->end_frame(monotonic_ns());
}

ErrorInfo hdGetError() {
  const std::lock_guard lock(mutex);
  return errors.pop();
}

const char* hdGetErrorString(std::uint32_t) { return "an error of the stand-in"; }

void hdEnable(std::uint32_t what) {
  const std::lock_guard lock(mutex);
  HdUnit* const u = current_unit();
  if (u != nullptr && what == 0x4000) u->force_output = true;
}

void hdGetBooleanv(std::uint32_t what, unsigned char* out) {
  const std::lock_guard lock(mutex);
  HdUnit* const u = current_unit();
  if (u == nullptr) return;
  if (what == 0x2002) {
    *out = u->docked(monotonic_ns()) ? 0 : 1;
  } else {
    errors.push(0x0103, 0, u->handle);
  }
}

void hdGetIntegerv(std::uint32_t what, int* out) {
  const std::lock_guard lock(mutex);
  HdUnit* const u = current_unit();
  if (u == nullptr) return;
  if (what == 0x2000) {
    *out = static_cast<int>(u->unit().mechanics().buttons() & 0xfu);
  } else if (what == 0x2555) {
    *out = u->settings().calibration == Calibration::kNeedsUpdate ? 2 : 4;
  } else {
    errors.push(0x0103, 0, u->handle);  // the inkwell switch, for one, is a boolean
  }
}

void hdGetDoublev(std::uint32_t what, double* out) {
  const std::lock_guard lock(mutex);
  HdUnit* const u = current_unit();
  if (u == nullptr) return;
  const auto& m = u->unit().settings().mechanics;
  const Eigen::Vector3d p = u->position_mm(monotonic_ns());
  switch (what) {
    case 0x2050:
      for (int i = 0; i < 3; ++i) out[i] = p[i];
      break;
    case 0x2051:
      for (int i = 0; i < 3; ++i) out[i] = 1e3 * u->unit().mechanics().velocity_m_s()[i];
      break;
    case 0x2052: {
      Eigen::Matrix4d t = Eigen::Matrix4d::Identity();
      t.topLeftCorner<3, 3>() = Eigen::AngleAxisd(u->settings().wrist_rad, Eigen::Vector3d::UnitY()).matrix();
      t.topRightCorner<3, 1>() = p;
      u->unit().spoil(t.data() + 12, monotonic_ns(), 1e3);  // [mm]
      std::memcpy(out, t.data(), sizeof(double) * 16);      // Eigen's order is the library's: by columns
      break;
    }
    case 0x2551:
      for (int i = 0; i < 3; ++i) {
        out[i] = 1e3 * m.workspace_min_m[i] + HdUnit::centre_mm()[i];
        out[i + 3] = 1e3 * m.workspace_max_m[i] + HdUnit::centre_mm()[i];
      }
      break;
    case 0x2603:
      *out = m.max_force_n;
      break;
    default:
      errors.push(0x0100, 0, u->handle);
  }
}

const char* hdGetString(std::uint32_t what) {
  const std::lock_guard lock(mutex);
  HdUnit* const u = current_unit();
  if (u == nullptr) return nullptr;
  switch (what) {
    case 0x2500:
    case 0x2502:
      return "3.4";
    case 0x2501:
      return u->settings().model_type.c_str();
    case 0x2504:
      return u->settings().unit.serial.c_str();
    default:
      errors.push(0x0100, 0, u->handle);
      return nullptr;
  }
}

// Outside a frame: an error, and no effect.
void hdSetDoublev(std::uint32_t what, const double* value) {
  const std::lock_guard lock(mutex);
  HdUnit* const u = current_unit();
  if (u == nullptr) return;
  if (what == 0x2700) {
    u->set_force({value[0], value[1], value[2]});
  } else {
    errors.push(0x0100, 0, u->handle);
  }
}

std::uint32_t hdCheckCalibration() {
  const std::lock_guard lock(mutex);
  HdUnit* const u = current_unit();
  return u == nullptr ? 0x5002 : u->check_calibration(monotonic_ns());
}

void hdUpdateCalibration(std::uint32_t) {
  const std::lock_guard lock(mutex);
  if (HdUnit* const u = current_unit()) u->update_calibration();
}

void hdStartScheduler() {
  const std::lock_guard lock(mutex);
  if (unit == nullptr || servo_runs.exchange(true)) return;
  unit->scheduler_started(monotonic_ns());
  unit->unit().begin(monotonic_ns());
  servo = std::thread(run_servo);
}

void hdStopScheduler() {
  if (!servo_runs.exchange(false)) return;
  servo.join();
  const std::lock_guard lock(mutex);
  (void)unit->unit().mechanics().set_force(Eigen::Vector3d::Zero(), drivers::simulated::Mechanics::kNever);
}

unsigned long hdScheduleAsynchronous(Callback callback, void* user_data, unsigned short priority) {
  const std::lock_guard lock(mutex);
  callbacks.push_back({next_scheduled, callback, user_data, priority});
  std::stable_sort(callbacks.begin(), callbacks.end(),
                   [](const Scheduled& a, const Scheduled& b) { return a.priority > b.priority; });
  return next_scheduled++;
}

// One that has ended by itself: an error, and nothing else.
void hdUnschedule(unsigned long handle) {
  const std::lock_guard lock(mutex);
  if (std::erase_if(callbacks, [&](const Scheduled& s) { return s.handle == handle; }) == 0) {
    errors.push(0x0102, 0, kNoHandle);
  }
}

}  // extern "C"
