#pragma once
/// @file tool_ahead.hpp
/// Copies of soft bodies and of a tool, which go on from the present for a while: what the tool will bear.
#include <functional>
#include <memory>
#include <vector>

#include "physics_node/bullet/bullet_proxy.hpp"
#include "physics_node/bullet/soft/soft_made.hpp"

namespace physics::bullet {

/// The tool is on its spring, as the real one is. The real bodies are not touched.
class ToolAhead {
 public:
  /// @param radius_m Of the tool.
  ToolAhead(btSoftBodyWorldInfo& info, double radius_m, double friction, double scale);

  /// From the present state of `near`, the bodies that take part; the tool is at `tool_m`.
  void start(const std::vector<const MadeSoftBody*>& near, const Eigen::Vector3d& tool_m,
             const Eigen::Vector3d& velocity_m_s);

  /// One step of `h` seconds towards `target`. `collide` adds the contacts of a copy with the tool and with what
  /// stands.
  void step(double h, const ProxyTarget& target, const std::function<void(MadeSoftBody&, BulletProxy&)>& collide);

  /// Place of the tool, and what it bore in the last step.
  [[nodiscard]] const ProxyReadout& tool() const noexcept { return tool_.state(); }
  [[nodiscard]] const std::vector<MadeSoftBody*>& bodies() const noexcept { return running_; }

 private:
  btSoftBodyWorldInfo& info_;
  double scale_;
  BulletProxy tool_;
  struct Copy {
    const MadeSoftBody* of;
    std::unique_ptr<MadeSoftBody> body;
  };
  std::vector<Copy> copies_;  ///< Made when a body first takes part.
  std::vector<MadeSoftBody*> running_;
};

}  // namespace physics::bullet
