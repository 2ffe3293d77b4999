// Mistakes made in a rendered scene: each is named, and nothing else.
#include "view_watch/view_watch.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "capture/frames/picture_layout.h"
#include "scene/lime.h"
#include "view_watch/camera_fit.h"

namespace huetrack::view_watch {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr double rad = std::numbers::pi / 180;

class ViewWatchOfScene : public testing::Test {
 protected:
  void SetUp() override {
    scene = scene::lime_that_flies();
    rig = scene.rig;
  }
  // The mistakes named at the end.
  std::vector<Mistake> watch(double seconds = 4, double pixel_noise_stddev = 3) {
    auto sets = scene::render(
        scene,
        {.set_count = int(30 * seconds), .format = format, .pixel_noise_stddev = pixel_noise_stddev, .seed = seed});
    if (spoil) spoil(sets);
    object_trackers::ObjectTracker tracker(rig, target, {});
    ViewWatch out(rig, target);
    for (const auto& set : sets) {
      const auto estimate = tracker.update(set);
      out.look(estimate, tracker, set.at);
      if (!out.late_s().empty()) {
        tracker.correct_times(out.late_s());
        ++corrections;
      }
      last = estimate;
      if (!out.mistakes().empty() && !named_at_s) named_at_s = capture::seconds(set.at - sets.front().at);
      for (const Mistake& mistake : out.mistakes()) ever.push_back(mistake);
    }
    return out.mistakes();
  }
  void turn(std::size_t camera, double degrees, const Vector3d& axis) {
    scene::turn(rig.cameras[camera], degrees * rad, axis);
  }
  scene::Scene scene;
  calib::CameraRig rig;
  object_tracking::TargetOptions target = scene::lime();
  std::function<void(std::vector<capture::FrameSet>&)> spoil;
  std::uint64_t seed = 1;
  capture::PixelFormat format = scene::RenderOptions{}.format;
  std::optional<double> named_at_s;
  std::vector<Mistake> ever;  // after each set
  int corrections = 0;
  object_tracking::ObjectEstimate last;
};

TEST_F(ViewWatchOfScene, nothingIsWrong) {
  for (seed = 1; seed <= 3; ++seed) EXPECT_THAT(watch(), IsEmpty()) << seed;
  EXPECT_FALSE(named_at_s);
}

TEST_F(ViewWatchOfScene, nothingIsNamedOfAnObjectAtRest) {
  scene.balls[0].path = [](double) { return Vector3d(0.2, 0.1, 1); };
  turn(1, 2, {1, 1, 0});
  EXPECT_THAT(watch(), IsEmpty());
}

TEST_F(ViewWatchOfScene, swappedVideos) {
  spoil = [](std::vector<capture::FrameSet>& sets) {
    for (auto& set : sets) std::swap(set.frames[0]->pixels, set.frames[2]->pixels);
  };
  const auto mistakes = watch();
  ASSERT_EQ(mistakes.size(), 1u);
  EXPECT_EQ(mistakes[0].kind, MistakeKind::swapped);
  EXPECT_THAT(mistakes[0].cameras, ElementsAre(0, 2));
  EXPECT_GT(mistakes[0].off_px, 5);
  EXPECT_LT(named_at_s.value_or(99), 3);
}

// As videos without stamps are: the times are wrong, too.
TEST_F(ViewWatchOfScene, swappedVideosThatDidNotBeginTogether) {
  spoil = [](std::vector<capture::FrameSet>& sets) {
    const auto before = sets;
    for (std::size_t i = 0; i < sets.size(); ++i)
      for (const std::size_t c : {0u, 1u, 2u})
        sets[i].frames[c]->pixels = before[i < c ? 0 : i - c].frames[c == 1 ? 1 : 2 - c]->pixels;
  };
  watch(8);
  ASSERT_FALSE(ever.empty());
  for (const Mistake& mistake : ever) {
    EXPECT_EQ(mistake.kind, MistakeKind::swapped);
    EXPECT_THAT(mistake.cameras, ElementsAre(0, 2));
  }
}

TEST_F(ViewWatchOfScene, aTurnedCamera) {
  for (const double degrees : {0.6, 2.0, 5.0}) {
    SetUp();
    turn(1, degrees, {1, -0.6, 0.3});
    const auto mistakes = watch();
    ASSERT_EQ(mistakes.size(), 1u) << degrees;
    EXPECT_EQ(mistakes[0].kind, MistakeKind::turned);
    EXPECT_THAT(mistakes[0].cameras, ElementsAre(1));
    EXPECT_NEAR(mistakes[0].size / rad, degrees, 0.15 + 0.1 * degrees);
    EXPECT_LT(named_at_s.value_or(99), 3.1);
  }
}

TEST_F(ViewWatchOfScene, anotherFocalLength) {
  for (const double factor : {1.1, 0.88}) {
    SetUp();
    const calib::CameraModel& model = rig.cameras[1].model;
    rig.cameras[1].model =
        calib::CameraModel(calib::PinholeRadtan{factor * model.fx(), factor * model.fy(), model.cx(), model.cy()});
    const auto mistakes = watch();
    ASSERT_EQ(mistakes.size(), 1u) << factor;
    EXPECT_EQ(mistakes[0].kind, MistakeKind::zoomed);
    EXPECT_THAT(mistakes[0].cameras, ElementsAre(1));
    EXPECT_NEAR(mistakes[0].size, 1 / factor, 0.02);
    for (const Mistake& mistake : ever) EXPECT_TRUE(mistake.kind == MistakeKind::zoomed || mistake.zoom != 1) << factor;
  }
}

TEST_F(ViewWatchOfScene, mirroredAndTurnedPictures) {
  for (const bool is_turned : {false, true}) {
    SetUp();
    format = capture::PixelFormat::i444;
    spoil = [is_turned](std::vector<capture::FrameSet>& sets) {
      for (auto& set : sets) {
        capture::Image& seen = set.frames[2]->pixels;
        seen = capture::turned(seen, {.column_by_column = -1, .row_by_row = is_turned ? -1 : 1});
      }
    };
    const auto mistakes = watch();
    ASSERT_EQ(mistakes.size(), 1u);
    EXPECT_EQ(mistakes[0].kind, is_turned ? MistakeKind::upside_down : MistakeKind::mirrored);
    EXPECT_THAT(mistakes[0].cameras, ElementsAre(2));
  }
}

TEST_F(ViewWatchOfScene, AllPicturesUpsideDown) {
  format = capture::PixelFormat::i444;
  spoil = [](std::vector<capture::FrameSet>& sets) {
    for (auto& set : sets)
      for (auto& frame : set.frames)
        frame->pixels = capture::turned(frame->pixels, {.column_by_column = -1, .row_by_row = -1});
  };
  const auto mistakes = watch();
  ASSERT_EQ(mistakes.size(), 1u);
  EXPECT_EQ(mistakes[0].kind, MistakeKind::upside_down);
  EXPECT_THAT(mistakes[0].cameras, testing::IsEmpty());
}

TEST_F(ViewWatchOfScene, anEstimatedLatencyIsNamed) {
  spoil = [](std::vector<capture::FrameSet>& sets) {
    constexpr std::size_t frames = 3;
    for (std::size_t i = sets.size(); i-- > 0;)
      sets[i].frames[0]->pixels = sets[i < frames ? 0 : i - frames].frames[0]->pixels;
  };
  const auto mistakes = watch(12);
  ASSERT_EQ(mistakes.size(), 1u);
  EXPECT_EQ(mistakes[0].kind, MistakeKind::late);
  EXPECT_THAT(mistakes[0].cameras, ElementsAre(0));
  EXPECT_NEAR(mistakes[0].size, 0.1, 0.025);
}

// Two cameras, and a ball that strolls: late frames are a few pixels off, which a turn would explain as well.
TEST_F(ViewWatchOfScene, ALateCameraOfTwoIsNotNamedAsTurned) {
  for (const double speed : {0.6, 1.0, 1.6}) {
    SetUp();
    scene.rig.cameras.resize(2);
    rig = scene.rig;
    scene.balls[0].path = [speed](double t) {
      return Vector3d(0.4 * std::sin(speed * t), 0.4 * std::cos(0.8 * speed * t), 1 + 0.2 * std::sin(1.3 * speed * t));
    };
    spoil = [](std::vector<capture::FrameSet>& sets) {
      constexpr std::size_t frames = 8;
      for (std::size_t i = sets.size(); i-- > 0;)
        sets[i].frames[1]->pixels = sets[i < frames ? 0 : i - frames].frames[1]->pixels;
    };
    watch(12);
    for (const Mistake& mistake : ever)
      EXPECT_TRUE(mistake.kind == MistakeKind::late || mistake.kind == MistakeKind::uneven_times)
          << speed << " " << name(mistake.kind) << " " << mistake.size;
  }
}

TEST_F(ViewWatchOfScene, OfTwoCamerasBothMayBeMirrored) {
  scene.rig.cameras.resize(2);
  rig = scene.rig;
  format = capture::PixelFormat::i444;
  spoil = [](std::vector<capture::FrameSet>& sets) {
    for (auto& set : sets)
      set.frames[1]->pixels = capture::turned(set.frames[1]->pixels, {.column_by_column = -1, .row_by_row = 1});
  };
  watch(6);
  const auto mirrored = std::ranges::find(ever, MistakeKind::mirrored, &Mistake::kind);
  ASSERT_NE(mirrored, ever.end());
  for (const Mistake& mistake : ever) {
    if (mistake.kind != MistakeKind::mirrored) continue;
    EXPECT_THAT(mistake.cameras, testing::Contains(1));
  }
}

// Before the right camera is certain no other one is named: a larger turn of another camera explains a ball that moves
// little, too, but worse.
TEST_F(ViewWatchOfScene, noOtherCameraIsBlamed) {
  for (const double reach_m : {0.1, 0.2}) {
    for (const Vector3d& axis : {Vector3d(1, -0.6, 0.3), Vector3d(0.3, 1, 0.2)}) {
      SetUp();
      scene.balls[0].path = [reach_m](double t) {
        return Vector3d(0.2 + reach_m * std::sin(2.1 * t), reach_m * std::cos(1.7 * t), 1 + 0.1 * std::sin(2.9 * t));
      };
      turn(1, 1, axis);
      watch();
      for (const Mistake& mistake : ever) {
        EXPECT_EQ(mistake.kind, MistakeKind::turned) << reach_m;
        EXPECT_THAT(mistake.cameras, ElementsAre(1)) << reach_m;
      }
    }
  }
}

// Two frames late, or six. The rig states the latencies, so the tracker does not estimate them.
TEST_F(ViewWatchOfScene, aLateCamera) {
  for (const std::size_t frames : {2u, 6u}) {
    SetUp();
    spoil = [frames](std::vector<capture::FrameSet>& sets) {
      for (std::size_t i = sets.size(); i-- > 0;)
        sets[i].frames[2]->pixels = sets[i < frames ? 0 : i - frames].frames[2]->pixels;
    };
    for (auto& camera : rig.cameras)
      camera.timing = {.latency_s = 0, .latency_sigma_s = 0.0005, .readout_s = 0, .readout_sigma_s = 0.0005};
    const auto mistakes = watch();
    ASSERT_EQ(mistakes.size(), 1u) << frames;
    EXPECT_EQ(mistakes[0].kind, MistakeKind::late);
    EXPECT_THAT(mistakes[0].cameras, ElementsAre(2));
    EXPECT_NEAR(mistakes[0].size, double(frames) / 30, 0.02);
  }
}

// Videos of one rate that did not begin together: by their stamps they are triggered, and no two are consistent. The
// correction makes the tracker estimate latencies again.
TEST_F(ViewWatchOfScene, videosThatDidNotBeginTogether) {
  spoil = [](std::vector<capture::FrameSet>& sets) {
    for (std::size_t i = sets.size(); i-- > 0;)
      for (const std::size_t c : {1u, 2u}) sets[i].frames[c]->pixels = sets[i < c ? 0 : i - c].frames[c]->pixels;
  };
  EXPECT_THAT(watch(12), IsEmpty());  // drivers cause as much
  EXPECT_GE(corrections, 1);
  ASSERT_EQ(last.times.size(), 3u);
  EXPECT_NEAR(last.times[1].latency_s - last.times[0].latency_s, 1 / 30., 0.004);
  EXPECT_NEAR(last.times[2].latency_s - last.times[0].latency_s, 2 / 30., 0.004);
  EXPECT_EQ(last.state, object_tracking::TrackState::tracking);
}

// Frames that are dropped and not counted: all later frames are newer than their stamps.
TEST_F(ViewWatchOfScene, stampsThatJump) {
  spoil = [](std::vector<capture::FrameSet>& sets) {
    const auto before = sets;
    for (std::size_t i = 0; i < sets.size(); ++i)
      for (const std::size_t c : {1u, 2u})
        sets[i].frames[c]->pixels = before[std::min(i + (i + 45 * c) / 90, sets.size() - 1)].frames[c]->pixels;
  };
  watch(12);
  EXPECT_GE(corrections, 1);
  EXPECT_TRUE(std::ranges::any_of(ever, [](const Mistake& m) { return m.kind == MistakeKind::uneven_times; }));
}

TEST_F(ViewWatchOfScene, anotherRoom) {
  turn(0, 25, {0.2, 1, 0});
  turn(1, 20, {1, 0.3, 0.5});
  turn(2, 28, {-0.5, 0.4, 1});
  const auto mistakes = watch();
  ASSERT_EQ(mistakes.size(), 1u);
  EXPECT_EQ(mistakes[0].kind, MistakeKind::other_rig);
}

// Two cameras are shifted and turned: no turn of one of them explains it.
TEST_F(ViewWatchOfScene, aRigWithSeveralErrors) {
  rig.cameras[1].cam_from_world.translation += Vector3d(0.04, -0.02, 0.02);
  rig.cameras[2].cam_from_world.translation += Vector3d(-0.02, 0.04, -0.02);
  turn(1, 0.4, {1, 0.3, 0.5});
  turn(2, 0.4, {-0.5, 1, 1});
  const auto mistakes = watch(6);
  ASSERT_EQ(mistakes.size(), 1u);
  EXPECT_EQ(mistakes[0].kind, MistakeKind::contradiction);
  EXPECT_GT(mistakes[0].off_px, 3);
}

// A wrong radius shows in all views alike: what they differ by, hands may add in all of them.
TEST(ViewWatch, OutlinesThatDifferDoNotContradictTheRadius) {
  const auto outlines = [](double least_m, double largest_m) {
    return object_tracking::OutlineFindings{
        .radius_m = std::sqrt(least_m * largest_m), .least_radius_m = least_m, .largest_radius_m = largest_m};
  };
  EXPECT_TRUE(outlines(0.050, 0.051).contradict(0.04));
  EXPECT_TRUE(outlines(0.050, 0.050).contradict(0.04)) << "one view";
  EXPECT_TRUE(outlines(0.032, 0.033).contradict(0.04));
  EXPECT_FALSE(outlines(0.041, 0.043).contradict(0.04));
  EXPECT_FALSE(outlines(0.046, 0.050).contradict(0.04)) << "hands";
  EXPECT_FALSE(outlines(0.040, 0.050).contradict(0.04)) << "one view is right";
  EXPECT_FALSE(outlines(0.028, 0.034).contradict(0.04));
}

// Where twice the radius was given, as a diameter, what is measured lies between that and the true one.
TEST(ViewWatch, TheRangeOfRadiiReachesAwayFromTheGivenOne) {
  const object_tracking::OutlineFindings outlines{.radius_m = 0.067, .least_radius_m = 0.064, .largest_radius_m = 0.07};
  EXPECT_LT(radius_range(outlines, 0.094).first, 0.047);
  EXPECT_NEAR(radius_range(outlines, 0.094).second, 0.079, 0.001);
  EXPECT_NEAR(radius_range(outlines, 0.067).first, 0.0566, 0.001) << "nothing drew it";
  EXPECT_GT(radius_range(outlines, 0.033).second, 0.15);
}

// By outlines, whatever the configured radius.
TEST_F(ViewWatchOfScene, aWrongRadius) {
  for (const double factor : {0.7, 0.8, 1.25, 1.45}) {
    named_at_s.reset();
    target.radius_m = 0.04 * factor;
    const auto mistakes = watch();
    ASSERT_EQ(mistakes.size(), 1u) << factor;
    EXPECT_EQ(mistakes[0].kind, MistakeKind::radius) << factor;
    EXPECT_THAT(0.04, testing::AllOf(testing::Gt(mistakes[0].range_m.first), testing::Lt(mistakes[0].range_m.second)))
        << factor;
    EXPECT_NEAR(mistakes[0].size, 0.04, 0.0024) << factor;
    EXPECT_LT(named_at_s.value_or(99), 3) << factor;
  }
}

TEST_F(ViewWatchOfScene, aSmallErrorOfTheRadius) {
  for (const double factor : {0.95, 1.07}) {
    target.radius_m = 0.04 * factor;
    EXPECT_THAT(watch(), IsEmpty()) << factor;
  }
}

// Without outlines, by regions.
TEST_F(ViewWatchOfScene, aWrongRadiusOfABlob) {
  target.shape = object_tracking::TargetShape::blob;
  target.radius_m = 0.04 * 1.45;
  const auto mistakes = watch();
  ASSERT_EQ(mistakes.size(), 1u);
  EXPECT_EQ(mistakes[0].kind, MistakeKind::radius);
  EXPECT_THAT(0.04, testing::AllOf(testing::Gt(mistakes[0].range_m.first), testing::Lt(mistakes[0].range_m.second)));
  EXPECT_NEAR(mistakes[0].size, 0.04, 0.004);
}

// Shade shifts a ball that hardly moves by a pixel and a half in one camera: a turn would explain it, but one place is
// not significant.
TEST(PairComparison, OnePlaceIsNotEnoughForATurn) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).build();
  std::vector<Track> tracks(3);
  for (int k = 0; k < 48; ++k) {
    const double t = k / 16.0;
    const Vector3d p(0.1 + 0.02 * t, 0.2 + 0.01 * t, 1.2);
    for (std::size_t c = 0; c < 3; ++c) {
      const Eigen::Vector2d px = scene.rig.cameras[c].project_world(p)->px - Eigen::Vector2d(0, c == 0 ? 1.5 : 0.0);
      tracks[c].push_back({t, px, 5.5, 0.41, 0.0, scene.rig.cameras[c].model.ray({px})->normalized()});
    }
  }
  const PairComparison comparison(scene.rig);
  const TimeSigmas times(3, 0.0);
  EXPECT_GT(comparison.agreement(tracks, {}, times).worst, 1.4) << "they are inconsistent";
  const auto found = best_turn(comparison, tracks, 0, times);
  ASSERT_TRUE(found);
  EXPECT_LT(found->turn_rad.norm() / rad, 1);
  EXPECT_LT(found->gain, 16.3);
}

