#include "capture/v4l2/v4l2_call.h"

#include <sys/ioctl.h>

#include <cerrno>

#include "capture/v4l2/v4l2_device.h"

namespace huetrack::capture {

std::string advice_for(int error_number) {
  switch (error_number) {
    case ENOSPC:
      return "that is USB bandwidth, not the disk: the cameras on this USB bus want more than it has. Use format: "
             "mjpeg, a lower rate or size, or plug the camera into a port of another USB controller (lsusb -t shows "
             "the buses); for yuyv, also the uvcvideo module option quirks=128";
    case EACCES:
    case EPERM:
      return "add the user to the group video (sudo usermod -aG video NAME, then log in anew); for a service, "
             "SupplementaryGroups=video";
    case EBUSY:
      return "another program uses it (fuser -v on the device names it)";
    case ENOENT:
    case ENXIO:
    case ENODEV:
      return "it is not plugged in, or has another name (ls -l /dev/v4l/by-path/)";
    case EIO:
    case EPROTO:
    case EILSEQ:
    case ETIMEDOUT:
      return "the camera does not answer as it should: try another cable or port, or a powered hub";
    default:
      return {};
  }
}

namespace v4l2 {

int call_driver(const FileDescriptor& fd, unsigned long request, void* argument) {
  int result = 0;
  do {
    result = ::ioctl(fd.get(), request, argument);
  } while (result < 0 && errno == EINTR);
  return result < 0 ? errno : 0;
}

void fail(const std::filesystem::path& node, int error, const std::string& doing) {
  std::string line = node.string() + ": " + std::generic_category().message(error);
  if (const auto advice = advice_for(error); !advice.empty()) line += ": " + advice;
  // A driver's EINVAL may pass; "invalid argument" is reserved for a request that the camera cannot fulfil.
  throw CaptureError({error == EINVAL ? EIO : error, std::generic_category()}, line + " (" + doing + ")");
}

void refuse(const std::filesystem::path& node, const std::string& what) {
  throw CaptureError(std::make_error_code(std::errc::invalid_argument), node.string() + ": " + what);
}

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

bool AnswerWatch::is_unanswered(int error, std::chrono::steady_clock::duration took) {
  constexpr auto locked_up_after = std::chrono::seconds(2);
  return error == ENODEV || error == ENXIO || error == ESHUTDOWN || error == ETIMEDOUT ||
         (error != 0 && took >= locked_up_after);
}

}  // namespace v4l2
}  // namespace huetrack::capture
