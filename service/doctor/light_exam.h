// Examines light for `huetrackd doctor`: a camera's controls, and its pictures while it streams.
#pragma once

#include <vector>

#include "capture/frames/light_watch.h"
#include "capture/jpeg/jpeg_reader.h"
#include "capture/v4l2/v4l2_device.h"
#include "doctor/camera_exam.h"
#include "doctor/doctor.h"

namespace huetrack::doctor {

// Analyses the pictures of one trial. thread-compatible.
class LightExam {
 public:
  explicit LightExam(double trial_s);
  void look(const capture::Dequeued& frame, const capture::StreamFormat& format);
  std::optional<capture::LightFindings> findings() const;  // nullopt: too few pictures

 private:
  capture::LightWatch watch_;
  capture::JpegReader jpeg_;
  std::optional<std::chrono::nanoseconds> first_;
};

// Pure: automatic controls, exposures that show flicker, findings in the pictures.
std::vector<Finding> judge_light(const CameraExam& exam);

}  // namespace huetrack::doctor
