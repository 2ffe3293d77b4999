// Properties of the comparison of views over random paths: hypotheses undo their faults, results do not depend on the
// order of cameras or on the world's frame, residuals have their expected variance.
#include "view_watch/pair_residuals.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "calib/model/covariance_ellipse.h"
#include "drawn.h"
#include "scene/scene.h"
#include "view_watch/camera_fit.h"

namespace huetrack::view_watch {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A path that fills the room.
std::function<Vector3d(double)> path_of(unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> phase(0, 2 * std::numbers::pi), rate(1.5, 3.5);
  const double a = phase(rng), b = phase(rng), c = phase(rng), fa = rate(rng), fb = rate(rng), fc = rate(rng);
  return [=](double t) {
    return Vector3d(0.6 * std::sin(fa * t + a), 0.6 * std::cos(fb * t + b), 1 + 0.4 * std::sin(fc * t + c));
  };
}

struct Views {
  double noise_px = 0;
  double sigma_px = 0.35;
  std::vector<double> delays_s = {};  // per camera, by which its samples show the past
  double period_s = 1 / 16.0, span_s = 3;
};

calib::CameraRig rig_of(int cameras) {
  return scene::SceneBuilder{}.cameras_on_ring({.count = cameras}).build().rig;
}

std::vector<Track> tracks_of(const calib::CameraRig& rig, unsigned seed, const Views& views = {}) {
  const auto path = path_of(seed);
  std::mt19937 rng(seed + 100);
  std::normal_distribution<double> noise(0, 1);
  std::vector<Track> tracks(rig.cameras.size());
  for (double t = 0; t < views.span_s; t += views.period_s) {
    for (std::size_t c = 0; c < tracks.size(); ++c) {
      const double delay_s = views.delays_s.empty() ? 0 : views.delays_s[c];
      const auto seen = rig.cameras[c].project_world(path(t - delay_s));
      if (!seen) continue;
      const Vector2d px = seen->px + views.noise_px * drawn<2>(rng, noise);
      const auto ray = rig.cameras[c].model.ray({px});
      tracks[c].push_back({.t_s = t, .px = px, .radius_px = 4, .sigma_px = views.sigma_px, .ray = ray->normalized()});
    }
  }
  return tracks;
}

// What a camera makes of other pixels than it should.
void change_pixels(const calib::Camera& camera, Track& track, const std::function<Vector2d(const Vector2d&)>& to) {
  for (SeenPoint& sample : track) {
    sample.px = to(sample.px);
    sample.ray = camera.model.ray({sample.px})->normalized();
  }
}

struct Fault {
  const char* name;
  std::function<void(calib::CameraRig&, std::vector<Track>&)> make;
  FaultHypothesis hypothesis;
};

calib::Camera turned(calib::Camera camera, const Vector3d& rad) {
  calib::Tangent6d tangent = calib::Tangent6d::Zero();
  tangent.head<3>() = rad;
  camera.cam_from_world = calib::exp(tangent) * camera.cam_from_world;
  return camera;
}

class HypothesisOf : public testing::TestWithParam<Fault> {};

TEST_P(HypothesisOf, UndoesItsFault) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    calib::CameraRig rig = rig_of(3);
    std::vector<Track> tracks = tracks_of(rig, seed);
    const TimeSigmas times(3, 0.0);
    ASSERT_LT(PairComparison(rig).agreement(tracks, {}, times).worst, 1e-6);
    GetParam().make(rig, tracks);
    const PairComparison comparison(rig);
    const auto as_is = comparison.agreement(tracks, {}, times);
    EXPECT_GT(as_is.worst, 2) << seed;
    EXPECT_GT(as_is.worst_px, 1) << seed;
    const auto undone = comparison.agreement(tracks, GetParam().hypothesis, times);
    EXPECT_EQ(undone.pairs, 3u);
    EXPECT_LT(undone.worst, 0.05) << seed;
    EXPECT_LT(undone.score, 0.01 * as_is.score) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Faults, HypothesisOf,
    testing::Values(Fault{"swapped",
                          [](calib::CameraRig&, std::vector<Track>& tracks) { std::swap(tracks[0], tracks[2]); },
                          {.really = {2, 1, 0}}},
                    Fault{"exchanged",
                          [](calib::CameraRig&, std::vector<Track>& tracks) {
                            std::rotate(tracks.begin(), tracks.begin() + 1, tracks.end());
                          },
                          {.really = {1, 2, 0}}},
                    Fault{"late",
                          [](calib::CameraRig&, std::vector<Track>& tracks) {
                            for (SeenPoint& sample : tracks[1]) sample.t_s += 0.125;
                          },
                          {.late_s = {0, 0.125, 0}}},
                    Fault{"turned",
                          [](calib::CameraRig& rig, std::vector<Track>&) {
                            rig.cameras[2] = turned(rig.cameras[2], {-0.03, 0.02, 0.02});
                          },
                          {.camera = 2, .turn_rad = {0.03, -0.02, -0.02}}},
                    Fault{"zoomed",
                          [](calib::CameraRig&, std::vector<Track>& tracks) {
                            for (SeenPoint& s : tracks[0])
                              s.ray = Vector3d(1.2 * s.ray.x(), 1.2 * s.ray.y(), s.ray.z()).normalized();
                          },
                          {.camera = 0, .zoom = 1.2}},
                    Fault{"mirrored",
                          [](calib::CameraRig& rig, std::vector<Track>& tracks) {
                            const double last = rig.cameras[1].image_size.width - 1;
                            change_pixels(rig.cameras[1], tracks[1],
                                          [=](const Vector2d& px) { return Vector2d(last - px.x(), px.y()); });
                          },
                          {.camera = 1, .is_mirrored = true}},
                    Fault{"upside_down",
                          [](calib::CameraRig& rig, std::vector<Track>& tracks) {
                            const auto& size = rig.cameras[1].image_size;
                            const Vector2d last(size.width - 1, size.height - 1);
                            change_pixels(rig.cameras[1], tracks[1],
                                          [=](const Vector2d& px) { return Vector2d(last - px); });
                          },
                          {.camera = 1, .is_upside_down = true}}),
    [](const auto& param) { return std::string(param.param.name); });

