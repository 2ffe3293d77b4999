// The mapping half of our camera tracker: key frames, new points, and their adjustment. It sees a frame after the
// tracking half is done with it, and knows nothing of the tracking's state beyond what is handed over.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/scene_map.h"
#include "camera_tracking/template_patch.h"

namespace huetrack::keyframes {

// What tracking hands over of a frame.
struct TrackedFrame {
  std::uint64_t number = 0;
  std::shared_ptr<const camera_tracking::Pyramid> pyramid;
  calib::Rigid3d cam_from_world;
  bool tracked = false;    // else the pose means nothing
  double share_found = 0;  // of the points that were sought
  double flow_px = 0;      // how far the image moved since the frame before: a fast frame is a blurred one
  std::vector<camera_tracking::PointSighting> sightings;  // its keyframe is not set
  std::vector<int> missed;                                // points that were sought and not found
};

struct MappingCounters {
  std::uint64_t keyframes = 0, points_added = 0, points_removed = 0, seeds_started = 0, seeds_abandoned = 0,
                adjustments = 0;
};

// thread-compatible. map() may run while tracking works on the next frame with the map that it was given before.
class KeyframeMapping {
 public:
  explicit KeyframeMapping(const calib::Camera& camera);

  // The first frame, with the points that are known: their true positions are within given_sigma_m of the given ones.
  void start(const TrackedFrame& frame, std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& normal,
             double given_sigma_m, const Eigen::Matrix<double, 6, 6>& start_covariance);
  void start(camera_tracking::StoredMap stored);  // a loaded one
  void map(const TrackedFrame& frame);
  const camera_tracking::SceneMap& scene() const { return map_; }
  camera_tracking::StoredMap stored() const;
  const MappingCounters& counters() const { return counters_; }

 private:
  // A corner of a key frame whose depth is being found: a Gaussian of the inverse depth along its ray, narrowed frame
  // by frame.
  struct Seed {
    int keyframe = 0, level = 0;
    Eigen::Vector2d px;                   // raw, level 0
    Eigen::Vector3d ray;                  // unit, camera frame of its key frame
    double inverse_depth = 0, sigma = 0;  // along the ray, 1/m
    int found = 0, failed = 0;
    double widest_rad = 0;  // parallax so far
  };

  void add_keyframe(const TrackedFrame& frame);
  void add_seeds(int keyframe);
  void update_seeds(const TrackedFrame& frame);
  bool update(Seed& seed, const TrackedFrame& frame);  // false: given up
  void promote(const Seed& seed);
  void add_look(camera_tracking::MapPoint& point, int keyframe, int level, const Eigen::Vector2d& px);
  void adjust_near(int keyframe);
  void remove(int point);
  double median_depth(const calib::Rigid3d& cam_from_world) const;

  calib::Camera camera_;
  camera_tracking::SceneMap map_;
  std::vector<std::vector<camera_tracking::PointSighting>> by_point_;  // sightings, per point, by key frame
  std::vector<Seed> seeds_;
  std::vector<double> given_sigma_m_;  // per point; 0: not given
  std::vector<Eigen::Vector3d> given_position_;
  std::uint64_t last_keyframe_frame_ = 0;
  camera_tracking::WarpedPatch patch_;
  std::vector<float> field_;
  MappingCounters counters_;
};

}  // namespace huetrack::keyframes
