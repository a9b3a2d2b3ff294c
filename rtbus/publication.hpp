#pragma once
/// @file publication.hpp
/// A writer for a realtime thread whose segment may be deleted, shortened or overwritten under it.
///
/// Somebody removes files from /dev/shm: a hasty `rm`, systemd-logind with RemoveIPC=yes when the user's last session
/// ends. The memory stays mapped in whoever has it, but no newcomer finds it. Or somebody shortens a file: its memory
/// is gone (detail/mapping_guard.hpp). maintain() notices either and makes the topic anew under its name; the realtime
/// thread then writes both rings until the readers have had time to change over, so that nobody who looks every 20 ms
/// misses anything that is still to be had. A header that was overwritten is put back in place:
///
///     housekeeping: maintain()                       realtime: publish()
///     the name leads elsewhere? create fresh
///     fresh ──► incoming_ (release)                  incoming_ there?
///     incoming_ empty: adopted, the clock runs         former_ = current_; current_ = fresh (acquire)
///                                                    writes current_ and former_
///     after kHandOver_ns: let_go_ (release)          let_go_ set? former_ ──► retired_ (release)
///     deletes retired_ (acquire)
///
/// Each cell has one thread that fills it and one that empties it. The realtime thread takes no lock, makes no system
/// call, allocates and frees nothing; the old ring stays mapped until it has put the old writer into retired_.
/// Numbers begin anew in the new ring. Readers change over by themselves when they are Subscriptions.
#include <atomic>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/topic.hpp"

namespace rtbus {

/// Movable until its two threads run; they must have ended before destruction, which unlinks the topic. One thread
/// publishes, one maintains; they may be the same.
template <Sample T>
class Publication {
 public:
  /// Both rings are written for so long: a dozen rounds of a reader's housekeeping.
  static constexpr std::uint64_t kHandOver_ns = 250 * kNsPerMs;
  /// A topic that cannot be made anew (another process has taken the name, /dev/shm is full) is tried again so late.
  static constexpr std::uint64_t kRetry_ns = kNsPerS;

  /// Creates the topic, or takes it over when its writer has died. @realtime No.
  [[nodiscard]] static Result<Publication, TopicError> create(const Session& session, std::string_view topic,
                                                              WriterOptions options = {}) {
    auto writer = Writer<T>::create(session, topic, options);
    if (!writer) return Failure{writer.error()};
    auto core = std::make_unique<Core>();
    core->session = session;
    core->topic = topic;
    core->options = options;
    core->newest = core->current = new Writer<T>(std::move(*writer));
    return Publication(std::move(core));
  }

