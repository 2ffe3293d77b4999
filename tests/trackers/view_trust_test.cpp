// Views that contradict one another, and cameras that are trusted by degrees.
#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>
#include <tuple>

#include "object_tracking/epipolar_consistency.h"
#include "object_tracking/trackers/object_tracker.h"
#include "scene/scene.h"
#include "truth/truth.h"

namespace huetrack::object_trackers {

using namespace object_tracking;

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double rad = std::numbers::pi / 180;

TargetOptions lime_target() {
  TargetOptions t;
  t.name = "lime";
  t.color.hue_min_deg = 65, t.color.hue_max_deg = 115;
  return t;
}

scene::Scene ring_scene(int count) {
  return scene::SceneBuilder{}.cameras_on_ring({.count = count}).ball({}).build();
}

// The camera is not where the rig says: turned about an axis of its own.
calib::CameraRig turned(calib::CameraRig rig, std::size_t camera, double degrees, const Vector3d& axis) {
  calib::Tangent6d tangent = calib::Tangent6d::Zero();
  tangent.head<3>() = degrees * rad * axis.normalized();
  rig.cameras[camera].cam_from_world = calib::exp(tangent) * rig.cameras[camera].cam_from_world;
  return rig;
}

using PerEstimate = std::function<void(const ObjectEstimate&)>;
struct Honesty {
  double nees = 0, rms_m = 0, sigma_m = 0;  // of all positions
  int positions = 0, tracking = 0, wrong_tracking = 0;
};

Honesty run(ObjectTracker& tracker, const scene::Scene& scene, const std::vector<capture::FrameSet>& sets,
            const PerEstimate& each = {}) {
  Honesty out;
  for (const capture::FrameSet& set : sets) {
    const ObjectEstimate e = tracker.update(set);
    if (each) each(e);
    if (!e.has_position()) continue;
    const Vector3d error = e.position - scene.ball_at(0, e.at);
    out.nees += truth::nees(error, e.covariance);
    out.rms_m += error.squaredNorm();
    out.sigma_m += std::sqrt(e.covariance.trace());
    ++out.positions;
    if (e.state != TrackState::tracking) continue;
    ++out.tracking;
    out.wrong_tracking += error.norm() > 0.1 ? 1 : 0;
  }
  if (out.positions == 0) return out;  // nothing was said, nothing is wrong
  out.nees /= out.positions, out.rms_m = std::sqrt(out.rms_m / out.positions), out.sigma_m /= out.positions;
  return out;
}

// d' S^-1 d as the header of LeaveOneOut says.
double squared_contradiction(const LeaveOneOut& w, const calib::Camera& camera) {
  const Vector3d p = w.position;
  const auto at = [&](const Vector3d& q) { return camera.project_world(q)->px; };
  Eigen::Matrix<double, 2, 3> jacobian;
  for (int k = 0; k < 3; ++k)
    jacobian.col(k) = (at(p + 1e-5 * Vector3d::Unit(k)) - at(p - 1e-5 * Vector3d::Unit(k))) / 2e-5;
  const Eigen::Matrix2d s = w.covariance + jacobian * w.position_covariance * jacobian.transpose();
  const Vector2d d = w.px - at(p);
  return d.dot(s.inverse() * d);
}

class Witness : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Cameras, Witness, testing::Values(2, 3, 4));

TEST_P(Witness, ofGoodViewsIsChiSquare) {
  const scene::Scene scene = ring_scene(GetParam());
  ObjectTracker tracker(scene.rig, lime_target(), {});
  double sum = 0;
  int n = 0;
  run(tracker, scene, scene::render(scene, {.set_count = 90}), [&](const ObjectEstimate& e) {
    for (std::size_t c = 0; c < e.per_view.size(); ++c) {
      if (!e.per_view[c].leave_one_out) continue;
      EXPECT_EQ(e.per_view[c].leave_one_out->others, e.views - 1);
      sum += squared_contradiction(*e.per_view[c].leave_one_out, scene.rig.cameras[c]), ++n;
    }
    EXPECT_EQ(e.per_view[0].inflation_px, 0);
  });
  ASSERT_GT(n, 80 * GetParam());
  const double degrees_of_freedom = GetParam() == 2 ? 1 : 2;
  // An evenly lit ball is seen better than the covariance, which knows of shading, expects.
  EXPECT_GT(sum / n, 0.1 * degrees_of_freedom);
  EXPECT_LT(sum / n, 2 * degrees_of_freedom);
}

