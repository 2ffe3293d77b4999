// What several objects of one colour cost: a whole update, on one thread, beside what a user would write instead with
// OpenCV on the same frames in the same run (YUYV to BGR to HSV, inRange, connected components, undistort, triangulate
// all pairs of blobs in all pairs of views).   build/release/tests/benchmark/many_speed
// Balls at distances of their own around the middle of the volume, on circles and swings; 640x480. Medians of rounds
// that alternate with OpenCV's.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "benchmark/blob_tracker.h"
#include "benchmark/sequence.h"
#include "benchmark/speed_run.h"
#include "calib/model/median.h"
#include "object_tracking/trackers/object_tracker.h"
#include "scene/scene.h"

using namespace huetrack;

namespace {

constexpr int recorded_sets = 24;

scene::Scene balls_before(int cameras, int balls) {
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = cameras, .image_size = {640, 480}, .focal_px = 480});
  for (int b = 0; b < balls; ++b) {
    const double phase = 2 * std::numbers::pi * b / balls;
    builder.ball({.path = [=](double t) {
      const double angle = phase + 0.6 * t;
      const double radius = 0.35 + 0.3 * (b % 3) / 2.0;
      return Eigen::Vector3d(radius * std::cos(angle), radius * std::sin(angle),
                             0.55 + 0.9 * (b * 5 % 16) / 15.0 + 0.05 * std::sin(2 * t + b));
    }});
  }
  return builder.build();
}

class OpenCvPass {
 public:
  OpenCvPass(const calib::CameraRig& rig, const object_tracking::TargetOptions& target)
      : rig_(rig), blob_(figures::blob_tracker_for(rig, target)) {}

  std::size_t run(const capture::FrameSet& set) {
    std::vector<std::vector<cv::Point2d>> blobs;
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      cv::Mat labels, stats, centres;
      const int n = cv::connectedComponentsWithStats(blob_.mask_of(set.frames[c]->pixels, c), labels, stats, centres);
      std::vector<cv::Point2d> raw;
      for (int b = 1; b < n; ++b) {
        if (stats.at<int>(b, cv::CC_STAT_AREA) >= 20)
          raw.emplace_back(centres.at<double>(b, 0), centres.at<double>(b, 1));
      }
      blobs.push_back(blob_.undistorted(raw, c));
    }
    std::size_t points = 0;
    for (std::size_t a = 0; a < blobs.size(); ++a) {
      for (std::size_t b = a + 1; b < blobs.size(); ++b) {
        std::vector<cv::Point2d> of_a, of_b;
        for (const auto& p : blobs[a])
          for (const auto& q : blobs[b]) of_a.push_back(p), of_b.push_back(q);
        if (of_a.empty()) continue;
        cv::Mat x;
        cv::triangulatePoints(blob_.projection(a), blob_.projection(b), of_a, of_b, x);
        points += static_cast<std::size_t>(x.cols);
      }
    }
    return points;
  }

 private:
  const calib::CameraRig& rig_;
  figures::BlobTracker blob_;
};

}  // namespace

int main() {
  cv::setNumThreads(1);
  std::printf("640x480, microseconds a set, medians; `told`: objects that are tracking, of those that are there\n");
  std::printf("cameras objects   count 1   huetrack    OpenCV   ratio  told\n");
  for (const int cameras : {2, 4, 8}) {
    for (const int balls : {1, 2, 4, 8, 16}) {
      const scene::Scene scene = balls_before(cameras, balls);
      const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = recorded_sets});
      object_tracking::TargetOptions target = figures::lime_ball();
      const object_tracking::ObjectTrackerOptions options =
          figures::rendered_options(object_tracking::Observation::huetrack, 1);
      object_trackers::ObjectTracker one(scene.rig, target, options);
      target.count = std::max(2, balls);
      object_trackers::ObjectTracker many(scene.rig, target, options);
      OpenCvPass opencv(scene.rig, target);
      std::vector<object_tracking::ObjectEstimate> estimates;
      figures::Player player(sets);
      std::vector<double> us_one, us_many, us_opencv;
      std::size_t told = 0, updates = 0;
      for (int i = 0; i < 60; ++i) one.update(player.next()), many.update(player.next(), estimates);
      for (int i = 0; i < 60; ++i) {
        const capture::FrameSet& set = player.next();
        if (balls == 1) us_one.push_back(figures::microseconds_of([&] { one.update(set); }));
        us_many.push_back(figures::microseconds_of([&] { many.update(set, estimates); }));
        if (i % 4 == 0) us_opencv.push_back(figures::microseconds_of([&] { opencv.run(set); }));
        for (const auto& e : estimates) told += e.state == object_tracking::TrackState::tracking ? 1 : 0;
        ++updates;
      }
      const double us = calib::median(us_many), cv = calib::median(us_opencv);
      std::printf("%7d %7d %9.0f %10.0f %9.0f %7.1f  %.2f of %d\n", cameras, balls,
                  us_one.empty() ? 0 : calib::median(us_one), us, cv, cv / us,
                  static_cast<double>(told) / static_cast<double>(updates), balls);
      std::fflush(stdout);
    }
  }
}
