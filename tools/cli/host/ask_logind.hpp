#pragma once
/// @file ask_logind.hpp
/// Whether systemd-logind will delete this user's topics at log-out (logind.conf(5), RemoveIPC).
#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>

namespace tools {

struct LogindFacts {
  bool running = false;      ///< systemd-logind looks after this machine's users.
  bool remove_ipc = true;    ///< As configured; yes is the default of systemd.
  std::string set_in;        ///< The file that says so; "": none, the default.
  bool system_user = false;  ///< root and system users are spared.
  bool lingers = false;      ///< `loginctl enable-linger`: never fully logged out, so spared too.
};

/// @param root Where the system's files lie; other than "/" for tests.
[[nodiscard]] LogindFacts ask_logind(uid_t user, const std::string& user_name, const std::filesystem::path& root = "/");

}  // namespace tools
