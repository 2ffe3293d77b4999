// What `huetrackd doctor` says about light: from a camera's controls, and from its pictures while it streams.
#pragma once

#include <vector>

#include "capture/frames/jpeg_decoder.h"
#include "capture/frames/light_watch.h"
#include "capture/v4l2/v4l2_device.h"
#include "doctor/camera_exam.h"
#include "doctor/doctor.h"

namespace huetrack::doctor {

// The pictures of one trial, as the driver gives them. thread-compatible.
class LightExam {
 public:
  explicit LightExam(double trial_s);
  void look(const capture::Dequeued& frame, const capture::StreamFormat& format);
  std::optional<capture::LightFindings> findings() const;  // nullopt: it has not seen enough

 private:
  capture::LightWatch watch_;
  capture::JpegDecoder jpeg_;
  std::optional<std::chrono::nanoseconds> first_;
};

// What it judges by, pure: automatics that are on, exposures that lamps do not fit into, and what the pictures say.
std::vector<Finding> judge_light(const CameraExam& exam);

}  // namespace huetrack::doctor
