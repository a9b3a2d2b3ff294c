#pragma once
/// @file page_files.hpp
/// The files of the page, embedded by CMake (cmake/embed.cmake): all that the server serves.
#include <span>
#include <string_view>

namespace view {

struct PageFile {
  std::string_view path;  ///< "/scene.js"
  std::string_view type;  ///< "text/javascript"
  std::string_view bytes;
};

[[nodiscard]] std::span<const PageFile> page_files() noexcept;

}  // namespace view
