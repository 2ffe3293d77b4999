#include "camera_tracking/leds/led_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <numeric>

#include "camera_tracking/leds/led_blobs.h"
#include "camera_tracking/leds/led_filter.h"
#include "camera_tracking/leds/led_schedule.h"
#include "camera_tracking/methods/make_camera_tracker.h"
#include "drawn.h"
#include "scene/led_scene.h"

namespace huetrack::leds {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::HasSubstr;

// ---- Dots in images

class LedBlobs : public testing::TestWithParam<capture::PixelFormat> {};

TEST_P(LedBlobs, FindsCentresToSubPixels) {
  const scene::LedScene scene = scene::led_scene();
  const std::vector<Vector2d> dots{{40.3, 50.7}, {200.25, 120.5}, {300.9, 230.1}};
  const auto found = find_led_blobs(scene::led_image(scene, dots, 1, GetParam()));
  ASSERT_EQ(found.size(), 3u);
  for (const Vector2d& dot : dots) {
    double nearest = 1e9;
    for (const LedBlob& blob : found) nearest = std::min(nearest, (blob.px - dot).norm());
    EXPECT_LT(nearest, 0.06) << dot.transpose();
  }
}
INSTANTIATE_TEST_SUITE_P(Formats, LedBlobs,
                         testing::Values(capture::PixelFormat::grey, capture::PixelFormat::yuyv,
                                         capture::PixelFormat::i420, capture::PixelFormat::bgr));

TEST(LedBlobs, IgnoresDarkImagesCutDotsAndLamps) {
  const scene::LedScene scene = scene::led_scene();
  EXPECT_TRUE(find_led_blobs(scene::led_image(scene, {}, 1)).empty());
  EXPECT_TRUE(find_led_blobs(scene::led_image(scene, {{0.4, 100}}, 1)).empty());
  capture::WritableImage lamp = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 320, 240);
  for (int v = 60; v < 160; ++v)
    std::fill_n(lamp.data[0] + v * lamp.image.planes[0].stride + 100, 100, std::uint8_t{250});
  EXPECT_TRUE(find_led_blobs(lamp.image).empty());
}

// ---- The motion

LedMotionState some_state() {
  LedMotionState s;
  s.world_from_camera = scene::led_scene_pose(0.3);
  s.velocity = {0.4, -0.2, 0.1};
  s.angular_rate = {0.3, 0.8, -0.5};
  s.acceleration = {1, 2, -1};
  s.angular_acceleration = {-2, 1, 3};
  return s;
}

TEST(LedMotion, ForwardAndBackwardPredictionCancel) {
  const LedMotionState s = some_state();
  EXPECT_LT(difference(moved(moved(s, 0.02), -0.02), s).norm(), 3e-4);
  const LedTangent d = LedTangent::Constant(0.01);
  EXPECT_LT((difference(corrected(s, d), s) - d).norm(), 1e-9);
}

TEST(LedMotion, JacobianMatchesDifferences) {
  const scene::LedScene scene = scene::led_scene();
  for (const double dt : {0.0, -0.03}) {
    LedJacobian j;
    const auto px = led_pixel(scene.camera.model, some_state(), scene.leds[2], dt, &j);
    ASSERT_TRUE(px);
    for (int i = 0; i < led_dimensions; ++i) {
      const double h = 1e-5;
      const auto a =
          led_pixel(scene.camera.model, corrected(some_state(), h * LedTangent::Unit(i)), scene.leds[2], dt, nullptr);
      const auto b =
          led_pixel(scene.camera.model, corrected(some_state(), -h * LedTangent::Unit(i)), scene.leds[2], dt, nullptr);
      // Of second order in omega dt.
      EXPECT_LT((((*a - *b) / (2 * h)) - j.col(i)).norm(), 1e-4 + 0.02 * j.col(i).norm() + 0.02 * std::abs(dt))
          << i << " at " << dt;
    }
  }
}

// ---- The filter

struct Course {
  int poses = 0, first = -1, wrong = 0;  // wrong: tracking, and over 5 cm or 5 degrees off
  double rms_mm = 0, rms_deg = 0, nees = 0;
};

