// CameraMethod::lee: S.-H. Lee, Real-time camera tracking using a particle filter combined with unscented Kalman
// filters, Journal of Electronic Imaging 23(1), 013029, 2014. The paper's two parallel tasks are two classes.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "calib/model/batch_projector.h"
#include "camera_tracking/camera_starter.h"
#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/papers/depth_ray.h"
#include "camera_tracking/papers/feature_template.h"
#include "camera_tracking/papers/unscented_kalman.h"
#include "camera_tracking/pose_solver.h"
#include "camera_tracking/scene_map.h"

namespace huetrack::papers {

using namespace camera_tracking;

// A feature, as input of the tracking task.
struct LeeFeature {
  int id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double depth = 1;  // along the reference ray
  FeatureSource source;
  bool given = false;
};

// A tracked frame, as input of the mapping task.
struct LeeFrame {
  std::uint64_t number = 0;
  std::shared_ptr<const Pyramid> pyramid;
  bool tracked = false;
  calib::Rigid3d cam_from_world;  // the particles' mean, or the polished fit
  std::optional<PoseFit> polished;
  Eigen::Matrix<double, 7, 7> state_covariance = Eigen::Matrix<double, 7, 7>::Zero();
  std::vector<calib::Rigid3d> sampled;  // cam_from_world of particles drawn by their weights
  struct Match {
    int id = 0;
    Eigen::Vector2d projected, found;  // raw px
    Eigen::Matrix2d cloud;             // Cov[P(x) z] of eq. (9), of the weighted particles
  };
  std::vector<Match> matches;
  std::vector<int> missed;  // ids: in view, not found
};

// First task: Algorithm 1.  thread-compatible.
class LeeTracking {
 public:
  struct Options {
    std::size_t particle_count = 350;
    double rotation_rad = 0.008;  // Omega_c: std. dev. per axis and frame
    double position_m = 0.005;    // V_c
    // C of eq. (4) as a share of the cloud's covariance; 1 in the paper, with twice the error (camera_particles).
    double cloud_share = 0.3;
    bool polish = true;         // the mean; not in the paper
    float threshold = 0.8f;     // of NCC
    std::size_t sampled = 40;   // LeeFrame::sampled
    double wider_unseen = 1.5;  // factor of the walk after a frame that did not support the pose; 1 in the paper
  };
  LeeTracking(const calib::Camera& camera, const Options& options, std::uint64_t seed);
  void start(const calib::Rigid3d& cam_from_world);
  LeeFrame track(std::uint64_t number, const std::shared_ptr<const Pyramid>& pyramid,
                 const std::vector<LeeFeature>& features);
  // Algorithm 1 without step 3, with given measurements (NaN: none), for simulations.
  calib::Rigid3d track_points(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector2d>& px);
  CloudMoments cloud_of(const Eigen::Vector3d& p_world);  // of the weighted particles' projections
  const PoseParticles& particles() const { return particles_; }
  int in_view() const { return in_view_; }

 private:
  struct Cloud {  // M of Algorithm 1, of one feature
    std::vector<float> u, v;
    CloudMoments moments;
  };
  struct Visible {  // indices of a feature in view and of its cloud
    std::size_t feature, cloud;
  };
  std::vector<Visible> project(const std::vector<LeeFeature>& features, const calib::Rigid3d& predicted);
  std::vector<Visible> measure(const GreyImage& image, const std::vector<LeeFeature>& features,
                               const calib::Rigid3d& predicted, const std::vector<Visible>& visible, LeeFrame& out);
  void weigh(const Cloud& cloud, const Eigen::Vector2d& y);
  bool is_supported(const std::vector<Visible>& seen, LeeFrame& out) const;
  std::optional<PoseFit> polished(const std::vector<LeeFeature>& features, const std::vector<Visible>& seen,
                                  const LeeFrame& frame) const;

  calib::Camera camera_;
  Options options_;
  calib::BatchProjector lens_;
  particle_filter::Rng rng_;
  PoseParticles particles_;
  int in_view_ = 0;
  bool supported_ = true;  // the last frame supported the pose
  std::vector<float> log_weight_;
  std::vector<Cloud> clouds_;
  WarpedPatch patch_;
  std::vector<float> field_;
};

// Second task: new features, their depths, one UKF each, removal of wrong ones.  thread-compatible.
class LeeMapping {
 public:
  struct Options {
    std::size_t wanted_in_view = 60;  // features and candidates
    std::size_t new_per_frame = 4;    // random boxes
    int box_px = 20;
    double pixel_sigma = 0.7;  // of R_p, eq. (9)
  };
  LeeMapping(const calib::Camera& camera, const Options& options, std::uint64_t seed);
  void start(const LeeFrame& first, const StartResult& started);
  void start(const StoredMap& stored);
  void add(const LeeFeature& feature, double inverse_depth_sigma, const Eigen::Matrix<double, 7, 7>& camera_covariance);
  void map(const LeeFrame& frame);
  const std::vector<LeeFeature>& features() const { return features_; }  // with increasing ids

 private:
  struct Estimator {                      // of features_[same index]
    std::optional<FeatureFilter> filter;  // none: given
    int found = 0, missed = 0, rejected = 0, age = 0;
  };
  struct FeatureCandidate {  // of unknown depth
    FeatureSource source;
    Eigen::Matrix<double, 7, 7> camera_covariance;
    Eigen::Matrix2d px_covariance;
    DepthRay ray;
    NccTemplate templ;
    int attempts = 0, missed = 0;
  };
  void update_features(const LeeFrame& frame);
  void update_candidates(const LeeFrame& frame);
  bool sharpen(FeatureCandidate& candidate, const LeeFrame& frame);
  void detect(const LeeFrame& frame);

  calib::Camera camera_;
  Options options_;
  particle_filter::Rng rng_;
  int next_id_ = 0;
  double depth_m_ = 1;  // of the scene, approximately
  std::vector<LeeFeature> features_;
  std::vector<Estimator> estimators_;
  std::vector<FeatureCandidate> candidates_;
  std::vector<float> field_;
};

SceneMap scene_of(const std::vector<LeeFeature>& features);

// options: valid. Throws std::runtime_error naming the map file.
std::unique_ptr<CameraTracker> make_lee_tracker(const calib::Camera& camera, const CameraTrackerOptions& options);

}  // namespace huetrack::papers
