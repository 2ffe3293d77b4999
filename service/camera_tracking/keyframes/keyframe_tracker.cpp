#include "camera_tracking/keyframes/keyframe_tracker.h"

#include <Eigen/LU>
#include <algorithm>

#include "calib/model/median.h"
#include "camera_tracking/camera_starter.h"
#include "camera_tracking/keyframes/keyframe_mapping.h"
#include "camera_tracking/keyframes/keyframe_tracking.h"
#include "camera_tracking/parallel_task.h"
#include "camera_tracking/pose_solver.h"

namespace huetrack::keyframes {

namespace {

constexpr std::size_t default_particles = 250;
constexpr double coast_s = 0.4;
// Growth of the standard deviation while coasting, per second: a hand-held camera.
constexpr double coast_m_s = 0.25, coast_rad_s = 0.6;

// Frame n is tracked with the map of frame n - 2, while frame n - 1 is mapped in parallel: deterministic.
class KeyframeTracker final : public CameraTracker {
 public:
  KeyframeTracker(const calib::Camera& camera, const CameraTrackerOptions& options)
      : camera_(camera),
        starter_(camera, options.start),
        tracking_(camera,
                  options.particle_count > 0 ? static_cast<std::size_t>(options.particle_count) : default_particles,
                  options.seed),
        mapping_(camera),
        particle_count_(options.particle_count > 0 ? options.particle_count : static_cast<int>(default_particles)) {
    if (!options.load_map.empty()) {
      mapping_.start(read_map(options.load_map, camera.image_size));
      map_ = mapping_.scene();
      started_ = is_map_unproven_ = true;
      state_ = PoseState::lost;
    }
  }

  CameraEstimate update(const capture::Frame& frame) override {
    CameraEstimate estimate;
    estimate.at = frame.captured_at;
    estimate.frame_number = frames_++;
    estimate.particle_count = particle_count_;
    if (frame.status != capture::FrameStatus::ok || frame.pixels.width != camera_.image_size.width ||
        frame.pixels.height != camera_.image_size.height) {
      coast(frame.captured_at);
      fill(estimate, ProvenPose{});
      return estimate;
    }
    const GreyImage grey = grey_of(frame.pixels);
    const auto pyramid = std::make_shared<const Pyramid>(make_pyramid(grey));
    if (!started_) {
      start(frame, grey, pyramid);
      fill(estimate, last_);
      return estimate;
    }
    if (to_map_) mapper_.start([this] { mapping_.map(*to_map_); });
    std::optional<calib::Rigid3d> proposed;
    if (state_ == PoseState::lost && estimate.frame_number % 5 == 0)
      proposed = starter_.find_again(frame.pixels, grey, pose_);
    const capture::Timestamp before = tracked_at_;
    last_ = tracking_.track(frame.captured_at, pyramid, map_, state_ == PoseState::lost, proposed);
    mapper_.wait();
    if (to_map_) map_ = mapping_.scene();
    to_map_.reset();
    if (pending_start_) {
      if (last_.proven) refine_start(before, frame.captured_at);
      pending_start_.reset();
    }
    if (last_.proven) {
      const double flow = flow_px(last_.pose.cam_from_world);
      state_ = PoseState::tracking;
      is_map_unproven_ = false;
      tracked_at_ = frame.captured_at;
      pose_ = last_.pose.cam_from_world;
      covariance_ = world_covariance(pose_, last_.tangent_covariance) + start_covariance_at(pose_);
      const PoseEvidence& e = last_.evidence;
      // With so few points nothing is mapped yet: the pose is that of the start rectangle.
      const double share_found = e.sought < 8 ? 1.0 : static_cast<double>(e.found) / e.sought;
      const double frame_s = std::max(1e-3, capture::seconds(frame.captured_at - before));
      to_map_ = PosedFrame{.number = estimate.frame_number,
                           .pyramid = pyramid,
                           .pose = last_.pose,
                           .tracked = true,
                           .share_found = share_found,
                           .flow_px = flow,
                           .sightings = last_.sightings,
                           .missed = last_.missed,
                           .prior = tracking_.prior(),
                           .readout = tracking_.readout(),
                           .readout_sigma_px = tracking_.readout().sigma_s * flow / frame_s};
    } else {
      coast(frame.captured_at);
    }
    fill(estimate, last_);
    return estimate;
  }

