// The building blocks of the camera trackers, each in a small synthetic scene.
#include <gmock/gmock.h>
#include <unistd.h>

#include <Eigen/LU>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "camera_tracking/drawn_rectangle.h"
#include "camera_tracking/ncc.h"
#include "camera_tracking/observation_field.h"
#include "camera_tracking/parallel_task.h"
#include "camera_tracking/pose_particles.h"
#include "camera_tracking/pose_solver.h"
#include "camera_tracking/rectangle_finder.h"
#include "camera_tracking/scene_map.h"
#include "camera_tracking/template_patch.h"
#include "particle_filter/random.h"

namespace huetrack::camera_tracking {
namespace {

// A smooth random texture: value at any place.
double texture(double x, double y) {
  return 128 + 45 * std::sin(0.9 * x + 0.4 * y) + 35 * std::sin(0.35 * x - 0.8 * y + 1) +
         30 * std::sin(0.15 * x * y * 0.05 + 0.5 * y);
}
GreyImage textured(int width, int height, double du = 0, double dv = 0) {
  std::uint8_t* px = nullptr;
  GreyImage image = make_grey(width, height, px);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u)
      px[v * width + u] = static_cast<std::uint8_t>(std::lround(std::clamp(texture(u - du, v - dv), 0.0, 255.0)));
  }
  return image;
}
NccTemplate cut(const GreyImage& image, int u, int v, int side) {
  NccTemplate t;
  t.side = side;
  const int before = (side - 1) / 2;
  for (int j = 0; j < side; ++j)
    t.pixels.insert(t.pixels.end(), image.row(v - before + j) + u - before,
                    image.row(v - before + j) + u - before + side);
  t.finish();
  return t;
}

// Reference implementation for one anchor.
float ncc_reference(const GreyImage& image, const NccTemplate& t, int u, int v) {
  const int before = (t.side - 1) / 2;
  const double n = t.side * t.side;
  double si = 0, st = 0;
  for (int j = 0; j < t.side; ++j) {
    for (int i = 0; i < t.side; ++i) {
      si += image.row(v - before + j)[u - before + i];
      st += t.pixels[static_cast<std::size_t>(j * t.side + i)];
    }
  }
  double cross = 0, ii = 0, tt = 0;
  for (int j = 0; j < t.side; ++j) {
    for (int i = 0; i < t.side; ++i) {
      const double a = image.row(v - before + j)[u - before + i] - si / n;
      const double b = t.pixels[static_cast<std::size_t>(j * t.side + i)] - st / n;
      cross += a * b, ii += a * a, tt += b * b;
    }
  }
  return ii <= 0.25 * n || tt < 0.25 * n ? 0.0f : static_cast<float>(cross / std::sqrt(ii * tt));
}

TEST(Ncc, FieldMatchesTheReference) {
  const GreyImage a = textured(70, 50), b = textured(70, 50, 3, 2);
  for (const int side : {8, 11}) {
    const NccTemplate t = cut(a, 30, 25, side);
    const PixelRegion region = clip({-5, 10, 90, 44}, b, side);
    std::vector<float> field;
    ncc_field(b, t, region, field);
    for (int v = region.v0; v <= region.v1; ++v) {
      for (int u = region.u0; u <= region.u1; ++u)
        ASSERT_NEAR(field[static_cast<std::size_t>((v - region.v0) * region.width() + u - region.u0)],
                    ncc_reference(b, t, u, v), 2e-5f)
            << u << ' ' << v;
    }
    const NccPeak peak = best_of(field, region);
    EXPECT_EQ(peak.u, 33);
    EXPECT_EQ(peak.v, 27);
    EXPECT_GT(peak.rho, 0.98f);
  }
}

TEST(Ncc, FlatImagesDoNotCorrelate) {
  std::uint8_t* px = nullptr;
  const GreyImage flat = make_grey(40, 40, px);
  std::vector<float> field;
  ncc_field(flat, cut(textured(40, 40), 20, 20, 8), clip({0, 0, 39, 39}, flat, 8), field);
  EXPECT_THAT(field, testing::Each(0.0f));
  EXPECT_EQ(cut(flat, 20, 20, 8).norm, 0.0f);
}

