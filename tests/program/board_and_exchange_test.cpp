#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <variant>

#include "calib/board/board_yaml.h"
#include "calib/model/rig_yaml.h"
#include "calib/program/command_line.h"

namespace huetrack::program {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class Commands : public testing::Test {
 protected:
  Commands()
      : folder_(std::filesystem::path(testing::TempDir()) /
                ("commands_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~Commands() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  static std::string text(const std::string& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }

  // What huetrack-calibrate would end with; what it would say on stderr is in said_.
  ExitStatus run(const std::vector<std::string>& arguments) {
    std::vector<const char*> argv{"huetrack-calibrate"};
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    std::variant<Command, int> asked = 0;
    ExitStatus status = ExitStatus::failed;
    std::string fault;
    try {
      asked = read_command_line(static_cast<int>(argv.size()), argv.data());
      if (const auto* command = std::get_if<Command>(&asked)) status = (*command)({});
    } catch (const std::exception& error) {
      fault = error.what();
    }
    out_ = testing::internal::GetCapturedStdout();
    const std::string errors = testing::internal::GetCapturedStderr();
    // What a command tells on its way is not what it fails with.
    said_ = std::holds_alternative<Command>(asked) ? fault : errors;
    return status;
  }

  std::filesystem::path folder_;
  std::string said_, out_;
};

TEST_F(Commands, BoardWritesItsPdfAndTheBoardFile) {
  EXPECT_EQ(run({"board", "--type", "charuco", "--columns", "7", "--rows", "5", "--square", "30", "--out",
                 path("board.pdf")}),
            ExitStatus::usable)
      << said_;
  const board::Board board = board::read_board(path("board.yaml"));
  EXPECT_EQ(board.type, board::BoardType::charuco);
  EXPECT_DOUBLE_EQ(board.pitch.x(), 0.03);
  EXPECT_TRUE(text(path("board.pdf")).starts_with("%PDF-1.4"));
  EXPECT_EQ(run({"board", "--type", "april_grid", "--out", path("april.pdf")}), ExitStatus::usable) << said_;
  EXPECT_EQ(board::read_board(path("april.yaml")).dictionary, "DICT_APRILTAG_36h11");
  for (const char* type : {"chessboard", "charuco", "aruco_grid"})  // with default options
    EXPECT_EQ(run({"board", "--type", type, "--out", path("plain.pdf")}), ExitStatus::usable) << said_;
  EXPECT_EQ(run({"board", "--type", "chessboard", "--square", "60", "--out", path("large.pdf")}), ExitStatus::failed);
  EXPECT_THAT(said_, AllOf(HasSubstr("does not fit on A4"), HasSubstr("can be")));
  EXPECT_FALSE(std::filesystem::exists(path("large.pdf")));
  EXPECT_EQ(run({"board", "--type", "chessboard", "--out", path("two.pdf"), "--board", path("two.pdf")}),
            ExitStatus::failed);
  EXPECT_THAT(said_, HasSubstr("written twice"));
  EXPECT_FALSE(std::filesystem::exists(path("two.pdf")));
  EXPECT_EQ(run({"board", "--type", "chessboard", "--paper", "B5", "--out", path("b.pdf")}), ExitStatus::failed);
  EXPECT_EQ(run({"board", "--type", "chessboard", "--marker", "20", "--out", path("b.pdf")}), ExitStatus::failed);
}

TEST_F(Commands, ImportAndExport) {
  const std::string rig = HUETRACK_SOURCE_DIR "/configs/demo/recording/rig.yaml";
  EXPECT_EQ(run({"export", rig, "--to", "aniposelib", "--out", path("out")}), ExitStatus::usable) << said_;
  EXPECT_EQ(run({"import", path("out/calibration.toml"), "--rig", path("back.yaml")}), ExitStatus::usable) << said_;
  EXPECT_EQ(calib::read_rig(path("back.yaml")).cameras.size(), 2u);
  EXPECT_LT((calib::read_rig(path("back.yaml")).cameras[1].centre() - calib::read_rig(rig).cameras[1].centre()).norm(),
            1e-13);
  // Never over what is there, and a file that cannot be read leaves the rig alone.
  EXPECT_EQ(run({"export", rig, "--to", "aniposelib", "--out", path("out")}), ExitStatus::failed);
  EXPECT_THAT(said_, HasSubstr("exists: give another --out"));
  const std::string before = text(path("back.yaml"));
  std::ofstream(path("bad.toml")) << "[cam_0]\nname = \"a\"\nsize = [640, 480]\n";
  EXPECT_EQ(run({"import", path("bad.toml"), "--rig", path("back.yaml")}), ExitStatus::failed);
  EXPECT_THAT(said_, AllOf(HasSubstr("bad.toml"), HasSubstr("no camera matrix")));
  EXPECT_EQ(before, text(path("back.yaml")));
  EXPECT_EQ(run({"import", path("out/calibration.toml"), "--unit", "furlong", "--rig", path("back.yaml")}),
            ExitStatus::failed);
}

// Three cameras around a place, of which the file has the inverted poses.
TEST_F(Commands, ADoubtfulImportEndsWith2AndKeepsTheRig) {
  std::string text_of_poses = "{";
  for (int c = 0; c < 3; ++c) {
    const Eigen::Vector3d centre(3 * std::cos(2.1 * c), 3 * std::sin(2.1 * c), 1.5);
    const Eigen::Vector3d z = (Eigen::Vector3d(0.6, -0.5, 0.3) - centre).normalized(),
                          x = z.cross(Eigen::Vector3d::UnitZ()).normalized(), y = z.cross(x).normalized();
    std::ostringstream rows;
    rows.precision(12);
    rows << "[[" << x.x() << "," << y.x() << "," << z.x() << "," << centre.x() << "],[" << x.y() << "," << y.y() << ","
         << z.y() << "," << centre.y() << "],[" << x.z() << "," << y.z() << "," << z.z() << "," << centre.z()
         << "],[0,0,0,1]]";
    text_of_poses += (c == 0 ? "\"cam" : ",\"cam") + std::to_string(c) +
                     "\": {\"K\": [[500,0,320],[0,500,240],[0,0,1]], \"D\": [0,0,0,0,0], \"size\": [640,480], "
                     "\"extrinsics\": " +
                     rows.str() + "}";
  }
  std::ofstream(path("inverted.json")) << text_of_poses << "}";
  EXPECT_EQ(run({"import", path("inverted.json"), "--inverted-poses", "--rig", path("rig.yaml")}), ExitStatus::usable)
      << said_;
  const std::string before = text(path("rig.yaml"));
  EXPECT_EQ(run({"import", path("inverted.json"), "--rig", path("rig.yaml")}), ExitStatus::doubtful) << said_;
  EXPECT_THAT(out_, AllOf(HasSubstr("--inverted-poses"), HasSubstr("rig.doubtful.yaml: 3 cameras")));
  EXPECT_EQ(text(path("rig.yaml")), before);
  EXPECT_EQ(calib::read_rig(path("rig.doubtful.yaml")).cameras.size(), 3u);
  EXPECT_EQ(run({"import", path("inverted.json"), "--rig", path("rig.yaml"), "--overwrite"}), ExitStatus::doubtful);
  EXPECT_NE(text(path("rig.yaml")), before);
}

TEST_F(Commands, ExportDoesNotReplaceTheRigThatItReads) {
  std::filesystem::copy_file(HUETRACK_SOURCE_DIR "/configs/demo/recording/rig.yaml", path("cam1.yaml"));
  const std::string before = text(path("cam1.yaml"));
  EXPECT_EQ(run({"export", path("cam1.yaml"), "--to", "ros", "--out", folder_, "--force"}), ExitStatus::failed);
  EXPECT_THAT(said_, HasSubstr("is the rig that is read"));
  EXPECT_EQ(text(path("cam1.yaml")), before);
  EXPECT_FALSE(std::filesystem::exists(path("cam0.yaml")));  // all or none
}

TEST_F(Commands, NotesHaveNoControlCharacters) {
  const std::string rig = HUETRACK_SOURCE_DIR "/configs/demo/recording/rig.yaml";
  ASSERT_EQ(run({"export", rig, "--to", "aniposelib", "--out", path("out")}), ExitStatus::usable) << said_;
  std::ofstream(path("out/calibration.toml"), std::ios::app)
      << (text(path("out/calibration.toml")).find("[metadata]") == std::string::npos ? "\n[metadata]\n" : "")
      << "\"a\\u001b[2J\" = [1]\n\"b\\u001b[2J\" = \"c\\u001b[2J\"\n";
  EXPECT_EQ(run({"import", path("out/calibration.toml"), "--rig", path("back.yaml")}), ExitStatus::usable) << said_;
  EXPECT_THAT(out_, HasSubstr("not taken over: metadata.a [2J"));
  const auto& noted = calib::read_rig(path("back.yaml")).made_by;
  EXPECT_THAT(noted, testing::Contains(testing::Pair("b [2J", "c [2J")));
}

TEST_F(Commands, WaveOnTheBundledRecording) {
  const std::string recording = HUETRACK_SOURCE_DIR "/configs/demo/recording",
                    config = HUETRACK_SOURCE_DIR "/configs/demo/huetrackd.yaml";
  const calib::CameraRig truth = calib::read_rig(recording + "/rig.yaml");
  const double distance = (truth.cameras[0].centre() - truth.cameras[1].centre()).norm();
  const ExitStatus status =
      run({"wave", recording, "--config", config, "--camera-distance", truth.cameras[0].name, truth.cameras[1].name,
           std::to_string(distance), "--rig", path("rig.yaml"), "--quiet"});
  EXPECT_NE(status, ExitStatus::failed) << said_;
  EXPECT_THAT(
      out_,
      AllOf(testing::ContainsRegex("\n(USABLE|DOUBTFUL): "), HasSubstr("expected error of positions"),
            testing::ContainsRegex("\nobject_tracking: .volume: .min: .-?[0-9.]+, .*, max: .*\\}\n.*rig.yaml\n$")));
  const calib::CameraRig found = calib::read_rig(path("rig.yaml"));
  EXPECT_LT((found.cameras[1].centre() - truth.cameras[1].centre()).norm(), 0.015);
  EXPECT_EQ(found.made_by.front().first, "tool");
  // From lenses alone.
  for (const calib::Camera& camera : truth.cameras) {
    calib::CameraRig lens{{camera}, {}};
    lens.cameras[0].cam_from_world = {};
    calib::write_rig(lens, path(camera.name + ".yaml"));
  }
  EXPECT_EQ(run({"wave", recording, "--lens", path(truth.cameras[0].name + ".yaml"), "--lens",
                 path(truth.cameras[1].name + ".yaml"), "--hue", "65", "115", "--radius", "40", "--rig",
                 path("new.yaml"), "--quiet"}),
            ExitStatus::doubtful)
      << said_;
  EXPECT_THAT(out_, HasSubstr("the scale is from the ball's radius"));
  EXPECT_THAT(calib::read_rig(path("new.yaml")).made_by.back(),
              testing::Pair("doubt", HasSubstr("the scale is from the ball's radius")));
  // Doubtful, and there is a rig: that stays.
  const std::string before = text(path("new.yaml"));
  EXPECT_EQ(run({"wave", recording, "--config", config, "--no-poses", "--rig", path("new.yaml"), "--quiet"}),
            ExitStatus::doubtful)
      << said_;
  EXPECT_EQ(before, text(path("new.yaml")));
  EXPECT_TRUE(std::filesystem::exists(path("new.doubtful.yaml")));
  // Failed: likewise, and nothing is written.
  EXPECT_EQ(run({"wave", recording, "--lens", path(truth.cameras[0].name + ".yaml"), "--lens",
                 path(truth.cameras[1].name + ".yaml"), "--hue", "200", "230", "--rig", path("new.yaml"), "--quiet"}),
            ExitStatus::failed);
  EXPECT_THAT(said_, HasSubstr("not connected"));
  EXPECT_EQ(before, text(path("new.yaml")));
  EXPECT_EQ(run({"wave", recording, "--config", config, "--target", "bull", "--rig", path("new.yaml")}),
            ExitStatus::failed);
  EXPECT_THAT(said_, AllOf(HasSubstr("bull"), HasSubstr("lime")));
}

}  // namespace
}  // namespace huetrack::program