TEST(WitnessOfThree, showsWhichCameraIsTurned) {
  const scene::Scene scene = ring_scene(3);
  ObjectTracker tracker(turned(scene.rig, 2, 0.5, {1, 0.2, 0}), lime_target(), {});
  const calib::CameraRig rig = turned(scene.rig, 2, 0.5, {1, 0.2, 0});
  std::vector<double> sum(3, 0), n(3, 0);
  ObjectEstimate last;
  run(tracker, scene, scene::render(scene, {.set_count = 150}), [&](const ObjectEstimate& e) {
    last = e;
    for (std::size_t c = 0; c < 3; ++c)
      if (e.per_view[c].leave_one_out)
        sum[c] += squared_contradiction(*e.per_view[c].leave_one_out, rig.cameras[c]), ++n[c];
  });
  for (std::size_t c : {0, 1}) {
    EXPECT_GT(sum[c] / n[c], 5.99) << c;  // in 1 of 20 by chance: each stands on the wrong one, or is it
    EXPECT_GT(last.per_view[2].inflation_px, last.per_view[c].inflation_px) << c;
  }
  EXPECT_GT(last.per_view[2].inflation_px, 1);  // 0.5 degrees are 2.1 px
  EXPECT_LT(last.per_view[2].inflation_px, 4);
}

struct Wrong {
  int cameras;
  double degrees;
};
class TurnedCamera : public testing::TestWithParam<Wrong> {};
INSTANTIATE_TEST_SUITE_P(, TurnedCamera,
                         testing::Values(Wrong{2, 0.5}, Wrong{2, 2}, Wrong{3, 0.3}, Wrong{3, 1}, Wrong{3, 2},
                                         Wrong{3, 5}, Wrong{4, 1}),
                         [](const auto& param) {
                           return std::to_string(param.param.cameras) + "cameras" +
                                  std::to_string(int(10 * param.param.degrees));
                         });

// A pair of cameras cannot see what turns one of them along the epipolar lines: here it is turned across them.
TEST_P(TurnedCamera, IsInTheCovariance) {
  double nees = 0;
  int runs = 0;
  for (const Vector3d& axis : {Vector3d(1, 0.2, 0), Vector3d(1, -0.5, 0.5)}) {
    const scene::Scene scene = ring_scene(GetParam().cameras);
    const auto sets = scene::render(scene, {.set_count = 120, .seed = std::uint64_t(runs + 1)});
    ObjectTracker tracker(turned(scene.rig, 1, GetParam().degrees, axis), lime_target(), {});
    const Honesty o = run(tracker, scene, sets);
    EXPECT_LE(o.wrong_tracking, 15);
    nees += o.nees, ++runs;
  }
  EXPECT_LE(nees / runs, 8);
}

// Two of three views are consistent when it is found: the third one does not count, from the first set on.
TEST(Trust, FindsTheObjectWhereViewsAreConsistent) {
  const scene::Scene scene = ring_scene(3);
  for (const Vector3d& axis : {Vector3d(1, 0.2, 0), Vector3d(1, -0.5, 0.5), Vector3d(0.3, 1, 0)}) {
    ObjectTracker tracker(turned(scene.rig, 2, 3, axis), lime_target(), {});
    int positions = 0;
    run(tracker, scene, scene::render(scene, {.set_count = 12}), [&](const ObjectEstimate& e) {
      if (!e.has_position()) return;
      ++positions;
      const Vector3d error = e.position - scene.ball_at(0, e.at);
      EXPECT_LT(truth::nees(error, e.covariance), 16.3) << positions << ": " << 1000 * error.norm() << " mm";
    });
    EXPECT_GE(positions, 8);
  }
}