  void begin_anew() override {
    if (!started_) return;
    state_ = PoseState::lost;
    pending_start_.reset();
    tracking_.forget();
  }

  std::string why_no_pose() const override {
    if (state_ == PoseState::searching) return starter_.why_not();
    if (state_ != PoseState::lost) return {};
    return is_map_unproven_ ? "nothing of the loaded map is recognised in the view: look at what it shows"
                            : "nothing of what was mapped is recognised in the view: look at where it was before";
  }

  CameraTrackerInside inside() const override {
    CameraTrackerInside out;
    for (const KeyframeTracking::Sought& s : tracking_.sought()) {
      const MapPoint& p = map_.point(s.point);
      out.features.push_back(
          {s.px.cast<float>(), s.found_px.cast<float>(), s.search.cast<float>(), p.position, p.covariance, p.given});
    }
    out.particles = tracking_.particles().world_from_cameras(300);
    return out;
  }

  std::vector<CameraMapPoint> map() const override {
    std::vector<CameraMapPoint> out;
    std::vector<CameraMapPoint::State> states(map_.points.size(), CameraMapPoint::State::not_sought);
    if (state_ == PoseState::tracking) {
      for (const KeyframeTracking::Sought& s : tracking_.sought())
        states[static_cast<std::size_t>(s.point)] =
            s.found_px.allFinite() ? CameraMapPoint::State::found : CameraMapPoint::State::missed;
    }
    for (std::size_t i = 0; i < map_.points.size(); ++i) {
      const MapPoint& p = map_.points[i];
      if (p.alive) out.push_back({static_cast<std::uint32_t>(i), p.position, p.covariance, states[i], p.given});
    }
    return out;
  }

  void save_map(const std::filesystem::path& file) const override { write_map(file, mapping_.stored()); }

 private:
  void start(const capture::Frame& frame, const GreyImage& grey, const std::shared_ptr<const Pyramid>& pyramid) {
    const auto started = starter_.find(frame.pixels, grey);
    if (!started) return;
    started_ = true;
    if (started->rectangle) tracking_.set_rectangle(started->dark);
    pose_ = started->pose.cam_from_world;
    tracking_.set_pose(frame.captured_at, pose_);
    pending_start_ = PendingStart{{.number = frames_ - 1,
                                   .pyramid = pyramid,
                                   .pose = {pose_},
                                   .tracked = true,
                                   .share_found = 1,
                                   .sightings = {},
                                   .missed = {},
                                   .prior = {},
                                   .readout = tracking_.readout()},
                                  *started};
    for (std::size_t i = 0; i < started->points.size(); ++i)
      pending_start_->frame.sightings.push_back({0, static_cast<int>(i), started->px[i], started->sigma_px});
    map_from_start(started->pose);
    covariance_ = map_.start_covariance;
    last_ = {};
    last_.pose.cam_from_world = pose_;
    last_.proven = true;
    last_.evidence.sought = last_.evidence.found = static_cast<int>(started->points.size());
    last_.sightings = pending_start_->frame.sightings;
    state_ = PoseState::tracking;
    tracked_at_ = frame.captured_at;
  }

  void map_from_start(const PoseFit& fit) {
    const auto& [first, started] = *pending_start_;
    mapping_.start(first, started.points, started.normal, started.given_sigma_m,
                   world_covariance(first.pose.cam_from_world, tangent_covariance(fit)));
    map_ = mapping_.scene();
  }

