#include "object_tracking/motion_state.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "drawn.h"
#include "object_tracking/sighting.h"

namespace huetrack::object_tracking {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

capture::Timestamp at(double s) {
  return capture::Timestamp{capture::duration_of(s)};
}

calib::Camera camera_at(const std::string& name, const Vector3d& centre) {
  calib::Camera camera;
  camera.name = name;
  camera.image_size = {640, 480};
  camera.model = calib::CameraModel(calib::PinholeRadtan{.fx = 450, .fy = 450, .cx = 320, .cy = 240});
  const Vector3d forward = (Vector3d(0, 0, 1) - centre).normalized();
  const Vector3d right = forward.cross(Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d rotation;
  rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  camera.cam_from_world = {Eigen::Quaterniond(rotation), -rotation * centre};
  return camera;
}

// Free-running cameras around an object on a looping path.
struct Scene {
  std::mt19937 random;
  calib::CameraRig rig;
  std::vector<double> latency_s{0.012, 0.038, 0.024}, readout_s{0.024, -0.018, 0.03};
  double noise_px = 0.2;
  double later_s = 0;  // than the others: another object of the same path

  explicit Scene(unsigned seed) : random(seed) {
    rig.cameras = {camera_at("a", {3, 0, 2}), camera_at("b", {-1, 3, 1.5}), camera_at("c", {-1, -3, 0.5})};
  }
  static Vector3d position(double t) {
    return {0.6 * std::cos(3 * t), 0.5 * std::sin(3.7 * t), 1 + 0.6 * std::sin(2.3 * t)};
  }
  // Sightings of one second in order: (frame time in seconds, sighting), timed by the state.
  void run(MotionState& state, double from_s, double to_s) {
    struct Coming {
      double middle_s;
      int camera;
    };
    std::vector<Coming> frames;
    for (int c = 0; c < 3; ++c)
      for (double t = from_s + 0.011 * c; t < to_s; t += 1 / (29.8 + 0.1 * c)) frames.push_back({t, c});
    std::ranges::sort(frames, {}, &Coming::middle_s);
    std::normal_distribution<double> noise(0, noise_px);
    for (const Coming& frame : frames) {
      const auto c = static_cast<std::size_t>(frame.camera);
      const calib::Camera& camera = rig.cameras[c];
      double row = 240;
      for (int i = 0; i < 4; ++i)
        row = camera.project_world(position(later_s + frame.middle_s + (row / 479 - 0.5) * readout_s[c]))->px.y();
      const double below = row / 479 - 0.5;
      const auto px = camera.project_world(position(later_s + frame.middle_s + below * readout_s[c]))->px;
      LinearSighting seen;
      seen.row = {.camera = frame.camera, .below_middle = below};
      seen.row.shift_s = state.row_offset_s(frame.camera, below);
      seen.row.at = at(frame.middle_s + latency_s[c] - latency_s[0] + seen.row.shift_s);
      seen.px = px + drawn<2>(random, noise);
      seen.covariance = noise_px * noise_px * Eigen::Matrix2d::Identity();
      seen.bias_sigma_px = 0.1;
      constexpr double q = 40;
      state.predict_to(seen.row.at, q);
      seen.linearised_at = state.position() + capture::seconds(seen.row.at - state.at) * state.velocity();
      const auto appearance = project_ball(camera, seen.linearised_at, 0.04);
      ASSERT_TRUE(appearance);
      seen.px_expected = appearance->px;
      seen.jacobian = appearance->jacobian;
      seen.ray = seen.linearised_at - camera.centre();
      state.observe(seen, state.velocity(), q);
    }
  }
};

TEST(MotionState, LearnsLatenciesAndReadoutsFromMotion) {
  int inside = 0, all = 0;
  for (unsigned seed = 0; seed < 8; ++seed) {
    Scene scene(seed);
    MotionState state(scene.rig, true);
    state.begin(at(0), Scene::position(0), 1, Vector3d::Zero(), 9);
    scene.run(state, 0, 6);
    for (int c = 0; c < 3; ++c) {
      const auto i = static_cast<std::size_t>(c);
      const CameraTimingEstimate t = state.timing(c);
      EXPECT_NEAR(t.latency_s, scene.latency_s[i] - scene.latency_s[0], 0.0015) << seed << " camera " << c;
      // A common readout is nearly a different motion along the path and hardly observable; differences are.
      EXPECT_NEAR(t.readout_s, scene.readout_s[i], 0.013) << seed << " camera " << c;
      EXPECT_NEAR(t.readout_s - state.timing(0).readout_s, scene.readout_s[i] - scene.readout_s[0], 0.004);
      all += c == 0 ? 0 : 1;
      inside += c != 0 && std::abs(t.latency_s - scene.latency_s[i] + scene.latency_s[0]) < 1.96 * t.latency_sigma_s;
    }
    EXPECT_EQ(state.timing(0).latency_sigma_s, 0) << "all others hang on it";
  }
  EXPECT_GE(inside, all * 8 / 10);
}

// Cameras wrongly taken as synchronised: the tight prior is not left until correct_times(), then timing is learnt from
// the corrected values.
TEST(MotionState, CorrectedTimesAreLearntAgain) {
  Scene scene(1);
  scene.latency_s = {0.02, 0.12, 0.05}, scene.readout_s = {0.02, 0.02, 0.02};
  MotionState state(scene.rig, true);
  state.expect_synchronised();
  state.begin(at(0), Scene::position(0), 1, Vector3d::Zero(), 9);
  scene.run(state, 0, 2);
  EXPECT_LT(std::abs(state.timing(1).latency_s), 0.01);
  EXPECT_LT(state.timing(1).latency_sigma_s, 0.001);
  state.correct_times(std::vector{-0.03, 0.06, 0.0});  // one correction for all, not exact
  EXPECT_NEAR(state.timing(0).latency_s, -0.03, 1e-12);
  EXPECT_EQ(state.timing(0).latency_sigma_s, 0) << "it is held where it was put";
  EXPECT_GT(state.timing(1).latency_sigma_s, 0.015);
  EXPECT_GT(largest_sigma(state.position_covariance()), 0.03) << "it was seen by wrong times";
  state.expect_synchronised();  // without effect
  EXPECT_GT(state.timing(1).latency_sigma_s, 0.015);
  scene.run(state, 2, 8);
  for (int c = 1; c < 3; ++c)
    EXPECT_NEAR(state.timing(c).latency_s - state.timing(0).latency_s,
                scene.latency_s[std::size_t(c)] - scene.latency_s[0], 0.004);
}

TEST(MotionState, FixedTimesAreNotCorrected) {
  Scene scene(1);
  MotionState state(scene.rig, false);
  state.correct_times(std::vector{0.1, 0.0, 0.0});
  EXPECT_EQ(state.timing(0).latency_s, 0);
}

TEST(MotionState, LearnsNoTimesFromARestingObject) {
  Scene scene(3);
  MotionState state(scene.rig, true);
  state.begin(at(0), {0, 0, 1}, 1, Vector3d::Zero(), 9);
  std::normal_distribution<double> noise(0, 0.2);
  for (int k = 0; k < 600; ++k) {
    const bool is_start = k < 6;  // the two sets of a start
    const int c = k % 3;
    const calib::Camera& camera = scene.rig.cameras[static_cast<std::size_t>(c)];
    LinearSighting seen;
    seen.row = {.camera = c, .below_middle = 0.2, .at = at(0.011 * k)};
    seen.row.shift_s = state.row_offset_s(c, 0.2);
    seen.px = camera.project_world({0, 0, 1})->px + drawn<2>(scene.random, noise);
    seen.covariance = 0.04 * Eigen::Matrix2d::Identity();
    seen.bias_sigma_px = 0.3;
    constexpr double q = 16 * 16 * 0.1;  // as the tracker while timing is unknown
    state.predict_to(seen.row.at, q);
    seen.linearised_at = state.position();
    const auto appearance = project_ball(camera, seen.linearised_at, 0.04);
    ASSERT_TRUE(appearance);
    seen.px_expected = appearance->px;
    seen.jacobian = appearance->jacobian;
    seen.ray = seen.linearised_at - camera.centre();
    state.observe(seen, is_start ? Vector3d(Vector3d::Zero()) : state.velocity(), q);
  }
  for (int c = 1; c < 3; ++c) {
    EXPECT_LT(std::abs(state.timing(c).latency_s), 0.02) << c;
    EXPECT_GT(state.timing(c).latency_sigma_s, 0.006) << c;
  }
  EXPECT_LT((state.position() - Vector3d(0, 0, 1)).norm(), 0.006);
}

TEST(MotionState, TimeUncertaintyLiesAlongThePath) {
  Scene scene(5);
  scene.rig.cameras[1].timing = {.latency_s = 0.03, .latency_sigma_s = 0.01, .readout_s = 0, .readout_sigma_s = 0};
  for (const int c : {0, 2})
    scene.rig.cameras[static_cast<std::size_t>(c)].timing = {
        .latency_s = 0, .latency_sigma_s = 0, .readout_s = 0, .readout_sigma_s = 0};
  MotionState state(scene.rig, true);
  state.begin(at(0), {0, 0, 1}, 1e-6, {2, 0, 0}, 1e-8);
  const Eigen::Matrix3d of_b = state.seen_covariance({.camera = 1, .below_middle = 0, .at = at(0)}, 0);
  EXPECT_NEAR(std::sqrt(of_b(0, 0)), 0.02, 2e-3);  // 2 m/s for 10 ms
  EXPECT_NEAR(std::sqrt(of_b(1, 1)), 0.001, 1e-4);
  const Eigen::Matrix3d of_a = state.seen_covariance({.camera = 0, .below_middle = 0, .at = at(0)}, 0);
  EXPECT_NEAR(std::sqrt(of_a(0, 0)), 0.001, 1e-4);
}

constexpr double a_microsecond = 1e-6;

// Two objects share what they show of one rig's timing, ten times a second: no measurement counts twice, and both are
// as sure as their measurements together.
TEST(MotionState, SharedTimesAreThoseOfAllMeasurements) {
  int inside = 0, all = 0;
  double once = 0, often = 0, alone = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    for (const int pieces : {1, 6}) {
      std::vector<Scene> scenes{Scene(2 * seed), Scene(2 * seed + 1)};
      scenes[1].later_s = 1.3;
      std::vector<MotionState> states;
      for (Scene& scene : scenes) {
        states.emplace_back(scene.rig, true);
        states.back().begin(at(0), Scene::position(scene.later_s), 1, Vector3d::Zero(), 9);
      }
      for (int piece = 0; piece < pieces; ++piece) {
        for (std::size_t i = 0; i < 2; ++i) scenes[i].run(states[i], 0.6 * piece / pieces, 0.6 * (piece + 1) / pieces);
        if (pieces == 1) alone += states[0].timing(1).latency_sigma_s;
        const std::vector shown{states[0].unshared_times(), states[1].unshared_times()};
        for (std::size_t i = 0; i < 2; ++i) states[i].add_times(shown[1 - i]);
        for (MotionState& state : states) state.set_times_shared();
      }
      for (int c = 1; c < 3; ++c) {
        const CameraTimingEstimate a = states[0].timing(c), b = states[1].timing(c);
        EXPECT_NEAR(a.latency_s, b.latency_s, 1e-4) << "one answer";
        EXPECT_NEAR(a.latency_sigma_s, b.latency_sigma_s, 0.05 * a.latency_sigma_s);
        const double off_s = a.latency_s - scenes[0].latency_s[std::size_t(c)] + scenes[0].latency_s[0];
        ++all, inside += std::abs(off_s) < 1.96 * a.latency_sigma_s ? 1 : 0;
      }
      (pieces == 1 ? once : often) += states[0].timing(1).latency_sigma_s;
      for (const MotionState& state : states)
        EXPECT_LT(state.unshared_times().matrix.norm(), 1e-6 / std::pow(a_microsecond, 2))
            << "nothing is left to share";
    }
  }
  EXPECT_LT(once, 0.85 * alone) << "two objects know more than one";
  EXPECT_NEAR(often, once, 0.1 * once) << "how often they share changes nothing";
  EXPECT_GE(inside, all * 85 / 100);
}

// What is shared of the timing moves an object that knew it badly, as far as its velocity takes it.
TEST(MotionState, SharedTimesMoveTheObjectAlongItsPath) {
  Scene scene(3);
  MotionState known(scene.rig, true), moving(scene.rig, true);
  known.begin(at(0), Scene::position(0), 1, Vector3d::Zero(), 9);
  scene.run(known, 0, 4);
  moving.begin(at(4), Scene::position(4), 1, Vector3d::Zero(), 9);
  scene.run(moving, 4, 4.15);
  const auto sigma_along = [&] {
    const Vector3d along = moving.velocity().normalized();
    return std::sqrt(along.dot(moving.position_covariance() * along));
  };
  const double before = sigma_along();
  moving.add_times(known.unshared_times());
  EXPECT_LT(sigma_along(), 0.95 * before);
  EXPECT_LT((moving.position() - Scene::position(capture::seconds(moving.at.time_since_epoch()))).norm(),
            4 * largest_sigma(moving.position_covariance()));
  EXPECT_NEAR(moving.timing(1).latency_s, scene.latency_s[1] - scene.latency_s[0], 0.002);
  // Of an object that turned out to be none, nothing remains.
  MotionState fresh = moving;
  fresh.forget_unshared_times();
  EXPECT_NEAR(fresh.timing(1).latency_s, known.timing(1).latency_s, 1e-6);
  MotionState untimed(scene.rig, false);
  EXPECT_EQ(untimed.unshared_times().matrix.size(), 0);
  untimed.add_times(untimed.unshared_times());
  untimed.set_times_shared();
}

// Two cameras of another host share one clock error, which does not stay known.
TEST(MotionState, AnotherHostsClockIsOneCommonError) {
  Scene scene(2);
  MotionState state(scene.rig, true);
  state.begin(at(0), Scene::position(0), 1, Vector3d::Zero(), 9);
  scene.run(state, 0, 4);
  capture::FrameSet set;
  set.frames.resize(3);
  for (std::size_t c = 0; c < 3; ++c) set.frames[c].emplace();
  MotionState same = state;
  same.open_clocks(set);
  EXPECT_EQ(same.timing(1).latency_sigma_s, state.timing(1).latency_sigma_s) << "all clocks are ours";
  set.frames[1]->clock = set.frames[2]->clock = {.of = 1, .sigma = std::chrono::milliseconds(4)};
  ASSERT_LT(state.timing(1).latency_sigma_s, 2e-3);
  for (int again = 0; again < 3; ++again) state.open_clocks(set);
  EXPECT_NEAR(std::min(state.timing(1).latency_sigma_s, state.timing(2).latency_sigma_s), 4e-3, 1e-6);
  EXPECT_LT(std::max(state.timing(1).latency_sigma_s, state.timing(2).latency_sigma_s), 4.5e-3);
  EXPECT_EQ(state.timing(0).latency_sigma_s, 0);
  EXPECT_EQ(state.clock_variance_s2(), 0);
  set.frames[0]->clock = {.of = 1, .sigma = std::chrono::milliseconds(4)};
  state.open_clocks(set);
  EXPECT_NEAR(state.clock_variance_s2(), 16e-6, 1e-12);
}

TEST(MotionState, ConditioningAndReinflatingIsTheIdentity) {
  Scene scene(1);
  MotionState state(scene.rig, true);
  state.begin(at(0), Scene::position(0), 1, Vector3d::Zero(), 9);
  scene.run(state, 0, 0.5);
  MotionState back = state.conditioned_on_nuisances();
  EXPECT_LT(back.position_covariance().trace(), state.position_covariance().trace());
  back.reinflate_nuisances(state);
  EXPECT_LT((back.position_covariance() - state.position_covariance()).norm(),
            1e-9 * state.position_covariance().norm() + 1e-12);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(back.timing(c).readout_sigma_s, state.timing(c).readout_sigma_s, 1e-6) << c;
}

// With many cameras updates are collected before they are applied to the covariance; every query must include them.
// Cameras without sightings change nothing, so the state is that of the three with sightings.
TEST(MotionState, CamerasWithoutSightingsChangeNothing) {
  Scene scene(4), same_scene(4);
  same_scene.rig.cameras.resize(50, scene.rig.cameras[2]);
  MotionState few(scene.rig, true), many(same_scene.rig, true);
  const auto compare = [&](const char* when) {
    const auto near = [&](const auto& a, const auto& b) {
      EXPECT_LT((a - b).norm(), 1e-6 * a.norm() + 1e-12) << when << "\n" << a << "\n\n" << b;
    };
    near(few.position(), many.position());
    near(few.velocity(), many.velocity());
    near(few.position_covariance(), many.position_covariance());
    near(few.velocity_covariance(), many.velocity_covariance());
    near(few.position_covariance_conditioned(), many.position_covariance_conditioned());
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(few.timing(c).latency_s, many.timing(c).latency_s, 1e-9) << when;
      EXPECT_NEAR(few.timing(c).latency_sigma_s, many.timing(c).latency_sigma_s, 1e-9) << when;
      EXPECT_NEAR(few.row_sigma_s(c, 0.4), many.row_sigma_s(c, 0.4), 1e-9) << when;
      near(few.bias(c), many.bias(c));
      const SeenRow row{.camera = c, .below_middle = -0.3, .at = few.at};
      near(few.seen_covariance(row, 40), many.seen_covariance(row, 40));
      near(few.measurement_given_position(row, 40).covariance, many.measurement_given_position(row, 40).covariance);
    }
  };
  for (MotionState* state : {&few, &many}) state->begin(at(0), Scene::position(0), 1, Vector3d::Zero(), 9);
  for (int i = 1; i <= 12; ++i) {  // 0.15 s: after a varying one of four sightings
    scene.run(few, 0.15 * (i - 1), 0.15 * i);
    same_scene.run(many, 0.15 * (i - 1), 0.15 * i);
    compare("after sightings");
    MotionState few_back = few.conditioned_on_nuisances(), many_back = many.conditioned_on_nuisances();
    few_back.reinflate_nuisances(few), many_back.reinflate_nuisances(many);
    few = few_back, many = many_back;
    compare("after given views");
    for (MotionState* state : {&few, &many}) {
      if (i % 3 == 0) state->reset_bias(i % 2);
      if (i % 4 == 0) state->set_position(state->position(), 1.1 * state->position_covariance());
    }
    compare("after changes");
  }
  for (MotionState* state : {&few, &many}) state->begin(at(2), Scene::position(2), 1, Vector3d::Zero(), 9);
  compare("of a new object");
}

