// Correlation fields and observation sets of Pupilli and Calway, eqs. (3)-(7): the likelihood of a map point as a
// look-up table for the particles.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "camera_tracking/ncc.h"

namespace huetrack::camera_tracking {

// One field, eq. (3), over the region in which the particles project. Pixels of the field's level of the pyramid.
// thread-compatible.
class ObservationField {
 public:
  // Clips the region to where the template lies inside the image (it may become empty) and correlates.
  void correlate(const GreyImage& image, const NccTemplate& t, const PixelRegion& region);

  // Stores for each pixel the largest weighted rho > epsilon_rho within radius epsilon_d, else 0: eqs. (4), (6).
  void mark(float epsilon_rho, float epsilon_d);

  // Sets rho <= epsilon_rho to 0.
  void threshold(float epsilon_rho);

  // Adds the marked value at each particle's projection (0 outside): the point's term of the sum of eq. (5).
  //   binary  adds 1 instead of rho, as eq. (5) is printed
  void score(std::span<const float> u, std::span<const float> v, bool binary, std::span<float> log_weight) const;

  // Eq. (7): multiplies rho of each pixel by the weight of the given particles that project within epsilon_d of it,
  // scaled to a maximum of 1. Call mark() afterwards.
  void reweight(std::span<const float> u, std::span<const float> v, std::span<const float> weight, float epsilon_d);

  // The largest weighted rho within radius of (u, v); rho 0: none above epsilon_rho.
  NccPeak strongest(float u, float v, float radius, float epsilon_rho) const;
  // Sub-pixel peak of the unweighted field within radius of px; nullopt: none above epsilon_rho.
  std::optional<Eigen::Vector2d> best_match(const Eigen::Vector2d& px, double radius, float epsilon_rho) const;
  const PixelRegion& region() const { return region_; }
  const std::vector<float>& rho() const { return rho_; }
  float centre_offset() const { return offset_; }  // of the template's centre from an anchor

 private:
  PixelRegion region_;
  float offset_ = 0;
  std::vector<float> rho_, marked_, weight_;
  std::vector<float> as_correlated_;  // rho_ before threshold() and reweight(); empty: as rho_
};

}  // namespace huetrack::camera_tracking