// Of an object that moves through the room. zoom: focal length of the second camera over the rig's.
std::vector<Track> tracks_of(const scene::Scene& scene, double zoom = 1) {
  std::vector<Track> tracks(scene.rig.cameras.size());
  for (int k = 0; k < 60; ++k) {
    const double t = k / 30.0;
    const Vector3d p(0.6 * std::sin(3 * t), 0.5 * std::cos(2.3 * t), 1 + 0.4 * std::sin(4 * t));
    for (std::size_t c = 0; c < tracks.size(); ++c) {
      const auto px = scene.rig.cameras[c].project_world(p)->px;
      Vector3d ray = *scene.rig.cameras[c].model.ray({px});
      if (c == 1) ray.z() /= zoom;
      tracks[c].push_back({t, px, 4.0, 0.35, 0.0, ray.normalized()});
    }
  }
  return tracks;
}

TEST(PairComparison, aTurnIsFoundExactly) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).build();
  const std::vector<Track> tracks = tracks_of(scene);
  const PairComparison right(scene.rig);
  const TimeSigmas times(3, 0.0);
  EXPECT_LT(right.agreement(tracks, {}, times).worst, 1e-3);
  calib::CameraRig rig = scene.rig;
  const Vector3d turn(0.02, -0.01, 0.03);
  calib::Tangent6d tangent = calib::Tangent6d::Zero();
  tangent.head<3>() = -turn;
  rig.cameras[2].cam_from_world = calib::exp(tangent) * rig.cameras[2].cam_from_world;
  const PairComparison wrong(rig);
  EXPECT_GT(wrong.agreement(tracks, {}, times).worst, 3);
  const auto found = best_turn(wrong, tracks, 2, times);
  ASSERT_TRUE(found);
  EXPECT_LT((found->turn_rad - turn).norm(), 1e-3);
  EXPECT_GT(found->gain, 50);
  EXPECT_EQ(wrong.agreement_of(tracks, 2, false, {}, times).pairs, 1u);
  EXPECT_LT(wrong.agreement_of(tracks, 2, false, {}, times).worst, 1e-3);
}

// Large errors, and one that any rig may have.
TEST(PairComparison, aFocalLengthIsFoundExactly) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).build();
  const TimeSigmas times(3, 0.0);
  for (const double zoom : {0.8, 0.98, 1.3}) {
    const BestZoom found = best_zoom(PairComparison(scene.rig), tracks_of(scene, zoom), 1, times);
    EXPECT_NEAR(found.zoom, zoom, 1e-3);
    EXPECT_GT(found.gain, 0);
  }
}

}  // namespace
}  // namespace huetrack::view_watch
