#include "reports/tracked_sets.h"

#include <Eigen/Eigenvalues>

namespace huetrack::reports {

void TrackedSets::add(const object_tracking::ObjectEstimate& estimate) {
  ++all_;
  if (estimate.state != object_tracking::TrackState::tracking) return;
  ++tracked_;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(estimate.covariance, Eigen::EigenvaluesOnly);
  if (axes.eigenvalues()[judged_axis_] > radius_m_ * radius_m_) ++unsure_;
}

}  // namespace huetrack::reports
