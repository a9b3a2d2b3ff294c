// A session file as a user may write it: reading it and its nodes' parts ends with a configuration or an Error.
#include <cstdint>
#include <filesystem>
#include <string_view>

#include "haptic_node/node_config.hpp"
#include "physics_node/node_config.hpp"
#include "rtbus/config/session.hpp"
#include "tests/support/temporary_file.hpp"

namespace {

/// A folder with the scenes and devices of the project beside the file.
class Folder : public tests::TemporaryFolder {
 public:
  Folder() {
    for (const char* name : {"scenes", "devices"}) {
      std::filesystem::create_directory_symlink(std::string(RTBUS_SOURCE_DIR) + "/config/" + name, path() / name);
    }
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Folder folder;
  const std::string file = folder.write("session.yaml", {reinterpret_cast<const char*>(data), size});
  try {
    rtbus::config::SessionConfig session = rtbus::config::load_session(file);
    for (std::size_t i = 0; i < session.haptic.size(); ++i) (void)haptic::read_haptic_config(session, i);
    if (session.physics) (void)physics::read_node_config(session);
  } catch (const rtbus::config::Error&) {  // the other end that it may have
  }
  return 0;
}
