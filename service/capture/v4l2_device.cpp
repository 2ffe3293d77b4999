#include "capture/v4l2_device.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <mutex>
#include <numeric>
#include <utility>

#include "calib/files/config_error.h"
#include "calib/files/nearest_word.h"
#include "capture/file_descriptor.h"

namespace huetrack::capture {
namespace {

namespace fs = std::filesystem;

constexpr int least_left_to_driver = 3;  // it fills one, has one ready, and one spare

// ---- Calls

// 0, or errno.
template <typename Argument>
int call(const FileDescriptor& fd, unsigned long request, Argument& argument) {
  int result = 0;
  do {
    result = ::ioctl(fd.get(), request, &argument);
  } while (result < 0 && errno == EINTR);
  return result < 0 ? errno : 0;
}

// Of a camera that is gone or locked up, whom every further question would cost seconds: uvcvideo gives each 5 s, and
// some kernels then say EIO, which a control that is merely refused may say, too, but at once.
constexpr auto locked_up_after = std::chrono::seconds(2);
bool is_unanswered(int error, std::chrono::steady_clock::duration took) {
  return error == ENODEV || error == ENXIO || error == ESHUTDOWN || error == ETIMEDOUT ||
         (error != 0 && took >= locked_up_after);
}

template <typename Struct>
Struct zeroed() {
  Struct s;
  std::memset(&s, 0, sizeof s);  // unions and reserved fields too
  return s;
}

std::string error_line(const fs::path& node, int error, const std::string& doing) {
  std::string line = node.string() + ": " + std::generic_category().message(error);
  if (const auto advice = advice_for(error); !advice.empty()) line += ": " + advice;
  return line + " (" + doing + ")";
}

[[noreturn]] void fail(const fs::path& node, int error, const std::string& doing) {
  // EINVAL of a driver may pass; "invalid argument" is kept for what the user asked and the camera has not.
  throw CaptureError({error == EINVAL ? EIO : error, std::generic_category()}, error_line(node, error, doing));
}

[[noreturn]] void refuse(const fs::path& node, const std::string& what) {
  throw CaptureError(std::make_error_code(std::errc::invalid_argument), node.string() + ": " + what);
}

template <std::size_t N>
std::string text_of(const __u8 (&field)[N]) {
  const auto* end = std::find(std::begin(field), std::end(field), __u8{0});
  return {std::begin(field), end};
}

std::string number_text(double value) {
  return fmt::format("{:g}", std::round(value * 1000) / 1000);
}

// ---- Which camera

std::string first_line_of(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

std::optional<UsbPlace> usb_place_of(const fs::path& device_folder) {
  std::error_code error;
  const auto hex_in = [](const fs::path& file) {
    const std::string text = first_line_of(file);
    int value = -1;
    std::from_chars(text.data(), text.data() + text.size(), value, 16);
    return value;
  };
  int interface = -1;
  for (fs::path folder = fs::canonical(device_folder, error); !error && folder.has_relative_path();
       folder = folder.parent_path()) {
    if (interface < 0) interface = hex_in(folder / "bInterfaceNumber");
    if (!fs::exists(folder / "idVendor", error)) continue;
    UsbPlace place;
    place.interface = interface;
    place.port = folder.filename().string();
    place.id = first_line_of(folder / "idVendor") + ":" + first_line_of(folder / "idProduct");
    place.serial = first_line_of(folder / "serial");
    const auto number_in = [&](const char* file, auto& value) {
      const std::string text = first_line_of(folder / file);
      std::from_chars(text.data(), text.data() + text.size(), value);
    };
    number_in("busnum", place.bus);
    number_in("speed", place.speed_mbps);
    return place;
  }
  return std::nullopt;
}

std::vector<fs::path> links_to(const fs::path& node, const fs::path& folder) {
  std::vector<fs::path> links;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (std::error_code ignored; fs::canonical(entry.path(), ignored) == node) links.push_back(entry.path());
  std::ranges::sort(links);
  return links;
}

// What can be told without opening it.
V4l2Identity place_of(const fs::path& node) {
  V4l2Identity identity;
  identity.node = node;
  struct stat status {};
  if (::stat(node.c_str(), &status) == 0 && S_ISCHR(status.st_mode))
    identity.usb = usb_place_of("/sys/dev/char/" + std::to_string(major(status.st_rdev)) + ":" +
                                std::to_string(minor(status.st_rdev)) + "/device");
  identity.by_path = links_to(node, "/dev/v4l/by-path");
  identity.by_id = links_to(node, "/dev/v4l/by-id");
  return identity;
}

std::uint32_t capabilities_of(const v4l2_capability& capability) {
  // device_caps are those of this node; capabilities are those of all nodes of the device together.
  return (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps : capability.capabilities;
}

bool can_capture(std::uint32_t capabilities) {
  return (capabilities & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) != 0 &&
         (capabilities & V4L2_CAP_STREAMING) != 0;
}

struct OpenedNode {
  FileDescriptor fd;
  V4l2Identity identity;
  std::uint32_t capabilities = 0;
};

OpenedNode open_node(const fs::path& path) {
  OpenedNode opened;
  std::error_code error;
  opened.identity = place_of(fs::exists(path, error) ? fs::canonical(path, error) : path);
  opened.fd = FileDescriptor(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (opened.fd.get() < 0) fail(path, errno, "open");
  auto capability = zeroed<v4l2_capability>();
  if (const int e = call(opened.fd, VIDIOC_QUERYCAP, capability)) {
    if (e == ENOTTY || e == EINVAL) refuse(path, "is not a video device: give one of /dev/v4l/by-path/*-video-index0");
    fail(path, e, "QUERYCAP");
  }
  opened.identity.driver = text_of(capability.driver);
  opened.identity.card = text_of(capability.card);
  opened.identity.bus_info = text_of(capability.bus_info);
  opened.capabilities = capabilities_of(capability);
  return opened;
}

// ---- Formats

struct KnownFormat {
  CaptureFormat format;
  std::string_view name;
  std::uint32_t fourcc;
};
// In the order in which they are preferred.
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

std::vector<OfferedFormat> formats_of(const FileDescriptor& fd, std::uint32_t buffer_type) {
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

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
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

// ---- Buffers

class Mapping {
 public:
  Mapping(const FileDescriptor& fd, const fs::path& node, std::size_t length, std::uint32_t offset) : length_(length) {
    data_ = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, fd.get(), static_cast<off_t>(offset));
    if (data_ == MAP_FAILED) fail(node, errno, "mmap");
  }
  ~Mapping() {
    if (data_) ::munmap(data_, length_);
  }
  Mapping(Mapping&& other) noexcept : data_(std::exchange(other.data_, nullptr)), length_(other.length_) {}
  Mapping& operator=(Mapping&&) = delete;
  std::span<const std::uint8_t> bytes() const { return {static_cast<const std::uint8_t*>(data_), length_}; }

 private:
  void* data_ = nullptr;
  std::size_t length_ = 0;
};

// A v4l2_buffer, and the one plane of it that a multi-planar driver wants described apart.
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

// The mapped buffers of a stream, shared by the device and whoever still holds a frame. thread-safe.
class Buffers {
 public:
  Buffers(std::shared_ptr<const FileDescriptor> fd, const fs::path& node, std::uint32_t type, int count)
      : fd_(std::move(fd)), type_(type) {
    auto request = zeroed<v4l2_requestbuffers>();
    request.count = static_cast<std::uint32_t>(count);
    request.type = type;
    request.memory = V4L2_MEMORY_MMAP;
    if (const int e = call(*fd_, VIDIOC_REQBUFS, request)) fail(node, e, "REQBUFS");
    if (request.count < 2) fail(node, ENOMEM, "REQBUFS: " + std::to_string(request.count) + " buffers");
    for (std::uint32_t i = 0; i < request.count; ++i) {
      BufferArgument argument(type, i);
      if (const int e = call(*fd_, VIDIOC_QUERYBUF, argument.buffer)) fail(node, e, "QUERYBUF");
      maps_.emplace_back(*fd_, node, argument.length(), argument.offset());
    }
    places_.assign(maps_.size(), Place::here);
  }
  ~Buffers() { stop(); }
  Buffers(const Buffers&) = delete;
  Buffers& operator=(const Buffers&) = delete;

  // 0, or errno and the call that failed.
  std::pair<int, const char*> start() {
    if (const int e = queue_all(false)) return {e, "QBUF"};
    auto type = static_cast<int>(type_);
    // Not under the mutex, as STREAMOFF: a camera that locks up takes seconds, and readers let go of its frames
    // meanwhile.
    if (const int e = call(*fd_, VIDIOC_STREAMON, type)) {
      call(*fd_, VIDIOC_STREAMOFF, type);  // gives the queued buffers back
      all_came_back();
      return {e, "STREAMON"};
    }
    queue_all(true);  // what was let go of meanwhile; what it cannot say here, the next dequeue() will
    return {0, ""};
  }

  void stop() {
    {
      const std::scoped_lock lock(mutex_);
      if (!std::exchange(streaming_, false)) return;
    }
    auto type = static_cast<int>(type_);
    call(*fd_, VIDIOC_STREAMOFF, type);
    all_came_back();
  }

  // Of a buffer just dequeued.
  void hold(std::uint32_t index) {
    const std::scoped_lock lock(mutex_);
    places_[index] = Place::reader;
    --queued_;
  }

  void give_back(std::uint32_t index) {
    const std::scoped_lock lock(mutex_);
    places_[index] = Place::here;
    if (streaming_) queue(index);  // what it cannot say here, the next dequeue() will
  }

  int left_to_driver() const {
    const std::scoped_lock lock(mutex_);
    return queued_;
  }
  int count() const { return static_cast<int>(maps_.size()); }
  std::uint32_t type() const { return type_; }
  std::span<const std::uint8_t> bytes(std::uint32_t index) const { return maps_[index].bytes(); }

 private:
  enum class Place : std::uint8_t { here, driver, reader };

  int queue(std::uint32_t index) {  // mutex_ is held
    BufferArgument argument(type_, index);
    const int error = call(*fd_, VIDIOC_QBUF, argument.buffer);
    if (error != 0) return error;
    places_[index] = Place::driver;
    ++queued_;
    return 0;
  }
  // 0, or errno.
  int queue_all(bool is_streaming) {
    const std::scoped_lock lock(mutex_);
    int error = 0;
    for (std::uint32_t i = 0; i < maps_.size() && error == 0; ++i)
      if (places_[i] == Place::here) error = queue(i);
    streaming_ = is_streaming;
    return error;
  }
  void all_came_back() {
    const std::scoped_lock lock(mutex_);
    std::ranges::replace(places_, Place::driver, Place::here);
    queued_ = 0;
  }

  const std::shared_ptr<const FileDescriptor> fd_;
  const std::uint32_t type_;
  std::vector<Mapping> maps_;
  mutable std::mutex mutex_;
  std::vector<Place> places_;  // guarded by mutex_
  int queued_ = 0;             // guarded by mutex_; at the driver
  bool streaming_ = false;     // guarded by mutex_
};

// ---- Controls

// As v4l2-ctl does: "Exposure Time, Absolute" is exposure_time_absolute.
std::string variable_name(std::string_view text) {
  std::string name;
  bool gap = false;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) {
      gap = true;
      continue;
    }
    if (gap && !name.empty()) name += '_';
    gap = false;
    name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return name;
}

// Before Linux 5.14 or so some had other names, which tutorials still use.
constexpr std::array<std::pair<std::string_view, std::uint32_t>, 8> older_names{
    {{"exposure_auto", V4L2_CID_EXPOSURE_AUTO},
     {"exposure_absolute", V4L2_CID_EXPOSURE_ABSOLUTE},
     {"exposure_auto_priority", V4L2_CID_EXPOSURE_AUTO_PRIORITY},
     {"white_balance_temperature_auto", V4L2_CID_AUTO_WHITE_BALANCE},
     {"focus_auto", V4L2_CID_FOCUS_AUTO},
     {"gain_auto", V4L2_CID_AUTOGAIN},
     {"hue_auto", V4L2_CID_HUE_AUTO},
     {"white_balance", V4L2_CID_WHITE_BALANCE_TEMPERATURE}}};

// A manual value and the automatic control that rules it.
struct Ruled {
  std::uint32_t id, automatic;
  std::int64_t manual;  // value of the automatic control that frees it
};
constexpr std::array<Ruled, 11> ruled_controls{
    {{V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL},
     {V4L2_CID_EXPOSURE, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL},
     {V4L2_CID_WHITE_BALANCE_TEMPERATURE, V4L2_CID_AUTO_WHITE_BALANCE, 0},
     {V4L2_CID_RED_BALANCE, V4L2_CID_AUTO_WHITE_BALANCE, 0},
     {V4L2_CID_BLUE_BALANCE, V4L2_CID_AUTO_WHITE_BALANCE, 0},
     {V4L2_CID_FOCUS_ABSOLUTE, V4L2_CID_FOCUS_AUTO, 0},
     {V4L2_CID_GAIN, V4L2_CID_AUTOGAIN, 0},
     {V4L2_CID_ISO_SENSITIVITY, V4L2_CID_ISO_SENSITIVITY_AUTO, V4L2_ISO_SENSITIVITY_MANUAL},
     {V4L2_CID_HUE, V4L2_CID_HUE_AUTO, 0},
     {V4L2_CID_BRIGHTNESS, V4L2_CID_AUTOBRIGHTNESS, 0},
     {V4L2_CID_CHROMA_GAIN, V4L2_CID_CHROMA_AGC, 0}}};

const Ruled* rule_of(std::uint32_t id) {
  const auto* rule = std::ranges::find(ruled_controls, id, &Ruled::id);
  return rule == ruled_controls.end() ? nullptr : rule;
}

bool is_automatic(std::uint32_t id) {
  return std::ranges::find(ruled_controls, id, &Ruled::automatic) != ruled_controls.end();
}

// 0, or errno. value: nullopt where it cannot be read.
int read_value(const FileDescriptor& fd, Control& into) {
  auto control = zeroed<v4l2_ext_control>();
  control.id = into.id;
  auto list = zeroed<v4l2_ext_controls>();
  list.which = V4L2_CTRL_WHICH_CUR_VAL;
  list.count = 1;
  list.controls = &control;
  into.value.reset();
  if (const int e = call(fd, VIDIOC_G_EXT_CTRLS, list)) return e;
  into.value = into.is_64_bit ? control.value64 : control.value;
  return 0;
}

int set_value(const FileDescriptor& fd, std::uint32_t id, bool is_64_bit, std::int64_t value) {
  auto control = zeroed<v4l2_ext_control>();
  control.id = id;
  if (is_64_bit)
    control.value64 = value;
  else
    control.value = static_cast<std::int32_t>(value);
  auto list = zeroed<v4l2_ext_controls>();
  list.which = V4L2_CTRL_WHICH_CUR_VAL;
  list.count = 1;
  list.controls = &control;
  return call(fd, VIDIOC_S_EXT_CTRLS, list);
}

// Watches over calls that ask the camera itself.
class Patience {
 public:
  // The error that the call gave, with how long it took.
  template <typename Call>
  int watch(Call&& call) {
    const auto begun = std::chrono::steady_clock::now();
    const int error = call();
    if (is_unanswered(error, std::chrono::steady_clock::now() - begun)) end_ = error;
    return error;
  }
  bool has_ended() const { return end_ != 0; }
  int error() const { return end_; }

 private:
  int end_ = 0;
};

// All of them, without their values. Ends early when the camera does not answer.
std::vector<Control> controls_of(const FileDescriptor& fd, Patience& patience) {
  std::vector<Control> controls;
  std::uint32_t last = 0;
  while (true) {
    auto query = zeroed<v4l2_query_ext_ctrl>();
    query.id = last | V4L2_CTRL_FLAG_NEXT_CTRL;
    if (patience.watch([&] { return call(fd, VIDIOC_QUERY_EXT_CTRL, query); }) != 0 || query.id <= last) break;
    last = query.id;
    switch (query.type) {
      case V4L2_CTRL_TYPE_INTEGER:
      case V4L2_CTRL_TYPE_INTEGER64:
      case V4L2_CTRL_TYPE_BOOLEAN:
      case V4L2_CTRL_TYPE_MENU:
      case V4L2_CTRL_TYPE_INTEGER_MENU:
      case V4L2_CTRL_TYPE_BITMASK:
      case V4L2_CTRL_TYPE_BUTTON:
        break;
      default:
        continue;  // headings, strings, compound ones
    }
    if ((query.flags & V4L2_CTRL_FLAG_DISABLED) != 0) continue;
    Control control;
    control.id = query.id;
    control.name = variable_name(query.name);
    control.min = query.minimum;
    control.max = query.maximum;
    control.step = static_cast<std::int64_t>(std::max<__u64>(query.step, 1));
    control.default_value = query.default_value;
    control.is_boolean = query.type == V4L2_CTRL_TYPE_BOOLEAN;
    control.is_64_bit = query.type == V4L2_CTRL_TYPE_INTEGER64;
    control.is_button = query.type == V4L2_CTRL_TYPE_BUTTON;
    control.is_read_only = (query.flags & V4L2_CTRL_FLAG_READ_ONLY) != 0;
    control.is_write_only = (query.flags & V4L2_CTRL_FLAG_WRITE_ONLY) != 0;
    control.is_inactive = (query.flags & V4L2_CTRL_FLAG_INACTIVE) != 0;
    if (query.type == V4L2_CTRL_TYPE_MENU || query.type == V4L2_CTRL_TYPE_INTEGER_MENU)
      for (std::int64_t i = query.minimum; i <= query.maximum && i < query.minimum + 256; ++i) {
        auto item = zeroed<v4l2_querymenu>();
        item.id = query.id;
        item.index = static_cast<std::uint32_t>(i);
        if (call(fd, VIDIOC_QUERYMENU, item) != 0) continue;
        control.menu.push_back(
            {i, query.type == V4L2_CTRL_TYPE_MENU ? text_of(item.name) : std::to_string(item.value)});
      }
    controls.push_back(std::move(control));
  }
  return controls;
}

// Its value, and whether another one rules it: what changes.
void read_state(const FileDescriptor& fd, Control& control, Patience& patience) {
  if (patience.has_ended()) return;
  auto query = zeroed<v4l2_query_ext_ctrl>();
  query.id = control.id;
  if (patience.watch([&] { return call(fd, VIDIOC_QUERY_EXT_CTRL, query); }) == 0)
    control.is_inactive = (query.flags & V4L2_CTRL_FLAG_INACTIVE) != 0;
  if (!control.is_write_only && !patience.has_ended()) patience.watch([&] { return read_value(fd, control); });
}

Control* find_control(std::vector<Control>& controls, std::uint32_t id) {
  const auto found = std::ranges::find(controls, id, &Control::id);
  return found == controls.end() ? nullptr : &*found;
}

std::string value_text(const Control& control, std::int64_t value) {
  const auto item = std::ranges::find(control.menu, value, &ControlMenuItem::value);
  return std::to_string(value) + (item == control.menu.end() ? "" : " (" + item->name + ")");
}

std::string range_text(const Control& control) {
  if (control.menu.empty())
    return std::to_string(control.min) + " to " + std::to_string(control.max) +
           (control.step > 1 ? " in steps of " + std::to_string(control.step) : "");
  std::vector<std::string> values;
  for (const auto& item : control.menu) values.push_back(value_text(control, item.value));
  return fmt::format("{}", fmt::join(values, ", "));
}

// The number meant, or what is wrong with it.
std::variant<std::int64_t, std::string> number_for(const Control& control, const ControlValue& value) {
  if (const auto* number = std::get_if<std::int64_t>(&value)) {
    if (control.is_button) return *number;
    const bool is_known =
        control.menu.empty() || std::ranges::find(control.menu, *number, &ControlMenuItem::value) != control.menu.end();
    if (is_known && *number >= control.min && *number <= control.max) return *number;
    return "is out of range: it takes " + range_text(control);
  }
  const std::string& text = std::get<std::string>(value);
  const std::string wanted = variable_name(text);
  for (const auto& item : control.menu)
    if (variable_name(item.name) == wanted) return item.value;
  if (control.is_boolean) {
    if (wanted == "on" || wanted == "true" || wanted == "yes") return 1;
    if (wanted == "off" || wanted == "false" || wanted == "no") return 0;
  }
  return "'" + text + "' is none of its values: it takes " + range_text(control);
}

}  // namespace

const Control* find_control(const std::vector<Control>& controls, std::string_view name) {
  const std::string wanted = variable_name(name);
  auto found = std::ranges::find(controls, wanted, &Control::name);
  if (found == controls.end())
    if (const auto* older = std::ranges::find(older_names, wanted, &std::pair<std::string_view, std::uint32_t>::first);
        older != older_names.end())
      found = std::ranges::find(controls, older->second, &Control::id);
  return found == controls.end() ? nullptr : &*found;
}

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

// ---- Names

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

std::string_view name(StampKind kind) {
  switch (kind) {
    case StampKind::start_of_exposure:
      return "start of exposure";
    case StampKind::end_of_frame:
      return "end of frame";
    case StampKind::dequeued:
      break;
  }
  return "none by the driver, taken on arrival";
}

ControlSetting control_setting(std::string name, const std::string& text) {
  if (text == "true" || text == "false") return {std::move(name), std::int64_t{text == "true"}};
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc{} && end == text.data() + text.size()) return {std::move(name), number};
  return {std::move(name), text};
}

std::string to_string(const ControlResult& result) {
  return result.name + (result.is_implied ? ": set to " : ": asked ") + result.asked +
         (result.got ? ", got " + std::to_string(*result.got) : std::string()) +
         (result.problem.empty() ? "" : ": " + result.problem);
}

bool V4l2Identity::is_same_camera(const V4l2Identity& other) const {
  const auto usb_of = [](const V4l2Identity& identity) {
    return identity.usb ? std::pair(identity.usb->id, identity.usb->serial) : std::pair<std::string, std::string>();
  };
  return driver == other.driver && card == other.card && usb_of(*this) == usb_of(other);
}

std::string V4l2Identity::to_string() const {
  return node.string() + " (" + card + ", " + driver + ", " + bus_info +
         (usb && !usb->serial.empty() ? ", serial " + usb->serial : "") + ")";
}

std::vector<V4l2Node> list_v4l2_nodes() {
  std::vector<std::pair<int, fs::path>> paths;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/dev", error)) {
    const std::string file = entry.path().filename().string();
    int number = 0;
    if (!file.starts_with("video")) continue;
    const auto [end, problem] = std::from_chars(file.data() + 5, file.data() + file.size(), number);
    if (problem == std::errc{} && end == file.data() + file.size()) paths.emplace_back(number, entry.path());
  }
  std::ranges::sort(paths);
  std::vector<V4l2Node> nodes;
  for (const auto& [number, path] : paths) {
    V4l2Node node;
    try {
      const auto opened = open_node(path);
      node.identity = opened.identity;
      node.is_capture = can_capture(opened.capabilities);
    } catch (const CaptureError& e) {
      node.identity = place_of(path);
      node.problem = e.what();
    }
    nodes.push_back(std::move(node));
  }
  return nodes;
}

std::vector<fs::path> v4l2_nodes_at(const std::string& usb_port) {
  std::vector<fs::path> nodes;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/sys/class/video4linux", error)) {
    const auto place = usb_place_of(entry.path() / "device");
    if (place && place->port == usb_port) nodes.push_back("/dev" / entry.path().filename());
  }
  std::ranges::sort(nodes);
  return nodes;
}

