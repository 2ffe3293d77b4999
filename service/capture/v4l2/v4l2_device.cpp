#include "capture/v4l2/v4l2_device.h"

#include <linux/videodev2.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <utility>

#include "capture/v4l2/v4l2_call.h"

namespace huetrack::capture {
namespace {

namespace fs = std::filesystem;

constexpr int least_left_to_driver = 3;  // capacity: it fills one, has one ready, and one spare

DequeueResult failed(int error, const std::string& doing) {
  const bool is_gone = error == ENODEV || error == ENXIO;
  return {.outcome = is_gone ? DequeueOutcome::unplugged : DequeueOutcome::failed,
          .message = std::generic_category().message(error) + " (" + doing + ")"};
}

}  // namespace

struct V4l2Device::Impl {
  explicit Impl(const fs::path& path) : wake(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (wake.get() < 0) v4l2::fail(path, errno, "eventfd");
    auto opened = v4l2::open_node(path);
    identity = std::move(opened.identity);
    fd = std::make_shared<const FileDescriptor>(std::move(opened.fd));
    if (!v4l2::can_capture(opened.capabilities)) {
      // A v4l2loopback becomes a camera only once something plays into it.
      if (is_loopback()) v4l2::fail(path, ENODEV, "nothing plays into this v4l2loopback device");
      v4l2::refuse(path, "(" + identity.card +
                             ") gives no video frames: many cameras have a second node for metadata. Take the one that "
                             "ends in -video-index0 in /dev/v4l/by-path/");
    }
    buffer_type = (opened.capabilities & V4L2_CAP_VIDEO_CAPTURE) != 0 ? V4L2_BUF_TYPE_VIDEO_CAPTURE
                                                                      : V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
  }

  bool is_loopback() const { return identity.driver == "v4l2 loopback"; }
  void release_buffers() const { v4l2::StreamBuffers::release(*fd, buffer_type); }

  DequeueResult dequeue(std::chrono::milliseconds patience) {
    if (!buffers) return failed(EINVAL, "DQBUF without a stream");
    std::array<pollfd, 2> waiting{{{fd->get(), POLLIN, 0}, {wake.get(), POLLIN, 0}}};
    const int ready = ::poll(waiting.data(), waiting.size(), static_cast<int>(patience.count()));
    if (ready < 0) return errno == EINTR ? DequeueResult{} : failed(errno, "poll");
    if ((waiting[1].revents & POLLIN) != 0) {
      std::uint64_t count = 0;
      if (::read(wake.get(), &count, sizeof count) > 0) return {.outcome = DequeueOutcome::stopped};
    }
    if (ready == 0) return {};

    DequeueResult result{.outcome = DequeueOutcome::frame};
    const auto [error, doing] = buffers->dequeue(result.frame);
    if (error == 0) return result;
    if (error != EAGAIN) return failed(error, doing);
    // Ready, and yet no frame: a queue in error would make us spin.
    if ((waiting[0].revents & (POLLERR | POLLHUP)) == 0) return {};
    return failed((waiting[0].revents & POLLHUP) != 0 ? ENODEV : EIO, "poll");
  }

  FileDescriptor wake;
  std::shared_ptr<const FileDescriptor> fd;
  V4l2Identity identity;
  std::uint32_t buffer_type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  std::shared_ptr<v4l2::StreamBuffers> buffers;  // while streaming
  std::vector<ControlSetting> previous;
};

V4l2Device::V4l2Device(const fs::path& path) : impl_(std::make_unique<Impl>(path)) {}
V4l2Device::~V4l2Device() {
  if (impl_) stop();
}
V4l2Device::V4l2Device(V4l2Device&&) noexcept = default;
V4l2Device& V4l2Device::operator=(V4l2Device&& other) noexcept {
  std::swap(impl_, other.impl_);
  return *this;
}

const V4l2Identity& V4l2Device::identity() const {
  return impl_->identity;
}

std::vector<OfferedFormat> V4l2Device::formats() const {
  return v4l2::offered_formats(*impl_->fd, impl_->buffer_type);
}

std::vector<Control> V4l2Device::controls() const {
  return v4l2::read_controls(*impl_->fd);
}

std::vector<ControlResult> V4l2Device::set_controls(std::span<const ControlSetting> settings) {
  return v4l2::apply_controls(*impl_->fd, settings, true, impl_->previous);
}

std::vector<ControlResult> V4l2Device::set_controls_plainly(std::span<const ControlSetting> settings) {
  return v4l2::apply_controls(*impl_->fd, settings, false, impl_->previous);
}

const std::vector<ControlSetting>& V4l2Device::previous_controls() const {
  return impl_->previous;
}

StreamFormat V4l2Device::start(const StreamRequest& request) {
  const StreamFormat format = claim(request);
  stream();
  return format;
}

StreamFormat V4l2Device::claim(const StreamRequest& request) {
  if (request.width < 1 || request.height < 1 || request.width > 32768 || request.height > 32768)
    v4l2::refuse(impl_->identity.node,
                 "cannot be asked for " + v4l2::size_text(request.width, request.height) + " pixels");
  stop();
  const StreamFormat format = v4l2::negotiate(*impl_->fd, impl_->identity.node, impl_->buffer_type, request);
  try {
    impl_->buffers =
        std::make_shared<v4l2::StreamBuffers>(impl_->fd, impl_->identity.node, impl_->buffer_type, request.buffers);
  } catch (const CaptureError& error) {
    if (error.code().value() != EBUSY) impl_->release_buffers();  // busy: another program streams
    throw;
  }
  return format;
}

void V4l2Device::stream() {
  if (!impl_->buffers) v4l2::fail(impl_->identity.node, EINVAL, "STREAMON without buffers");
  const auto [error, what] = impl_->buffers->start();
  if (error == 0) return;
  stop();
  v4l2::fail(impl_->identity.node, error, what);
}

bool V4l2Device::restart(std::string& message) {
  if (!impl_->buffers) {
    message = "there is no stream";
    return false;
  }
  impl_->buffers->stop();
  const auto [error, what] = impl_->buffers->start();
  if (error != 0) message = std::generic_category().message(error) + " (" + what + ")";
  return error == 0;
}

void V4l2Device::stop() {
  if (!impl_->buffers) return;
  impl_->buffers->stop();
  impl_->buffers.reset();
  impl_->release_buffers();
}

DequeueResult V4l2Device::dequeue(std::chrono::milliseconds patience) {
  return impl_->dequeue(patience);
}

void V4l2Device::wake() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(impl_->wake.get(), &one, sizeof one);
}

bool V4l2Device::is_short_of_buffers() const {
  return impl_->buffers && (impl_->is_loopback() || impl_->buffers->left_to_driver() < least_left_to_driver);
}

}  // namespace huetrack::capture
