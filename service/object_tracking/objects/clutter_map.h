// Where regions of the target's colour are that are no objects.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "color/color_region.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::objects {

// Density of unassociated regions per camera and place. A set's regions count with the next add(): by then it is known
// which of them are objects. thread-compatible; one per target.
class ClutterMap {
 public:
  explicit ClutterMap(const calib::CameraRig& rig);
  // Not clutter: the regions of the last add() that these sightings are of.
  void claim(std::span<const object_tracking::Sighting> sightings);
  // regions[i]: all regions of views[i] that no known object explains.
  void add(const std::vector<object_tracking::TargetView>& views,
           std::span<const std::vector<color::ColorRegion>> regions);
  double density(std::size_t camera, const Eigen::Vector2d& px) const;  // per px^2 and set, > 0
  void forget(std::size_t camera);                                      // it was moved

 private:
  static constexpr int cell_px = 16;  // layout: of the map
  struct PerCamera {
    int columns = 0, rows = 0;
    double pixels = 1;
    double sets = 0;                                        // in the means
    double regions = 0;                                     // per set, in the image
    std::vector<float> around;                              // per set, per cell
    std::optional<std::vector<Eigen::Vector2d>> open = {};  // centres of the last add()'s regions: not counted yet
  };
  static void count(PerCamera& of, std::span<const Eigen::Vector2d> centres);
  static double expected(const PerCamera& of);  // regions per set, in the image
  std::vector<PerCamera> cameras_;
};

}  // namespace huetrack::objects
