#include "pictures/pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "pictures/camera_pictures.h"
#include "pictures/canvas_image.h"

namespace huetrack::pictures {
namespace {

namespace fs = std::filesystem;

// How many pixels of the picture are about of this colour (BGR).
int count_near(const cv::Mat& picture, cv::Vec3b color, int tolerance = 30) {
  int count = 0;
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      const auto p = picture.at<cv::Vec3b>(v, u);
      bool near = true;
      for (int i = 0; i < 3; ++i) near &= std::abs(int(p[i]) - int(color[i])) <= tolerance;
      count += near ? 1 : 0;
    }
  }
  return count;
}

TEST(WritePng, NamesTheReason) {
  const cv::Mat picture(48, 64, CV_8UC3, cv::Scalar(10, 20, 30));
  const auto error_of = [&](const fs::path& file) {
    try {
      write_png(file, picture);
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(error_of("/dev/full"), "cannot write /dev/full: No space left on device");
  EXPECT_EQ(error_of("/nowhere/a.png"), "cannot write /nowhere/a.png: No such file or directory");
  const fs::path file = fs::path(testing::TempDir()) / "write_png.png";
  EXPECT_EQ(error_of(file), "");
  EXPECT_EQ(cv::norm(cv::imread(file.string()), picture), 0);
  fs::remove(file);
}

TEST(BgrOf, FollowsBt601InBothRanges) {
  struct Case {
    capture::Yuv yuv;
    capture::ColorRange range;
    cv::Vec3b bgr;
  };
  const Case cases[] = {
      {{16, 128, 128}, capture::ColorRange::limited, {0, 0, 0}},
      {{235, 128, 128}, capture::ColorRange::limited, {255, 255, 255}},
      {{81, 90, 240}, capture::ColorRange::limited, {0, 0, 255}},
      {{145, 54, 34}, capture::ColorRange::limited, {0, 255, 0}},
      {{76, 85, 255}, capture::ColorRange::full, {0, 0, 255}},
      {{255, 128, 128}, capture::ColorRange::full, {255, 255, 255}},
  };
  for (const auto& c : cases) {
    capture::WritableImage image = capture::make_image(capture::PixelFormat::i444, c.range, 1, 1);
    *image.data[0] = c.yuv.y;
    *image.data[1] = c.yuv.u;
    *image.data[2] = c.yuv.v;
    const auto got = bgr_of(image.image).at<cv::Vec3b>(0, 0);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(got[i], c.bgr[i], 2);
  }
  capture::WritableImage bgr = capture::make_image(capture::PixelFormat::bgr, capture::ColorRange::full, 1, 1);
  bgr.data[0][0] = 1;
  bgr.data[0][1] = 2;
  bgr.data[0][2] = 3;
  EXPECT_EQ(bgr_of(bgr.image).at<cv::Vec3b>(0, 0), cv::Vec3b(1, 2, 3));
}

class CameraPictures : public testing::Test {
 protected:
  CameraPictures() {
    camera_.name = "cam0";
    camera_.image_size = {320, 240};
    camera_.model = calib::CameraModel(calib::PinholeRadtan{.fx = 250, .fy = 250, .cx = 160, .cy = 120});
    job_.frame.pixels = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 320, 240).image;
    job_.estimate.state = camera_tracking::PoseState::tracking;
    job_.estimate.world_from_camera = {Eigen::Quaterniond::Identity(), {0, 0, -1}};
    job_.estimate.covariance.setIdentity();
    plane_.origin = {0.2, 0.1, 0};  // the start lies aside of the world's origin
  }
  calib::Camera camera_;
  StartPlane plane_;
  CameraPictureJob job_;
};

TEST_F(CameraPictures, TheAxesStandAtTheWorldsOrigin) {
  // x runs to the right from the middle of the right picture, y down.
  const cv::Mat picture = draw_camera(camera_, plane_, job_);
  const cv::Point middle(2 * 14 + 720 + 361, 44 + 28 + 271);
  EXPECT_GT(count_near(picture(cv::Rect(middle + cv::Point(10, -2), cv::Size(20, 5))), {52, 64, 235}), 40);
  EXPECT_GT(count_near(picture(cv::Rect(middle + cv::Point(-2, 10), cv::Size(5, 20))), {70, 200, 70}), 40);
}

TEST_F(CameraPictures, RegionsAreDrawnOnlyWithAPose) {
  camera_tracking::CameraTrackerInside::Feature& feature = job_.inside.features.emplace_back();
  feature.px = {100, 100};
  feature.found_px.setConstant(std::nanf(""));
  feature.search = 20 * Eigen::Matrix2f::Identity();
  feature.position.setZero();
  feature.covariance.setZero();
  const cv::Rect left(14, 72, 720, 540);
  EXPECT_GT(count_near(draw_camera(camera_, plane_, job_)(left), {88, 96, 255}), 20);
  job_.estimate.state = camera_tracking::PoseState::lost;
  EXPECT_EQ(count_near(draw_camera(camera_, plane_, job_)(left), {88, 96, 255}), 0);
}

TEST_F(CameraPictures, TheMapIsAllOfIt) {
  std::vector<camera_tracking::CameraMapPoint> map;
  const auto drawn = [&] {
    return count_near(draw_camera_map(camera_, plane_, "", {job_.estimate}, map), {160, 90, 40});
  };
  const int none = drawn();
  for (int i = 0; i < 30; ++i) {
    map.emplace_back().position = {0.01 * i, 0.1, -0.3};
    map.back().covariance = 1e-6 * Eigen::Matrix3d::Identity();
    map.back().state = camera_tracking::CameraMapPoint::State::not_sought;
  }
  EXPECT_GT(drawn(), none + 30 * 8);
}

class Pictures : public testing::Test {
 protected:
  Pictures() {
    for (std::size_t c = 0; c < config_.rig.cameras.size(); ++c) {
      const auto size = config_.rig.cameras[c].image_size;
      capture::Frame frame;
      frame.camera = int(c);
      frame.pixels =
          capture::make_image(capture::PixelFormat::bgr, capture::ColorRange::full, size.width, size.height).image;
      job_.set.frames.emplace_back(frame);
    }
    object_tracking::ObjectEstimate& estimate = job_.estimates.emplace_back();
    estimate.state = object_tracking::TrackState::tracking;
    estimate.position = {0.1, 0.2, 1};
    estimate.velocity.setZero();
    estimate.covariance = Eigen::Matrix3d::Identity() * 1e-4;
    job_.particles.resize(1);
  }
  const config::ServiceConfig config_ =
      config::load_service_config(fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/huetrackd.yaml");
  PictureJob job_;
};

TEST_F(Pictures, ParticlesAreDrawnWhereTheyProject) {
  const cv::Mat without = draw_views(config_, job_);
  const int before = count_near(without, {64, 255, 160}, 60);
  for (int i = 0; i < 100; ++i) job_.particles[0].emplace_back(-0.8f + 0.016f * float(i), 0.5f, 0.5f);
  const cv::Mat with = draw_views(config_, job_);
  EXPECT_EQ(without.size(), with.size());
  EXPECT_GT(count_near(with, {64, 255, 160}, 60), before + 300);
}

TEST_F(Pictures, AViewWithoutAFrameAndATargetWithoutAPositionAreDrawnAsSuch) {
  job_.set.frames[1].reset();
  job_.estimates[0] = object_tracking::ObjectEstimate{};
  job_.estimates[0].state = object_tracking::TrackState::lost;
  const cv::Mat picture = draw_views(config_, job_);
  EXPECT_GT(count_near(picture, {88, 96, 255}), 50);  // the word "lost"
  EXPECT_FALSE(picture.empty());
}

TEST_F(Pictures, TheTrackIsDrawnWithAndWithoutTruthAndEvenWhenEmpty) {
  const tracks::Truth truth =
      tracks::Truth::read(fs::path(HUETRACK_SOURCE_DIR) / "configs/demo/recording/groundtruth.csv");
  std::vector<std::vector<object_tracking::ObjectEstimate>> tracks(1);
  EXPECT_FALSE(draw_track_3d(config_, "empty", tracks, nullptr).empty());
  const int without_track = count_near(draw_track_3d(config_, "empty", tracks, &truth), {0, 150, 232});
  for (const auto& sample : truth.targets().at("lime")) {
    object_tracking::ObjectEstimate e = job_.estimates[0];
    e.at = sample.at;
    e.position = sample.position + Eigen::Vector3d(0, 0, 0.1);
    e.state = object_tracking::TrackState::coasting;
    tracks[0].push_back(e);
  }
  EXPECT_GT(count_near(draw_track_3d(config_, "coasting", tracks, &truth), {0, 130, 232}), without_track + 1000);
}

TEST_F(Pictures, AreWrittenAsPng) {
  const fs::path folder = fs::path(testing::TempDir()) / "huetrack_pictures_test/sub";
  PictureWriter writer(config_, folder);
  job_.set.number = 42;
  writer.write(job_);
  EXPECT_EQ(writer.written(), 1u);
  const cv::Mat read = cv::imread((folder / "set_000042.png").string());
  EXPECT_EQ(read.size(), draw_views(config_, job_).size());
  fs::remove_all(folder.parent_path());
}

TEST_F(Pictures, AFolderThatCannotBeMadeIsNamed) {
  EXPECT_THAT([&] { PictureWriter(config_, "/proc/nowhere"); },
              testing::ThrowsMessage<std::runtime_error>(testing::HasSubstr("/proc/nowhere")));
}

}  // namespace
}  // namespace huetrack::pictures
