// huetrack-calibrate as a user runs it: on good pictures, and on everything that goes wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <sstream>

#include "calib/board/board_yaml.h"
#include "calib/model/rig_yaml.h"
#include "end_to_end/process.h"
#include "gather/pictured_rig.h"

namespace huetrack::program {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

struct Ended {
  int status = -1;
  std::string out, err;
};

// What a reader copies out of the documents must be there, and a command without a folder is about the reader's own
// file.
TEST(Documents, CommandsNameExistingFiles) {
  for (const char* document : {"calib/tutorial.md", "calib/reference.md", "calib/README.md", "README.md"}) {
    const fs::path project = HUETRACK_SOURCE_DIR;
    const std::string text = end_to_end::contents(project / document);
    ASSERT_FALSE(text.empty()) << document;
    for (std::size_t at = text.find("huetrack-calibrate "); at != std::string::npos;
         at = text.find("huetrack-calibrate ", at + 1)) {
      std::istringstream command(text.substr(at, text.find_first_of("`\n", at) - at));
      for (std::string word; command >> word;) {
        EXPECT_NE(word, "huetrackd.yaml") << document << ": no such file is in the project's folder: " << command.str();
        if (!word.starts_with("configs/")) continue;
        EXPECT_TRUE(fs::exists(project / word)) << document << ": " << word;
      }
    }
  }
}

class Calibrate : public testing::Test {
 protected:
  Calibrate() {
    folder_ = fs::temp_directory_path() / ("huetrack_calibrate_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    std::ofstream(folder_ / "board.yaml") << board::to_yaml(gather::pictured_board());
  }
  ~Calibrate() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  Ended run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), HUETRACK_CALIBRATE);
    end_to_end::Process process(arguments, folder_ / "out", folder_ / "err");
    Ended run;
    run.status = process.wait();
    run.out = process.out();
    run.err = process.err();
    return run;
  }
  Ended extrinsics(const std::string& pictures, const std::string& rig = "rig.yaml",
                   std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments{"extrinsics", "--board", path("board.yaml"), "--lens",
                                       "radtan4",    "--rig",   path(rig)};
    if (!pictures.empty()) arguments.push_back(path(pictures));
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }

  // The rig is of the other cameras, doubtful, and the report says of this one why it is not in it.
  void expect_left_out(const Ended& result, const std::string& camera, const testing::Matcher<std::string>& why) const {
    EXPECT_EQ(result.status, 2) << result.out << result.err;
    EXPECT_THAT(result.out, AllOf(HasSubstr("DOUBTFUL"), HasSubstr(camera + " is left out"), why));
    EXPECT_THAT(end_to_end::contents(path("rig.report.txt")), why);
    std::vector<std::string> others{"cam0", "cam1", "cam2"};
    std::erase(others, camera);
    EXPECT_EQ(calib::read_rig(path("rig.yaml")).camera_names(), others);
    fs::remove(path("rig.yaml"));
  }

  fs::path folder_;
};

