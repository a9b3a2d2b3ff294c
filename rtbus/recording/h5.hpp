#pragma once
/// @file h5.hpp
/// HDF5 handles that close themselves, and its errors as text. Private to rtbus/recording.
#include <hdf5.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

namespace rtbus::recording::h5 {

/// One identifier of the library: file, group, dataset, space, type, attribute or property list.
class Handle {
 public:
  Handle() = default;
  Handle(hid_t id, herr_t (*close)(hid_t)) noexcept : id_(id), close_(close) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    if (this != &other) {
      (void)reset();
      id_ = std::exchange(other.id_, -1);
      close_ = other.close_;
    }
    return *this;
  }
  ~Handle() { (void)reset(); }

  /// False when closing failed: what was buffered may be lost.
  bool reset() noexcept {
    const hid_t id = std::exchange(id_, -1);
    return id < 0 || close_(id) >= 0;
  }
  explicit operator bool() const noexcept { return id_ >= 0; }
  [[nodiscard]] hid_t id() const noexcept { return id_; }

 private:
  hid_t id_ = -1;
  herr_t (*close_)(hid_t) = nullptr;
};

/// The library prints its errors by itself unless told not to.
inline void quiet() noexcept { (void)H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

/// The innermost reason of the last failure, then forgets it.
inline std::string last_error() {
  std::string text;
  const auto visit = [](unsigned, const H5E_error2_t* error, void* out) -> herr_t {
    if (error->desc != nullptr) *static_cast<std::string*>(out) = error->desc;
    return 0;
  };
  (void)H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, +visit, &text);
  (void)H5Eclear2(H5E_DEFAULT);
  return text.empty() ? "unknown error of HDF5" : text;
}

/// Fixed-length UTF-8 text of `bytes` bytes, zero-terminated unless full.
inline Handle text_type(std::size_t bytes) {
  Handle type(H5Tcopy(H5T_C_S1), &H5Tclose);
  (void)H5Tset_size(type.id(), bytes);
  (void)H5Tset_strpad(type.id(), H5T_STR_NULLPAD);
  (void)H5Tset_cset(type.id(), H5T_CSET_UTF8);
  return type;
}

/// Writes one attribute of `object`. False when that failed.
inline bool set_attribute(hid_t object, const char* name, hid_t type, const void* value) {
  const Handle space(H5Screate(H5S_SCALAR), &H5Sclose);
  Handle attribute(H5Acreate2(object, name, type, space.id(), H5P_DEFAULT, H5P_DEFAULT), &H5Aclose);
  return attribute && H5Awrite(attribute.id(), type, value) >= 0;
}
inline bool set_attribute(hid_t object, const char* name, const std::string& text) {
  // HDF5 has no text of zero bytes.
  const std::string stored = text.empty() ? std::string(1, '\0') : text;
  return set_attribute(object, name, text_type(stored.size()).id(), stored.data());
}
inline bool set_attribute(hid_t object, const char* name, unsigned long long value) {
  return set_attribute(object, name, H5T_NATIVE_ULLONG, &value);
}

}  // namespace rtbus::recording::h5