// Where the LEDs are seen at time t, each in the row that is exposed then.
std::vector<Vector2d> dots_at(const scene::LedScene& scene, double t_s, const std::vector<int>& lit) {
  std::vector<Vector2d> dots;
  for (const int led : lit) {
    std::vector<Vector2d> dot = scene::led_dots(scene, scene::led_scene_pose(t_s), {led});
    for (int i = 0; i < 3 && !dot.empty(); ++i) {
      const double part = dot.front().y() / (scene.camera.image_size.height - 1) - 0.5;
      const double row_s = t_s + part * scene.camera.timing.readout_s.value_or(0);
      dot = scene::led_dots(scene, scene::led_scene_pose(row_s), {led});
    }
    dots.insert(dots.end(), dot.begin(), dot.end());
  }
  return dots;
}

Course follow(
    LedFilter& filter, const scene::LedScene& scene, const std::vector<int>& schedule, int frames, int judged_from,
    const std::function<bool(int)>& covered = [](int) { return false; }) {
  Course run;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  int judged = 0;
  for (int i = 0; i < frames; ++i) {
    const calib::Rigid3d truth = scene::led_scene_pose(i / scene.fps);
    LedFrame frame{.at = scene.at(i), .number = static_cast<std::uint64_t>(i), .lit = std::nullopt, .dots = {}};
    std::vector<int> lit(scene.leds.size());
    std::iota(lit.begin(), lit.end(), 0);
    if (!schedule.empty()) {
      frame.lit = schedule[static_cast<std::size_t>(i) % schedule.size()];
      lit = {*frame.lit};
    }
    if (!covered(i)) frame.dots = dots_at(scene, i / scene.fps, lit);
    for (Vector2d& dot : frame.dots) dot += 0.1 * drawn<2>(random, normal);
    const camera_tracking::CameraEstimate e = filter.update(frame);
    EXPECT_EQ(e.has_pose(), e.world_from_camera.translation.allFinite() && e.covariance.allFinite());
    if (!e.has_pose()) continue;
    if (run.first < 0) run.first = i;
    ++run.poses;
    Eigen::Matrix<double, 6, 1> off;
    off.head<3>() = truth.translation - e.world_from_camera.translation;
    off.tail<3>() =
        calib::log(calib::Rigid3d{truth.rotation * e.world_from_camera.rotation.conjugate(), Vector3d::Zero()})
            .head<3>();
    run.wrong += e.state == camera_tracking::PoseState::tracking &&
                 (off.head<3>().norm() > 0.05 || off.tail<3>().norm() > 0.087);
    if (i < judged_from) continue;
    ++judged;
    run.rms_mm += 1e6 * off.head<3>().squaredNorm();
    run.rms_deg += std::pow(off.tail<3>().norm() * 180 / std::numbers::pi, 2);
    run.nees += off.dot(e.covariance.llt().solve(off));
  }
  if (judged > 0) {
    run.rms_mm = std::sqrt(run.rms_mm / judged);
    run.rms_deg = std::sqrt(run.rms_deg / judged);
    run.nees /= judged;
  }
  return run;
}

LedFilterOptions options_for(const scene::LedScene& scene) {
  LedFilterOptions options;
  options.start.leds = scene.leds;
  options.start.room_min = {-1.5, -1.5, 0};
  options.start.room_max = {1.5, 1.5, 2};
  options.particle_count = 1000;
  return options;
}
const std::vector<int> in_turn{0, 1, 2, 3, 4, 5, 6, 7};

TEST(LedFilter, TracksFromOneLedPerFrame) {
  const scene::LedScene scene = scene::led_scene();
  const auto filter = LedFilter::huetrack(scene.camera, options_for(scene));
  const Course run = follow(*filter, scene, in_turn, 140, 24);
  EXPECT_GE(run.first, 7);
  EXPECT_LE(run.first, 16);
  EXPECT_LT(run.rms_mm, 3);
  EXPECT_LT(run.rms_deg, 0.25);
  EXPECT_EQ(run.wrong, 0);
  EXPECT_GT(run.nees, 0.5);  // 6 is perfect
  EXPECT_LT(run.nees, 15);
}

