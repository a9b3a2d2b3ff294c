/// @file rtbus.h
/// The bus for C, and for whatever calls C: find sessions and topics, read, follow, publish, give orders.
///
/// Library librtbus.so.1. Handles are opaque; no structure of the library crosses by value. A function that can fail
/// returns a negative rtbus_status and leaves a sentence for the user in rtbus_last_error(). No exception and no abort
/// crosses this interface. Strings are UTF-8.
///
/// Structures that the library fills or reads begin with `struct_bytes`: set it to sizeof before the call. A newer
/// library fills no more than that, and takes what an older caller does not have as zero.
///
/// Threads: a handle belongs to one thread at a time; different handles may be used at once. Each function says after
/// @thread from where it may be called; "the handle's" means from one thread at a time. After fork() the handles of the
/// parent must not be used in the child: its topics stay the parent's.
#ifndef RTBUS_C_RTBUS_H
#define RTBUS_C_RTBUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define RTBUS_API __attribute__((visibility("default")))
#else
#define RTBUS_API
#endif

/// Grows with every function or structure member that is added; the soname with what is removed or changed.
#define RTBUS_C_ABI_VERSION 1

/// What a call returns: >= 0 is how it went, < 0 why it failed.
typedef enum rtbus_status {
  RTBUS_OK = 0,
  RTBUS_FRESH = 1,    ///< A sample was read.
  RTBUS_SAME = 2,     ///< Nothing new; the output is unchanged.
  RTBUS_LAPPED = 3,   ///< The writer overtook every attempt to copy; the output is unchanged.
  RTBUS_REFUSED = 4,  ///< The sample was not sane (not finite, impossible); the output is unchanged.

  RTBUS_E_NOT_FOUND = -1,   ///< No such topic yet; its writer has not started.
  RTBUS_E_OWNED = -2,       ///< A live writer holds the topic.
  RTBUS_E_LAYOUT = -3,      ///< Version, size or type differ from what was expected.
  RTBUS_E_PERMISSION = -4,  ///< The topic belongs to another user.
  RTBUS_E_NAME = -5,        ///< A name of a session, topic, type or field that may not be.
  RTBUS_E_CORRUPT = -6,     ///< Not a topic of this bus, or a damaged one.
  RTBUS_E_SYSTEM = -7,      ///< A system call failed; the sentence says which error.
  RTBUS_E_ARGUMENT = -8,    ///< A null pointer, a size or a value that makes no sense.
  RTBUS_E_VALUE = -9,       ///< A sample that readers would refuse: not finite, or impossible. It was not published.
  RTBUS_E_TIMEOUT = -10,    ///< Nobody answered in time.
  RTBUS_E_ORDER = -11,      ///< The session refused the order; the sentence says why.
  RTBUS_E_MEMORY = -12,     ///< Out of memory.
  RTBUS_E_ENDED = -13       ///< The session, or what the handle stood for, has ended.
} rtbus_status;

/// One sentence for people; never null. Any thread.
/// @thread Any.
RTBUS_API const char* rtbus_strerror(int status);

/// What this thread's last failed call has to say: names the thing, the value and the remedy. Never null; valid until
/// the thread's next call.
/// @thread Any; each thread has its own.
RTBUS_API const char* rtbus_last_error(void);

/// RTBUS_C_ABI_VERSION of the library that was loaded.
/// @thread Any.
RTBUS_API uint32_t rtbus_abi_version(void);

/// Version of the project, "0.3.0".
/// @thread Any.
RTBUS_API const char* rtbus_version(void);

/// Now, on the clock of all stamps: CLOCK_MONOTONIC [ns].
/// @thread Any.
RTBUS_API uint64_t rtbus_now_ns(void);

// --- types of samples ------------------------------------------------------------------------------------------------

typedef enum rtbus_field_type {
  RTBUS_F64 = 1,
  RTBUS_U64 = 2,
  RTBUS_I64 = 3,
  RTBUS_U32 = 4,
  RTBUS_I32 = 5,
  RTBUS_U8 = 6,
  RTBUS_TEXT = 7  ///< `count` bytes of UTF-8, ended by a zero byte unless full.
} rtbus_field_type;

/// One field of a sample: `count` elements of `type` from byte `offset` on.
typedef struct rtbus_field {
  char name[40];    ///< With its unit as suffix: "position_m".
  char unit[16];    ///< "m", "N", "ns"; "1" for a pure number, "" for text.
  uint32_t type;    ///< rtbus_field_type.
  uint32_t offset;  ///< [bytes]
  uint32_t count;   ///< All elements.
  uint32_t inner;   ///< Those of the last dimension: 3 for 64 positions, whose count is 192. Else 1.
} rtbus_field;

