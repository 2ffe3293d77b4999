// Tracks from what a camera host says of its frames are those from the frames.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "capture/frames/jpeg_encoder.h"
#include "capture/frames/matches.h"
#include "color/match_tiles.h"
#include "hosts/frame_message.h"
#include "hosts/match_finder.h"
#include "hosts/wanted_matches.h"
#include "hosts/wanted_outlines.h"
#include "object_tracking/trackers/object_tracker.h"
#include "scene/lime.h"

namespace huetrack::hosts {
namespace {

using capture::Frame;
using capture::FrameSet;
using object_trackers::ObjectTracker;
using object_tracking::ObjectEstimate;
using object_tracking::TargetOptions;

TargetOptions lime() {
  TargetOptions target = scene::lime();
  target.shape = object_tracking::TargetShape::blob;
  return target;
}

// A camera host and what a tracker reads of it, without the bus.
class Sender {
 public:
  explicit Sender(std::size_t cameras) : finders_(cameras), decoders_(cameras), latest_(cameras), outlines_(cameras) {}

  // The same set, of matches; asked: by camera.
  FrameSet seen_by(const FrameSet& set, const std::vector<MatchFinderOptions>& asked) {
    FrameSet out = set;
    for (std::size_t c = 0; c < out.frames.size(); ++c) {
      if (!out.frames[c]) continue;
      Frame& frame = *out.frames[c];
      const auto bytes = finders_[c].find(frame, asked[c]);
      if (!bytes) {
        ADD_FAILURE() << "it does not decode";
        continue;
      }
      most_bytes_ = std::max(most_bytes_, bytes->size());
      msg::CameraMatches message;
      message.bytes().assign(bytes->begin(), bytes->end());
      Frame received = from_message(std::move(message), decoders_[c], latest_[c]);
      EXPECT_EQ(received.status, capture::FrameStatus::ok);
      frame.pixels = received.pixels;
      frame.matches = received.matches;
      frame.encoded = received.encoded;
    }
    return out;
  }
  // What a tracker has said of outlines, for the options of this set's frames; of the set before it.
  void add_patches(const FrameSet& set, std::vector<MatchFinderOptions>& asked) {
    for (std::size_t c = 0; c < set.frames.size(); ++c) {
      if (!set.frames[c]) continue;
      outlines_[c].places_at(set.frames[c]->stamped_at, asked[c].patches);
      outlines_[c].note(set.frames[c]->sequence, set.frames[c]->stamped_at);
    }
  }
  void hear_outlines(const ObjectTracker& tracker, const FrameSet& set) {
    for (std::size_t c = 0; c < set.frames.size(); ++c) {
      if (!set.frames[c]) continue;
      std::vector<capture::ExpectedOutline> expected;
      tracker.expected_outlines(c, expected);
      if (expected.empty()) continue;
      msg::OutlinesOfCamera said;
      said.number(set.frames[c]->sequence);
      for (const auto& outline : expected) {
        auto& to = said.outlines().emplace_back();
        to.u(outline.u), to.v(outline.v), to.u_per_s(outline.u_per_s), to.v_per_s(outline.v_per_s);
        to.radius_px(outline.radius_px);
      }
      EXPECT_TRUE(outlines_[c].update(1, said));
    }
  }
  std::size_t most_bytes() const { return most_bytes_; }

