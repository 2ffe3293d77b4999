#include "camera_tracking/keyframes/swept_fit.h"

#include <gmock/gmock.h>

#include <Eigen/LU>

#include "camera_tracking/drawn_rectangle.h"
#include "particle_filter/random.h"

namespace huetrack::keyframes {
namespace {

using camera_tracking::camera;
using camera_tracking::look_at;
using camera_tracking::PoseObservation;
using camera_tracking::Sweep;
using camera_tracking::SweptPose;

constexpr double last_row = 239, fps = 30;

calib::Tangent6d tangent(double a, double b, double c, double d, double e, double f) {
  calib::Tangent6d out;
  out << a, b, c, d, e, f;
  return out;
}

// What a camera that turns and moves evenly sees of some points.
struct Flight {
  calib::Tangent6d velocity = tangent(0.6, -2.0, 0.3, 0.2, -0.1, 0.1);  // per second
  double readout_s = 0.03;
  double noise_px = 0;
  std::uint64_t seed = 4;
  calib::Rigid3d middle = look_at({0.1, -0.5, 0.45}, {0, 0, 0});

  capture::Timestamp at(int frame) const { return capture::Timestamp(capture::duration_of(frame / fps)); }
  calib::Rigid3d pose(int frame) const { return calib::exp(calib::Tangent6d(velocity * (frame / fps))) * middle; }
  SweptPose swept() const { return {middle, {readout_s * velocity, calib::Tangent6d::Zero(), last_row}}; }
  // The last of some frames is the one that is looked at.
  MotionPrior prior(const Readout& readout) const {
    CameraMotion motion;
    constexpr int before = 8;
    for (int i = 0; i < before; ++i) motion.add(at(i), pose(i - before), 1e-10 * Matrix6d::Identity());
    return motion.prior(at(before), readout);
  }
  std::vector<PoseObservation> seen(int points = 60) const {
    const calib::Camera c = camera();
    particle_filter::Rng rng(seed);
    std::vector<float> noise(256 * 2);
    rng.fill_normal(noise);
    std::vector<PoseObservation> out;
    for (int i = 0; i < points; ++i) {
      const Eigen::Vector3d p(0.5 * rng.uniform() - 0.25, 0.4 * rng.uniform() - 0.2, 0.1 * rng.uniform());
      const auto px = project_swept(c.model, swept(), p);
      const auto k = static_cast<std::size_t>(2 * i);
      const Eigen::Vector2d error = Eigen::Vector2f(noise[k], noise[k + 1]).cast<double>();
      out.push_back({p, px->px + noise_px * error, noise_px > 0 ? noise_px : 0.3});
    }
    return out;
  }
};

SweptPose still(const calib::Rigid3d& cam_from_world) {
  return {cam_from_world, {calib::Tangent6d::Zero(), calib::Tangent6d::Zero(), last_row}};
}

double pose_error(const calib::Rigid3d& a, const calib::Rigid3d& b) {
  return calib::log(a * calib::inverse(b)).norm();
}

TEST(SweptPose, ProjectionIsConsistentWithItsRow) {
  const calib::Camera c = camera();
  const SweptPose pose = Flight{}.swept();
  for (const Eigen::Vector3d& p :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.1, 0.12, 0.05), Eigen::Vector3d(-0.1, -0.1, 0)}) {
    const auto seen = project_swept(c.model, pose, p);
    ASSERT_TRUE(seen);
    EXPECT_LT((c.model.project(pose.at(seen->px.y()) * p)->px - seen->px).norm(), 0.01);
    EXPECT_LT(pose_error(seen->cam_from_world, pose.at(seen->px.y())), 1e-4);
  }
  EXPECT_GT((project_swept(c.model, pose, {0.1, 0.12, 0.05})->px -
             c.model.project(pose.cam_from_world * Eigen::Vector3d(0.1, 0.12, 0.05))->px)
                .norm(),
            1.5);
}

TEST(SweptFit, KnownReadoutGivesTheMiddleRowsPose) {
  const Flight flight;
  const SweptFit fit =
      refine_swept_pose(camera().model, flight.seen(), still(flight.pose(-1)), flight.prior({0.03, 1e-4}), 15);
  EXPECT_LT(pose_error(fit.pose.cam_from_world, flight.middle), 1e-4);
  EXPECT_LT((fit.pose.sweep.motion - flight.readout_s * flight.velocity).norm(), 1e-4);
  // As if all rows were of one moment, the same points mislead by a hundred times that.
  const auto global = camera_tracking::refine_pose(camera().model, flight.seen(), flight.pose(-1), 15);
  EXPECT_GT(pose_error(global.cam_from_world, flight.middle), 1e-2);
}

