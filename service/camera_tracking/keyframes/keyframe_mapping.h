// The mapping half of our camera tracker: key frames, new points and their adjustment. Its input is what PosedFrame
// carries of a tracked frame.
#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/keyframes/camera_motion.h"
#include "camera_tracking/keyframes/local_bundle.h"
#include "camera_tracking/scene_map.h"
#include "camera_tracking/template_patch.h"

namespace huetrack::keyframes {

inline constexpr int patch_side = 8;          // layout: pixels of a point's patch
inline constexpr float good_ncc = 0.8f;       // least NCC of a match
inline constexpr double most_shift_px = 1.5;  // of refine()

inline double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {  // rad
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// A tracked frame, as input of the mapping.
struct PosedFrame {
  std::uint64_t number = 0;
  std::shared_ptr<const Pyramid> pyramid;
  SweptPose pose;
  bool tracked = false;                  // false: the pose is not valid
  double share_found = 0;                // of the points that were searched for
  double flow_px = 0;                    // median image motion since the frame before; fast frames are blurred
  std::vector<PointSighting> sightings;  // keyframe is not set
  std::vector<int> missed;               // points that were not found
  std::optional<MotionPrior> prior;      // of the fit of its pose
  Readout readout;                       // current estimate
  double readout_sigma_px = 0;           // readout.sigma_s times the image's speed
};

// thread-compatible. map() may run while tracking uses a copy of scene().
class KeyframeMapping {
 public:
  explicit KeyframeMapping(const calib::Camera& camera);

  // The first frame, with the known points, whose positions have the standard deviation given_sigma_m per axis.
  void start(const PosedFrame& frame, std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& normal,
             double given_sigma_m, const Eigen::Matrix<double, 6, 6>& start_covariance);
  void start(StoredMap stored);  // from a loaded map
  void map(const PosedFrame& frame);
  const SceneMap& scene() const { return map_; }
  StoredMap stored() const;

 private:
  struct Seed : PointSeed {
    int found = 0, failed = 0;
    double widest_rad = 0;  // largest parallax so far
  };

  // The result of the epipolar search for a seed in one frame.
  struct SeedMeasurement {
    enum class Result : std::uint8_t { found, out_of_view, ambiguous, distorted, not_found };
    Result result = Result::not_found;
    Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw, if found
    int level = 0;                                 // of the pyramid
  };

  void count_detections(const PosedFrame& frame);
  bool is_new_keyframe(const PosedFrame& frame) const;
  void add_keyframe(const PosedFrame& frame);
  void add_view(MapPoint& point, int keyframe, int level, const Eigen::Vector2d& px);
  void promote(const Seed& seed);
  void remove(int point);
  double median_depth(const calib::Rigid3d& cam_from_world) const;

  // ---- Adjustment of some key frames and of the points that they see.
  struct LocalProblem {
    BundleProblem bundle;
    std::map<int, int> pose_of;                               // key frame -> pose of the bundle
    std::vector<int> point_of;                                // point of the bundle -> point of the map
    std::vector<std::pair<std::size_t, std::size_t>> source;  // per observation: point, index in by_point_[point]
  };
  void adjust_window(const std::set<int>& moved, int newest);
  std::set<int> window_of(int keyframe) const;
  LocalProblem problem_of(const std::set<int>& moved, int keyframe) const;
  void apply(const LocalProblem& local);
  void refit_outdated(const Readout& readout);
  void refit(const std::set<int>& keyframes);

  // ---- keyframe_seeds.cpp
  void add_seeds(int keyframe);
  void export_seeds();  // to map_.seeds: those of sharp key frames
  void update_seeds(const PosedFrame& frame);
  bool update(Seed& seed, const PosedFrame& frame);  // false: abandon it
  SeedMeasurement search(const Seed& seed, const PosedFrame& frame);
  bool update_depth(Seed& seed, const SeedMeasurement& seen, const PosedFrame& frame) const;  // false: rejected

  calib::Camera camera_;
  SceneMap map_;
  // Per key frame:
  std::vector<std::optional<MotionPrior>> priors_;  // of its fit; none for a loaded one
  std::vector<bool> is_sharp_;
  std::vector<double> speed_px_s_;  // of its image; 0: the readout was known
  // Per point:
  std::vector<std::vector<PointSighting>> by_point_;  // by key frame
  std::vector<double> given_sigma_m_;                 // 0: not given
  std::vector<Eigen::Vector3d> given_position_;

  std::vector<Seed> seeds_;
  std::uint64_t last_keyframe_frame_ = 0;
  WarpedPatch patch_;
  std::vector<float> field_;
};

}  // namespace huetrack::keyframes
