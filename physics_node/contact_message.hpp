#pragma once
/// @file contact_message.hpp
/// From an engine's contact set to the message of the bus.
#include "physics_node/engine/contact_set.hpp"
#include "rtbus/contact_messages.hpp"

namespace physics {

/// Overwrites `out`. `proxy` is the answer of the same step; rows that are not used are zero. Contacts of soft bodies
/// are left out: what they do is the reaction's.
void fill_message(const ContactSet& set, const ToolReaction& reaction, const rtbus::ProxyState& proxy,
                  rtbus::ProxyContacts& out);

/// The same for observers. Overwrites `out` but for its step and time.
void fill_points(const ContactSet& set, rtbus::ContactPoints& out);

}  // namespace physics