TEST(PoseParticles, ProjectsAsTheCameraModel) {
  const calib::Camera c = camera();
  const calib::Rigid3d pose = look_at({0.3, -0.5, 0.4}, {0, 0, 0});
  PoseParticles particles(100, pose);
  particle_filter::Rng rng(1);
  particles.walk_normal(0.02f, 0.01f, rng);
  std::vector<float> u(100), v(100);
  const Eigen::Vector3d point(0.1, 0.05, 0.02);
  particles.project(calib::BatchProjector(c), point, u, v);
  for (std::size_t i = 0; i < 100; ++i) {
    const auto px = c.model.project(particles.pose(i) * point);
    ASSERT_TRUE(px);
    EXPECT_NEAR(u[i], px->px.x(), 2e-3);
    EXPECT_NEAR(v[i], px->px.y(), 2e-3);
  }
}

TEST(PoseParticles, WalksHaveTheGivenWidth) {
  const calib::Rigid3d pose = look_at({0.3, -0.5, 0.4}, {0, 0, 0});
  PoseParticles particles(4000, pose);
  particle_filter::Rng rng(2);
  particles.walk_uniform(0.03f, 0.02f, rng);
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Eigen::Vector3d moved = calib::inverse(particles.pose(i)).translation - calib::inverse(pose).translation;
    ASSERT_LT(moved.cwiseAbs().maxCoeff(), 0.0201);
  }
  const Covariance6d uniform = particles.covariance(particles.mean());
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(uniform(k, k), 0.02 * 0.02 / 3, 0.1 * 0.02 * 0.02 / 3);
    EXPECT_NEAR(uniform(3 + k, 3 + k), 0.03 * 0.03 / 3, 0.1 * 0.03 * 0.03 / 3);
  }
  particles.reset(4000, pose);
  particles.walk_normal(0.01f, 0.005f, rng);
  const Covariance6d normal = particles.covariance(particles.mean());
  EXPECT_NEAR(normal(1, 1), 0.005 * 0.005, 0.1 * 0.005 * 0.005);
  EXPECT_NEAR(normal(4, 4), 0.01 * 0.01, 0.1 * 0.01 * 0.01);
}

TEST(ObservationField, ScoresParticlesNearAPeak) {
  const GreyImage image = textured(80, 60);
  ObservationField field;
  field.correlate(image, cut(image, 40, 30, 11), {30, 20, 50, 40});
  field.mark(0.98f, 2.0f);
  const std::vector<float> u{40, 41.4f, 43.2f, 40, -1e9f}, v{30, 31.0f, 30, 26, 0};
  std::vector<float> score(5, 0.0f);
  field.score(u, v, true, score);
  EXPECT_THAT(score, testing::ElementsAre(1, 1, 0, 0, 0));  // eqs. (5), (6)
  field.threshold(0.98f);
  const std::vector<float> ru{44}, rv{30}, rw{1};
  field.reweight(ru, rv, rw, 2.0f);  // eq. (7): no particle is near the peak
  EXPECT_EQ(field.strongest(40, 30, 1, 0).rho, 0.0f);
}

TEST(TemplatePatch, RefinesToSubPixels) {
  const Pyramid source{{textured(120, 90)}};
  WarpedPatch patch;
  ASSERT_TRUE(warp_patch(source, {60, 45}, Eigen::Matrix2d::Identity(), 0, 8, patch));
  const GreyImage moved = textured(120, 90, 0.37, -0.21);
  const auto found = refine(moved, patch, {60, 45});
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->px.x(), 60.37, 0.02);
  EXPECT_NEAR(found->px.y(), 44.79, 0.02);
  EXPECT_GT(found->ncc, 0.99f);
}

