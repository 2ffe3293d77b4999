#include "object_tracking/trackers/paper_tracker.h"

#include <gmock/gmock.h>

#include <cmath>

#include "color/random_image.h"
#include "particle_filter/resample.h"
#include "scene/scene.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

using Eigen::Vector3d;

TargetOptions lime_ball() {
  TargetOptions t;
  t.name = "lime";
  t.color.hue_min_deg = 65, t.color.hue_max_deg = 115;
  return t;
}

ObjectTrackerOptions paper(int particles = 200) {
  ObjectTrackerOptions o;
  o.observation = Observation::paper;
  o.particle_count = particles;
  o.max_particle_count = std::max(2000, particles);
  return o;
}

Vector3d still(double) {
  return {0.1, 0.05, 1.0};
}

PositionParticles strewn(std::size_t n, const Vector3d& around, double sigma_m, std::uint64_t seed) {
  PositionParticles p;
  p.resize(n);
  particle_filter::Rng rng(seed);
  rng.fill_normal(p.x), rng.fill_normal(p.y), rng.fill_normal(p.z);
  for (std::size_t i = 0; i < n; ++i) {
    p.x[i] = static_cast<float>(around.x() + sigma_m * static_cast<double>(p.x[i]));
    p.y[i] = static_cast<float>(around.y() + sigma_m * static_cast<double>(p.y[i]));
    p.z[i] = static_cast<float>(around.z() + sigma_m * static_cast<double>(p.z[i]));
  }
  return p;
}

// Eqs. (4)-(6) for one particle, as they are printed.
double weight_by_hand(const std::vector<TargetView>& views, const Vector3d& particle) {
  double product = 1;
  for (const TargetView& view : views) {
    const auto at = view.camera->project_world(particle);
    double p = 1.0 / 25;  // (5): outside of the image
    if (at && view.camera->contains(*at)) {
      const int k = color::count_5x5_reference(*view.image, *view.table, static_cast<int>(std::floor(at->px.x() + 0.5)),
                                               static_cast<int>(std::floor(at->px.y() + 0.5)));
      p = std::max(k, 1) / 25.0;  // (6)
    }
    product *= p;  // (4)
  }
  return product;
}

// A projection that falls on the edge between two pixels in single precision may round to the other one.
bool on_an_edge(const std::vector<TargetView>& views, const Vector3d& particle) {
  return std::ranges::any_of(views, [&](const TargetView& view) {
    const auto at = view.camera->project_world(particle);
    const auto near_half = [](double x) { return std::abs(x + 0.5 - std::round(x + 0.5)) < 1e-3; };
    return at && (near_half(at->px.x()) || near_half(at->px.y()));
  });
}

TEST(PaperObservation, isTheProductOverTheViews) {
  for (const int cameras : {1, 2, 4}) {
    const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = cameras}).ball({.path = still}).build();
    const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 1});
    TargetViews target_views(scene.rig, lime_ball());
    const std::vector<TargetView>& views = target_views.look_at(sets[0]);
    // Close around the ball, over the volume, and all around the cameras.
    for (const double sigma_m : {0.03, 0.5, 3.0}) {
      const PositionParticles particles = strewn(3000, still(0), sigma_m, 1);
      PaperObservation observation;
      std::vector<float> weight;
      observation.weigh(particles, views, weight);
      ASSERT_EQ(weight.size(), particles.size());
      int compared = 0, above_floor = 0;
      for (std::size_t i = 0; i < weight.size(); ++i) {
        const Vector3d p = Eigen::Vector3f(particles.x[i], particles.y[i], particles.z[i]).cast<double>();
        if (on_an_edge(views, p)) continue;
        const double expected = std::pow(25, cameras) * weight_by_hand(views, p);
        ASSERT_NEAR(static_cast<double>(weight[i]), expected, 1e-6 * expected) << p.transpose();
        ++compared;
        above_floor += expected > 1.5 ? 1 : 0;
      }
      EXPECT_GT(compared, 2500);
      if (sigma_m < 0.1) {
        EXPECT_GT(above_floor, 1000);
      }
    }
  }
}

