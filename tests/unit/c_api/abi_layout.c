/* The C interface in C, and the layouts that programs compiled yesterday rely on. A line here changes only together with
 * the soname; members are added at the end. */
#include <stddef.h>

#include "rtbus/c/rtbus.h"
#include "rtbus/c/rtbus_messages.h"

#define PINNED(type, member, at) _Static_assert(offsetof(type, member) == (at), #type "." #member)
#define BYTES(type, size) _Static_assert(sizeof(type) == (size), #type)

BYTES(rtbus_field, 72);
PINNED(rtbus_field, name, 0);
PINNED(rtbus_field, unit, 40);
PINNED(rtbus_field, type, 56);
PINNED(rtbus_field, offset, 60);
PINNED(rtbus_field, count, 64);
PINNED(rtbus_field, inner, 68);

BYTES(rtbus_type, 80);
PINNED(rtbus_type, struct_bytes, 0);
PINNED(rtbus_type, name, 8);
PINNED(rtbus_type, hash, 56);
PINNED(rtbus_type, bytes, 64);
PINNED(rtbus_type, field_count, 68);
PINNED(rtbus_type, fields, 72);

BYTES(rtbus_topic_info, 384);
PINNED(rtbus_topic_info, session, 0);
PINNED(rtbus_topic_info, topic, 40);
PINNED(rtbus_topic_info, type_name, 144);
PINNED(rtbus_topic_info, problem, 192);
PINNED(rtbus_topic_info, published, 352);
PINNED(rtbus_topic_info, segment_bytes, 360);
PINNED(rtbus_topic_info, sample_bytes, 368);
PINNED(rtbus_topic_info, capacity, 372);
PINNED(rtbus_topic_info, writer_pid, 376);
PINNED(rtbus_topic_info, writer_alive, 380);

BYTES(rtbus_node, 80);
PINNED(rtbus_node, pid, 40);
PINNED(rtbus_node, alive, 44);
PINNED(rtbus_node, state, 48);
PINNED(rtbus_node, beat_age_ns, 56);
PINNED(rtbus_node, work_age_ns, 64);
PINNED(rtbus_node, work_period_ns, 72);

BYTES(rtbus_stamp, 16);
PINNED(rtbus_stamp, stamp_ns, 8);

BYTES(rtbus_writer_options, 24);
PINNED(rtbus_writer_options, capacity, 8);
PINNED(rtbus_writer_options, doorbell, 12);
PINNED(rtbus_writer_options, mode, 16);

_Static_assert(RTBUS_OK == 0 && RTBUS_FRESH == 1 && RTBUS_SAME == 2 && RTBUS_LAPPED == 3 && RTBUS_REFUSED == 4, "");
_Static_assert(RTBUS_E_NOT_FOUND == -1 && RTBUS_E_OWNED == -2 && RTBUS_E_LAYOUT == -3 && RTBUS_E_PERMISSION == -4, "");
_Static_assert(RTBUS_E_NAME == -5 && RTBUS_E_CORRUPT == -6 && RTBUS_E_SYSTEM == -7 && RTBUS_E_ARGUMENT == -8, "");
_Static_assert(RTBUS_E_VALUE == -9 && RTBUS_E_TIMEOUT == -10 && RTBUS_E_ORDER == -11 && RTBUS_E_MEMORY == -12, "");
_Static_assert(RTBUS_E_ENDED == -13, "");

/* The messages as C sees them: the same bytes as in C++ (rtbus/messages.hpp). */
BYTES(rtbus_device_state, 560);
BYTES(rtbus_proxy_state, 232);
BYTES(rtbus_heartbeat, 40);
BYTES(rtbus_telemetry, 240);
PINNED(rtbus_proxy_state, contact_force_n, 128);

size_t rtbus_abi_checked(void) { return sizeof(rtbus_type); }
