#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <random>
#include <thread>

#include "pipeline/pipeline_to.h"
#include "scene/scene.h"

namespace huetrack::pipeline {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

calib::CameraRig rig_of(int cameras) {
  calib::CameraRig rig;
  for (int i = 0; i < cameras; ++i) {
    calib::Camera camera;
    camera.name = std::string(1, char('a' + i));
    camera.image_size = {32, 24};
    camera.model = calib::CameraModel(calib::PinholeRadtan{.fx = 30, .fy = 30, .cx = 15.5, .cy = 11.5});
    camera.cam_from_world.translation = {0.1 * i, 0, 2};
    rig.cameras.push_back(camera);
  }
  return rig;
}

// Grey frames, 10 ms apart, of some cameras; endless when count is 0.
class GreySource final : public capture::FrameSource {
 public:
  GreySource(std::vector<int> cameras, int count, calib::ImageSize size = {32, 24})
      : cameras_(std::move(cameras)), count_(count), size_(size) {}

  std::optional<capture::Frame> next(std::stop_token stop) override {
    if (stop.stop_requested()) return std::nullopt;
    const auto turn = made_ / int(cameras_.size());
    if (count_ > 0 && turn == count_) return std::nullopt;
    capture::Frame frame;
    frame.camera = cameras_[std::size_t(made_) % cameras_.size()];
    frame.sequence = std::uint32_t(turn);
    frame.captured_at = capture::Timestamp(turn * 10ms);
    frame.pixels =
        capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, size_.width, size_.height).image;
    ++made_;
    return frame;
  }

 private:
  std::vector<int> cameras_;
  int count_, made_ = 0;
  calib::ImageSize size_;
};

std::vector<object_trackers::ObjectTracker> trackers_for(const calib::CameraRig& rig, int count) {
  std::vector<object_trackers::ObjectTracker> trackers;
  for (int i = 0; i < count; ++i) {
    object_tracking::TargetOptions target;
    target.name = std::string(1, char('p' + i));
    target.color.hue_min_deg = 40.0 * i;
    target.color.hue_max_deg = 40.0 * i + 20;
    trackers.emplace_back(rig, target, object_tracking::ObjectTrackerOptions{});
  }
  return trackers;
}

PipelineOptions options_for(const calib::CameraRig& rig) {
  PipelineOptions options;
  options.frame_sets.camera_count = int(rig.cameras.size());
  options.frame_sets.tolerance = 4ms;
  return options;
}

template <typename... Sources>
std::vector<std::unique_ptr<capture::FrameSource>> sources(Sources... all) {
  std::vector<std::unique_ptr<capture::FrameSource>> list;
  (list.push_back(std::make_unique<Sources>(std::move(all))), ...);
  return list;
}

// As a live source: it knows when the bytes came.
class ArrivedSource final : public capture::FrameSource {
 public:
  ArrivedSource(std::vector<int> cameras, int count, capture::Timestamp at)
      : grey_(std::move(cameras), count), at_(at) {}
  std::optional<capture::Frame> next(std::stop_token stop) override {
    auto frame = grey_.next(stop);
    if (frame) frame->arrived_at = at_;
    return frame;
  }

 private:
  GreySource grey_;
  capture::Timestamp at_;
};

TEST(Pipeline, LatencyCountsFromTheArrivalOfTheBytes) {
  const calib::CameraRig rig = rig_of(2);
  const capture::Timestamp at{1'000'000s};
  std::size_t sets = 0;
  PipelineTo pipeline(rig, sources(ArrivedSource({0, 1}, 5, at)), trackers_for(rig, 1), options_for(rig),
                      {.estimates = [&](const capture::FrameSet&, std::span<const object_tracking::ObjectEstimate>,
                                        capture::Timestamp received_at) {
                        ++sets;
                        EXPECT_EQ(received_at, at);
                      }});
  pipeline.run({});
  EXPECT_EQ(sets, 5U);
}

