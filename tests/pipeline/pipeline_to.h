// A pipeline whose output is functions.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "pipeline/pipeline.h"

namespace huetrack::pipeline {

// Named as what they get; an empty one is left out.
struct Calls {
  std::function<void(const capture::FrameSet&, std::span<const object_tracking::ObjectEstimate>, capture::Timestamp)>
      estimates = nullptr;
  std::function<void(const PipelineFigures&)> status = nullptr;
  std::function<void(const pictures::PictureJob&)> pictures = nullptr;
  std::function<void(const TrackedFrame&)> camera_poses = nullptr;
  std::function<void(const pictures::CameraPictureJob&)> camera_pictures = nullptr;
};

class CallingOutput : public Output {
 public:
  explicit CallingOutput(Calls calls) : calls_(std::move(calls)) {}
  void on_set(const TrackedSet& set) override {
    if (calls_.estimates) calls_.estimates(set.frames, set.estimates, set.received_at);
  }
  void on_status(const PipelineFigures& figures) override {
    if (calls_.status) calls_.status(figures);
  }
  void on_picture(const pictures::PictureJob& job) override {
    if (calls_.pictures) calls_.pictures(job);
  }
  void on_camera_pose(const TrackedFrame& frame) override {
    if (calls_.camera_poses) calls_.camera_poses(frame);
  }
  void on_camera_picture(const pictures::CameraPictureJob& job) override {
    if (calls_.camera_pictures) calls_.camera_pictures(job);
  }

 private:
  const Calls calls_;
};

class PipelineTo : private CallingOutput, public Pipeline {
 public:
  PipelineTo(const calib::CameraRig& rig, std::vector<std::unique_ptr<capture::FrameSource>> sources,
             std::vector<object_trackers::ObjectTracker> trackers, PipelineOptions options, Calls calls)
      : CallingOutput(std::move(calls)), Pipeline(rig, std::move(sources), std::move(trackers), std::move(options)) {
    add(static_cast<CallingOutput&>(*this));
  }
};

}  // namespace huetrack::pipeline
