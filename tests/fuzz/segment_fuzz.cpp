// A segment in /dev/shm as somebody may leave or scribble it: opening it ends with a reader or a TopicError, and what
// is read lies within the sample.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>

#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic_directory.hpp"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

/// Gone with the process.
struct Place {
  rtbus::Session session;
  std::string name;
  Place() {
    session.name = "fuzz-" + std::to_string(::getpid());
    name = "/" + rtbus::segment_name(session.name, "t");
  }
  ~Place() { ::shm_unlink(name.c_str()); }
};

template <class T>
void read_as(const rtbus::Session& session) {
  auto reader = rtbus::Reader<T>::open(session, "t");
  if (!reader) return;
  rtbus::Stamped<T> sample;
  for (int i = 0; i < 3; ++i) {
    if (reader->read_next(sample) == rtbus::ReadStatus::kFresh) require(rtbus::sane(sample.value, sample.stamp_ns));
  }
}

void read_raw(const rtbus::Session& session) {
  auto reader = rtbus::RawReader::open(session, "t");
  if (!reader) return;
  for (int i = 0; i < 3; ++i) {
    (void)(i == 0 ? reader->read_latest() : reader->read_next());
    std::size_t length = 0;
    rtbus::visit_fields(reader->bytes(), reader->description(),
                        [&](const std::string& label, const std::string&, const rtbus::FieldValue& value) {
                          length += label.size() + rtbus::to_text(value).size();
                        });
    require(reader->bytes().size() == reader->description().sample_bytes && length < (64U << 20));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Place place;
  const int fd = ::shm_open(place.name.c_str(), O_RDWR | O_CREAT | O_TRUNC, 0600);
  require(fd >= 0);
  require(size == 0 || ::write(fd, data, size) == static_cast<ssize_t>(size));
  ::close(fd);
  require(rtbus::list_topics(place.session.name).size() == 1);
  read_raw(place.session);
  read_as<rtbus::Heartbeat>(place.session);
  read_as<rtbus::DeviceState>(place.session);
  read_as<rtbus::ProxyContacts>(place.session);
  return 0;
}
