// What the speed benchmarks share: sets that are played there and back, the pass that a user would write with OpenCV
// instead, and how long an update takes.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "benchmark/blob_tracker.h"
#include "benchmark/sequence.h"
#include "calib/model/median.h"
#include "capture/frames/frame.h"
#include "object_tracking/trackers/object_tracker.h"
#include "scene/scene.h"

namespace huetrack::figures {

// Plays the sets there and back, with times that go on. They outlive it.
class Player {
 public:
  explicit Player(const std::vector<capture::FrameSet>& sets) : sets_(sets) {}
  const capture::FrameSet& next() {
    const std::size_t n = sets_.size();
    const std::size_t k = count_ % (2 * n - 2);
    set_ = sets_[k < n ? k : 2 * n - 2 - k];
    set_.number = count_;
    set_.at = capture::Timestamp(capture::duration_of(static_cast<double>(count_++) / 30));
    for (auto& frame : set_.frames) frame->captured_at = set_.at;
    return set_;
  }

 private:
  const std::vector<capture::FrameSet>& sets_;
  std::uint64_t count_ = 0;
  capture::FrameSet set_;
};

inline double microseconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
}

// A lime ball before cameras on a ring, in YUYV. focal_px 0: it grows with the image, so that the view stays the same.
inline Sequence scene_at(int camera_count, int width, int height, int set_count, double focal_px = 0) {
  const scene::Scene scene = scene::SceneBuilder{}
                                 .cameras_on_ring({.count = camera_count,
                                                   .image_size = {width, height},
                                                   .focal_px = focal_px > 0 ? focal_px : 0.75 * width})
                                 .ball({})
                                 .build();
  return {"scene", scene.rig, scene::render(scene, {.set_count = set_count}), {}};
}

class OpenCvPass {
 public:
  OpenCvPass(const calib::CameraRig& rig, const object_tracking::TargetOptions& target)
      : rig_(rig), blob_(blob_tracker_for(rig, target)) {}
  void run(const capture::FrameSet& set) {
    std::vector<cv::Point2d> centres;
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      const cv::Moments m = cv::moments(blob_.mask_of(set.frames[c]->pixels, c), true);
      centres.push_back(blob_.undistorted({{m.m10 / m.m00, m.m01 / m.m00}}, c).front());
    }
    cv::Mat x;
    cv::triangulatePoints(blob_.projection(0), blob_.projection(1), cv::Mat(cv::Matx21d(centres[0].x, centres[0].y)),
                          cv::Mat(cv::Matx21d(centres[1].x, centres[1].y)), x);
    last_ = x.at<double>(0);
  }

 private:
  const calib::CameraRig& rig_;
  BlobTracker blob_;
  volatile double last_ = 0;  // so that the result is not optimised away
};

inline object_tracking::ObjectTrackerOptions options_for(object_tracking::Observation observation, int particle_count) {
  object_tracking::ObjectTrackerOptions o = rendered_options(observation, 1);
  o.particle_count = particle_count;
  o.max_particle_count = std::max(o.max_particle_count, particle_count);
  return o;
}

// Median time of one update, microseconds, of a tracker that has locked on. `tracking` is the share of updates in
// tracking.
struct Timing {
  double us, tracking;
};
inline Timing time_update(const Sequence& s, object_tracking::Observation observation, int particle_count, int rounds,
                          int updates_per_round, const std::function<void(const capture::FrameSet&)>& between = {},
                          object_tracking::TargetShape shape = object_tracking::TargetShape::automatic) {
  object_tracking::TargetOptions target = lime_ball();
  target.shape = shape;
  object_trackers::ObjectTracker tracker(s.rig, target, options_for(observation, particle_count));
  Player player(s.sets);
  for (int i = 0; i < 120; ++i) tracker.update(player.next());
  std::vector<double> us;
  int tracking = 0, all = 0;
  for (int round = 0; round < rounds; ++round) {
    double sum = 0;
    for (int i = 0; i < updates_per_round; ++i) {
      const capture::FrameSet& set = player.next();
      sum += microseconds_of(
          [&] { tracking += tracker.update(set).state == object_tracking::TrackState::tracking ? 1 : 0; });
      ++all;
    }
    us.push_back(sum / updates_per_round);
    if (between) between(player.next());
  }
  return {calib::median(us), static_cast<double>(tracking) / all};
}

}  // namespace huetrack::figures