/// A type and its fields. The fields belong to whoever gave them.
typedef struct rtbus_type {
  size_t struct_bytes;
  char name[48];         ///< "rtbus/Telemetry".
  uint64_t hash;         ///< Changes with name, size and fields. Ignored by rtbus_writer_create().
  uint32_t bytes;        ///< Of a sample: a multiple of 8.
  uint32_t field_count;  ///< Without a gap, in the order of their offsets.
  const rtbus_field* fields;
} rtbus_type;

/// A type that the nodes exchange, by its name, for example "rtbus/DeviceState". The same as C structures:
/// rtbus_messages.h. The fields live as long as the library. RTBUS_E_NOT_FOUND: there is none of that name.
/// @thread Any.
RTBUS_API int rtbus_known_type(const char* name, rtbus_type* out);

/// Names of the known types: the i-th, or null beyond the last.
/// @thread Any.
RTBUS_API const char* rtbus_known_type_name(size_t i);

// --- sessions and topics ---------------------------------------------------------------------------------------------

/// A topic, as rtbus_list() finds it.
typedef struct rtbus_topic_info {
  char session[40];
  char topic[104];
  char type_name[48];
  char problem[160];       ///< Why it could not be opened; "" when the rest is valid.
  uint64_t published;      ///< Samples over the life of the topic.
  uint64_t segment_bytes;  ///< Memory it takes.
  uint32_t sample_bytes;
  uint32_t capacity;      ///< Samples that the ring holds.
  uint32_t writer_pid;    ///< Of the present or last writer.
  uint32_t writer_alive;  ///< 1 or 0.
} rtbus_topic_info;

/// Topics of one session, or of all (null), sorted. Fills at most `capacity` entries of `entry_bytes` each (write
/// sizeof(rtbus_topic_info)). @returns how many topics there are, which may be more than `capacity`; < 0: failed.
/// @thread Any.
RTBUS_API int rtbus_list(const char* session, rtbus_topic_info* out, size_t entry_bytes, size_t capacity);

/// A node of a session, by its heartbeat.
typedef struct rtbus_node {
  char name[40];  ///< "physics", "haptic0".
  uint32_t pid;
  uint32_t alive;  ///< 1: its process lives, and its last beat is younger than 60 ms.
  uint32_t state;  ///< 0 starting, 1 running, 2 stopping.
  uint32_t reserved;
  uint64_t beat_age_ns;     ///< Since its last beat.
  uint64_t work_age_ns;     ///< Since its last step or tick.
  uint64_t work_period_ns;  ///< Declared period of the steps or ticks.
} rtbus_node;

/// The nodes of a session; counts and sizes as in rtbus_list(). RTBUS_E_NOT_FOUND: the session has no heartbeat.
/// @thread Any.
RTBUS_API int rtbus_session_nodes(const char* session, rtbus_node* out, size_t entry_bytes, size_t capacity);

// --- reading ---------------------------------------------------------------------------------------------------------

typedef struct rtbus_reader rtbus_reader;

enum {
  RTBUS_PRESENCE = 1,     ///< Lets the writer know that somebody looks: some topics are published only then.
  RTBUS_FROM_OLDEST = 2,  ///< rtbus_read_next() begins at the oldest sample still held, not at the next one.
  RTBUS_ANY_OWNER = 4     ///< Also topics of other users. Without it: mine and root's.
};

/// A sample's number in its topic, from 1, and the writer's stamp [ns].
typedef struct rtbus_stamp {
  uint64_t sequence;
  uint64_t stamp_ns;
} rtbus_stamp;

/// Opens a topic for reading. @param flags RTBUS_PRESENCE and so on, or'ed.
/// @thread Any; the handle belongs to one thread at a time from then on.
RTBUS_API int rtbus_reader_open(const char* session, const char* topic, uint32_t flags, rtbus_reader** out);

/// Closes; null is allowed. The topic stays.
/// @thread Any, when no other thread uses the handle.
RTBUS_API void rtbus_reader_close(rtbus_reader* reader);

/// Type of the samples. The fields live as long as the reader.
/// @thread The handle's.
RTBUS_API int rtbus_reader_type(const rtbus_reader* reader, rtbus_type* out);

/// Copies the newest sample. @param out `bytes` must be those of the type. @param stamp May be null.
/// @returns RTBUS_FRESH, RTBUS_SAME, RTBUS_LAPPED or RTBUS_REFUSED. @realtime Yes: no system call, no lock.
/// @thread The handle's.
RTBUS_API int rtbus_read_latest(rtbus_reader* reader, void* out, size_t bytes, rtbus_stamp* stamp);

