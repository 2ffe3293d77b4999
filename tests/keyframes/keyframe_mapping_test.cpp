// The depth filter on a synthetic textured plane with known poses: where it maps, and how certain it is.
#include "camera_tracking/keyframes/keyframe_mapping.h"

#include <gmock/gmock.h>

#include "camera_tracking/random_scene.h"

namespace huetrack::keyframes {
namespace {

// A mosaic of random grey squares of 12 mm on z = 0.
double plane_grey(double x, double y) {
  const auto a = static_cast<std::uint32_t>(std::floor(x / 0.012) + 1000),
             b = static_cast<std::uint32_t>(std::floor(y / 0.012) + 1000);
  const std::uint32_t hash = (a * 2654435761U ^ b * 2246822519U) * 3266489917U;
  return 40 + (hash >> 16) % 180;
}

std::shared_ptr<const Pyramid> view_of_plane(const calib::Rigid3d& cam_from_world) {
  static const std::vector<Eigen::Vector3d> rays = [] {
    std::vector<Eigen::Vector3d> out;
    for (int v = 0; v < 240; ++v)
      for (int u = 0; u < 320; ++u)
        for (int k = 0; k < 4; ++k)
          out.push_back(*camera().model.ray({Eigen::Vector2d(u + 0.5 * (k % 2) - 0.25, v + 0.5 * (k / 2) - 0.25)}));
    return out;
  }();
  const calib::Rigid3d back = calib::inverse(cam_from_world);
  std::uint8_t* px = nullptr;
  GreyImage image = make_grey(320, 240, px);
  for (std::size_t i = 0; i < 320 * 240; ++i) {
    double sum = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::Vector3d d = back.rotation * rays[4 * i + k];
      const Eigen::Vector3d p = back.translation - back.translation.z() / d.z() * d;
      sum += plane_grey(p.x(), p.y()) / 4;
    }
    px[i] = static_cast<std::uint8_t>(std::lround(sum));
  }
  return std::make_shared<const Pyramid>(make_pyramid(std::move(image)));
}

std::vector<Eigen::Vector3d> known_points() {
  return camera_tracking::rectangle_corners();
}

PosedFrame frame_at(std::uint64_t number, const calib::Rigid3d& pose) {
  PosedFrame out{.number = number,
                 .pyramid = view_of_plane(pose),
                 .pose = {pose},
                 .tracked = true,
                 .share_found = 1,
                 .flow_px = 3,
                 .sightings = {},
                 .missed = {},
                 .prior = {},
                 .readout = {}};
  for (const Eigen::Vector3d& p : known_points()) {
    const int point = static_cast<int>(out.sightings.size());
    out.sightings.push_back({0, point, camera().model.project(pose * p)->px, 0.1});
  }
  return out;
}

// A camera that moves sideways by 15 mm per frame; pose_error: of each pose, per axis.
SceneMap mapped(int frames, double pose_error_m = 0) {
  RandomScene random(3);
  KeyframeMapping mapping(camera());
  const auto pose = [](int i) { return look_at({-0.1 + 0.015 * i, -0.4, 0.45}, {0.01 * i - 0.05, 0, 0}); };
  mapping.start(frame_at(0, pose(0)), known_points(), Eigen::Vector3d::UnitZ(), 1e-4, 1e-8 * Matrix6d::Identity());
  for (int i = 1; i < frames; ++i) {
    PosedFrame frame = frame_at(static_cast<std::uint64_t>(i), pose(i));
    frame.pose.cam_from_world = calib::exp(random.tangent(0, pose_error_m)) * frame.pose.cam_from_world;
    mapping.map(frame);
  }
  return mapping.scene();
}

TEST(KeyframeMapping, PointsLieOnThePlane) {
  const SceneMap map = mapped(14);
  double square = 0, nis = 0;
  int n = 0;
  for (const MapPoint& p : map.points) {
    if (p.given || !p.alive) continue;
    square += p.position.z() * p.position.z();
    nis += p.position.z() * p.position.z() / p.covariance(2, 2);
    ++n;
  }
  EXPECT_GT(n, 30);
  EXPECT_LT(std::sqrt(square / n), 0.006);
  EXPECT_LT(nis / n, 4);
  EXPECT_GT(map.keyframes.size(), 2u);
}

TEST(KeyframeMapping, SeedsNarrowWithTheBaseline) {
  const auto mean_relative_sigma = [](const SceneMap& map) {
    double sum = 0;
    for (const PointSeed& s : map.seeds) sum += s.sigma / s.inverse_depth / static_cast<double>(map.seeds.size());
    return sum;
  };
  const SceneMap first = mapped(1), second = mapped(3);
  ASSERT_GT(first.seeds.size(), 30u);
  EXPECT_GT(mean_relative_sigma(first), 0.4);
  EXPECT_LT(mean_relative_sigma(second), 0.5 * mean_relative_sigma(first));
}

TEST(KeyframeMapping, GivenPointsStay) {
  const SceneMap map = mapped(10);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_TRUE(map.points[i].given);
    EXPECT_LT((map.points[i].position - known_points()[i]).norm(), 1e-3);
  }
}

TEST(KeyframeMapping, ViewsReferToThePointsPixels) {
  for (const SceneMap map = mapped(10); const MapPoint& p : map.points) {
    for (int k = 0; k < p.view_count; ++k) {
      const Keyframe& frame = map.keyframe(p.view(k).keyframe);
      const auto px = project_swept(camera().model, frame.pose(), p.position);
      ASSERT_TRUE(px);
      EXPECT_LT((px->px - p.view(k).px).norm(), 3);
    }
  }
}

TEST(KeyframeMapping, UntrackedFramesChangeNothing) {
  KeyframeMapping mapping(camera());
  const calib::Rigid3d pose = look_at({-0.1, -0.4, 0.45}, {-0.05, 0, 0});
  mapping.start(frame_at(0, pose), known_points(), Eigen::Vector3d::UnitZ(), 1e-4, 1e-8 * Matrix6d::Identity());
  const std::size_t seeds = mapping.scene().seeds.size();
  PosedFrame frame = frame_at(1, look_at({0.1, -0.4, 0.45}, {0.05, 0, 0}));
  frame.tracked = false;
  mapping.map(frame);
  EXPECT_EQ(mapping.scene().keyframes.size(), 1u);
  EXPECT_EQ(mapping.scene().seeds.size(), seeds);
}

TEST(KeyframeMapping, StoredMapsContinue) {
  KeyframeMapping mapping(camera());
  const calib::Rigid3d pose = look_at({-0.1, -0.4, 0.45}, {-0.05, 0, 0});
  mapping.start(frame_at(0, pose), known_points(), Eigen::Vector3d::UnitZ(), 1e-4, 1e-8 * Matrix6d::Identity());
  KeyframeMapping loaded(camera());
  loaded.start(mapping.stored());
  EXPECT_EQ(loaded.scene().points.size(), 4u);
  loaded.map(frame_at(10, look_at({0.05, -0.4, 0.45}, {0.03, 0, 0})));
  EXPECT_EQ(loaded.scene().keyframes.size(), 2u);
}

}  // namespace
}  // namespace huetrack::keyframes
