#include "camera_tracking/keyframes/swept_fit.h"

#include <gmock/gmock.h>

#include <Eigen/LU>

#include "camera_tracking/random_scene.h"
#include "drawn.h"
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
      const Eigen::Vector3d unit = drawn<3>(rng, [](particle_filter::Rng& of) { return of.uniform(); });
      const Eigen::Vector3d p = Eigen::Vector3d(0.5, 0.4, 0.1).cwiseProduct(unit) - Eigen::Vector3d(0.25, 0.2, 0);
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

// ---- Properties

using camera_tracking::distance;
using camera_tracking::RandomScene;

// A frame whose motion is drawn from its prior.
struct RandomFrame {
  RandomFrame(std::uint64_t seed, const Readout& readout, double sigma_px = 0.3, int points = 40) {
    RandomScene scene(seed);
    truth.cam_from_world = scene.pose();
    prior.readout = readout;
    prior.expected = truth.cam_from_world;
    prior.expected_velocity = scene.tangent(1.5, 0.3);
    for (int i = 0; i < 6; ++i) prior.velocity_covariance(i, i) = i < 3 ? 0.2 * 0.2 : 0.1 * 0.1;
    readout_s = readout.mean_s + readout.sigma_s * scene.normal();
    truth.sweep = {readout_s * (prior.expected_velocity + scene.tangent(0.2, 0.1)), calib::Tangent6d::Zero(), last_row};
    seen = scene.observe(truth, points, sigma_px);
    start = {calib::exp(scene.tangent(0.01, 0.005)) * truth.cam_from_world,
             prior.sweep(truth.cam_from_world, last_row)};
  }
  SweptFit fit() const { return refine_swept_pose(camera().model, seen, start, prior, 15); }

  SweptPose truth, start;
  MotionPrior prior;
  double readout_s = 0;
  std::vector<PoseObservation> seen;
};

TEST(SweptFitProperties, AtRestItIsTheFitOfAGlobalShutter) {
  RandomScene scene(1);
  for (int run = 0; run < 10; ++run) {
    const calib::Rigid3d truth = scene.pose(), start = calib::exp(scene.tangent(0.01, 0.005)) * truth;
    const auto seen = scene.observe({truth}, 30, 0.3);
    MotionPrior at_rest;
    at_rest.readout = {0.03, 0};
    const SweptFit swept = refine_swept_pose(camera().model, seen, still(start), at_rest, 15);
    const auto global = camera_tracking::refine_pose(camera().model, seen, start, 15);
    EXPECT_LT(distance(swept.pose.cam_from_world, global.cam_from_world), 1e-6);
    EXPECT_LT((swept.fit.information - global.information).norm(), 1e-3 * global.information.norm());
  }
}

TEST(SweptFitProperties, DoesNotDependOnTheOrder) {
  RandomFrame frame(2, {0.02, 0.005});
  const SweptFit a = frame.fit();
  std::ranges::reverse(frame.seen);
  const SweptFit b = frame.fit();
  EXPECT_LT(distance(a.pose.cam_from_world, b.pose.cam_from_world), 1e-9);
  EXPECT_LT((a.pose.sweep.motion - b.pose.sweep.motion).norm(), 1e-9);
  ASSERT_TRUE(a.readout && b.readout);
  EXPECT_NEAR(a.readout->mean_s, b.readout->mean_s, 1e-8);
}

TEST(SweptFitProperties, EquivariantToTheWorldFrame) {
  RandomScene scene(3);
  for (std::uint64_t run = 1; run <= 10; ++run) {
    RandomFrame frame(run, {0.02, 0.005});
    frame.prior.d_velocity_d_pose = 10 * Matrix6d::Identity();
    const SweptFit a = frame.fit();
    const calib::Rigid3d new_from_old = scene.transform(), old_from_new = calib::inverse(new_from_old);
    frame.seen = camera_tracking::moved(frame.seen, new_from_old);
    frame.start.cam_from_world = frame.start.cam_from_world * old_from_new;
    frame.prior.expected = frame.prior.expected * old_from_new;
    const SweptFit b = frame.fit();
    EXPECT_LT(distance(a.pose.cam_from_world * old_from_new, b.pose.cam_from_world), 1e-7);
    EXPECT_LT((a.pose.sweep.motion - b.pose.sweep.motion).norm(), 1e-7);
    EXPECT_LT((a.fit.information - b.fit.information).norm(), 1e-5 * a.fit.information.norm());
  }
}

