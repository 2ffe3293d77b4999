#include "calib/wave/wave_adjustment.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "calib/solver/calibration_error.h"
#include "calib/wave/similarity.h"
#include "wave/waving.h"

namespace huetrack::wave {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double knot_s = 1.0 / 30;

struct Problem {
  calib::CameraRig rig;
  WaveState state;
  std::vector<BallObservation> observations;
  WaveAdjustmentOptions options;
};

struct ProblemOptions {
  int cameras = 3;
  double seconds = 3, noise_px = 0.15;
  std::uint64_t seed = 1;
  std::vector<CameraTime> times{};
  std::function<Vector3d(double)> path = lissajous;
};

// The state is the truth; the observations have white noise.
Problem problem_of(const ProblemOptions& o) {
  Problem p;
  p.rig = rig_of(o.cameras);
  for (const calib::Camera& camera : p.rig.cameras) p.state.cam_from_world.push_back(camera.cam_from_world);
  p.state.path = BallPath::over(-0.1, o.seconds + 0.1, knot_s);
  for (std::size_t k = 0; k < p.state.path.control.size(); ++k)
    p.state.path.control[k] = o.path(p.state.path.start_s + (static_cast<double>(k) - 1) * knot_s);
  std::mt19937_64 rng(o.seed);
  std::normal_distribution<double> noise(0, o.noise_px);
  for (int c = 0; c < o.cameras; ++c) {
    const calib::Camera& camera = p.rig.cameras[static_cast<std::size_t>(c)];
    const CameraTime time = o.times.empty() ? CameraTime{} : o.times[static_cast<std::size_t>(c)];
    for (int i = 0; i < static_cast<int>(o.seconds / knot_s); ++i) {
      const double middle_s = i * knot_s + 0.007 * c;
      double exposed_s = middle_s;
      std::optional<Vector2d> px;
      for (int round = 0; round < 4; ++round) {
        px = outline_centre(camera.model, camera.cam_from_world * p.state.path.at(exposed_s), 0.04);
        if (px) exposed_s = middle_s + below_middle(camera, *px) * time.readout_s;
      }
      if (!px || !camera.contains({*px})) continue;
      p.observations.push_back({c, middle_s + time.latency_s, *px + drawn<2>(rng, noise),
                                std::max(1e-4, o.noise_px * o.noise_px) * Eigen::Matrix2d::Identity()});
    }
  }
  p.options.loss = 1000;
  p.options.correlation = {.constant_share = 0, .slow_share = 0};
  return p;
}

// A camera's centre and rotation (world axes), true less found.
Eigen::Matrix<double, 6, 1> pose_error(const calib::Rigid3d& found, const calib::Rigid3d& truth) {
  const Eigen::AngleAxisd turn(found.rotation.conjugate() * truth.rotation);
  Eigen::Matrix<double, 6, 1> error;
  error << calib::inverse(truth).translation - calib::inverse(found).translation, turn.angle() * turn.axis();
  return error;
}

void move_off(WaveState& state, double size, std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  std::normal_distribution<double> normal(0, size);
  for (std::size_t c = 1; c < state.cam_from_world.size(); ++c) {
    calib::Tangent6d t;
    for (int i = 0; i < 6; ++i) t(i) = normal(rng);
    state.cam_from_world[c] = calib::exp(t) * state.cam_from_world[c];
  }
}

double distance_of(const WaveState& state, std::size_t a, std::size_t b) {
  return (calib::inverse(state.cam_from_world[a]).translation - calib::inverse(state.cam_from_world[b]).translation)
      .norm();
}

TEST(WaveAdjustment, FindsTheTruthFromExactOutlines) {
  Problem p = problem_of({.noise_px = 0});
  const std::vector<calib::Rigid3d> truth = p.state.cam_from_world;
  const double distance = distance_of(p.state, 0, 1);
  move_off(p.state, 0.02, 3);
  const double scale = distance_of(p.state, 0, 1) / distance;  // of the start, which stays
  adjust_wave(p.rig, p.observations, p.state, p.options);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_LT(p.state.cam_from_world[c].rotation.angularDistance(truth[c].rotation), 2e-4) << c;
    const Vector3d expected = calib::inverse(truth[0]).translation +
                              scale * (calib::inverse(truth[c]).translation - calib::inverse(truth[0]).translation);
    EXPECT_LT((calib::inverse(p.state.cam_from_world[c]).translation - expected).norm(), 1e-3) << c;
  }
}

