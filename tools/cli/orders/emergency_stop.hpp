#pragma once
/// @file emergency_stop.hpp
/// E-stop of a session by whatever still works.
#include <string>

#include "rtbus/result.hpp"

namespace tools {

/// Orders an E-stop. When no `rtbus run` answers, ends the haptic nodes (SIGTERM): they go to zero force at once.
/// @param reason Shown by the monitors. @param source Who may take it back alone; empty: the user. Takes at most 1 s.
/// @returns what was done; the error says why nothing was. Both are sentences for the user.
[[nodiscard]] rtbus::Result<std::string, std::string> emergency_stop(const std::string& session,
                                                                     const std::string& reason,
                                                                     const std::string& source = {});

}  // namespace tools
