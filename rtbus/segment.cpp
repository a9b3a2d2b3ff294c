#include "rtbus/segment.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/detail/doorbell.hpp"
#include "rtbus/detail/file.hpp"
#include "rtbus/detail/fork_guard.hpp"
#include "rtbus/detail/header_check.hpp"
#include "rtbus/detail/mapping_guard.hpp"
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

/// What a segment's name leads to, with its writer's lock in our hands.
struct Claimed {
  bip::shared_memory_object object;  // its descriptor carries the lock
  struct stat status {};
  bool created = false;
};

enum class Lock : std::uint8_t { kMine, kBusy, kGone };

/// Takes the writer's lock on an open segment and makes sure that the name still leads to it.
Lock take_lock(const std::string& name, int fd, const detail::FileId& id) noexcept {
  for (int i = 0; i < kLockTries; ++i) {
    if (detail::lock_byte(fd, F_WRLCK, detail::kWriterLockByte)) {
      return detail::leads_to(name, id) ? Lock::kMine : Lock::kGone;
    }
    if (!detail::leads_to(name, id)) return Lock::kGone;  // its owner has just unlinked it
    sleep_until(monotonic_ns() + kNsPerMs);
  }
  return Lock::kBusy;
}

/// Opens what is there, else creates; whoever gets the lock on the inode that the name leads to is the owner.
/// @returns none when another process has removed or replaced the name in between: to be tried again.
Result<std::optional<Claimed>, TopicError> claim(const std::string& name) {
  Claimed out;
  int number = open_object(out.object, bip::open_only, name.c_str(), bip::read_write);
  if (number == ENOENT) {
    number = open_object(out.object, bip::create_only, name.c_str(), bip::read_write, bip::permissions(0600));
    if (number == EEXIST) return std::optional<Claimed>{};
    out.created = number == 0;
  }
  if (number != 0) return fail_system(number);
  const int fd = handle_of(out.object);
  if (::fstat(fd, &out.status) != 0) return fail_system(errno);
  if (!S_ISREG(out.status.st_mode)) return fail(TopicError::kCorrupt);
  switch (take_lock(name, fd, detail::file_id(out.status))) {
    case Lock::kBusy:
      return fail(TopicError::kAlreadyOwned);
    case Lock::kGone:
      return std::optional<Claimed>{};
    case Lock::kMine:
      break;
  }
  return std::optional<Claimed>(std::move(out));
}

}  // namespace

struct Segment::Impl {
  std::string name;
  bool is_writer = false;
  bip::shared_memory_object object;  // its descriptor carries the locks
  bip::mapped_region region;
  detail::ForkGuard fork_guard;  // after both: forgets them first
  detail::MappingGuard guard;
  bip::mapped_region doorbell_region;  // reader's end, from its first sleep on
  detail::MappingGuard doorbell_guard;
  bool doorbell_tried = false;
  detail::FileId id;
  uid_t owner = 0;
  detail::Geometry where{};
  Description description;
  struct alignas(detail::kCacheLineBytes) Line {
    std::byte bytes[detail::kCacheLineBytes];
  };
  std::vector<Line> made;  // writer's end: the header as it was made