TEST(Trust, APoseReplacesTheRigs) {
  const scene::Scene scene = ring_scene(3);
  const auto sets = scene::render(scene, {.set_count = 90});
  ObjectTracker tracker(turned(scene.rig, 1, 2, {1, 1, 0}), lime_target(), {});
  std::vector<CameraTrust> trust(2);
  trust[1].cam_from_world = scene.rig.cameras[1].cam_from_world;
  tracker.trust(trust);
  const Honesty o = run(tracker, scene, sets);
  EXPECT_GT(o.tracking, 85);
  EXPECT_LT(o.rms_m, 0.006);
  tracker.trust({});  // as the rig says, again
  double inflation_px = 0;
  run(tracker, scene, scene::render(scene, {.set_count = 60}),
      [&](const ObjectEstimate& e) { inflation_px = double(e.per_view[1].inflation_px); });
  EXPECT_GT(inflation_px, 3);  // 2 degrees are 8 px
}

TEST(Trust, ANewPoseResetsInflation) {
  const scene::Scene scene = ring_scene(3);
  const auto sets = scene::render(scene, {.set_count = 120});
  ObjectTracker tracker(turned(scene.rig, 1, 2, {1, 1, 0}), lime_target(), {});
  const std::span<const capture::FrameSet> all(sets);
  for (const auto& set : all.first(60)) tracker.update(set);
  std::vector<CameraTrust> trust(3);
  trust[1].cam_from_world = scene.rig.cameras[1].cam_from_world;
  tracker.trust(trust);
  for (const auto& set : all.subspan(60)) {
    const ObjectEstimate e = tracker.update(set);
    if (set.number < 64) continue;
    EXPECT_EQ(e.state, TrackState::tracking) << set.number;
    EXPECT_LT((e.position - scene.ball_at(0, e.at)).norm(), 0.02) << set.number;
    EXPECT_LT(std::sqrt(e.covariance.trace()), 0.01) << set.number;
  }
}

// What views contradicted of a camera is explained once it is known to have moved: its pose is held to be as unsure as
// that, and no other view is inflated.
TEST(Trust, AnExplanationResetsInflation) {
  const scene::Scene scene = ring_scene(3);
  const auto sets = scene::render(scene, {.set_count = 70});
  for (const bool has_moved : {false, true}) {
    ObjectTracker tracker(turned(scene.rig, 1, 2, {1, 1, 0}), lime_target(), {});
    const std::span<const capture::FrameSet> all(sets);
    for (const auto& set : all.first(60)) tracker.update(set);
    std::vector<CameraTrust> trust(3);
    trust[1].has_moved = has_moved;
    trust[1].pose_covariance.topLeftCorner<3, 3>().diagonal().setConstant(4 * rad * rad);
    tracker.trust(trust);
    for (const auto& set : all.subspan(60)) {
      const ObjectEstimate e = tracker.update(set);
      if (has_moved)
        EXPECT_LT(e.per_view[1].inflation_px, 1) << set.number;
      else
        EXPECT_GT(e.per_view[1].inflation_px, 3) << set.number;
      EXPECT_EQ(e.state, TrackState::tracking) << set.number;
      EXPECT_LT((e.position - scene.ball_at(0, e.at)).norm(), 0.02) << set.number;
    }
  }
}

// What contradicts the others and is left out from then on says nothing more, though the others' own past is forgotten
// as one of them was posed anew.
TEST(Trust, LeavingACameraOutResetsInflation) {
  const scene::Scene scene = ring_scene(3);
  const auto sets = scene::render(scene, {.set_count = 90});
  ObjectTracker tracker(turned(scene.rig, 1, 2, {1, 1, 0}), lime_target(), {});
  const std::span<const capture::FrameSet> all(sets);
  for (const auto& set : all.first(60)) tracker.update(set);
  std::vector<CameraTrust> trust(3);
  trust[1].is_used = false;
  calib::Tangent6d hardly = calib::Tangent6d::Zero();
  hardly[0] = 1e-5;
  trust[2].cam_from_world = calib::exp(hardly) * scene.rig.cameras[2].cam_from_world;
  tracker.trust(trust);
  for (const auto& set : all.subspan(60)) {
    const ObjectEstimate e = tracker.update(set);
    if (set.number < 62) continue;
    EXPECT_EQ(e.state, TrackState::tracking) << set.number;
    EXPECT_LT(std::sqrt(e.covariance.trace()), 0.012) << set.number;
  }
}

