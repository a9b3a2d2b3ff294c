#pragma once
/// @file subscription.hpp
/// A reader for a realtime thread, which follows a writer that ends and returns.
///
/// The realtime thread only copies samples. Everything that needs the kernel (finding the topic, mapping it, noticing
/// that it was replaced) happens in maintain(), which one housekeeping thread calls about every 20 ms. Between them:
///
///     housekeeping: maintain()                     realtime: read_latest()
///     delete retired_, if any
///     new Reader ──► incoming_ (release)           incoming_ there and retired_ empty?
///                                                    current_ = incoming_ taken (acquire)
///     deletes it next time ◄── retired_ (release)    old current_ ──► retired_
///
/// Each cell has one thread that fills it and one that empties it. So neither waits, and the realtime thread allocates
/// and frees nothing. A Reader is destroyed only by the housekeeping thread, after the realtime thread gave it back;
/// until then maintain() may ask the kernel about it (another part of the object than the one read_latest() uses).
#include <atomic>
#include <memory>
#include <new>
#include <string>
#include <utility>

#include "rtbus/topic.hpp"

namespace rtbus {

/// Neither copyable nor movable. Two threads: one reads, one maintains. Both must have ended before destruction.
template <Sample T>
class Subscription {
 public:
  Subscription(Session session, std::string topic, ReaderOptions options = {})
      : session_(std::move(session)), topic_(std::move(topic)), options_(options) {}
  ~Subscription() {
    delete incoming_.load(std::memory_order_acquire);
    delete retired_.load(std::memory_order_acquire);
    delete current_;
  }
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;

  /// Copies the newest sample, as Reader::read_latest does; kDetached until a writer has been found. After a change of
  /// segment the numbers may begin anew; reading goes on with the new ones. @realtime Yes, wait-free.
  [[nodiscard]] ReadStatus read_latest(Stamped<T>& out) noexcept RTBUS_NONBLOCKING {
    adopt();
    return current_ != nullptr ? current_->read_latest(out) : ReadStatus::kDetached;
  }
  /// As Reader::read_latest_rows does; likewise. @realtime Yes, wait-free.
  [[nodiscard]] ReadStatus read_latest_rows(Stamped<T>& out) noexcept RTBUS_NONBLOCKING requires TabularSample<T> {
    adopt();
    return current_ != nullptr ? current_->read_latest_rows(out) : ReadStatus::kDetached;
  }
  /// In order, as Reader::read_next does. @realtime Yes, wait-free.
  [[nodiscard]] ReadStatus read_next(Stamped<T>& out) noexcept RTBUS_NONBLOCKING {
    adopt();
    return current_ != nullptr ? current_->read_next(out) : ReadStatus::kDetached;
  }

  /// Opens the topic, or opens it anew once the name leads elsewhere. One thread, about every 20 ms. @realtime No.
  void maintain() noexcept {
    delete retired_.exchange(nullptr, std::memory_order_acquire);
    const bool old_alive = newest_ != nullptr && newest_->writer_alive();
    if (newest_ != nullptr) {
      attached_.store(old_alive, std::memory_order_relaxed);
      // A dead writer whose name still leads here will be followed by one that goes on in place.
      if (!newest_->replaced()) return;
    }
    auto opened = open();
    if (!opened) {
      error_.store(opened.error(), std::memory_order_relaxed);
      return;
    }
    const bool alive = opened->writer_alive();
    // A live writer whose segment was deleted makes it anew (Publication) and writes both for a while; until then, and
    // if what has its name belongs to a dead one, stay where samples come from.
    if (old_alive && !alive) return;
    auto* const reader = new (std::nothrow) Reader<T>(std::move(*opened));
    if (reader == nullptr) return;
    // Withdraw what the realtime thread has not taken yet: it is outdated.
    delete incoming_.exchange(reader, std::memory_order_acq_rel);
    newest_ = reader;
    attached_.store(alive, std::memory_order_relaxed);
    attachments_.fetch_add(1, std::memory_order_relaxed);
  }

  /// A segment has been found and its writer lived at the last maintain(). Any thread.
  [[nodiscard]] bool attached() const noexcept { return attached_.load(std::memory_order_relaxed); }
  /// Segments found since construction; grows with each re-attachment. Any thread.
  [[nodiscard]] std::uint64_t attachments() const noexcept { return attachments_.load(std::memory_order_relaxed); }
  /// Samples that read_next() jumped over, in all segments. Reading thread. @realtime Yes.
  [[nodiscard]] std::uint64_t missed() const noexcept RTBUS_NONBLOCKING {
    return missed_before_ + (current_ != nullptr ? current_->missed() : 0);
  }
  /// Samples that were not sane (sane_sample.hpp), in all segments. Reading thread. @realtime Yes.
  [[nodiscard]] std::uint64_t refused() const noexcept RTBUS_NONBLOCKING {
    return refused_before_ + (current_ != nullptr ? current_->refused() : 0);
  }
  /// Why the last attempt to open failed; kNotFound before the first. Any thread.
  [[nodiscard]] TopicError last_error() const noexcept { return error_.load(std::memory_order_relaxed); }
  [[nodiscard]] const std::string& topic() const noexcept { return topic_; }

 private:
  void adopt() noexcept RTBUS_NONBLOCKING {
    if (incoming_.load(std::memory_order_relaxed) == nullptr) return;
    // The cell for the old one must be empty before it is taken out of use; maintain() empties it.
    if (retired_.load(std::memory_order_relaxed) != nullptr) return;
    Reader<T>* const fresh = incoming_.exchange(nullptr, std::memory_order_acquire);
    if (fresh == nullptr) return;  // withdrawn in between
    missed_before_ = missed();
    refused_before_ = refused();
    retired_.store(current_, std::memory_order_release);
    current_ = fresh;
  }

  [[nodiscard]] Result<Reader<T>, TopicError> open() noexcept {
    try {
      return Reader<T>::open(session_, topic_, options_);
    } catch (...) {  // out of memory: the next maintain() tries again
      return Failure{TopicError::kSystem};
    }
  }

  Session session_;
  std::string topic_;
  ReaderOptions options_;
  Reader<T>* newest_ = nullptr;       ///< Housekeeping: the last one opened; it sits in incoming_ or current_.
  Reader<T>* current_ = nullptr;      ///< Realtime: the one in use.
  std::uint64_t missed_before_ = 0;   ///< Realtime: by the readers before it.
  std::uint64_t refused_before_ = 0;  ///< Likewise.
  std::atomic<Reader<T>*> incoming_{nullptr};
  std::atomic<Reader<T>*> retired_{nullptr};
  std::atomic<bool> attached_{false};
  std::atomic<std::uint64_t> attachments_{0};
  std::atomic<TopicError> error_{TopicError::kNotFound};
};

}  // namespace rtbus