TEST(SweptFit, EstimatesAnUnknownReadout) {
  for (const double readout_s : {-0.02, 0.0, 0.015, 0.03}) {
    Flight flight;
    flight.readout_s = readout_s, flight.noise_px = 0.3;
    const auto seen = flight.seen();
    MotionPrior prior = flight.prior({0, 0.02});
    const SweptPose start{flight.pose(0), prior.sweep(flight.pose(0), last_row)};
    const SweptFit fit = refine_swept_pose(camera().model, seen, start, prior, 15);
    EXPECT_LT(pose_error(fit.pose.cam_from_world, flight.middle), 0.004) << readout_s;
    ASSERT_TRUE(fit.readout);
    EXPECT_LT(std::abs(fit.readout->mean_s - readout_s), 3 * fit.readout->sigma_s) << readout_s;
    EXPECT_LT(fit.readout->sigma_s, 2e-3);
    prior.readout = {readout_s, 1e-5};
    const SweptFit known = refine_swept_pose(camera().model, seen, start, prior, 15);
    EXPECT_GT(fit.fit.information.inverse().trace(), known.fit.information.inverse().trace());
  }
}

TEST(SweptFit, CovarianceIsConsistent) {
  double nees = 0;
  constexpr int runs = 60;
  for (int i = 0; i < runs; ++i) {
    Flight flight;
    flight.noise_px = 0.3, flight.seed = static_cast<std::uint64_t>(10 + i);
    const MotionPrior prior = flight.prior({0, 0.02});
    const SweptFit fit = refine_swept_pose(camera().model, flight.seen(40), still(flight.middle), prior, 15);
    const calib::Tangent6d error = calib::log(flight.middle * calib::inverse(fit.pose.cam_from_world));
    nees += error.dot(fit.fit.information * error) / runs;
  }
  EXPECT_GT(nees, 3.0);  // 6, if the velocity were as uncertain as the prior says; here it is exact
  EXPECT_LT(nees, 7.5);
}

// Besides four known points, points with a wrong depth and a large sigma along their line: they improve the pose.
TEST(SweptFit, UncertainDepthsConstrainAcrossTheirLine) {
  const auto cam = camera().model;
  double with = 0, without = 0, ignored = 0;
  constexpr int runs = 20;
  for (int run = 0; run < runs; ++run) {
    Flight flight;
    flight.noise_px = 0.2, flight.seed = static_cast<std::uint64_t>(run + 1);
    auto seen = flight.seen(64);
    const MotionPrior prior = flight.prior({0.03, 1e-4});
    const auto error = [&](const std::vector<PoseObservation>& o) {
      return pose_error(refine_swept_pose(cam, o, still(flight.pose(0)), prior, 15).pose.cam_from_world,
                        flight.middle) /
             runs;
    };
    without += error({seen.begin(), seen.begin() + 4});
    for (std::size_t i = 4; i < seen.size(); ++i) {  // too near or too far along the ray of a camera 0.1 m aside
      const Eigen::Vector3d from = calib::inverse(flight.middle).translation + Eigen::Vector3d(0.1, 0.02, 0);
      const Eigen::Vector3d along = 0.3 * (seen[i].p_world - from);
      const auto swept = project_swept(cam, flight.swept(), seen[i].p_world);
      const auto further = cam.project(swept->cam_from_world * (seen[i].p_world + along));
      ASSERT_TRUE(further);
      seen[i].p_world += (i % 2 ? 0.5 : -0.5) * along;
      seen[i].line_sigma_px = further->px - swept->px;
    }
    with += error(seen);
    for (PoseObservation& o : seen) o.line_sigma_px.setZero();
    ignored += error(seen);
  }
  EXPECT_LT(with, 0.6 * without);
  EXPECT_GT(ignored, 3 * with);
}

TEST(SweptFit, ReadoutIsUnobservableAtRest) {
  Flight flight;
  flight.velocity.setZero(), flight.noise_px = 0.3;
  const SweptFit fit = refine_swept_pose(camera().model, flight.seen(), flight.swept(), flight.prior({0, 0.02}), 15);
  EXPECT_LT(pose_error(fit.pose.cam_from_world, flight.middle), 0.003);
  EXPECT_GT(fit.readout.value_or(Readout{0, 1}).sigma_s, 0.02);
}

}  // namespace
}  // namespace huetrack::keyframes
