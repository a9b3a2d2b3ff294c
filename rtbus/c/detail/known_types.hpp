#pragma once
/// @file known_types.hpp
/// The samples that the nodes exchange, as the C interface describes them. Private to rtbus/c.
#include <string_view>
#include <vector>

#include "rtbus/c/rtbus.h"

namespace rtbus::capi {

struct KnownType {
  rtbus_type type{};
  std::vector<rtbus_field> fields;
};

/// In the order of the headers. Made at the first call.
[[nodiscard]] const std::vector<KnownType>& known_types();

/// Null: there is none of that name.
[[nodiscard]] const KnownType* find_known_type(std::string_view name);

}  // namespace rtbus::capi