TEST_F(Calibrate, GoodImagesGiveTheRig) {
  const calib::CameraRig truth = gather::pictured_rig();
  gather::write_pictures(folder_ / "pictures", truth, gather::pictured_poses(16));
  const Ended first = extrinsics("pictures");
  EXPECT_EQ(first.status, 0) << first.out << first.err;
  EXPECT_THAT(first.out, AllOf(HasSubstr("USABLE"), HasSubstr("tape measure"), HasSubstr("Expected accuracy")));
  const calib::CameraRig found = calib::read_rig(path("rig.yaml"));
  EXPECT_LT(solver::volume_rms_m(truth, found, {-0.4, -0.4, 0.5}, {0.4, 0.4, 1.3}), 0.002);
  // As the cameras are held: level.
  for (std::size_t c = 0; c < 3; ++c) {
    const Eigen::Vector3d right = found.cameras[c].cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitX();
    EXPECT_NEAR(right.z(), 0, 0.01) << c;
  }
  const std::string report = end_to_end::contents(path("rig.report.html"));
  for (const char* part : {"Usable", "data:image/jpeg", "cam1"})
    EXPECT_NE(report.find(part), std::string::npos) << part;
  EXPECT_EQ(report.find("http"), std::string::npos);  // self-contained
  EXPECT_THAT(end_to_end::contents(path("rig.report.txt")), HasSubstr("USABLE"));
  EXPECT_THAT(end_to_end::contents(path("rig.yaml")),
              AllOf(HasSubstr("made_by"), HasSubstr("huetrack-calibrate"), HasSubstr("verdict: \"usable\"")));

  // Once more: the same bytes, but for the time of day.
  const auto timeless = [&] {
    const std::string text = end_to_end::contents(path("rig.yaml"));
    const std::size_t at = text.find("  at: ");
    return text.substr(0, at) + text.substr(text.find('\n', at));
  };
  const std::string bytes = timeless();
  EXPECT_EQ(extrinsics("pictures", "rig.yaml", {"--temperature", "21.5"}).status, 0);
  EXPECT_THAT(timeless(), HasSubstr("temperature_c: 21.5"));
  EXPECT_EQ(extrinsics("pictures").status, 0);
  EXPECT_EQ(timeless(), bytes);
  EXPECT_TRUE(end_to_end::contents(path("rig.report.html")) == report);

  // It fits its own pictures; a camera that was bumped is named.
  ASSERT_TRUE(found.uncertainty);
  Ended check = run({"check", path("rig.yaml"), path("pictures"), "--board", path("board.yaml"), "--note"});
  EXPECT_EQ(check.status, 0) << check.out << check.err;
  EXPECT_THAT(check.out, AllOf(HasSubstr("FITS"), HasSubstr("calibrated less than 2 minutes ago")));
  const calib::CameraRig noted = calib::read_rig(path("rig.yaml"));
  ASSERT_EQ(noted.made.checks.size(), 1u);
  EXPECT_EQ(noted.made.checks.front().verdict, "usable");
  EXPECT_EQ(calib::rig_identity(noted), calib::rig_identity(found));

  const Ended map = run({"map", path("rig.yaml"), "--report", path("map.html")});
  EXPECT_EQ(map.status, 0) << map.out << map.err;
  EXPECT_THAT(map.out, AllOf(HasSubstr("the calibration contributes"), HasSubstr("Where to put the next camera")));
  EXPECT_THAT(end_to_end::contents(path("map.html")), HasSubstr("<svg"));
  EXPECT_THAT(end_to_end::contents(path("map.pdf")), testing::StartsWith("%PDF-"));
  const Ended again = run({"map", path("rig.yaml"), "--report", path("map")});  // .html is added
  EXPECT_EQ(again.status, 0) << again.err;
  EXPECT_FALSE(std::filesystem::exists(path("map")));
  std::ofstream(path("notes.pdf")) << "experiment 7 FAILED";
  const Ended refused = run({"map", path("rig.yaml"), "--report", path("notes.html")});
  EXPECT_NE(refused.status, 0);
  EXPECT_THAT(refused.err, HasSubstr("notes.pdf exists and holds no PDF"));
  EXPECT_EQ(end_to_end::contents(path("notes.pdf")), "experiment 7 FAILED");
  EXPECT_FALSE(std::filesystem::exists(path("notes.html"))) << "half of a report";
  calib::CameraRig bumped = found;
  const calib::Rigid3d bump = calib::exp((calib::Tangent6d() << 0.01, 0.02, -0.01, 0.03, 0, 0.01).finished());
  bumped.cameras[1].cam_from_world = bump * bumped.cameras[1].cam_from_world;
  calib::write_rig(bumped, path("bumped.yaml"));
  check = run(
      {"check", path("bumped.yaml"), path("pictures"), "--board", path("board.yaml"), "--mend", path("mended.yaml")});
  EXPECT_EQ(check.status, 1) << check.out << check.err;
  EXPECT_THAT(check.out, AllOf(HasSubstr("DOES NOT FIT"), HasSubstr("cam1: was moved by"), HasSubstr("cam0: unchanged"),
                               HasSubstr("cam2: unchanged")));
  EXPECT_LT(solver::volume_rms_m(truth, calib::read_rig(path("mended.yaml")), {-0.4, -0.4, 0.5}, {0.4, 0.4, 1.3}),
            0.003);
}