// As CovarianceIsThatOfRepeatedExperiments, of lenses that start elsewhere. Their priors are as wide as not to matter.
TEST(WaveAdjustment, LensesAreFoundWithTheirCovariance) {
  constexpr int trials = 16;
  LensChange wide;
  wide << 1, 100, 100, 1, 1, 0.05, 0.05;
  double sum = 0;
  for (int trial = 0; trial < trials; ++trial) {
    Problem p = problem_of({.seconds = 6, .noise_px = 0.015, .seed = static_cast<std::uint64_t>(trial + 1)});
    LensChange off;
    off << -0.03, 4, -3, 0.05, -0.01, 0.001, -0.001;
    for (calib::Camera& camera : p.rig.cameras) camera.model = changed(camera.model, off);
    p.options.any_lens_sigmas.assign(3, wide);
    p.options.frames_as_one.assign(3, 1);
    p.options.with_covariance = true;
    p.state.times.resize(3);
    const WaveFit fit = adjust_wave(p.rig, p.observations, p.state, p.options);
    const LensChange error = -off - p.state.lenses[2];
    const Eigen::Matrix<double, lens_freedom, lens_freedom> own =
        fit.covariance.bottomRightCorner<lens_freedom, lens_freedom>();
    sum += error.dot(own.ldlt().solve(error)) / lens_freedom / trials;
  }
  EXPECT_NEAR(sum, 1, 4 * std::sqrt(2.0 / (lens_freedom * trials)));
}

TEST(WaveAdjustment, AGivenLensGivesWayOnlyIfItIsContradicted) {
  LensChange any, given;
  any << 0.25, 10, 10, 0.15, 0.1, 1e-3, 1e-3;
  given << 2e-4, 0.1, 0.1, 1e-3, 3e-3, 1e-4, 1e-4;
  for (const double off : {0.0, 0.03}) {
    Problem p = problem_of({.seconds = 6});
    LensChange change = LensChange::Zero();
    change[0] = off;
    p.rig.cameras[1].model = changed(p.rig.cameras[1].model, change);
    p.options.any_lens_sigmas.assign(3, any), p.options.given_lens_sigmas.assign(3, given);
    p.options.frames_as_one.assign(3, 1);
    adjust_wave(p.rig, p.observations, p.state, p.options);
    EXPECT_NEAR(p.state.lenses[1][0], -off, off == 0 ? 2e-4 : 5e-3);
    EXPECT_NEAR(p.state.lenses[2][0], 0, 4e-4);
  }
}

// By the sum over all pairs of frames.
TEST(WaveAdjustment, CorrelatedFramesCountAsFewer) {
  const OutlineCorrelation correlation{.constant_share = 0.2, .slow_share = 0.25, .slow_s = 0.4};
  constexpr int frames = 3000;
  double sum = 0;
  for (int i = 0; i < frames; ++i)
    for (int k = 0; k < frames; ++k) sum += (i == k ? 0.55 : 0) + 0.25 * std::exp(-std::abs(i - k) / 30.0 / 0.4);
  EXPECT_NEAR(correlation.frames_as_one(1 / 30.0), sum / frames, 0.05);
}

TEST(WaveAdjustment, ScaleAndReferenceStay) {
  Problem p = problem_of({});
  move_off(p.state, 0.01, 1);
  const double distance = distance_of(p.state, 0, 1);
  const calib::Rigid3d reference = p.state.cam_from_world[0];
  adjust_wave(p.rig, p.observations, p.state, p.options);
  EXPECT_NEAR(distance_of(p.state, 0, 1), distance, 1e-6);
  EXPECT_EQ(p.state.cam_from_world[0].translation, reference.translation);
}

// Squared errors in their own standard deviations, over poses and times of many noisy recordings: chi-square, mean 1.
TEST(WaveAdjustment, CovarianceIsThatOfRepeatedExperiments) {
  const std::vector<CameraTime> times{{0, 0.02}, {0.01, -0.015}, {-0.005, 0.01}};
  constexpr int trials = 24;
  double poses = 0, latency = 0, readout = 0;
  for (int trial = 0; trial < trials; ++trial) {
    Problem p = problem_of({.seed = static_cast<std::uint64_t>(trial + 1), .times = times});
    const std::vector<calib::Rigid3d> truth = p.state.cam_from_world;
    p.state.times = times;
    p.options.times.assign(3, TimePrior{});
    p.options.with_covariance = true;
    const WaveFit fit = adjust_wave(p.rig, p.observations, p.state, p.options);
    const auto error = pose_error(p.state.cam_from_world[2], truth[2]);
    const Eigen::Matrix<double, 6, 6> own = fit.covariance.block<6, 6>(12, 12);
    poses += error.dot(own.ldlt().solve(error)) / 6 / trials;
    for (const std::size_t c : {1, 2}) {
      const auto i = static_cast<Eigen::Index>(2 * c);
      latency += std::pow(p.state.times[c].latency_s - times[c].latency_s, 2) / fit.time_covariance(i, i) / 2 / trials;
      readout +=
          std::pow(p.state.times[c].readout_s - times[c].readout_s, 2) / fit.time_covariance(i + 1, i + 1) / 2 / trials;
    }
    EXPECT_EQ(fit.time_covariance(0, 0), 0) << "the time reference's latency is exact";
    EXPECT_TRUE(fit.covariance.topLeftCorner(6, 6).isZero()) << "and so is the reference's pose";
  }
  // The standard deviation of each mean is sqrt(2 / (trials * degrees of freedom)).
  EXPECT_NEAR(poses, 1, 4 * std::sqrt(2.0 / (6 * trials)));
  EXPECT_NEAR(latency, 1, 4 * std::sqrt(2.0 / (2 * trials)));
  EXPECT_NEAR(readout, 1, 4 * std::sqrt(2.0 / (2 * trials)));
}

