#pragma once
/// @file device_file.hpp
/// Writes a device file that a calibration has changed.
#include <string>
#include <vector>

#include "rtbus/config/document.hpp"
#include "rtbus/result.hpp"

namespace tools {

/// The number at a key of the top level of a device file, after `changes`; `fallback` where none stands.
[[nodiscard]] double number_in(const std::string& yaml, const std::vector<rtbus::config::Override>& changes,
                               const std::string& key, double fallback);

/// Puts `changes` (later ones win) into the device file `yaml`, which came from `origin`, and writes the outcome to
/// `file`, below `comment` (lines of "# …"). Names of files in it stay true: relative ones that exist beside `origin`
/// become absolute. The result is read by the driver before it is kept. An existing `file` is replaced only when
/// `overwrite` says so; nothing is left behind when this fails. The failure is a sentence for the user.
[[nodiscard]] rtbus::Result<void, std::string> write_device_file(const std::string& yaml, const std::string& origin,
                                                                 const std::vector<rtbus::config::Override>& changes,
                                                                 const std::string& comment, const std::string& file,
                                                                 bool overwrite);

}  // namespace tools
