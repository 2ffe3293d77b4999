// CameraMethod::pupilli: M. Pupilli and A. Calway, Real-Time Camera Tracking Using a Particle Filter, BMVC 2005.
#pragma once

#include <memory>
#include <vector>

#include "calib/model/batch_projector.h"
#include "camera_tracking/camera_starter.h"
#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/observation_field.h"
#include "camera_tracking/papers/depth_ray.h"
#include "camera_tracking/papers/feature_template.h"
#include "camera_tracking/pose_particles.h"
#include "camera_tracking/pose_solver.h"
#include "camera_tracking/scene_map.h"

namespace huetrack::papers {

using namespace camera_tracking;

// A scene point z_i with its template T_i.
struct PupilliPoint {
  std::uint32_t id = 0;                                // set by PupilliFilter::add()
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world
  double sigma_m = 0;                                  // along its ray; 0: given
  NccTemplate templ;
  FeatureSource source;
  bool given = false;
  int found = 0, missed = 0;  // recent counts
};

// thread-compatible.
class PupilliFilter {
 public:
  struct Options {
    std::size_t particle_count = 500;
    float rotation_rad = 0.03f;  // v of eq. (2): half widths of the uniform walk
    float position_m = 0.018f;
    int annealing_steps = 3;                 // each with half the v of the one before
    float epsilon_d_px[3] = {5, 3, 1.2f};    // of eq. (6)
    float epsilon_rho = 0.75f;               // of eq. (4)
    float wider_unseen = 1.5f;               // factor of v while too few points support the cloud
    std::size_t reweighting_particles = 60;  // of eq. (7)
    std::size_t max_active = 24;             // points that are measured in one frame
    std::size_t wanted_in_view = 40;         // with fewer, new points are introduced
    std::size_t introduced_at_once = 12;     // 1 in the paper
    bool polish = true;                      // the mean; not in the paper
  };
  PupilliFilter(const calib::Camera& camera, const Options& options, std::uint64_t seed);
  void start(const calib::Rigid3d& cam_from_world);
  void add(PupilliPoint point);  // sets its id

  struct Result {
    calib::Rigid3d cam_from_world;  // the weighted mean, or the polished fit
    std::optional<PoseFit> polished;
    bool supported = false;
    int active = 0, matched = 0;
  };
  // One frame of the particle filter, sections 3 and 4.
  Result track(const std::shared_ptr<const Pyramid>& pyramid);
  // The auxiliary process of section 5, for the frame of the last track().
  void map(const std::shared_ptr<const Pyramid>& pyramid, const Result& result);

  const PoseParticles& particles() const { return particles_; }
  const std::vector<PupilliPoint>& points() const { return points_; }
  // The measurements of the last frame.
  struct Measured {
    std::size_t point;
    CloudMoments cloud;
    Eigen::Vector2d found;  // NaN: none
  };
  const std::vector<Measured>& measured() const { return measured_; }

 private:
  struct FeatureCandidate {
    FeatureSource source;
    NccTemplate templ;
    DepthRay ray;
    int attempts = 0, missed = 0;
  };
  void choose_active(const calib::Rigid3d& predicted);
  void project(std::size_t active);
  void correlate(const GreyImage& image);
  void anneal(float rotation_rad, float position_m);
  int measure(const calib::Rigid3d& cam_from_world);
  std::optional<PoseFit> polished(const calib::Rigid3d& mean) const;
  bool sharpen(FeatureCandidate& candidate, const GreyImage& image, const calib::Rigid3d& pose);
  void introduce(const std::shared_ptr<const Pyramid>& pyramid, const calib::Rigid3d& pose);

  calib::Camera camera_;
  Options options_;
  calib::BatchProjector lens_;
  particle_filter::Rng rng_;
  PoseParticles particles_;
  std::vector<PupilliPoint> points_;
  std::uint32_t next_id_ = 0;
  std::vector<FeatureCandidate> candidates_;  // at most introduced_at_once
  double depth_m_ = 1;
  bool supported_ = true;
  std::vector<ObservationField> fields_;
  std::vector<std::size_t> active_;
  std::vector<std::vector<float>> u_, v_;  // projections of each active point
  std::vector<float> log_weight_;
  std::vector<Measured> measured_;
  ObservationField candidate_field_;
};

// options: valid. Throws std::runtime_error naming the map file.
std::unique_ptr<CameraTracker> make_pupilli_tracker(const calib::Camera& camera, const CameraTrackerOptions& options);

}  // namespace huetrack::papers
