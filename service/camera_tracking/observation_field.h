// Where a point's template correlates in an image, as a table that particles look themselves up in: Pupilli and
// Calway's correlation fields and observation sets, eqs. (3)-(7).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "camera_tracking/ncc.h"

namespace huetrack::camera_tracking {

// One field, eq. (3), over the region in which the particles project. All pixels are of the field's own level of the
// pyramid. thread-compatible.
class ObservationField {
 public:
  // Correlates. The region is clipped to where the template lies inside the image; it may become empty.
  void correlate(const GreyImage& image, const NccTemplate& t, const PixelRegion& region);

  // The observation set is where rho > epsilon_rho, eq. (4). Each pixel learns the strongest rho (times its weight) of
  // the set within radius epsilon_d of it, 0 without one; so that eq. (6) for a particle is one look-up.
  void mark(float epsilon_rho, float epsilon_d);

  // Only the observation set is left: rho at or below epsilon_rho becomes 0.
  void threshold(float epsilon_rho);

  // Per particle: + gain * the marked value at its projection (0 outside): eq. (5)'s sum over points, for one of them.
  // binary: 1 instead of rho, which is eq. (5) to the letter.
  void score(std::span<const float> u, std::span<const float> v, float gain, bool binary,
             std::span<float> log_weight) const;

  // Eq. (7): rho of each pixel times the weight of the particles that project within epsilon_d of it (a subset of the
  // particles, u, v, weight), the largest being 1. Then mark() again.
  void reweight(std::span<const float> u, std::span<const float> v, std::span<const float> weight, float epsilon_d);

  // The strongest rho (with weights) within radius of (u, v); rho 0: none above epsilon_rho.
  NccPeak strongest(float u, float v, float radius, float epsilon_rho) const;
  // Where the template itself matches best within radius of (u, v), between the pixels; as correlate() left the field.
  // nullopt: nowhere above epsilon_rho.
  std::optional<Eigen::Vector2d> best_match(const Eigen::Vector2d& px, double radius, float epsilon_rho) const;
  const PixelRegion& region() const { return region_; }
  const std::vector<float>& rho() const { return rho_; }
  float centre_offset() const { return offset_; }  // of the template's centre from an anchor

 private:
  PixelRegion region_;
  float offset_ = 0;
  std::vector<float> rho_, marked_, weight_;
  std::vector<float> as_correlated_;  // rho_, once that is weighted
};

}  // namespace huetrack::camera_tracking