// The checks and the age of the old rig do not apply to the new one.
TEST_F(Calibrate, AnAcceptedRigCountsAsNotChecked) {
  calib::CameraRig knocked = gather::pictured_rig();
  knocked.made.at = calib::utc_time("2026-03-01T08:00:00Z");
  knocked.made.add({*calib::utc_time("2026-03-02T08:00:00Z"), "failed", "cam1: was moved"});
  calib::CameraRig mended = knocked;
  const calib::Rigid3d knock = calib::exp((calib::Tangent6d() << 0, 0.02, 0, 0, 0, 0).finished());
  mended.cameras[1].cam_from_world = knock * mended.cameras[1].cam_from_world;
  calib::write_rig(knocked, path("rig.yaml"));
  calib::write_rig(mended, path("rig.mended.yaml"));
  const Ended accepted = run({"accept", path("rig.yaml")});
  EXPECT_EQ(accepted.status, 0) << accepted.err;
  EXPECT_THAT(accepted.out, HasSubstr("cam1: turned by 1.15 degrees"));
  EXPECT_FALSE(fs::exists(path("rig.mended.yaml")));
  const calib::CameraRig now = calib::read_rig(path("rig.yaml"));
  EXPECT_EQ(now.made.at, knocked.made.at);
  ASSERT_EQ(now.made.checks.size(), 2u);
  EXPECT_EQ(now.made.checks[1].verdict, calib::mended_verdict);
  EXPECT_THAT(now.made.text(now.made.checks[1].at),
              testing::EndsWith("mended less than 2 minutes ago, not checked since"));
  EXPECT_THAT(now.made.checks[1].text, HasSubstr("mended by huetrackd: cam1: turned by 1.15 degrees"));
  EXPECT_GT(now.made.checks[1].at, now.made.checks[0].at);
}

// It lay there since before the cameras were calibrated anew.
TEST_F(Calibrate, RejectsAMendedRigOfAnEarlierCalibration) {
  calib::CameraRig mended = gather::pictured_rig();
  mended.cameras[1].cam_from_world.translation.x() += 0.01;
  calib::CameraRig anew = gather::pictured_rig();
  anew.made.at = calib::utc_time("2026-04-01T08:00:00Z");
  for (const char* made : {"2026-03-01T08:00:00Z", ""}) {
    mended.made.at = calib::utc_time(made);
    calib::write_rig(mended, path("rig.mended.yaml"));
    calib::write_rig(anew, path("rig.yaml"));
    const std::string before = end_to_end::contents(path("rig.yaml"));
    const Ended refused = run({"accept", path("rig.yaml")});
    EXPECT_NE(refused.status, 0) << refused.out;
    EXPECT_THAT(refused.err, AllOf(HasSubstr("out of date"), HasSubstr("2026-04-01T08:00:00Z")));
    EXPECT_EQ(end_to_end::contents(path("rig.yaml")), before);
    EXPECT_TRUE(fs::exists(path("rig.mended.yaml")));
  }
}

TEST_F(Calibrate, KeepsTheWorldOfThePreviousRig) {
  const calib::CameraRig truth = gather::pictured_rig();
  gather::write_pictures(folder_ / "pictures", truth, gather::pictured_poses(16));
  // The true rig is the one that is there, its world the one that was set; one camera was moved since.
  calib::CameraRig before = truth;
  before.made_by = {{"world", "the board on the floor"}};
  before.cameras[2].cam_from_world.translation += Eigen::Vector3d(0.3, 0, 0);
  calib::write_rig(before, path("rig.yaml"));
  const Ended again = extrinsics("pictures");
  EXPECT_EQ(again.status, 0) << again.out << again.err;
  EXPECT_THAT(again.out, AllOf(HasSubstr("by cam0, cam1"), HasSubstr("moved since: cam2")));
  const calib::CameraRig found = calib::read_rig(path("rig.yaml"));
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_LT((found.cameras[c].centre() - truth.cameras[c].centre()).norm(), 0.01) << c;
  EXPECT_THAT(end_to_end::contents(path("rig.yaml")), HasSubstr("the board on the floor"));
  const Ended other = extrinsics("pictures", "rig.yaml", {"--new-world"});
  EXPECT_EQ(other.status, 0) << other.out << other.err;
  EXPECT_THAT(end_to_end::contents(path("rig.yaml")), HasSubstr("a guess"));
}

