// Pixel formats, sizes and rates that a camera offers, and their negotiation.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "capture/frames/file_descriptor.h"
#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// The formats that we can use.
enum class CaptureFormat : std::uint8_t { yuyv, nv12, mjpeg, grey };
std::string_view name(CaptureFormat format);  // "yuyv", "nv12", "mjpeg", "grey"
std::optional<CaptureFormat> capture_format_of(std::string_view name);

struct OfferedSize {
  int width = 0, height = 0;          // the largest, where the driver gives a range
  int min_width = 0, min_height = 0;  // equal to width, height for a discrete size
  std::vector<double> fps;            // at this size, descending; both ends of a range; empty: not reported
};
struct OfferedFormat {
  std::uint32_t fourcc = 0;
  std::string description;              // the driver's
  std::optional<CaptureFormat> format;  // nullopt: we cannot use it
  std::vector<OfferedSize> sizes;       // empty: the driver does not enumerate them
};
std::string fourcc_text(std::uint32_t fourcc);  // "YUYV"

struct StreamRequest {
  // nullopt: of yuyv, nv12, mjpeg, grey that have this size, the first that reaches fps, else the fastest.
  std::optional<CaptureFormat> format;
  int width = 0, height = 0;  // pixels, > 0; any other size is a CaptureError
  double fps = 0;             // frames per second, the nearest is taken; 0: the driver's choice
  int buffers = 8;            // 4 .. 32. Readers hold some of them (see Dequeued::owner)
};
// Chooses among formats in order of preference: the first that reaches `asked` frames/s, else the fastest, the earlier
// one of nearly equal ones. rates: the highest of each; 0: not reported, counts as fast enough. asked 0: the fastest.
// nullopt: rates is empty.
std::optional<std::size_t> preferred_rate(std::span<const double> rates, double asked);

struct StreamFormat {
  CaptureFormat format = CaptureFormat::yuyv;
  int width = 0, height = 0;
  std::size_t stride = 0;  // bytes from row to row; 0 for mjpeg
  double fps = 0;          // as the driver reports; 0: it does not
  ColorRange range = ColorRange::limited;
  bool is_interlaced = false;
};

namespace v4l2 {

// buffer_type: V4L2_BUF_TYPE_VIDEO_CAPTURE or its _MPLANE. Empty: the driver does not enumerate.
std::vector<OfferedFormat> offered_formats(const FileDescriptor& fd, std::uint32_t buffer_type);
// Sets format, size and rate. throws CaptureError.
StreamFormat negotiate(const FileDescriptor& fd, const std::filesystem::path& node, std::uint32_t buffer_type,
                       const StreamRequest& request);

}  // namespace v4l2
}  // namespace huetrack::capture
