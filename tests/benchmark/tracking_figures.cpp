#include "benchmark/tracking_figures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "benchmark/blob_tracker.h"
#include "object_tracking/trackers/object_tracker.h"
#include "pictures/pictures.h"
#include "tracks/truth_comparison.h"

namespace huetrack::figures {

std::vector<object_tracking::ObjectEstimate> track(const Sequence& sequence,
                                                   const object_tracking::TargetOptions& target,
                                                   const object_tracking::ObjectTrackerOptions& options) {
  object_trackers::ObjectTracker tracker(sequence.rig, target, options);
  std::vector<object_tracking::ObjectEstimate> out;
  for (const capture::FrameSet& set : sequence.sets) out.push_back(tracker.update(set));
  return out;
}

std::vector<object_tracking::ObjectEstimate> track_blob(const Sequence& sequence,
                                                        const object_tracking::TargetOptions& target) {
  BlobTracker blob = blob_tracker_for(sequence.rig, target);
  std::vector<object_tracking::ObjectEstimate> out;
  for (const capture::FrameSet& set : sequence.sets) {
    object_tracking::ObjectEstimate e;
    e.at = set.at;
    e.set_number = set.number;
    if (const auto p = blob.locate(set)) {
      e.state = object_tracking::TrackState::tracking;
      e.position = *p;
    }
    out.push_back(std::move(e));
  }
  return out;
}

TrackingFigures figures_of(const Sequence& sequence, const std::string& target,
                           const std::vector<object_tracking::ObjectEstimate>& track, double from_s) {
  TrackingFigures f;
  double sum2 = 0, sum2_two = 0, sum_nees = 0;
  std::size_t inside = 0, waiting = 0;
  std::optional<Eigen::Vector3d> last_error;
  for (const object_tracking::ObjectEstimate& e : track) {
    const std::optional<TruthRow> row = sequence.row(target, e.at);
    if (!row || capture::seconds(e.at - sequence.sets.front().at) < from_s) continue;
    ++f.sets;
    const bool two = row->views_that_see() >= 2;
    TrackingFigures::Seen& seen = f.by_views[static_cast<std::size_t>(std::min(2, row->views_that_see()))];
    ++seen.sets;
    seen.tracking += e.state == object_tracking::TrackState::tracking ? 1 : 0;
    waiting = two && e.state != object_tracking::TrackState::tracking ? waiting + 1 : 0;
    f.longest_return = std::max(f.longest_return, waiting);
    if (!e.has_position()) {
      ++f.without_answer;
      last_error.reset();
      continue;
    }
    const Eigen::Vector3d error = e.position - row->position;
    if (e.state == object_tracking::TrackState::tracking && error.norm() > 0.1) ++f.wrong_tracking;
    if (!f.lock_set && e.state == object_tracking::TrackState::tracking && error.norm() < 0.05) f.lock_set = f.sets;
    if (!f.lock_set) continue;
    if (last_error && !two) f.largest_jump_m = std::max(f.largest_jump_m, (error - *last_error).norm());
    last_error = error;
    ++f.compared;
    sum2 += error.squaredNorm();
    f.max_m = std::max(f.max_m, error.norm());
    if (two) {
      ++f.seen_by_two;
      sum2_two += error.squaredNorm();
      f.max_two_views_m = std::max(f.max_two_views_m, error.norm());
    }
    if (e.covariance.allFinite()) {
      const double n = tracks::nees(error, e.covariance);
      sum_nees += n;
      inside += n <= 7.815 ? 1 : 0;
      ++seen.compared;
      seen.inside_95 += n <= 7.815 ? 1 : 0;
      seen.sum_nees += n;
      seen.sum_error2 += error.squaredNorm();
      seen.max_m = std::max(seen.max_m, error.norm());
    }
  }
  const auto mean = [](double sum, std::size_t n) { return n > 0 ? sum / static_cast<double>(n) : 0; };
  f.rms_m = std::sqrt(mean(sum2, f.compared));
  f.rms_two_views_m = std::sqrt(mean(sum2_two, f.seen_by_two));
  f.mean_nees = mean(sum_nees, f.compared);
  f.share_inside_95 = mean(static_cast<double>(inside), f.compared);
  return f;
}

std::size_t inside_red_square(const Sequence& sequence, const std::vector<object_tracking::ObjectEstimate>& track) {
  // The square's colour in OpenCV's HSV, 2-98 %, from the data's README, a little wider.
  const cv::Scalar low[] = {{171, 210, 80}, {169, 120, 140}}, high[] = {{178, 255, 145}, {178, 165, 190}};
  std::size_t count = 0;
  for (std::size_t s = 0; s < sequence.sets.size(); ++s) {
    if (!track[s].has_position()) continue;
    bool inside = true;
    for (std::size_t c = 0; c < 2; ++c) {
      const auto& frame = sequence.sets[s].frames[c];
      const auto px = sequence.rig.cameras[c].project_world(track[s].position);
      if (!frame || !px) {
        inside = false;
        continue;
      }
      cv::Mat hsv, mask;
      cv::cvtColor(pictures::bgr_of(frame->pixels), hsv, cv::COLOR_BGR2HSV);
      cv::inRange(hsv, low[c], high[c], mask);
      cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, cv::Mat::ones(3, 3, CV_8U));
      std::vector<std::vector<cv::Point>> contours;
      cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
      const auto largest = std::ranges::max_element(contours, {}, [](const auto& k) { return cv::contourArea(k); });
      if (largest == contours.end()) {
        inside = false;
        continue;
      }
      std::vector<cv::Point> hull;
      cv::convexHull(*largest, hull);
      const cv::Point2f at(static_cast<float>(px->px.x()), static_cast<float>(px->px.y()));
      inside = inside && cv::pointPolygonTest(hull, at, false) >= 0;
    }
    count += inside ? 1 : 0;
  }
  return count;
}

}  // namespace huetrack::figures
