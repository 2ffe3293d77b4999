#include "capture/cropped_source.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace huetrack::capture {
namespace {

bool is_even(const Crop& crop) {
  return crop.u % 2 == 0 && crop.v % 2 == 0 && crop.width % 2 == 0 && crop.height % 2 == 0;
}

bool is_same_device(const CameraRequest& a, const CameraRequest& b) {
  const auto is_same = [](const ControlSetting& x, const ControlSetting& y) {
    return x.name == y.name && x.value == y.value;
  };
  return a.format == b.format && a.width == b.width && a.height == b.height && a.fps == b.fps &&
         std::ranges::equal(a.controls, b.controls, is_same) && a.restore_controls == b.restore_controls;
}

}  // namespace

std::vector<SharedDevice> by_device(std::span<const CameraRequest> requests) {
  std::vector<SharedDevice> devices;
  for (const CameraRequest& request : requests) {
    auto device = devices.end();
    if (request.crop)
      device = std::ranges::find_if(
          devices, [&](const SharedDevice& d) { return !d.parts.empty() && d.options.device == request.device; });
    if (device == devices.end()) {
      device = devices.insert(devices.end(), {request, {}});
      if (request.crop) device->options.timing = {};
    } else {
      device->options.name += "+" + request.name;
    }
    if (request.crop) device->parts.push_back({request.camera, *request.crop, request.timing});
  }
  return devices;
}

std::string problem_of(std::span<const CameraRequest> requests) {
  for (const CameraRequest& request : requests) {
    if (request.crop) {
      if (const auto outside = problem_of(*request.crop, PixelFormat::grey, request.width, request.height);
          !outside.empty())
        return "camera " + request.name + ": " + outside;
      if (!is_even(*request.crop))
        return "camera " + request.name + ": crop " + text_of(*request.crop) +
               " must be even numbers, because neighbouring pixels of a camera share their colour";
    }
    for (const CameraRequest& other : requests) {
      if (&other == &request) break;
      if (other.device != request.device) continue;
      if (!request.crop || !other.crop)
        return "camera " + request.name + " has the device of " + other.name +
               ": cameras that share a device need a crop each, their part of its picture";
      if (!is_same_device(request, other))
        return "cameras " + other.name + " and " + request.name +
               " share a device, which has one format, size, fps, controls and restore_controls: give both the same";
    }
  }
  return {};
}

CroppedSource::CroppedSource(std::unique_ptr<FrameSource> device, std::vector<CroppedPart> parts)
    : device_(std::move(device)), parts_(std::move(parts)) {
  if (parts_.empty()) throw std::invalid_argument("CroppedSource: there are no parts");
}

std::optional<Frame> CroppedSource::next(std::stop_token stop) {
  if (waiting_.empty()) {
    const auto whole = device_->next(std::move(stop));
    if (!whole) return std::nullopt;
    for (const CroppedPart& part : parts_) waiting_.push_back(part_of(*whole, part));
  }
  Frame frame = std::move(waiting_.front());
  waiting_.pop_front();
  return frame;
}

Frame CroppedSource::part_of(const Frame& whole, const CroppedPart& part) const {
  Frame frame = whole;
  frame.camera = part.camera;
  frame.captured_at -= part.timing.latency;
  frame.latency = part.timing.latency;
  frame.readout = part.timing.readout;
  frame.encoded = nullptr;
  if (!has_pixels(whole.pixels)) return frame;
  if (problem_of(part.crop, whole.pixels.format, whole.pixels.width, whole.pixels.height).empty()) {
    frame.pixels = cropped(whole.pixels, part.crop);
  } else {  // the device delivers another size than it promised
    frame.status = FrameStatus::corrupted;
    frame.pixels = {};
  }
  return frame;
}

}  // namespace huetrack::capture
