#include "object_tracking/trackers/object_tracker.h"

#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <bit>
#include <cmath>
#include <functional>
#include <random>
#include <stdexcept>

#include "capture/frames/jpeg_encoder.h"
#include "capture/jpeg/jpeg_reader.h"
#include "object_tracking/trackers/region_tracker.h"
#include "scene/lime.h"
#include "truth/truth.h"

namespace huetrack::object_trackers {

using namespace object_tracking;
using namespace objects;

namespace {

using Eigen::Vector3d;
using scene::lime;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

scene::BallOptions pink_ball() {
  return {.name = "pink", .rgb = {0.85, 0.25, 0.55}};
}

TargetOptions pink() {
  TargetOptions t = lime();
  t.name = "pink";
  t.color.hue_min_deg = 310, t.color.hue_max_deg = 355;
  return t;
}

ObjectTrackerOptions options_with(std::uint64_t seed = 1, Observation observation = Observation::huetrack) {
  ObjectTrackerOptions o;
  o.seed = seed;
  o.observation = observation;
  return o;
}

scene::SceneBuilder ring(int count) {
  return scene::SceneBuilder{}.cameras_on_ring({.count = count});
}

// What holds of every estimate, whatever happens.
void expect_sound(const ObjectEstimate& e, const capture::FrameSet& set, std::size_t cameras) {
  // Of the newest sighting, which lies on some row of some frame of the set.
  EXPECT_LT(std::chrono::abs(e.at - set.at), std::chrono::milliseconds(60));
  if (!e.has_position()) {
    EXPECT_EQ(e.at, set.at);
  }
  EXPECT_EQ(e.set_number, set.number);
  EXPECT_EQ(e.has_position(), e.state == TrackState::tracking || e.state == TrackState::coasting);
  for (const bool finite :
       {e.position.allFinite(), e.velocity.allFinite(), e.covariance.allFinite(), e.map_position.allFinite()})
    EXPECT_EQ(finite, e.has_position()) << name(e.state);
  if (e.has_position()) {
    EXPECT_EQ(Eigen::LLT<Eigen::Matrix3d>(e.covariance).info(), Eigen::Success) << e.covariance;
    EXPECT_LT((e.covariance - e.covariance.transpose()).norm(), 1e-12);
  }
  EXPECT_GE(e.confidence, 0);
  EXPECT_LE(e.confidence, 1);
  EXPECT_GE(e.effective_sample_size, 1);
  EXPECT_LE(e.effective_sample_size, e.particle_count);
  ASSERT_EQ(e.per_view.size(), cameras);
  int seen = 0;
  for (std::size_t c = 0; c < cameras; ++c) {
    const ViewSupport& view = e.per_view[c];
    seen += view.seen ? 1 : 0;
    EXPECT_TRUE(!view.seen || view.in_view);
    EXPECT_TRUE(!view.in_view || view.delivered);
    EXPECT_TRUE(!view.delivered || (c < set.frames.size() && set.frames[c]));
    EXPECT_EQ(view.px.allFinite(), view.in_view);
  }
  EXPECT_EQ(seen, e.views);
}

struct Outcome {
  std::vector<ObjectEstimate> estimates;
  std::vector<double> error_m;                           // NaN without a position
  std::size_t lock = 1000;                               // 1: the first set
  double rms_m = 0, mean_nees = 0, share_inside_95 = 0;  // from the lock on, in `tracking`
};

Outcome run(const scene::Scene& scene, const std::vector<capture::FrameSet>& sets, const TargetOptions& target,
            const ObjectTrackerOptions& options, std::size_t ball = 0) {
  ObjectTracker tracker(scene.rig, target, options);
  Outcome out;
  double sum2 = 0;
  int n = 0;
  for (const capture::FrameSet& set : sets) {
    const ObjectEstimate e = tracker.update(set);
    expect_sound(e, set, scene.rig.cameras.size());
    const Vector3d error = e.position - scene.ball_at(ball, e.at);
    out.error_m.push_back(error.norm());
    out.estimates.push_back(e);
    if (e.state != TrackState::tracking) continue;
    // The distance of what one view sees is by its size.
    EXPECT_TRUE(error.norm() < 0.1 || (e.views < 2 && truth::nees(error, e.covariance) < 14.2))
        << "`tracking`, set " << set.number << ", off by " << error.norm();
    if (out.lock == 1000) out.lock = out.estimates.size();
    const double nees = truth::nees(error, e.covariance);
    sum2 += error.squaredNorm(), out.mean_nees += nees, out.share_inside_95 += nees < 7.815 ? 1 : 0, ++n;
  }
  out.rms_m = std::sqrt(sum2 / n), out.mean_nees /= n, out.share_inside_95 /= n;
  return out;
}

// All that it says, to the last bit.
std::vector<std::uint64_t> bits_of(const ObjectEstimate& e) {
  std::vector<std::uint64_t> out{static_cast<std::uint64_t>(e.state), static_cast<std::uint64_t>(e.views),
                                 static_cast<std::uint64_t>(e.particle_count)};
  const auto add = [&out](double x) { out.push_back(std::bit_cast<std::uint64_t>(x)); };
  for (int i = 0; i < 3; ++i) add(e.position(i)), add(e.velocity(i)), add(e.map_position(i));
  for (int i = 0; i < 9; ++i) add(e.covariance(i));
  add(e.confidence), add(e.effective_sample_size);
  for (const ViewSupport& v : e.per_view) {
    out.push_back((v.delivered ? 1 : 0) + (v.in_view ? 2 : 0) + (v.seen ? 4 : 0));
    for (const float x : {v.px.x(), v.px.y(), v.radius_px, v.support, v.residual_px})
      out.push_back(std::bit_cast<std::uint32_t>(x));
  }
  return out;
}

std::vector<std::vector<std::uint64_t>> bits_of(const std::vector<ObjectEstimate>& estimates) {
  std::vector<std::vector<std::uint64_t>> out;
  for (const ObjectEstimate& e : estimates) out.push_back(bits_of(e));
  return out;
}

TEST(ObjectTracker, TracksByTheThirdSetWithAConsistentCovariance) {
  double nees = 0, inside = 0;
  int runs = 0;
  for (const int cameras : {2, 3}) {
    const scene::Scene scene = ring(cameras).ball({}).build();
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const Outcome o = run(scene, scene::render(scene, {.set_count = 50, .seed = seed}), lime(), options_with(seed));
      EXPECT_LE(o.lock, 3u) << cameras << " cameras, seed " << seed;
      EXPECT_LT(o.rms_m, 0.006) << cameras << " cameras, seed " << seed;
      for (std::size_t i = o.lock; i < o.estimates.size(); ++i)
        EXPECT_EQ(o.estimates[i].state, TrackState::tracking) << i;
      nees += o.mean_nees, inside += o.share_inside_95, ++runs;
    }
  }
  EXPECT_GT(nees / runs,
            0.9);  // this scene lights balls evenly: errors that last, which the tracker expects, are not there
  EXPECT_LT(nees / runs, 6);
  EXPECT_GT(inside / runs, 0.85);
}

TEST(ObjectTracker, readsEveryFormat) {
  for (const capture::PixelFormat format :
       {capture::PixelFormat::yuyv, capture::PixelFormat::nv12, capture::PixelFormat::i420, capture::PixelFormat::i422,
        capture::PixelFormat::i444, capture::PixelFormat::bgr}) {
    const scene::Scene scene = ring(2).ball({}).build();
    const Outcome o = run(scene, scene::render(scene, {.set_count = 15, .format = format}), lime(), options_with());
    EXPECT_LE(o.lock, 3u) << capture::name(format);
    EXPECT_LT(o.rms_m, 0.01) << capture::name(format);
  }
}

TEST(ObjectTracker, FindsNothingInAnEmptyRoom) {
  scene::Scene scene = ring(3).build();
  ObjectTracker tracker(scene.rig, lime(), options_with());
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 20})) {
    const ObjectEstimate e = tracker.update(set);
    expect_sound(e, set, 3);
    EXPECT_EQ(e.state, TrackState::searching);
  }
  ObjectTracker of_grey(scene.rig, lime(), options_with());
  scene.balls.push_back({});
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 5, .format = capture::PixelFormat::grey})) {
    EXPECT_EQ(of_grey.update(set).state, TrackState::searching);
  }
}

