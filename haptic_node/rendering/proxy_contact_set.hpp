#pragma once
/// @file proxy_contact_set.hpp
/// The contacts of the proxy with rigid bodies, between two answers of physics. Frame W, SI units. Fixed size, no
/// allocation.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "haptic_node/rendering/contact_solver.hpp"
#include "haptic_node/rendering/local_body.hpp"
#include "haptic_node/rendering/near_shapes.hpp"
#include "haptic_node/rendering/tuning.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// Where the proxy is.
struct LocalProxy {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};

/// An answer that is being taken: its rigid rows are bodies by now.
struct TakenAnswer {
  const rtbus::ProxyContacts& answer;
  std::uint64_t now_ns = 0;
  std::size_t rigid_rows = 0;  ///< Rows of its bodies. What yields is told apart.
  std::span<const std::size_t> slot_of_row;
  std::span<const Eigen::Quaterniond> turned;  ///< Each row's body, from the answer's instant to now.
};

/// A contact is a plane or a part of a ball on its body, or follows the body's known shape. What an answer moves starts
/// where it was felt, and comes to its place with the blend of its body. @realtime Everything.
class ProxyContactSet {
 public:
  static constexpr std::size_t kContacts = rtbus::kContactSlots + 8;  ///< Those of an answer, and some that recede.
  static constexpr std::size_t kSolved = rtbus::kContactSlots;        ///< In one step.

  struct Contact {
    std::size_t body = 0;
    Eigen::Vector3d from_centre_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::UnitY();
    /// Of a body of a pile, which does not turn here as it does there: the normal comes to what physics has.
    std::optional<Eigen::Vector3d> told_normal;
    double radius_m = 0.0;      ///< Of the ball whose surface it is; 0: a plane.
    int surface = -1;           ///< Known surface on which it is found anew in each step; −1: none …
    std::uint64_t feature = 0;  ///< … and what of it it is on.
    double friction = 0.0;      ///< Coulomb coefficient of the pair [1].
    double offset_m = 0.0;      ///< Added to the gap: what is still to be blended in …
    double blend_m_s = 0.0;     ///< … and how fast the surface rises by that.
    double gap_m = 0.0;         ///< As of the last step, offset included.
    Eigen::Vector3d late_m_s = Eigen::Vector3d::Zero();     ///< Added to the surface's velocity; decays with the blend.
    bool fades = false;                                     ///< Physics does not know it any more …
    Eigen::Vector3d faded_m = Eigen::Vector3d::Zero();      ///< … it is a plane here, which only recedes.
    std::uint64_t named_ns = 0;                             ///< When physics named it last.
    Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();  ///< On the proxy, in the last step.

    [[nodiscard]] bool active() const noexcept { return !impulse_n_s.isZero(0.0); }
  };
  using Bodies = std::span<const LocalBody>;

  explicit ProxyContactSet(const Tuning& tuning) : tuning_(tuning) {}

  void reset() noexcept { count_ = 0; }
  [[nodiscard]] std::span<const Contact> all() const noexcept { return {contacts_.data(), count_}; }
  [[nodiscard]] bool any_of(std::size_t body) const noexcept RTBUS_NONBLOCKING;
  void drop(std::size_t body) noexcept RTBUS_NONBLOCKING;
  /// That body has turned.
  void turn(std::size_t body, const Eigen::Quaterniond& turned) noexcept RTBUS_NONBLOCKING;

  /// Before an answer moves anything: gaps and velocities as they are felt.
  void remember(Bodies bodies, const LocalProxy& proxy) noexcept RTBUS_NONBLOCKING;
  /// After it has moved the bodies.
  /// @returns how far that moves the surfaces that are felt, along their normals: the largest; none: nothing is felt.
  std::optional<double> take(const TakenAnswer& taken, Bodies bodies, const LocalProxy& proxy,
                             NearShapes& shapes) noexcept RTBUS_NONBLOCKING;

  /// Surfaces go on to where physics has them, in a step of `h`.
  void blend(Bodies bodies, double h) noexcept RTBUS_NONBLOCKING;