 private:
  std::vector<MatchFinder> finders_;
  std::vector<capture::JpegReader> decoders_;
  std::vector<capture::Image> latest_;
  std::vector<WantedOutlines> outlines_;
  std::size_t most_bytes_ = 0;
};

std::vector<MatchFinderOptions> looked_for_by(const ObjectTracker& tracker, std::size_t cameras,
                                              capture::Duration picture_every = {}) {
  std::vector<MatchFinderOptions> asked(cameras);
  for (std::size_t c = 0; c < cameras; ++c) {
    asked[c].colors.push_back(color::matched_color(tracker.color_in(c)));
    asked[c].picture_every = picture_every;
  }
  return asked;
}

template <typename Matrix>
bool same_bits(const Matrix& a, const Matrix& b) {
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (std::bit_cast<std::uint64_t>(a.data()[i]) != std::bit_cast<std::uint64_t>(b.data()[i])) return false;
  return true;
}

void expect_same(const std::vector<ObjectEstimate>& a, const std::vector<ObjectEstimate>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].state, b[i].state);
    ASSERT_EQ(a[i].object, b[i].object);
    ASSERT_EQ(a[i].at, b[i].at);
    ASSERT_EQ(a[i].views, b[i].views);
    ASSERT_TRUE(same_bits(a[i].position, b[i].position));
    ASSERT_TRUE(same_bits(a[i].velocity, b[i].velocity));
    ASSERT_TRUE(same_bits(a[i].covariance, b[i].covariance));
    for (std::size_t v = 0; v < a[i].per_view.size(); ++v) {
      ASSERT_EQ(a[i].per_view[v].seen, b[i].per_view[v].seen);
      ASSERT_EQ(a[i].per_view[v].radius_px, b[i].per_view[v].radius_px);
    }
  }
}

// Both trackers, set by set. Returns in how many sets something was tracked.
std::size_t compare(const scene::Scene& scene, const std::vector<FrameSet>& sets, const TargetOptions& target,
                    object_tracking::ObjectTrackerOptions options = {}) {
  ObjectTracker of_frames(scene.rig, target, options), of_matches(scene.rig, target, options);
  Sender host(scene.rig.cameras.size());
  std::vector<ObjectEstimate> a, b;
  std::size_t tracked = 0;
  for (const FrameSet& set : sets) {
    of_frames.update(set, a);
    of_matches.update(host.seen_by(set, looked_for_by(of_matches, set.frames.size(), std::chrono::milliseconds(300))),
                      b);
    expect_same(a, b);
    if (testing::Test::HasFatalFailure()) return 0;
    tracked += std::ranges::any_of(a, [](const auto& e) { return e.state == object_tracking::TrackState::tracking; });
  }
  for (std::size_t c = 0; c < scene.rig.cameras.size(); ++c) EXPECT_EQ(of_matches.frames_of_other_colors(c), 0U);
  return tracked;
}

TEST(Matches, GiveTheSameTracksAsFrames) {
  for (const auto format : {capture::PixelFormat::yuyv, capture::PixelFormat::i420, capture::PixelFormat::bgr}) {
    const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).ball({}).build();
    const auto sets = render(scene, {.set_count = 40, .format = format, .dropped_frames = 0.1, .seed = 3});
    EXPECT_GT(compare(scene, sets, lime()), 30U) << name(format);
  }
}

TEST(Matches, GiveTheSameTracksAsFramesWithThePapersFilter) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).ball({}).build();
  object_tracking::ObjectTrackerOptions options;
  options.observation = object_tracking::Observation::paper;
  EXPECT_GT(compare(scene, render(scene, {.set_count = 25}), lime(), options), 10U);
}

// Static clutter of the target's colour, and an ignored region.
// Without pixels an object before clutter of its colour is left out with it; what is tracked is right all the same.
TEST(Matches, TrackAmongClutter) {
  auto builder = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).ball({});
  for (int i = 0; i < 3; ++i) {
    const double angle = 2 * std::numbers::pi * i / 3 + 0.5;
    const Eigen::Vector3d at(0.9 * std::cos(angle), 0.9 * std::sin(angle), 0.5);
    builder.ball({.name = "lamp", .radius_m = 0.35, .path = [at](double) { return at; }});
  }
  const scene::Scene scene = builder.build();
  TargetOptions target = lime();
  target.ignored = {{scene.rig.cameras[0].name, {{0, 0, 40, 239}, {200, 100, 260, 130}}}};
  ObjectTracker of_matches(scene.rig, target, {});
  Sender host(3);
  std::vector<ObjectEstimate> estimates;
  std::size_t tracked = 0;
  for (const FrameSet& set : render(scene, {.set_count = 60})) {
    of_matches.update(host.seen_by(set, looked_for_by(of_matches, 3, std::chrono::milliseconds(300))), estimates);
    for (const ObjectEstimate& e : estimates) {
      if (e.state != object_tracking::TrackState::tracking) continue;
      ++tracked;
      EXPECT_LT((e.position - scene.ball_at(0, e.at)).norm(), lime().radius_m);
    }
  }
  EXPECT_GT(tracked, 10U);
}

