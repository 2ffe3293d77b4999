// Live calibration without cameras: what it keeps, what it asks for, and what it says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <condition_variable>
#include <cstring>
#include <memory>
#include <mutex>
#include <thread>

#include "calib/gather/image_files.h"
#include "calib/gather/live_boards.h"
#include "calib/gather/live_cameras.h"
#include "calib/gather/view_coverage.h"
#include "end_to_end/process.h"
#include "gather/pictured_rig.h"

namespace huetrack::gather {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

// Which of some pictures all cameras show in their frame 0, 1, ...: the next one when turn() was called. thread-safe.
class Programme {
 public:
  explicit Programme(int pictures) : pictures_(pictures) {}
  void turn() {
    const std::scoped_lock lock(mutex_);
    ++now_;
  }
  // Returns when both cameras have come to this frame: their clocks are the same, as those of real cameras are.
  void meet(std::size_t camera, std::size_t frame, const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    reached_[camera] = frame;
    met_.notify_all();
    met_.wait(lock, stop, [&] { return reached_[0] >= frame && reached_[1] >= frame; });
  }
  std::optional<int> picture_of_frame(std::size_t frame) {  // nullopt: it is over
    const std::scoped_lock lock(mutex_);
    while (shown_.size() <= frame) shown_.push_back(now_);
    return shown_[frame] < pictures_ ? std::optional(shown_[frame]) : std::nullopt;
  }

 private:
  int pictures_;
  std::mutex mutex_;
  int now_ = 0;  // these two guarded by mutex_
  std::vector<int> shown_;
  std::array<std::size_t, 2> reached_{};
  std::condition_variable_any met_;
};

class ShownPictures final : public capture::FrameSource {
 public:
  ShownPictures(std::vector<cv::Mat> pictures, std::shared_ptr<Programme> programme, std::size_t camera)
      : pictures_(std::move(pictures)), programme_(std::move(programme)), camera_(camera) {}
  std::optional<capture::Frame> next(std::stop_token stop) override {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));  // not to fill the memory; nothing depends on it
    programme_->meet(camera_, at_, stop);
    const auto picture_number = programme_->picture_of_frame(at_);
    if (stop.stop_requested() || !picture_number) return std::nullopt;
    const cv::Mat& picture = pictures_[static_cast<std::size_t>(*picture_number)];
    capture::WritableImage image =
        capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, picture.cols, picture.rows);
    std::memcpy(image.data[0], picture.data, picture.total());
    capture::Frame frame;
    frame.camera = static_cast<int>(camera_);
    frame.sequence = static_cast<std::uint32_t>(at_);
    frame.captured_at = capture::Timestamp(capture::duration_of(0.1 * static_cast<double>(at_)));
    frame.pixels = image.image;
    ++at_;
    return frame;
  }

 private:
  std::vector<cv::Mat> pictures_;
  std::shared_ptr<Programme> programme_;
  std::size_t camera_;
  std::size_t at_ = 0;
};

std::vector<LiveCameraSource> shown(const calib::CameraRig& rig, const std::vector<calib::Rigid3d>& poses,
                                    const std::shared_ptr<Programme>& programme) {
  std::vector<LiveCameraSource> cameras;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    std::vector<cv::Mat> pictures;
    for (const calib::Rigid3d& pose : poses) pictures.push_back(picture_of(rig.cameras[c], pictured_board(), pose, c));
    cameras.push_back({rig.cameras[c].name, std::make_unique<ShownPictures>(pictures, programme, c), {}});
  }
  return cameras;
}

