// Outlines of a ball in single views, each fitted by itself beside the truth: how far off they are, and what their
// pixels allow at best.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "benchmark/sequence.h"
#include "outline/outline_fit.h"

namespace huetrack::figures {

struct OutlineView {
  int camera = 0;
  outline::Fit fit;
  Eigen::Vector2d off_px;                        // of the fit's centre, from where the truth has the outline's
  std::optional<Eigen::Vector2d> region_off_px;  // of the colour's region there
  double radius_px = 0;                          // of the outline
  Eigen::Vector2d px_per_s;                      // of its centre
  Eigen::Matrix<double, 2, 3> jacobian;          // d px / d p_world at the truth
  double visible = 1;                            // share of the ball that can be seen
  double took_s = 0;                             // of one fit
};

// One entry per set, with a view for each that shows at least 30 % of the ball; those of the first second are empty:
// what is behind is learnt then, as the tracker learns it. Each fit begins off_radii of the outline's radius beside the
// truth, in a direction that goes around from set to set. Rows are exposed as the rig's timing says; the stamps are
// taken for the times of the row on which the ball's centre lies.
std::vector<std::vector<OutlineView>> fit_outlines(const Sequence& sequence,
                                                   const object_tracking::TargetOptions& target,
                                                   double off_radii = 0.3);

// What an efficient estimator would make of the pixels of single sets (Cramer-Rao, by the image's noise and gradients,
// were all but the position known): rms over the sets in which two or more views show more than half of the ball,
// metres. A filter that uses many sets may be better. nullopt: there is no such set.
std::optional<double> bound_of_sets_m(const std::vector<std::vector<OutlineView>>& sets);

}  // namespace huetrack::figures