namespace {

// ---- Controls that are set together

// One setting on its way to the camera.
struct ControlStep {
  std::optional<std::uint32_t> id;  // nullopt: there is nothing to set, result.problem says why
  std::int64_t value = 0;
  bool is_64_bit = false;
  int error = 0;  // that setting it gave
  ControlResult result;
};

// What V4l2Device::set_controls() does, step by step; the functions are called in the order in which they stand here.
class ControlChange {
 public:
  ControlChange(const FileDescriptor& fd, std::span<const ControlSetting> settings)
      : fd_(fd), controls_(controls_of(fd, patience_)) {
    for (const auto& setting : settings) steps_.push_back(step_for(setting));
    for (const auto& step : steps_)
      if (const Ruled* rule = step.id ? rule_of(*step.id) : nullptr)
        if (Control* automatic = find_control(controls_, rule->automatic);
            automatic && std::ranges::find(automatics_, automatic) == automatics_.end())
          automatics_.push_back(automatic);
    for (Control* automatic : automatics_) read_state(fd_, *automatic, patience_);
  }

  // What has to be manual for the values asked becomes a step of its own, where nobody said otherwise.
  void switch_off_what_rules_them() {
    const auto asked = steps_.size();
    for (std::size_t i = 0; i < asked; ++i) {
      const Ruled* rule = steps_[i].id ? rule_of(*steps_[i].id) : nullptr;
      const Control* automatic = rule ? find_control(controls_, rule->automatic) : nullptr;
      if (!automatic || automatic->value == rule->manual || automatic->is_read_only) continue;
      if (std::ranges::any_of(steps_, [&](const ControlStep& step) { return step.id == rule->automatic; })) continue;
      ControlStep step;
      step.id = automatic->id;
      step.value = rule->manual;
      step.result.name = automatic->name;
      step.result.asked = value_text(*automatic, rule->manual);
      step.result.is_implied = true;
      steps_.push_back(std::move(step));
    }
  }