TEST(PaperObservation, knownWindows) {
  // One ball straight ahead; particles on its centre, on the background, beside the image and behind the camera.
  const scene::Scene scene =
      scene::SceneBuilder{}.cameras_on_ring({.count = 1}).ball({.radius_m = 0.1, .path = still}).build();
  TargetViews target_views(scene.rig, lime_ball());
  const auto sets = scene::render(scene, {.set_count = 1, .pixel_noise_stddev = 0});
  const Vector3d eye = scene.rig.cameras[0].centre();
  PositionParticles p;
  p.resize(4);
  const Vector3d at[] = {still(0), still(0) + Vector3d(0, 0, 0.4), still(0) + Vector3d(0, 30, 0), 2 * eye - still(0)};
  for (std::size_t i = 0; i < 4; ++i) {
    p.x[i] = static_cast<float>(at[i].x()), p.y[i] = static_cast<float>(at[i].y()),
    p.z[i] = static_cast<float>(at[i].z());
  }
  PaperObservation observation;
  std::vector<float> weight;
  observation.weigh(p, target_views.look_at(sets[0]), weight);
  EXPECT_THAT(weight, testing::ElementsAre(25, 1, 1, 1));
}

TEST(PaperObservation, noViewsNoPreference) {
  PaperObservation observation;
  std::vector<float> weight{7, 7};
  observation.weigh(strewn(5, Vector3d::Zero(), 1, 1), {}, weight);
  EXPECT_THAT(weight, testing::ElementsAre(1, 1, 1, 1, 1));
}

TEST(PaperTracker, startsUniformInTheVolume) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 2}).build();
  ObjectTrackerOptions options = paper(20'000);
  options.volume = {{-0.5, 0.2, 1}, {0.5, 0.4, 3}};
  const PaperTracker tracker(scene.rig, lime_ball(), options, particle_filter::Rng(1));
  const PositionParticles& p = tracker.particles();
  ASSERT_EQ(p.size(), 20'000u);
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<float>& values = axis == 0 ? p.x : axis == 1 ? p.y : p.z;
    const double min = options.volume.min(axis), extent = options.volume.max(axis) - min;
    std::vector<int> tenth(10, 0);
    for (const float value : values) {
      const double share = (static_cast<double>(value) - min) / extent;
      ASSERT_GT(share, -1e-6);
      ASSERT_LT(share, 1 + 1e-6);
      ++tenth[static_cast<std::size_t>(std::clamp(10 * share, 0.0, 9.0))];
    }
    for (const int count : tenth) EXPECT_NEAR(count, 2000, 5 * std::sqrt(1800.0));
  }
}