// A prior that counts often is as uncertain as it says where the outlines hardly show the readout.
TEST(WaveAdjustment, APriorOfReadoutsKeepsItsUncertainty) {
  Problem p = problem_of({.noise_px = 3});
  for (BallObservation& o : p.observations) o.covariance *= 1e6;
  p.state.times.assign(3, {});
  p.options.times.assign(3, TimePrior{.time = {}, .readout_sigma_s = 1});
  constexpr double mean_s = 0.004, sigma_s = 0.019;
  p.options.any_readouts.assign(3, {.mean_s = mean_s, .sigma_s = sigma_s, .weight = 15});
  p.options.hold_poses = p.options.with_covariance = true;
  const WaveFit fit = adjust_wave(p.rig, p.observations, p.state, p.options);
  for (const std::size_t c : {0, 1, 2}) {
    const auto i = static_cast<Eigen::Index>(2 * c + 1);
    EXPECT_NEAR(p.state.times[c].readout_s, mean_s, 1e-3);
    EXPECT_NEAR(std::sqrt(fit.time_covariance(i, i)), sigma_s, 0.1 * sigma_s);
  }
}

// Another world frame and unit of length changes poses and path by that similarity, and no residual.
TEST(WaveAdjustment, DoesNotDependOnWorldFrameAndUnit) {
  const Problem p = problem_of({});
  const Similarity change{.scale = 100,  // centimetres
                          .rotation = Eigen::AngleAxisd(1.1, Vector3d(2, 1, -1).normalized()).matrix(),
                          .translation = {50, -300, 20}};
  Problem moved = p;
  change.apply(moved.state);
  moved.options.radius_m *= change.scale;
  moved.options.jerk_m_s3 *= change.scale;
  Problem here = p;
  here.options.with_covariance = moved.options.with_covariance = true;
  const WaveFit a = adjust_wave(here.rig, here.observations, here.state, here.options);
  const WaveFit b = adjust_wave(moved.rig, moved.observations, moved.state, moved.options);
  EXPECT_NEAR(a.cost, b.cost, 1e-6 * a.cost);
  change.apply(here.state);
  for (std::size_t c = 0; c < 3; ++c) {
    const calib::Rigid3d &x = here.state.cam_from_world[c], &y = moved.state.cam_from_world[c];
    EXPECT_LT((calib::inverse(x).translation - calib::inverse(y).translation).norm(), 1e-3) << c;  // of centimetres
    EXPECT_LT(x.rotation.angularDistance(y.rotation), 1e-5) << c;
    const auto i = static_cast<Eigen::Index>(6 * c);
    const Eigen::Matrix3d expected =
        change.scale * change.scale * change.rotation * a.covariance.block<3, 3>(i, i) * change.rotation.transpose();
    EXPECT_LT((expected - b.covariance.block<3, 3>(i, i)).norm(), 0.01 * expected.norm() + 1e-12) << c;
  }
}

TEST(WaveAdjustment, DoesNotDependOnTheOrderOfCameras) {
  Problem p = problem_of({}), reversed = p;
  std::ranges::reverse(reversed.rig.cameras);
  std::ranges::reverse(reversed.state.cam_from_world);
  for (BallObservation& o : reversed.observations) o.camera = 2 - o.camera;
  reversed.options.reference = 2;
  reversed.options.scale_a = 2, reversed.options.scale_b = 1;
  p.options.with_covariance = reversed.options.with_covariance = true;
  const WaveFit a = adjust_wave(p.rig, p.observations, p.state, p.options);
  const WaveFit b = adjust_wave(reversed.rig, reversed.observations, reversed.state, reversed.options);
  EXPECT_NEAR(a.cost, b.cost, 1e-7 * a.cost);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_LT((p.state.cam_from_world[c].translation - reversed.state.cam_from_world[2 - c].translation).norm(), 1e-5);
    const auto i = static_cast<Eigen::Index>(6 * c), k = static_cast<Eigen::Index>(6 * (2 - c));
    EXPECT_LT((a.covariance.block<6, 6>(i, i) - b.covariance.block<6, 6>(k, k)).norm(), 1e-3 * a.covariance.norm())
        << c;
  }
}