// Through a chimney without a roof, 40 cm wide, whose walls hide the ball from all cameras for a second.
class BehindWalls : public testing::TestWithParam<int> {};

TEST_P(BehindWalls, CoastsIsLostAndComesBack) {
  const double a = 0.2;
  const Vector3d up(0, 0, 2.5), x(2 * a, 0, 0), y(0, 2 * a, 0);
  scene::SceneBuilder builder = ring(GetParam());
  for (const scene::Wall& wall :
       {scene::Wall{{-a, -a, 0}, x, up}, {{-a, a, 0}, x, up}, {{-a, -a, 0}, y, up}, {{a, -a, 0}, y, up}})
    builder.wall(wall);
  const scene::Scene scene =
      builder.ball({.path = [](double t) { return Vector3d(-0.7 + 0.35 * t, 0.45 - 0.2 * t, 1.0); }}).build();
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const Outcome o = run(scene, scene::render(scene, {.set_count = 120, .seed = seed}), lime(), options_with(seed));
    const auto state_is = [&](TrackState s) { return std::ranges::count(o.estimates, s, &ObjectEstimate::state); };
    EXPECT_LE(o.lock, 3u);
    EXPECT_GT(state_is(TrackState::coasting), 2);
    EXPECT_GT(state_is(TrackState::lost), 2);
    EXPECT_LT(state_is(TrackState::searching), 3);  // that is before it was ever found
    EXPECT_EQ(o.estimates.back().state, TrackState::tracking);
    EXPECT_LT(o.error_m.back(), 0.02);
    // While it coasts it is ever less sure.
    for (std::size_t i = 1; i < o.estimates.size(); ++i) {
      const ObjectEstimate &before = o.estimates[i - 1], &now = o.estimates[i];
      if (now.state == TrackState::coasting && now.views == 0 && before.has_position()) {
        EXPECT_GT(now.covariance.trace(), before.covariance.trace()) << i;
      }
      if (now.views == 0) {
        EXPECT_NE(now.state, TrackState::tracking) << i;
      }
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Cameras, BehindWalls, testing::Values(2, 3));

// While no view sees the object, two views show something of its colour where it cannot have come: for one
// set it is not taken for it, and for good it is.
TEST(ObjectTracker, RejectsADetectionOutOfReach) {
  constexpr std::size_t hidden_from = 55, elsewhere_from = 60, seen_from = 61, sets = 75;
  const auto along = [](double t) { return Vector3d(-0.5 + 0.3 * t, 0.3, 1); };
  const Vector3d elsewhere(0.3, -0.6, 1.2);
  const scene::Scene scene = ring(3).ball({.path = along}).build();
  const scene::Scene other = ring(3).ball({.path = [&](double) { return elsewhere; }}).build();
  const scene::Scene empty = ring(3).build();
  const scene::RenderOptions rendered{.set_count = int(sets)};
  const auto of_ball = scene::render(scene, rendered), of_other = scene::render(other, rendered),
             of_none = scene::render(empty, rendered);
  for (const bool is_for_good : {false, true}) {
    ObjectTracker tracker(scene.rig, lime(), options_with());
    ObjectEstimate e;
    for (std::size_t i = 0; i < sets; ++i) {
      capture::FrameSet set = of_ball[i];
      const bool is_elsewhere = i >= elsewhere_from && (i < seen_from || is_for_good);
      if (is_elsewhere) set.frames[0] = of_none[i].frames[0];
      for (const std::size_t c : {1u, 2u}) {
        if (is_elsewhere)
          set.frames[c] = of_other[i].frames[c];
        else if (i >= hidden_from && i < elsewhere_from)
          set.frames[c] = of_none[i].frames[c];
      }
      e = tracker.update(set);
      if (i + 1 == elsewhere_from) {
        ASSERT_EQ(e.state, TrackState::coasting) << "else the test shows nothing";
      }
      if (i >= elsewhere_from && i < seen_from && e.state == TrackState::tracking) {
        EXPECT_LT((e.position - along(capture::seconds(e.at - of_ball[0].at))).norm(), 0.1) << i;
      }
    }
    EXPECT_EQ(e.state, TrackState::tracking) << is_for_good;
    const Vector3d there = is_for_good ? elsewhere : along(capture::seconds(e.at - of_ball[0].at));
    EXPECT_LT((e.position - there).norm(), 0.02) << is_for_good;
  }
}

TEST(ObjectTracker, droppedFrames) {
  const scene::Scene scene = ring(3).ball({}).build();
  const Outcome o =
      run(scene, scene::render(scene, {.set_count = 90, .dropped_frames = 0.25, .seed = 3}), lime(), options_with());
  EXPECT_LE(o.lock, 6u);
  EXPECT_LT(o.rms_m, 0.01);
  EXPECT_EQ(std::ranges::count(o.estimates, TrackState::lost, &ObjectEstimate::state), 0);
}

// The rig says when their rows are exposed: global shutters, stamped at mid-exposure.
scene::Scene with_known_times(scene::Scene scene) {
  for (calib::Camera& camera : scene.rig.cameras)
    camera.timing = {.latency_s = 0, .latency_sigma_s = 0, .readout_s = 0, .readout_sigma_s = 0};
  return scene;
}

// The same with unknown timing: its uncertainty is published, and then estimated.
TEST(ObjectTracker, EstimatesUnknownTiming) {
  const scene::Scene scene =
      ring(3)
          .ball({.path =
                     [](double t) {
                       return Vector3d(0.5 * std::sin(4 * t), 0.4 * std::cos(4 * t), 1 + 0.3 * std::sin(3 * t));
                     }})
          .build();
  std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 240, .offset_s = {0, 0.011, 0.022}});
  for (capture::FrameSet& set : sets) {  // one camera's stamps are late
    for (auto& frame : set.frames)
      if (frame && frame->camera == 2) frame->captured_at += capture::duration_of(0.025);
    set.at += capture::duration_of(0.025);
  }
  ObjectTracker tracker(scene.rig, lime(), options_with());
  double nees = 0, sum2 = 0;
  int n = 0, late_n = 0;
  ObjectEstimate e;
  for (const capture::FrameSet& set : sets) {
    e = tracker.update(set);
    if (e.state != TrackState::tracking) continue;
    const Vector3d error = e.position - scene.ball_at(0, e.at);
    nees += truth::nees(error, e.covariance), ++n;
    if (set.number >= 150) sum2 += error.squaredNorm(), ++late_n;
  }
  EXPECT_GT(n, 200);
  EXPECT_LT(nees / n, 6);
  EXPECT_LT(std::sqrt(sum2 / late_n), 0.015);
  EXPECT_NEAR(e.times[1].latency_s, 0, 0.0015);
  EXPECT_NEAR(e.times[2].latency_s, 0.025, 0.0015);
  EXPECT_EQ(e.times[0].latency_sigma_s, 0);
}

