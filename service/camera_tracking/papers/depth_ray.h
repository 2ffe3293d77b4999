// The depth of a new point along its first ray: weights of discrete inverse depths, updated by the intersections with
// the rays of the camera's particles. Pupilli and Calway, section 5; Lee, section 3.3 and Fig. 3.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace huetrack::papers {

// thread-compatible.
class DepthRay {
 public:
  // The reference ray in the world (metres, unit direction) and its range of depths.
  DepthRay(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double near_m, double far_m,
           int bins = 160);

  // One frame: begin(), add() for every particle's ray through every place where the template is seen, end().
  void begin() { std::ranges::fill(gained_, 0.0); }
  // At the reference ray's point nearest to the other ray, at distance p (Fig. 3), adds weight * exp(-p^2 / (2 s^2)), s
  // = sigma_rad times the distance from the other origin. Nearly parallel rays and depths out of range add nothing.
  void add(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double weight, double sigma_rad);
  // Multiplies the weights by what was added, with a floor against single wrong frames. false: nothing was added.
  bool end();

  struct Estimate {
    double inverse_depth = 0, sigma = 0;  // 1/m, of the mode
  };
  // Set if 90 % of the weights lie within 10 % of the mode (or three bins), and some ray crossed at an angle at which
  // one pixel is at most 3 % of the inverse depth: frames from nearly the same place may agree on a wrong depth.
  std::optional<Estimate> converged() const;
  const std::vector<double>& weights() const { return weight_; }  // sum 1; bin i is of inverse_depth(i)
  // The inverse depths between which all but `tail` of the weight at either end lies: far, near.
  std::pair<double, double> interval(double tail) const;
  double inverse_depth(std::size_t bin) const { return least_ + step_ * (static_cast<double>(bin) + 0.5); }
  const Eigen::Vector3d& origin() const { return origin_; }
  const Eigen::Vector3d& direction() const { return direction_; }

 private:
  Eigen::Vector3d origin_, direction_;
  double least_, step_;
  std::vector<double> weight_, gained_;
  int frames_ = 0;
  double finest_ = std::numeric_limits<double>::infinity();  // 1/m, of the rays so far
};

}  // namespace huetrack::papers