TEST(Matches, GiveTheSameTracksAsFramesForSeveralObjects) {
  auto builder = scene::SceneBuilder{}.cameras_on_ring({.count = 3});
  for (int i = 0; i < 3; ++i)
    builder.ball({.path = [i](double t) {
      return Eigen::Vector3d(0.5 * std::cos(t + 2.1 * i), 0.5 * std::sin(t + 2.1 * i), 0.8 + 0.2 * i);
    }});
  const scene::Scene scene = builder.build();
  TargetOptions target = lime();
  target.count = 3;
  EXPECT_GT(compare(scene, render(scene, {.set_count = 45}), target), 25U);
}

TEST(Matches, TrackABallWithoutOutlines) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).ball({}).build();
  TargetOptions ball = lime();
  ball.shape = object_tracking::TargetShape::ball;
  ObjectTracker of_frames(scene.rig, lime(), {}), of_matches(scene.rig, ball, {});
  Sender host(3);
  std::vector<ObjectEstimate> a, b;
  for (const FrameSet& set : render(scene, {.set_count = 30})) {
    of_frames.update(set, a);
    of_matches.update(host.seen_by(set, looked_for_by(of_matches, 3, std::chrono::milliseconds(200))), b);
    expect_same(a, b);
  }
  EXPECT_EQ(of_matches.outline_findings().fitted, 0U);
}

// The host sends pixels where the tracker predicts the ball: outlines fitted in them are as accurate as in whole
// pictures, and messages stay small.
TEST(Matches, FitOutlinesInPatches) {
  const scene::Scene scene = scene::lime_that_flies();
  TargetOptions ball = lime();
  ball.shape = object_tracking::TargetShape::ball;
  ObjectTracker of_frames(scene.rig, ball, {}), of_matches(scene.rig, ball, {}), of_regions(scene.rig, lime(), {});
  Sender host(3);
  std::vector<ObjectEstimate> a, b, c;
  double frames_m2 = 0, matches_m2 = 0, regions_m2 = 0;
  int sets = 0, in_patches = 0;
  for (FrameSet& set : render(scene, {.set_count = 90})) {
    for (auto& frame : set.frames) {
      // As a camera's stamps are.
      if (frame && frame->stamped_at == capture::Timestamp{})
        frame->stamped_at = frame->captured_at + std::chrono::hours(1);
    }
    of_frames.update(set, a);
    of_regions.update(set, c);
    auto asked = looked_for_by(of_matches, 3);
    host.add_patches(set, asked);
    const FrameSet received = host.seen_by(set, asked);
    for (const auto& frame : received.frames) in_patches += frame && !frame->matches->patches.empty();
    of_matches.update(received, b);
    host.hear_outlines(of_matches, set);
    if (++sets <= 45 || a.front().state != object_tracking::TrackState::tracking ||
        b.front().state != object_tracking::TrackState::tracking ||
        c.front().state != object_tracking::TrackState::tracking)
      continue;
    const auto error2 = [&](const ObjectEstimate& e) { return (e.position - scene.ball_at(0, e.at)).squaredNorm(); };
    frames_m2 += error2(a.front()), matches_m2 += error2(b.front()), regions_m2 += error2(c.front());
  }
  EXPECT_GT(in_patches, 3 * 60);
  EXPECT_GT(of_matches.outline_findings().fitted, 3U * 40);
  EXPECT_GT(of_frames.outline_findings().fitted, 3U * 40);
  EXPECT_LT(host.most_bytes(), 6000U);
  // 1.17, 1.30 and 2.46 mm rms: patches show less of the background than whole pictures.
  EXPECT_LT(matches_m2, 1.6 * frames_m2);
  EXPECT_LT(matches_m2, 0.5 * regions_m2);
}