TEST_F(Calibrate, LeavesOutAndNamesAnUncalibratableCamera) {
  const calib::CameraRig truth = gather::pictured_rig();
  gather::write_pictures(folder_ / "pictures", truth, gather::pictured_poses(16),
                         [](int camera, int, cv::Mat& picture) {
                           if (camera == 1) picture.setTo(90);
                         });
  calib::write_rig(truth, path("rig.yaml"));
  const std::string good = end_to_end::contents(path("rig.yaml"));
  std::ofstream(path("rig.report.txt")) << "of the good rig";
  const Ended result = extrinsics("pictures");
  EXPECT_EQ(result.status, 2) << result.out << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("cam1 is left out"), HasSubstr("is in none of its")));
  // Doubtful: neither the rig that is there is replaced, nor its report.
  EXPECT_EQ(end_to_end::contents(path("rig.yaml")), good);
  EXPECT_EQ(end_to_end::contents(path("rig.report.txt")), "of the good rig");
  EXPECT_THAT(end_to_end::contents(path("rig.doubtful.report.txt")), HasSubstr("cam1 is left out"));
  const calib::CameraRig rest = calib::read_rig(path("rig.doubtful.yaml"));
  ASSERT_EQ(rest.cameras.size(), 2u);
  EXPECT_EQ(rest.cameras[1].name, "cam2");
}

TEST_F(Calibrate, ReportsAMissingFolderBeforeTheWork) {
  const Ended result = extrinsics("pictures", "nowhere/rig.yaml");  // there are no pictures either
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("no such folder; it is needed for rig.yaml"));
  fs::create_directories(folder_ / "empty");
  EXPECT_THAT(extrinsics("empty").err, HasSubstr("the folder is empty"));
  fs::create_directories(folder_ / "empty/left");
  fs::create_directories(folder_ / "empty/right");
  EXPECT_THAT(extrinsics("empty").err, HasSubstr("no images are in left, right"));
}

TEST_F(Calibrate, RejectsACameraGivenTwice) {
  const Ended result = extrinsics("nowhere", "rig.yaml", {"--cameras", "cam0,cam1,cam0"});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("--cameras: cam0 is given twice"));
}

TEST_F(Calibrate, TheOrderOfImagesDoesNotMatter) {
  const calib::CameraRig truth = gather::pictured_rig();
  gather::write_pictures(folder_ / "pictures", truth, gather::pictured_poses(12));
  std::vector<std::string> files;
  for (int p = 0; p < 12; ++p) files.push_back((folder_ / "pictures/cam1" / gather::picture_name(p)).string());
  std::vector<std::string> arguments{"intrinsics", "--camera", "cam1",  "--board",     path("board.yaml"),
                                     "--lens",     "radtan4",  "--rig", path("a.yaml")};
  std::vector<std::string> other = arguments;
  other.back() = path("b.yaml");
  arguments.insert(arguments.end(), files.begin(), files.end());
  other.insert(other.end(), files.rbegin(), files.rend());
  const Ended first = run(arguments), second = run(other);
  EXPECT_NE(first.status, 1) << first.err;
  EXPECT_EQ(first.status, second.status);
  const auto numbers = [](const std::string& yaml) {
    return yaml.substr(0, yaml.find("made_by"));
  };  // inputs are as given
  EXPECT_EQ(numbers(end_to_end::contents(path("a.yaml"))), numbers(end_to_end::contents(path("b.yaml"))));
  EXPECT_NEAR(calib::read_rig(path("a.yaml")).cameras[0].model.fx() / truth.cameras[1].model.fx(), 1, 0.01);
}

