#pragma once
/// @file find_config.hpp
/// Where session and device files are found by name, in the source tree and installed.
#include <filesystem>
#include <string>
#include <vector>

namespace tools {

/// The folders that are searched, first match first: config/ where the command runs, /etc/rtbus (this machine's own
/// files), what is installed with this program (/usr/share/rtbus/config), the source tree (build/bin/../../config).
[[nodiscard]] std::vector<std::filesystem::path> config_folders();

/// The file `name` ("wall.yaml", "devices/sim_falcon.yaml") in the first of these folders that has it.
/// Throws rtbus::config::Error when none has.
[[nodiscard]] std::string find_config(const std::string& name);

/// A session as users name it: a file ("my/wall.yaml"), or the name of one in these folders ("wall").
/// Throws rtbus::config::Error, with the names that exist, when it is neither.
[[nodiscard]] std::string find_session(const std::string& file_or_name);

/// The names that find_session() knows, sorted, each once.
[[nodiscard]] std::vector<std::string> session_names();

/// The folder of this program, where its sisters lie (/proc/self/exe).
[[nodiscard]] std::string folder_of_this_program();

}  // namespace tools