TEST(Pipeline, EverySetComesOutOnceInOrderWithEveryTarget) {
  const calib::CameraRig rig = rig_of(2);
  for (const int threads : {1, 2, 5}) {
    PipelineOptions options = options_for(rig);
    options.threads = threads;
    options.queue_capacity = 2;
    std::vector<std::uint64_t> numbers, estimates_of, pictures;
    std::size_t particles = 0;
    int statuses = 0;
    options.pictures_every = 10;
    PipelineTo pipeline(
        rig, sources(GreySource({0, 1}, 50)), trackers_for(rig, 3), options,
        {.estimates =
             [&](const capture::FrameSet& set, std::span<const object_tracking::ObjectEstimate> estimates,
                 capture::Timestamp received_at) {
               numbers.push_back(set.number);
               EXPECT_EQ(estimates.size(), 3u);
               for (const auto& e : estimates) EXPECT_EQ(e.set_number, set.number);
               EXPECT_LT(std::chrono::system_clock::now() - received_at, 60s);
             },
         .status = [&](const PipelineFigures&) { ++statuses; },
         .pictures =
             [&](const pictures::PictureJob& job) {
               pictures.push_back(job.set.number);
               particles += job.particles.at(2).size();
             }});
    pipeline.run({});
    std::vector<std::uint64_t> expected(50);
    for (std::size_t i = 0; i < expected.size(); ++i) expected[i] = i;
    EXPECT_EQ(numbers, expected);
    EXPECT_THAT(pictures, ElementsAre(0, 10, 20, 30, 40));
    EXPECT_GT(particles, 0u);
    EXPECT_GE(statuses, 2);  // a start and an end at the least
    const PipelineFigures figures = pipeline.figures();
    EXPECT_EQ(figures.sets_tracked, 50u);
    EXPECT_EQ(figures.sets_dropped, 0u);
    EXPECT_EQ(figures.cameras.at(1).frames, 50u);
    EXPECT_TRUE(figures.cameras[0].ended && figures.cameras[1].ended);
    EXPECT_GT(figures.track.wall, 0ns);
    EXPECT_GT(figures.draw.wall, 0ns);
  }
}

// Every frame is damaged.
class DamagedSource final : public capture::FrameSource {
 public:
  std::optional<capture::Frame> next(std::stop_token stop) override {
    auto frame = all_.next(stop);
    if (frame) frame->status = capture::FrameStatus::corrupted, frame->pixels = {};
    return frame;
  }

 private:
  GreySource all_{{1}, 20};
};

TEST(Pipeline, DamagedFramesDoNotCountAsDelivered) {
  const calib::CameraRig rig = rig_of(2);
  PipelineTo pipeline(rig, sources(GreySource({0}, 20), DamagedSource()), trackers_for(rig, 1), options_for(rig), {});
  pipeline.run({});
  const PipelineFigures figures = pipeline.figures();
  EXPECT_EQ(figures.cameras[0].frames, 20u);
  EXPECT_EQ(figures.cameras[0].corrupted, 0u);
  EXPECT_EQ(figures.cameras[1].frames, 0u);
  EXPECT_EQ(figures.cameras[1].corrupted, 20u);
  EXPECT_FALSE(figures.cameras[1].last_received);
}

// Noise, as from a live camera; from some turn on camera 1 repeats its last picture.
class HangingSource final : public capture::FrameSource {
 public:
  explicit HangingSource(std::uint32_t hangs_from) : hangs_from_(hangs_from) {}

  std::optional<capture::Frame> next(std::stop_token stop) override {
    auto frame = all_.next(stop);
    if (!frame) return frame;
    if (frame->camera == 1 && frame->sequence >= hangs_from_) {
      frame->pixels = last_;
      return frame;
    }
    const capture::WritableImage noise =
        capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 32, 24);
    for (int i = 0; i < 32 * 24; ++i) noise.data[0][i] = std::uint8_t(100 + random_() % 3);
    frame->pixels = noise.image;
    if (frame->camera == 1) last_ = noise.image;
    return frame;
  }

 private:
  GreySource all_{{0, 1}, 100};
  std::uint32_t hangs_from_;
  capture::Image last_;
  std::mt19937 random_{3};
};

TEST(Pipeline, ACameraThatHangsOnItsLastPictureIsAbsent) {
  const calib::CameraRig rig = rig_of(2);
  std::vector<bool> is_there;
  PipelineTo pipeline(
      rig, sources(HangingSource(60)), trackers_for(rig, 1), options_for(rig),
      {.estimates = [&](const capture::FrameSet& set, auto, auto) { is_there.push_back(set.frames[1].has_value()); }});
  pipeline.run({});
  std::vector<bool> expected(100, true);
  std::fill(expected.begin() + 60, expected.end(), false);
  EXPECT_EQ(is_there, expected);
  const PipelineFigures figures = pipeline.figures();
  EXPECT_EQ(figures.cameras[0].repeated, 0u);
  EXPECT_EQ(figures.cameras[1].repeated, 40u);
  EXPECT_EQ(figures.cameras[1].times_repeated, 1u);
  EXPECT_EQ(figures.cameras[1].repeated_since, capture::Timestamp(600ms));
}