  // In which they are set: as asked, the automatic ones before all others if so wanted.
  void put_in_order(bool automatics_first) {
    for (auto& step : steps_)
      if (step.id) order_.push_back(&step);
    if (automatics_first)
      std::ranges::stable_partition(order_, [](const ControlStep* step) { return is_automatic(*step->id); });
  }

  // Values that will change and are not in `previous` yet go in front of it: a value is set back before the automatic
  // control that rules it.
  void remember_values(std::vector<ControlSetting>& previous) const {
    for (const ControlStep* step : order_) {
      const Control& control = control_of(*step);
      const bool is_new =
          std::ranges::find(previous, control.name, &ControlSetting::name) == previous.end() && control.value;
      if (is_new && *control.value != step->value)
        previous.insert(previous.begin(), {.name = control.name, .value = *control.value});
    }
  }

  // Those refused are tried once more: what ruled them may only then be off.
  void set() {
    for (ControlStep* step : order_) set(*step);
    for (ControlStep* step : order_)
      if (step->error != 0 && !patience_.has_ended()) set(*step);
  }

  // After all were set, because one control may move another.
  void read_back() {
    for (const ControlStep* step : order_) read_state(fd_, control_of(*step), patience_);
    for (Control* automatic : automatics_) read_state(fd_, *automatic, patience_);
  }