// However long an object rests: what a pose leaves open is not averaged away.
TEST(Trust, APosesUncertaintyIsNotAveragedOut) {
  const scene::Scene scene = scene::SceneBuilder{}
                                 .cameras_on_ring({.count = 3})
                                 .ball({.path = [](double) { return Vector3d(0.1, 0.2, 1); }})
                                 .build();
  const auto sets = scene::render(scene, {.set_count = 150});
  ObjectTracker tracker(scene.rig, lime_target(), {});
  std::vector<CameraTrust> trust(3);
  constexpr double sigma = 0.2 * rad;
  for (CameraTrust& camera : trust) camera.pose_covariance.topLeftCorner<3, 3>().diagonal().setConstant(sigma * sigma);
  tracker.trust(trust);
  ObjectEstimate last;
  const Honesty o = run(tracker, scene, sets, [&](const ObjectEstimate& e) { last = e; });
  EXPECT_GT(o.tracking, 140);
  // At some 2.6 m each camera leaves 9 mm open on two axes: three of them, 5.2 mm on the plane that they all see
  // askance, and about as much upwards.
  const double expected_m = 2.6 * sigma;
  const Vector3d sigmas = last.covariance.diagonal().cwiseSqrt();
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GT(sigmas[axis], 0.45 * expected_m) << axis;
    EXPECT_LT(sigmas[axis], 1.2 * expected_m) << axis;
  }
}

TEST(Trust, AnUnusedCameraDoesNotMoveTheTrackAndIsStillCompared) {
  const scene::Scene scene = ring_scene(3);
  const auto sets = scene::render(scene, {.set_count = 60});
  std::vector<capture::FrameSet> without = sets;
  for (capture::FrameSet& set : without) set.frames[1].reset();
  ObjectTracker all(scene.rig, lime_target(), {}), two(scene.rig, lime_target(), {});
  std::vector<CameraTrust> trust(3);
  trust[1].is_used = false;
  all.trust(trust);
  int witnessed = 0;
  for (std::size_t i = 0; i < sets.size(); ++i) {
    const ObjectEstimate a = all.update(sets[i]), b = two.update(without[i]);
    EXPECT_EQ(a.state, b.state);
    EXPECT_EQ(a.views, b.views);
    if (!a.has_position()) continue;
    EXPECT_EQ(a.position, b.position);
    EXPECT_EQ(a.covariance, b.covariance);
    EXPECT_TRUE(a.per_view[1].delivered);
    EXPECT_FALSE(a.per_view[1].seen);
    if (!a.per_view[1].leave_one_out) continue;
    ++witnessed;
    EXPECT_EQ(a.per_view[1].leave_one_out->others, 2);
    EXPECT_LT((a.per_view[1].leave_one_out->position - scene.ball_at(0, a.at)).norm(), 0.03);
    ASSERT_TRUE(a.per_view[0].leave_one_out);
    EXPECT_EQ(a.per_view[0].leave_one_out->others, 1);
  }
  EXPECT_GT(witnessed, 50);
}

