// One task at a time, beside the caller: how tracking and mapping run in parallel and yet give the same result every
// time.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace huetrack::camera_tracking {

// thread-compatible: start() and wait() by one thread. The task shares nothing with what the caller does in between;
// what it made is the caller's after wait(). So the result does not depend on who is faster.
class ParallelTask {
 public:
  ParallelTask() : worker_([this](std::stop_token stop) { run(stop); }) {}
  ~ParallelTask() { wait(); }
  ParallelTask(const ParallelTask&) = delete;
  ParallelTask& operator=(const ParallelTask&) = delete;

  void start(std::function<void()> task) {  // the one before was waited for; the task does not throw
    std::lock_guard lock(mutex_);
    task_ = std::move(task);
    changed_.notify_all();
  }
  void wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !task_; });
  }

 private:
  void run(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (changed_.wait(lock, stop, [this] { return static_cast<bool>(task_); })) {
      lock.unlock();
      task_();
      lock.lock();
      task_ = nullptr;
      changed_.notify_all();
    }
  }

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::function<void()> task_;  // guarded by mutex_; while it runs, nobody else touches it
  std::jthread worker_;         // last: it uses the others
};

}  // namespace huetrack::camera_tracking