TEST(MotionState, FixedTimesAddTheirUncertainty) {
  Scene scene(2);
  for (auto& camera : scene.rig.cameras)
    camera.timing = {.latency_s = 0.01, .latency_sigma_s = 0.003, .readout_s = 0.02, .readout_sigma_s = 0};
  MotionState state(scene.rig, false);
  state.begin(at(0), Scene::position(0), 1, Vector3d::Zero(), 9);
  scene.run(state, 0, 1);
  EXPECT_EQ(state.timing(2).latency_s, 0.01);
  EXPECT_EQ(state.row_offset_s(1, 0.4), 0);
  EXPECT_NEAR(state.row_sigma_s(1, 0), 0.003, 1e-12);
}

// One camera and a ball whose radius is off by exp(scale) from the configured one; the radius in the image has a bias
// that fades along the path.
struct SizedScene {
  std::mt19937 random;
  calib::CameraRig rig;
  double scale, bias = 0;
  bool is_region = false;  // then the bias is constant
  static constexpr double noise_px = 0.1, size_noise = 0.01, size_bias = 0.015, bias_length_m = 0.5, q = 40;

  explicit SizedScene(unsigned seed) : random(seed), scale(0.02 * normal()) {
    rig.cameras = {camera_at("a", {3, 0, 2})};
  }
  double normal() { return std::normal_distribution<double>()(random); }
  void run(MotionState& state, double from_s, double to_s) {
    const calib::Camera& camera = rig.cameras[0];
    Vector3d before = Scene::position(from_s);
    for (double t = from_s; t < to_s; t += 1.0 / 30) {
      const Vector3d p = Scene::position(t);
      const double kept = t == from_s ? 0 : std::exp(-(p - before).norm() / bias_length_m);
      before = p;
      if (!is_region) bias = kept * bias + std::sqrt(1 - kept * kept) * size_bias * normal();
      state.predict_to(at(t), q);
      const SeenRow row{.camera = 0, .below_middle = 0, .at = at(t)};
      const Vector3d near = state.position();
      const auto expected = project_ball(camera, near, 0.04), true_ball = project_ball(camera, p, 0.04);
      ASSERT_TRUE(expected && true_ball);
      state.observe({.row = row,
                     .px = true_ball->px + noise_px * Vector2d(normal(), normal()),
                     .covariance = noise_px * noise_px * Eigen::Matrix2d::Identity(),
                     .bias_sigma_px = 0.01,
                     .linearised_at = near,
                     .px_expected = expected->px,
                     .jacobian = expected->jacobian,
                     .ray = near - camera.centre()},
                    state.velocity(), q);
      state.observe_size(
          {.row = row,
           .log_off = std::log(true_ball->radius_px / expected->radius_px) + scale + bias + size_noise * normal(),
           .variance = size_noise * size_noise,
           .bias_sigma = is_region ? sighting_tuning.region_size_sigma : size_bias,
           .is_bias_constant = is_region,
           .linearised_at = near,
           .ray = near - camera.centre()},
          state.velocity(), q);
    }
  }
  Vector3d off(const MotionState& state) const {
    return state.position() - Scene::position(capture::seconds(state.at.time_since_epoch()));
  }
};

