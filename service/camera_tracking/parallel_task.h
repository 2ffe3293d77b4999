// One background task at a time: tracking and mapping run in parallel with a deterministic result.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace huetrack::camera_tracking {

// thread-compatible: start() and wait() by one thread. Between the two, the task and the caller must not share data, so
// that the result does not depend on timing.
class ParallelTask {
 public:
  ParallelTask() : worker_([this](std::stop_token stop) { run(stop); }) {}
  ~ParallelTask() { wait(); }
  ParallelTask(const ParallelTask&) = delete;
  ParallelTask& operator=(const ParallelTask&) = delete;

  void start(std::function<void()> task) {  // call wait() before the next one; the task must not throw
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
  std::function<void()> task_;  // guarded by mutex_, except while it runs
  std::jthread worker_;         // last: it uses the others
};

}  // namespace huetrack::camera_tracking
