// OpenCV's files, one per camera, with the camera's pose in each.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <string>

#include "calib/exchange/exchange.h"

namespace huetrack::exchange {
namespace {

using Poses = std::map<std::string, cv::Mat>;

// Two cameras, 1.5 m above the floor and 3 m from the world's origin, as cv::FileStorage writes them.
class OpenCvPoses : public testing::TestWithParam<std::string> {
 protected:
  OpenCvPoses() : folder_(std::filesystem::path(testing::TempDir()) / "opencv_poses") {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    for (const std::size_t c : {0u, 1u}) {
      r_[c] = (cv::Mat_<double>(3, 3) << 0, c == 0 ? 1 : -1, 0, 0, 0, -1, c == 0 ? -1 : 1, 0, 0);
      t_[c] = (cv::Mat_<double>(3, 1) << 0, 1.5, 3);
    }
  }
  ~OpenCvPoses() override { std::filesystem::remove_all(folder_); }

  Poses poses_of(std::size_t c) const {
    cv::Mat vector, matrix;
    cv::Rodrigues(r_[c], vector);
    cv::hconcat(r_[c], t_[c], matrix);
    cv::Mat square = matrix.clone();
    const cv::Mat last = (cv::Mat_<double>(1, 4) << 0, 0, 0, 1);
    square.push_back(last);
    static const std::map<std::string, std::pair<std::string, std::string>> two{
        {"R+T", {"R", "T"}},
        {"R+t", {"R", "t"}},
        {"rotation", {"rotation", "translation"}},
        {"rotation_matrix", {"rotation_matrix", "translation_vector"}}};
    const std::string& kind = GetParam();
    if (const auto names = two.find(kind); names != two.end())
      return {{names->second.first, r_[c]}, {names->second.second, t_[c]}};
    if (kind == "rvec") return {{"rvec", vector}, {"tvec", t_[c]}};
    const std::string key = kind.substr(0, kind.find(' '));
    return {{key, kind.ends_with("3x4") ? matrix : square}};
  }

  std::filesystem::path written(std::size_t c) const {
    const std::filesystem::path file = folder_ / ("cam" + std::to_string(c) + ".yml");
    const cv::Mat k = (cv::Mat_<double>(3, 3) << 500, 0, 320, 0, 500, 240, 0, 0, 1);
    const cv::Mat d = (cv::Mat_<double>(1, 5) << -0.1, 0.02, 0, 0, 0);
    cv::FileStorage out(file.string(), cv::FileStorage::WRITE);
    out << "image_width" << 640 << "image_height" << 480;
    out << "camera_matrix" << k << "distortion_coefficients" << d;
    for (const auto& [key, value] : poses_of(c)) out << key << value;
    return file;
  }

  std::filesystem::path folder_;
  std::array<cv::Mat, 2> r_, t_;
};

TEST_P(OpenCvPoses, AreRead) {
  const std::array<std::filesystem::path, 2> files{written(0), written(1)};
  const Imported in = import_rig(files);
  ASSERT_EQ(in.rig.cameras.size(), 2u);
  for (const std::size_t c : {0u, 1u}) {
    const Eigen::Vector3d centre = in.rig.cameras[c].centre();
    EXPECT_NEAR((centre - Eigen::Vector3d(c == 0 ? 3 : -3, 0, 1.5)).norm(), 0, 1e-9) << centre.transpose();
  }
  EXPECT_THAT(in.notes, testing::Each(testing::Not(testing::HasSubstr("not taken over"))));
}

INSTANTIATE_TEST_SUITE_P(Keys, OpenCvPoses,
                         testing::Values("R+T", "R+t", "rotation", "rotation_matrix", "rvec", "extrinsics 3x4",
                                         "extrinsics 4x4", "cam_from_world 3x4", "cam_from_world 4x4"));

}  // namespace
}  // namespace huetrack::exchange