TEST(TemplatePatch, TransfersPatchesOfAPlane) {
  const calib::Camera c = camera();
  const calib::Rigid3d first = look_at({0, -0.5, 0.5}, {0, 0, 0}), second = look_at({0.2, -0.45, 0.5}, {0, 0, 0});
  const Eigen::Vector3d point(0.05, 0.03, 0);
  const Eigen::Vector3d in_first = first * point, normal = first.rotation * Eigen::Vector3d::UnitZ();
  const auto view = transfer_patch(c.model, c.model.project(in_first)->px,
                                   plane_homography(second * calib::inverse(first), normal, normal.dot(in_first)));
  ASSERT_TRUE(view);
  EXPECT_LT((view->px - c.model.project(second * point)->px).norm(), 1e-6);
  const Eigen::Vector3d beside = point + Eigen::Vector3d(0.002, 0.001, 0);  // on the plane
  const Eigen::Vector2d d0 = c.model.project(first * beside)->px - c.model.project(in_first)->px;
  const Eigen::Vector2d d1 = c.model.project(second * beside)->px - view->px;
  EXPECT_LT((view->affine * d0 - d1).norm(), 0.02 * d1.norm());
}

TEST(PoseSolver, SolvesPlanarAndSpatialPoints) {
  const calib::Camera c = camera();
  const calib::Rigid3d truth = look_at({0.2, -0.5, 0.45}, {0, 0, 0});
  for (const double height : {0.0, 0.1}) {
    std::vector<PoseObservation> seen;
    for (int i = 0; i < 12; ++i) {
      const Eigen::Vector3d p(0.1 * std::cos(i), 0.08 * std::sin(2.0 * i), i % 3 == 0 ? height : 0);
      seen.push_back({p, c.model.project(truth * p)->px, 0.5});
    }
    if (height > 0) seen[5].px += Eigen::Vector2d(30, 10);  // one is wrong
    const auto fit = solve_pose(c.model, seen);
    ASSERT_TRUE(fit);
    EXPECT_LT(calib::log(fit->cam_from_world * calib::inverse(truth)).norm(), 1e-4);
    if (height > 0) {
      EXPECT_EQ(fit->weight[5], 0);
    }
  }
}

TEST(PoseSolver, RansacToleratesHalfOutliers) {
  const calib::Camera c = camera();
  const calib::Rigid3d truth = look_at({0.2, -0.5, 0.45}, {0, 0, 0});
  particle_filter::Rng rng(5);
  std::vector<PoseObservation> seen;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d p(0.3 * rng.uniform() - 0.15, 0.3 * rng.uniform() - 0.15, 0.1 * rng.uniform());
    seen.push_back(
        {p, i % 2 ? Eigen::Vector2d(320 * rng.uniform(), 240 * rng.uniform()) : c.model.project(truth * p)->px, 1});
  }
  const auto fit = solve_pose_ransac(c.model, seen, 3, 12, 9);
  ASSERT_TRUE(fit);
  EXPECT_LT(calib::log(fit->cam_from_world * calib::inverse(truth)).norm(), 1e-3);
  for (auto& s : seen) s.px = {320 * rng.uniform(), 240 * rng.uniform()};
  EXPECT_FALSE(solve_pose_ransac(c.model, seen, 3, 12, 9));
}

TEST(PoseSolver, WorldCovarianceMatchesPerturbedPoses) {
  const calib::Rigid3d pose = look_at({0.2, -0.5, 0.45}, {0, 0, 0});
  calib::Tangent6d small;
  small << 1e-4, -2e-4, 3e-4, 2e-4, 1e-4, -3e-4;
  const calib::Rigid3d a = calib::inverse(pose), b = calib::inverse(calib::exp(small) * pose);
  Eigen::Matrix<double, 6, 1> e;
  const Eigen::AngleAxisd turn(b.rotation * a.rotation.inverse());
  e << b.translation - a.translation, turn.angle() * turn.axis();
  const Covariance6d expected = e * e.transpose();
  EXPECT_LT((world_covariance(pose, small * small.transpose()) - expected).norm(), 1e-2 * expected.norm());
}