  /// Makes `value` the newest sample. @realtime Yes, wait-free: one copy of sizeof(T) bytes, two during a hand-over.
  void publish(const T& value, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING {
    Core& core = *core_;
    if (core.incoming.load(std::memory_order_relaxed) != nullptr) core.adopt();
    core.current->publish(value, stamp_ns);
    if (core.former == nullptr) return;
    core.former->publish(value, stamp_ns);
    if (core.let_go.load(std::memory_order_relaxed)) core.part();
  }

  /// Makes the topic anew when its name leads elsewhere or nowhere. About every 20 ms. @realtime No.
  void maintain() noexcept {
    Core& core = *core_;
    const std::uint64_t now_ns = monotonic_ns();
    if (core.outgoing != nullptr && !core.end_hand_over(now_ns)) {
      // One that nobody published into meanwhile may be replaced too.
      if (!core.newest->replaced() || !core.withdraw()) return;
    }
    if (!core.newest->replaced()) {
      (void)core.newest->mend();
      core.error.store(kNoError, std::memory_order_relaxed);
      return;
    }
    if (now_ns < core.retry_ns) return;
    Writer<T>* const fresh = core.make();
    if (fresh == nullptr) {
      core.retry_ns = now_ns + kRetry_ns;
      return;
    }
    core.error.store(kNoError, std::memory_order_relaxed);
    core.outgoing = std::exchange(core.newest, fresh);
    core.adopted_ns = 0;
    core.let_go.store(false, std::memory_order_relaxed);
    core.incoming.store(fresh, std::memory_order_release);
    core.renewals.fetch_add(1, std::memory_order_relaxed);
  }

  /// Some reader asked to be noticed. Housekeeping thread. @realtime No: asks the kernel.
  [[nodiscard]] bool observed() const noexcept {
    return core_->newest->observed() || (core_->outgoing != nullptr && core_->outgoing->observed());
  }
  /// How often the topic was made anew. Any thread.
  [[nodiscard]] std::uint64_t renewals() const noexcept { return core_->renewals.load(std::memory_order_relaxed); }
  /// Why it could not be made anew at the last attempt; none: it could, or nothing has happened. Any thread.
  [[nodiscard]] std::optional<TopicError> last_error() const noexcept {
    const int error = core_->error.load(std::memory_order_relaxed);
    return error == kNoError ? std::nullopt : std::optional(static_cast<TopicError>(error));
  }
  [[nodiscard]] const std::string& topic() const noexcept { return core_->topic; }

 private:
  static constexpr int kNoError = -1;
  struct Core {
    Session session;
    std::string topic;
    WriterOptions options;

    // Housekeeping thread.
    Writer<T>* newest = nullptr;    ///< In incoming or current.
    Writer<T>* outgoing = nullptr;  ///< The one before it, until it came back through retired.
    std::uint64_t adopted_ns = 0;
    std::uint64_t retry_ns = 0;
    // Realtime thread.
    Writer<T>* current = nullptr;
    Writer<T>* former = nullptr;  ///< Written too, during a hand-over.
    // Between them.
    std::atomic<Writer<T>*> incoming{nullptr};
    std::atomic<Writer<T>*> retired{nullptr};
    std::atomic<bool> let_go{false};
    std::atomic<std::uint64_t> renewals{0};
    std::atomic<int> error{kNoError};  // a TopicError; an optional one is not lock-free with every compiler

    ~Core() {
      delete incoming.load(std::memory_order_acquire);
      delete retired.load(std::memory_order_acquire);
      delete former;
      delete current;
    }

    void adopt() noexcept RTBUS_NONBLOCKING {
      Writer<T>* const fresh = incoming.exchange(nullptr, std::memory_order_acq_rel);
      if (fresh == nullptr) return;  // withdrawn in this moment
      // former is empty: maintain() offers the next one only after the last hand-over has ended.
      former = std::exchange(current, fresh);
    }
    void part() noexcept RTBUS_NONBLOCKING { retired.store(std::exchange(former, nullptr), std::memory_order_release); }

    /// Takes back the one that was offered. False: the realtime thread has it.
    bool withdraw() noexcept {
      Writer<T>* const untaken = incoming.exchange(nullptr, std::memory_order_acq_rel);
      if (untaken == nullptr) return false;
      delete untaken;
      newest = std::exchange(outgoing, nullptr);
      return true;
    }

    /// False while the hand-over goes on.
    bool end_hand_over(std::uint64_t now_ns) noexcept {
      if (incoming.load(std::memory_order_acquire) != nullptr) return false;  // not taken: nothing was published since
      if (adopted_ns == 0) adopted_ns = now_ns;
      if (now_ns < adopted_ns + kHandOver_ns) return false;
      let_go.store(true, std::memory_order_relaxed);
      Writer<T>* const old = retired.exchange(nullptr, std::memory_order_acquire);
      if (old == nullptr) return false;
      delete old;  // unlinks nothing: the name does not lead to it
      outgoing = nullptr;
      return true;
    }

    Writer<T>* make() noexcept {
      try {
        newest->give_up_name();  // one whose file was shortened still has it, and the lock
        auto writer = Writer<T>::create(session, topic, options);
        if (writer) return new Writer<T>(std::move(*writer));
        error.store(static_cast<int>(writer.error()), std::memory_order_relaxed);
      } catch (...) {  // out of memory
        error.store(static_cast<int>(TopicError::kSystem), std::memory_order_relaxed);
      }
      return nullptr;
    }
  };
  explicit Publication(std::unique_ptr<Core> core) : core_(std::move(core)) {}

  std::unique_ptr<Core> core_;
};

/// What several publications of a node have to tell its user.
struct RenewalCount {
  std::uint64_t renewed = 0;  ///< Topics made anew, ever.
  std::uint64_t failing = 0;  ///< Topics that newcomers do not find now.
  std::optional<TopicError> why;
  bool operator==(const RenewalCount&) const = default;
  RenewalCount& operator+=(const RenewalCount& other) noexcept {
    renewed += other.renewed;
    failing += other.failing;
    if (other.why) why = other.why;
    return *this;
  }
  /// One sentence. @realtime No.
  [[nodiscard]] std::string text() const {
    std::string out = "somebody deleted or shortened topics in /dev/shm: " + std::to_string(renewed) + " created again";
    if (why) {
      out += ", " + std::to_string(failing) + " could not be (" + to_string(*why) + "), tried again every second";
    }
    return out + "; if this comes with logging out, see `rtbus doctor` (RemoveIPC)";
  }
};

/// Any thread.
template <class... Publications>
[[nodiscard]] RenewalCount count_renewals(const Publications&... publications) noexcept {
  RenewalCount count;
  const auto add = [&count](const auto& publication) {
    const std::optional<TopicError> error = publication.last_error();
    count += {publication.renewals(), error ? 1u : 0u, error};
  };
  (add(publications), ...);
  return count;
}

}  // namespace rtbus