MotionState sized_state(const calib::CameraRig& rig) {
  MotionState state(rig, false);
  state.begin(at(0), Scene::position(0), 0.04, Vector3d::Zero(), 9);
  return state;
}

// In 20 s of motion nothing may be learnt of the scale: what is not observable stays as uncertain as it was.
TEST(MotionState, OneCameraAndTheSizeGiveThePlaceWithAnHonestCovariance) {
  double nees = 0, along = 0, sigma_along = 0, sigma_size = 0;
  constexpr int runs = 200;
  for (unsigned seed = 0; seed < runs; ++seed) {
    SizedScene scene(seed);
    MotionState state = sized_state(scene.rig);
    scene.run(state, 0, 20);
    const Vector3d off = scene.off(state), ray = state.position() - scene.rig.cameras[0].centre();
    nees += off.dot(state.position_covariance().ldlt().solve(off)) / runs;
    along += off.dot(ray) / ray.squaredNorm() / runs;
    sigma_along += std::sqrt(ray.dot(state.position_covariance() * ray)) / ray.squaredNorm() / runs;
    sigma_size += state.log_size_sigma() / runs;
  }
  EXPECT_NEAR(nees, 3, 0.7);  // 4 sigma of the mean of 200 values of chi-square with 3 dof
  EXPECT_NEAR(along, 0, 4 * sigma_along / std::sqrt(runs)) << "share of the distance";
  EXPECT_NEAR(sigma_size, 0.02, 0.002);
}

