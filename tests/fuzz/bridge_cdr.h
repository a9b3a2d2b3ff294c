#pragma once
/* Bytes as another participant of DDS may send them: Cyclone DDS checks and decodes them as those from the network. (In C: its
 * internal headers are no C++.) */
#include <dds/dds.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif
struct ddsi_sertype;

/* Two authors of one topic. */
struct foreign_topic {
  dds_entity_t writers[2];
  const struct ddsi_sertype* type;
};
/* `example` is a message of the type, which is written once. Returns 0 when DDS refused. */
int foreign_topic_open(dds_entity_t participant, const char* name, const dds_topic_descriptor_t* type, const void* example,
                       struct foreign_topic* out);
/* Returns 1 when the bytes, a header of four and the message behind it, are a message of the type. */
int foreign_topic_write(const struct foreign_topic* topic, int author, const void* bytes, size_t size);
#ifdef __cplusplus
}
#endif
