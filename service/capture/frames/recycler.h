// Objects with much memory that are used again instead of freed: a frame's planes of some megabytes would otherwise be
// given back to the kernel and faulted in anew for every frame.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace huetrack::capture {

// take() from one thread; the last owner lets go in any thread, also after the Recycler's end. T: default
// constructible; it comes back with the content of its last use.
template <typename T>
class Recycler {
 public:
  // most_unused: objects kept while nobody uses them; further ones are freed.
  explicit Recycler(std::size_t most_unused = 8) : shelf_(std::make_shared<Shelf>(most_unused)) {}

  std::shared_ptr<T> take() {
    std::unique_ptr<T> object;
    {
      const std::scoped_lock lock(shelf_->mutex);
      if (!shelf_->unused.empty()) {
        object = std::move(shelf_->unused.back());  // the one used last: it is most likely in a cache
        shelf_->unused.pop_back();
      }
    }
    if (!object) object = std::make_unique<T>();
    // Moved out: a weak pointer to an unused object would keep the deleter, and so the shelf that owns the object.
    return {object.release(),
            [shelf = shelf_](T* p) mutable { std::exchange(shelf, nullptr)->put(std::unique_ptr<T>(p)); }};
  }

 private:
  struct Shelf {
    explicit Shelf(std::size_t most) : most_unused(most) { unused.reserve(most); }
    void put(std::unique_ptr<T> object) {
      const std::scoped_lock lock(mutex);
      if (unused.size() < most_unused) unused.push_back(std::move(object));
    }
    const std::size_t most_unused;
    std::mutex mutex;
    std::vector<std::unique_ptr<T>> unused;  // guarded by mutex
  };
  std::shared_ptr<Shelf> shelf_;
};

// Bytes of a frame, uninitialised.
class FrameMemory {
 public:
  // At least so many bytes; their content is undefined.
  std::uint8_t* bytes(std::size_t count) {
    if (count > capacity_ || 2 * count < capacity_) {  // another image size
      memory_ = std::make_unique_for_overwrite<std::uint8_t[]>(count);
      capacity_ = count;
    }
    return memory_.get();
  }

 private:
  std::unique_ptr<std::uint8_t[]> memory_;
  std::size_t capacity_ = 0;
};

}  // namespace huetrack::capture