// One rig has one timing: what a target that moves shows of it, a target that has been at rest knows when it is thrown.
TEST(ObjectTracker, ATargetAtRestKnowsTheTimingByAnother) {
  constexpr double thrown_s = 4;
  const scene::Scene scene =
      ring(3)
          .ball({.path =
                     [](double t) {
                       return Vector3d(0.5 * std::sin(4 * t), 0.4 * std::cos(4 * t), 1.1 + 0.2 * std::sin(3 * t));
                     }})
          .ball({.name = "pink",
                 .rgb = pink_ball().rgb,
                 .path =
                     [](double t) {
                       const double since = std::max(0.0, t - thrown_s);
                       return Vector3d(0.7 - 2 * since, -0.7 + 1.5 * since, 0.6 + 1.5 * since - 4.9 * since * since);
                     }})
          .build();
  std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 135, .offset_s = {0, 0.011, 0.022}});
  for (capture::FrameSet& set : sets) {
    for (auto& frame : set.frames)
      if (frame && frame->camera == 2) frame->captured_at += capture::duration_of(0.025);
    set.at += capture::duration_of(0.025);
  }
  const auto flight = [&](bool is_shared) {
    std::vector<ObjectTracker> trackers;
    for (const TargetOptions& target : {lime(), pink()}) trackers.emplace_back(scene.rig, target, options_with());
    double sum2 = 0, nees = 0;
    int n = 0;
    for (const capture::FrameSet& set : sets) {
      trackers[0].update(set);
      const ObjectEstimate e = trackers[1].update(set);
      if (is_shared) ObjectTracker::share_times(trackers);
      for (ObjectTracker& tracker : trackers) tracker.learn();
      const double since = capture::seconds(e.at - sets[0].at) - thrown_s;
      if (since < 0 || since > 0.3 || e.state != TrackState::tracking) continue;
      const Vector3d error = e.position - scene.ball_at(1, e.at);
      sum2 += error.squaredNorm(), nees += truth::nees(error, e.covariance), ++n;
    }
    return std::tuple(n, std::sqrt(sum2 / n), nees / n);
  };
  const auto [n, rms_m, nees] = flight(true);
  const auto [n_alone, rms_alone_m, nees_alone] = flight(false);
  EXPECT_GE(n, 8);
  EXPECT_LT(rms_m, 0.5 * rms_alone_m) << n_alone;
  EXPECT_LT(nees, 8) << nees_alone;
}

// Two of three cameras are of another host, whose clock is off by some milliseconds that cannot be determined from the
// stamps. How well it is known comes with the frames, and is a part of the covariance.
TEST(ObjectTracker, CovarianceContainsAnotherHostsClock) {
  constexpr double sigma_s = 3e-3;
  double nees_known = 0, nees_unknown = 0;
  int runs = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    scene::Scene scene =
        ring(3)
            .ball({.path =
                       [](double t) {
                         return Vector3d(0.5 * std::sin(4 * t), 0.4 * std::cos(4 * t), 1 + 0.3 * std::sin(3 * t));
                       }})
            .build();
    for (calib::Camera& camera : scene.rig.cameras)
      camera.timing = {.latency_s = 0, .latency_sigma_s = 2e-4, .readout_s = 0, .readout_sigma_s = 2e-4};
    std::mt19937 random(seed);
    const double off_s = std::normal_distribution<double>(0, sigma_s)(random);
    std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 45, .offset_s = {0, 0.011, 0.022}});
    for (const bool is_known : {false, true}) {
      for (capture::FrameSet& set : sets) {
        for (auto& frame : set.frames) {
          if (!frame || frame->camera == 0) continue;
          if (!is_known)
            frame->captured_at += capture::duration_of(off_s), set.at = std::max(set.at, frame->captured_at);
          frame->clock = {.of = 1, .sigma = capture::duration_of(is_known ? sigma_s : 0)};
        }
      }
      ObjectTracker tracker(scene.rig, lime(), options_with(seed));
      double sum = 0;
      int n = 0;
      for (const capture::FrameSet& set : sets) {
        const ObjectEstimate e = tracker.update(set);
        if (e.state != TrackState::tracking) continue;
        const Vector3d error = e.position - scene.ball_at(0, e.at);
        sum += truth::nees(error, e.covariance), ++n;
      }
      ASSERT_GT(n, 35) << seed;
      (is_known ? nees_known : nees_unknown) += sum / n;
    }
    ++runs;
  }
  EXPECT_LT(nees_known / runs, 5) << "3 is honest";
  EXPECT_GT(nees_unknown / runs, 2 * nees_known / runs);
}

