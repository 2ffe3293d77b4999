// The methods on the first frames of data/rendered/desk, which start on the rectangle and are covered in frames 46
// to 64.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cstring>
#include <string>

#include "benchmark/camera_sequence.h"
#include "camera_tracking/methods/make_camera_tracker.h"

namespace huetrack::camera_tracking {
namespace {

const figures::CameraSequence& desk() {
  static const figures::CameraSequence sequence =
      figures::load_camera_sequence(figures::shared_camera_data() / "rendered/desk", "groundtruth.txt", 76);
  return sequence;
}

class Desk : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(figures::shared_camera_data() / "rendered/desk"))
      GTEST_SKIP() << "data/rendered/desk is not there";
  }
  static CameraTrackerOptions options(CameraMethod method) {
    CameraTrackerOptions o;
    o.method = method, o.start = figures::desk_rectangle();
    return o;
  }
  static figures::CameraSequence part(std::size_t from, std::size_t to) {
    figures::CameraSequence s = desk();
    s.frames = {s.frames.begin() + static_cast<std::ptrdiff_t>(from),
                s.frames.begin() + static_cast<std::ptrdiff_t>(to)};
    s.world_from_camera = {s.world_from_camera.begin() + static_cast<std::ptrdiff_t>(from),
                           s.world_from_camera.begin() + static_cast<std::ptrdiff_t>(to)};
    return s;
  }
};

TEST_F(Desk, HuetrackTracksFromTheFirstFrameAndAfterTheCover) {
  const auto tracker = camera_methods::make_camera_tracker(desk().camera, options(CameraMethod::huetrack));
  const auto estimates = figures::run(*tracker, desk());
  EXPECT_EQ(estimates[0].state, PoseState::tracking);
  const figures::PoseErrors e = figures::errors_of(estimates, desk());
  EXPECT_LT(e.rms_m, 0.004);
  EXPECT_LT(e.max_m, 0.02);
  EXPECT_LT(e.rms_deg, 0.4);
  EXPECT_GT(figures::errors_of(estimates, desk(), 0, 40).tracked, 39);
  EXPECT_EQ(figures::errors_of(estimates, desk(), 50, 60).tracked, 0);  // covered
  for (std::size_t i = 50; i < 61; ++i)
    EXPECT_EQ(estimates[i].has_pose(), estimates[i].world_from_camera.translation.allFinite());
  EXPECT_LE(figures::frames_until_tracked(estimates, 65).value_or(99), 5);
  const CameraTrackerInside inside = tracker->inside();
  EXPECT_GT(inside.features.size(), 50u);
  EXPECT_FALSE(inside.particles.empty());
  const auto map = tracker->map();
  EXPECT_EQ(map.size(), static_cast<std::size_t>(estimates.back().map_points));
  EXPECT_GT(std::ranges::count(map, CameraMapPoint::State::found, &CameraMapPoint::state), 40);
  EXPECT_TRUE(std::ranges::is_sorted(map, std::ranges::less_equal{}, &CameraMapPoint::id));
  EXPECT_EQ(std::ranges::count(map, true, &CameraMapPoint::given), 4);
  EXPECT_GT(map.back().covariance.trace(), 0);
}

TEST_F(Desk, HuetrackStartsFromFourKnownPoints) {
  const figures::CameraSequence s = part(0, 24);
  PointsStart start;
  start.points = {{-0.1, 0.075, 0}, {0.1, 0.075, 0}, {0.1, -0.075, 0}, {-0.1, -0.075, 0}};  // rectangle.csv
  for (const auto& p : start.points)
    start.pixels.push_back(s.camera.model.project(calib::inverse(*s.world_from_camera[0]) * p)->px);
  CameraTrackerOptions o;
  o.start = start;
  const figures::PoseErrors e =
      figures::errors_of(figures::run(*camera_methods::make_camera_tracker(s.camera, o), s), s);
  EXPECT_EQ(e.tracked, 24);
  EXPECT_LT(e.max_m, 0.02);
}

TEST_F(Desk, SameSeedSameBits) {
  const figures::CameraSequence s = part(0, 24);
  for (const CameraMethod method : {CameraMethod::huetrack, CameraMethod::lee, CameraMethod::pupilli}) {
    const auto first = figures::run(*camera_methods::make_camera_tracker(s.camera, options(method)), s),
               second = figures::run(*camera_methods::make_camera_tracker(s.camera, options(method)), s);
    for (std::size_t i = 0; i < s.frames.size(); ++i) {
      const auto bits = [](const CameraEstimate& e) {  // NaN included
        std::string out(sizeof(double) * (4 + 3 + 36), 0);
        std::memcpy(out.data(), e.world_from_camera.rotation.coeffs().data(), 4 * sizeof(double));
        std::memcpy(out.data() + 4 * sizeof(double), e.world_from_camera.translation.data(), 3 * sizeof(double));
        std::memcpy(out.data() + 7 * sizeof(double), e.covariance.data(), 36 * sizeof(double));
        return out;
      };
      EXPECT_TRUE(bits(first[i]) == bits(second[i])) << name(method) << " frame " << i;
      EXPECT_EQ(first[i].state, second[i].state);
    }
  }
}

TEST_F(Desk, PapersMethodsTrack) {
  const figures::CameraSequence s = part(0, 30);
  for (const CameraMethod method : {CameraMethod::lee, CameraMethod::pupilli}) {
    const auto estimates = figures::run(*camera_methods::make_camera_tracker(s.camera, options(method)), s);
    const figures::PoseErrors e = figures::errors_of(estimates, s);
    EXPECT_GE(e.tracked, 28) << name(method);
    EXPECT_LT(e.rms_m, 0.05) << name(method);
    EXPECT_GT(estimates.back().map_points, 4) << name(method);
  }
}

TEST_F(Desk, RelocalisesInALoadedMap) {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("huetrack_desk_" + std::to_string(::getpid()) + ".map");
  {
    const auto tracker = camera_methods::make_camera_tracker(desk().camera, options(CameraMethod::huetrack));
    figures::run(*tracker, part(0, 36));
    tracker->save_map(file);
  }
  CameraTrackerOptions o = options(CameraMethod::huetrack);
  o.load_map = file;
  const figures::CameraSequence s = part(25, 31);
  const auto estimates = figures::run(*camera_methods::make_camera_tracker(s.camera, o), s);
  EXPECT_LE(figures::frames_until_tracked(estimates, 0).value_or(99), 1);
  EXPECT_LT(figures::errors_of(estimates, s).max_m, 0.01);
  // In a part of the scene that the map does not have, there is no pose rather than a false one.
  const auto tracker = camera_methods::make_camera_tracker(s.camera, o);
  figures::CameraSequence covered = part(52, 58);
  EXPECT_EQ(figures::errors_of(figures::run(*tracker, covered), covered).tracked, 0);
  std::filesystem::remove(file);
}

TEST_F(Desk, CoastsOverADamagedFrame) {
  figures::CameraSequence s = part(0, 12);
  s.frames[6].status = capture::FrameStatus::corrupted;
  s.frames[6].pixels = {};
  const auto estimates =
      figures::run(*camera_methods::make_camera_tracker(s.camera, options(CameraMethod::huetrack)), s);
  EXPECT_EQ(estimates[6].state, PoseState::coasting);
  EXPECT_EQ(estimates[7].state, PoseState::tracking);
}

}  // namespace
}  // namespace huetrack::camera_tracking