  // Unlink before the descriptor closes and the lock goes, so that nobody takes over what is about to vanish.
  ~Impl() { give_up_name(); }
  void give_up_name() const noexcept {
    if (is_writer && detail::leads_to(name, id)) bip::shared_memory_object::remove(name.c_str());
  }
  /// Maps the first `bytes` of the object, watched; 0 or errno.
  [[nodiscard]] int map(const bip::shared_memory_object& from, bip::mode_t mode, std::uint64_t bytes) {
    bip::mapped_region mapped;
    if (const int number = map_object(mapped, from, mode, 0, bytes); number != 0) return number;
    guard.forget();
    region.swap(mapped);
    return guard.watch(region.get_address(), region.get_size()) ? 0 : ENOMEM;
  }
  // The writer's end, in the order of create(). `where` is known before.
  /// Maps a dead writer's segment, which goes on in place when it is ours, whole, and of the same layout.
  /// @returns whether it is.
  [[nodiscard]] bool take_over(const Claimed& dead, const SampleDescription& sample, std::uint32_t capacity,
                               bool with_doorbell);
  /// Reserves and maps the pages of a new segment and writes its header, but for the magic number; 0 or errno.
  [[nodiscard]] int fill(const Claimed& made_now, const SampleDescription& sample, std::uint32_t capacity);
  /// Signs the header as this process's and lets readers in.
  [[nodiscard]] Result<void, TopicError> announce(const SampleDescription& sample, std::uint32_t capacity);

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

bool Segment::Impl::take_over(const Claimed& dead, const SampleDescription& sample, std::uint32_t capacity,
                              bool with_doorbell) {
  const auto bytes = static_cast<std::uint64_t>(dead.status.st_size);
  if (dead.status.st_uid != ::geteuid() || bytes != where.segment_bytes || detail::has_holes(dead.status)) return false;
  if (map(dead.object, bip::read_write, bytes) != 0) return false;
  const auto checked = detail::read_header(base(), bytes);
  return checked && same_type(checked->description, sample) && checked->description.capacity == capacity &&
         checked->description.doorbell == with_doorbell &&
         header().newest.load(std::memory_order_acquire) <= detail::kMaxTakenOver;
}

int Segment::Impl::fill(const Claimed& made_now, const SampleDescription& sample, std::uint32_t capacity) {
  // Reserve the pages now: a full /dev/shm is an error here instead of a SIGBUS in the loop.
  int number = ::posix_fallocate(handle_of(made_now.object), 0, static_cast<off_t>(where.segment_bytes));
  if (number == 0) number = map(made_now.object, bip::read_write, where.segment_bytes);
  if (number == 0) detail::write_header(base(), sample, capacity, where);
  return number;
}

Result<void, TopicError> Segment::Impl::announce(const SampleDescription& sample, std::uint32_t capacity) {
  auto& shared = *reinterpret_cast<detail::SegmentHeader*>(base());
  const auto pid = static_cast<std::uint32_t>(::getpid());
  const std::uint64_t start_ns = monotonic_ns();
  shared.writer_pid.store(pid, std::memory_order_relaxed);
  shared.writer_start_ns.store(start_ns, std::memory_order_relaxed);
  const std::uint32_t epoch = shared.epoch.fetch_add(1, std::memory_order_release) + 1;
  shared.magic.store(detail::kMagic, std::memory_order_release);

  // The same once more, for mend() and the description: the segment may be damaged already.
  const auto field_count = static_cast<std::uint32_t>(sample.fields.size());
  made.resize(detail::round_up(detail::header_end(field_count), sizeof(Line)) / sizeof(Line));
  std::byte* const own = made.front().bytes;
  detail::write_header(own, sample, capacity, where);
  auto& copy = *reinterpret_cast<detail::SegmentHeader*>(own);
  copy.writer_pid.store(pid, std::memory_order_relaxed);
  copy.writer_start_ns.store(start_ns, std::memory_order_relaxed);
  copy.epoch.store(epoch, std::memory_order_relaxed);
  copy.magic.store(detail::kMagic, std::memory_order_relaxed);
  auto checked = detail::read_header(own, where.segment_bytes);
  if (!checked) return fail(checked.error());
  description = std::move(checked->description);
  return {};
}

Result<Segment, TopicError> Segment::create(const Session& session, std::string_view topic,
                                            const SampleDescription& sample, std::uint32_t capacity, bool doorbell) {
  if (!Session::valid_name(session.name) || !valid_topic_name(topic)) return fail(TopicError::kBadName);
  if (!describable(sample, capacity)) return fail(TopicError::kSystem, EINVAL);
  auto impl = std::make_unique<Impl>();
  impl->name = segment_name(session.name, topic);
  impl->where = detail::geometry(sample.bytes, capacity, static_cast<std::uint32_t>(sample.fields.size()), doorbell);

  for (int round = 0; round < kCreateTries; ++round) {
    auto claimed = claim(impl->name);
    if (!claimed) return Failure{claimed.error()};
    if (!*claimed) continue;
    Claimed& mine = **claimed;
    if (mine.created) {
      if (const int number = impl->fill(mine, sample, capacity); number != 0) {
        bip::shared_memory_object::remove(impl->name.c_str());
        return fail(TopicError::kSystem, number);
      }
    } else if (!impl->take_over(mine, sample, capacity, doorbell)) {
      // Still locked: a starting writer waits for the lock, finds the name gone, and creates anew like us.
      if (!bip::shared_memory_object::remove(impl->name.c_str()) && errno != ENOENT) return fail_system(errno);
      continue;
    }
    impl->is_writer = true;  // from here on the destructor unlinks
    impl->object.swap(mine.object);
    impl->fork_guard.watch(handle_of(impl->object), impl->base(), impl->region.get_size(), &impl->is_writer);
    impl->id = detail::file_id(mine.status);
    impl->owner = ::geteuid();
    if (const int number = set_permissions(handle_of(impl->object), session); number != 0) return fail_system(number);
    if (const auto announced = impl->announce(sample, capacity); !announced) return Failure{announced.error()};
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
  number = impl->map(impl->object, bip::read_only, header_bytes);
  if (number != 0) return fail(TopicError::kSystem, number);
  auto checked = detail::read_header(impl->base(), bytes);
  if (!checked) return fail(checked.error());
  if (detail::has_holes(status)) return fail(TopicError::kCorrupt);
  if (expected != nullptr && !same_type(checked->description, *expected)) return fail(TopicError::kLayoutMismatch);
  number = impl->map(impl->object, bip::read_only, bytes);
  if (number != 0) return fail(TopicError::kSystem, number);

  impl->id = detail::file_id(status);
  impl->owner = status.st_uid;
  impl->where = checked->where;
  impl->description = std::move(checked->description);
  if (presence && !detail::lock_byte(fd, F_RDLCK, detail::kPresenceLockByte)) return fail_system(errno);
  if (presence) impl->fork_guard.watch(fd, impl->base(), impl->region.get_size(), nullptr);
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
bool Segment::replaced() const noexcept {
  struct stat status {};
  return impl_->guard.lost() || !detail::look_up(impl_->name, status) || detail::file_id(status) != impl_->id ||
         static_cast<std::uint64_t>(status.st_size) != impl_->where.segment_bytes || detail::has_holes(status);
}
bool Segment::mend() noexcept {
  if (!impl_->is_writer) return false;
  auto& header = *reinterpret_cast<detail::SegmentHeader*>(impl_->base());
  // All but the magic number, which is stored last, and `newest`, which is the ring's.
  constexpr std::size_t kBegin = sizeof header.magic, kNewest = offsetof(detail::SegmentHeader, newest);
  constexpr std::size_t kAfter = kNewest + sizeof header.newest;
  const std::size_t rest = detail::header_end(static_cast<std::uint32_t>(impl_->description.fields.size())) - kAfter;
  std::byte* const now = impl_->base();
  const std::byte* const made = impl_->made.front().bytes;
  if (header.magic.load(std::memory_order_relaxed) == detail::kMagic &&
      std::memcmp(now + kBegin, made + kBegin, kNewest - kBegin) == 0 &&
      std::memcmp(now + kAfter, made + kAfter, rest) == 0) {
    return false;
  }
  header.magic.store(0, std::memory_order_release);  // not ready, for whoever opens it meanwhile
  std::memcpy(now + kBegin, made + kBegin, kNewest - kBegin);
  std::memcpy(now + kAfter, made + kAfter, rest);
  header.magic.store(detail::kMagic, std::memory_order_release);
  return true;
}
void Segment::give_up_name() noexcept { impl_->give_up_name(); }
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
      bip::mapped_region mapped;
      if (map_object(mapped, writable, bip::read_write, where.doorbell_offset, detail::kPageBytes) == 0 &&
          doorbell_guard.watch(mapped.get_address(), mapped.get_size())) {
        doorbell_region.swap(mapped);
      }
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
