// Sightings by the object's outline, where what is behind it is known: five times as right as the centre of its
// colour's region, which remains where it is not.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "object_tracking/expected_view.h"
#include "object_tracking/motion_belief.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "outline/background.h"
#include "outline/outline_fit.h"

namespace huetrack::object_tracking {

// thread-compatible; one per target. Allocates when a view is first seen, and not after that.
class OutlineSighter {
 public:
  OutlineSighter(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options);

  // The outline near a sighting that was made from a region, in its place. spread: of where the object is expected,
  // px^2. false: there is none, and the sighting is as it was.
  bool sharpen(const TargetView& view, const MotionBelief& belief, const ExpectedView& expected,
               const Eigen::Matrix2d& spread, Sighting& sighting);

  // Whether there is anything to be gained from the pixels around the object.
  bool is_sought() const { return shape_ != TargetShape::blob && !is_blob_; }

  // What is behind it in these views, where the object is by now and where it goes.
  void learn(const std::vector<TargetView>& views, const MotionBelief& belief);

  OutlineFindings findings() const;

 private:
  struct PerView {
    std::optional<outline::Background> behind;
    outline::AppearanceModel look;
    Eigen::Vector3d lit_at = Eigen::Vector3d::Zero();  // where its light was learnt last, world, and when
    capture::Timestamp lit_when{};
    double log_size = 0, log_size_weight = 0;  // of the outline over that of the target's radius: mean, and of how much
    double size_variance = 0;                  // of the mean: what of one outline's error lasts
    Eigen::Vector2d px = Eigen::Vector2d::Zero();  // of the last one
    double still = 0;                              // how much of its error is that of the one before
    bool is_sharp = false;
    bool begins_at_region = false;  // a fit, where no size is known
  };
  double radius_m_;
  TargetShape shape_;
  double pixel_noise_px_;
  std::vector<PerView> views_;
  outline::OutlineFit fit_;
  std::size_t fitted_ = 0, not_fitted_ = 0;
  bool is_blob_ = false;
};

}  // namespace huetrack::object_tracking