TEST(WaveAdjustment, TwiceTheNoiseIsFourTimesTheCovariance) {
  const auto covariance = [](double noise_px) {
    Problem p = problem_of({.noise_px = noise_px});
    p.options.with_covariance = true;
    return Eigen::MatrixXd(adjust_wave(p.rig, p.observations, p.state, p.options).covariance);
  };
  const double once = covariance(0.05).trace(), twice = covariance(0.1).trace();
  // Not exactly: how smooth the path is does not follow.
  EXPECT_GT(twice / once, 2.5);
  EXPECT_LT(twice / once, 4.6);
}

TEST(WaveAdjustment, CorrelatedErrorsMakeTheCovarianceLarger) {
  Problem p = problem_of({});
  p.options.with_covariance = true;
  const double white = adjust_wave(p.rig, p.observations, p.state, p.options).covariance.trace();
  p.options.correlation = {.constant_share = 0.2, .slow_share = 0.25};
  const double correlated = adjust_wave(p.rig, p.observations, p.state, p.options).covariance.trace();
  p.options.wander_s = {0, 0.003, 0};
  const double wandering = adjust_wave(p.rig, p.observations, p.state, p.options).covariance.trace();
  EXPECT_GT(correlated, 1.5 * white);
  EXPECT_GT(wandering, 1.2 * correlated);
}

TEST(WaveAdjustment, OneWrongOutlineHardlyCounts) {
  Problem p = problem_of({}), spoilt = p;
  spoilt.observations[20].px += Vector2d(80, -60);
  p.options.loss = spoilt.options.loss = 3;
  adjust_wave(p.rig, p.observations, p.state, p.options);
  const WaveFit fit = adjust_wave(spoilt.rig, spoilt.observations, spoilt.state, spoilt.options);
  EXPECT_GT(fit.distance2[20], 1e4);
  for (std::size_t c = 1; c < 3; ++c)
    EXPECT_LT((p.state.cam_from_world[c].translation - spoilt.state.cam_from_world[c].translation).norm(), 0.002);
}

TEST(WaveAdjustment, HeldPosesStay) {
  const std::vector<CameraTime> times{{0, 0.02}, {0.012, 0}, {0, 0}};
  Problem p = problem_of({.times = times});
  const std::vector<calib::Rigid3d> before = p.state.cam_from_world;
  p.options.hold_poses = true;
  p.options.times.assign(3, TimePrior{});
  p.options.with_covariance = true;
  const WaveFit fit = adjust_wave(p.rig, p.observations, p.state, p.options);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(p.state.cam_from_world[c].translation, before[c].translation);
  EXPECT_TRUE(fit.covariance.isZero());
  EXPECT_NEAR(p.state.times[1].latency_s, 0.012, 5e-4);
  EXPECT_NEAR(p.state.times[0].readout_s, 0.02, 3e-3);
}

// The evidence is largest near the jerk that the path has.
TEST(WaveAdjustment, EvidencePrefersTheJerkOfThePath) {
  Problem p = problem_of({});
  const auto evidence = [&](double jerk) {
    WaveState state = p.state;
    WaveAdjustmentOptions options = p.options;
    options.jerk_m_s3 = jerk;
    options.with_evidence = true;
    return adjust_wave(p.rig, p.observations, state, options).evidence;
  };
  const double usual = evidence(6);  // the third derivative of lissajous() is some 6 m/s^3
  EXPECT_GT(usual, evidence(0.3));
  EXPECT_GT(usual, evidence(600));
}

// A ball that rests at one place: cameras may turn around it.
TEST(WaveAdjustment, UndeterminedPosesAreANamedErrorOrHaveAHugeCovariance) {
  Problem p = problem_of({.noise_px = 0, .path = [](double) { return Vector3d(0, 0, 1); }});
  p.options.with_covariance = true;
  try {
    EXPECT_GT(adjust_wave(p.rig, p.observations, p.state, p.options).covariance.trace(), 10);
  } catch (const solver::CalibrationError& error) {
    EXPECT_EQ(error.fault(), solver::Fault::undetermined_poses) << error.what();
  }
}

TEST(WaveAdjustment, CameraWithoutAnObservationStays) {
  Problem p = problem_of({});
  std::erase_if(p.observations, [](const BallObservation& o) { return o.camera == 2; });
  const calib::Rigid3d before = p.state.cam_from_world[2];
  p.options.with_covariance = true;
  const WaveFit fit = adjust_wave(p.rig, p.observations, p.state, p.options);
  EXPECT_EQ(p.state.cam_from_world[2].translation, before.translation);
  EXPECT_TRUE(fit.covariance.bottomRightCorner(6, 6).isZero());
}

}  // namespace
}  // namespace huetrack::wave