// A frame without a requested colour gives no measurement of it.
TEST(Matches, OfOtherColoursAreNoMeasurement) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).ball({}).build();
  const auto sets = render(scene, {.set_count = 20});
  TargetOptions taught = lime();
  taught.color.saturation_min = 0.35;
  ObjectTracker tracker(scene.rig, taught, {}), old(scene.rig, lime(), {});
  Sender host(3);
  std::vector<ObjectEstimate> estimates;
  for (std::size_t i = 0; i < sets.size(); ++i) {
    tracker.update(host.seen_by(sets[i], looked_for_by(i < 8 ? old : tracker, 3)), estimates);
    if (i < 8) {
      EXPECT_EQ(estimates.front().state, object_tracking::TrackState::searching);
      EXPECT_FALSE(estimates.front().per_view[0].delivered);
    }
  }
  for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(tracker.frames_of_other_colors(c), 8U);
  EXPECT_EQ(estimates.front().state, object_tracking::TrackState::tracking);
}

msg::LookedForColors said(std::int64_t tracker, std::vector<double> hues, double picture_every_s) {
  msg::LookedForColors out;
  out.tracker(tracker);
  out.picture_every_s(picture_every_s);
  for (const double hue : hues) {
    msg::LookedFor& color = out.colors().emplace_back();
    color.hue_min_deg(hue), color.hue_max_deg(hue + 20);
    color.saturation_min(0.3), color.saturation_max(1);
    color.intensity_min(0.1), color.intensity_max(0.9);
  }
  return out;
}

TEST(WantedMatches, CombineAllRecentRequests) {
  using namespace std::chrono_literals;
  WantedMatches wanted;
  MatchFinderOptions all;
  const WantedMatches::Clock::time_point start{};
  wanted.all(start, all);
  EXPECT_TRUE(all.colors.empty());
  EXPECT_TRUE(wanted.update(said(1, {60, 100}, 2), start));
  EXPECT_TRUE(wanted.update(said(2, {100, 200}, 0), start + 3s));
  wanted.all(start + 3s, all);
  EXPECT_EQ(all.colors.size(), 3U);
  EXPECT_EQ(all.picture_every, 2s);
  EXPECT_TRUE(wanted.update(said(2, {200}, 0.5), start + 4s)) << "replaces its earlier request";
  wanted.all(start + 4s, all);
  EXPECT_EQ(all.picture_every, 500ms);
  wanted.all(start + 6s, all);
  ASSERT_EQ(all.colors.size(), 1U) << "the first request has expired";
  EXPECT_EQ(all.colors[0].hue_min_deg, 200);
}

TEST(WantedMatches, RejectInvalidAndBoundLargeRequests) {
  using namespace std::chrono_literals;
  const WantedMatches::Clock::time_point now{};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  WantedMatches wanted;
  EXPECT_FALSE(wanted.update(said(1, {nan}, 1), now));
  EXPECT_FALSE(wanted.update(said(1, {400}, 1), now));
  EXPECT_FALSE(wanted.update(said(1, {60}, nan), now));
  EXPECT_FALSE(wanted.update(said(1, {60}, -1), now));
  EXPECT_FALSE(wanted.update(said(1, {60}, 1e300), now));
  EXPECT_FALSE(wanted.update(said(1, std::vector<double>(33, 60), 1), now));
  for (int t = 0; t < 16; ++t) {
    std::vector<double> hues;
    for (int i = 0; i < 10; ++i) hues.push_back(10 * t + i);
    EXPECT_TRUE(wanted.update(said(t, hues, 1), now));
  }
  EXPECT_FALSE(wanted.update(said(99, {60}, 1), now)) << "one tracker too many";
  MatchFinderOptions all;
  wanted.all(now, all);
  EXPECT_EQ(all.colors.size(), capture::Matches::most);
}

