#include "capture/v4l2/stream_buffers.h"

#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <string>

#include "capture/v4l2/v4l2_call.h"

namespace huetrack::capture {

std::string_view name(StampKind kind) {
  static constexpr std::string_view names[] = {"start of exposure", "end of frame",
                                               "none by the driver, taken on arrival"};
  return names[std::size_t(kind)];
}

namespace v4l2 {
namespace {

// A v4l2_buffer, with the plane that a multi-planar driver wants in a structure of its own.
struct BufferArgument {
  BufferArgument(std::uint32_t type, std::uint32_t index = 0)
      : buffer(zeroed<v4l2_buffer>()), plane(zeroed<v4l2_plane>()) {
    buffer.type = type;
    buffer.index = index;
    buffer.memory = V4L2_MEMORY_MMAP;
    if (is_multi_planar()) {
      buffer.m.planes = &plane;
      buffer.length = 1;
    }
  }
  BufferArgument(const BufferArgument&) = delete;
  BufferArgument& operator=(const BufferArgument&) = delete;

  bool is_multi_planar() const { return buffer.type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE; }
  std::uint32_t length() const { return is_multi_planar() ? plane.length : buffer.length; }
  std::uint32_t offset() const { return is_multi_planar() ? plane.m.mem_offset : buffer.m.offset; }
  std::uint32_t data_begin() const { return is_multi_planar() ? plane.data_offset : 0; }
  std::uint32_t bytes_used() const { return is_multi_planar() ? plane.bytesused : buffer.bytesused; }

  v4l2_buffer buffer;
  v4l2_plane plane;
};

v4l2_requestbuffers buffer_request(std::uint32_t type, int count) {
  auto request = zeroed<v4l2_requestbuffers>();
  request.count = static_cast<std::uint32_t>(count);
  request.type = type;
  request.memory = V4L2_MEMORY_MMAP;
  return request;
}

}  // namespace

Mapping::Mapping(const FileDescriptor& fd, const std::filesystem::path& node, std::size_t length, std::uint32_t offset)
    : length_(length) {
  data_ = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, fd.get(), static_cast<off_t>(offset));
  if (data_ == MAP_FAILED) fail(node, errno, "mmap");
}

Mapping::~Mapping() {
  if (data_) ::munmap(data_, length_);
}

StreamBuffers::StreamBuffers(std::shared_ptr<const FileDescriptor> fd, const std::filesystem::path& node,
                             std::uint32_t type, int count)
    : fd_(std::move(fd)), type_(type) {
  auto request = buffer_request(type, count);
  if (const int e = call(*fd_, VIDIOC_REQBUFS, request)) fail(node, e, "REQBUFS");
  if (request.count < 2) fail(node, ENOMEM, "REQBUFS: " + std::to_string(request.count) + " buffers");
  for (std::uint32_t i = 0; i < request.count; ++i) {
    BufferArgument argument(type, i);
    if (const int e = call(*fd_, VIDIOC_QUERYBUF, argument.buffer)) fail(node, e, "QUERYBUF");
    maps_.emplace_back(*fd_, node, argument.length(), argument.offset());
  }
  places_.assign(maps_.size(), Place::here);
}

void StreamBuffers::release(const FileDescriptor& fd, std::uint32_t type) {
  auto request = buffer_request(type, 0);
  call(fd, VIDIOC_REQBUFS, request);
}

StreamBuffers::Result StreamBuffers::start() {
  if (const int e = queue_all(false)) return {e, "QBUF"};
  auto type = static_cast<int>(type_);
  // STREAMON and STREAMOFF run without the mutex: a camera that locks up takes seconds, and meanwhile readers let go of
  // its frames.
  if (const int e = call(*fd_, VIDIOC_STREAMON, type)) {
    call(*fd_, VIDIOC_STREAMOFF, type);  // returns the queued buffers
    mark_all_returned();
    return {e, "STREAMON"};
  }
  queue_all(true);  // those let go of meanwhile; the next dequeue() reports an error
  return {0, ""};
}

void StreamBuffers::stop() {
  {
    const std::scoped_lock lock(mutex_);
    if (!std::exchange(streaming_, false)) return;
  }
  auto type = static_cast<int>(type_);
  call(*fd_, VIDIOC_STREAMOFF, type);
  mark_all_returned();
}

StreamBuffers::Result StreamBuffers::dequeue(Dequeued& out) {
  BufferArgument argument(type_);
  const int error = call(*fd_, VIDIOC_DQBUF, argument.buffer);
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  if (error != 0) return {error, "DQBUF"};
  const std::uint32_t index = argument.buffer.index;
  if (index >= maps_.size()) return {EIO, "DQBUF returned an unknown buffer"};
  {
    const std::scoped_lock lock(mutex_);
    places_[index] = Place::reader;
    --queued_;
  }
  const auto mapped = maps_[index].bytes();
  const std::size_t begin = std::min<std::size_t>(argument.data_begin(), mapped.size());
  const std::size_t end = std::clamp<std::size_t>(argument.bytes_used(), begin, mapped.size());
  out.bytes = mapped.subspan(begin, end - begin);
  out.owner = std::shared_ptr<const void>(
      mapped.data(), [held_by = shared_from_this(), index](const void*) { held_by->give_back(index); });
  out.sequence = argument.buffer.sequence;
  const std::uint32_t flags = argument.buffer.flags;
  out.has_error = (flags & V4L2_BUF_FLAG_ERROR) != 0;
  const auto& stamp = argument.buffer.timestamp;
  const bool is_monotonic = (flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC &&
                            (stamp.tv_sec != 0 || stamp.tv_usec != 0);
  if (is_monotonic) {
    out.at = std::chrono::seconds(stamp.tv_sec) + std::chrono::microseconds(stamp.tv_usec);
    out.stamp = (flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE ? StampKind::start_of_exposure
                                                                                        : StampKind::end_of_frame;
  } else {
    out.at = now;
    out.stamp = StampKind::dequeued;
  }
  return {0, ""};
}

void StreamBuffers::give_back(std::uint32_t index) {
  const std::scoped_lock lock(mutex_);
  places_[index] = Place::here;
  if (streaming_) queue(index);  // the next dequeue() reports an error
}

int StreamBuffers::left_to_driver() const {
  const std::scoped_lock lock(mutex_);
  return queued_;
}

int StreamBuffers::queue(std::uint32_t index) {
  BufferArgument argument(type_, index);
  const int error = call(*fd_, VIDIOC_QBUF, argument.buffer);
  if (error != 0) return error;
  places_[index] = Place::driver;
  ++queued_;
  return 0;
}

int StreamBuffers::queue_all(bool is_streaming) {
  const std::scoped_lock lock(mutex_);
  int error = 0;
  for (std::uint32_t i = 0; i < maps_.size() && error == 0; ++i)
    if (places_[i] == Place::here) error = queue(i);
  streaming_ = is_streaming;
  return error;
}

void StreamBuffers::mark_all_returned() {
  const std::scoped_lock lock(mutex_);
  std::ranges::replace(places_, Place::driver, Place::here);
  queued_ = 0;
}

}  // namespace v4l2
}  // namespace huetrack::capture
