// Which camera a device node is.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "capture/frames/file_descriptor.h"

namespace huetrack::capture {

// A device's place on the USB, from sysfs.
struct UsbPlace {
  std::string port;       // "1-1.4": bus 1, port 1 of the root hub, port 4 of the hub there
  int bus = 0;            // cameras on one bus share its bandwidth
  double speed_mbps = 0;  // 12, 480, 5000, ...: the speed that the device runs at
  std::string id;         // "046d:0825", vendor:product
  std::string serial;     // empty: the device has none
  int interface = -1;     // of the device, that the video node belongs to; -1: unknown
};

struct V4l2Identity {
  std::filesystem::path node;          // "/dev/video0"
  std::string driver, card, bus_info;  // from VIDIOC_QUERYCAP
  std::optional<UsbPlace> usb;
  std::vector<std::filesystem::path> by_path, by_id;  // udev's stable names of this node, /dev/v4l/by-path/...

  // Compares driver, card, and for USB vendor, product and serial number. Two cameras of one model without serial
  // numbers differ only by their port (bus_info), which is not compared.
  bool is_same_camera(const V4l2Identity& other) const;
  std::string to_string() const;  // "/dev/video0 (HD Webcam C525, uvcvideo, usb-0000:00:14.0-2)"
};

// One /dev/video* node, for `doctor`.
struct V4l2Node {
  V4l2Identity identity;    // only node, by_path, by_id and usb when it cannot be opened
  bool is_capture = false;  // streams video frames; false: a metadata, output or radio node
  std::string problem;      // why it cannot be opened, and advice; empty: it can
};
std::vector<V4l2Node> list_v4l2_nodes();  // sorted by number; does not throw

// The video nodes of the device on that USB port (UsbPlace::port), sorted. Opens none.
std::vector<std::filesystem::path> v4l2_nodes_at(const std::string& usb_port);

namespace v4l2 {

struct OpenedNode {
  FileDescriptor fd;
  V4l2Identity identity;
  std::uint32_t capabilities = 0;  // V4L2_CAP_...
};
OpenedNode open_node(const std::filesystem::path& path);  // throws CaptureError
bool can_capture(std::uint32_t capabilities);

}  // namespace v4l2
}  // namespace huetrack::capture
