// Which of a view's regions belong to which of several objects of one colour: the association of a view's measurements
// with tracks. Objects whose predicted discs stay apart get a region each, by the assignment of least cost (global
// nearest neighbour over the view); those whose discs overlap in the image share what is there, and their outlines are
// fitted together (disc_fit.h).
//
// Why not JPDA: it averages over associations, and so pulls objects that come near to one another together
// (coalescence); here the discs' sizes and the motion leave hardly more than one association that counts, and where two
// objects are one region the question is not which of them it is.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "object_tracking/expected_view.h"
#include "object_tracking/objects/disc_fit.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::objects {

// An object, as one view may show it.
struct ExpectedObject {
  std::size_t object = 0;  // whose it is: the caller's
  object_tracking::BallProjection at;
  Eigen::Matrix2d covariance;  // px^2, of where it is expected
  object_tracking::ImageMotion motion;
};

struct AssociatedSightings {
  std::vector<std::optional<object_tracking::Sighting>> of_objects;  // one for each of those expected
  std::vector<char> is_explained;  // one for each region: by an object that was expected
};

// thread-compatible.
class RegionAssociation {
 public:
  explicit RegionAssociation(double pixel_noise_px) : pixel_noise_px_(pixel_noise_px) {}
  // The sightings' rows have no time yet.
  AssociatedSightings share(const object_tracking::TargetView& view, std::span<const color::ColorRegion> regions,
                            std::span<const ExpectedObject> expected) const;

 private:
  void assign(const object_tracking::TargetView& view, std::span<const color::ColorRegion> regions,
              std::span<const ExpectedObject> expected, AssociatedSightings& out, std::vector<int>& region_of) const;
  std::optional<object_tracking::Sighting> by_outline(const object_tracking::TargetView& view,
                                                      const ExpectedObject& expected,
                                                      const std::optional<FittedDisc>& fitted) const;
  object_tracking::Sighting by_region(const object_tracking::TargetView& view,
                                      std::span<const color::ColorRegion> regions, std::size_t which,
                                      const ExpectedObject& expected, AssociatedSightings& out) const;
  bool is_whole(const object_tracking::TargetView& view, const object_tracking::Sighting& by_region,
                const ExpectedObject& expected) const;

  double pixel_noise_px_;
};

}  // namespace huetrack::objects