TEST(LedFilter, TracksFromUnidentifiedLeds) {
  const scene::LedScene scene = scene::led_scene();
  const auto filter = LedFilter::huetrack(scene.camera, options_for(scene));
  const Course run = follow(*filter, scene, {}, 60, 20);
  EXPECT_GE(run.first, 0);
  EXPECT_LE(run.first, 12);
  EXPECT_LT(run.rms_mm, 2);
  EXPECT_EQ(run.wrong, 0);
}

TEST(LedFilter, UsesTheTimeOfEachRow) {
  scene::LedScene scene = scene::led_scene();
  scene.fps = 30;
  const auto ignorant = LedFilter::huetrack(scene.camera, options_for(scene));
  scene.camera.timing.readout_s = 0.03;
  const auto knowing = LedFilter::huetrack(scene.camera, options_for(scene));
  const Course misled = follow(*ignorant, scene, {}, 60, 12), run = follow(*knowing, scene, {}, 60, 12);
  EXPECT_GE(run.poses, 45);
  EXPECT_LT(run.rms_mm, 1.5);
  EXPECT_LT(run.nees, 15);
  EXPECT_GT(misled.rms_mm, 2 * run.rms_mm);
}

TEST(LedFilter, NeedsFourLeds) {
  const scene::LedScene scene = scene::led_scene();
  const Course four = follow(*LedFilter::huetrack(scene.camera, options_for(scene)), scene, {0, 2, 4, 6}, 140, 40);
  EXPECT_GT(four.poses, 90);
  EXPECT_EQ(four.wrong, 0);
  EXPECT_LT(four.rms_mm, 6);
  EXPECT_EQ(follow(*LedFilter::huetrack(scene.camera, options_for(scene)), scene, {0, 2, 4}, 100, 0).poses, 0);
}

TEST(LedFilter, CoastsIsLostAndRecovers) {
  const scene::LedScene scene = scene::led_scene();
  const auto filter = LedFilter::huetrack(scene.camera, options_for(scene));
  const Course run = follow(*filter, scene, in_turn, 300, 0, [](int i) { return i >= 60 && i < 180; });
  EXPECT_EQ(run.wrong, 0);
  EXPECT_GT(run.poses, 140);
  EXPECT_LT(run.poses, 250);  // 120 frames are covered, 1.3 s
}

TEST(LedFilter, PaperFilterGivesNoFalsePose) {
  const scene::LedScene scene = scene::led_scene();
  LedFilterOptions options = options_for(scene);
  options.start.room_min = {0.4, -0.4, 0.3};
  options.start.room_max = {1.1, 0.4, 1.0};
  options.particle_count = 4000;
  options.pixel_noise_px = 1;
  const Course run = follow(*LedFilter::paper(scene.camera, options), scene, in_turn, 250, 200);
  EXPECT_EQ(run.wrong, 0);
}

TEST(LedFilter, PaperFilterTracksFromUnidentifiedLeds) {
  const scene::LedScene scene = scene::led_scene();
  for (const std::uint64_t seed : {1, 2}) {
    LedFilterOptions options = options_for(scene);
    options.particle_count = 2000;
    options.seed = seed;
    // Covered from frame 40 on for half a second: lost, and found again from the whole room.
    const Course run =
        follow(*LedFilter::paper(scene.camera, options), scene, {}, 130, 20, [](int i) { return i >= 40 && i < 85; });
    EXPECT_GE(run.first, 0) << seed;
    EXPECT_LE(run.first, 25) << seed;
    EXPECT_GT(run.poses, 50) << seed;
    EXPECT_EQ(run.wrong, 0) << seed;
  }
}

