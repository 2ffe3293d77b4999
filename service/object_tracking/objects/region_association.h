// Data association of a view's regions with several objects of one colour. Objects whose predicted discs are separate:
// global nearest neighbour. Objects whose discs overlap: their outlines are fitted together (disc_fit.h). Not JPDA,
// which pulls near objects together (coalescence), while discs' sizes and motion leave hardly more than one association
// here.
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

// An object as predicted in one view.
struct ExpectedObject {
  std::size_t object = 0;  // the caller's index
  object_tracking::BallProjection at;
  Eigen::Matrix2d covariance;  // px^2, of at.px
  object_tracking::ImageMotion motion;
};

struct AssociatedSightings {
  std::vector<std::optional<object_tracking::Sighting>> of_objects;  // one per expected object
  std::vector<char> is_explained;                                    // per region: by an expected object
};

// thread-compatible.
class RegionAssociation {
 public:
  explicit RegionAssociation(double pixel_noise_px) : pixel_noise_px_(pixel_noise_px) {}
  // The sightings' rows have no time yet.
  AssociatedSightings associate(const object_tracking::TargetView& view, std::span<const color::ColorRegion> regions,
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

  double pixel_noise_px_;
};

}  // namespace huetrack::objects