TEST(LiveBoards, KeepsViewsOfARestingBoard) {
  calib::CameraRig rig = pictured_rig();
  rig.cameras.resize(2);
  const fs::path page = fs::temp_directory_path() / ("huetrack_page_" + std::to_string(getpid()) + ".html");
  const auto programme = std::make_shared<Programme>(4);
  LiveBoardsOptions options;
  options.progress = false;
  options.page = page;
  options.looked = [&](const std::string& status) {
    if (status.starts_with("kept view")) programme->turn();
  };
  const FoundBoards found =
      gather_live(shown(rig, pictured_poses(4), programme), board::BoardDetector(pictured_board()), options, {});
  // Each of the four places once.
  EXPECT_EQ(found.set_at_s.size(), 4U);
  EXPECT_EQ(found.views.size(), 8U);
  EXPECT_EQ(found.thumbnails.size(), 8U);
  EXPECT_THAT(end_to_end::contents(page), AllOf(HasSubstr("finished with 4 frame sets"), HasSubstr("cam1"),
                                                HasSubstr("data:image/jpeg"), Not(HasSubstr("http-equiv=refresh"))));
  fs::remove(page);
}

TEST(LiveBoards, AsksToHoldABlurredBoardStill) {
  calib::CameraRig rig = pictured_rig();
  rig.cameras.resize(2);
  const auto programme = std::make_shared<Programme>(2);
  std::vector<LiveCameraSource> cameras = shown(rig, {}, programme);
  for (std::size_t c = 0; c < 2; ++c) {
    const cv::Mat still = picture_of(rig.cameras[c], pictured_board(), pictured_poses(1)[0], c);
    cameras[c].source =
        std::make_unique<ShownPictures>(std::vector<cv::Mat>{still, smeared(still, 15, 40)}, programme, c);
  }
  std::vector<std::string> statuses;
  LiveBoardsOptions options;
  options.progress = false;
  options.looked = [&](const std::string& status) {
    if (statuses.empty() || statuses.back() != status) statuses.push_back(status);
    if (status.starts_with("kept view") || status.starts_with("hold it still:")) programme->turn();
  };
  options.seconds = 20;
  gather_live(std::move(cameras), board::BoardDetector(pictured_board()), options, {});
  EXPECT_THAT(statuses, Contains(HasSubstr("hold it still: the board is blurred by motion in cam")));
}

TEST(LiveBoards, NamesACameraWithoutTheBoard) {
  calib::CameraRig rig = pictured_rig();
  rig.cameras.resize(2);
  const auto programme = std::make_shared<Programme>(1);
  auto cameras = shown(rig, pictured_poses(1), programme);
  cameras[1].source =
      std::make_unique<ShownPictures>(std::vector<cv::Mat>{cv::Mat::zeros(240, 320, CV_8UC1)}, programme, 1);
  LiveBoardsOptions options;
  options.progress = false;
  options.looked = [&](const std::string& status) {
    if (status.starts_with("kept view")) programme->turn();
  };
  try {
    gather_live(std::move(cameras), board::BoardDetector(pictured_board()), options, {});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("camera cam1: the board"), HasSubstr("the image is black")));
  }
}

TEST(ViewCoverage, ListsWhatIsMissing) {
  ViewCoverage coverage(pictured_board(), {"left", "right", "back"}, {{320, 240}, {320, 240}, {320, 240}});
  EXPECT_THAT(coverage.needs(), Contains("left has not seen the board yet"));
  const calib::CameraRig rig = pictured_rig();
  const board::Board board = pictured_board();
  const auto view = [&](int c, const calib::Rigid3d& pose) {
    solver::BoardView seen{c, 0, "", {}, {}};
    for (int id = 0; id < board.point_count(); ++id) {
      const auto px = rig.cameras[static_cast<std::size_t>(c)].project_world(pose * board.point(id));
      if (!px || !rig.cameras[static_cast<std::size_t>(c)].contains(*px)) continue;
      seen.ids.push_back(id);
      seen.px.push_back(px->px);
    }
    return seen;
  };
  for (const calib::Rigid3d& pose : pictured_poses(30)) {
    coverage.add({view(0, pose), view(1, pose)});
    EXPECT_FALSE(coverage.is_new({view(0, pose), view(1, pose)}));
  }
  coverage.add({view(1, pictured_poses(1)[0]), view(2, pictured_poses(1)[0])});
  EXPECT_EQ(coverage.shared(0, 1), 30);
  EXPECT_EQ(coverage.shared(2, 1), 1);
  EXPECT_THAT(coverage.needs(), Contains("show it to right and back together: 1 of 10 shared views"));
  EXPECT_THAT(coverage.needs(), Contains("back: 1 of 15 views at different places"));
  EXPECT_THAT(coverage.lines(), HasSubstr("shared views: left + back 0/10, right + back 1/10"));
  EXPECT_THAT(coverage.lines(), HasSubstr("back   views [----------]  1/15  image"));
}