TEST_F(Calibrate, AFailedCalibrationKeepsAnExistingRig) {
  calib::write_rig(gather::pictured_rig(), path("rig.yaml"));
  const std::string good = end_to_end::contents(path("rig.yaml"));
  gather::write_pictures(folder_ / "pictures", gather::pictured_rig(), gather::pictured_poses(12),
                         [](int c, int p, cv::Mat& picture) {
                           if ((c == 2) == (p < 6)) picture = cv::Mat();  // cam2 has no view in common
                         });
  // Without cam2 there is one camera left.
  const Ended result = extrinsics("pictures", "rig.yaml", {"--cameras", "cam1,cam2"});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("cam2"));
  EXPECT_EQ(end_to_end::contents(path("rig.yaml")), good);
}

TEST_F(Calibrate, ADoubtfulRigDoesNotReplaceAGoodOne) {
  calib::write_rig(gather::pictured_rig(), path("rig.yaml"));
  const std::string good = end_to_end::contents(path("rig.yaml"));
  gather::write_pictures(folder_ / "pictures", gather::pictured_rig(), gather::pictured_poses(7));
  const Ended result = extrinsics("pictures");
  EXPECT_EQ(result.status, 2) << result.out << result.err;
  EXPECT_EQ(end_to_end::contents(path("rig.yaml")), good);
  EXPECT_TRUE(fs::exists(path("rig.doubtful.yaml")));
  EXPECT_THAT(result.out, AllOf(HasSubstr("DOUBTFUL"), HasSubstr("show the board at some 15 different places")));
  EXPECT_THAT(result.err, HasSubstr("is kept"));
}

TEST_F(Calibrate, RejectsANonRigOutputBeforeTheWork) {
  std::ofstream(path("rig.yaml")) << "my notes";
  const Ended result = extrinsics("pictures");  // there are no pictures either
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("rig.yaml"), HasSubstr("its world would be kept: give another --rig")));
  EXPECT_EQ(end_to_end::contents(path("rig.yaml")), "my notes");
}

// --- inputs that are wrong: each its own message and status ---

TEST_F(Calibrate, ABoardOfAnotherSizeBeforeOneCamera) {
  // cam1 was shown a board of 0.7 times the size at the same places.
  const calib::CameraRig rig = gather::pictured_rig();
  const auto poses = gather::pictured_poses(10);
  gather::write_pictures(folder_ / "pictures", rig, poses, [&](int c, int p, cv::Mat& picture) {
    if (c != 1) return;
    board::Board small = gather::pictured_board();
    small.pitch *= 0.7;
    const Eigen::Vector3d middle = gather::pictured_board().point(17);
    calib::Rigid3d pose = poses[static_cast<std::size_t>(p)];
    pose.translation = pose * Eigen::Vector3d(0.3 * middle);
    picture = gather::picture_of(rig.cameras[1], small, pose, static_cast<std::uint64_t>(p));
  });
  const Ended result = extrinsics("pictures");
  expect_left_out(result, "cam1", AllOf(HasSubstr("times as large"), HasSubstr("did they see different boards")));
}

TEST_F(Calibrate, MirroredImagesOfOneCamera) {
  gather::write_pictures(folder_ / "pictures", gather::pictured_rig(), gather::pictured_poses(10),
                         [](int c, int, cv::Mat& picture) {
                           if (c == 0) cv::flip(picture, picture, 1);
                         });
  const Ended result = extrinsics("pictures");
  expect_left_out(result, "cam0", HasSubstr("mirrored"));
  // With two cameras it is ambiguous which one.
  const Ended two = extrinsics("pictures", "rig.yaml", {"--cameras", "cam0,cam1"});
  EXPECT_EQ(two.status, 1) << two.out;
  EXPECT_THAT(two.err, AllOf(HasSubstr("cam0"), HasSubstr("mirrored")));
}