// All cameras are of one other host: what its clock is off moves nothing that views could show, and the position as a
// whole along its way.
TEST(ObjectTracker, CovarianceContainsASharedClock) {
  const scene::Scene scene = ring(3).ball({}).build();
  std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 30});
  ObjectTracker exact(scene.rig, lime(), options_with()), unsure(scene.rig, lime(), options_with());
  int compared = 0;
  for (capture::FrameSet& set : sets) {
    const ObjectEstimate a = exact.update(set);
    for (auto& frame : set.frames) frame->clock = {.of = 1, .sigma = capture::duration_of(2e-3)};
    const ObjectEstimate b = unsure.update(set);
    ASSERT_EQ(a.state, b.state);
    if (a.state != TrackState::tracking) continue;
    EXPECT_TRUE(a.position == b.position);
    const Eigen::Matrix3d expected = a.covariance + 4e-6 * a.velocity * a.velocity.transpose();
    EXPECT_LT((b.covariance - expected).norm(), 1e-12);
    ++compared;
  }
  EXPECT_GT(compared, 20);
}

// It falls at 5 m/s and comes back as fast: between two frames at 60 fps its velocity changes by 10 m/s.
TEST(ObjectTracker, CovarianceContainsTheCalibrationWhichDoesNotMoveTheTrack) {
  scene::Scene scene = ring(3).ball({}).build();
  const auto sets = scene::render(scene, {.set_count = 30});
  TargetOptions regions_only = lime();  // sightings that are as sure in each view: outlines come to one before another
  regions_only.shape = TargetShape::blob;
  ObjectTracker exact(scene.rig, regions_only, options_with());
  // Poses to 3 mrad and 5 mm, each for itself.
  Eigen::VectorXd variance(18);
  for (int c = 0; c < 3; ++c) variance.segment<6>(6 * c) << 9e-6, 9e-6, 9e-6, 25e-6, 25e-6, 25e-6;
  calib::CameraRig rig = scene.rig;
  rig.uncertainty = calib::RigUncertainty::of(std::vector(3, calib::RigUncertainty::CameraParameters{.has_pose = true}),
                                              variance.asDiagonal().toDenseMatrix());
  ObjectTracker unsure(rig, regions_only, options_with()), mended(rig, regions_only, options_with());
  std::vector<CameraTrust> posed_anew(3);  // poses that are exactly known now
  for (std::size_t c = 0; c < 3; ++c) posed_anew[c].cam_from_world = rig.cameras[c].cam_from_world;
  mended.trust(posed_anew);
  const std::vector<calib::PlaceView> views{
      {0, Eigen::Matrix2d::Identity()}, {1, Eigen::Matrix2d::Identity()}, {2, Eigen::Matrix2d::Identity()}};
  int compared = 0;
  for (const capture::FrameSet& set : sets) {
    const ObjectEstimate a = exact.update(set), b = unsure.update(set), c = mended.update(set);
    ASSERT_EQ(a.state, b.state);
    if (a.state != TrackState::tracking || b.views < 3) continue;
    EXPECT_TRUE(a.position == b.position);
    const Eigen::Matrix3d added = b.covariance - a.covariance;
    const Eigen::Matrix3d expected = calib::rig_covariance_at(rig, b.position, views);
    EXPECT_NEAR(added.trace() / expected.trace(), 1, 0.3);  // as far as the views are alike
    EXPECT_LT((c.covariance - a.covariance).trace(), 0.01 * added.trace());
    ++compared;
  }
  EXPECT_GT(compared, 20);
}

// When it bounces between two sets decides how far it is from where it was expected: just after a set, by the change of
// its velocity, which is more than twice its speed where it is hit.
TEST(ObjectTracker, FollowsABounce) {
  struct Bounce {
    double at_s, up_m_s;
  };
  for (const auto& [at_s, up_m_s] :
       {Bounce{13.02 / 60, 5}, Bounce{0.22, 5}, Bounce{13.5 / 60, 5}, Bounce{13.02 / 60, 7}}) {
    SCOPED_TRACE(testing::Message() << at_s << " s, then at " << up_m_s << " m/s");
    const auto path = [=](double t) {
      return Vector3d(0.3 - 0.8 * t, 0.1, 0.4 + (t < at_s ? 5 * (at_s - t) : up_m_s * (t - at_s)));
    };
    const scene::Scene scene = ring(4).ball({.path = path}).build();
    const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 26, .fps = 60});
    const Outcome o = run(scene, sets, lime(), options_with());
    EXPECT_LE(o.lock, 4u);
    for (std::size_t i = o.lock; i < o.estimates.size(); ++i) {
      EXPECT_EQ(o.estimates[i].state, TrackState::tracking) << i;
      EXPECT_LT(o.error_m[i], 0.03) << i;
    }
  }
}

// A camera that repeats a frame is inconsistent with the others, which count.
TEST(ObjectTracker, ARepeatedFrameIsNoBounce) {
  const scene::Scene scene = ring(3).ball({}).build();
  std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 80});
  for (std::size_t i = 20; i < 80; i += 7) sets[i].frames[1]->pixels = sets[i - 2].frames[1]->pixels;
  const Outcome o = run(scene, sets, lime(), options_with());
  EXPECT_LT(o.rms_m, 0.008);
  for (std::size_t i = o.lock; i < o.error_m.size(); ++i) EXPECT_LT(o.error_m[i], 0.03) << i;
}