TEST(LedFilter, SameSeedSameBits) {
  const scene::LedScene scene = scene::led_scene();
  const auto bits = [&](std::uint64_t seed) {
    LedFilterOptions options = options_for(scene);
    options.seed = seed;
    const auto filter = LedFilter::huetrack(scene.camera, options);
    Vector3d last(0, 0, 0);
    for (int i = 0; i < 30; ++i) {
      const camera_tracking::CameraEstimate e =
          filter->update({.at = scene.at(i),
                          .number = static_cast<std::uint64_t>(i),
                          .lit = i % 8,
                          .dots = scene::led_dots(scene, scene::led_scene_pose(i / scene.fps), {i % 8})});
      if (e.has_pose()) last = e.world_from_camera.translation;
    }
    return last;
  };
  EXPECT_NE(bits(1), Vector3d(0, 0, 0));
  EXPECT_EQ(bits(1), bits(1));
}

// ---- The tracker: images in

TEST(LedTracker, TracksInImagesWithASchedule) {
  const scene::LedScene scene = scene::led_scene();
  camera_tracking::CameraTrackerOptions options;
  camera_tracking::LedStart start{.leds = scene.leds, .schedule = in_turn};
  start.room_min = {-1.5, -1.5, 0};
  start.room_max = {1.5, 1.5, 2};
  options.start = start;
  options.particle_count = 1000;
  const auto tracker = camera_methods::make_camera_tracker(scene.camera, options);
  int poses = 0;
  for (int i = 0; i < 40; ++i) {
    if (i % 11 == 5) continue;  // a dropped frame: the schedule goes by the driver's numbers
    const calib::Rigid3d truth = scene::led_scene_pose(i / scene.fps);
    const capture::Frame frame{
        .camera = 0,
        .sequence = static_cast<std::uint32_t>(i),
        .captured_at = scene.at(i),
        .pixels = scene::led_image(scene, scene::led_dots(scene, truth, {i % 8}), static_cast<std::uint64_t>(i))};
    const camera_tracking::CameraEstimate e = tracker->update(frame);
    if (!e.has_pose()) continue;
    ++poses;
    EXPECT_LT((e.world_from_camera.translation - truth.translation).norm(), 0.02) << i;
  }
  EXPECT_GT(poses, 15);
  EXPECT_FALSE(tracker->inside().features.empty());
  EXPECT_FALSE(tracker->inside().particles.empty());
  EXPECT_THROW(tracker->save_map("map"), std::runtime_error);

  start.slot_s = 0.5;
  capture::Frame frame;
  frame.captured_at = capture::Timestamp(capture::duration_of(4.6));
  EXPECT_EQ(lit_led(start, moment_of(frame)), 1);  // slot 9 of 8
  start.schedule.clear();
  EXPECT_EQ(lit_led(start, moment_of(frame)), std::nullopt);
}

struct Film {
  std::vector<int> lit;  // of frame i: lit[i % size], -1: none
  int frames = 90, every = 1;
  capture::Duration late{0};  // all capture times
};
struct Outcome {
  int first = -1, poses = 0, wrong = 0, most_in_view = 0;
  std::string why;  // after the last frame
};

Outcome play(const camera_tracking::LedStart& start, const Film& film,
             camera_tracking::CameraMethod method = camera_tracking::CameraMethod::huetrack) {
  const scene::LedScene scene = scene::led_scene();
  camera_tracking::CameraTrackerOptions options;
  options.method = method;
  options.start = start;
  options.particle_count = 1000;
  const auto tracker = camera_methods::make_camera_tracker(scene.camera, options);
  Outcome out;
  for (int i = 0; i < film.frames; i += film.every) {
    const calib::Rigid3d truth = scene::led_scene_pose(i / scene.fps);
    std::vector<int> lit;
    if (const int led = film.lit[static_cast<std::size_t>(i) % film.lit.size()]; led >= 0) lit.push_back(led);
    const capture::Frame frame{
        .camera = 0,
        .sequence = static_cast<std::uint32_t>(i / film.every),
        .captured_at = scene.at(i) + film.late,
        .pixels = scene::led_image(scene, scene::led_dots(scene, truth, lit), static_cast<std::uint64_t>(i)),
        .stream_index = i};
    const camera_tracking::CameraEstimate e = tracker->update(frame);
    if (!e.has_pose()) continue;
    if (out.first < 0) out.first = i;
    ++out.poses;
    out.most_in_view = std::max(out.most_in_view, e.features_in_view);
    out.wrong += (e.world_from_camera.translation - truth.translation).norm() > 0.05;
  }
  out.why = tracker->why_no_pose();
  return out;
}

