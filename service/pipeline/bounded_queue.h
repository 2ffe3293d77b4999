// Bounded queue between threads, with a policy for a full queue and an end.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>

namespace huetrack::pipeline {

// Live data drops the oldest; a replay waits.
enum class WhenFull { drop_oldest, wait };

// thread-safe: any number of producers and consumers.
template <typename T>
class BoundedQueue {
 public:
  // throws std::invalid_argument when capacity is 0
  BoundedQueue(std::size_t capacity, WhenFull when_full) : capacity_(capacity), when_full_(when_full) {
    if (capacity == 0) throw std::invalid_argument("BoundedQueue: capacity must be at least 1");
  }

  // False once the queue is closed: the item is not added, and the producer may end. pushed_out (may be null) receives
  // the item that was dropped to make room.
  bool push(T item, std::optional<T>* pushed_out = nullptr) {
    {
      std::unique_lock lock(mutex_);
      if (when_full_ == WhenFull::wait) {
        room_.wait(lock, [&] { return closed_ || items_.size() < capacity_; });
      } else if (!closed_ && items_.size() == capacity_) {
        if (pushed_out) *pushed_out = std::move(items_.front());
        items_.pop_front();
        ++dropped_;
      }
      if (closed_) return false;
      items_.push_back(std::move(item));
    }
    arrived_.notify_one();
    return true;
  }

  // Blocks; nullopt once closed and empty: the consumer's end signal.
  std::optional<T> pop() {
    std::unique_lock lock(mutex_);
    arrived_.wait(lock, [&] { return closed_ || !items_.empty(); });
    return take(lock);
  }

  // As pop(), but also returns nullopt after `patience`; ended() distinguishes the two.
  std::optional<T> pop_for(std::chrono::nanoseconds patience) {
    std::unique_lock lock(mutex_);
    const auto is_due = [&] { return closed_ || !items_.empty(); };
#ifdef __SANITIZE_THREAD__  // GCC 12's does not know pthread_cond_clockwait, which wait_for uses
    arrived_.wait_until(lock, std::chrono::system_clock::now() + patience, is_due);
#else
    arrived_.wait_for(lock, patience, is_due);
#endif
    return take(lock);
  }

  // Wakes all waiting threads. Items in the queue can still be popped.
  void close() {
    {
      const std::scoped_lock lock(mutex_);
      closed_ = true;
    }
    arrived_.notify_all();
    room_.notify_all();
  }

  // Closes and discards all items.
  void abandon() {
    {
      const std::scoped_lock lock(mutex_);
      closed_ = true;
      items_.clear();
    }
    arrived_.notify_all();
    room_.notify_all();
  }

  bool ended() const {
    const std::scoped_lock lock(mutex_);
    return closed_ && items_.empty();
  }
  std::size_t dropped() const {
    const std::scoped_lock lock(mutex_);
    return dropped_;
  }

 private:
  std::optional<T> take(std::unique_lock<std::mutex>& lock) {
    if (items_.empty()) return std::nullopt;
    std::optional<T> item(std::move(items_.front()));
    items_.pop_front();
    lock.unlock();
    room_.notify_one();
    return item;
  }

  const std::size_t capacity_;
  const WhenFull when_full_;
  mutable std::mutex mutex_;
  std::condition_variable arrived_, room_;
  std::deque<T> items_;      // guarded by mutex_
  std::size_t dropped_ = 0;  // guarded by mutex_
  bool closed_ = false;      // guarded by mutex_
};

}  // namespace huetrack::pipeline