  std::vector<ControlResult> take_results() {
    std::vector<ControlResult> results;
    for (auto& step : steps_) {
      if (step.id && patience_.has_ended())
        say_unanswered(step.result);
      else if (step.id)
        judge(step);
      results.push_back(std::move(step.result));
    }
    return results;
  }

 private:
  // The control that is meant, as it is now, and the number.
  ControlStep step_for(const ControlSetting& setting) {
    ControlStep step;
    ControlResult& result = step.result;
    const auto* number = std::get_if<std::int64_t>(&setting.value);
    result.name = setting.name;
    result.asked = number ? std::to_string(*number) : std::get<std::string>(setting.value);
    const Control* named = patience_.has_ended() ? nullptr : find_control(std::as_const(controls_), setting.name);
    Control* control = named ? find_control(controls_, named->id) : nullptr;
    if (control) read_state(fd_, *control, patience_);
    if (patience_.has_ended()) {
      say_unanswered(result);
    } else if (!control) {
      std::vector<std::string> names;
      for (const auto& c : controls_) names.push_back(c.name);
      const auto nearest = files::nearest_word(variable_name(setting.name), names);
      result.problem = "this camera has no such control" + (nearest ? " (did you mean " + *nearest + "?)" : "");
    } else if (control->is_read_only) {
      result.got = control->value;
      result.problem = "cannot be set: it is read-only";
    } else if (const auto meant = number_for(*control, setting.value); std::holds_alternative<std::string>(meant)) {
      result.got = control->value;
      result.problem = std::get<std::string>(meant);
    } else {
      step.id = control->id;
      step.value = std::get<std::int64_t>(meant);
      step.is_64_bit = control->is_64_bit;
    }
    return step;
  }

