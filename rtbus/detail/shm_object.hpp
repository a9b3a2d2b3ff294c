#pragma once
/// @file shm_object.hpp
/// Boost.Interprocess with error numbers instead of exceptions. Private to rtbus.
#include <sys/mman.h>

#include <boost/interprocess/mapped_region.hpp>
#include <boost/interprocess/shared_memory_object.hpp>
#include <cerrno>
#include <cstdint>

namespace rtbus::detail {

namespace bip = boost::interprocess;

inline int error_number(const bip::interprocess_exception& failure) noexcept {
  const int number = failure.get_native_error();
  return number != 0 ? number : EIO;
}

/// Opens or creates a segment by name: arguments as of bip::shared_memory_object. Returns 0 or errno.
template <class... Arguments>
[[nodiscard]] int open_object(bip::shared_memory_object& out, Arguments... arguments) {
  try {
    bip::shared_memory_object object(arguments...);
    out.swap(object);
    return 0;
  } catch (const bip::interprocess_exception& failure) {
    return error_number(failure);
  }
}

/// Maps a part of it, every page faulted in at once (MAP_POPULATE). Returns 0 or errno.
[[nodiscard]] inline int map_object(bip::mapped_region& out, const bip::shared_memory_object& object, bip::mode_t mode,
                                    std::uint64_t offset, std::uint64_t bytes) {
  try {
    bip::mapped_region region(object, mode, static_cast<bip::offset_t>(offset), bytes, nullptr, MAP_POPULATE);
    out.swap(region);
    return 0;
  } catch (const bip::interprocess_exception& failure) {
    return error_number(failure);
  }
}

[[nodiscard]] inline int handle_of(const bip::shared_memory_object& object) noexcept {
  return object.get_mapping_handle().handle;
}

}  // namespace rtbus::detail
