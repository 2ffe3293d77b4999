// What `huetrackd doctor` finds out about the cameras of this host: all that V4L2 says of them, and how they really
// behave while all of them stream at once for a few seconds.
#pragma once

#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "capture/frames/light_watch.h"
#include "capture/v4l2/usb_bandwidth.h"
#include "capture/v4l2/v4l2_device.h"

namespace huetrack::doctor {

// A few seconds of frames.
struct StreamTrial {
  capture::StreamFormat agreed;
  std::uint64_t frames = 0;     // that came
  double seconds = 0;           // from the first one's time stamp to the last one's
  std::uint64_t dropped = 0;    // gaps in the driver's numbering
  std::uint64_t corrupted = 0;  // flagged by the driver
  std::uint64_t bytes = 0;      // of all frames
  double longest_gap_s = 0;     // between two time stamps
  double mean_age_s = 0;        // from the time stamp to the dequeue
  capture::StampKind stamp = capture::StampKind::dequeued;
  std::optional<capture::UsbReservation> usb;   // while it streamed
  std::optional<capture::LightFindings> light;  // nullopt: too few sound frames to say
  std::string failure;                          // why it ended early; empty: it did not
  double fps() const { return frames > 1 && seconds > 0 ? double(frames - 1) / seconds : 0; }
};

struct CameraExam {
  capture::V4l2Node node;
  std::string name;      // in the configuration; empty: not in it, or there is none
  double asked_fps = 0;  // by the configuration, else what was chosen for the trial; 0: the driver's choice
  std::vector<capture::OfferedFormat> formats;
  std::vector<capture::Control> controls;          // as found
  std::vector<capture::ControlResult> configured;  // after set_controls() as `run` does it
  std::vector<capture::ControlResult> stayed;  // those that stuck, read again after the trial: problem when they moved
  std::vector<capture::ControlResult> tried;   // others that matter, moved by one step and back
  std::string problem;                         // why it could not be examined; empty: it was
  std::optional<StreamTrial> trial;            // nullopt: it did not start (problem), or was not to
};

// What to ask of a camera.
struct ExamRequest {
  capture::V4l2Node node;
  std::string name;
  std::optional<capture::StreamRequest> stream;  // nullopt: what suits it
  std::vector<capture::ControlSetting> controls;
  bool streams = true;
};

// 640x480, or the nearest below it that the camera has, at 30 frames/s or the nearest; nullopt: nothing that we can
// use.
std::optional<capture::StreamRequest> suitable_stream(std::span<const capture::OfferedFormat> formats);

// Examines all of them; those that stream do it at the same time, as they share the USB. The controls are put back. A
// camera that another program streams from is left alone. No exception.
std::vector<CameraExam> examine_cameras(const std::vector<ExamRequest>& requests, std::chrono::duration<double> length,
                                        const std::stop_token& stop);

}  // namespace huetrack::doctor