TEST(WantedOutlines, ArePredictedForTheNextFrame) {
  using namespace std::chrono_literals;
  const capture::Timestamp start(1h);
  WantedOutlines wanted;
  std::vector<capture::PatchPlace> places;
  msg::OutlinesOfCamera said;
  said.number(7);
  auto& outline = said.outlines().emplace_back();
  outline.u(100), outline.v(50), outline.u_per_s(300), outline.v_per_s(-60), outline.radius_px(10);
  EXPECT_FALSE(wanted.update(1, said)) << "for a frame that was never sent";
  wanted.note(7, start);
  ASSERT_TRUE(wanted.update(1, said));
  wanted.places_at(start + 100ms, places);
  ASSERT_EQ(places.size(), 1U);
  // Its middle, and all of it with what a fit needs around it.
  EXPECT_NEAR(places[0].u + places[0].width / 2.0, 130, 2);
  EXPECT_NEAR(places[0].v + places[0].height / 2.0, 44, 2);
  EXPECT_GE(places[0].width, 2 * (10 + 7));
  EXPECT_EQ(places[0].u % 2 + places[0].v % 2 + places[0].width % 2 + places[0].height % 2, 0);
  // Another tracker's, nearly there: one place. Elsewhere: two.
  outline.u(101);
  ASSERT_TRUE(wanted.update(2, said));
  wanted.places_at(start + 100ms, places);
  EXPECT_EQ(places.size(), 1U);
  outline.u(300);
  ASSERT_TRUE(wanted.update(2, said));
  wanted.places_at(start + 100ms, places);
  EXPECT_EQ(places.size(), 2U);
  // Old and future predictions are ignored.
  wanted.places_at(start + 301ms, places);
  EXPECT_TRUE(places.empty());
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), 1e30f, -1.f}) {
    said.outlines()[0].radius_px(bad);
    EXPECT_FALSE(wanted.update(2, said));
  }
  said.outlines()[0].radius_px(10);
  said.outlines().resize(capture::Matches::most_patches + 1, said.outlines()[0]);
  EXPECT_FALSE(wanted.update(2, said));
}

// Brightness changes within seconds, which a tracker with matches could not detect.
TEST(MatchFinder, DetectsChangingLight) {
  using namespace std::chrono_literals;
  const auto findings_of = [](double share) {
    MatchFinder finder;
    for (int i = 0; i < 30 * 10; ++i) {
      const double level = 110 * (1 + share * std::sin(2 * std::numbers::pi * i / 90.0));
      const auto pixels =
          std::make_shared<std::vector<std::uint8_t>>(std::size_t(160 * 120), static_cast<std::uint8_t>(level));
      Frame frame;
      frame.stamped_at = capture::Timestamp(1h) + i * capture::Duration(33'333'333);
      frame.pixels = {.format = capture::PixelFormat::grey,
                      .range = capture::ColorRange::full,
                      .width = 160,
                      .height = 120,
                      .planes = {{{pixels->data(), 160}}},
                      .owner = pixels};
      EXPECT_TRUE(finder.find(frame, {}));
    }
    return finder.light();
  };
  EXPECT_TRUE(findings_of(0.15).exposure_change);
  EXPECT_TRUE(findings_of(0) == capture::LightFindings{});
}

TEST(MatchFinder, ClipsPatchesToTheImageAndTheBudget) {
  const scene::Scene scene = scene::SceneBuilder{}.cameras_on_ring({.count = 3}).ball({}).build();
  const Frame frame = *render(scene, {.set_count = 1}).front().frames[0];
  MatchFinder finder;
  capture::JpegDecoder decoder;
  capture::Image latest;
  MatchFinderOptions asked;
  const int width = frame.pixels.width, height = frame.pixels.height;
  asked.patches = {{-5, -5, 20, 20}, {width - 9, height - 9, 40, 40}, {width + 10, 0, 20, 20}, {0, 0, 400, 400}};
  const auto bytes = finder.find(frame, asked);
  ASSERT_TRUE(bytes);
  const auto back = capture::decode_matches(*bytes, decoder, latest);
  ASSERT_TRUE(back);
  ASSERT_EQ(back->matches->patches.size(), 2U);
  EXPECT_EQ(back->matches->patches[0].at.u, 0);
  EXPECT_EQ(back->matches->patches[0].at.width, 14);
  EXPECT_EQ(back->matches->patches[1].at.u + back->matches->patches[1].at.width, width);
  EXPECT_EQ(back->matches->patches[1].at.v + back->matches->patches[1].at.height, height);
}