  void set(ControlStep& step) {
    step.error = patience_.has_ended()
                     ? patience_.error()
                     : patience_.watch([&] { return set_value(fd_, *step.id, step.is_64_bit, step.value); });
  }

  void say_unanswered(ControlResult& result) const {
    result.problem = "the camera does not answer: " + std::generic_category().message(patience_.error());
    result.is_unanswered = true;
  }

  // What came of it, by what was read back.
  void judge(ControlStep& step) {
    const Control& control = control_of(step);
    ControlResult& result = step.result;
    result.got = control.value;
    const Ruled* rule = rule_of(control.id);
    const Control* automatic = rule ? find_control(controls_, rule->automatic) : nullptr;
    const std::string ruled_by = automatic && automatic->value && *automatic->value != rule->manual
                                     ? ": " + automatic->name + " is " + value_text(*automatic, *automatic->value) +
                                           ", set it to " + value_text(*automatic, rule->manual)
                                     : std::string();
    if (step.error != 0)
      result.problem = "the camera refuses it: " + std::generic_category().message(step.error) + ruled_by;
    else if (!control.value)
      return;  // write-only, such as a button: nothing to hold it to
    else if (*control.value != step.value)
      result.problem = "the camera made it " + value_text(control, *control.value) + " (it takes " +
                       range_text(control) + ")" + ruled_by;
    else if (!ruled_by.empty() && control.is_inactive)
      result.problem = "has no effect now" + ruled_by;
  }

