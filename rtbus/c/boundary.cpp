#include "rtbus/c/detail/boundary.hpp"

#include <utility>

namespace rtbus::capi {
namespace {

std::string& sentence() noexcept {
  thread_local std::string text;
  return text;
}

}  // namespace

const char* text_of(int status) noexcept {
  switch (status) {
    case RTBUS_OK:
      return "fine";
    case RTBUS_FRESH:
      return "a new sample";
    case RTBUS_SAME:
      return "nothing new";
    case RTBUS_LAPPED:
      return "the writer overtook every attempt to copy";
    case RTBUS_REFUSED:
      return "the sample was not sane: not finite, or impossible";
    case RTBUS_E_NOT_FOUND:
      return "not found";
    case RTBUS_E_OWNED:
      return to_string(TopicError::kAlreadyOwned);
    case RTBUS_E_LAYOUT:
      return to_string(TopicError::kLayoutMismatch);
    case RTBUS_E_PERMISSION:
      return to_string(TopicError::kPermission);
    case RTBUS_E_NAME:
      return "a name has characters or a length that it may not have";
    case RTBUS_E_CORRUPT:
      return to_string(TopicError::kCorrupt);
    case RTBUS_E_SYSTEM:
      return to_string(TopicError::kSystem);
    case RTBUS_E_ARGUMENT:
      return "an argument makes no sense";
    case RTBUS_E_VALUE:
      return "readers would refuse this sample: a number is not finite, or impossible";
    case RTBUS_E_TIMEOUT:
      return "nobody answered in time";
    case RTBUS_E_ORDER:
      return "the session refused the order";
    case RTBUS_E_MEMORY:
      return "out of memory";
    case RTBUS_E_ENDED:
      return "it has ended";
    default:
      return "unknown status";
  }
}

const char* last_error() noexcept { return sentence().c_str(); }

int fail(int status, std::string text) noexcept {
  sentence() = std::move(text);
  return status;
}

int fail(TopicError error, std::string_view session, std::string_view topic) noexcept {
  const int number = errno;
  int status = RTBUS_E_SYSTEM;
  switch (error) {
    case TopicError::kNotFound:
      status = RTBUS_E_NOT_FOUND;
      break;
    case TopicError::kAlreadyOwned:
      status = RTBUS_E_OWNED;
      break;
    case TopicError::kLayoutMismatch:
      status = RTBUS_E_LAYOUT;
      break;
    case TopicError::kPermission:
      status = RTBUS_E_PERMISSION;
      break;
    case TopicError::kBadName:
      status = RTBUS_E_NAME;
      break;
    case TopicError::kCorrupt:
      status = RTBUS_E_CORRUPT;
      break;
    case TopicError::kSystem:
      break;
  }
  try {
    std::string text = "session " + std::string(session) + ", topic " + std::string(topic) + ": " + to_string(error);
    if (error == TopicError::kSystem && number != 0) text += std::string(": ") + std::strerror(number);
    return fail(status, std::move(text));
  } catch (...) {
    return status;
  }
}

int put_type(const rtbus_type& type, const std::vector<rtbus_field>& fields, rtbus_type& out) noexcept {
  if (out.struct_bytes < offsetof(rtbus_type, fields) + sizeof(void*)) {
    return fail(RTBUS_E_ARGUMENT, "set struct_bytes to sizeof(rtbus_type) before the call");
  }
  const std::size_t bytes = out.struct_bytes;
  out = type;
  out.struct_bytes = bytes;
  out.field_count = static_cast<std::uint32_t>(fields.size());
  out.fields = fields.data();
  return RTBUS_OK;
}

rtbus_field field_of(const Segment::OwnedField& field) noexcept {
  rtbus_field out{};
  put(field.name, out.name);
  put(field.unit, out.unit);
  out.type = static_cast<std::uint32_t>(field.type);
  out.offset = field.offset;
  out.count = field.count;
  out.inner = field.inner;
  return out;
}

}  // namespace rtbus::capi