// How large it really is, and how sure that is, whatever the configuration says.
TEST(ObjectTracker, OutlinesMeasureTheRadius) {
  for (const double true_m : {0.035, 0.055}) {
    scene::BallOptions ball;
    ball.radius_m = true_m;
    const scene::Scene scene = ring(3).ball(ball).build();
    const auto sets = scene::render(scene, {.set_count = 90});
    for (const double factor : {0.9, 1.0, 1.1}) {
      TargetOptions target = lime();
      target.radius_m = factor * true_m;
      ObjectTracker tracker(scene.rig, target, options_with());
      for (const auto& set : sets) tracker.update(set);
      const OutlineFindings found = tracker.outline_findings();
      ASSERT_TRUE(found.radius_m) << factor;
      EXPECT_GT(found.radius_sigma_m, 0.003 * true_m) << factor;
      EXPECT_LT(found.radius_sigma_m, 0.07 * true_m) << factor;
      EXPECT_NEAR(*found.radius_m, true_m, 2.5 * found.radius_sigma_m) << factor;
    }
  }
}

// A second ball of the colour is searched for after the estimate: update() decodes nothing of it, learn() does.
TEST(ObjectTracker, UpdateDecodesOnlyTheObjectsSurroundings) {
  const scene::Scene scene =
      ring(3).ball({}).ball({.name = "other", .path = [](double) { return Vector3d(0.4, -0.4, 0.6); }}).build();
  ObjectTracker tracker(scene.rig, lime(), options_with());
  capture::JpegReader reader;
  std::size_t decoded_by_learning = 0, tracked = 0;
  for (capture::FrameSet& set : scene::render(scene, {.set_count = 75})) {
    for (auto& frame : set.frames) {
      const capture::Image& picture = frame->pixels;
      const auto jpeg = capture::encode_picture(picture, {.width = picture.width, .height = picture.height}, 90);
      frame->pixels = *reader.read(reader.keep(jpeg)).image;
      ASSERT_TRUE(frame->pixels.on_demand);
    }
    const auto decoded_units = [&set] {
      std::size_t sum = 0;
      for (const auto& frame : set.frames) sum += frame->pixels.on_demand->decoded_units();
      return sum;
    };
    const bool was_tracking = tracked > 0;
    tracked = tracker.update(set).state == TrackState::tracking ? tracked + 1 : 0;
    const std::size_t by_update = decoded_units();
    tracker.learn();
    if (!was_tracking || tracked == 0) continue;
    EXPECT_LE(by_update, 48U) << set.number;  // 3 views, 4x4 units of 16x16 px around 9 px; a picture has 300
    decoded_by_learning += decoded_units() - by_update;
  }
  EXPECT_GT(tracked, 60U);
  EXPECT_GT(decoded_by_learning, 0U);
}

TEST(ObjectTracker, LearnsTheSameBeforeTheNextUpdate) {
  const scene::Scene scene = ring(3).ball({}).wall({{0.3, 0.3, 0}, {0.3, 0, 0}, {0, 0, 2}}).build();
  ObjectTracker at_once(scene.rig, lime(), options_with()), later(scene.rig, lime(), options_with());
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 60})) {
    EXPECT_EQ(bits_of(at_once.update(set)), bits_of(later.update(set)));
    at_once.learn();
  }
}

// Of two inconsistent cameras either may be wrong; but no two frames of a moving object are the same.
TEST(ObjectTracker, IgnoresARepeatedFrame) {
  const scene::Scene scene = ring(2).ball({}).build();
  std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 80});
  for (std::size_t i = 20; i < 80; i += 7) sets[i].frames[1]->pixels = sets[i - 1].frames[1]->pixels;
  const Outcome o = run(scene, sets, lime(), options_with());
  for (std::size_t i = 20; i < 80; ++i) {
    const ViewSupport &before = o.estimates[i - 1].per_view[1], &now = o.estimates[i].per_view[1];
    const bool is_shown_again = (i - 20) % 7 == 0;
    if (!is_shown_again || (now.px - before.px).norm() > 2) {
      EXPECT_EQ(now.seen, !is_shown_again) << i;
    }
    EXPECT_LT(o.error_m[i], 0.02) << i;
  }
}

// Cameras that look at different times, a ball at 2 m/s: 22 ms are 44 mm.
TEST(ObjectTracker, freeRunningCameras) {
  const scene::Scene scene =
      ring(3)
          .ball({.path =
                     [](double t) {
                       return Vector3d(0.5 * std::sin(4 * t), 0.4 * std::cos(4 * t), 1 + 0.2 * std::sin(3 * t));
                     }})
          .build();
  const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 90, .offset_s = {0, 0.011, 0.022}});
  const Outcome o = run(with_known_times(scene), sets, lime(), options_with());
  EXPECT_LE(o.lock, 4u);
  EXPECT_LT(o.rms_m, 0.010);
  EXPECT_GT(o.share_inside_95, 0.8);
  for (std::size_t i = 10; i < o.estimates.size(); ++i) {
    if (o.estimates[i].state == TrackState::tracking) {
      const Vector3d velocity =
          (scene.ball_at(0, sets[i].at + capture::duration_of(1e-3)) - scene.ball_at(0, sets[i].at)) / 1e-3;
      EXPECT_LT((o.estimates[i].velocity - velocity).norm(), 1.0) << i;
    }
  }
}

// Every other set, or two of three, has one view only: it neither confirms a find nor refutes one.
TEST(ObjectTracker, camerasOfDifferentRates) {
  const scene::Scene scene = ring(2).ball({}).build();
  for (const std::size_t every : {2u, 3u}) {
    std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 90});
    for (std::size_t i = 0; i < sets.size(); ++i) {
      if (i % every != 1) sets[i].frames[1].reset();
    }
    const Outcome o = run(scene, sets, lime(), options_with());
    EXPECT_LE(o.lock, 2 * every) << every;
    EXPECT_LT(o.rms_m, 0.012) << every;
    EXPECT_EQ(std::ranges::count(o.estimates, TrackState::lost, &ObjectEstimate::state), 0) << every;
  }
}

