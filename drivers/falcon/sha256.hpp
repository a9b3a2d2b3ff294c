#pragma once
/// @file sha256.hpp
/// SHA-256 (FIPS 180-4) of a buffer, to recognise firmware files by the hashes people publish. Small on purpose: one
/// hash of a few kilobytes is no reason to depend on a cryptographic library.
#include <cstdint>
#include <span>
#include <string>

namespace drivers::falcon {

/// 64 lower-case hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::span<const std::uint8_t> bytes);

}  // namespace drivers::falcon