  const Control& control_of(const ControlStep& step) const {
    return *std::ranges::find(controls_, *step.id, &Control::id);
  }
  Control& control_of(const ControlStep& step) { return *find_control(controls_, *step.id); }

  const FileDescriptor& fd_;
  Patience patience_;  // before controls_, which are asked under it
  std::vector<Control> controls_;
  std::vector<ControlStep> steps_;    // those asked, then the implied ones
  std::vector<Control*> automatics_;  // that rule those asked; in controls_
  std::vector<ControlStep*> order_;   // in steps_, which does not grow any more
};

}  // namespace

// ---- The device

struct V4l2Device::Impl {
  explicit Impl(const fs::path& path) : wake(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (wake.get() < 0) fail(path, errno, "eventfd");
    auto opened = open_node(path);
    identity = std::move(opened.identity);
    fd = std::make_shared<const FileDescriptor>(std::move(opened.fd));
    if (!can_capture(opened.capabilities)) {
      // A v4l2loopback becomes a camera only once something plays into it.
      if (is_loopback()) fail(path, ENODEV, "nothing plays into this v4l2loopback device");
      refuse(path, "(" + identity.card +
                       ") gives no video frames: many cameras have a second node for metadata. Take " +
                       "the one that ends in -video-index0 in /dev/v4l/by-path/");
    }
    buffer_type = (opened.capabilities & V4L2_CAP_VIDEO_CAPTURE) != 0 ? V4L2_BUF_TYPE_VIDEO_CAPTURE
                                                                      : V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
  }

