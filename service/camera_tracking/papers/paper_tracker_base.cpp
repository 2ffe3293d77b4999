#include "camera_tracking/papers/paper_tracker_base.h"

#include <Eigen/LU>
#include <algorithm>
#include <stdexcept>
#include <string>

#include "camera_tracking/relocalizer.h"

namespace huetrack::papers {

using namespace camera_tracking;

namespace {

// A proposal needs so many features within so many pixels (their maps are coarser than ours); the filter then judges
// it.
constexpr double map_error_px = 6;
constexpr int agreeing = 10;
constexpr int probation = 3;  // frames in a row that have to prove the pose, once it was lost, before it is told
// A proof, whatever the filter makes of it: a pose that is fitted to what was matched, without the filter, has so many
// points within so many pixels, most of those that should be seen, leaves so little open, and is where the filter says.
constexpr int proving = 8;
constexpr double proven_px = 2.5, proven_share = 0.65, proven_sigma_m = 0.02, proven_off_m = 0.05;
constexpr double told_sigma_m = 0.05;  // a pose that leaves more open is no claim
constexpr int patience = 4;            // frames
constexpr double coast_s = 1.0;        // the particles disperse meanwhile, and say how far

}  // namespace

PaperTrackerBase::PaperTrackerBase(const calib::Camera& camera, const CameraTrackerOptions& options)
    : camera_(camera), starter_(camera, options.start), seed_(options.seed), as_printed_(options.as_printed) {
  if (options.load_map.empty()) return;
  loaded_ = read_map(options.load_map);
  if (loaded_->image_size != Eigen::Vector2i(camera.image_size.width, camera.image_size.height))
    throw std::runtime_error(options.load_map.string() + ": is a map of images of another size than the camera's");
  has_map_ = true;
}

void PaperTrackerBase::save_map(const std::filesystem::path& file) const {
  write_map(file, {scene(), {}, {camera_.image_size.width, camera_.image_size.height}});
}

std::optional<PoseFit> PaperTrackerBase::proposal(const Pyramid& pyramid, std::uint64_t number) const {
  return relocalize(camera_, pyramid, scene(), seed_ + number, map_error_px, agreeing);
}

bool PaperTrackerBase::proven(const FilteredPose& pose) const {
  if (static_cast<int>(pose.seen.size()) < proving) return false;
  const PoseFit fit = refine_pose(camera_.model, pose.seen, pose.cam_from_world);
  const auto agree = static_cast<int>(std::ranges::count_if(fit.error, [](double e) { return e < proven_px; }));
  if (agree < proving || agree < proven_share * pose.in_view) return false;
  const double scale = std::max(1.0, fit.scale);
  const Eigen::Matrix<double, 6, 6> covariance = scale * scale * fit.information.inverse();
  const double sigma_m = std::sqrt(world_covariance(fit.cam_from_world, covariance).topLeftCorner<3, 3>().trace());
  const double off_m =
      (calib::inverse(fit.cam_from_world).translation - calib::inverse(pose.cam_from_world).translation).norm();
  return sigma_m < proven_sigma_m && off_m < proven_off_m;
}

// The fit's or the particles' own, about their mean, and what the map and the world's start leave open.
Covariance6d PaperTrackerBase::covariance_of(const FilteredPose& pose, const calib::Rigid3d& cam_from_world) const {
  Covariance6d covariance = start_covariance_;
  if (pose.polished) {
    const double scale = std::max(1.0, pose.polished->scale);
    const Eigen::Matrix<double, 6, 6> own = scale * scale * pose.polished->information.inverse();
    covariance += world_covariance(cam_from_world, own);
  } else {
    covariance += particles().covariance(cam_from_world);
  }
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
    if (!started_ && has_map_) find_way_in(*pyramid, estimate.frame_number);
    pose = started_ ? follow(frame, grey, pyramid, estimate.frame_number)
                    : begin(frame, grey, pyramid, estimate.frame_number);
  }
  if (!started_) return estimate;
  const calib::Rigid3d cam_from_world = usable ? pose.cam_from_world : particles().mean();
  const Covariance6d covariance = covariance_of(pose, cam_from_world);
  settle_state(pose, covariance, frame.captured_at);
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

// Into a loaded map, by the looks of its features.
void PaperTrackerBase::find_way_in(const Pyramid& pyramid, std::uint64_t number) {
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
  if (has_map_) {  // is it the map's world? That is to be proven
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
  // Not in the papers, whose particles only disperse until they happen upon the features again: after some frames
  // without support the stored looks of the features propose a pose, and now and then what was started from is
  // looked for. The filter has to agree in the frames that follow.
  if (unsupported_ >= patience && !as_printed_) {
    if (const auto found = proposal(*pyramid, number)) {
      restart(found->cam_from_world);
    } else if (unsupported_ % 5 == 0) {
      if (const auto again = starter_.find_again(frame.pixels, grey, particles().mean())) {
        restart(*again);
        probation_ = has_map_ ? probation : 0;  // a proof in itself, where it is what the map began with
      }
    }
  }
  FilteredPose pose = track(pyramid, number);
  unsupported_ = pose.tracked ? 0 : unsupported_ + 1;
  // A filter that lost the features may happen upon something else: from then on it has to be proven.
  if (unsupported_ >= patience) probation_ = probation;
  if (probation_ > 0 && pose.tracked) {
    probation_ = proven(pose) ? probation_ - 1 : probation;
    pose.tracked = false;
  }
  return pose;
}

void PaperTrackerBase::settle_state(const FilteredPose& pose, const Covariance6d& covariance, capture::Timestamp at) {
  if (pose.tracked && covariance.topLeftCorner<3, 3>().trace() < told_sigma_m * told_sigma_m) {
    state_ = PoseState::tracking;
    tracked_at_ = at;
  } else if (state_ == PoseState::tracking || state_ == PoseState::coasting) {
    state_ = capture::seconds(at - tracked_at_) > coast_s ? PoseState::lost : PoseState::coasting;
  } else if (state_ == PoseState::searching) {
    state_ = PoseState::lost;  // a map was loaded, and the way in was not right
  }
}

}  // namespace huetrack::papers