TEST(ObjectTracker, OneOfThreeCamerasDeliversNothing) {
  const scene::Scene scene = ring(3).ball({}).build();
  std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 80});
  for (std::size_t i = 20; i < 60; ++i) sets[i].frames[1].reset();
  const Outcome o = run(scene, sets, lime(), options_with());
  EXPECT_LT(o.rms_m, 0.008);
  for (std::size_t i = 3; i < sets.size(); ++i) {
    EXPECT_EQ(o.estimates[i].state, TrackState::tracking) << i;
    EXPECT_EQ(o.estimates[i].per_view[1].delivered, i < 20 || i >= 60) << i;
  }
}

// One view leaves the depth open: the filter may go on for a while, but must say how unsure it is, and give up.
TEST(ObjectTracker, oneViewIsNotEnoughForLong) {
  const scene::Scene scene = ring(2).ball({}).build();
  std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 120});
  for (std::size_t i = 20; i < 100; ++i) sets[i].frames[1].reset();
  const Outcome o = run(scene, sets, lime(), options_with());
  int outside = 0, positions = 0;
  for (std::size_t i = 20; i < 100; ++i) {
    if (!o.estimates[i].has_position()) continue;
    const Vector3d error = o.estimates[i].position - scene.ball_at(0, sets[i].at);
    outside += truth::nees(error, o.estimates[i].covariance) > 16.27 ? 1 : 0;  // 99.9 %
    ++positions;
  }
  EXPECT_LE(outside, positions / 5);
  EXPECT_NE(o.estimates[99].state, TrackState::tracking);
  EXPECT_EQ(o.estimates[104].state, TrackState::tracking);
}

TEST(ObjectTracker, IgnoresUnusableFrames) {
  const scene::Scene scene = ring(3).ball({}).build();
  const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 20});
  std::vector<capture::FrameSet> absent = sets, small = sets, corrupted = sets;
  const capture::WritableImage other =
      capture::make_image(capture::PixelFormat::yuyv, capture::ColorRange::limited, 160, 120);
  for (std::size_t i = 5; i < sets.size(); ++i) {
    absent[i].frames[2].reset();
    small[i].frames[2]->pixels = other.image;
    corrupted[i].frames[2]->status = capture::FrameStatus::corrupted;
  }
  const auto expected = bits_of(run(scene, absent, lime(), options_with()).estimates);
  EXPECT_EQ(bits_of(run(scene, small, lime(), options_with()).estimates), expected);
  EXPECT_EQ(bits_of(run(scene, corrupted, lime(), options_with()).estimates), expected);
  EXPECT_NE(bits_of(run(scene, sets, lime(), options_with()).estimates), expected);
}

TEST(ObjectTracker, colorsPerCamera) {
  const scene::Scene scene = ring(2).ball({}).build();
  const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 6});
  TargetOptions target = lime();
  target.color = {200, 260, 0.3, 1, 0.1, 0.95};
  EXPECT_EQ(run(scene, sets, target, options_with()).lock, 1000u);
  target.camera_colors = {{"cam0", lime().color}};
  EXPECT_EQ(run(scene, sets, target, options_with()).lock, 1000u);
  target.camera_colors.emplace_back("cam1", lime().color);
  EXPECT_LE(run(scene, sets, target, options_with()).lock, 3u);
}

class BothObservations : public testing::TestWithParam<Observation> {};
INSTANTIATE_TEST_SUITE_P(, BothObservations, testing::Values(Observation::paper, Observation::huetrack),
                         [](const auto& param) { return param.param == Observation::paper ? "paper" : "huetrack"; });

std::vector<ObjectEstimate> track(const scene::Scene& scene, const std::vector<capture::FrameSet>& sets,
                                  const TargetOptions& target, const ObjectTrackerOptions& options) {
  ObjectTracker tracker(scene.rig, target, options);
  std::vector<ObjectEstimate> out;
  for (const capture::FrameSet& set : sets) {
    out.push_back(tracker.update(set));
    expect_sound(out.back(), set, scene.rig.cameras.size());
  }
  return out;
}

TEST_P(BothObservations, sameSeedSameBytes) {
  const scene::Scene scene = ring(2).ball({}).build();
  const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 40, .dropped_frames = 0.1});
  const auto first = bits_of(track(scene, sets, lime(), options_with(5, GetParam())));
  EXPECT_EQ(bits_of(track(scene, sets, lime(), options_with(5, GetParam()))), first);
  EXPECT_NE(bits_of(track(scene, sets, lime(), options_with(6, GetParam()))), first);
}

// Each target has its own stream: another tracker beside it, before or after it, changes nothing.
TEST_P(BothObservations, targetsDoNotDisturbEachOther) {
  const scene::Scene scene = ring(3).ball({}).ball(pink_ball()).build();
  const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 40});
  const auto alone = bits_of(track(scene, sets, lime(), options_with(1, GetParam())));
  ObjectTracker pink_tracker(scene.rig, pink(), options_with(1, GetParam())),
      lime_tracker(scene.rig, lime(), options_with(1, GetParam()));
  std::vector<ObjectEstimate> beside, of_pink;
  for (const capture::FrameSet& set : sets) {
    of_pink.push_back(pink_tracker.update(set));
    beside.push_back(lime_tracker.update(set));
  }
  EXPECT_EQ(bits_of(beside), alone);
  if (GetParam() == Observation::huetrack) {
    EXPECT_LT((beside.back().position - scene.ball_at(0, sets.back().at)).norm(), 0.02);
    EXPECT_LT((of_pink.back().position - scene.ball_at(1, sets.back().at)).norm(), 0.02);
  }
}

TEST(ObjectTracker, OneCameraTracksABallByItsSize) {
  const scene::Scene scene = ring(1).ball({}).build();
  const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 120});
  const Outcome o = run(scene, sets, lime(), options_with());
  EXPECT_LE(o.lock, 30u);  // when the background around it is known
  for (std::size_t i = o.lock; i < 120; ++i) EXPECT_EQ(o.estimates[i].state, TrackState::tracking) << i;
  EXPECT_LT(o.mean_nees, 6);
  EXPECT_LT(o.rms_m, 0.08);  // 0.1 px of a radius of 4 px are 2.5 % of 3 m
}

