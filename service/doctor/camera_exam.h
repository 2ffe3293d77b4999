// Examines the local cameras for `huetrackd doctor`: their V4L2 properties, and a trial with all of them streaming at
// once.
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
  std::uint64_t frames = 0;     // received
  double seconds = 0;           // from the first time stamp to the last
  std::uint64_t dropped = 0;    // gaps in the driver's numbering
  std::uint64_t corrupted = 0;  // flagged by the driver
  std::uint64_t bytes = 0;      // of all frames
  double longest_gap_s = 0;     // between two time stamps
  double mean_age_s = 0;        // from the time stamp to the dequeue
  capture::StampKind stamp = capture::StampKind::dequeued;
  std::optional<capture::UsbReservation> usb;   // while it streamed
  std::optional<capture::LightFindings> light;  // nullopt: too few valid frames
  std::string failure;                          // why it ended early; empty: it completed
  double fps() const { return frames > 1 && seconds > 0 ? double(frames - 1) / seconds : 0; }
};

struct CameraExam {
  capture::V4l2Node node;
  std::string name;         // in the configuration; empty: none
  bool has_fields = false;  // there: the field to play
  double asked_fps = 0;     // by the configuration or for the trial; 0: the driver's choice
  std::vector<capture::OfferedFormat> formats;
  std::vector<capture::Control> controls;          // as found
  std::vector<capture::ControlResult> configured;  // after set_controls() as `run` does it
  std::vector<capture::ControlResult> stayed;      // accepted ones, read again after the trial
  std::vector<capture::ControlResult> tried;       // others, changed by one step and restored
  std::string problem;                             // why it could not be examined; empty: examined
  std::optional<StreamTrial> trial;                // nullopt: not started (problem), or not requested
};

struct ExamRequest {
  capture::V4l2Node node;
  std::string name;
  bool has_fields = false;
  std::optional<capture::StreamRequest> stream;  // nullopt: suitable_stream()
  std::vector<capture::ControlSetting> controls;
  bool streams = true;
};

// 640x480, or the nearest smaller size, at 30 frames/s or the nearest rate; nullopt: no usable format.
std::optional<capture::StreamRequest> suitable_stream(std::span<const capture::OfferedFormat> formats);

// Examines all cameras; they stream at the same time, because they share the USB. Restores the controls. Does not
// disturb a camera that another program uses. No exceptions.
std::vector<CameraExam> examine_cameras(const std::vector<ExamRequest>& requests, std::chrono::duration<double> length,
                                        const std::stop_token& stop);

}  // namespace huetrack::doctor
