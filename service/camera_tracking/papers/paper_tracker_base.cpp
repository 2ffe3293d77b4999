#include "camera_tracking/papers/paper_tracker_base.h"

#include <Eigen/LU>
#include <algorithm>
#include <string>

#include "camera_tracking/relocalizer.h"
#include "particle_filter/resample.h"

namespace huetrack::papers {

namespace {

constexpr double map_error_px = 6;  // of the relocalisation: these maps are coarser than ours
constexpr int probation = 3;        // consecutive frames that have to prove a pose after a loss
// Proof, independent of the filter: a pose fitted to the matches has so many points within proven_px, most of those in
// view, a small sigma, and is near the filter's pose.
constexpr int proving = 8;
constexpr double proven_px = 2.5, proven_share = 0.65, proven_sigma_m = 0.02, proven_off_m = 0.05;
constexpr double published_sigma_m = 0.05;  // largest sigma of a `tracking` pose, all axes
constexpr int patience = 4;                 // unsupported frames before a relocalisation
constexpr double coast_s = 1.0;             // meanwhile the particles disperse

}  // namespace

PaperTrackerBase::PaperTrackerBase(const calib::Camera& camera, const CameraTrackerOptions& options)
    : camera_(camera), starter_(camera, options.start), seed_(options.seed), as_printed_(options.as_printed) {
  if (options.load_map.empty()) return;
  loaded_ = read_map(options.load_map, camera.image_size);
  has_map_ = true;
}

void PaperTrackerBase::save_map(const std::filesystem::path& file) const {
  write_map(file, {scene(), {}, {camera_.image_size.width, camera_.image_size.height}});
}

std::optional<PoseFit> PaperTrackerBase::proposal(const Pyramid& pyramid, std::uint64_t number) const {
  return relocalize(camera_, pyramid, scene(), seed_ + number, map_error_px);
}

bool PaperTrackerBase::proven(const FilteredPose& pose) const {
  if (static_cast<int>(pose.seen.size()) < proving) return false;
  const PoseFit fit = refine_pose(camera_.model, pose.seen, pose.cam_from_world);
  const auto agree = static_cast<int>(std::ranges::count_if(fit.error, [](double e) { return e < proven_px; }));
  if (agree < proving || agree < proven_share * pose.in_view) return false;
  const double off_m =
      (calib::inverse(fit.cam_from_world).translation - calib::inverse(pose.cam_from_world).translation).norm();
  return position_sigma_m(fit) < proven_sigma_m && off_m < proven_off_m;
}

// Of the fit or the particles, plus that of the map and of the start.
Covariance6d PaperTrackerBase::covariance_of(const FilteredPose& pose, const calib::Rigid3d& cam_from_world) const {
  Covariance6d covariance = start_covariance_;
  covariance += pose.polished ? world_covariance(cam_from_world, tangent_covariance(*pose.polished))
                              : particles().covariance(cam_from_world);
  const double shared = pose.map_sigma_m * pose.map_sigma_m;
  covariance.diagonal().head<3>().array() += 1e-8 + shared;
  covariance.diagonal().tail<3>().array() += 1e-8 + shared / (pose.depth_m * pose.depth_m);
  return covariance;
}

std::string PaperTrackerBase::why_no_pose() const {
  if (state_ == PoseState::searching && !started_) return starter_.why_not();
  if (state_ == PoseState::tracking || state_ == PoseState::coasting) return {};
  return has_map_ ? "nothing of the loaded map is recognised in the view, or too little to be sure"
                  : "nothing of what was mapped is recognised in the view, or too little to be sure";
}

CameraEstimate PaperTrackerBase::update(const capture::Frame& frame) {
  CameraEstimate estimate;
  estimate.at = frame.captured_at;
  estimate.frame_number = frames_++;
  const bool usable = frame.status == capture::FrameStatus::ok && frame.pixels.width == camera_.image_size.width &&
                      frame.pixels.height == camera_.image_size.height;
  FilteredPose pose;
  if (usable) {
    const GreyImage grey = grey_of(frame.pixels);
    const auto pyramid = std::make_shared<const Pyramid>(make_pyramid(grey));
    if (!started_ && has_map_) relocalise_into_map(*pyramid, estimate.frame_number);
    pose = started_ ? follow(frame, grey, pyramid, estimate.frame_number)
                    : begin(frame, grey, pyramid, estimate.frame_number);
  }
  if (!started_) return estimate;
  const calib::Rigid3d cam_from_world = usable ? pose.cam_from_world : particles().mean();
  const Covariance6d covariance = covariance_of(pose, cam_from_world);
  update_state(pose, covariance, frame.captured_at);
  estimate.state = state_;
  estimate.particle_count = static_cast<int>(particles().size());
  estimate.effective_sample_size = std::clamp(particle_filter::effective_sample_size(particles().weight), 1.0,
                                              static_cast<double>(particles().size()));
  estimate.map_points = pose.map_points;
  if (!estimate.has_pose()) return estimate;
  estimate.world_from_camera = calib::inverse(cam_from_world);
  estimate.covariance = covariance;
  estimate.features_in_view = pose.in_view;
  estimate.features_matched = state_ == PoseState::tracking ? pose.matched : 0;
  if (pose.in_view > 0) estimate.confidence = static_cast<double>(estimate.features_matched) / pose.in_view;
  return estimate;
}

void PaperTrackerBase::begin_anew() {
  if (!started_) return;
  state_ = PoseState::lost;
  unsupported_ = patience;
  probation_ = probation;
}

void PaperTrackerBase::relocalise_into_map(const Pyramid& pyramid, std::uint64_t number) {
  const auto found = proposal(pyramid, number);
  if (!found) return;
  restart(found->cam_from_world);
  started_ = true;
  probation_ = probation;
}

FilteredPose PaperTrackerBase::begin(const capture::Frame& frame, const GreyImage& grey,
                                     const std::shared_ptr<const Pyramid>& pyramid, std::uint64_t number) {
  const auto found = starter_.find(frame.pixels, grey);
  if (!found) return {};
  started_ = true;
  const Eigen::Matrix<double, 6, 6> inverse_information = found->pose.information.inverse();
  start_covariance_ = world_covariance(found->pose.cam_from_world, inverse_information);
  if (has_map_) {  // not necessarily the map's world: to be proven
    restart(found->pose.cam_from_world);
    probation_ = probation;
    FilteredPose pose;
    pose.cam_from_world = found->pose.cam_from_world;
    return pose;
  }
  start(pyramid, *found, number);
  const int n = static_cast<int>(found->points.size());
  return {true, found->pose.cam_from_world, n, n, n, 0, 1, {}, {}};
}

FilteredPose PaperTrackerBase::follow(const capture::Frame& frame, const GreyImage& grey,
                                      const std::shared_ptr<const Pyramid>& pyramid, std::uint64_t number) {
  // Not in the papers, whose particles only disperse: after some unsupported frames the relocaliser or the start,
  // detected again, proposes a pose, which the filter has to confirm in the frames that follow.
  if (unsupported_ >= patience && !as_printed_) {
    if (const auto found = proposal(*pyramid, number)) {
      restart(found->cam_from_world);
    } else if (unsupported_ % 5 == 0) {
      if (const auto again = starter_.find_again(frame.pixels, grey, particles().mean())) {
        restart(*again);
        probation_ = has_map_ ? probation : 0;  // the start proves a pose of the map that began with it
      }
    }
  }
  FilteredPose pose = track(pyramid, number);
  unsupported_ = pose.tracked ? 0 : unsupported_ + 1;
  // A filter that lost its features may converge to something else.
  if (unsupported_ >= patience) probation_ = probation;
  if (probation_ > 0 && pose.tracked) {
    probation_ = proven(pose) ? probation_ - 1 : probation;
    pose.tracked = false;
  }
  return pose;
}

void PaperTrackerBase::update_state(const FilteredPose& pose, const Covariance6d& covariance, capture::Timestamp at) {
  if (pose.tracked && covariance.topLeftCorner<3, 3>().trace() < published_sigma_m * published_sigma_m) {
    state_ = PoseState::tracking;
    tracked_at_ = at;
  } else if (state_ == PoseState::tracking || state_ == PoseState::coasting) {
    state_ = capture::seconds(at - tracked_at_) > coast_s ? PoseState::lost : PoseState::coasting;
  } else if (state_ == PoseState::searching) {
    state_ = PoseState::lost;  // in a loaded map, after a wrong relocalisation
  }
}

}  // namespace huetrack::papers
