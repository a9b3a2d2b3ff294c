#pragma once
/// @file support.hpp
/// What free bodies of local_contact stand on. Frame W, SI units.
#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "rtbus/contact_messages.hpp"

namespace haptic {

struct Support {
  Eigen::Vector3d from_centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  double friction = 0.0;
  double torsion_radius_m = 0.0;
  double force_n = 0.0;  ///< Along the normal, as physics had it.
  double gap_m = 0.0;    ///< Of a corner on a known face; the others stay where they are told.
  double round_m = 0.0;  ///< Radius of the body's own surface there, which rolls over it; 0: of an edge or a face.
  Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();
  double torsion_n_m_s = 0.0;
  int holder =
      kStands;  ///< Slot of the free body that holds, in the local world; kStands: what holds does not give way.
  Eigen::Vector3d from_holder_m = Eigen::Vector3d::Zero();  ///< From the centre of that one.
  static constexpr int kStands = -1;
};

/// The supports of all free bodies, those of one body in a row.
struct SupportPool {
  /// A row of six boxes has 4·6 corners on the floor and 4·5 between them; others have walls and boxes before them too.
  static constexpr std::size_t kSupports = 64;
  static_assert(kSupports >= rtbus::kSupportSlots);
  std::array<Support, kSupports> rows{};
  std::size_t count = 0;
  std::size_t spare = 0;  ///< Places that no support of the answer needs.
};

}  // namespace haptic
