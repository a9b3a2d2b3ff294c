#include "tests/fuzz/bridge_cdr.h"

#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>

int foreign_topic_open(dds_entity_t participant, const char* name, const dds_topic_descriptor_t* type, const void* example,
                       struct foreign_topic* out) {
  const dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
  const dds_entity_t reader = dds_create_reader(participant, topic, NULL, NULL);
  if (topic < 0 || reader < 0) return 0;
  for (int i = 0; i < 2; ++i) {
    out->writers[i] = dds_create_writer(participant, topic, NULL, NULL);
    if (out->writers[i] < 0) return 0;
  }
  /* Cyclone DDS 0.10 tells the serialised type of a topic only by a message of it. */
  struct ddsi_serdata* message = NULL;
  dds_sample_info_t info;
  if (dds_write(out->writers[0], example) != DDS_RETCODE_OK) return 0;
  if (dds_takecdr(reader, &message, 1, &info, DDS_ANY_STATE) != 1) return 0;
  out->type = ddsi_sertype_ref(message->type);
  ddsi_serdata_unref(message);
  return dds_delete(reader) == DDS_RETCODE_OK;
}

int foreign_topic_write(const struct foreign_topic* topic, int author, const void* bytes, size_t size) {
  const ddsrt_iovec_t part = {.iov_base = (void*)bytes, .iov_len = size};
  struct ddsi_serdata* message = ddsi_serdata_from_ser_iov(topic->type, SDK_DATA, 1, &part, size);
  if (message == NULL) return 0;
  return dds_writecdr(topic->writers[author], message) == DDS_RETCODE_OK; /* takes the reference over */
}
