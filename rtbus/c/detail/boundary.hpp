#pragma once
/// @file boundary.hpp
/// What every function of the C interface does at its border: no exception leaves, failures leave a sentence. Private
/// to rtbus/c.
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "rtbus/c/rtbus.h"
#include "rtbus/segment.hpp"

namespace rtbus::capi {

/// One sentence for a status.
[[nodiscard]] const char* text_of(int status) noexcept;

/// This thread's last sentence.
[[nodiscard]] const char* last_error() noexcept;

/// Notes the sentence and passes the status on.
int fail(int status, std::string sentence) noexcept;

/// A topic's failure: names session and topic.
int fail(TopicError error, std::string_view session, std::string_view topic) noexcept;

/// Runs `body` and turns what it throws into a status.
template <class Body>
auto guarded(const Body& body) noexcept -> decltype(body()) {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return fail(RTBUS_E_MEMORY, "out of memory");
  } catch (const std::exception& error) {
    return fail(RTBUS_E_SYSTEM, error.what());
  } catch (...) {
    return fail(RTBUS_E_SYSTEM, "an unknown failure");
  }
}

/// Copies a text, cut to fit, with a zero byte behind it.
template <std::size_t N>
void put(std::string_view text, char (&out)[N]) noexcept {
  const std::size_t length = text.size() < N - 1 ? text.size() : N - 1;
  std::memcpy(out, text.data(), length);
  std::memset(out + length, 0, N - length);
}

/// Fills a caller's rtbus_type as far as its struct_bytes says.
int put_type(const rtbus_type& type, const std::vector<rtbus_field>& fields, rtbus_type& out) noexcept;

/// The C form of a field.
[[nodiscard]] rtbus_field field_of(const Segment::OwnedField& field) noexcept;

}  // namespace rtbus::capi
