#include "calib/wave/consistent_regions.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/model/closest_approach.h"
#include "calib/model/index.h"

namespace huetrack::wave {
namespace {

using calib::index;
using Eigen::Vector3d;

struct RegionRay {
  Vector3d direction;  // world, unit
  double radius_rad;   // apparent
};

class Rays {
 public:
  Rays(const calib::CameraRig& rig, const std::vector<BallFrame>& frames) : of_frames_(frames.size()) {
    for (std::size_t f = 0; f < frames.size(); ++f) {
      const calib::Camera& camera = rig.cameras[index(frames[f].camera)];
      for (const color::ColorRegion& region : frames[f].regions) {
        const auto ray = camera.model.ray({region.centre});
        const double radius_px = 2 * std::pow(region.spread.determinant(), 0.25);  // of a disc
        std::optional<RegionRay>& out = of_frames_[f].emplace_back();
        if (ray)
          out = RegionRay{camera.cam_from_world.rotation.conjugate() * ray->normalized(),
                          radius_px / camera.model.fx() * ray->z() / ray->norm()};
      }
    }
  }
  const std::vector<std::optional<RegionRay>>& of(std::size_t frame) const { return of_frames_[frame]; }

 private:
  std::vector<std::vector<std::optional<RegionRay>>> of_frames_;
};

// Squared sigmas by which two rays disagree; nullopt: they do not meet before both cameras.
std::optional<double> disagreement(const Vector3d& base, const RegionRay& a, const RegionRay& b, double radius_m,
                                   const ConsistencyTuning& tuning) {
  constexpr double least_sin2 = 1e-3;
  const auto nearest = calib::closest_approach(base, a.direction, b.direction, least_sin2);
  if (!nearest || nearest->along_0 <= 0 || nearest->along_1 <= 0) return std::nullopt;
  const double gap_m = std::abs(base.dot(a.direction.cross(b.direction))) / std::sqrt(nearest->sin2);
  const double gap = gap_m / std::min(nearest->along_0, nearest->along_1) / tuning.gap;
  const double size_a = std::log(a.radius_rad * nearest->along_0 / radius_m) / tuning.log_size,
               size_b = std::log(b.radius_rad * nearest->along_1 / radius_m) / tuning.log_size;
  return gap * gap + size_a * size_a + size_b * size_b;
}

// Per frame and camera, the frame nearest in time.
std::vector<std::vector<std::optional<std::size_t>>> nearest_frames(std::size_t cameras,
                                                                    const std::vector<BallFrame>& frames,
                                                                    double most_apart_s) {
  std::vector<std::vector<std::optional<std::size_t>>> out(frames.size(),
                                                           std::vector<std::optional<std::size_t>>(cameras));
  std::vector<std::optional<std::size_t>> latest(cameras);
  const auto consider = [&](std::size_t f) {
    for (std::size_t c = 0; c < cameras; ++c) {
      if (!latest[c]) continue;
      const auto apart = [&](std::size_t other) { return std::abs(frames[other].t_s - frames[f].t_s); };
      if (apart(*latest[c]) < (out[f][c] ? apart(*out[f][c]) : most_apart_s)) out[f][c] = latest[c];
    }
    latest[index(frames[f].camera)] = f;
  };
  for (std::size_t f = 0; f < frames.size(); ++f) consider(f);
  latest.assign(cameras, std::nullopt);
  for (std::size_t f = frames.size(); f-- > 0;) consider(f);
  return out;
}

}  // namespace

std::vector<int> consistent_regions(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, double radius_m,
                                    double most_apart_s, const ConsistencyTuning& tuning) {
  const Rays rays(rig, frames);
  const auto nearest = nearest_frames(rig.cameras.size(), frames, most_apart_s);
  std::vector<int> chosen(frames.size(), -1);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    double best = 0;
    for (std::size_t r = 0; r < rays.of(f).size(); ++r) {
      if (!rays.of(f)[r]) continue;
      double gain = 0;  // over a region that is inconsistent with all, squared sigmas
      for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
        if (c == index(frames[f].camera) || !nearest[f][c]) continue;
        const Vector3d base = rig.cameras[c].centre() - rig.cameras[index(frames[f].camera)].centre();
        double least = tuning.most_sigmas2;
        for (const auto& other : rays.of(*nearest[f][c])) {
          if (!other) continue;
          if (const auto off = disagreement(base, *rays.of(f)[r], *other, radius_m, tuning))
            least = std::min(least, *off);
        }
        gain += tuning.most_sigmas2 - least;
      }
      if (gain > best) best = gain, chosen[f] = static_cast<int>(r);
    }
  }
  return chosen;
}

}  // namespace huetrack::wave
