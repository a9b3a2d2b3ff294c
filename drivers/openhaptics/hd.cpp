#include "drivers/openhaptics/hd.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "drivers/vendor/shared_library.hpp"

namespace drivers::openhaptics {
namespace {

struct Known {
  std::uint32_t code;
  ErrorKind kind;
  const char* name;
  const char* remedy;
};

constexpr const char* kOurBug = "this is a defect of the driver; please report it";
constexpr const char* kNotSetUp =
    "plug the device in and power it, set it up with Touch_Setup or Touch_HeadlessSetup as the user that runs rtbus, "
    "close other programs that use it; after a crash unplug USB and power for some seconds";

constexpr std::array kErrors{
    Known{0x0100, ErrorKind::kOther, "INVALID_ENUM", kOurBug},
    Known{0x0101, ErrorKind::kOther, "INVALID_VALUE", kOurBug},
    Known{0x0102, ErrorKind::kOther, "INVALID_OPERATION", kOurBug},
    Known{0x0103, ErrorKind::kOther, "INVALID_INPUT_TYPE", "harmless once after the start"},
    Known{0x0104, ErrorKind::kOther, "BAD_HANDLE", kOurBug},
    Known{0x0200, ErrorKind::kWarm, "WARM_MOTORS", "its motors are warm; let the device rest"},
    Known{0x0201, ErrorKind::kForce, "EXCEEDED_MAX_FORCE",
          "hold the stylus; lower the stiffness or safety.max_force_n"},
    Known{0x0202, ErrorKind::kForce, "EXCEEDED_MAX_FORCE_IMPULSE", "hold the stylus; lower the stiffness"},
    Known{0x0203, ErrorKind::kForce, "EXCEEDED_MAX_VELOCITY", "hold the stylus; lower the stiffness"},
    Known{0x0204, ErrorKind::kForce, "FORCE_ERROR", "hold the stylus; lower the stiffness"},
    Known{0x0300, ErrorKind::kDevice, "DEVICE_FAULT", kNotSetUp},
    Known{0x0301, ErrorKind::kDevice, "DEVICE_ALREADY_INITIATED", "another part of this program has it; end it"},
    Known{0x0302, ErrorKind::kDevice, "COMM_ERROR",
          "the link to the device is lost; replug it or power-cycle it, then start the session again (over Ethernet: "
          "set the adapter to IPv4 link-local only, pair it with the setup tool)"},
    Known{0x0303, ErrorKind::kDevice, "COMM_CONFIG_ERROR", kNotSetUp},
    Known{0x0304, ErrorKind::kDevice, "TIMER_ERROR", "the computer is too busy, or realtime priority is not permitted"},
    Known{0x0400, ErrorKind::kOther, "ILLEGAL_BEGIN", kOurBug},
    Known{0x0401, ErrorKind::kOther, "ILLEGAL_END", kOurBug},
    Known{0x0402, ErrorKind::kOther, "FRAME_ERROR", kOurBug},
    Known{0x0500, ErrorKind::kOther, "INVALID_PRIORITY", kOurBug},
    Known{0x0501, ErrorKind::kOther, "SCHEDULER_FULL", kOurBug},
    Known{0x0600, ErrorKind::kDevice, "INVALID_LICENSE", "run the vendor's licence manager"},
};

const Known* find(std::uint32_t code) noexcept {
  const auto* const it = std::find_if(kErrors.begin(), kErrors.end(), [&](const Known& k) { return k.code == code; });
  return it == kErrors.end() ? nullptr : it;
}

}  // namespace

ErrorKind kind_of(std::uint32_t code) noexcept {
  if (code == 0) return ErrorKind::kNone;
  const Known* const known = find(code);
  return known == nullptr ? ErrorKind::kOther : known->kind;
}

std::string explain(const ErrorInfo& error) {
  const Known* const known = find(error.code);
  char text[96];
  std::snprintf(text, sizeof text, "%s (0x%04x, internal %d): ", known == nullptr ? "unknown error" : known->name,
                error.code, error.internal_code);
  return std::string(text) + (known == nullptr ? "see the vendor's manual" : known->remedy);
}

rtbus::Result<Hd, std::string> load_hd(const std::string& file) {
  Hd out;
  std::vector<vendor::Symbol> symbols;
#define RTBUS_HD_SYMBOL(required, result, name, arguments) \
  symbols.push_back({#name, reinterpret_cast<void**>(&out.name), required});
  RTBUS_HD_FUNCTIONS(RTBUS_HD_SYMBOL)
#undef RTBUS_HD_SYMBOL
  vendor::LibraryRequest request;
  request.files = file.empty() ? std::vector<std::string>{"libHD.so", "libHD.so.3.4", "libHD.so.3.4.0", "libHD.so.3.0"}
                               : std::vector<std::string>{file};
  request.remedy_missing =
      file.empty()
          ? "install OpenHaptics 3.4 and the device driver package TouchDriver (both from 3D Systems), then run "
            "ldconfig, or name libHD.so by `library:` in the device file"
          : "correct `library:` in the device file, or leave it out to search the usual names";
  request.remedy_old = "it is not libHD of OpenHaptics 3; install OpenHaptics 3.4";
  auto loaded = vendor::load_library(request, symbols);
  if (!loaded) return rtbus::Failure{loaded.error()};
  out.file = *loaded;
  return out;
}

}  // namespace drivers::openhaptics
