// Our tracker on a rendered desk: what must not change its poses, and what they must be consistent with.
#include "camera_tracking/keyframes/keyframe_tracker.h"

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <cstring>

#include "camera_tracking/random_scene.h"
#include "scene/desk_scene.h"

namespace huetrack::keyframes {
namespace {

using camera_tracking::CameraEstimate;
using camera_tracking::CameraMapPoint;
using camera_tracking::PoseState;

struct Sequence {
  calib::Camera camera;
  std::vector<capture::Frame> frames;
  std::vector<calib::Rigid3d> world_from_camera;
};

const Sequence& sequence() {
  static const Sequence rendered = [] {
    const scene::DeskScene desk(8);
    const scene::HandHeld hand({.seed = 8, .length_s = 1.2, .fastest_deg_s = 40, .still_s = 0.1});
    Sequence out{desk.camera, scene::render(desk, hand, {.frames = 24}), {}};
    for (const capture::Frame& f : out.frames)
      out.world_from_camera.push_back(hand.world_from_camera(capture::seconds(f.captured_at)));
    out.camera.timing.readout_s = 0, out.camera.timing.readout_sigma_s = 1e-4;
    return out;
  }();
  return rendered;
}

struct Trajectory {
  std::vector<CameraEstimate> estimates;
  std::vector<CameraMapPoint> map;
};

Trajectory track(const std::vector<capture::Frame>& frames, const calib::Rigid3d& new_from_old = {}, double scale = 1,
                 std::uint64_t seed = 1) {
  camera_tracking::CameraTrackerOptions options;
  std::vector<Eigen::Vector3d> corners = scene::DeskScene::rectangle_corners();
  for (Eigen::Vector3d& p : corners) p = new_from_old * Eigen::Vector3d(scale * p);
  options.start = camera_tracking::RectangleStart{corners, {}};
  options.seed = seed;
  const auto tracker = make_keyframe_tracker(sequence().camera, options);
  Trajectory out;
  for (const capture::Frame& f : frames) out.estimates.push_back(tracker->update(f));
  out.map = tracker->map();
  return out;
}

const Trajectory& reference() {
  static const Trajectory run = track(sequence().frames);
  return run;
}

double position_error(const CameraEstimate& e, const calib::Rigid3d& truth) {
  return (e.world_from_camera.translation - truth.translation).norm();
}

// The same frames with other grey levels.
template <typename Map>
std::vector<capture::Frame> with_grey_levels(const Map& map) {
  std::vector<capture::Frame> out = sequence().frames;
  for (capture::Frame& f : out) {
    const capture::Plane plane = f.pixels.planes[0];
    const auto bytes = std::make_shared<std::vector<std::uint8_t>>();
    for (int v = 0; v < f.pixels.height; ++v)
      for (int u = 0; u < f.pixels.width; ++u) bytes->push_back(map(plane.data[v * plane.stride + u]));
    f.pixels.format = capture::PixelFormat::grey;
    f.pixels.planes = {};
    f.pixels.planes[0].data = bytes->data(), f.pixels.planes[0].stride = f.pixels.width;
    f.pixels.owner = bytes;
  }
  return out;
}

TEST(KeyframeTracker, TracksEveryFrameConsistently) {
  double nees = 0;
  for (std::size_t i = 0; i < sequence().frames.size(); ++i) {
    const CameraEstimate& e = reference().estimates[i];
    ASSERT_EQ(e.state, PoseState::tracking) << i;
    EXPECT_EQ(e.frame_number, i);
    EXPECT_LT(position_error(e, sequence().world_from_camera[i]), 0.006) << i;
    EXPECT_GT(e.confidence, 0.4) << i;
    const calib::Rigid3d& truth = sequence().world_from_camera[i];
    const Eigen::AngleAxisd turn((truth.rotation * e.world_from_camera.rotation.inverse()).normalized());
    Eigen::Matrix<double, 6, 1> error;
    error << truth.translation - e.world_from_camera.translation, turn.angle() * turn.axis();
    nees += error.dot(e.covariance.inverse() * error) / static_cast<double>(sequence().frames.size());
  }
  EXPECT_LT(nees, 15);
  EXPECT_GT(nees, 0.1);
}

TEST(KeyframeTracker, MapsPointsOfTheScene) {
  const auto& map = reference().map;
  EXPECT_GT(map.size(), 30u);
  EXPECT_EQ(std::ranges::count(map, true, &CameraMapPoint::given), 4);
  int inside = 0;
  for (const CameraMapPoint& p : map)  // desk and boxes; the walls are 1.6 m away
    inside += p.position.z() > -0.05 && p.position.norm() < 3.5;
  EXPECT_GT(inside, 0.95 * static_cast<double>(map.size()));
}

TEST(KeyframeTracker, SameSeedSameBits) {
  const Trajectory again = track(sequence().frames);
  for (std::size_t i = 0; i < again.estimates.size(); ++i) {
    EXPECT_EQ(again.estimates[i].world_from_camera.translation, reference().estimates[i].world_from_camera.translation);
    EXPECT_EQ(again.estimates[i].covariance, reference().estimates[i].covariance);
  }
}

TEST(KeyframeTracker, SeedsDifferByLessThanTheSigma) {
  const Trajectory other = track(sequence().frames, {}, 1, 99);
  for (std::size_t i = 0; i < other.estimates.size(); ++i) {
    const double sigma = std::sqrt(reference().estimates[i].covariance.topLeftCorner<3, 3>().trace());
    EXPECT_LT(position_error(other.estimates[i], reference().estimates[i].world_from_camera), 3 * sigma) << i;
  }
}

TEST(KeyframeTracker, EquivariantToTheWorldFrame) {
  camera_tracking::RandomScene scene(1);
  const calib::Rigid3d new_from_old = scene.transform();
  const Trajectory moved = track(sequence().frames, new_from_old);
  for (std::size_t i = 0; i < moved.estimates.size(); ++i) {
    ASSERT_EQ(moved.estimates[i].state, PoseState::tracking) << i;
    const calib::Rigid3d expected = new_from_old * reference().estimates[i].world_from_camera;
    EXPECT_LT(position_error(moved.estimates[i], expected), 0.004) << i;
  }
}

TEST(KeyframeTracker, EquivariantToTheScale) {
  const Trajectory larger = track(sequence().frames, {}, 3);
  for (std::size_t i = 0; i < larger.estimates.size(); ++i) {
    ASSERT_EQ(larger.estimates[i].state, PoseState::tracking) << i;
    calib::Rigid3d expected = reference().estimates[i].world_from_camera;
    expected.translation *= 3;
    EXPECT_LT(position_error(larger.estimates[i], expected), 3 * 0.004) << i;
  }
}

TEST(KeyframeTracker, InvariantToContrast) {
  const Trajectory darker =
      track(with_grey_levels([](std::uint8_t grey) { return static_cast<std::uint8_t>(20 + 0.7 * grey); }));
  for (std::size_t i = 0; i < darker.estimates.size(); ++i) {
    ASSERT_EQ(darker.estimates[i].state, PoseState::tracking) << i;
    EXPECT_LT(position_error(darker.estimates[i], sequence().world_from_camera[i]), 0.008) << i;
  }
}

TEST(KeyframeTracker, WithoutAnImageItCoastsThenIsLost) {
  std::vector<capture::Frame> frames = sequence().frames;
  const capture::Frame last = frames.back();
  for (int i = 1; i <= 20; ++i) {
    capture::Frame f = last;
    f.captured_at += capture::duration_of(i / 30.0);
    f.status = capture::FrameStatus::corrupted;
    frames.push_back(f);
  }
  const Trajectory run = track(frames);
  const std::size_t first = sequence().frames.size();
  for (std::size_t i = first; i < frames.size(); ++i) {
    const CameraEstimate& e = run.estimates[i];
    const bool within = capture::seconds(frames[i].captured_at - last.captured_at) <= 0.4;
    EXPECT_EQ(e.state, within ? PoseState::coasting : PoseState::lost) << i;
    EXPECT_EQ(e.world_from_camera.translation.allFinite(), e.has_pose());
    if (within && i > first) {
      EXPECT_GT(e.covariance.trace(), run.estimates[i - 1].covariance.trace());
    }
  }
}

TEST(KeyframeTracker, DoesNotTrackNoise) {
  std::mt19937 random(3);
  std::vector<capture::Frame> frames =
      with_grey_levels([&](std::uint8_t) { return static_cast<std::uint8_t>(random() % 256); });
  std::copy_n(sequence().frames.begin(), 6, frames.begin());
  const Trajectory run = track(frames);
  EXPECT_EQ(run.estimates[5].state, PoseState::tracking);
  for (std::size_t i = 6; i < frames.size(); ++i) EXPECT_NE(run.estimates[i].state, PoseState::tracking) << i;
}

}  // namespace
}  // namespace huetrack::keyframes