TEST(RectangleFinder, MeasuresADrawnRectangle) {
  const calib::Camera c = camera();
  const calib::Rigid3d truth = look_at({0.05, -0.35, 0.42}, {0, 0, 0});
  const calib::Rigid3d back = calib::inverse(truth);
  const GreyImage image = view_of_rectangle(c, truth);
  const std::vector<Eigen::Vector3d> corners = rectangle_corners();
  const auto found = find_rectangle(image, c.model, corners);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->dark);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT((found->corners.px[i] - c.model.project(truth * corners[i])->px).norm(), 0.12) << i;
  EXPECT_LT((calib::inverse(found->pose.cam_from_world).translation - back.translation).norm(), 0.002);
  std::vector<Eigen::Vector3d> other = corners;
  for (auto& p : other) p.x() *= 2;
  EXPECT_FALSE(find_rectangle(image, c.model, other));  // another shape
}

class MapFile : public testing::Test {
 protected:
  MapFile() {
    std::filesystem::create_directories(folder);
    stored.image_size = {80, 64};
    stored.map.keyframes.push_back(
        {std::make_shared<const Pyramid>(make_pyramid(textured(80, 64))), look_at({0, -0.5, 0.4}, {0, 0, 0})});
    MapPoint p;
    p.position = {1, 2, 3}, p.given = true, p.view_count = 1;
    p.views[0].keyframe = 0, p.views[0].px = {40, 30};
    stored.map.points.push_back(p);
    stored.sightings.push_back({0, 0, {40, 30}, 0.5});
  }
  ~MapFile() override { std::filesystem::remove_all(folder); }
  std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("huetrack_map_test_" + std::to_string(::getpid()));
  std::filesystem::path file = folder / "a.map";
  StoredMap stored;
};

TEST_F(MapFile, RoundTrips) {
  write_map(file, stored);
  const StoredMap back = read_map(file);
  ASSERT_EQ(back.map.points.size(), 1u);
  EXPECT_EQ(back.map.points[0].position, stored.map.points[0].position);
  EXPECT_TRUE(back.map.points[0].given);
  EXPECT_TRUE(back.map.points[0].views[0].has_descriptor);
  EXPECT_EQ(back.map.keyframes[0].cam_from_world.translation, stored.map.keyframes[0].cam_from_world.translation);
  EXPECT_EQ(back.map.keyframes[0].pyramid->levels[0].row(20)[33],
            stored.map.keyframes[0].pyramid->levels[0].row(20)[33]);
  EXPECT_EQ(back.sightings[0].px, stored.sightings[0].px);
}

TEST_F(MapFile, KeepsTheSweepOfKeyFrames) {
  Keyframe& k = stored.map.keyframes[0];
  k.sweep.motion << 0.01, -0.03, 0.002, 0.004, 0, -0.001;
  k.sweep.bend << 0.001, 0, 0, 0, 0.002, 0;
  k.sweep.last_row = 63;
  write_map(file, stored);
  const StoredMap back = read_map(file);
  for (const double row : {0.0, 20.0, 63.0}) {
    const calib::Rigid3d off = k.pose().at(row) * calib::inverse(back.map.keyframes[0].pose().at(row));
    EXPECT_LT(calib::log(off).norm(), 1e-12);
  }
}

TEST_F(MapFile, ReportsDamage) {
  write_map(file, stored);
  std::string bytes;
  {
    std::ifstream in(file, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  const auto error_of = [&](const std::string& content) -> std::string {
    std::ofstream(file, std::ios::binary | std::ios::trunc) << content;
    try {
      read_map(file);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(error_of(bytes.substr(0, bytes.size() - 3)), testing::HasSubstr("a.map: is damaged or cut off"));
  std::string other = bytes;
  other[bytes.size() / 2] ^= 1;
  EXPECT_THAT(error_of(other), testing::HasSubstr("check sum"));
  EXPECT_THAT(error_of("hello"), testing::HasSubstr("is not a camera map"));
  EXPECT_THROW(read_map(folder / "none.map"), std::runtime_error);
  EXPECT_THROW(write_map(folder / "no folder" / "a.map", stored), std::runtime_error);
}

TEST(ParallelTask, WaitFinishesEachTask) {
  ParallelTask task;
  int sum = 0;
  for (int i = 0; i < 200; ++i) {
    task.start([&sum, i] { sum += i; });
    task.wait();
  }
  EXPECT_EQ(sum, 199 * 100);
}

}  // namespace
}  // namespace huetrack::camera_tracking