TEST(Pipeline, ACameraThatHangsFromItsFirstPictureHasNotChanged) {
  const calib::CameraRig rig = rig_of(2);
  PipelineTo pipeline(rig, sources(HangingSource(1)), trackers_for(rig, 1), options_for(rig), {});
  pipeline.run({});
  const PipelineFigures figures = pipeline.figures();
  EXPECT_TRUE(figures.cameras[0].has_changed);
  EXPECT_FALSE(figures.cameras[1].has_changed);
}

// Camera 1 ends after three turns, and camera 0 goes on.
class CutShortSource final : public capture::FrameSource {
 public:
  std::optional<capture::Frame> next(std::stop_token stop) override {
    auto frame = all_.next(stop);
    while (frame && frame->camera == 1 && frame->captured_at >= capture::Timestamp(30ms)) {
      cut_ = true;
      frame = all_.next(stop);
    }
    return frame;
  }
  bool ended(int camera) const override { return camera == 1 && cut_; }

 private:
  GreySource all_{{0, 1}, 20};
  bool cut_ = false;
};

TEST(Pipeline, ACameraThatIsCutShortHasEndedWhileTheOtherGoesOn) {
  const calib::CameraRig rig = rig_of(2);
  bool seen = false;
  PipelineOptions options = options_for(rig);
  PipelineTo pipeline(
      rig, sources(CutShortSource()), trackers_for(rig, 1), options,
      {.estimates = {},
       .status = [&](const PipelineFigures& figures) { seen |= figures.cameras[1].ended && !figures.cameras[0].ended; },
       .pictures = {}});
  pipeline.hold_to({std::chrono::steady_clock::now(), capture::Timestamp(0ns)});  // so that sets are tracked meanwhile
  pipeline.run({});
  EXPECT_TRUE(seen);
  EXPECT_EQ(pipeline.figures().cameras[1].frames, 3u);
  EXPECT_EQ(pipeline.figures().cameras[1].last_captured, capture::Timestamp(20ms));
  EXPECT_EQ(pipeline.figures().cameras[0].last_captured, capture::Timestamp(190ms));
}

TEST(Pipeline, OneSourcePerCameraWorks) {
  const calib::CameraRig rig = rig_of(2);
  std::uint64_t last = 0, sets = 0;
  PipelineTo pipeline(rig, sources(GreySource({0}, 40), GreySource({1}, 40)), trackers_for(rig, 1), options_for(rig),
                      {.estimates =
                           [&](const capture::FrameSet& set, auto, auto) {
                             EXPECT_TRUE(sets == 0 || set.number > last);
                             last = set.number;
                             ++sets;
                           },
                       .status = {},
                       .pictures = {}});
  pipeline.run({});
  EXPECT_EQ(pipeline.figures().cameras[0].frames + pipeline.figures().cameras[1].frames, 80u);
  EXPECT_EQ(sets, pipeline.figures().sets_tracked);
  EXPECT_GE(sets, 1u);
}

TEST(Pipeline, AStopEndsSoonWithCompleteSets) {
  const calib::CameraRig rig = rig_of(2);
  for (const bool paced : {false, true}) {
    PipelineOptions options = options_for(rig);
    options.pictures_every = 1;
    std::stop_source stop;
    std::atomic<int> sets = 0;
    PipelineTo pipeline(rig, sources(GreySource({0, 1}, 0)), trackers_for(rig, 2), options,
                        {.estimates = [&](auto&, auto, auto) { ++sets; },
                         .status = {},
                         .pictures = [](const pictures::PictureJob&) { std::this_thread::sleep_for(50ms); }});
    if (paced) pipeline.hold_to({std::chrono::steady_clock::now(), capture::Timestamp{}});
    std::jthread stopper([&] {
      while (sets < 3) std::this_thread::sleep_for(1ms);
      stop.request_stop();
    });
    const auto start = std::chrono::steady_clock::now();
    pipeline.run(stop.get_token());
    EXPECT_LT(std::chrono::steady_clock::now() - start, 5s);
    EXPECT_EQ(std::uint64_t(sets), pipeline.figures().sets_tracked);
  }
}

TEST(Pipeline, PacedFramesComeAtTheirTime) {
  const calib::CameraRig rig = rig_of(1);
  PipelineOptions options = options_for(rig);
  const auto start = std::chrono::steady_clock::now();
  PipelineTo pipeline(
      rig, sources(GreySource({0}, 21)), trackers_for(rig, 1), options,
      {.estimates =
           [&](const capture::FrameSet& set, auto, auto) {  // never early; how late depends on the machine's load
             EXPECT_GE(std::chrono::steady_clock::now() - start, set.at.time_since_epoch());
           },
       .status = {},
       .pictures = {}});
  pipeline.hold_to({start, capture::Timestamp{}});
  pipeline.run({});
  EXPECT_GE(std::chrono::steady_clock::now() - start, 200ms);
}

