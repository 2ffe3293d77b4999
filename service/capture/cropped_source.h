// Cameras that share one device: side-by-side stereo webcams, whose picture holds those of two sensors.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/frames/crop.h"
#include "capture/frames/frame_source.h"
#include "capture/v4l2_source.h"

namespace huetrack::capture {

// A camera of this host, as a configuration asks for it.
struct CameraRequest : V4l2SourceOptions {
  std::optional<Crop> crop;  // its part of the device's picture, whose size is width x height; nullopt: all of it
};

// A camera's part of a device's picture.
struct CroppedPart {
  int camera = 0;  // Frame::camera
  Crop crop;
  FrameTiming timing;  // of the part: its middle row, its first and last row
};

// A device to open once.
struct SharedDevice {
  V4l2SourceOptions options;       // with parts: without timing
  std::vector<CroppedPart> parts;  // empty: the picture is one camera's
};

// Requests for the same device path become one, in the order of their first. The requests of a device must agree in all
// but camera, name, crop and timing.
std::vector<SharedDevice> by_device(std::span<const CameraRequest> requests);

// One sentence on what is wrong with these requests, without a file; empty: nothing.
std::string problem_of(std::span<const CameraRequest> requests);

// Delivers a frame per part for every frame of the device: same stamps, sequence and status, without a copy. The
// pixels' JPEG bytes are those of the whole picture, so a part has none (Frame::encoded).
class CroppedSource final : public FrameSource {
 public:
  // device: its frames have no latency and readout. parts: at least one
  CroppedSource(std::unique_ptr<FrameSource> device, std::vector<CroppedPart> parts);

  std::optional<Frame> next(std::stop_token stop) override;

 private:
  Frame part_of(const Frame& whole, const CroppedPart& part) const;

  std::unique_ptr<FrameSource> device_;
  std::vector<CroppedPart> parts_;
  std::deque<Frame> waiting_;
};

}  // namespace huetrack::capture