  bool is_multi_planar() const { return buffer_type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE; }
  bool is_loopback() const { return identity.driver == "v4l2 loopback"; }

  StreamFormat negotiate(const StreamRequest& request) {
    const auto formats = formats_of(*fd, buffer_type);
    std::uint32_t fourcc = 0;
    if (!formats.empty())
      fourcc = chosen_fourcc(*fd, identity.node, formats, request);
    else
      fourcc =
          std::ranges::find(known_formats, request.format.value_or(CaptureFormat::yuyv), &KnownFormat::format)->fourcc;

    auto format = zeroed<v4l2_format>();
    format.type = buffer_type;
    if (const int e = call(*fd, VIDIOC_G_FMT, format)) fail(identity.node, e, "G_FMT");
    const auto width = static_cast<std::uint32_t>(request.width);
    const auto height = static_cast<std::uint32_t>(request.height);
    if (is_multi_planar()) {
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
    if (const int e = call(*fd, VIDIOC_S_FMT, format)) fail(identity.node, e, "S_FMT");
    const auto got = [&] {
      struct Got {
        std::uint32_t fourcc, width, height, stride, field, colorspace, quantization;
      };
      const auto& mp = format.fmt.pix_mp;
      const auto& sp = format.fmt.pix;
      return is_multi_planar()
                 ? Got{mp.pixelformat, mp.width,      mp.height,      mp.plane_fmt[0].bytesperline,
                       mp.field,       mp.colorspace, mp.quantization}
                 : Got{sp.pixelformat, sp.width, sp.height, sp.bytesperline, sp.field, sp.colorspace, sp.quantization};
    }();
    if (got.fourcc != fourcc || got.width != width || got.height != height)
      refuse(identity.node, "was asked for " + fourcc_text(fourcc) + " " + size_text(request.width, request.height) +
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
    result.fps = negotiate_rate(fourcc, request);
    return result;
  }

  double negotiate_rate(std::uint32_t fourcc, const StreamRequest& request) {
    auto parameters = zeroed<v4l2_streamparm>();
    parameters.type = buffer_type;
    if (call(*fd, VIDIOC_G_PARM, parameters) != 0) return 0;
    auto& capture = parameters.parm.capture;
    if (request.fps > 0 && (capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
      const double milli_fps = std::clamp(1000 * request.fps, 1.0, 1e9);  // what a fraction of 32 bits can say
      Interval wanted{1000, static_cast<std::uint32_t>(std::lround(milli_fps))};
      const auto common = std::gcd(wanted.numerator, wanted.denominator);
      wanted = {wanted.numerator / common, wanted.denominator / common};
      // an exact one that the camera lists, rather than our decimal notion of 29.97
      for (const auto& interval : intervals_of(*fd, fourcc, request.width, request.height))
        if (std::abs(interval.fps() - request.fps) < 0.005 * request.fps) wanted = interval;
      capture.timeperframe = {wanted.numerator, wanted.denominator};
      call(*fd, VIDIOC_S_PARM, parameters);  // what it does all the same is read below
      if (call(*fd, VIDIOC_G_PARM, parameters) != 0) return 0;
    }
    return Interval{capture.timeperframe.numerator, capture.timeperframe.denominator}.fps();
  }

  struct Failed {
    DequeueOutcome outcome;
    std::string message;
  };
  DequeueResult ended(int error, const std::string& doing) const {
    const bool is_gone = error == ENODEV || error == ENXIO;
    return {.outcome = is_gone ? DequeueOutcome::unplugged : DequeueOutcome::failed,
            .frame = {},
            .message = std::generic_category().message(error) + " (" + doing + ")"};
  }

  DequeueResult dequeue(std::chrono::milliseconds patience) {
    if (!buffers) return ended(EINVAL, "DQBUF without a stream");
    std::array<pollfd, 2> waiting{{{fd->get(), POLLIN, 0}, {wake.get(), POLLIN, 0}}};
    const int ready = ::poll(waiting.data(), waiting.size(), static_cast<int>(patience.count()));
    if (ready < 0) return errno == EINTR ? DequeueResult{} : ended(errno, "poll");
    if ((waiting[1].revents & POLLIN) != 0) {
      std::uint64_t count = 0;
      if (::read(wake.get(), &count, sizeof count) > 0)
        return {.outcome = DequeueOutcome::stopped, .frame = {}, .message = {}};
    }
    if (ready == 0) return {};

    BufferArgument argument(buffers->type());
    const int error = call(*fd, VIDIOC_DQBUF, argument.buffer);
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    if (error == EAGAIN) {
      // ready, and yet nothing: a queue that is in error would make us spin
      if ((waiting[0].revents & (POLLERR | POLLHUP)) != 0)
        return ended((waiting[0].revents & POLLHUP) != 0 ? ENODEV : EIO, "poll");
      return {};
    }
    if (error != 0) return ended(error, "DQBUF");
    const std::uint32_t index = argument.buffer.index;
    if (index >= static_cast<std::uint32_t>(buffers->count())) return ended(EIO, "DQBUF gave a buffer that is none");
    buffers->hold(index);

    DequeueResult result{.outcome = DequeueOutcome::frame, .frame = {}, .message = {}};
    Dequeued& frame = result.frame;
    const auto mapped = buffers->bytes(index);
    const std::size_t begin = std::min<std::size_t>(argument.data_begin(), mapped.size());
    const std::size_t end = std::clamp<std::size_t>(argument.bytes_used(), begin, mapped.size());
    frame.bytes = mapped.subspan(begin, end - begin);
    frame.owner = std::shared_ptr<const void>(mapped.data(),
                                              [held_by = buffers, index](const void*) { held_by->give_back(index); });
    frame.sequence = argument.buffer.sequence;
    frame.has_error = (argument.buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
    const auto& stamp = argument.buffer.timestamp;
    const bool is_monotonic =
        (argument.buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC &&
        (stamp.tv_sec != 0 || stamp.tv_usec != 0);
    if (is_monotonic) {
      frame.at = std::chrono::seconds(stamp.tv_sec) + std::chrono::microseconds(stamp.tv_usec);
      frame.stamp = (argument.buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE
                        ? StampKind::start_of_exposure
                        : StampKind::end_of_frame;
    } else {
      frame.at = now;
      frame.stamp = StampKind::dequeued;
    }
    return result;
  }

  // Settings in the order given; results in the same order.
  std::vector<ControlResult> apply(std::span<const ControlSetting> settings, bool helps) {
    if (settings.empty()) return {};
    ControlChange change(*fd, settings);
    if (helps) change.switch_off_what_rules_them();
    change.put_in_order(helps);
    if (helps) change.remember_values(previous);
    change.set();
    change.read_back();
    return change.take_results();
  }

  FileDescriptor wake;
  std::shared_ptr<const FileDescriptor> fd;
  V4l2Identity identity;
  std::uint32_t buffer_type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  std::shared_ptr<Buffers> buffers;  // while streaming
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
  return formats_of(*impl_->fd, impl_->buffer_type);
}

std::vector<Control> V4l2Device::controls() const {
  Patience patience;
  auto controls = controls_of(*impl_->fd, patience);
  for (auto& control : controls)
    if (!control.is_write_only && !patience.has_ended())
      patience.watch([&] { return read_value(*impl_->fd, control); });
  return controls;
}

std::vector<ControlResult> V4l2Device::set_controls(std::span<const ControlSetting> settings) {
  return impl_->apply(settings, true);
}

std::vector<ControlResult> V4l2Device::set_controls_plainly(std::span<const ControlSetting> settings) {
  return impl_->apply(settings, false);
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
    refuse(impl_->identity.node, "cannot be asked for " + size_text(request.width, request.height) + " pixels");
  stop();
  const StreamFormat format = impl_->negotiate(request);
  try {
    impl_->buffers = std::make_shared<Buffers>(impl_->fd, impl_->identity.node, impl_->buffer_type, request.buffers);
  } catch (const CaptureError& error) {
    if (error.code().value() != EBUSY) release_buffers();  // busy: those of another program
    throw;
  }
  return format;
}

void V4l2Device::stream() {
  if (!impl_->buffers) fail(impl_->identity.node, EINVAL, "STREAMON without buffers");
  const auto [error, what] = impl_->buffers->start();
  if (error == 0) return;
  stop();
  fail(impl_->identity.node, error, what);
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
  release_buffers();
}

void V4l2Device::release_buffers() {
  // Fails with EBUSY while readers hold some; then the next REQBUFS of this node does, until they let go.
  auto request = zeroed<v4l2_requestbuffers>();
  request.type = impl_->buffer_type;
  request.memory = V4L2_MEMORY_MMAP;
  call(*impl_->fd, VIDIOC_REQBUFS, request);
}

DequeueResult V4l2Device::dequeue(std::chrono::milliseconds patience) {
  return impl_->dequeue(patience);
}

void V4l2Device::wake() {
  const std::uint64_t one = 1;
  // Fails only when it has been woken 2^64 - 2 times already.
  [[maybe_unused]] const auto written = ::write(impl_->wake.get(), &one, sizeof one);
}

bool V4l2Device::is_short_of_buffers() const {
  return impl_->buffers && (impl_->is_loopback() || impl_->buffers->left_to_driver() < least_left_to_driver);
}

}  // namespace huetrack::capture
