// Measures an object's centre by fitting its outline where the background is known: about five times as accurate as the
// centroid of its colour region, which is used elsewhere.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "object_tracking/covered_ball.h"
#include "object_tracking/expected_view.h"
#include "object_tracking/motion_state.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"
#include "object_tracking/tracker_options.h"
#include "outline/background.h"
#include "outline/outline_fit.h"

namespace huetrack::object_tracking {

// thread-compatible; one per target. Allocates only when a view is first seen.
class OutlineSighter {
 public:
  OutlineSighter(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options);

  // Replaces a region's sighting by the outline near it, if that is better. spread: covariance of the predicted place,
  // px^2. false: the sighting is unchanged.
  bool sharpen(const TargetView& view, const MotionState& state, const ExpectedView& expected,
               const Eigen::Matrix2d& spread, Sighting& sighting);

  bool is_enabled() const { return shape_ != TargetShape::blob && !is_blob_; }

  // nullopt: the background is not learnt, or not yet.
  std::optional<KnownBackground> behind(std::size_t camera) const;

  // Learns the background around the object and ahead of it.
  void learn(const std::vector<TargetView>& views, const MotionState& state);

  OutlineFindings findings() const;

 private:
  struct PerView {
    std::optional<outline::Background> behind;
    outline::AppearanceModel look;
    Eigen::Vector3d lit_at = Eigen::Vector3d::Zero();  // where its shading was learnt last, world; and when
    capture::Timestamp lit_when{};
    double log_size = 0, log_size_weight = 0;      // of the outline over the target's radius: mean, number of outlines
    double size_variance = 0;                      // of the mean: bias does not average out
    Eigen::Vector2d px = Eigen::Vector2d::Zero();  // of the last outline
    double still = 0;                              // correlation of its error with that of the one before
    bool is_sharp = false;                         // the last sighting was an outline
    bool begins_at_region = false;                 // initial radius of a fit where no size is known
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
