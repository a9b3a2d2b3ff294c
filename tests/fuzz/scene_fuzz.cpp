// A scene file and the OBJ mesh that it names, apart by a line `%%`: reading them ends with a scene or an Error, and of
// a scene that is accepted the shapes can be made.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "rtbus/config/session.hpp"
#include "tests/support/temporary_file.hpp"

namespace {

constexpr std::string_view kSession = R"(schema: session/1
session: fuzz
scene: scene.yaml
physics: {engine: bullet, rate_hz: 1000}
haptic:
  - {name: haptic0, device: none.yaml, coupling: {stiffness_n_per_m: 200}}
)";

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const tests::TemporaryFolder folder;
  static const std::string session_file = folder.write("session.yaml", kSession);
  const std::string_view all(reinterpret_cast<const char*>(data), size);
  constexpr std::string_view kApart = "\n%%\n";
  const std::size_t cut = std::min(all.find(kApart), all.size());
  folder.write("scene.yaml", all.substr(0, cut));
  folder.write("mesh.obj", all.substr(std::min(cut + kApart.size(), all.size())));
  try {
    const rtbus::config::SessionConfig session = rtbus::config::load_session(session_file);
    for (const auto& body : session.scene.bodies) {
      require(std::isfinite(body.mass_kg) && body.mass_kg >= 0.0 && body.p_WB.allFinite());
    }
    (void)session.scene.static_shapes();
  } catch (const rtbus::config::Error&) {  // the other end that it may have
  }
  return 0;
}