// Rig and tracks in another order, and in another world frame.
TEST(PairComparisonOf, DoesNotDependOnTheOrderOfCameras) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    calib::CameraRig rig = rig_of(4);
    const std::vector<Track> tracks = tracks_of(rig, seed, {.noise_px = 0.5});
    rig.cameras[3] = turned(rig.cameras[3], {0.004, 0.002, -0.003});
    const TimeSigmas times{0.001, 0.002, 0, 0.003};
    const auto as_is = PairComparison(rig).agreement(tracks, {}, times);
    const auto of_first = PairComparison(rig).agreement_of(tracks, 0, true, {}, times);
    std::vector<std::size_t> order{0, 1, 2, 3};
    std::mt19937 rng(seed);
    std::ranges::shuffle(order, rng);
    calib::CameraRig other = rig;
    std::vector<Track> other_tracks(4);
    TimeSigmas other_times(4);
    for (std::size_t c = 0; c < 4; ++c)
      other.cameras[c] = rig.cameras[order[c]], other_tracks[c] = tracks[order[c]], other_times[c] = times[order[c]];
    const auto now = PairComparison(other).agreement(other_tracks, {}, other_times);
    EXPECT_EQ(now.pairs, as_is.pairs);
    EXPECT_NEAR(now.worst, as_is.worst, 1e-9) << seed;
    EXPECT_NEAR(now.score, as_is.score, 1e-9) << seed;
    EXPECT_NEAR(now.worst_px, as_is.worst_px, 1e-9) << seed;
    const auto first = std::size_t(std::ranges::find(order, 0u) - order.begin());
    const auto now_of_first = PairComparison(other).agreement_of(other_tracks, first, true, {}, other_times);
    EXPECT_EQ(now_of_first.pairs, 3u);
    EXPECT_NEAR(now_of_first.score, of_first.score, 1e-9) << seed;

    const auto last = std::size_t(std::ranges::find(order, 3u) - order.begin());
    const auto turn = best_turn(PairComparison(rig), tracks, 3, times);
    const auto other_turn = best_turn(PairComparison(other), other_tracks, last, other_times);
    ASSERT_TRUE(turn && other_turn);
    EXPECT_LT((turn->turn_rad - other_turn->turn_rad).norm(), 1e-6) << seed;
    EXPECT_NEAR(turn->gain, other_turn->gain, 1e-4 * turn->gain) << seed;
  }
}

