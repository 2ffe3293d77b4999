#include "capture/v4l2/capture_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "capture/v4l2/v4l2_call.h"

namespace huetrack::capture {
namespace {

using v4l2::call, v4l2::fail, v4l2::refuse, v4l2::size_text, v4l2::zeroed;
namespace fs = std::filesystem;

std::string number_text(double value) {
  return fmt::format("{:g}", std::round(value * 1000) / 1000);
}

struct KnownFormat {
  CaptureFormat format;
  std::string_view name;
  std::uint32_t fourcc;
};
// In order of preference.
constexpr std::array<KnownFormat, 5> known_formats{{{CaptureFormat::yuyv, "yuyv", V4L2_PIX_FMT_YUYV},
                                                    {CaptureFormat::nv12, "nv12", V4L2_PIX_FMT_NV12},
                                                    {CaptureFormat::mjpeg, "mjpeg", V4L2_PIX_FMT_MJPEG},
                                                    {CaptureFormat::mjpeg, "mjpeg", V4L2_PIX_FMT_JPEG},
                                                    {CaptureFormat::grey, "grey", V4L2_PIX_FMT_GREY}}};

std::optional<CaptureFormat> format_of_fourcc(std::uint32_t fourcc) {
  const auto known = std::ranges::find(known_formats, fourcc, &KnownFormat::fourcc);
  return known == known_formats.end() ? std::nullopt : std::optional(known->format);
}

struct Interval {
  std::uint32_t numerator = 1, denominator = 0;  // seconds per frame
  double fps() const { return numerator == 0 ? 0 : static_cast<double>(denominator) / numerator; }
};

// Ascending intervals, so descending rates; for a range its two ends.
std::vector<Interval> intervals_of(const FileDescriptor& fd, std::uint32_t fourcc, int width, int height) {
  std::vector<Interval> intervals;
  for (std::uint32_t i = 0; i < 256; ++i) {
    auto entry = zeroed<v4l2_frmivalenum>();
    entry.index = i;
    entry.pixel_format = fourcc;
    entry.width = static_cast<std::uint32_t>(width);
    entry.height = static_cast<std::uint32_t>(height);
    if (call(fd, VIDIOC_ENUM_FRAMEINTERVALS, entry) != 0) break;
    if (entry.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      intervals.push_back({entry.discrete.numerator, entry.discrete.denominator});
      continue;
    }
    intervals.push_back({entry.stepwise.min.numerator, entry.stepwise.min.denominator});
    intervals.push_back({entry.stepwise.max.numerator, entry.stepwise.max.denominator});
    break;
  }
  std::ranges::sort(intervals, std::ranges::greater{}, &Interval::fps);
  return intervals;
}

std::vector<OfferedSize> sizes_of(const FileDescriptor& fd, std::uint32_t fourcc) {
  std::vector<OfferedSize> sizes;
  for (std::uint32_t i = 0; i < 256; ++i) {
    auto entry = zeroed<v4l2_frmsizeenum>();
    entry.index = i;
    entry.pixel_format = fourcc;
    if (call(fd, VIDIOC_ENUM_FRAMESIZES, entry) != 0) break;
    const bool is_discrete = entry.type == V4L2_FRMSIZE_TYPE_DISCRETE;
    OfferedSize size;
    size.width = static_cast<int>(is_discrete ? entry.discrete.width : entry.stepwise.max_width);
    size.height = static_cast<int>(is_discrete ? entry.discrete.height : entry.stepwise.max_height);
    size.min_width = is_discrete ? size.width : static_cast<int>(entry.stepwise.min_width);
    size.min_height = is_discrete ? size.height : static_cast<int>(entry.stepwise.min_height);
    for (const auto& interval : intervals_of(fd, fourcc, size.width, size.height)) size.fps.push_back(interval.fps());
    sizes.push_back(std::move(size));
    if (!is_discrete) break;
  }
  return sizes;
}

std::string offer_text(const std::vector<OfferedFormat>& formats) {
  std::vector<std::string> offers;
  for (const auto& format : formats) {
    if (!format.format) continue;
    std::string& text = offers.emplace_back(name(*format.format));
    for (std::size_t i = 0; i < format.sizes.size() && i < 12; ++i) {
      const auto& size = format.sizes[i];
      text += (i == 0 ? " " : ", ");
      if (size.min_width != size.width) text += size_text(size.min_width, size.min_height) + " to ";
      text += size_text(size.width, size.height);
      if (!size.fps.empty()) text += "@" + number_text(size.fps.front());
    }
    if (format.sizes.size() > 12) text += ", ...";
  }
  if (!offers.empty()) return fmt::format("it offers {}", fmt::join(offers, "; "));
  std::string text = "it offers nothing that we can use, only";
  for (const auto& format : formats) text += " " + fourcc_text(format.fourcc);
  return text;
}

bool has_size(const OfferedFormat& format, int width, int height) {
  return format.sizes.empty() || std::ranges::any_of(format.sizes, [&](const OfferedSize& size) {
           return width >= size.min_width && width <= size.width && height >= size.min_height && height <= size.height;
         });
}

// The fourcc to ask for. formats: what the driver enumerates, not empty.
std::uint32_t chosen_fourcc(const FileDescriptor& fd, const fs::path& node, const std::vector<OfferedFormat>& formats,
                            const StreamRequest& request) {
  std::vector<const KnownFormat*> candidates;
  std::vector<double> rates;
  for (const auto& known : known_formats) {
    if (request.format && *request.format != known.format) continue;
    const auto offered = std::ranges::find(formats, known.fourcc, &OfferedFormat::fourcc);
    if (offered == formats.end() || !has_size(*offered, request.width, request.height)) continue;
    const auto intervals = intervals_of(fd, known.fourcc, request.width, request.height);
    candidates.push_back(&known);
    rates.push_back(intervals.empty() ? 0 : intervals.front().fps());
  }
  if (const auto chosen = preferred_rate(rates, request.fps)) return candidates[*chosen]->fourcc;
  refuse(node, "has no " + (request.format ? std::string(name(*request.format)) + " " : std::string()) +
                   size_text(request.width, request.height) + ": " + offer_text(formats));
}

// Frames per second as the driver reports them; 0: it does not.
double negotiated_rate(const FileDescriptor& fd, std::uint32_t buffer_type, std::uint32_t fourcc,
                       const StreamRequest& request) {
  auto parameters = zeroed<v4l2_streamparm>();
  parameters.type = buffer_type;
  if (call(fd, VIDIOC_G_PARM, parameters) != 0) return 0;
  auto& capture = parameters.parm.capture;
  if (request.fps > 0 && (capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
    const double milli_fps = std::clamp(1000 * request.fps, 1.0, 1e9);  // the range of a fraction of 32 bits
    Interval wanted{1000, static_cast<std::uint32_t>(std::lround(milli_fps))};
    const auto common = std::gcd(wanted.numerator, wanted.denominator);
    wanted = {wanted.numerator / common, wanted.denominator / common};
    // prefer an exact interval of the camera to a decimal 29.97
    for (const auto& interval : intervals_of(fd, fourcc, request.width, request.height))
      if (std::abs(interval.fps() - request.fps) < 0.005 * request.fps) wanted = interval;
    capture.timeperframe = {wanted.numerator, wanted.denominator};
    call(fd, VIDIOC_S_PARM, parameters);  // the result is read below
    if (call(fd, VIDIOC_G_PARM, parameters) != 0) return 0;
  }
  return Interval{capture.timeperframe.numerator, capture.timeperframe.denominator}.fps();
}

}  // namespace

std::optional<std::size_t> preferred_rate(std::span<const double> rates, double asked) {
  constexpr double enough = 0.95, faster = 1.02;
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < rates.size(); ++i) {
    if (asked > 0 && (rates[i] <= 0 || rates[i] >= enough * asked)) return i;
    if (rates[i] <= 0) {
      if (!best) return i;
      continue;
    }
    if (!best || rates[i] > faster * rates[*best]) best = i;
  }
  return best;
}

std::string_view name(CaptureFormat format) {
  return std::ranges::find(known_formats, format, &KnownFormat::format)->name;
}

std::optional<CaptureFormat> capture_format_of(std::string_view name) {
  const auto known = std::ranges::find(known_formats, name, &KnownFormat::name);
  return known == known_formats.end() ? std::nullopt : std::optional(known->format);
}

std::string fourcc_text(std::uint32_t fourcc) {
  std::string text;
  for (int i = 0; i < 4; ++i) text += static_cast<char>(fourcc >> (8 * i) & 0x7F);
  while (text.ends_with(' ')) text.pop_back();
  return text;
}

namespace v4l2 {

std::vector<OfferedFormat> offered_formats(const FileDescriptor& fd, std::uint32_t buffer_type) {
  std::vector<OfferedFormat> formats;
  for (std::uint32_t i = 0; i < 256; ++i) {
    auto entry = zeroed<v4l2_fmtdesc>();
    entry.index = i;
    entry.type = buffer_type;
    if (call(fd, VIDIOC_ENUM_FMT, entry) != 0) break;
    formats.push_back({.fourcc = entry.pixelformat,
                       .description = text_of(entry.description),
                       .format = format_of_fourcc(entry.pixelformat),
                       .sizes = sizes_of(fd, entry.pixelformat)});
  }
  return formats;
}

StreamFormat negotiate(const FileDescriptor& fd, const fs::path& node, std::uint32_t buffer_type,
                       const StreamRequest& request) {
  const bool is_multi_planar = buffer_type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
  const auto formats = offered_formats(fd, buffer_type);
  std::uint32_t fourcc = 0;
  if (!formats.empty())
    fourcc = chosen_fourcc(fd, node, formats, request);
  else
    fourcc =
        std::ranges::find(known_formats, request.format.value_or(CaptureFormat::yuyv), &KnownFormat::format)->fourcc;

  auto format = zeroed<v4l2_format>();
  format.type = buffer_type;
  if (const int e = call(fd, VIDIOC_G_FMT, format)) fail(node, e, "G_FMT");
  const auto width = static_cast<std::uint32_t>(request.width);
  const auto height = static_cast<std::uint32_t>(request.height);
  if (is_multi_planar) {
    auto& pix = format.fmt.pix_mp;
    pix.width = width;
    pix.height = height;
    pix.pixelformat = fourcc;
    pix.field = V4L2_FIELD_NONE;
    pix.num_planes = 1;
    pix.plane_fmt[0].bytesperline = 0;  // the driver's own
    pix.plane_fmt[0].sizeimage = 0;
  } else {
    auto& pix = format.fmt.pix;
    pix.width = width;
    pix.height = height;
    pix.pixelformat = fourcc;
    pix.field = V4L2_FIELD_NONE;
    pix.bytesperline = 0;
    pix.sizeimage = 0;
  }
  if (const int e = call(fd, VIDIOC_S_FMT, format)) fail(node, e, "S_FMT");
  const auto got = [&] {
    struct Got {
      std::uint32_t fourcc, width, height, stride, field, colorspace, quantization;
    };
    const auto& mp = format.fmt.pix_mp;
    const auto& sp = format.fmt.pix;
    return is_multi_planar
               ? Got{mp.pixelformat, mp.width,      mp.height,      mp.plane_fmt[0].bytesperline,
                     mp.field,       mp.colorspace, mp.quantization}
               : Got{sp.pixelformat, sp.width, sp.height, sp.bytesperline, sp.field, sp.colorspace, sp.quantization};
  }();
  if (got.fourcc != fourcc || got.width != width || got.height != height)
    refuse(node, "was asked for " + fourcc_text(fourcc) + " " + size_text(request.width, request.height) +
                     ", and gives " + fourcc_text(got.fourcc) + " " +
                     size_text(static_cast<int>(got.width), static_cast<int>(got.height)) +
                     (formats.empty() ? std::string() : ": " + offer_text(formats)));

  StreamFormat result;
  result.format = *format_of_fourcc(fourcc);
  result.width = request.width;
  result.height = request.height;
  const bool is_jpeg = result.format == CaptureFormat::mjpeg;
  const std::size_t tight = result.format == CaptureFormat::yuyv ? std::size_t{2} * width : std::size_t{width};
  result.stride = is_jpeg ? 0 : std::max<std::size_t>(got.stride, tight);
  const bool is_full = got.quantization == V4L2_QUANTIZATION_FULL_RANGE ||
                       (got.quantization == V4L2_QUANTIZATION_DEFAULT && got.colorspace == V4L2_COLORSPACE_JPEG);
  result.range = is_full || is_jpeg ? ColorRange::full : ColorRange::limited;
  result.is_interlaced = got.field != V4L2_FIELD_NONE && got.field != V4L2_FIELD_ANY;
  result.fps = negotiated_rate(fd, buffer_type, fourcc, request);
  return result;
}

}  // namespace v4l2
}  // namespace huetrack::capture