TEST(MatchFinder, SendsPicturesPeriodicallyWithinTheBudget) {
  const auto [image, data] = capture::make_image(capture::PixelFormat::yuyv, capture::ColorRange::limited, 640, 480);
  std::uint32_t noise = 1;
  for (int i = 0; i < 640 * 480 * 2; ++i)
    data[0][i] = static_cast<std::uint8_t>((noise = noise * 1664525u + 1013904223u) >> 24);
  const auto [plain, written] = capture::make_image(capture::PixelFormat::yuyv, capture::ColorRange::limited, 640, 480);
  std::fill_n(written[0], 640 * 480 * 2, std::uint8_t{90});
  MatchFinder finder;
  MatchFinderOptions asked{.colors = {color::matched_color({60, 180, 0.1, 1, 0.05, 0.95})},
                           .picture_every = std::chrono::seconds(1)};
  capture::JpegDecoder decoder;
  capture::Image latest;
  int pictures = 0;
  for (int i = 0; i < 45; ++i) {
    Frame frame;
    frame.pixels = i < 30 ? plain : image;
    frame.stamped_at = capture::Timestamp(std::chrono::milliseconds(1'700'000'000'400 + 1000 * i / 30));
    const auto bytes = finder.find(frame, asked);
    ASSERT_TRUE(bytes);
    ASSERT_LE(bytes->size(), most_bytes_of_matches(640, 480));
    const auto back = capture::decode_matches(*bytes, decoder, latest);
    ASSERT_TRUE(back);
    pictures += back->matches->has_own_picture ? 1 : 0;
    EXPECT_EQ(back->matches->colors.size(), 1U);
  }
  EXPECT_EQ(pictures, 2) << "with the first, and with that after the whole second";
  // Of noise all over, no more colours than fit.
  asked.colors.clear();
  for (int i = 0; i < 12; ++i) asked.colors.push_back(color::matched_color({10.0 + i, 200, 0.1, 1, 0.05, 0.95}));
  Frame frame;
  frame.pixels = image;
  frame.stamped_at = capture::Timestamp(std::chrono::seconds(1'700'000'100));
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(finder.find(frame, asked));  // four new colours of each frame
  const auto bytes = finder.find(frame, asked);
  ASSERT_TRUE(bytes);
  EXPECT_LE(bytes->size(), most_bytes_of_matches(640, 480));
  const auto back = capture::decode_matches(*bytes, decoder, latest);
  ASSERT_TRUE(back);
  EXPECT_LT(back->matches->colors.size(), 12U);
  EXPECT_GE(back->matches->colors.size(), 4U);
}

// Who asks for ever new colours holds no camera up: tables are made a few at a time, in the order asked for.
TEST(MatchFinder, AddsFourNewColoursPerFrame) {
  const auto [image, data] = capture::make_image(capture::PixelFormat::yuyv, capture::ColorRange::limited, 64, 48);
  std::fill_n(data[0], 64 * 48 * 2, std::uint8_t{90});
  MatchFinder finder;
  MatchFinderOptions asked;
  for (int i = 0; i < 6; ++i) asked.colors.push_back(color::matched_color({10.0 + i, 200, 0.1, 1, 0.05, 0.95}));
  Frame frame;
  frame.pixels = image;
  capture::JpegDecoder decoder;
  capture::Image latest;
  for (const std::size_t expected : {4U, 6U, 6U}) {
    const auto bytes = finder.find(frame, asked);
    ASSERT_TRUE(bytes);
    const auto back = capture::decode_matches(*bytes, decoder, latest);
    ASSERT_TRUE(back);
    ASSERT_EQ(back->matches->colors.size(), expected);
    for (std::size_t i = 0; i < expected; ++i) EXPECT_EQ(back->matches->colors[i].color, asked.colors[i]);
  }
}

// A ball before a grey room, as a JPEG: all of its pixels are found, wherever it lies among the blocks. The picture at
// 1/8 alone would show it from a radius of 8 * sqrt(2) px on, where the ball surely covers a block (of chroma: twice
// that); bounds of the blocks' samples show it at any size.
TEST(MatchFinder, FindsBallsOfAllSizesInJpegs) {
  constexpr int width = 320, height = 240;
  const color::HsiRange lime{60, 140, 0.3, 1, 0.1, 0.95};
  const color::ColorTable table(lime, capture::PixelFormat::i420, capture::ColorRange::full);
  capture::JpegReader reader;
  for (const int radius : {3, 4, 6, 9, 13, 24}) {
    int shown_at_eighth = 0, trials = 0;
    for (int shift = 0; shift < 16; shift += 3, ++trials) {
      capture::WritableImage made =
          capture::make_image(capture::PixelFormat::i420, capture::ColorRange::full, width, height);
      std::minstd_rand random(static_cast<unsigned>(shift + 1));
      for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u) {
          const bool is_ball = std::hypot(u - 150 - shift, v - 100 - shift) <= radius;
          made.data[0][v * made.image.planes[0].stride + u] = static_cast<std::uint8_t>(120 + random() % 7);
          for (const std::size_t chroma : {1U, 2U})
            if (u % 2 == 0 && v % 2 == 0)
              made.data[chroma][v / 2 * made.image.planes[chroma].stride + u / 2] =
                  is_ball ? (chroma == 1 ? 70 : 90) : 128;
        }
      const auto jpeg = capture::encode_picture(made.image, {.width = width, .height = height}, 90);
      const capture::JpegResult read = reader.read(reader.keep(jpeg));
      ASSERT_TRUE(read.image && read.image->on_demand);
      std::vector<std::uint64_t> found, all;
      color::match_tiles(*read.image, table, found);
      EXPECT_LT(read.image->on_demand->decoded_units(), 40U) << radius;
      color::match_tiles(*capture::JpegDecoder().decode(jpeg).image, table, all);
      EXPECT_EQ(found, all) << radius;
      EXPECT_TRUE(std::ranges::any_of(all, [](std::uint64_t tile) { return tile != 0; })) << radius;
      const capture::Image eighth = read.image->on_demand->eighth();
      bool is_shown = false;
      for (int v = 0; v < eighth.height; ++v)
        for (int u = 0; u < eighth.width; ++u) is_shown |= table.contains(capture::yuv_at(eighth, u, v));
      shown_at_eighth += is_shown ? 1 : 0;
    }
    EXPECT_TRUE(radius > 3 || shown_at_eighth < trials);
    EXPECT_TRUE(radius < 24 || shown_at_eighth == trials);
  }
}

TEST(MatchFinder, DecodesJpegsAndRejectsOthers) {
  const auto [image, data] = capture::make_image(capture::PixelFormat::i422, capture::ColorRange::full, 64, 48);
  std::fill_n(data[1], 32 * 48, std::uint8_t{60});
  Frame frame;
  frame.pixels = {.format = capture::PixelFormat::i422, .width = 64, .height = 48, .planes = {}, .owner = {}};
  const auto jpeg = capture::encode_picture(image, {.width = 64, .height = 48}, 90);
  frame.encoded = std::make_shared<const std::vector<std::uint8_t>>(jpeg);
  MatchFinder finder;
  EXPECT_TRUE(finder.find(frame, {}));
  frame.encoded = std::make_shared<const std::vector<std::uint8_t>>(jpeg.begin(), jpeg.begin() + 100);
  EXPECT_FALSE(finder.find(frame, {}));
  frame.encoded = nullptr;
  EXPECT_FALSE(finder.find(frame, {}));
}

}  // namespace
}  // namespace huetrack::hosts