TEST(ObjectTracker, OneCameraPublishesNothingThatLeftItsPicture) {
  const auto path = [](double t) {
    const double y = t < 2.5 ? 0.5 * std::sin(1.5 * t) : 0.5 * std::sin(3.75) - 1.5 * (t - 2.5);
    return Vector3d(0.2 * std::sin(2 * t), y, 1 + 0.2 * std::sin(t));
  };
  const scene::Scene scene = ring(1).ball({.path = path}).build();
  const calib::Camera& camera = scene.rig.cameras.front();
  ObjectTrackerOptions options = options_with();
  options.volume = {{-4, -4, 0}, {4, 4, 2}};  // reaches further than the picture
  ObjectTracker tracker(scene.rig, lime(), options);
  int tracked = 0, gone = 0;
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 120})) {
    const ObjectEstimate e = tracker.update(set);
    const auto px = camera.model.project(camera.cam_from_world * scene.ball_at(0, set.at));
    const bool is_visible = px && camera.contains(*px);
    tracked += e.state == TrackState::tracking ? 1 : 0;
    gone = is_visible ? 0 : gone + 1;
    if (gone > 2) {
      EXPECT_FALSE(e.has_position()) << set.number;
    }
  }
  EXPECT_GT(tracked, 60);
  EXPECT_GT(gone, 6);
}

TEST(ObjectTracker, OneCameraFindsNoBlob) {
  const scene::Scene scene = ring(1).ball({}).build();
  TargetOptions blob = lime();
  blob.shape = TargetShape::blob;
  for (const ObjectEstimate& e : track(scene, scene::render(scene, {.set_count = 20}), blob, options_with()))
    EXPECT_EQ(e.state, TrackState::searching);
}

TEST_P(BothObservations, setsWithoutFrames) {
  const scene::Scene scene = ring(2).ball({}).build();
  std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 60});
  for (std::size_t i = 0; i < sets.size(); ++i) {
    if (i % 3 == 0) sets[i].frames.clear();  // no slots at all
    if (i > 40) sets[i].frames.assign(2, std::nullopt);
  }
  const auto estimates = track(scene, sets, lime(), options_with(1, GetParam()));
  EXPECT_NE(estimates.back().state, TrackState::tracking);
}

TEST_P(BothObservations, oneParticle) {
  const scene::Scene scene = ring(2).ball({}).build();
  ObjectTrackerOptions options = options_with(1, GetParam());
  options.particle_count = options.max_particle_count = 1;
  for (const ObjectEstimate& e : track(scene, scene::render(scene, {.set_count = 20}), lime(), options))
    EXPECT_EQ(e.particle_count, 1);
}

TEST_P(BothObservations, particlesAreThoseOfTheEstimate) {
  const scene::Scene scene = ring(2).ball({}).build();
  ObjectTracker tracker(scene.rig, lime(), options_with(1, GetParam()));
  const std::vector<capture::FrameSet> sets = scene::render(scene, {.set_count = 70});
  for (const capture::FrameSet& set : sets) tracker.update(set);
  Vector3d mean = Vector3d::Zero();
  const auto particles = tracker.particles();
  EXPECT_EQ(particles.size(), 200u);
  for (const Eigen::Vector3f& p : particles) mean += p.cast<double>() / static_cast<double>(particles.size());
  EXPECT_LT((mean - scene.ball_at(0, sets.back().at)).norm(), 0.06);
}

TEST(ObjectTracker, fisheyeCameras) {
  scene::Scene scene = ring(3).ball({}).build();
  for (calib::Camera& camera : scene.rig.cameras)
    camera.model = calib::CameraModel(calib::FisheyeKannalaBrandt{200, 200, 159.5, 119.5, {-0.02, 0.004, -0.001, 0}});
  const Outcome o = run(scene, scene::render(scene, {.set_count = 40}), lime(), options_with());
  EXPECT_LE(o.lock, 3u);
  EXPECT_LT(o.rms_m, 0.008);
}

TEST(ObjectTracker, RejectsInvalidOptionsAndNamesAll) {
  const scene::Scene scene = ring(2).build();
  TargetOptions target = lime();
  target.radius_m = 0;
  target.camera_colors = {{"cam7", {}}};
  ObjectTrackerOptions options;
  options.particle_count = 0;
  try {
    ObjectTracker(scene.rig, target, options);
    FAIL() << "nothing thrown";
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("target lime"), HasSubstr("radius_m must be > 0"),
                                HasSubstr("particle_count must be >= 1"), HasSubstr("there is no camera 'cam7'")));
  }
  calib::CameraRig twins = scene.rig;
  twins.cameras[1].name = twins.cameras[0].name;
  EXPECT_THROW(ObjectTracker(twins, lime(), {}), std::invalid_argument);
  EXPECT_THROW(ObjectTracker(calib::CameraRig{}, lime(), {}), std::invalid_argument);
}

TEST(TargetOptions, problemsNameTheConstraint) {
  EXPECT_THAT(lime().problems(), IsEmpty());
  TargetOptions t = lime();
  t.name = "";
  EXPECT_THAT(t.problems(), ElementsAre(HasSubstr("must have a name")));
  t = lime();
  for (const double radius : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    t.radius_m = radius;
    EXPECT_THAT(t.problems(), ElementsAre(HasSubstr("radius_m"))) << radius;
  }
  t = lime();
  t.color.saturation_min = 2;
  t.camera_colors = {{"cam0", {.hue_min_deg = -5}}};
  EXPECT_THAT(t.problems(), ElementsAre(HasSubstr("color: saturation"), HasSubstr("camera_colors.cam0: hue")));
}

