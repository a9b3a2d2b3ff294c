#pragma once
/// @file export_bodies.hpp
/// The poses of a recording's bodies as a table: a row per frame, columns by the bodies' names.
#include <iosfwd>

#include "rtbus/recording/reader.hpp"

namespace tools {

/// The topic holds body poses, and the recording knows the bodies' names.
[[nodiscard]] bool has_named_bodies(const rtbus::recording::Recording& recording,
                                    const rtbus::recording::RecordedTopic& topic);

/// "ball.x [m]", …, "ball.qw [1]", …: p_WB and q_WB. Frames of which a sample was lost are left out.
/// @returns how many rows were written; ends early at Ctrl-C.
std::uint64_t write_named_bodies(const rtbus::recording::Recording& recording,
                                 const rtbus::recording::RecordedTopic& topic, std::ostream& out);

}  // namespace tools