// Without a view all weights are equal: what is left of an update is the random walk, eqs. (1)-(3), and the search.
TEST(PaperTracker, walksWithSigma) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 2}).build();
  ObjectTrackerOptions options = paper(50'000);
  options.max_particle_count = 50'000;
  options.volume = {{0, 0, 0}, {1e-6, 1e-6, 1e-6}};
  options.position_noise_m = 0.07;
  PaperTracker tracker(scene.rig, lime_ball(), options, particle_filter::Rng(1));
  capture::FrameSet empty;
  empty.frames.resize(2);
  tracker.update(empty);
  // Four fifths walked and were resampled with equal weights; the rest was drawn anew at the origin.
  const PositionParticles& p = tracker.particles();
  ASSERT_EQ(p.size(), 50'000u);
  for (const std::vector<float>& axis : {p.x, p.y, p.z}) {
    double sum = 0, sum2 = 0;
    for (std::size_t i = 0; i < 40'000; ++i)
      sum += static_cast<double>(axis[i]), sum2 += std::pow(static_cast<double>(axis[i]), 2);
    EXPECT_NEAR(sum / 40'000, 0, 5 * 0.07 / std::sqrt(40'000));
    EXPECT_NEAR(std::sqrt(sum2 / 40'000), 0.07, 0.07 * 0.02);
  }
}

TEST(PaperTracker, findsTheBallAndFollowsIt) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).ball({}).build();
  PaperTracker tracker(scene.rig, lime_ball(), paper(), particle_filter::Rng(1));
  double sum2 = 0;
  int n = 0;
  const auto sets = scene::render(scene, {.set_count = 120});
  for (const capture::FrameSet& set : sets) {
    const ObjectEstimate e = tracker.update(set);
    EXPECT_EQ(e.position.allFinite(), e.has_position());
    if (set.number < 60) continue;
    EXPECT_EQ(e.state, TrackState::tracking) << set.number;
    EXPECT_EQ(e.particle_count, 200);
    EXPECT_GT(e.effective_sample_size, 5);
    if (!e.has_position()) continue;
    sum2 += (e.position - scene.ball_at(0, set.at)).squaredNorm(), ++n;
    EXPECT_LT((e.map_position - scene.ball_at(0, set.at)).norm(), 0.15);
  }
  EXPECT_LT(std::sqrt(sum2 / n), 0.03);
}

// "When the system cannot see the object in the images it grows the particle population" (section 3), and back.
TEST(PaperTracker, populationGrowsWhileUnseenAndShrinksWhenFound) {
  const scene::Scene with = scene::SceneBuilder{}.cameras_on_ring({.count = 2}).ball({.path = still}).build();
  scene::Scene without = with;
  without.balls.clear();
  ObjectTrackerOptions options = paper(100);
  options.max_particle_count = 1000;
  PaperTracker tracker(with.rig, lime_ball(), options, particle_filter::Rng(1));
  std::vector<capture::FrameSet> sets = scene::render(without, {.set_count = 30});
  std::vector<std::size_t> size{tracker.particles().size()};
  for (const capture::FrameSet& set : sets) {
    const ObjectEstimate e = tracker.update(set);
    EXPECT_EQ(e.state, TrackState::searching);
    EXPECT_EQ(static_cast<std::size_t>(e.particle_count), size.back());
    size.push_back(tracker.particles().size());
  }
  EXPECT_EQ(size.front(), 100u);
  EXPECT_TRUE(std::ranges::is_sorted(size));
  EXPECT_EQ(size[1], 120u);
  EXPECT_EQ(size.back(), 1000u);
  for (capture::FrameSet& set : scene::render(with, {.set_count = 90})) {
    set.at += capture::duration_of(1);
    tracker.update(set);
    size.push_back(tracker.particles().size());
  }
  EXPECT_EQ(size.back(), 100u);
}

TEST(PaperTracker, coastsThenIsLostWithoutAPosition) {
  const scene::Scene with = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).ball({.path = still}).build();
  ObjectTrackerOptions options = paper(1000);
  options.coast_s = 0.3;
  PaperTracker tracker(with.rig, lime_ball(), options, particle_filter::Rng(1));
  ObjectEstimate e;
  for (const capture::FrameSet& set : scene::render(with, {.set_count = 60})) e = tracker.update(set);
  ASSERT_EQ(e.state, TrackState::tracking);
  scene::Scene without = with;
  without.balls.clear();
  std::vector<TrackState> states;
  for (capture::FrameSet& set : scene::render(without, {.set_count = 20})) {
    set.at += capture::duration_of(2);
    e = tracker.update(set);
    EXPECT_EQ(e.position.allFinite(), e.has_position());
    EXPECT_EQ(e.covariance.allFinite(), e.has_position());
    states.push_back(e.state);
  }
  EXPECT_EQ(states.back(), TrackState::lost);
}

}  // namespace
}  // namespace huetrack::object_trackers