TEST(ObjectTrackerOptions, problemsNameTheConstraint) {
  EXPECT_THAT(ObjectTrackerOptions{}.problems(), IsEmpty());
  const auto problems_with = [](const std::function<void(ObjectTrackerOptions&)>& change) {
    ObjectTrackerOptions o;
    change(o);
    return o.problems();
  };
  EXPECT_THAT(problems_with([](auto& o) { o.volume.max.y() = o.volume.min.y(); }),
              ElementsAre(HasSubstr("volume.min must be less")));
  EXPECT_THAT(problems_with([](auto& o) { o.volume.max.x() = HUGE_VAL; }),
              ElementsAre(HasSubstr("volume.min must be less")));
  EXPECT_THAT(problems_with([](auto& o) { o.max_particle_count = 5; }), ElementsAre(HasSubstr("max_particle_count")));
  using Member = double ObjectTrackerOptions::*;
  for (const auto& [member, what] : std::vector<std::pair<Member, std::string>>{
           {&ObjectTrackerOptions::position_noise_m, "position_noise_m"},
           {&ObjectTrackerOptions::acceleration_m_s2, "acceleration_m_s2"},
           {&ObjectTrackerOptions::start_speed_m_s, "start_speed_m_s"},
           {&ObjectTrackerOptions::pixel_noise_px, "pixel_noise_px"},
           {&ObjectTrackerOptions::max_tracking_sigma_m, "max_tracking_sigma_m"},
           {&ObjectTrackerOptions::max_tracking_share_along, "max_tracking_share_along"},
           {&ObjectTrackerOptions::coast_s, "coast_s"},
           {&ObjectTrackerOptions::max_coast_sigma_m, "max_coast_sigma_m"}}) {
    for (const double bad : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
      EXPECT_THAT(problems_with([&](auto& o) { o.*member = bad; }), ElementsAre(HasSubstr(what + " must be > 0")))
          << bad;
    }
  }
}

SearchFindings findings_of(const scene::Scene& scene, const TargetOptions& target, int sets) {
  ObjectTracker tracker(scene.rig, target, options_with());
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = sets})) tracker.update(set);
  return tracker.search_findings();
}

TEST(SearchFindings, RadiusIsThatOfTheRegions) {
  const scene::Scene scene = ring(3).ball({}).build();  // of 4 cm
  TargetOptions target = lime();
  target.radius_m = 0.1;
  const SearchFindings found = findings_of(scene, target, 20);
  EXPECT_EQ(found.sets, 20u);
  EXPECT_THAT(found.sets_with_color, testing::Each(20u));
  ASSERT_TRUE(found.radius_m);
  EXPECT_NEAR(*found.radius_m, 0.04, 0.004);
  EXPECT_TRUE(found.shows_color(2));
}

TEST(SearchFindings, NoCameraShowsAnAbsentColor) {
  const SearchFindings found = findings_of(ring(2).ball(pink_ball()).build(), lime(), 12);
  EXPECT_EQ(found.sets, 12u);
  EXPECT_FALSE(found.radius_m);
  EXPECT_FALSE(found.shows_color(0) || found.shows_color(1));
}

TEST(SearchFindings, NameWhereItIsOutsideOfTheVolume) {
  ObjectTrackerOptions options = options_with();
  options.volume = {.min = {-1, -1, 0}, .max = {1, 1, 0.6}};
  const scene::Scene scene = ring(3).ball({.path = [](double t) { return Vector3d(0.1, 0.2 * t, 1.1); }}).build();
  ObjectTracker tracker(scene.rig, lime(), options);
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 20})) tracker.update(set);
  const SearchFindings found = tracker.search_findings();
  EXPECT_EQ(found.sets_in_two, 20u);
  EXPECT_EQ(found.sets_outside, 20u);
  ASSERT_TRUE(found.outside);
  EXPECT_NEAR(found.outside->radius_m, 0.04, 0.004);
  EXPECT_NEAR(found.outside->places.center().z(), 1.1, 0.02);
  EXPECT_FALSE(found.radius_m) << "of what is inside";
}

TEST(SearchFindings, OfTheRunCountWhatWasClearedToo) {
  const scene::Scene scene = ring(2).ball({}).build();
  ObjectTracker tracker(scene.rig, lime(), options_with());
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 12})) tracker.update(set);
  EXPECT_EQ(tracker.search_findings().sets, 0u);
  EXPECT_GE(tracker.search_findings_of_run().sets, 1u);
  EXPECT_EQ(tracker.search_findings_of_run().sets_in_two, tracker.search_findings_of_run().sets);
}

struct Sized {
  std::optional<double> shown_m;
  bool is_known;
  std::size_t untracked = 0;
};

// Of the lime ball that flies, whose radius is 40 mm. assumed_m: as if that were the default.
Sized sized_from(double assumed_m, bool is_assumed, TargetShape shape = TargetShape::automatic) {
  const scene::Scene scene = scene::lime_that_flies();
  TargetOptions target = lime();
  target.radius_m = assumed_m, target.is_radius_assumed = is_assumed, target.shape = shape;
  ObjectTracker tracker(scene.rig, target, options_with());
  Sized out{};
  for (const capture::FrameSet& set : scene::render(scene, {.set_count = 120})) {
    out.untracked += tracker.update(set).state == TrackState::tracking ? 0 : 1;
    tracker.learn();
  }
  out.shown_m = tracker.shown_radius_m(), out.is_known = tracker.is_radius_known();
  return out;
}

// Half of and twice the true one: nothing is found with it.
TEST(AssumedRadius, IsReplacedByWhatThePicturesShow) {
  for (const double assumed_m : {0.02, 0.03, 0.055, 0.08}) {
    const Sized sized = sized_from(assumed_m, true);
    ASSERT_TRUE(sized.shown_m) << assumed_m;
    EXPECT_NEAR(*sized.shown_m, 0.04, 0.004) << assumed_m;
    EXPECT_TRUE(sized.is_known) << assumed_m;
    EXPECT_LT(sized.untracked, 20u) << assumed_m;
  }
}

TEST(AssumedRadius, StaysWhereTheOutlinesAgree) {
  const Sized sized = sized_from(0.04, true);
  EXPECT_FALSE(sized.shown_m);
  EXPECT_TRUE(sized.is_known);
}

TEST(AssumedRadius, StaysUnknownWithoutOutlines) {
  const Sized sized = sized_from(0.04, true, TargetShape::blob);
  EXPECT_FALSE(sized.shown_m);
  EXPECT_FALSE(sized.is_known);
}

TEST(AssumedRadius, OneThatWasGivenStays) {
  const Sized sized = sized_from(0.055, false);
  EXPECT_FALSE(sized.shown_m);
  EXPECT_TRUE(sized.is_known);
}

TEST(SearchFindings, AreClearedWhenTheTargetIsFound) {
  const SearchFindings found = findings_of(ring(2).ball({}).build(), lime(), 12);
  EXPECT_EQ(found.sets, 0u);
}

}  // namespace
}  // namespace huetrack::object_trackers