camera_tracking::LedStart start_for(const std::vector<int>& schedule) {
  camera_tracking::LedStart start{.leds = scene::led_scene().leds, .schedule = schedule};
  start.room_min = {-1.5, -1.5, 0};
  start.room_max = {1.5, 1.5, 2};
  return start;
}

TEST(LedTracker, ScheduleCountsFramesOfTheStream) {
  const Outcome third = play(start_for(in_turn), {.lit = in_turn, .frames = 120, .every = 3});
  EXPECT_GE(third.first, 0);
  EXPECT_GT(third.poses, 15);
  EXPECT_EQ(third.wrong, 0);
  EXPECT_EQ(third.most_in_view, 8) << "LEDs are counted, not sightings";
}

TEST(LedTracker, EstimatesTheScheduleOffset) {
  for (const int off : {1, 4}) {  // by 4 a wrong pose fits to some pixels
    std::vector<int> lit = in_turn;
    std::rotate(lit.begin(), lit.begin() + off, lit.end());
    const Outcome run = play(start_for(in_turn), {.lit = lit});
    EXPECT_GE(run.first, 0);
    EXPECT_GT(run.poses, 30);
    EXPECT_EQ(run.wrong, 0);
    EXPECT_EQ(run.why, "");
  }
}

TEST(LedTracker, ScheduleByTimeMayBeginWithinASlot) {
  camera_tracking::LedStart start = start_for(in_turn);
  for (const double slot_s : {0.011111111, 0.0111111112})  // of frames every 1/90 s
    for (const int late_ms : {0, 10, 37}) {
      start.slot_s = slot_s;
      const Outcome run = play(start, {.lit = in_turn, .late = std::chrono::milliseconds(late_ms)});
      EXPECT_GE(run.first, 0) << slot_s << ' ' << late_ms;
      EXPECT_GT(run.poses, 30) << slot_s << ' ' << late_ms;
      EXPECT_EQ(run.wrong, 0) << slot_s << ' ' << late_ms;
    }
}

TEST(LedTracker, ExplainsWhyThereIsNoPose) {
  const Outcome reversed = play(start_for(in_turn), {.lit = {7, 6, 5, 4, 3, 2, 1, 0}});
  EXPECT_EQ(reversed.poses, 0);
  EXPECT_THAT(reversed.why, HasSubstr("no pose explains them: check led_schedule"));
  EXPECT_THAT(play(start_for(in_turn), {.lit = {-1}, .frames = 20}).why, HasSubstr("no LED was seen in the last 2 s"));
  EXPECT_THAT(play(start_for(in_turn), {.lit = {0, 1, 2, -1, -1, -1, -1, -1}, .frames = 40}).why,
              HasSubstr("only 3 different LEDs were seen"));
  EXPECT_THAT(play(start_for({}), {.lit = {0}, .frames = 5}).why, HasSubstr("only 1 bright dot is seen at once"));
}

TEST(LedTracker, RejectsFourUnidentifiedLeds) {
  camera_tracking::LedStart start = start_for({});
  start.leds.resize(4);
  camera_tracking::CameraTrackerOptions options;
  options.start = start;
  EXPECT_THAT(options.problems(), testing::Contains(HasSubstr("give led_schedule, or a fifth LED")));
}

TEST(LedTracker, RejectsThreeLeds) {
  camera_tracking::CameraTrackerOptions options;
  options.start = camera_tracking::LedStart{.leds = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, .schedule = {}};
  try {
    camera_methods::make_camera_tracker(scene::led_scene().camera, options);
    FAIL() << "three LEDs were accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("at least 4 LEDs are needed, not 3"));
  }
}

}  // namespace
}  // namespace huetrack::leds