TEST(MotionState, OneCameraAndARegionsSizeLeaveTheDistanceUnsure) {
  double nees = 0;
  constexpr int runs = 200;
  for (unsigned seed = 0; seed < runs; ++seed) {
    SizedScene scene(seed);
    scene.is_region = true;
    scene.bias = sighting_tuning.region_size_sigma * scene.normal();
    MotionState state(scene.rig, false);
    state.begin(at(0), Scene::position(0), 9, Vector3d::Zero(), 9);
    scene.run(state, 0, 5);
    const Vector3d off = scene.off(state), ray = state.position() - scene.rig.cameras[0].centre();
    nees += off.dot(state.position_covariance().ldlt().solve(off)) / runs;
    const double sigma_along = std::sqrt(ray.dot(state.position_covariance() * ray)) / ray.squaredNorm();
    EXPECT_NEAR(sigma_along, 0.2, 0.05);
  }
  EXPECT_NEAR(nees, 3, 0.7);
}

TEST(MotionState, ASizeThatContradictsMovesLittleAtOnce) {
  SizedScene scene(1);
  MotionState state = sized_state(scene.rig);
  scene.run(state, 0, 2);
  const double before = state.log_size();
  scene.scale -= 0.25;  // a hand hides a part
  scene.run(state, 2, 2.01);
  EXPECT_LT(scene.off(state).norm(), 0.2) << "a quarter of the distance is 0.7 m";
  EXPECT_NEAR(state.log_size(), before, 0.01);
}

}  // namespace
}  // namespace huetrack::object_tracking
