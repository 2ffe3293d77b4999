#include "capture/v4l2/camera_identity.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fstream>

#include "capture/frames/capture_error.h"
#include "capture/v4l2/v4l2_call.h"

namespace huetrack::capture {
namespace {

namespace fs = std::filesystem;

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

// What is known without opening it.
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

}  // namespace

namespace v4l2 {

bool can_capture(std::uint32_t capabilities) {
  return (capabilities & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) != 0 &&
         (capabilities & V4L2_CAP_STREAMING) != 0;
}

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
  // device_caps are those of this node; capabilities are those of all nodes of the device together.
  opened.capabilities =
      (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps : capability.capabilities;
  return opened;
}

}  // namespace v4l2

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
      const auto opened = v4l2::open_node(path);
      node.identity = opened.identity;
      node.is_capture = v4l2::can_capture(opened.capabilities);
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

}  // namespace huetrack::capture
