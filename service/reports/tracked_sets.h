// How often one target was tracked, and how often with little certainty.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>

#include "object_tracking/object_estimate.h"

namespace huetrack::reports {

class TrackedSets {
 public:
  // Of one camera the sigma across its ray counts: along it is the radius's.
  TrackedSets() = default;
  TrackedSets(double radius_m, std::size_t cameras) : radius_m_(radius_m), judged_axis_(cameras == 1 ? 1 : 2) {}

  void add(const object_tracking::ObjectEstimate& estimate);

  std::uint64_t all() const { return all_; }
  std::uint64_t tracked() const { return tracked_; }
  std::uint64_t unsure() const { return unsure_; }  // of tracked(): with a sigma above the radius

 private:
  double radius_m_ = 0;
  Eigen::Index judged_axis_ = 2;  // of the covariance's eigenvalues, ascending
  std::uint64_t all_ = 0, tracked_ = 0, unsure_ = 0;
};

}  // namespace huetrack::reports
