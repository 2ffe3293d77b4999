// How honest positions are by a rig that a calibration left uncertain: the cameras are where a draw from the rig's own
// covariance puts them, two or more of them see a ball that flies through the volume, and the tracker has the rig.
//   rig_draws RIG.yaml [DRAWS [CAMERAS [SECONDS]]]
// prints NEES (3 is perfect) and the share inside the 95 % ellipsoid, with the rig's uncertainty and without.
#include <fmt/core.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "calib/model/rig_yaml.h"
#include "object_tracking/object_tracker.h"
#include "particle_filter/random.h"
#include "scene/scene.h"

namespace {

using namespace huetrack;
using Eigen::Vector3d;

struct Honesty {
  double nees = 0, inside = 0, squares = 0;
  int samples = 0;
  void add(const object_tracking::ObjectEstimate& e, const Vector3d& truth) {
    const Vector3d off = e.position - truth;
    const double d2 = off.dot(e.covariance.inverse() * off);
    constexpr double chi2_95 = 7.815;  // three degrees of freedom
    nees += d2, inside += d2 <= chi2_95 ? 1 : 0, squares += off.squaredNorm(), ++samples;
  }
  void add(const Honesty& o) {
    nees += o.nees, inside += o.inside, squares += o.squares, samples += o.samples;
  }
  double mean() const { return nees / std::max(1, samples); }
  double rms_mm() const { return 1e3 * std::sqrt(squares / std::max(1, samples)); }
};

// The first cameras of a rig, with what is uncertain of them.
calib::CameraRig first_cameras(calib::CameraRig rig, std::size_t count) {
  if (count >= rig.cameras.size()) return rig;
  rig.cameras.resize(count);
  if (rig.uncertainty) {
    auto cameras = rig.uncertainty->cameras;
    cameras.resize(count);
    const int size = cameras.back().at + cameras.back().size();
    rig.uncertainty =
        calib::RigUncertainty::of(cameras, rig.uncertainty->covariance().topLeftCorner(size, size));
  }
  return rig;
}

object_tracking::ObjectTracker tracker_of(const calib::CameraRig& rig, const Vector3d& middle, std::uint64_t seed) {
  object_tracking::TargetOptions target;
  target.name = "lime";
  target.color = {70, 115, 0.3, 1, 0.1, 0.95};
  object_tracking::ObjectTrackerOptions options;
  options.volume = {middle - Vector3d(1.1, 1.1, 1), middle + Vector3d(1.1, 1.1, 1)};
  options.seed = seed;
  return {rig, target, options};
}

// Where all cameras look: the point nearest to their axes.
Vector3d middle_of(const calib::CameraRig& rig) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const calib::Camera& camera : rig.cameras) {
    const Vector3d axis = camera.cam_from_world.rotation.conjugate() * Vector3d::UnitZ();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    sum += across;
    right += across * camera.centre();
  }
  return sum.inverse() * right;
}

}  // namespace

int main(int argc, char** argv) {
  const calib::CameraRig rig =
      first_cameras(calib::read_rig(argv[1]), argc > 3 ? std::strtoul(argv[3], nullptr, 10) : 99);
  const int draws = argc > 2 ? std::atoi(argv[2]) : 20;
  const double seconds = argc > 4 ? std::atof(argv[4]) : 3;
  if (!rig.uncertainty) return 1;
  calib::CameraRig exact = rig;
  exact.uncertainty.reset();
  const Vector3d middle = middle_of(rig);
  const Eigen::MatrixXd factor = rig.uncertainty->factor();
  Honesty with, without;
  for (int draw = 0; draw < draws; ++draw) {
    particle_filter::Rng rng(17, static_cast<std::uint64_t>(draw));
    std::vector<float> unit(static_cast<std::size_t>(factor.cols()));
    rng.fill_normal(unit);
    Eigen::VectorXd normal(factor.cols());
    for (Eigen::Index k = 0; k < normal.size(); ++k) normal(k) = static_cast<double>(unit[static_cast<std::size_t>(k)]);
    scene::SceneBuilder builder;
    const calib::CameraRig truth = calib::with_errors(rig, factor * normal);
    for (const calib::Camera& camera : truth.cameras) builder.camera(camera);
    const double phase = 0.7 * draw;
    scene::BallOptions ball;
    ball.path = [=](double t) {
      return Vector3d(middle + Vector3d(0.5 * std::sin(1.3 * t + phase), 0.45 * std::cos(1.1 * t + 2 * phase),
                                        0.3 * std::sin(1.7 * t - phase)));
    };
    const scene::Scene scene = builder.ball(ball).build();
    auto tracker = tracker_of(rig, middle, static_cast<std::uint64_t>(draw) + 1);
    auto trusting = tracker_of(exact, middle, static_cast<std::uint64_t>(draw) + 1);
    Honesty a, b;
    for (const auto& set : scene::render(scene, {.set_count = static_cast<int>(30 * seconds), .seed = 100 + static_cast<std::uint64_t>(draw)})) {
      const auto e = tracker.update(set), f = trusting.update(set);
      if (!e.has_position()) continue;
      a.add(e, scene.ball_at(0, e.at));
      b.add(f, scene.ball_at(0, f.at));
    }
    fmt::print("draw {:2}: {} samples, rms {:.2f} mm, NEES {:.2f}, without {:.2f}\n", draw, a.samples, a.rms_mm(),
               a.mean(), b.mean());
    with.add(a), without.add(b);
  }
  fmt::print("all: rms {:.2f} mm, NEES {:.2f}, inside 95 % {:.1f} %; without the rig's uncertainty NEES {:.2f}, {:.1f} %\n",
             with.rms_mm(), with.mean(), 100 * with.inside / with.samples, without.mean(),
             100 * without.inside / without.samples);
}
