// The mapping half of our camera tracker: key frames, new points, and their adjustment. It sees a frame after the
// tracking half is done with it, and knows nothing of the tracking's state beyond what is handed over.
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

inline constexpr int patch_side = 8;          // pixels of a point's patch
inline constexpr float good_ncc = 0.8f;       // from here on a patch is said to be found
inline constexpr double most_shift_px = 1.5;  // of refine()

inline double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {  // rad
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// What tracking hands over of a frame.
struct PosedFrame {
  std::uint64_t number = 0;
  std::shared_ptr<const camera_tracking::Pyramid> pyramid;
  camera_tracking::SweptPose pose;
  bool tracked = false;    // else the pose means nothing
  double share_found = 0;  // of the points that were sought
  double flow_px = 0;      // how far the image moved since the frame before: a fast frame is a blurred one
  std::vector<camera_tracking::PointSighting> sightings;  // its keyframe is not set
  std::vector<int> missed;                                // points that were sought and not found
  std::optional<MotionPrior> prior;                       // with which its pose was fitted
  Readout readout;                                        // as it is known now
  double readout_open_px = 0;                             // what that leaves open between the first row and the last
};

// thread-compatible. map() may run while tracking works on the next frame with the map that it was given before.
class KeyframeMapping {
 public:
  explicit KeyframeMapping(const calib::Camera& camera);

  // The first frame, with the points that are known: their true positions are within given_sigma_m of the given ones.
  void start(const PosedFrame& frame, std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& normal,
             double given_sigma_m, const Eigen::Matrix<double, 6, 6>& start_covariance);
  void start(camera_tracking::StoredMap stored);  // a loaded one
  void map(const PosedFrame& frame);
  const camera_tracking::SceneMap& scene() const { return map_; }
  camera_tracking::StoredMap stored() const;

 private:
  // A corner of a key frame whose depth is being found: a Gaussian of the inverse depth along its ray, narrowed frame
  // by frame.
  struct Seed : camera_tracking::PointSeed {
    int found = 0, failed = 0;
    double widest_rad = 0;  // parallax so far
  };

  // What a frame says to a seed.
  struct SeedSeen {
    enum class How : std::uint8_t { found, out_of_view, ambiguous, distorted, not_found };
    How how = How::not_found;
    Eigen::Vector2d px = Eigen::Vector2d::Zero();  // raw, when it is found
    int level = 0;                                 // of the pyramid, at which it is
  };

  void count_finds(const PosedFrame& frame);
  bool is_new_keyframe(const PosedFrame& frame) const;
  void add_keyframe(const PosedFrame& frame);
  void add_look(camera_tracking::MapPoint& point, int keyframe, int level, const Eigen::Vector2d& px);
  void promote(const Seed& seed);
  void remove(int point);
  double median_depth(const calib::Rigid3d& cam_from_world) const;

  // ---- The adjustment of some key frames and of what they see.
  struct LocalProblem {
    BundleProblem bundle;
    std::map<int, int> pose_of;                               // key frame -> pose of the bundle
    std::vector<int> point_of;                                // of each point of the bundle: the map's
    std::vector<std::pair<std::size_t, std::size_t>> source;  // of each observation: point, place in its list
  };
  void adjust_moved(const std::set<int>& moved, int newest);
  std::set<int> to_be_moved(int keyframe) const;
  LocalProblem problem_of(const std::set<int>& moved, int keyframe) const;
  void take_over(const LocalProblem& local);
  void keep_up_with(const Readout& readout);
  void refit(const std::set<int>& keyframes);

  // ---- keyframe_seeds.cpp
  void add_seeds(int keyframe);
  void show_seeds();  // in the map: those of sharp key frames, whose own motion is known best
  void update_seeds(const PosedFrame& frame);
  bool update(Seed& seed, const PosedFrame& frame);  // false: given up
  SeedSeen seek(const Seed& seed, const PosedFrame& frame);
  bool narrow(Seed& seed, const SeedSeen& seen, const PosedFrame& frame) const;  // false: contradicted

  calib::Camera camera_;
  camera_tracking::SceneMap map_;
  std::vector<std::optional<MotionPrior>>
      priors_;                      // per key frame: with which its pose was fitted; of a stored one none
  std::vector<bool> is_sharp_;      // per key frame; the first one is taken as it comes
  std::vector<double> speed_px_s_;  // per key frame: of its image, where nothing was known of the readout
  std::vector<std::vector<camera_tracking::PointSighting>> by_point_;  // sightings, per point, by key frame
  std::vector<Seed> seeds_;
  std::vector<double> given_sigma_m_;  // per point; 0: not given
  std::vector<Eigen::Vector3d> given_position_;
  std::uint64_t last_keyframe_frame_ = 0;
  camera_tracking::WarpedPatch patch_;
  std::vector<float> field_;
};

}  // namespace huetrack::keyframes
