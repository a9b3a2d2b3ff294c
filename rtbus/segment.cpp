#include "rtbus/segment.hpp"

#include <sys/mman.h>
#include <algorithm>

#include "rtbus/clock.hpp"
#include "rtbus/detail/doorbell.hpp"
#include "rtbus/detail/file.hpp"
#include "rtbus/detail/header_check.hpp"
#include "rtbus/detail/shm_object.hpp"

namespace rtbus {

namespace bip = boost::interprocess;
using detail::handle_of;
using detail::map_object;
using detail::open_object;

namespace {

/// Rounds of the creation loop. Each one more needs another process to remove or replace the name in between.
constexpr int kCreateTries = 32;
/// A lock that is held is asked for again this often, 1 ms apart: `rtbus clean` and a closing writer hold it briefly.
constexpr int kLockTries = 10;

TopicError error_of(int number) noexcept {
  switch (number) {
    case ENOENT:
      return TopicError::kNotFound;
    case EACCES:
    case EPERM:
      return TopicError::kPermission;
    case ELOOP:
      return TopicError::kCorrupt;  // a symbolic link: glibc's shm_open passes O_NOFOLLOW
    default:
      return TopicError::kSystem;
  }
}

Failure<TopicError> fail(TopicError error, int number = 0) noexcept {
  errno = number;
  return Failure{error};
}
Failure<TopicError> fail_system(int number) noexcept { return fail(error_of(number), number); }

bool same_type(const Segment::Description& found, const SampleDescription& wanted) noexcept {
  return found.type_hash == wanted.type_hash && found.sample_bytes == wanted.bytes &&
         found.type_name == wanted.type_name;
}

bool describable(const SampleDescription& sample, std::uint32_t capacity) noexcept {
  if (!detail::valid_sizes(sample.bytes, capacity, sample.fields.size())) return false;
  if (sample.type_name.empty() || sample.type_name.size() > 47) return false;
  return std::all_of(sample.fields.begin(), sample.fields.end(), [](const Field& field) {
    return !field.name.empty() && field.name.size() <= 39 && field.unit.size() <= 15;
  });
}

/// Exactly these permissions, whatever the umask; 0 or errno.
int set_permissions(int fd, const Session& session) noexcept {
  if (session.group && ::fchown(fd, static_cast<uid_t>(-1), *session.group) != 0) return errno;
  return ::fchmod(fd, session.mode) == 0 ? 0 : errno;
}

bool trusted(const struct stat& status, const Session& session, OwnerTrust trust) noexcept {
  return trust == OwnerTrust::kAnyone || status.st_uid == ::geteuid() || status.st_uid == 0 ||
         (session.group && status.st_gid == *session.group);  // only its members and root can give a file that group
}

}  // namespace

struct Segment::Impl {
  std::string name;
  bool is_writer = false;
  bip::shared_memory_object object;  // its descriptor carries the locks
  bip::mapped_region region;
  bip::mapped_region doorbell_region;  // reader's end, from its first sleep on
  bool doorbell_tried = false;
  detail::FileId id;
  uid_t owner = 0;
  detail::Geometry where{};
  Description description;

