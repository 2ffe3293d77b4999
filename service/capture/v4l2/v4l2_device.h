// One V4L2 camera: which one it is, what it offers, its controls, and its stream of buffers. v4l2_device.cpp is the
// only file with ioctl(). Single-planar and multi-planar drivers look the same from here. At start trouble is thrown as
// CaptureError, one readable line that names the device and says what helps:
//   /dev/video2: No space left on device: that is USB bandwidth, not the disk: ...
// While streaming it is a value.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "capture/frames/capture_error.h"
#include "capture/frames/frame.h"

namespace huetrack::capture {

// ---- Which camera

// Where on the USB a device hangs, from sysfs.
struct UsbPlace {
  std::string port;       // "1-1.4": bus 1, port 1 of the root hub, port 4 of the hub there
  int bus = 0;            // cameras on one bus share its bandwidth
  double speed_mbps = 0;  // 12, 480, 5000, ...: what the device runs at
  std::string id;         // "046d:0825", vendor:product
  std::string serial;     // empty: it has none
  int interface = -1;     // of the device, that the video node belongs to; -1: unknown
};

struct V4l2Identity {
  std::filesystem::path node;          // "/dev/video0"
  std::string driver, card, bus_info;  // as VIDIOC_QUERYCAP says
  std::optional<UsbPlace> usb;
  std::vector<std::filesystem::path> by_path,
      by_id;  // the stable names of this node, /dev/v4l/by-path/..., as udev made

  // The same physical camera as far as it can be told: driver, card, and for USB vendor, product and serial number. Two
  // of one model without serial numbers cannot be told apart but by their port (bus_info), which is not compared here.
  bool is_same_camera(const V4l2Identity& other) const;
  std::string to_string() const;  // "/dev/video0 (HD Webcam C525, uvcvideo, usb-0000:00:14.0-2)"
};

// A node below /dev/video*, whether or not it can be opened: what `doctor` lists.
struct V4l2Node {
  V4l2Identity identity;    // only node, by_path, by_id and usb when it cannot be opened
  bool is_capture = false;  // gives video frames that can be streamed; false: a metadata, output or radio node
  std::string problem;      // why it cannot be opened, with what to do; empty: it can
};
std::vector<V4l2Node> list_v4l2_nodes();  // sorted by number; no exception

// The video nodes of the device on that USB port (UsbPlace::port), sorted; none is opened.
std::vector<std::filesystem::path> v4l2_nodes_at(const std::string& usb_port);

// ---- What it offers

// What a camera sends that we can use.
enum class CaptureFormat : std::uint8_t { yuyv, nv12, mjpeg, grey };
std::string_view name(CaptureFormat format);  // "yuyv", "nv12", "mjpeg", "grey"
std::optional<CaptureFormat> capture_format_of(std::string_view name);

struct OfferedSize {
  int width = 0, height = 0;          // the largest, where the driver gives a range
  int min_width = 0, min_height = 0;  // equal to width, height for a discrete size
  std::vector<double> fps;            // at this size; descending; ends of a range; empty: the driver does not say
};
struct OfferedFormat {
  std::uint32_t fourcc = 0;
  std::string description;              // the driver's
  std::optional<CaptureFormat> format;  // nullopt: we cannot use it
  std::vector<OfferedSize> sizes;
};
std::string fourcc_text(std::uint32_t fourcc);  // "YUYV"

struct StreamRequest {
  // nullopt: of yuyv, nv12, mjpeg, grey that have this size, the first that reaches fps, else the fastest.
  std::optional<CaptureFormat> format;
  int width = 0, height = 0;  // pixels, > 0: exactly these, or CaptureError
  double fps = 0;             // frames per second; 0: leave it to the driver. The nearest one is taken
  int buffers = 8;            // 4 .. 32. Readers hold some of them (see Dequeued::owner)
};
// Which of several formats, in the order in which they are preferred: the first that reaches `asked` frames/s, else the
// fastest, the earlier one when they are as good as equal. rates: the highest of each; 0: the driver does not say,
// which counts as fast enough. asked 0: the fastest. nullopt: rates is empty.
std::optional<std::size_t> preferred_rate(std::span<const double> rates, double asked);

struct StreamFormat {
  CaptureFormat format = CaptureFormat::yuyv;
  int width = 0, height = 0;
  std::size_t stride = 0;  // bytes from row to row; 0 for mjpeg
  double fps = 0;          // what the driver says that it will do; 0: it does not say
  ColorRange range = ColorRange::limited;
  bool is_interlaced = false;
};

// ---- Controls

struct ControlMenuItem {
  std::int64_t value = 0;
  std::string name;  // "Manual Mode"; for an integer menu its number
};
struct Control {
  std::uint32_t id = 0;
  std::string name;  // as v4l2-ctl writes it: "exposure_time_absolute"
  std::int64_t min = 0, max = 0, step = 1, default_value = 0;
  std::optional<std::int64_t> value;  // nullopt: cannot be read
  std::vector<ControlMenuItem> menu;  // of menus only
  bool is_boolean = false;
  bool is_64_bit = false;
  bool is_button = false;  // any value presses it; it has none to read
  bool is_read_only = false;
  bool is_write_only = false;
  bool is_inactive = false;  // another control, mostly an automatic one, rules it now
};
// By its name, or its older one: "exposure_auto". nullptr: it has none.
const Control* find_control(const std::vector<Control>& controls, std::string_view name);

// A menu entry may be given by its name; case, blanks and punctuation do not matter ("manual_mode", "50 Hz").
using ControlValue = std::variant<std::int64_t, std::string>;
struct ControlSetting {
  std::string name;
  ControlValue value;
};
// From text, as it stands in a configuration: a number, true or false (1 or 0), or else a menu entry's name.
ControlSetting control_setting(std::string name, const std::string& text);
struct ControlResult {
  std::string name;
  std::string asked;                // as text
  std::optional<std::int64_t> got;  // read back; nullopt: unreadable or not there
  std::string problem;              // refused, rounded, unknown, overruled: one sentence; empty: it stuck
  bool is_implied = false;     // nobody asked: an automatic control that had to be switched off for one that was asked
  bool is_unanswered = false;  // the camera is gone or locked up: whatever would have come after was not tried
};
std::string to_string(const ControlResult& result);  // "exposure_time_absolute: asked 100, got 100"

// ---- Streaming

// What a driver's time stamps mean.
enum class StampKind : std::uint8_t {
  start_of_exposure,  // monotonic clock
  end_of_frame,       // monotonic clock; when the last byte had come: late by exposure and transfer
  dequeued,           // the driver gives none (or on an unknown clock): when we took the frame from it
};
std::string_view name(StampKind kind);

struct Dequeued {
  std::span<const std::uint8_t> bytes;  // what the driver filled; not the buffer's size
  // Keeps bytes alive; the last holder to let go, on any thread, gives the buffer back to the driver. Outlives the
  // device. Holding one too long starves the driver: see V4l2Device::is_short_of_buffers.
  std::shared_ptr<const void> owner;
  std::chrono::nanoseconds at{0};  // CLOCK_MONOTONIC
  StampKind stamp = StampKind::dequeued;
  std::uint32_t sequence = 0;  // the driver's
  bool has_error = false;      // V4L2_BUF_FLAG_ERROR: the data may be damaged
};

enum class DequeueOutcome : std::uint8_t {
  frame,
  timeout,    // nothing came in time
  stopped,    // wake() was called
  unplugged,  // the device is gone: open it anew
  failed,     // the driver gave up (EIO, a vanished queue): restart the stream, or open it anew
};
struct DequeueResult {
  DequeueOutcome outcome = DequeueOutcome::timeout;
  Dequeued frame;       // for frame
  std::string message;  // for unplugged and failed: one readable line
};

// thread-compatible: one thread, but wake(), and the owners of frames, which may be let go anywhere at any time.
class V4l2Device {
 public:
  // path: /dev/v4l/by-path/..., /dev/v4l/by-id/..., /dev/videoN. throws CaptureError: not there, no permission, busy,
  // not a camera (a metadata node, an output).
  explicit V4l2Device(const std::filesystem::path& path);
  ~V4l2Device();  // stops the stream; buffers still held stay readable until they are let go
  V4l2Device(V4l2Device&&) noexcept;
  V4l2Device& operator=(V4l2Device&&) noexcept;