// cam2 stands on the other side, and sees the back of the board only.
TEST_F(Calibrate, ABoardThatIsPrintedOnBothSides) {
  board::Board board{
      .type = board::BoardType::charuco, .columns = 6, .rows = 5, .pitch = {0.11, 0.11}, .marker = 0.088};
  calib::CameraRig rig = gather::pictured_rig();
  rig.cameras[2].cam_from_world = solver::looking_at({-1.5, 0.3, 1.6}, {0, 0, 0.9});
  for (calib::Camera& camera : rig.cameras) {
    const double f = 2 * camera.model.fx();
    camera.image_size = {640, 480};
    camera.model = calib::CameraModel(calib::PinholeRadtan{f, f, 318, 241});
  }
  constexpr double thickness_m = 0.03;
  const auto poses = gather::pictured_poses(14);
  gather::write_pictures(
      folder_ / "pictures", rig, poses,
      [&](int c, int p, cv::Mat& picture) {
        if (c != 2) return;
        calib::Rigid3d back = poses[static_cast<std::size_t>(p)];
        back.translation = back * Eigen::Vector3d(0, 0, thickness_m);
        picture = gather::picture_of(rig.cameras[2], board, back, static_cast<std::uint64_t>(p));
      },
      board);
  std::ofstream(folder_ / "board.yaml") << board::to_yaml(board);
  expect_left_out(extrinsics("pictures"), "cam2",
                  AllOf(HasSubstr("mirrored"), HasSubstr("back of a board that is printed on both sides")));

  board.back = board::BoardBack{.thickness = thickness_m};
  std::ofstream(folder_ / "board.yaml") << board::to_yaml(board);
  const Ended result = extrinsics("pictures");
  EXPECT_NE(result.status, 1) << result.err;
  // Markers of 20 pixels, whose soft corners are found a little inside, are no other markers than the file's.
  EXPECT_THAT(result.out, testing::Not(HasSubstr("one of the two lengths is wrong")));
  const calib::CameraRig found = calib::read_rig(path("rig.yaml"));
  ASSERT_EQ(found.cameras.size(), 3u) << result.out;
  EXPECT_LT(solver::volume_rms_m(rig, found, {-0.4, -0.4, 0.5}, {0.4, 0.4, 1.3}), 0.003) << result.out;
}

TEST_F(Calibrate, SwappedCameras) {
  gather::write_pictures(folder_ / "pictures", gather::pictured_rig(), gather::pictured_poses(12));
  calib::write_rig(gather::pictured_rig(), path("known.yaml"));
  const Ended result =
      extrinsics("", "rig.yaml",
                 {"--intrinsics", path("known.yaml"), "--cameras", "cam0,cam1,cam2", "cam0=" + path("pictures/cam1"),
                  "cam1=" + path("pictures/cam0"), "cam2=" + path("pictures/cam2")});
  EXPECT_EQ(result.status, 1) << result.out;
  EXPECT_THAT(result.err, HasSubstr("cameras cam0 and cam1 look swapped"));
}

TEST_F(Calibrate, ACameraWithoutOverlap) {
  gather::write_pictures(folder_ / "pictures", gather::pictured_rig(), gather::pictured_poses(12),
                         [](int c, int p, cv::Mat& picture) {
                           if ((c == 2) == (p < 6)) picture = cv::Mat(240, 320, CV_8UC1, cv::Scalar(90));
                           if ((c == 2) == (p < 6)) cv::circle(picture, {160, 120}, 60, cv::Scalar(200), -1);
                         });
  const Ended result = extrinsics("pictures");
  expect_left_out(result, "cam2",
                  HasSubstr("camera cam2 never saw the board at the same time as cam0 and cam1: show it to cam2"));
}

TEST_F(Calibrate, BlurredAndEmptyImages) {
  const auto poses = gather::pictured_poses(12);
  gather::write_pictures(folder_ / "blurred", gather::pictured_rig(), poses, [](int c, int, cv::Mat& picture) {
    if (c == 1) cv::GaussianBlur(picture, picture, {}, 15);
  });
  expect_left_out(extrinsics("blurred"), "cam1",
                  AllOf(HasSubstr("camera cam1: the board (chessboard 7x5"), HasSubstr("the image is blurred")));
  gather::write_pictures(folder_ / "empty", gather::pictured_rig(), poses, [](int c, int, cv::Mat& picture) {
    if (c == 2) picture.setTo(0);
  });
  expect_left_out(extrinsics("empty"), "cam2", AllOf(HasSubstr("camera cam2"), HasSubstr("the image is black")));
  for (std::size_t p = 0; p < poses.size(); ++p)
    std::ofstream(folder_ / "empty/cam2" / gather::picture_name(static_cast<int>(p)), std::ios::trunc);
  expect_left_out(extrinsics("empty"), "cam2", HasSubstr("no usable image"));
  // With one camera left there is nothing to calibrate.
  const Ended alone = extrinsics("empty", "rig.yaml", {"--cameras", "cam0,cam2"});
  EXPECT_EQ(alone.status, 1) << alone.out;
  EXPECT_THAT(alone.err, AllOf(HasSubstr("cam2"), HasSubstr("no usable image")));
}

