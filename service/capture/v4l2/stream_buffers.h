// The buffers of a stream, mapped into memory.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "capture/frames/file_descriptor.h"

namespace huetrack::capture {

// Meaning of a driver's time stamps.
enum class StampKind : std::uint8_t {
  start_of_exposure,  // monotonic clock
  end_of_frame,       // monotonic clock; when the last byte had arrived: late by exposure and transfer
  dequeued,           // the driver gives none (or on an unknown clock): when we dequeued the frame
};
std::string_view name(StampKind kind);

struct Dequeued {
  std::span<const std::uint8_t> bytes;  // the filled part of the buffer
  // Keeps bytes alive; the last holder to let go, on any thread, returns the buffer to the driver. Outlives the
  // device. Holding one too long starves the driver: see V4l2Device::is_short_of_buffers.
  std::shared_ptr<const void> owner;
  std::chrono::nanoseconds at{0};  // CLOCK_MONOTONIC
  StampKind stamp = StampKind::dequeued;
  std::uint32_t sequence = 0;  // the driver's
  bool has_error = false;      // V4L2_BUF_FLAG_ERROR: the data may be damaged
};

namespace v4l2 {

class Mapping {
 public:
  Mapping(const FileDescriptor& fd, const std::filesystem::path& node, std::size_t length, std::uint32_t offset);
  ~Mapping();
  Mapping(Mapping&& other) noexcept : data_(std::exchange(other.data_, nullptr)), length_(other.length_) {}
  Mapping& operator=(Mapping&&) = delete;
  std::span<const std::uint8_t> bytes() const { return {static_cast<const std::uint8_t*>(data_), length_}; }

 private:
  void* data_ = nullptr;
  std::size_t length_ = 0;
};

// Shared by the device and every reader that still holds a frame. thread-safe.
class StreamBuffers : public std::enable_shared_from_this<StreamBuffers> {
 public:
  // An errno, 0 for success, and the call that failed.
  using Result = std::pair<int, const char*>;

  // type: V4L2_BUF_TYPE_VIDEO_CAPTURE or its _MPLANE. throws CaptureError.
  StreamBuffers(std::shared_ptr<const FileDescriptor> fd, const std::filesystem::path& node, std::uint32_t type,
                int count);
  ~StreamBuffers() { stop(); }
  StreamBuffers(const StreamBuffers&) = delete;
  StreamBuffers& operator=(const StreamBuffers&) = delete;
  // Asks the driver to free its buffers. Fails (EBUSY) while readers hold some; then the next REQBUFS of this node
  // fails, until they let go.
  static void release(const FileDescriptor& fd, std::uint32_t type);

  Result start();
  void stop();
  Result dequeue(Dequeued& out);  // EAGAIN: none is ready
  int left_to_driver() const;

 private:
  enum class Place : std::uint8_t { here, driver, reader };

  void give_back(std::uint32_t index);
  int queue(std::uint32_t index);    // 0, or errno; mutex_ is held
  int queue_all(bool is_streaming);  // 0, or errno
  void mark_all_returned();

  const std::shared_ptr<const FileDescriptor> fd_;
  const std::uint32_t type_;
  std::vector<Mapping> maps_;
  mutable std::mutex mutex_;
  std::vector<Place> places_;  // guarded by mutex_
  int queued_ = 0;             // guarded by mutex_; at the driver
  bool streaming_ = false;     // guarded by mutex_
};

}  // namespace v4l2
}  // namespace huetrack::capture