TEST(Pipeline, FramesOfAnotherSizeAreAnErrorThatNamesBothSizes) {
  const calib::CameraRig rig = rig_of(2);
  PipelineTo pipeline(rig, sources(GreySource({0, 1}, 10, {64, 48})), trackers_for(rig, 1), options_for(rig), {});
  try {
    pipeline.run({});
    FAIL() << "frames of the wrong size were taken";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("camera a: its frames are 64x48, but the rig was calibrated at 32x24"));
  }
}

TEST(Pipeline, RunRethrowsAnOutputsException) {
  const calib::CameraRig rig = rig_of(1);
  const auto fails = [](const char* why) { throw std::runtime_error(why); };
  PipelineTo estimates(rig, sources(GreySource({0}, 0)), trackers_for(rig, 1), options_for(rig),
                       {.estimates = [&](auto&, auto, auto) { fails("disk full"); }, .status = {}, .pictures = {}});
  EXPECT_THAT([&] { estimates.run({}); }, testing::ThrowsMessage<std::runtime_error>("disk full"));
  PipelineOptions with_pictures = options_for(rig);
  with_pictures.pictures_every = 1;
  PipelineTo pictures(rig, sources(GreySource({0}, 0)), trackers_for(rig, 1), with_pictures,
                      {.estimates = {}, .status = {}, .pictures = [&](auto&) { fails("no picture"); }});
  EXPECT_THAT([&] { pictures.run({}); }, testing::ThrowsMessage<std::runtime_error>("no picture"));
}

// The frames of rendered sets, set by set.
class RenderedSource final : public capture::FrameSource {
 public:
  // jump: the first set after one.
  explicit RenderedSource(const std::vector<capture::FrameSet>& sets, std::optional<std::size_t> jump = {})
      : jump_at_(jump ? std::optional(sets.at(*jump).at) : std::nullopt) {
    for (const capture::FrameSet& set : sets)
      for (const auto& frame : set.frames) frames_.push_back(frame.value());
  }
  std::optional<capture::Frame> next(std::stop_token) override {
    return next_ == frames_.size() ? std::nullopt : std::optional(frames_[next_++]);
  }
  std::uint64_t jumps() const override {
    return next_ > 0 && jump_at_ && frames_[next_ - 1].captured_at >= *jump_at_ ? 1 : 0;
  }

 private:
  const std::optional<capture::Timestamp> jump_at_;
  std::vector<capture::Frame> frames_;
  std::size_t next_ = 0;
};

TEST(Pipeline, AReplacedTrackersObjectsEndAndTheirNumbersAreNotReused) {
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = 3});
  builder.ball({.path = [](double t) { return Eigen::Vector3d(0.3 * t, 0, 1.0); }});
  const scene::Scene scene = builder.build();
  const std::vector<capture::FrameSet> sets = render(scene, {.set_count = 12});
  object_tracking::TargetOptions several;
  several.name = "lime";
  several.count = 2;
  several.color.hue_min_deg = 65, several.color.hue_max_deg = 115;
  std::vector<object_trackers::ObjectTracker> trackers;
  trackers.emplace_back(scene.rig, several, object_tracking::ObjectTrackerOptions{});
  std::vector<std::uint32_t> births, ends;
  PipelineTo pipeline(
      scene.rig, sources(RenderedSource(sets)), std::move(trackers), options_for(scene.rig),
      {.estimates = [&](const capture::FrameSet&, std::span<const object_tracking::ObjectEstimate> estimates,
                        capture::Timestamp) {
        for (const auto& e : estimates) {
          if (e.is_birth) births.push_back(e.object);
          if (e.is_end) ends.push_back(e.object);
        }
      }});
  Pipeline::Replacement next;
  next.trackers.push_back(
      {0, several, object_trackers::ObjectTracker(scene.rig, several, object_tracking::ObjectTrackerOptions{})});
  next.from = sets[6].at;
  pipeline.replace_trackers(std::move(next));
  pipeline.run({});
  EXPECT_THAT(births, ElementsAre(1, 2));
  EXPECT_THAT(ends, ElementsAre(1));
}