TEST_F(Calibrate, ATruncatedVideo) {
  const calib::CameraRig rig = gather::pictured_rig();
  const auto poses = gather::pictured_poses(16);
  fs::create_directories(path("videos"));
  for (std::size_t c = 0; c < 2; ++c) {
    std::ofstream video(folder_ / "videos" / (rig.cameras[c].name + ".mjpeg"), std::ios::binary);
    for (std::size_t p = 0; p < poses.size(); ++p) {
      cv::Mat picture;
      cv::cvtColor(gather::picture_of(rig.cameras[c], gather::pictured_board(), poses[p], 100 * c + p), picture,
                   cv::COLOR_GRAY2BGR);
      std::vector<std::uint8_t> jpeg;
      cv::imencode(".jpg", picture, jpeg);
      video.write(reinterpret_cast<const char*>(jpeg.data()), static_cast<std::streamsize>(jpeg.size()));
    }
  }
  // Such files have no times of their own.
  std::ofstream(folder_ / "videos/recording.yaml")
      << "version: 1\ncameras:\n  cam0: {frames: cam0.mjpeg, fps: 10}\n  cam1: {frames: cam1.mjpeg, fps: 10}\n";
  const fs::path cut = path("videos/cam1.mjpeg");
  fs::resize_file(cut, fs::file_size(cut) * 8 / 10);
  const Ended result = extrinsics("videos");
  EXPECT_EQ(result.status, 2) << result.out << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("cam1.mjpeg"), HasSubstr("use an undamaged copy, or record it again")));
}

// libjpeg makes a picture of it all the same, with grey where data are missing: it is named, not used as if it were
// whole.
TEST_F(Calibrate, NamesADamagedImage) {
  const auto poses = gather::pictured_poses(16);
  gather::write_pictures(folder_ / "stills", gather::pictured_rig(), poses);
  const fs::path whole = folder_ / "stills/cam1" / gather::picture_name(3);
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", cv::imread(whole.string(), cv::IMREAD_GRAYSCALE), jpeg);
  const std::string name = whole.stem().string() + ".jpg";
  std::ofstream(whole.parent_path() / name, std::ios::binary)
      .write(reinterpret_cast<const char*>(jpeg.data()), static_cast<std::streamsize>(jpeg.size() / 2));
  fs::remove(whole);
  const Ended result = extrinsics("stills");
  EXPECT_THAT(result.out + result.err, HasSubstr("cam1/" + name));
}

TEST_F(Calibrate, ABoardFileWithAnUnknownKey) {
  std::ofstream(path("board.yaml")) << "inner_corners: [7, 5]\nsqare: 0.08\n";
  const Ended result = extrinsics("pictures");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("board.yaml"), HasSubstr("square")));
}

TEST_F(Calibrate, WrongCommandLines) {
  // As huetrackd and huetrack end then: no input failed.
  EXPECT_GT(run({"extrinsics"}).status, 100);
  EXPECT_GT(run({"extrinsic"}).status, 100);
  Ended result = extrinsics("nowhere");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("nowhere: no such file or folder"));
  result = extrinsics("", "rig.yaml", {"left=" + path("none.mp4"), "right=" + path("none.mp4")});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, HasSubstr("none.mp4: no such file"));
}

// --- the world ---