TEST(PairComparisonOf, DoesNotDependOnTheWorldsFrame) {
  calib::CameraRig rig = rig_of(3);
  const std::vector<Track> tracks = tracks_of(rig, 3, {.noise_px = 0.5});
  const TimeSigmas times(3, 0.001);
  const auto as_is = PairComparison(rig).agreement(tracks, {}, times);
  calib::Tangent6d tangent;
  tangent << 0.3, -1.1, 0.5, 2, -3, 1;
  for (calib::Camera& camera : rig.cameras) camera.cam_from_world = camera.cam_from_world * calib::exp(tangent);
  const auto now = PairComparison(rig).agreement(tracks, {}, times);
  EXPECT_NEAR(now.worst, as_is.worst, 1e-7);
  EXPECT_NEAR(now.score, as_is.score, 1e-7);
}

TEST(PairComparisonOf, DerivativesAreThoseOfFiniteDifferences) {
  std::mt19937 rng(7);
  std::normal_distribution<double> normal(0, 1);
  const auto vector = [&] { return drawn<3>(rng, normal); };
  for (int trial = 0; trial < 200; ++trial) {
    // Two rays that nearly meet in front of both cameras.
    const Vector3d base = vector(), point = 3 * vector().normalized() + 0.5 * base;
    const auto moment_at = [&](const Vector3d& of_i) {
      return PairComparison::Moment{of_i, (point - base).normalized(), 4, 4, 0.5, 0.5, 0.1};
    };
    const PairComparison::Placement placement{base, 400, 500};
    const Vector3d ray = point.normalized();
    const auto at = PairComparison::passing(moment_at(ray), placement);
    if (!at || at->radius_m == 0 || point.norm() < 0.3 || (point - base).norm() < 0.3) continue;
    EXPECT_NEAR(at->off_px, 0, 1e-6);
    for (int axis = 0; axis < 3; ++axis) {
      constexpr double step = 1e-6;
      const Vector3d by = step * Vector3d::Unit(axis);
      const auto more = PairComparison::passing(moment_at((ray + by.cross(ray)).normalized()), placement);
      const auto less = PairComparison::passing(moment_at((ray - by.cross(ray)).normalized()), placement);
      ASSERT_TRUE(more && less);
      EXPECT_NEAR(at->slope_of_i_px[axis], (more->off_px - less->off_px) / (2 * step),
                  1e-3 * at->slope_of_i_px.norm() + 1e-3)
          << trial;
    }
  }
}

// Pixel noise alone, far above what is expected of the rig: |off| / expected is half a normal distribution.
TEST(PairComparisonOf, ResidualsHaveTheirExpectedVariance) {
  double sum2 = 0, median = 0;
  std::size_t n = 0, pairs = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const calib::CameraRig rig = rig_of(3);
    const std::vector<Track> tracks = tracks_of(rig, seed, {.noise_px = 2, .sigma_px = 2});
    const PairComparison comparison(rig);
    for (std::size_t j = 1; j < 3; ++j) {
      for (std::size_t i = 0; i < j; ++i, ++pairs) {
        const PairResiduals pair = comparison.residuals(tracks, i, j, {}, TimeSigmas(3, 0.0));
        median += pair.usual();
        for (std::size_t k = 0; k < pair.off_px.size(); ++k, ++n)
          sum2 += std::pow(pair.off_px[k] / pair.expected[k], 2);
      }
    }
  }
  EXPECT_GT(n, 1500u);
  EXPECT_NEAR(sum2 / double(n), 1, 0.1);
  EXPECT_NEAR(median / double(pairs), 0.67, 0.06);
}

TEST(PairComparisonOf, MeasuresTheRadius) {
  const calib::CameraRig rig = rig_of(3);
  std::vector<Track> tracks = tracks_of(rig, 2);
  const auto path = path_of(2);
  for (std::size_t c = 0; c < 3; ++c)
    for (SeenPoint& s : tracks[c])
      s.radius_px = 0.05 * focal_px(rig.cameras[c]) / (path(s.t_s) - rig.cameras[c].centre()).norm();
  const PairResiduals pair = PairComparison(rig).residuals(tracks, 0, 1, {}, TimeSigmas(3, 0.0));
  ASSERT_GT(pair.radius_m.size(), 40u);
  for (const double radius_m : pair.radius_m) EXPECT_NEAR(radius_m, 0.05, 1e-4);
}