TEST(ViewCoverage, NamesACameraThatIsOutOfFocus) {
  ViewCoverage coverage(pictured_board(), {"left", "right"}, {{320, 240}, {320, 240}});
  const auto add = [&](double left_px, double right_px) {
    coverage.add({{0, 0, "", {}, {}, {}, left_px}, {1, 0, "", {}, {}, {}, right_px}});
  };
  for (int view = 0; view < 5; ++view) add(0.6, view == 2 ? 6 : 0.7);  // moved once
  const auto out_of_focus = Contains(HasSubstr("out of focus"));
  EXPECT_THAT(coverage.needs(), Not(out_of_focus));
  for (int view = 0; view < 7; ++view) add(0.6, 3.2);
  EXPECT_THAT(coverage.needs(), Contains("right is out of focus (edges blurred by 3.2 px, at best 0.6): focus it, and "
                                         "start anew"));
  EXPECT_THAT(coverage.needs(), Not(Contains(HasSubstr("left is out of focus"))));
}

TEST(ImagePairs, MatchByTheLastNumber) {
  const std::vector<std::string> cameras{"left", "right"};
  const auto sets = paired_images(cameras, {{"l/left2.png", "l/left10.png"}, {"r/right10.png", "r/right3.png"}});
  ASSERT_EQ(sets.size(), 3U);
  EXPECT_EQ(sets[0].number, 2);
  EXPECT_FALSE(sets[0].files[1]);
  EXPECT_EQ(sets[2].files[0], fs::path("l/left10.png"));
  EXPECT_EQ(sets[2].files[1], fs::path("r/right10.png"));
  // Numbers that have nothing in common: by their order, if there are as many.
  EXPECT_EQ(paired_images(cameras, {{"a1.png", "a2.png"}, {"b7.png", "b8.png"}}).size(), 2U);
  EXPECT_THROW(paired_images(cameras, {{"a1.png", "a2.png"}, {"b7.png"}}), InputError);
}

TEST(LiveCameras, AreReadFromAServiceConfiguration) {
  const fs::path file = fs::temp_directory_path() / ("huetrack_live_" + std::to_string(getpid()) + ".yaml");
  std::ofstream(file) << "rig: rig.yaml\ncameras:\n  left: {device: 2, size: [640, 480], fps: 30, controls: "
                         "{focus_automatic_continuous: false}}\n"
                         "  right: {device: /dev/v4l/by-path/x, size: [800, 600], format: mjpeg}\n";
  const auto cameras = live_cameras_in(file, {});
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_EQ(cameras[0].device, "/dev/video2");
  EXPECT_EQ(cameras[0].fps, 30);
  EXPECT_EQ(cameras[0].controls.at(0).name, "focus_automatic_continuous");
  EXPECT_EQ(cameras[1].width, 800);
  EXPECT_EQ(cameras[1].format, capture::CaptureFormat::mjpeg);
  fs::remove(file);
  EXPECT_THROW(live_cameras(std::vector<std::string>{"/dev/video0"}, {.size = calib::ImageSize{640, 480}}), InputError);
  EXPECT_TRUE(are_devices(std::vector<std::string>{"a=/dev/video0", "/dev/video1"}));
  EXPECT_FALSE(are_devices(std::vector<std::string>{"a=x.mp4", "b=/dev/video1"}));
}

}  // namespace
}  // namespace huetrack::gather
