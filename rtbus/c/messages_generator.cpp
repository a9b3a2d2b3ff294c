// Prints rtbus_messages.h: the known samples as C structures, from the same descriptions as the C++ ones.
#include <cctype>
#include <cstdio>
#include <string>

#include "rtbus/c/detail/known_types.hpp"

namespace {

const char* c_type(std::uint32_t type) {
  switch (type) {
    case RTBUS_F64:
      return "double";
    case RTBUS_U64:
      return "uint64_t";
    case RTBUS_I64:
      return "int64_t";
    case RTBUS_U32:
      return "uint32_t";
    case RTBUS_I32:
      return "int32_t";
    case RTBUS_U8:
      return "uint8_t";
    default:
      return "char";
  }
}

/// "rtbus/DeviceState" → "rtbus_device_state".
std::string c_name(const char* type) {
  std::string out;
  for (const char* at = type; *at != '\0'; ++at) {
    if (*at == '/') {
      out += '_';
    } else if (std::isupper(static_cast<unsigned char>(*at)) != 0) {
      if (!out.empty() && out.back() != '_') out += '_';
      out += static_cast<char>(std::tolower(static_cast<unsigned char>(*at)));
    } else {
      out += *at;
    }
  }
  return out;
}

std::string dimensions(const rtbus_field& field) {
  if (field.count == 1) return "";
  if (field.inner == 1) return "[" + std::to_string(field.count) + "]";
  return "[" + std::to_string(field.count / field.inner) + "][" + std::to_string(field.inner) + "]";
}

}  // namespace

int main() {
  std::printf(
      "/// @file rtbus_messages.h\n"
      "/// The samples that the nodes exchange. Made from rtbus/messages.hpp and its neighbours, which say what each\n"
      "/// field means; do not edit. The unit of a field stands behind it.\n"
      "#ifndef RTBUS_C_RTBUS_MESSAGES_H\n#define RTBUS_C_RTBUS_MESSAGES_H\n\n#include <stdint.h>\n");
  for (const rtbus::capi::KnownType& known : rtbus::capi::known_types()) {
    const std::string name = c_name(known.type.name);
    std::printf("\n/// %s, %u bytes.\n#define %s_type \"%s\"\ntypedef struct %s {\n", known.type.name, known.type.bytes,
                name.c_str(), known.type.name, name.c_str());
    for (const rtbus_field& field : known.fields) {
      std::printf("  %s %s%s;", c_type(field.type), field.name, dimensions(field).c_str());
      std::printf(field.unit[0] == '\0' ? "\n" : "  ///< [%s]\n", field.unit);
    }
    std::printf("} %s;\n", name.c_str());
    std::printf("typedef char %s_has_its_size[sizeof(%s) == %u ? 1 : -1];\n", name.c_str(), name.c_str(),
                known.type.bytes);
  }
  std::printf("\n#endif\n");
  return 0;
}
