#pragma once
/// @file engine_state.hpp
/// What the functions of rtbus_engine.h share. Private to this folder.
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "physics_node/external/external_world.hpp"
#include "physics_node/external/rtbus_engine.h"
#include "physics_node/external/shape_table.hpp"
#include "physics_node/node.hpp"

struct rtbus_engine {
  physics::ExternalWorld* world = nullptr;  ///< Of the node.
  std::unique_ptr<physics::Node> node;
  rtbus::Session session;
  physics::ShapeTable shapes;
  double step_s = 0.0;
  Eigen::Vector3d gravity_m_s2 = Eigen::Vector3d::Zero();
  bool gives_bodies = false;
  bool in_step = false;
  double this_step_s = 0.0;
  std::uint64_t steps = 0;
  physics::ExternalAnswer answer;
};

namespace physics::external {

/// The sentence of this thread's last failure.
inline std::string& sentence() noexcept {
  thread_local std::string text;
  return text;
}
inline int fail(int status, std::string text) noexcept {
  sentence() = std::move(text);
  return status;
}

template <class Body>
int guarded(const Body& body) noexcept {
  try {
    return body();
  } catch (const rtbus::config::Error& error) {
    return fail(RTBUS_ENGINE_E_CONFIG, error.what());
  } catch (const std::bad_alloc&) {
    return fail(RTBUS_ENGINE_E_MEMORY, "out of memory");
  } catch (const std::exception& error) {
    return fail(RTBUS_ENGINE_E_SYSTEM, error.what());
  } catch (...) {
    return fail(RTBUS_ENGINE_E_SYSTEM, "an unknown failure");
  }
}

/// A structure of the caller's, which may be shorter than ours: the rest is zero.
template <class T>
bool take_struct(const T* given, T& out) {
  out = T{};
  if (given == nullptr || given->struct_bytes < sizeof(std::size_t)) return false;
  std::memcpy(&out, given, std::min(given->struct_bytes, sizeof out));
  return true;
}
template <class T>
int give_struct(T value, T* out) {
  if (out == nullptr || out->struct_bytes < sizeof(std::size_t)) {
    return fail(RTBUS_ENGINE_E_ARGUMENT, "the output is null, or its struct_bytes is not set");
  }
  value.struct_bytes = out->struct_bytes;
  std::memcpy(out, &value, std::min(out->struct_bytes, sizeof value));
  return RTBUS_ENGINE_OK;
}

template <std::size_t N>
void put(std::string_view text, char (&out)[N]) {
  const std::size_t length = std::min(text.size(), N - 1);
  std::memcpy(out, text.data(), length);
  std::memset(out + length, 0, N - length);
}
inline void put(const Eigen::Vector3d& from, double (&out)[3]) { std::copy_n(from.data(), 3, out); }
inline Eigen::Vector3d vector_of(const double (&from)[3]) { return {from[0], from[1], from[2]}; }

}  // namespace physics::external