/// Copies the samples after the one read before, in order, at most `capacity`, into the array `out` of `bytes` bytes.
/// @param stamps Null, or room for `capacity`. @returns how many; 0: nothing new. @realtime Yes, as above.
/// @thread The handle's.
RTBUS_API int rtbus_read_next(rtbus_reader* reader, void* out, size_t bytes, rtbus_stamp* stamps, size_t capacity);

/// Sleeps until a sample newer than the last one read is there, or until `deadline_ns` of rtbus_now_ns(). Follows a
/// topic that was made anew. A signal does not end it. @returns RTBUS_FRESH; RTBUS_SAME: the deadline has passed;
/// RTBUS_E_LAYOUT: a new writer has brought another type. @realtime No.
/// @thread The handle's, which sleeps. Nothing else wakes it.
RTBUS_API int rtbus_wait(rtbus_reader* reader, uint64_t deadline_ns);

/// Samples that rtbus_read_next() lost because it was overtaken, or passed over because they were not sane [count].
/// @thread The handle's.
RTBUS_API uint64_t rtbus_missed(const rtbus_reader* reader);

/// Samples that were not sane [count].
/// @thread The handle's.
RTBUS_API uint64_t rtbus_refused(const rtbus_reader* reader);

/// 1 while the writer's process lives and keeps the topic, else 0. @realtime No.
/// @thread The handle's.
RTBUS_API int rtbus_writer_alive(const rtbus_reader* reader);

// --- publishing ------------------------------------------------------------------------------------------------------

typedef struct rtbus_writer rtbus_writer;

typedef struct rtbus_writer_options {
  size_t struct_bytes;
  uint32_t capacity;  ///< Samples that the ring holds: a power of two, 2…65536. 0: 64.
  uint32_t doorbell;  ///< 1: readers that wait are woken at once (a system call per publish while they sleep).
  uint32_t mode;      ///< Permissions of the shared memory, 0600 when 0.
  uint32_t reserved;
} rtbus_writer_options;

/// Creates a topic, or takes it over when its writer has died. @param options Null: as if all zero.
/// @thread Any; the handle belongs to one thread at a time from then on.
RTBUS_API int rtbus_writer_create(const char* session, const char* topic, const rtbus_type* type,
                                  const rtbus_writer_options* options, rtbus_writer** out);

/// Ends the topic; null is allowed.
/// @thread Any, when no other thread uses the handle.
RTBUS_API void rtbus_writer_close(rtbus_writer* writer);

/// Publishes one sample. @param stamp_ns Time that it belongs to; 0: now. RTBUS_E_VALUE: a number is not finite, or
/// impossible for a known type; rtbus_last_error() names the field. @realtime No: looks after the topic's file every
/// 20 ms.
/// @thread The handle's.
RTBUS_API int rtbus_publish(rtbus_writer* writer, const void* sample, size_t bytes, uint64_t stamp_ns);

/// 1 while a reader with RTBUS_PRESENCE looks, else 0. @realtime No.
/// @thread The handle's.
RTBUS_API int rtbus_observed(rtbus_writer* writer);

// --- orders ----------------------------------------------------------------------------------------------------------

/// Sends an order to the `rtbus run` of a session: a JSON object as docs/orders.md lists them. The answer, another JSON
/// object, is copied into `answer` with a zero byte behind it. @param patience_s Waits so long for it.
/// RTBUS_E_NOT_FOUND: no `rtbus run` serves this session; RTBUS_E_TIMEOUT: no answer; RTBUS_E_ORDER: it refused.
/// @thread Any, which waits for the answer.
RTBUS_API int rtbus_order(const char* session, const char* order, char* answer, size_t answer_bytes, double patience_s);

/// Zero force in all haptic nodes of the session, held. @param reason For people; null: none.
/// **No substitute for a switch in the supply of the device.**
/// @thread Any, which waits for the answer.
RTBUS_API int rtbus_estop(const char* session, const char* reason);

/// Allows force again after an E-stop.
/// @thread Any, which waits for the answer.
RTBUS_API int rtbus_rearm(const char* session);

/// Changes a key that the session lists as adjustable, for example "haptic0.coupling.stiffness_n_per_m".
/// @thread Any, which waits for the answer.
RTBUS_API int rtbus_adjust(const char* session, const char* key, double value);

/// Notes an event in the recordings under way.
/// @thread Any, which waits for the answer.
RTBUS_API int rtbus_mark(const char* session, const char* text);

#ifdef __cplusplus
}
#endif

#endif
