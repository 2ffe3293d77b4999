// The exception that cameras and recordings throw at start when a device or file is at fault.
#pragma once

#include <stdexcept>
#include <string>
#include <system_error>

namespace huetrack::capture {

// what() is one readable line that names the device or file, the problem, and what to do.
class CaptureError : public std::runtime_error {
 public:
  CaptureError(std::error_code code, const std::string& what) : std::runtime_error(what), code_(code) {}
  // errno. std::errc::invalid_argument: the camera works, but cannot do what was asked; do not retry.
  const std::error_code& code() const noexcept { return code_; }

 private:
  std::error_code code_;
};

}  // namespace huetrack::capture