  const V4l2Identity& identity() const;
  std::vector<OfferedFormat> formats() const;  // empty: the driver does not enumerate

  std::vector<Control> controls() const;
  // Automatic controls first, so that the manual values stick; reads every one back at the end, when all have been set.
  // A manual value that an automatic control rules switches that one off, unless it is asked for itself (is_implied).
  // One result per setting, in the order asked, the implied ones at the end. Does not throw. A camera that does not
  // answer is not asked any further (is_unanswered).
  std::vector<ControlResult> set_controls(std::span<const ControlSetting> settings);
  // One after the other in the order given, nothing implied: for previous_controls(). Does not throw.
  std::vector<ControlResult> set_controls_plainly(std::span<const ControlSetting> settings);
  // Values from before the first set_controls() that changed them, in the order in which they can be set back.
  const std::vector<ControlSetting>& previous_controls() const;

  // Format, size, rate, buffers: from here on no other program can have it, and its controls are ours. Any of these
  // throws CaptureError.
  StreamFormat claim(const StreamRequest& request);
  void stream();                                     // STREAMON, after claim()
  StreamFormat start(const StreamRequest& request);  // both
  // STREAMOFF and ON again with the same buffers, those held by readers excepted: for a driver that stopped delivering.
  // False: it does not start any more; message says why.
  bool restart(std::string& message);
  void stop();  // idempotent; after claim() too

  // The next frame. Does not throw.
  DequeueResult dequeue(std::chrono::milliseconds patience);
  void wake();  // thread-safe: ends dequeue() with `stopped`, once now or the next one
  // Copy the frame and let go of it rather than hold it: fewer than three buffers are left to the driver, or it is
  // v4l2loopback, whose player writes on into buffers that were handed out.
  bool is_short_of_buffers() const;

 private:
  void release_buffers();

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// What helps against this error at this camera, as in " that is USB bandwidth, not the disk: ..."; empty when unknown.
std::string advice_for(int error_number);

}  // namespace huetrack::capture