  // The start frame was fitted as if at rest: refits it with the motion that the next frame implies.
  void refine_start(capture::Timestamp started_at, capture::Timestamp at) {
    auto& [first, started] = *pending_start_;
    std::vector<PoseObservation> seen;
    for (const PointSighting& s : first.sightings)
      seen.push_back({started.points[static_cast<std::size_t>(s.point)], s.px, s.sigma_px});
    first.prior = tracking_.motion_from_next(started_at, at);
    first.pose.sweep.last_row = camera_.image_size.height - 1;
    first.readout = tracking_.readout();
    first.flow_px = flow_px(last_.pose.cam_from_world);
    first.readout_sigma_px = first.readout.sigma_s * first.flow_px / std::max(1e-3, capture::seconds(at - started_at));
    const auto refitted = tracking_.refit_with_motion(*first.prior, started_at, first.pose.cam_from_world, seen, at);
    if (refitted) first.pose = refitted->pose;
    map_from_start(refitted ? refitted->fit : started.pose);
  }

  void coast(capture::Timestamp at) {
    if (state_ == PoseState::tracking) {
      state_ = PoseState::coasting;
      coasting_covariance_ = covariance_;
    }
    if (state_ != PoseState::coasting) return;
    const double t = capture::seconds(at - tracked_at_);
    if (t > coast_s) {
      state_ = PoseState::lost;
      tracking_.forget();
      return;
    }
    covariance_ = coasting_covariance_;
    covariance_.diagonal().head<3>().array() += coast_m_s * coast_m_s * t * t;
    covariance_.diagonal().tail<3>().array() += coast_rad_s * coast_rad_s * t * t;
  }

  // The start's error, common to all poses, transferred to this camera position.
  Covariance6d start_covariance_at(const calib::Rigid3d& cam_from_world) const {
    const Eigen::Vector3d arm = calib::inverse(cam_from_world).translation - map_.start_centre;
    Covariance6d carry = Covariance6d::Identity();
    carry.topRightCorner<3, 3>() << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0;
    return carry * map_.start_covariance * carry.transpose();
  }

  // Median image motion of the points since the last pose.
  double flow_px(const calib::Rigid3d& now) const {
    std::vector<double> flow;
    for (const PointSighting& s : last_.sightings) {
      const auto before = camera_.model.project(pose_ * map_.point(s.point).position);
      const auto after = camera_.model.project(now * map_.point(s.point).position);
      if (before && after) flow.push_back((after->px - before->px).norm());
    }
    return calib::median(std::move(flow));
  }

  void fill(CameraEstimate& estimate, const ProvenPose& proof) const {
    estimate.state = state_;
    estimate.map_points = map_.alive_count();
    estimate.effective_sample_size = std::max(1.0, tracking_.effective_sample_size());
    estimate.readout_s = tracking_.readout().mean_s, estimate.readout_sigma_s = tracking_.readout().sigma_s;
    if (!estimate.has_pose()) return;
    estimate.world_from_camera = calib::inverse(pose_);
    estimate.covariance = covariance_;
    estimate.features_in_view = proof.evidence.sought + proof.evidence.corners;
    estimate.features_matched = state_ == PoseState::tracking ? proof.evidence.found + proof.evidence.corners : 0;
    if (estimate.features_in_view > 0)
      estimate.confidence = static_cast<double>(estimate.features_matched) / estimate.features_in_view;
  }

  struct PendingStart {
    PosedFrame frame;
    StartResult start;
  };

  calib::Camera camera_;
  CameraStarter starter_;
  std::optional<PendingStart> pending_start_;  // until the frame after the start
  KeyframeTracking tracking_;
  KeyframeMapping mapping_;  // used by mapper_ only while it runs
  SceneMap map_;             // the copy for tracking_
  std::optional<PosedFrame> to_map_;
  int particle_count_;
  std::uint64_t frames_ = 0;
  bool started_ = false;
  bool is_map_unproven_ = false;  // a loaded map without a proven pose so far
  PoseState state_ = PoseState::searching;
  capture::Timestamp tracked_at_{};
  calib::Rigid3d pose_;
  Covariance6d covariance_ = Covariance6d::Zero(), coasting_covariance_ = Covariance6d::Zero();
  ProvenPose last_;
  ParallelTask mapper_;  // last: destroyed first
};

}  // namespace

std::unique_ptr<CameraTracker> make_keyframe_tracker(const calib::Camera& camera, const CameraTrackerOptions& options) {
  return std::make_unique<KeyframeTracker>(camera, options);
}

}  // namespace huetrack::keyframes