TEST(Trust, RejectsWhatIsNotFinite) {
  const scene::Scene scene = ring_scene(2);
  ObjectTracker tracker(scene.rig, lime_target(), {});
  std::vector<CameraTrust> trust(1);
  trust[0].pose_covariance(3, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(tracker.trust(trust), std::invalid_argument);
}

// Two cameras side by side that look the same way, at a point before them.
PathResidual beside(int camera, double off_u, double off_v) {
  PathResidual out;
  out.camera = camera;
  out.px = {100, 100};
  out.off_px = {off_u, off_v};
  out.covariance = 0.04 * Eigen::Matrix2d::Identity();
  const double angle = 2.0 * camera;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
  Eigen::Matrix<double, 2, 3> jacobian;
  jacobian << 100, 0, 0, 0, 0, -100;
  out.jacobian = jacobian * turn;
  return out;
}

constexpr double radius_m = 0.04;

// The views of these cameras agree in two places.
void prove(EpipolarConsistency& doubts, std::initializer_list<int> cameras) {
  for (int place = 0; place < 2; ++place) {
    std::vector<PathResidual> views;
    for (const int camera : cameras) {
      views.push_back(beside(camera, 0, 0));
      views.back().px = {100.0 * place, 50};
    }
    doubts.compare(views, 0, 0);
  }
}

TEST(EpipolarConsistency, TwoViewsAreNotComparedAlongTheirEpipolarLines) {
  EpipolarResidual seen;
  ASSERT_TRUE(epipolar_residual(beside(0, 5, 0), beside(1, -7, 0), 0, seen));
  EXPECT_NEAR(seen.off_px, 0, 1e-9);
  ASSERT_TRUE(epipolar_residual(beside(0, 5, 3), beside(1, -7, 0), 0, seen));
  EXPECT_NEAR(std::abs(seen.off_px), 3 / std::sqrt(2), 1e-9);
  EXPECT_NEAR(seen.expected_px2, 0.04, 1e-9);
  EXPECT_NEAR(seen.share_i + seen.share_j, 1, 1e-9);
  EXPECT_FALSE(epipolar_residual(beside(0, 0, 0), beside(0, 0, 0), 0, seen));
}

TEST(EpipolarConsistency, IdentifiesOneOfThreeAndNotOneOfTwo) {
  EpipolarConsistency three(3, radius_m), two(2, radius_m);
  prove(three, {0, 2});
  prove(two, {0, 1});
  for (int i = 0; i < 40; ++i) {
    const double noise = 0.1 * ((i % 5) - 2);
    three.compare(std::vector{beside(0, 0, noise), beside(1, 0, 5), beside(2, 0, -noise)}, 0, 0);
    two.compare(std::vector{beside(0, 0, noise), beside(1, 0, 5)}, 0, 0);
  }
  EXPECT_NEAR(std::sqrt(three.variance_px2(1)), 5, 2);
  EXPECT_EQ(three.variance_px2(0), 0);  // one camera explains it
  EXPECT_EQ(three.variance_px2(2), 0);
  EXPECT_NEAR(two.variance_px2(0), two.variance_px2(1), 1e-9);
  EXPECT_NEAR(std::sqrt(two.variance_px2(0) + two.variance_px2(1)), 5, 2);
  three.forget(1);
  EXPECT_FALSE(three.any());
}

// Two of three that agree may do so by chance, along their epipolar lines: in one place they do, and hardly in two.
TEST(EpipolarConsistency, ConsistencyInOnePlaceClearsNoView) {
  EpipolarConsistency doubts(3, radius_m);
  const auto contradict = [&] {
    for (int i = 0; i < 40; ++i) doubts.compare(std::vector{beside(0, 0, 0), beside(1, 0, 5), beside(2, 0, 0)}, 0, 0);
  };
  contradict();
  for (std::size_t c = 0; c < 3; ++c) EXPECT_GE(std::sqrt(doubts.variance_px2(c)), 5) << c;
  EXPECT_FALSE(doubts.no_consistent_pair()) << "two agree here";
  prove(doubts, {0, 2});
  contradict();
  EXPECT_EQ(doubts.variance_px2(0), 0);
  EXPECT_NEAR(std::sqrt(doubts.variance_px2(1)), 5, 2);
}

// Half a ball is off by a little, and by one view alone, in any rig.
TEST(EpipolarConsistency, ASmallInconsistencyNeedsNoProof) {
  EpipolarConsistency doubts(3, radius_m);
  for (int i = 0; i < 40; ++i) doubts.compare(std::vector{beside(0, 0, 0), beside(1, 0, 0.7), beside(2, 0, 0)}, 0, 0);
  EXPECT_NEAR(std::sqrt(doubts.variance_px2(1)), 0.7, 0.4);
  EXPECT_EQ(doubts.variance_px2(0), 0);
  EXPECT_EQ(doubts.variance_px2(2), 0);
}

// With unknown timing, views of a moving object are consistent with anything.
TEST(EpipolarConsistency, AViewThatCannotBeInconsistentProvesNothing) {
  EpipolarConsistency doubts(2, radius_m);
  for (int place = 0; place < 5; ++place) {
    std::vector views{beside(0, 0, 0), beside(1, 0, 0)};
    for (PathResidual& view : views) view.px.x() = 100.0 * place, view.covariance *= 25 * 25;
    doubts.compare(views, 0, 0);
  }
  for (int i = 0; i < 40; ++i) doubts.compare(std::vector{beside(0, 0, 0), beside(1, 0, 5)}, 0, 0);
  EXPECT_TRUE(doubts.no_consistent_pair());
  for (std::size_t c = 0; c < 2; ++c) EXPECT_GE(std::sqrt(doubts.variance_px2(c)), 5) << c;
}

// beside(): sigma 0.2 px per axis, of which a pair's residual has as much.
TEST(EpipolarConsistency, ErrorsBeyondTheStatedOnesShowInTheNoise) {
  std::mt19937 rng(3);
  std::normal_distribution<double> normal;
  for (const auto& [sigma_px, least, most] :
       {std::tuple(0.2, 1.0, 1.5), std::tuple(0.3, 1.4, 3.4), std::tuple(0.02, 1.0, 1.0)}) {
    EpipolarConsistency doubts(3, radius_m);
    EXPECT_EQ(doubts.noise_scale2(), 1);
    double sum = 0;
    for (int i = 0; i < 400; ++i) {
      const auto view = [&](int camera) { return beside(camera, sigma_px * normal(rng), sigma_px * normal(rng)); };
      doubts.compare(std::vector{view(0), view(1), view(2)}, 0, 0);
      sum += doubts.noise_scale2();
    }
    EXPECT_GE(sum / 400, least) << sigma_px;
    EXPECT_LE(sum / 400, most) << sigma_px;
  }
}

TEST(EpipolarConsistency, AnInconsistentCameraIsNoUnboundedNoise) {
  EpipolarConsistency doubts(3, radius_m);
  prove(doubts, {0, 2});
  for (int i = 0; i < 100; ++i) doubts.compare(std::vector{beside(0, 0, 0), beside(1, 0, 5), beside(2, 0, 0)}, 0, 0);
  EXPECT_GT(doubts.noise_scale2(), 2) << "two of three pairs are inconsistent";
  EXPECT_LE(doubts.noise_scale2(), 4) << "5 px are 25 sigmas, which the camera's inflation explains";
}

// Of two cameras that could be wrong, each by what it would take, however well the third one sees them.
TEST(EpipolarConsistency, InflatesEachOfTwoThatMayBeWrong) {
  EpipolarConsistency doubts(3, radius_m);
  prove(doubts, {0, 2});
  for (int i = 0; i < 40; ++i) {
    EpipolarResidual apart{.off_px = 4, .expected_px2 = 0.04, .share_i = 0.5, .share_j = 0.5};
    EpipolarResidual together{.off_px = 0.1, .expected_px2 = 0.04, .share_i = 0.8, .share_j = 0.2};
    doubts.add(0, 1, apart);
    doubts.add(0, 2, together);
    std::swap(together.share_i, together.share_j);
    doubts.add(1, 2, together);
  }
  EXPECT_NEAR(doubts.variance_px2(0), 16, 1);  // 32 px^2 alone, half of it with even odds
  EXPECT_NEAR(doubts.variance_px2(1), 16, 1);
  EXPECT_EQ(doubts.variance_px2(2), 0);
}

// An error that lies almost along both other cameras' epipolar lines shows in how little they say apart from each
// other.
TEST(EpipolarConsistency, anErrorAlongTheLinesIsAsLargeAsItTakes) {
  const auto tilted = [](int camera, const Vector2d& off) {
    PathResidual out = beside(camera, off.x(), off.y());
    const Vector3d level = out.jacobian.row(0).normalized();
    out.jacobian = (out.jacobian * Eigen::AngleAxisd(-0.2 - 0.1 * camera, level).toRotationMatrix()).eval();
    return out;
  };
  EpipolarResidual first, second;
  ASSERT_TRUE(epipolar_residual(tilted(0, {0, 0}), tilted(1, {0, 0}), 0, first));
  ASSERT_TRUE(epipolar_residual(tilted(0, {0, 0}), tilted(2, {0, 0}), 0, second));
  Vector2d across_both = first.across_i.normalized();
  if (across_both.dot(second.across_i) < 0) second.across_i = -second.across_i;
  across_both = (across_both + second.across_i.normalized()).normalized();
  const Vector2d error = 20 * Vector2d(-across_both.y(), across_both.x());
  EpipolarConsistency doubts(3, radius_m);
  prove(doubts, {1, 2});
  for (int i = 0; i < 40; ++i)
    doubts.compare(std::vector{tilted(0, error), tilted(1, {0, 0}), tilted(2, {0, 0})}, 0, 0);
  ASSERT_LT(std::abs(first.across_i.normalized().dot(error)), 10);  // half of it is seen across, at most
  EXPECT_NEAR(std::sqrt(doubts.variance_px2(0)), 20, 6);
  EXPECT_EQ(doubts.variance_px2(1), 0);
  EXPECT_EQ(doubts.variance_px2(2), 0);
}

// A frame that is shown once more, something else of the colour: as long as it is rare.
TEST(EpipolarConsistency, RareOnesInflateNothing) {
  EpipolarConsistency doubts(2, radius_m);
  for (int i = 0; i < 100; ++i) {
    doubts.compare(std::vector{beside(0, 0, 0.1 * ((i % 5) - 2)), beside(1, 0, i % 6 == 5 && i > 8 ? 20 : 0)}, 0, 0);
    EXPECT_FALSE(doubts.any()) << i;
  }
}

// A shirt that was taken for the ball for a second, in one view, is no error of its camera: the ball shows that later.
TEST(EpipolarConsistency, ConsistencyInTwoPlacesEndsAGrossInconsistency) {
  EpipolarConsistency doubts(2, radius_m);
  prove(doubts, {0, 1});
  for (int i = 0; i < 60; ++i) doubts.compare(std::vector{beside(0, 0, 0), beside(1, 0, 40)}, 0, 0);
  const auto see_both = [&](double u) {
    for (int i = 0; i < 40; ++i) {
      std::vector views{beside(0, 0, 0.1 * ((i % 5) - 2)), beside(1, 0, 0)};
      for (PathResidual& view : views) view.px = {u, 50};
      doubts.compare(views, 0, 0);
    }
  };
  see_both(0);
  EXPECT_GT(std::sqrt(doubts.variance_px2(0)), 10) << "one place: the error may lie along the epipolar lines";
  see_both(200);
  const double half_radius_px = 0.5 * radius_m * beside(0, 0, 0).jacobian.norm() / std::sqrt(2);
  EXPECT_LE(std::sqrt(doubts.variance_px2(0)), 1.5 * half_radius_px);
}

// A region of furniture that was taken for the object in three frames counts then, and not for long after.
TEST(EpipolarConsistency, ABriefInconsistencyIsForgotten) {
  EpipolarConsistency doubts(2, radius_m);
  for (int i = 0; i < 60; ++i) {
    doubts.compare(std::vector{beside(0, 0, 0.1 * ((i % 5) - 2)), beside(1, 0, i >= 20 && i < 23 ? 90 : 0)}, 0, 0);
    EXPECT_EQ(doubts.any(), i == 21 || i == 22) << i;
  }
}

}  // namespace
}  // namespace huetrack::object_trackers