  /// The rows of contacts that the proxy may reach in a step of `h` if it goes at `free_m_s`, or at `pulled_m_s`, with
  /// what yields. @param again Where they were found last. @returns how many, at most kSolved; touched bodies are
  /// marked.
  std::size_t gather(Bodies bodies, const LocalProxy& proxy, const Eigen::Vector3d& free_m_s,
                     const Eigen::Vector3d& pulled_m_s, double h, NearShapes& shapes, SolverContact* rows,
                     std::span<bool> touched, bool again) noexcept RTBUS_NONBLOCKING;

  /// Around an edge a plane leads astray. After a first solution of the step the strongest contact gets the plane that
  /// it has at the end of it. @param way_m Of the proxy in that solution. @param free_way_m Without contacts.
  /// @returns whether that is another one: then the step is to be solved again.
  [[nodiscard]] bool bend(Bodies bodies, const LocalProxy& proxy, const Eigen::Vector3d& way_m,
                          const Eigen::Vector3d& free_way_m, std::span<const SolverContact> rows, double h,
                          NearShapes& shapes) noexcept RTBUS_NONBLOCKING;
  /// How fast the surface goes by the motion of its body. What fades goes away with it, and no way else.
  [[nodiscard]] static Eigen::Vector3d carried_m_s(const Contact& contact,
                                                   const BodyMotion& motion) noexcept RTBUS_NONBLOCKING;
  /// The contact of a row.
  [[nodiscard]] Contact& of_row(std::size_t row) noexcept { return contacts_[row_source_[row]]; }
  /// At the end of a step.
  void advance(double h) noexcept RTBUS_NONBLOCKING;

  /// A step that is only tried begins with keep() and ends with bring_back().
  void keep() noexcept RTBUS_NONBLOCKING;
  void bring_back() noexcept RTBUS_NONBLOCKING;

 private:
  [[nodiscard]] static double gap_of(const Contact& contact, Bodies bodies, const LocalProxy& proxy) noexcept;
  static void roll(Contact& contact, Bodies bodies, const LocalProxy& proxy) noexcept;
  static void follow(Contact& contact, Bodies bodies, const LocalProxy& proxy, NearShapes& shapes,
                     double most_rad) noexcept;
  void follow_surface(const NearShapes::Named& named, Bodies bodies, const LocalProxy& proxy, double h,
                      NearShapes& shapes) noexcept;
  [[nodiscard]] static bool name_surface(std::size_t body, double friction, Bodies bodies, const LocalProxy& proxy,
                                         NearShapes& shapes) noexcept;
  [[nodiscard]] bool names(const TakenAnswer& taken, std::size_t row, const Eigen::Vector3d& normal) const noexcept;
  /// A plane that the proxy's centre is so far behind leads through its body.
  [[nodiscard]] double behind_m(const LocalProxy& proxy) const noexcept {
    return std::max(proxy.radius_m, tuning_.deep_m());
  }
  [[nodiscard]] bool blocked(const rtbus::ProxyContacts& answer, std::size_t contact, double gap_m,
                             const LocalProxy& proxy) const noexcept;
  bool keep_way_out(const TakenAnswer& taken, std::size_t row, std::size_t old_count, std::span<bool> matched,
                    Bodies bodies, const LocalProxy& proxy, Contact& contact) noexcept;
  [[nodiscard]] std::size_t match(const Contact& contact, std::size_t old_count,
                                  std::span<const bool> matched) const noexcept;

  Tuning tuning_;
  std::array<Contact, kContacts> contacts_{};
  std::size_t count_ = 0;
  std::array<Contact, kContacts> old_;  ///< Before what is being found anew.
  std::array<Contact, kContacts> kept_{};
  std::size_t kept_count_ = 0;
  std::array<std::size_t, kSolved> row_source_{};
  std::size_t bent_ = kContacts;  ///< By bend(), for the solution that comes.
};

}  // namespace haptic