// A replay may be paused when a colour is saved: no set was tried with it.
TEST(Pipeline, WhatWasSearchedSaysNothingOfANewColour) {
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = 2});
  builder.ball({.path = [](double) { return Eigen::Vector3d(0, 0, 1.0); }});
  const scene::Scene scene = builder.build();
  const std::vector<capture::FrameSet> sets = render(scene, {.set_count = 4});
  object_tracking::TargetOptions target;
  target.name = "blue";
  target.color.hue_min_deg = 200, target.color.hue_max_deg = 250;
  const auto tracker = [&] {
    return object_trackers::ObjectTracker(scene.rig, target, object_tracking::ObjectTrackerOptions{});
  };
  for (const bool is_reloaded : {false, true}) {
    std::vector<object_trackers::ObjectTracker> trackers;
    trackers.push_back(tracker());
    PipelineTo pipeline(scene.rig, sources(RenderedSource(sets)), std::move(trackers), options_for(scene.rig),
                        {.estimates = [&](const capture::FrameSet& set,
                                          std::span<const object_tracking::ObjectEstimate>, capture::Timestamp) {
                          if (!is_reloaded || set.at != sets.back().at) return;
                          Pipeline::Replacement next;
                          next.trackers.push_back({0, target, tracker()});
                          pipeline.replace_trackers(std::move(next));
                        }});
    pipeline.run({});
    ASSERT_EQ(pipeline.figures().searches.size(), 1u);
    EXPECT_EQ(pipeline.figures().searches[0].sets, is_reloaded ? 0u : sets.size());
  }
}

// After a jump the published position must not be that from before it.
TEST(Pipeline, ObjectsAreSearchedAnewAfterAJump) {
  scene::SceneBuilder builder;
  builder.cameras_on_ring({.count = 3});
  builder.ball({.path = [](double t) { return Eigen::Vector3d(t < 0.15 ? 0.2 : -0.2, 0, 1.0); }});
  const scene::Scene scene = builder.build();
  const std::vector<capture::FrameSet> sets = render(scene, {.set_count = 12});
  std::size_t first_after = 0;
  while (capture::seconds(sets[first_after].at - sets[0].at) < 0.15) ++first_after;
  ASSERT_GT(first_after, 3u);
  ASSERT_LT(first_after, 9u);
  for (const int count : {1, 2}) {
    object_tracking::TargetOptions lime;
    lime.name = "lime";
    lime.count = count;
    lime.color.hue_min_deg = 65, lime.color.hue_max_deg = 115;
    std::vector<object_trackers::ObjectTracker> trackers;
    trackers.emplace_back(scene.rig, lime, object_tracking::ObjectTrackerOptions{});
    std::vector<object_tracking::ObjectEstimate> published;
    PipelineTo pipeline(
        scene.rig, sources(RenderedSource(sets, first_after)), std::move(trackers), options_for(scene.rig),
        {.estimates = [&](const capture::FrameSet&, std::span<const object_tracking::ObjectEstimate> estimates,
                          capture::Timestamp) { published.push_back(estimates.front()); }});
    pipeline.run({});
    ASSERT_EQ(published.size(), sets.size());
    EXPECT_TRUE(published[first_after - 1].has_position()) << count;
    EXPECT_FALSE(published[first_after].has_position()) << count;
    EXPECT_EQ(published[first_after].state,
              count > 1 ? object_tracking::TrackState::lost : object_tracking::TrackState::searching);
    EXPECT_EQ(published[first_after].is_end, count > 1);
    ASSERT_TRUE(published.back().has_position()) << count;
    EXPECT_NEAR(published.back().position.x(), -0.2, 0.03) << count;
  }
}

TEST(Pipeline, LiveDropsTheOldestSetsAndCountsThem) {
  const calib::CameraRig rig = rig_of(1);
  PipelineOptions options = options_for(rig);
  options.when_full = WhenFull::drop_oldest;
  options.queue_capacity = 1;
  std::vector<std::uint64_t> numbers;
  PipelineTo pipeline(rig, sources(GreySource({0}, 60)), trackers_for(rig, 1), options,
                      {.estimates =
                           [&](const capture::FrameSet& set, auto, auto) {
                             numbers.push_back(set.number);
                             std::this_thread::sleep_for(20ms);
                           },
                       .status = {},
                       .pictures = {}});
  pipeline.run({});
  EXPECT_GT(pipeline.figures().sets_dropped, 0u);
  EXPECT_EQ(pipeline.figures().sets_dropped + pipeline.figures().sets_tracked, 60u);
  EXPECT_EQ(numbers.back(), 59u);  // the newest frame matters most
}

}  // namespace
}  // namespace huetrack::pipeline
