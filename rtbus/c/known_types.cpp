#include "rtbus/c/detail/known_types.hpp"

#include <algorithm>

#include "rtbus/c/detail/boundary.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/link_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/shape_messages.hpp"

namespace rtbus::capi {
namespace {

template <Sample T>
KnownType known() {
  KnownType out;
  out.type.struct_bytes = sizeof out.type;
  put(SampleTraits<T>::kName, out.type.name);
  out.type.hash = type_hash<T>();
  out.type.bytes = sizeof(T);
  for (const Field& field : SampleTraits<T>::kFields) {
    out.fields.push_back(field_of(
        {std::string(field.name), std::string(field.unit), field.type, field.offset, field.count, field.inner}));
  }
  return out;
}

template <Sample... Types>
std::vector<KnownType> all_known() {
  std::vector<KnownType> out;
  (out.push_back(known<Types>()), ...);
  return out;
}

}  // namespace

const std::vector<KnownType>& known_types() {
  static const std::vector<KnownType> types =
      all_known<DeviceState, ProxyState, Heartbeat, NodeInfo, LoopStats, Telemetry, StepStats, BodyPoses, SoftNodes,
                PlantCommand, PlantState, ProxyContacts, ContactPoints, LinkStats, Orders, BodyOrders, BodyShapes>();
  return types;
}

const KnownType* find_known_type(std::string_view name) {
  const auto& types = known_types();
  const auto found =
      std::find_if(types.begin(), types.end(), [name](const KnownType& each) { return each.type.name == name; });
  return found == types.end() ? nullptr : &*found;
}

}  // namespace rtbus::capi
