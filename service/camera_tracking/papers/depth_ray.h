// How far a new point is along the ray on which it was first seen: weights of discrete depths, sharpened by where the
// rays of the camera's particles pass it. Pupilli and Calway, section 5; Lee, section 3.3 and Fig. 3.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

namespace huetrack::papers {

// thread-compatible.
class DepthRay {
 public:
  // origin, direction: of the reference ray in the world, metres, unit. near_m, far_m: the depths that are looked at,
  // in equal steps of the inverse depth.
  DepthRay(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double near_m, double far_m,
           int bins = 160);

  // One frame: begin(), add() for every particle's ray through every place where the template is seen, end().
  void begin();
  // The other ray and the reference ray come nearest at a depth of the reference ray, `p` apart (Fig. 3); that depth
  // gains weight * exp(-p^2 / (2 sigma^2)), sigma = sigma_rad times the distance. Nearly parallel rays, and depths
  // outside, add nothing.
  void add(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double weight, double sigma_rad);
  // Multiplies what was added into the weights (with a floor, so that one wrong frame does not end it). false: nothing
  // was added.
  bool end();

  struct Estimate {
    double inverse_depth = 0, sigma = 0;  // 1/m, of the mode's surroundings
  };
  // Set once the weights are one peak: 9 tenths of them within a tenth of its inverse depth (or three bins); and a ray
  // crossed at an angle at which one pixel is 3 % of the inverse depth: frames are not independent, and many that look
  // from nearly the same place agree on a wrong depth.
  std::optional<Estimate> converged() const;
  int frames() const { return frames_; }
  const std::vector<double>& weights() const { return weight_; }  // sum 1; bin i is of inverse_depth(i)
  double inverse_depth(std::size_t bin) const { return least_ + step_ * (static_cast<double>(bin) + 0.5); }
  const Eigen::Vector3d& origin() const { return origin_; }
  const Eigen::Vector3d& direction() const { return direction_; }

 private:
  Eigen::Vector3d origin_, direction_;
  double least_, step_;
  std::vector<double> weight_, gained_;
  int frames_ = 0;
  double finest_ = std::numeric_limits<double>::infinity();  // 1/m, of the rays that were added
};

}  // namespace huetrack::papers