TEST_F(Calibrate, TheWorldOfABoardOnTheFloor) {
  calib::CameraRig rig = gather::pictured_rig();
  // On the floor, its front up: x along the world's y, so the board's y is along the world's x... and z down.
  Eigen::Matrix3d lying;
  lying.col(2) = -Eigen::Vector3d::UnitZ();
  lying.col(0) = Eigen::Vector3d::UnitY();
  lying.col(1) = lying.col(2).cross(lying.col(0));
  const calib::Rigid3d world_from_board{Eigen::Quaterniond(lying), {0.1, -0.25, 0.55}};
  gather::write_pictures(folder_ / "floor", rig, {world_from_board});
  // Some other world to start from.
  const calib::Rigid3d other = calib::exp((calib::Tangent6d() << 0.3, -0.5, 0.8, 1, 2, 3).finished());
  for (calib::Camera& camera : rig.cameras) camera.cam_from_world = camera.cam_from_world * calib::inverse(other);
  calib::write_rig(rig, path("rig.yaml"));
  Ended result = run({"world", path("rig.yaml"), path("floor"), "--board", path("board.yaml")});
  EXPECT_EQ(result.status, 0) << result.out << result.err;
  const calib::CameraRig set = calib::read_rig(path("rig.yaml")), truth = gather::pictured_rig();
  for (std::size_t c = 0; c < 3; ++c) {
    // The origin is the board's corner 0; x along its rows.
    const Eigen::Vector3d p = truth.cameras[c].centre() - world_from_board.translation;
    EXPECT_LT((set.cameras[c].centre() - Eigen::Vector3d(p.y(), -p.x(), p.z())).norm(), 0.01) << c;
  }
  EXPECT_THAT(end_to_end::contents(path("rig.yaml")), HasSubstr("the board on the floor"));
  const Eigen::Vector2d origin = truth.cameras[0].project_world(world_from_board.translation).value().px;  // ambiguous
  EXPECT_THAT(result.out, HasSubstr("The origin is the corner at pixel (" + std::to_string(std::lround(origin.x())) +
                                    ", " + std::to_string(std::lround(origin.y())) + ") of cam0"));

  // Points, measured by their pixels; the rig's scale is wrong.
  std::ofstream points(path("points.yaml"));
  points << "points:\n";
  const std::vector<Eigen::Vector3d> places{{0, 0, 0.6}, {0.3, 0.1, 0.7}, {-0.2, 0.3, 0.9}, {0.1, -0.3, 0.8}};
  for (std::size_t k = 0; k < places.size(); ++k) {
    points << "  p" << k << ": {world: [" << places[k].x() << ", " << places[k].y() << ", " << places[k].z()
           << "], pixels: {";
    for (std::size_t c = 0; c < 2; ++c) {
      const auto px = truth.cameras[c].project_world(places[k]).value().px;
      points << (c > 0 ? ", " : "") << truth.cameras[c].name << ": [" << px.x() << ", " << px.y() << "]";
    }
    points << "}}\n";
  }
  points.close();
  calib::CameraRig large = set;
  for (calib::Camera& camera : large.cameras) camera.cam_from_world.translation *= 1.05;
  calib::write_rig(large, path("large.yaml"));
  result = run({"world", path("large.yaml"), "--points", path("points.yaml"), "--out", path("moved.yaml")});
  EXPECT_EQ(result.status, 2) << result.out << result.err;
  EXPECT_THAT(result.out, HasSubstr("all lengths of the rig are to be multiplied by 0.95"));
  result = run({"world", path("large.yaml"), "--points", path("points.yaml"), "--scale", "--out", path("scaled.yaml")});
  EXPECT_EQ(result.status, 0) << result.out << result.err;
  const calib::CameraRig scaled = calib::read_rig(path("scaled.yaml"));
  for (std::size_t c = 0; c < 3; ++c) EXPECT_LT((scaled.cameras[c].centre() - truth.cameras[c].centre()).norm(), 0.01);

  // Upside down: doubtful, and the file stays; with points on the floor that is refused.
  const std::string before = end_to_end::contents(path("rig.yaml"));
  std::ofstream(path("upside.yaml"))
      << "points:\n  a: {world: [0, 0, 0], position: [0, 0, 0]}\n"
         "  b: {world: [1, 0, 0], position: [1, 0, 0]}\n  c: {world: [0, -1, 0], position: [0, 1, 0]}\n";
  result = run({"world", path("rig.yaml"), "--points", path("upside.yaml")});
  EXPECT_EQ(result.status, 2) << result.out << result.err;
  EXPECT_THAT(result.out, HasSubstr("below z = 0"));
  EXPECT_EQ(end_to_end::contents(path("rig.yaml")), before);
}

}  // namespace
}  // namespace huetrack::program
