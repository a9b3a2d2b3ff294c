#pragma once
/// @file stored_session.hpp
/// The session file inside a recording, with all that it refers to, as it was when it was recorded.
#include <functional>

#include "rtbus/config/session.hpp"
#include "rtbus/recording/reader.hpp"

namespace view {

/// Loads it and hands it to `use`. Meshes are not in the recording: they are read from where they were. Throws
/// std::runtime_error with a sentence for the user, also for what `use` throws. Paths are those of the recording's
/// time.
void with_stored_session(const rtbus::recording::Recording& recording,
                         const std::function<void(rtbus::config::SessionConfig& session)>& use);

}  // namespace view
