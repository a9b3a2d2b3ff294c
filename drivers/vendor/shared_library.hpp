#pragma once
/// @file shared_library.hpp
/// A vendor's library, mapped at run time. It is never unmapped: vendors' libraries start threads and do not bear it.
#include <string>
#include <vector>

#include "rtbus/result.hpp"

namespace drivers::vendor {

/// One symbol that a driver wants, and where its address goes.
struct Symbol {
  const char* name;
  void** address;
  bool required = true;  ///< Else the address stays null.
};

struct LibraryRequest {
  std::vector<std::string> files;  ///< In this order; a name without '/' is searched by the loader.
  const char* remedy_missing;      ///< What to do when there is none of them.
  const char* remedy_old;          ///< What to do when a symbol is missing.
};

/// Maps the first of the files that loads and fills in its symbols. @returns which file it was; else a sentence for the
/// user: what was tried, what the loader says about a file that exists, and the remedy. @realtime No.
[[nodiscard]] rtbus::Result<std::string, std::string> load_library(const LibraryRequest& request,
                                                                   const std::vector<Symbol>& symbols);

}  // namespace drivers::vendor
