#pragma once
/// @file formatted.hpp
/// Text as printf(3) makes it.
#include <string>

namespace tools {

[[gnu::format(printf, 1, 2)]] [[nodiscard]] std::string formatted(const char* format, ...);

}  // namespace tools
