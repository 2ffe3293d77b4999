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

struct DetectionTuning {
  double probability = 0.9;  // P_D: a view detects an object that should be visible; else something unknown hides it
};
inline constexpr DetectionTuning detection{};

// Density of unassociated regions per camera and place, and how much they stand out (DiscFinder). A set's regions count
// with the next add(): by then it is known which of them are objects. thread-compatible; one per target.
class ClutterMap {
 public:
  explicit ClutterMap(const calib::CameraRig& rig);
  // Before a set's regions are judged. regions[i]: all regions of views[i] that no known object explains.
  void look(const std::vector<object_tracking::TargetView>& views,
            std::span<const std::vector<color::ColorRegion>> regions);
  // After that: the same regions.
  void add(const std::vector<object_tracking::TargetView>& views,
           std::span<const std::vector<color::ColorRegion>> regions);
  // The regions of the last add() that these sightings are of are an object with this probability.
  void claim(std::span<const object_tracking::Sighting> sightings, double probability = 1);
  void forget(std::size_t camera);  // it was moved

  // Per px^2 and set, > 0: of the regions that were seen within radius_px.
  double density(std::size_t camera, const Eigen::Vector2d& px, double radius_px) const;
  // What the regions of the last look() add to it, wherever they are: most of them will be clutter.
  double unjudged(std::size_t camera) const;
  double expected(std::size_t camera) const;  // regions per set, of the last look(), too; > 0
  // The mean set shows more regions than a search looks at: the object may not be among them.
  bool is_crowded(std::size_t camera) const;
  // Natural logarithm of p(evidence | target) / p(evidence | clutter of this view): an amplitude feature (Lerro and
  // Bar-Shalom 1993). 0: nothing is known.
  double log_ratio(std::size_t camera, const color::DiscEvidence& evidence) const;

 private:
  static constexpr int cell_px = 4;  // layout: of the map
  struct Open {
    Eigen::Vector2d centre;
    float clutter;  // probability
  };
  struct Marks {  // per set
    double regions = 0, discs = 0;
    double evidence = 0;  // sum over the discs, DiscEvidence::odds
  };
  struct PerCamera {
    int columns = 0, rows = 0;
    double pixels = 1;
    double sets = 0;                             // in the means
    double regions = 0;                          // per set, in the image
    std::vector<float> around;                   // per set, per cell
    double others_now = 0;                       // regions of the last look(), but for one that may be an object
    Marks marks = {};                            // with the last look()
    std::optional<std::vector<Open>> open = {};  // regions of the last add(): not counted yet
  };
  static void count(PerCamera& of, std::span<const Open> regions);
  static double counted(const PerCamera& of);  // regions per set, > 0
  std::vector<PerCamera> cameras_;
};

}  // namespace huetrack::objects