TEST(PairComparisonOf, FewSamplesAreNotCompared) {
  const calib::CameraRig rig = rig_of(2);
  std::vector<Track> tracks = tracks_of(rig, 1);
  tracks[1].resize(pair_sampling.least_samples - 1);
  const auto agreement = PairComparison(rig).agreement(tracks, {}, TimeSigmas(2, 0.0));
  EXPECT_EQ(agreement.pairs, 0u);
  EXPECT_EQ(agreement.worst, 0);
}

TEST(Lateness, IsFoundOfOneCameraAndOfAll) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> late(-0.4, 0.4);
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const calib::CameraRig rig = rig_of(3);
    const double one_s = late(rng);
    const PairComparison comparison(rig);
    const TimeSigmas times(3, 0.001);
    const auto one = tracks_of(rig, seed, {.noise_px = 0.3, .delays_s = {0, 0, one_s}, .period_s = 1 / 30.0});
    EXPECT_NEAR(best_lateness(comparison, one, 2, times), one_s, 0.006) << seed;
    const std::vector<double> delays_s{0, 0.5 * late(rng), late(rng)};
    const auto all = tracks_of(rig, seed + 10, {.noise_px = 0.3, .delays_s = delays_s, .period_s = 1 / 30.0});
    const std::vector<double> found_s = best_latenesses(comparison, all, times);
    EXPECT_EQ(found_s[0], 0);
    for (std::size_t c = 1; c < 3; ++c) EXPECT_NEAR(found_s[c], delays_s[c], 0.01) << seed;
  }
}

// The gain of a turn that is none follows its prior and chi-square: the gate of 99.9 % is not exceeded.
TEST(BestTurn, IsNotSignificantByNoiseAlone) {
  double mean = 0;
  constexpr unsigned seeds = 40;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    const calib::CameraRig rig = rig_of(3);
    const std::vector<Track> tracks = tracks_of(rig, seed, {.noise_px = 1.5, .sigma_px = 1.5});
    const auto found = best_turn(PairComparison(rig), tracks, seed % 3, TimeSigmas(3, 0.0));
    ASSERT_TRUE(found);
    EXPECT_GE(found->gain, 0);
    EXPECT_LT(found->gain, calib::chi2_999_in_3d) << seed;
    EXPECT_LT(found->turn_rad.norm(), 0.02) << seed;
    mean += found->gain / seeds;
  }
  EXPECT_LT(mean, 4);
}

TEST(BestTurn, AndFocalLengthAreFoundInNoise) {
  std::mt19937 rng(9);
  std::uniform_real_distribution<double> rad(-0.035, 0.035), zoom(0.75, 1.35);
  for (unsigned seed = 1; seed <= 12; ++seed) {
    calib::CameraRig rig = rig_of(3);
    const std::vector<Track> tracks = tracks_of(rig, seed, {.noise_px = 0.4, .sigma_px = 0.4});
    const std::size_t camera = seed % 3;
    const Vector3d turn(rad(rng), rad(rng), rad(rng));
    rig.cameras[camera] = turned(rig.cameras[camera], -turn);
    const TimeSigmas times(3, 0.0);
    const auto found = best_turn(PairComparison(rig), tracks, camera, times);
    ASSERT_TRUE(found) << seed;
    EXPECT_LT((found->turn_rad - turn).norm(), 0.05 * turn.norm() + 0.003) << seed;
    if (turn.norm() > 0.015) {
      EXPECT_GT(found->gain, calib::chi2_999_in_3d) << seed;
    }

    const calib::CameraRig right = rig_of(3);
    std::vector<Track> zoomed = tracks;
    const double factor = zoom(rng);
    for (SeenPoint& s : zoomed[camera])
      s.ray = Vector3d(factor * s.ray.x(), factor * s.ray.y(), s.ray.z()).normalized();
    EXPECT_NEAR(best_zoom(PairComparison(right), zoomed, camera, times).zoom, factor, 0.01) << seed;
  }
}

}  // namespace
}  // namespace huetrack::view_watch