  ~Impl() {
    // Unlink before the descriptor closes and the lock goes, so that nobody takes over what is about to vanish.
    if (is_writer && detail::leads_to(name, id)) bip::shared_memory_object::remove(name.c_str());
  }
  [[nodiscard]] std::byte* base() const noexcept { return static_cast<std::byte*>(region.get_address()); }
  [[nodiscard]] const detail::SegmentHeader& header() const noexcept {
    return *reinterpret_cast<const detail::SegmentHeader*>(base());
  }
  [[nodiscard]] detail::Doorbell* doorbell() noexcept;
};

bool Session::valid_name(std::string_view name) noexcept {
  return !name.empty() && name.size() <= 32 && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

bool valid_topic_name(std::string_view topic) noexcept {
  return !topic.empty() && topic.size() <= 96 && topic.front() != '.' &&
         std::all_of(topic.begin(), topic.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.';
         });
}

std::string segment_name(std::string_view session, std::string_view topic) {
  std::string name = "rtbus.";
  name.append(session).append(".").append(topic);
  return name;
}

const char* to_string(TopicError error) noexcept {
  switch (error) {
    case TopicError::kNotFound:
      return "no such topic yet; start its writer, or check session and topic name";
    case TopicError::kAlreadyOwned:
      return "a live writer holds this topic; stop it, or choose another session";
    case TopicError::kLayoutMismatch:
      return "version, size or type of the topic differ; rebuild both ends";
    case TopicError::kPermission:
      return "the topic belongs to another user; run both ends as one user, or set bus.group";
    case TopicError::kBadName:
      return "session or topic name has characters other than a-z 0-9 _ - (topics also .)";
    case TopicError::kCorrupt:
      return "not a topic of this bus, or a damaged one; `rtbus clean` removes dead ones";
    case TopicError::kSystem:
      return "a system call failed";
  }
  return "unknown error";
}

Segment::Segment(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Segment::Segment(Segment&&) noexcept = default;
Segment& Segment::operator=(Segment&&) noexcept = default;
Segment::~Segment() = default;

namespace {

enum class Claim : std::uint8_t { kMine, kBusy, kGone };

/// Takes the writer's lock on an open segment and makes sure that the name still leads to it.
Claim claim(const std::string& name, int fd, const detail::FileId& id) noexcept {
  for (int i = 0; i < kLockTries; ++i) {
    if (detail::lock_byte(fd, F_WRLCK, detail::kWriterLockByte)) {
      return detail::leads_to(name, id) ? Claim::kMine : Claim::kGone;
    }
    if (!detail::leads_to(name, id)) return Claim::kGone;  // its owner has just unlinked it
    sleep_until(monotonic_ns() + kNsPerMs);
  }
  return Claim::kBusy;
}

}  // namespace

Result<Segment, TopicError> Segment::create(const Session& session, std::string_view topic,
                                            const SampleDescription& sample, std::uint32_t capacity, bool doorbell) {
  if (!Session::valid_name(session.name) || !valid_topic_name(topic)) return fail(TopicError::kBadName);
  if (!describable(sample, capacity)) return fail(TopicError::kSystem, EINVAL);
  const auto field_count = static_cast<std::uint32_t>(sample.fields.size());
  const detail::Geometry where = detail::geometry(sample.bytes, capacity, field_count, doorbell);
  auto impl = std::make_unique<Impl>();
  impl->name = segment_name(session.name, topic);
  const char* const name = impl->name.c_str();

  for (int round = 0; round < kCreateTries; ++round) {
    // Open what is there, else create; whoever gets the lock on the inode that the name leads to is the owner.
    bip::shared_memory_object object;
    bool created = false;
    int number = open_object(object, bip::open_only, name, bip::read_write);
    if (number == ENOENT) {
      number = open_object(object, bip::create_only, name, bip::read_write, bip::permissions(0600));
      if (number == EEXIST) continue;
      created = number == 0;
    }
    if (number != 0) return fail_system(number);
    const int fd = handle_of(object);
    struct stat status {};
    if (::fstat(fd, &status) != 0) return fail_system(errno);
    const detail::FileId id = detail::file_id(status);
    if (!S_ISREG(status.st_mode)) return fail(TopicError::kCorrupt);
    switch (claim(impl->name, fd, id)) {
      case Claim::kBusy:
        return fail(TopicError::kAlreadyOwned);
      case Claim::kGone:
        continue;
      case Claim::kMine:
        break;
    }

    // A dead writer's segment goes on in place when it is mine, whole, and of the same layout.
    if (!created) {
      bip::mapped_region region;
      const auto bytes = static_cast<std::uint64_t>(status.st_size);
      bool usable = status.st_uid == ::geteuid() && bytes == where.segment_bytes &&
                    map_object(region, object, bip::read_write, 0, bytes) == 0;
      if (usable) {
        auto checked = detail::read_header(static_cast<std::byte*>(region.get_address()), bytes);
        usable = checked && same_type(checked->description, sample) && checked->description.capacity == capacity &&
                 checked->description.doorbell == doorbell;
      }
      if (!usable) {
        // Still locked: a starting writer waits for the lock, finds the name gone, and creates anew like us.
        if (!bip::shared_memory_object::remove(name) && errno != ENOENT) return fail_system(errno);
        continue;
      }
      impl->region.swap(region);
    } else {
      // Reserve the pages now: a full /dev/shm is an error here instead of a SIGBUS in the loop.
      number = ::posix_fallocate(fd, 0, static_cast<off_t>(where.segment_bytes));
      if (number == 0) number = map_object(impl->region, object, bip::read_write, 0, where.segment_bytes);
      if (number != 0) {
        bip::shared_memory_object::remove(name);
        return fail(TopicError::kSystem, number);
      }
      detail::write_header(impl->base(), sample, capacity, where);
    }
    impl->is_writer = true;  // from here on the destructor unlinks
    impl->object.swap(object);
    impl->id = id;
    impl->owner = ::geteuid();
    impl->where = where;
    if (number = set_permissions(fd, session); number != 0) return fail_system(number);

    auto& header = *reinterpret_cast<detail::SegmentHeader*>(impl->base());
    header.writer_pid.store(static_cast<std::uint32_t>(::getpid()), std::memory_order_relaxed);
    header.writer_start_ns.store(monotonic_ns(), std::memory_order_relaxed);
    header.epoch.fetch_add(1, std::memory_order_release);
    header.magic.store(detail::kMagic, std::memory_order_release);
    auto checked = detail::read_header(impl->base(), where.segment_bytes);
    if (!checked) return fail(checked.error());
    impl->description = std::move(checked->description);
    return Segment(std::move(impl));
  }
  return fail(TopicError::kSystem, EBUSY);
}

Result<Segment, TopicError> Segment::open(const Session& session, std::string_view topic,
                                          const SampleDescription* expected, OwnerTrust trust, bool presence) {
  if (!Session::valid_name(session.name) || !valid_topic_name(topic)) return fail(TopicError::kBadName);
  auto impl = std::make_unique<Impl>();
  impl->name = segment_name(session.name, topic);

  // Look first: opening a FIFO of that name would block.
  struct stat status {};
  if (!detail::look_up(impl->name, status)) return fail_system(errno);
  if (!S_ISREG(status.st_mode)) return fail(TopicError::kCorrupt);
  int number = open_object(impl->object, bip::open_only, impl->name.c_str(), bip::read_only);
  if (number != 0) return fail_system(number);
  const int fd = handle_of(impl->object);
  if (::fstat(fd, &status) != 0) return fail_system(errno);
  if (!S_ISREG(status.st_mode)) return fail(TopicError::kCorrupt);
  if (!trusted(status, session, trust)) return fail(TopicError::kPermission);
  if (status.st_size == 0) return fail(TopicError::kNotFound);  // its creator is not ready
  const auto bytes = static_cast<std::uint64_t>(status.st_size);
  if (bytes < detail::kPageBytes ||
      bytes > detail::geometry(detail::kMaxSampleBytes, detail::kMaxCapacity, detail::kMaxFields, true).segment_bytes) {
    return fail(TopicError::kCorrupt);
  }
  // Check the header before the rest is mapped: a sparse file of any size could claim to be a topic, and faulting it in
  // would fill the memory. Ours have all their blocks from the beginning.
  const std::uint64_t header_bytes = std::min<std::uint64_t>(bytes, detail::kMaxHeaderBytes);
  number = map_object(impl->region, impl->object, bip::read_only, 0, header_bytes);
  if (number != 0) return fail(TopicError::kSystem, number);
  auto checked = detail::read_header(impl->base(), bytes);
  if (!checked) return fail(checked.error());
  if (static_cast<std::uint64_t>(status.st_blocks) * 512 < bytes) return fail(TopicError::kCorrupt);
  if (expected != nullptr && !same_type(checked->description, *expected)) return fail(TopicError::kLayoutMismatch);
  number = map_object(impl->region, impl->object, bip::read_only, 0, bytes);
  if (number != 0) return fail(TopicError::kSystem, number);

  impl->id = detail::file_id(status);
  impl->owner = status.st_uid;
  impl->where = checked->where;
  impl->description = std::move(checked->description);
  if (presence && !detail::lock_byte(fd, F_RDLCK, detail::kPresenceLockByte)) return fail_system(errno);
  return Segment(std::move(impl));
}

detail::RingView Segment::ring() const noexcept {
  detail::RingView view;
  view.newest = &reinterpret_cast<detail::SegmentHeader*>(impl_->base())->newest;
  view.slots = impl_->base() + impl_->where.header_bytes;
  view.capacity = impl_->description.capacity;
  view.slot_stride = impl_->where.slot_stride;
  view.words = impl_->description.sample_bytes / 8;
  return view;
}

bool Segment::writer_alive() const noexcept {
  return impl_->is_writer || detail::is_locked_against(handle_of(impl_->object), F_RDLCK, detail::kWriterLockByte);
}
bool Segment::observed() const noexcept {
  return detail::is_locked_against(handle_of(impl_->object), F_WRLCK, detail::kPresenceLockByte);
}
bool Segment::replaced() const noexcept { return !detail::leads_to(impl_->name, impl_->id); }
std::size_t Segment::bytes() const noexcept { return impl_->where.segment_bytes; }
std::uint32_t Segment::writer_pid() const noexcept {
  return impl_->header().writer_pid.load(std::memory_order_relaxed);
}
std::uint32_t Segment::epoch() const noexcept { return impl_->header().epoch.load(std::memory_order_acquire); }
std::uint64_t Segment::writer_start_ns() const noexcept {
  return impl_->header().writer_start_ns.load(std::memory_order_relaxed);
}
uid_t Segment::owner() const noexcept { return impl_->owner; }
const Segment::Description& Segment::description() const noexcept { return impl_->description; }

detail::Doorbell* Segment::Impl::doorbell() noexcept {
  if (where.doorbell_offset == 0) return nullptr;
  if (is_writer) return reinterpret_cast<detail::Doorbell*>(base() + where.doorbell_offset);
  if (!doorbell_tried) {
    // The reader's mapping stays read-only; only this page is mapped a second time, for writing, if the mode permits.
    doorbell_tried = true;
    bip::shared_memory_object writable;
    struct stat status {};
    if (open_object(writable, bip::open_only, name.c_str(), bip::read_write) == 0 &&
        ::fstat(handle_of(writable), &status) == 0 && detail::file_id(status) == id) {
      (void)map_object(doorbell_region, writable, bip::read_write, where.doorbell_offset, detail::kPageBytes);
    }
  }
  return static_cast<detail::Doorbell*>(doorbell_region.get_address());
}

void Segment::ring_doorbell() noexcept {
  if (detail::Doorbell* const bell = impl_->is_writer ? impl_->doorbell() : nullptr) detail::ring(*bell);
}
bool Segment::wait_newer_than(std::uint64_t sequence, std::uint64_t deadline_ns) noexcept {
  return detail::wait_newer(impl_->header().newest, impl_->doorbell(), sequence, deadline_ns);
}

}  // namespace rtbus