TEST(SweptFitProperties, EquivariantToTheUnitOfLength) {
  for (const double s : {0.2, 5.0}) {
    RandomFrame frame(4, {0.02, 0.005});
    const SweptFit a = frame.fit();
    const Matrix6d unit = camera_tracking::unit_change(s);
    frame.seen = camera_tracking::scaled(frame.seen, s);
    frame.start.cam_from_world = camera_tracking::scaled(frame.start.cam_from_world, s);
    frame.start.sweep.motion = unit * frame.start.sweep.motion;
    frame.start.sweep.bend = unit * frame.start.sweep.bend;
    frame.prior.expected = camera_tracking::scaled(frame.prior.expected, s);
    frame.prior.expected_velocity = unit * frame.prior.expected_velocity;
    frame.prior.velocity_covariance = unit * frame.prior.velocity_covariance * unit;
    const SweptFit b = frame.fit();
    EXPECT_LT(distance(camera_tracking::scaled(a.pose.cam_from_world, s), b.pose.cam_from_world),
              1e-6 * std::max(1.0, s));
    EXPECT_LT((unit * a.pose.sweep.motion - b.pose.sweep.motion).norm(), 1e-6 * std::max(1.0, s));
    ASSERT_TRUE(a.readout && b.readout);
    EXPECT_NEAR(a.readout->mean_s, b.readout->mean_s, 1e-6);
    EXPECT_NEAR(a.readout->sigma_s, b.readout->sigma_s, 1e-3 * a.readout->sigma_s);
  }
}

// 6 for normal residuals; Tukey's weights make the information some 15 % too small.
TEST(SweptFitProperties, CovarianceMatchesMonteCarlo) {
  for (const Readout& readout : {Readout{0.03, 1e-6}, Readout{0.02, 0.008}}) {
    double nees = 0;
    constexpr int runs = 200;
    for (std::uint64_t run = 1; run <= runs; ++run) {
      const RandomFrame frame(run, readout);
      const SweptFit fit = frame.fit();
      const calib::Tangent6d error = calib::log(frame.truth.cam_from_world * calib::inverse(fit.pose.cam_from_world));
      nees += error.dot(fit.fit.information * error) / runs;
    }
    EXPECT_GT(nees, 4.0) << readout.mean_s;
    EXPECT_LT(nees, 7.0) << readout.mean_s;
  }
}

TEST(SweptFitProperties, ReadoutOfSingleFramesIsUnbiasedAndConsistent) {
  double error = 0, square = 0;
  int n = 0;
  for (std::uint64_t run = 1; run <= 200; ++run) {
    const RandomFrame frame(run, {0.02, 0.008});
    const auto measured = frame.fit().readout;
    if (!measured) continue;
    const double normalised = (measured->mean_s - frame.readout_s) / measured->sigma_s;
    error += normalised, square += normalised * normalised, ++n;
  }
  EXPECT_GT(n, 190);
  EXPECT_NEAR(error / n, 0, 0.3);
  EXPECT_GT(square / n, 0.4);
  EXPECT_LT(square / n, 1.8);
}

TEST(SweptFitProperties, TheReadoutsPriorIsRemovedFromItsMeasurement) {
  RandomFrame frame(5, {0.02, 0.008}, 0.1, 120);
  const auto measured = frame.fit().readout;
  frame.prior.readout.mean_s += 0.004;
  const auto shifted = frame.fit().readout;
  ASSERT_TRUE(measured && shifted);
  EXPECT_NEAR(measured->mean_s, shifted->mean_s, 0.3 * 0.004);
}

TEST(SweptFitProperties, SigmaAcrossTheLineOnly) {
  RandomFrame frame(6, {0.02, 0.001}, 0, 30);
  RandomScene scene(7);
  for (std::size_t i = 0; i < frame.seen.size(); i += 2) {  // displaced along a line of which that is the sigma
    const Eigen::Vector2d line = Eigen::Vector2d(scene.normal(), scene.normal()).normalized();
    frame.seen[i].px += 4 * line;
    frame.seen[i].line_sigma_px = 1e4 * line;
  }
  EXPECT_LT(distance(frame.fit().pose.cam_from_world, frame.truth.cam_from_world), 3e-3);
  for (PoseObservation& o : frame.seen) o.line_sigma_px.setZero();
  EXPECT_GT(distance(frame.fit().pose.cam_from_world, frame.truth.cam_from_world), 4e-3);
}

}  // namespace
}  // namespace huetrack::keyframes
