// Calls to a V4L2 driver and their errors, for the files of this module. v4l2_call.cpp is the only file that calls
// ioctl().
#pragma once

#include <linux/videodev2.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <string>

#include "capture/frames/file_descriptor.h"

namespace huetrack::capture::v4l2 {

// ioctl(), repeated after a signal. Returns 0, or errno.
int call_driver(const FileDescriptor& fd, unsigned long request, void* argument);
template <typename Argument>
int call(const FileDescriptor& fd, unsigned long request, Argument& argument) {
  return call_driver(fd, request, &argument);
}

template <typename Struct>
Struct zeroed() {
  Struct s;
  std::memset(&s, 0, sizeof s);  // unions and reserved fields too
  return s;
}

template <std::size_t N>
std::string text_of(const __u8 (&field)[N]) {
  return {std::begin(field), std::find(std::begin(field), std::end(field), __u8{0})};
}

// CaptureError of a system error, with advice. doing: the call that failed.
[[noreturn]] void fail(const std::filesystem::path& node, int error, const std::string& doing);
// CaptureError std::errc::invalid_argument: the camera cannot do what was asked.
[[noreturn]] void refuse(const std::filesystem::path& node, const std::string& what);

std::string size_text(int width, int height);  // "640x480"

// Detects a camera that is gone or locked up, so that it is not asked again: uvcvideo waits 5 s for each answer. Some
// kernels then return EIO, which a merely refused control may return, too, but at once.
class AnswerWatch {
 public:
  // Runs `call`, which returns 0 or errno; returns its result.
  template <typename Call>
  int watch(Call&& call) {
    const auto begun = std::chrono::steady_clock::now();
    const int error = call();
    if (is_unanswered(error, std::chrono::steady_clock::now() - begun)) error_ = error;
    return error;
  }
  bool has_given_up() const { return error_ != 0; }
  int error() const { return error_; }

 private:
  static bool is_unanswered(int error, std::chrono::steady_clock::duration took);
  int error_ = 0;
};

}  // namespace huetrack::capture::v4l2
