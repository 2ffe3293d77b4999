#include "calib/exchange/exchange.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <sstream>

#include "calib/files/config_error.h"
#include "calib/model/nearest_lens.h"
#include "recordings/bag_writer.h"

namespace huetrack::exchange {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

class Exchange : public testing::Test {
 protected:
  Exchange()
      : folder_(std::filesystem::path(testing::TempDir()) /
                ("exchange_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~Exchange() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path file(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  static Imported import(const std::filesystem::path& path, const ImportOptions& options = {}) {
    const std::array<std::filesystem::path, 1> files{path};
    return import_rig(files, options);
  }
  Imported import_text(const std::string& name, const std::string& text, const ImportOptions& options = {}) const {
    return import(file(name, text), options);
  }
  std::string error_of(const std::string& name, const std::string& text, const ImportOptions& options = {}) const {
    try {
      import_text(name, text, options);
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "no error";
  }
  // Writes what was exported and reads it again.
  Imported and_back(const calib::CameraRig& rig, const ExportOptions& options) const {
    std::vector<std::filesystem::path> files;
    for (const auto& [name, text] : export_rig(rig, options).files) files.push_back(file(name, text));
    return import_rig(files, {.format = options.format});
  }

  std::filesystem::path folder_;
};

cv::Mat column(const std::vector<double>& values) {
  return cv::Mat(values, true).reshape(1, static_cast<int>(values.size()));
}

// OpenCV's own projection of points around (0, 0, 3) in front of the camera is ours.
void expect_projects_like_opencv(const calib::Camera& camera, const std::vector<double>& k,
                                 const std::vector<double>& d, const cv::Mat& rotation_vector,
                                 const std::vector<double>& t, bool fisheye = false) {
  cv::Mat r;
  cv::Rodrigues(rotation_vector, r);
  std::vector<cv::Point3d> world;
  for (double x = -0.6; x < 0.7; x += 0.3) {
    for (double y = -0.4; y < 0.5; y += 0.2) {
      const cv::Mat p = r.t() * (cv::Mat_<double>(3, 1) << x - t[0], y - t[1], 2 + x * y - t[2]);
      world.emplace_back(p.at<double>(0), p.at<double>(1), p.at<double>(2));
    }
  }
  std::vector<cv::Point2d> px;
  const cv::Mat matrix = cv::Mat(k, true).reshape(1, 3);
  if (fisheye)
    cv::fisheye::projectPoints(world, px, rotation_vector, column(t), matrix, column(d));
  else
    cv::projectPoints(world, rotation_vector, column(t), matrix, d.empty() ? cv::Mat() : column(d), px);
  for (std::size_t i = 0; i < world.size(); ++i) {
    const auto ours = camera.project_world({world[i].x, world[i].y, world[i].z});
    ASSERT_TRUE(ours);
    EXPECT_NEAR(ours->px.x(), px[i].x, 1e-7);
    EXPECT_NEAR(ours->px.y(), px[i].y, 1e-7);
  }
}

void expect_same(const calib::CameraRig& a, const calib::CameraRig& b, bool names = true) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    const calib::Camera &x = a.cameras[c], &y = b.cameras[c];
    if (names) {
      EXPECT_EQ(x.name, y.name);
    }
    EXPECT_EQ(x.image_size, y.image_size);
    ASSERT_EQ(x.model.name(), y.model.name());
    EXPECT_EQ(x.model.fx(), y.model.fx());
    EXPECT_EQ(x.model.fy(), y.model.fy());
    EXPECT_EQ(x.model.cx(), y.model.cx());
    EXPECT_EQ(x.model.cy(), y.model.cy());
    if (const auto* lens = std::get_if<calib::PinholeRadtan>(&x.model.lens())) {
      EXPECT_EQ(lens->distortion, std::get<calib::PinholeRadtan>(y.model.lens()).distortion);
    } else {
      EXPECT_EQ(std::get<calib::FisheyeKannalaBrandt>(x.model.lens()).distortion,
                std::get<calib::FisheyeKannalaBrandt>(y.model.lens()).distortion);
    }
    EXPECT_LT((x.cam_from_world.translation - y.cam_from_world.translation).norm(), 1e-14);
    EXPECT_LT((x.cam_from_world.rotation.toRotationMatrix() - y.cam_from_world.rotation.toRotationMatrix()).norm(),
              1e-14);
  }
}

// In the first camera's frame, which is what formats without a world keep.
calib::CameraRig from_first(calib::CameraRig rig) {
  const calib::Rigid3d world_from_first = calib::inverse(rig.cameras.front().cam_from_world);
  for (calib::Camera& camera : rig.cameras) camera.cam_from_world = camera.cam_from_world * world_from_first;
  return rig;
}

calib::CameraRig some_rig(bool fisheye = false) {
  calib::CameraRig rig;
  for (int c = 0; c < 3; ++c) {
    calib::Camera camera;
    camera.name = "cam" + std::to_string(c);
    camera.image_size = {640, 480};
    if (fisheye)
      camera.model = calib::CameraModel(
          calib::FisheyeKannalaBrandt{310.0 / 3, 101.7, 320.1, 239.3 + c, {0.1 / 7, -0.003, 0.0007, -0.0001}});
    else
      camera.model = calib::CameraModel(
          calib::PinholeRadtan{532.1 / 3, 531.7, 320.1 + c, 239.3, {-0.1 / 3, 0.02, 0.0005, -0.0004}});
    const Eigen::Vector3d axis = Eigen::Vector3d(0.3, 1, 0.2 * c).normalized();
    camera.cam_from_world = {Eigen::Quaterniond(Eigen::AngleAxisd(0.4 + 1.3 * c, axis)), {0.1 * c, -0.2 / 3, 2.5}};
    rig.cameras.push_back(camera);
  }
  return rig;
}

const char* const camera_info = R"(image_width: 640
image_height: 480
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [532.1, 0, 320.5, 0, 531.2, 239.25, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.28, 0.07, 0.0012, -0.0003, 0.01]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [532.1, 0, 320.5, 0, 0, 531.2, 239.25, 0, 0, 0, 1, 0]
)";

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

TEST_F(Exchange, CameraInfo) {
  const Imported in = import_text("left.yaml", camera_info);
  ASSERT_EQ(in.rig.cameras.size(), 1u);
  EXPECT_EQ(in.rig.cameras[0].name, "left");
  expect_projects_like_opencv(in.rig.cameras[0], {532.1, 0, 320.5, 0, 531.2, 239.25, 0, 0, 1},
                              {-0.28, 0.07, 0.0012, -0.0003, 0.01}, cv::Mat::zeros(3, 1, CV_64F), {0, 0, 0});
  expect_same(in.rig, and_back(in.rig, {.format = ExchangeFormat::ros}).rig);
}

TEST_F(Exchange, CameraInfoReportsWhatItIgnores) {
  const Imported in = import_text("right.yaml", replaced(camera_info, "320.5, 0, 0, 531.2, 239.25, 0, 0, 0, 1, 0]",
                                                         "320.5, -53.21, 0, 531.2, 239.25, 0, 0, 0, 1, 0]"));
  EXPECT_THAT(in.notes, Contains(AllOf(HasSubstr("projection_matrix is not taken over"), HasSubstr("0.1 m"))));
  calib::CameraRig rig = some_rig();
  EXPECT_THAT(export_rig(rig, {.format = ExchangeFormat::ros}).notes, Contains(HasSubstr("no poses")));
}

TEST_F(Exchange, CameraInfoErrorsNameTheLine) {
  EXPECT_THAT(error_of("a.yaml", replaced(camera_info, "plumb_bob", "plump_bob")),
              AllOf(HasSubstr("a.yaml:8"), HasSubstr("plumb_bob")));
  EXPECT_THAT(error_of("b.yaml", replaced(camera_info, "plumb_bob", "thin_prism")), HasSubstr("b.yaml:8"));
  EXPECT_THAT(error_of("c.yaml", replaced(camera_info, "cols: 5\n  data: [-0.28, 0.07, 0.0012, -0.0003, 0.01]",
                                          "cols: 3\n  data: [-0.28, 0.07, 0.0012]")),
              AllOf(HasSubstr("c.yaml:9"), HasSubstr("got 3")));
  EXPECT_THAT(error_of("d.yaml", replaced(camera_info, "[532.1, 0, 320.5", "[532.1, 3, 320.5")),
              AllOf(HasSubstr("d.yaml:4"), HasSubstr("skew")));
  EXPECT_THAT(error_of("e.yaml", replaced(camera_info, "image_width: 640\n", "")),
              AllOf(HasSubstr("e.yaml"), HasSubstr("--size")));
  EXPECT_THAT(import_text("f.yaml", std::string(camera_info) + "binning_z: 2\n").notes,
              Contains(HasSubstr("not taken over: binning_z")));
}

TEST_F(Exchange, CameraInfoOfOtherLenses) {
  calib::CameraRig rig{{some_rig(true).cameras[0]}, {}};
  rig.cameras[0].cam_from_world = {};
  EXPECT_THAT(export_rig(rig, {.format = ExchangeFormat::ros}).files[0].second,
              HasSubstr("distortion_model: equidistant"));
  expect_same(rig, and_back(rig, {.format = ExchangeFormat::ros}).rig);
  rig.cameras[0].model =
      calib::CameraModel(calib::PinholeRadtan{500, 501, 320, 240, {0.1, 0.2, 1e-3, 2e-3, 0.3, 0.11, 0.22, 0.33}});
  EXPECT_THAT(export_rig(rig, {.format = ExchangeFormat::ros}).files[0].second,
              HasSubstr("distortion_model: rational_polynomial"));
  expect_same(rig, and_back(rig, {.format = ExchangeFormat::ros}).rig);
}

// The example of Kalibr's documentation of the format, with both cameras pinhole.
const char* const camchain = R"(cam0:
  camera_model: pinhole
  intrinsics: [461.629, 460.152, 362.680, 246.049]
  distortion_model: radtan
  distortion_coeffs: [-0.27695497, 0.06712482, 0.00087538, 0.00011556]
  T_cam_imu:
  - [0.01779318, 0.99967549,-0.01822936, 0.07008565]
  - [-0.9998017, 0.01795239, 0.00860714,-0.01771023]
  - [0.00893160, 0.01807260, 0.99979678, 0.00399246]
  - [0.0, 0.0, 0.0, 1.0]
  timeshift_cam_imu: -8.121e-05
  rostopic: /cam0/image_raw
  resolution: [752, 480]
cam1:
  camera_model: pinhole
  intrinsics: [450.1, 451.2, 373.85, 253.749]
  distortion_model: equidistant
  distortion_coeffs: [-0.01, 0.02, -0.003, 0.0004]
  T_cn_cnm1:
  - [ 0.99998854, 0.00216014, 0.00427195,-0.11003785]
  - [-0.00221074, 0.99992702, 0.01187697, 0.00045792]
  - [-0.00424598,-0.01188627, 0.99992034,-0.00064487]
  - [0.0, 0.0, 0.0, 1.0]
  rostopic: /cam1/image_raw
  resolution: [752, 480]
)";

TEST_F(Exchange, KalibrCamchain) {
  const Imported in = import_text("camchain.yaml", camchain);
  ASSERT_EQ(in.rig.cameras.size(), 2u);
  const std::vector<double> k0{461.629, 0, 362.680, 0, 460.152, 246.049, 0, 0, 1},
      k1{450.1, 0, 373.85, 0, 451.2, 253.749, 0, 0, 1};
  expect_projects_like_opencv(in.rig.cameras[0], k0, {-0.27695497, 0.06712482, 0.00087538, 0.00011556},
                              cv::Mat::zeros(3, 1, CV_64F), {0, 0, 0});
  cv::Mat r;
  const cv::Mat rounded = (cv::Mat_<double>(3, 3) << 0.99998854, 0.00216014, 0.00427195, -0.00221074, 0.99992702,
                           0.01187697, -0.00424598, -0.01188627, 0.99992034);
  cv::Rodrigues(rounded, r);
  // (Rodrigues makes the rounded matrix a rotation in a way of its own.)
  const auto p = in.rig.cameras[1].project_world({0.1, 0.2, 2});
  std::vector<cv::Point2d> px;
  cv::fisheye::projectPoints(std::vector<cv::Point3d>{{0.1, 0.2, 2}}, px, r,
                             column({-0.11003785, 0.00045792, -0.00064487}), cv::Mat(k1, true).reshape(1, 3),
                             column({-0.01, 0.02, -0.003, 0.0004}));
  ASSERT_TRUE(p);
  EXPECT_NEAR(p->px.x(), px[0].x, 1e-4);
  EXPECT_NEAR(p->px.y(), px[0].y, 1e-4);
  EXPECT_THAT(in.notes, Contains(AllOf(HasSubstr("cam0: not taken over"), HasSubstr("T_cam_imu"))));
  EXPECT_EQ(in.rig.cameras[0].timing, (calib::CameraTiming{8.121e-05, {}, {}, {}}));
  EXPECT_EQ(in.rig.cameras[1].timing, calib::CameraTiming{});
  expect_same(in.rig, and_back(in.rig, {.format = ExchangeFormat::kalibr}).rig);
}

TEST_F(Exchange, KalibrChainOfThree) {
  for (const bool fisheye : {false, true}) {
    const calib::CameraRig rig = some_rig(fisheye);
    EXPECT_THAT(export_rig(rig, {.format = ExchangeFormat::kalibr}).notes,
                Contains(HasSubstr("the world becomes cam0's frame")));
    expect_same(from_first(rig), and_back(rig, {.format = ExchangeFormat::kalibr}).rig);
  }
}

// t_imu = t_stamp + timeshift_cam_imu + row * line delay, so the middle row's latency is -shift - readout / 2.
TEST_F(Exchange, KalibrTiming) {
  const std::string shift = "  timeshift_cam_imu: -8.121e-05\n";
  const auto timing = [&](const std::string& lines) {
    return import_text("timed.yaml", replaced(camchain, shift, lines)).rig.cameras[0].timing;
  };
  const calib::CameraTiming rolling = timing("  timeshift_cam_imu: -0.03\n  line_delay_nanoseconds: 40000\n");
  EXPECT_NEAR(rolling.readout_s.value(), 40e-6 * 479, 1e-15);
  EXPECT_NEAR(rolling.latency_s.value(), 0.03 - 20e-6 * 479, 1e-15);
  EXPECT_NEAR(timing("  line_delay: 4.0e-05\n").readout_s.value(), 40e-6 * 479, 1e-15);
  EXPECT_FALSE(timing("  line_delay: 4.0e-05\n").latency_s);
  EXPECT_THAT(error_of("s.yaml", replaced(camchain, shift, "  timeshift_cam_imu: 12.5\n")),
              AllOf(HasSubstr("s.yaml:11"), HasSubstr("more than a second")));
  EXPECT_THAT(error_of("l.yaml", replaced(camchain, shift, "  line_delay_nanoseconds: -1\n")), HasSubstr("l.yaml:11"));
  EXPECT_THAT(error_of("b.yaml", replaced(camchain, shift, "  line_delay: 0\n  line_delay_nanoseconds: 0\n")),
              HasSubstr("b.yaml:11: cam0.line_delay: is given together with line_delay_nanoseconds"));
  EXPECT_THAT(import_text("d.yaml", replaced(camchain, shift, "  line_dely: 0\n")).notes,
              Contains(AllOf(HasSubstr("cam0: not taken over"), HasSubstr("line_dely"))));

  // There and back. The format's line delay is in whole nanoseconds.
  calib::CameraRig rig = some_rig();
  rig.cameras[0].timing = {0.031, 0.001, 60000e-9 * 479, {}};
  rig.cameras[1].timing = {-0.002, {}, {}, {}};
  const calib::CameraRig back = and_back(rig, {.format = ExchangeFormat::kalibr}).rig;
  EXPECT_NEAR(back.cameras[0].timing.latency_s.value(), 0.031, 1e-15);
  EXPECT_NEAR(back.cameras[0].timing.readout_s.value(), 60000e-9 * 479, 1e-15);
  EXPECT_EQ(back.cameras[1].timing, rig.cameras[1].timing);
  EXPECT_EQ(back.cameras[2].timing, calib::CameraTiming{});
  EXPECT_THAT(export_rig(rig, {.format = ExchangeFormat::kalibr}).notes,
              Contains(HasSubstr("cam0: Kalibr has no place for the standard deviations of timing")));
  rig.cameras[0].timing = {0.01, {}, -0.02, {}};
  EXPECT_THAT(export_rig(rig, {.format = ExchangeFormat::kalibr}).notes,
              Contains(HasSubstr("cam0: Kalibr has no place for a sensor that reads upwards")));
  EXPECT_NEAR(and_back(rig, {.format = ExchangeFormat::kalibr}).rig.cameras[0].timing.latency_s.value(), 0, 1e-15);
}

TEST_F(Exchange, FormatsWithoutTimingReportIt) {
  calib::CameraRig rig = some_rig();
  const auto about_timing = Contains(HasSubstr("has no place for the cameras' timing"));
  for (const ExchangeFormat format :
       {ExchangeFormat::ros, ExchangeFormat::opencv, ExchangeFormat::aniposelib, ExchangeFormat::caliscope}) {
    rig.cameras[1].timing = {};
    EXPECT_THAT(export_rig(rig, {.format = format}).notes, testing::Not(about_timing));
    rig.cameras[1].timing.readout_s = 0.02;
    EXPECT_THAT(export_rig(rig, {.format = format}).notes, about_timing);
  }
}

TEST_F(Exchange, KalibrErrors) {
  EXPECT_THAT(error_of("a.yaml", replaced(camchain, "camera_model: pinhole", "camera_model: omni")),
              AllOf(HasSubstr("a.yaml:2"), HasSubstr("omni")));
  EXPECT_THAT(error_of("b.yaml", replaced(camchain, "radtan", "fov")), HasSubstr("b.yaml:4"));
  EXPECT_THAT(error_of("c.yaml", replaced(camchain, "0.00087538, 0.00011556]", "0.00087538]")), HasSubstr("c.yaml:5"));
  EXPECT_THAT(error_of("d.yaml", replaced(camchain, "[ 0.99998854, 0.00216014", "[ 0.89998854, 0.00216014")),
              AllOf(HasSubstr("d.yaml:"), HasSubstr("not a rotation")));
  EXPECT_THAT(error_of("e.yaml", replaced(replaced(camchain, "[ 0.99998854, 0.00216014, 0.00427195",
                                                   "[ -0.99998854, -0.00216014, -0.00427195"),
                                          "0.2", "0.2")),
              HasSubstr("mirrored"));
  calib::CameraRig rig = some_rig();
  rig.cameras[1].model = calib::CameraModel(calib::PinholeRadtan{500, 500, 320, 240, {0.1, 0.2, 0, 0, 0.05}});
  try {
    export_rig(rig, {.format = ExchangeFormat::kalibr});
    ADD_FAILURE() << "k3 was dropped";
  } catch (const ExchangeError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("cam1"), HasSubstr("k3 = 0.05")));
  }
}

TEST_F(Exchange, AStereographicLensIsApproximated) {
  calib::CameraRig rig = some_rig();
  const calib::CameraModel lens(
      calib::Stereographic{500, 500, 320, 240, {0.1, -0.05, 1e-3, -5e-4, 0.01, 0, 1e-3, 5e-4}});
  rig.cameras[1].model = lens;
  for (const ExchangeFormat format : {ExchangeFormat::ros, ExchangeFormat::opencv, ExchangeFormat::kalibr,
                                      ExchangeFormat::aniposelib, ExchangeFormat::caliscope}) {
    EXPECT_THAT(
        export_rig(rig, {.format = format}).notes,
        Contains(AllOf(HasSubstr("cam1"), HasSubstr("no stereographic lens"), HasSubstr("px (95 % of the image)"))))
        << name(format);
  }
  const calib::NearestLens nearest =
      calib::nearest_lens(lens, {640, 480}, calib::CameraModel(calib::PinholeRadtan{}), 12);
  EXPECT_TRUE(nearest.covers_image);
  EXPECT_LT(nearest.p95_px, 0.3);
  // As far off as it says.
  const auto ray = lens.ray({{5, 5}});
  ASSERT_TRUE(ray);
  EXPECT_LE((nearest.model.project(*ray).value().px - Eigen::Vector2d(5, 5)).norm(), nearest.worst_px);
}

// What aniposelib's CameraGroup.dump() writes.
const char* const anipose = R"([cam_0]
name = "A"
size = [ 1280, 720,]
matrix = [ [ 900.5, 0.0, 639.5,], [ 0.0, 901.5, 359.5,], [ 0.0, 0.0, 1.0,],]
distortions = [ -0.33, 0.04, -0.004, 0.004, 0.06,]
rotation = [ 0.1, -0.2, 0.3,]
translation = [ 10.0, -20.0, 1500.0,]

[cam_1]
name = "B"
size = [ 1280, 720,]
matrix = [ [ 800.5, 0.0, 630.5,], [ 0.0, 801.5, 350.5,], [ 0.0, 0.0, 1.0,],]
distortions = [ 0.01, 0.02, -0.003, 0.001,]
rotation = [ 2.0, 1.0, -2.0,]
translation = [ 300.0, 40.0, 1200.0,]
fisheye = true

[metadata]
adjusted = false
error = 0.5625
)";

TEST_F(Exchange, Aniposelib) {
  EXPECT_THAT(error_of("calibration.toml", anipose), HasSubstr("--unit mm"));
  const Imported in = import_text("calibration.toml", anipose, {.metres_per_unit = 1e-3});
  ASSERT_EQ(in.rig.cameras.size(), 2u);
  EXPECT_EQ(in.rig.cameras[0].name, "A");
  expect_projects_like_opencv(in.rig.cameras[0], {900.5, 0, 639.5, 0, 901.5, 359.5, 0, 0, 1},
                              {-0.33, 0.04, -0.004, 0.004, 0.06}, column({0.1, -0.2, 0.3}), {0.01, -0.02, 1.5});
  expect_projects_like_opencv(in.rig.cameras[1], {800.5, 0, 630.5, 0, 801.5, 350.5, 0, 0, 1},
                              {0.01, 0.02, -0.003, 0.001}, column({2.0, 1.0, -2.0}), {0.3, 0.04, 1.2}, true);
  EXPECT_THAT(in.rig.made_by, Contains(testing::Pair("error", "0.5625")));
  const Imported back = and_back(in.rig, {.format = ExchangeFormat::aniposelib});
  expect_same(in.rig, back.rig);
  EXPECT_EQ(in.rig.made_by, back.rig.made_by);
  EXPECT_TRUE(export_rig(in.rig, {.format = ExchangeFormat::aniposelib}).notes.empty());
}

TEST_F(Exchange, TomlErrorsNameTheLine) {
  const ImportOptions mm{.metres_per_unit = 1e-3};
  EXPECT_THAT(error_of("a.toml", replaced(anipose, "-0.004, 0.004, 0.06,]", "-0.004,]"), mm),
              AllOf(HasSubstr("a.toml:5"), HasSubstr("got 3")));
  EXPECT_THAT(error_of("b.toml", replaced(anipose, "rotation = [ 0.1, -0.2, 0.3,]", "rotation = [ 0.1, -0.2,]"), mm),
              AllOf(HasSubstr("b.toml:6"), HasSubstr("rotation")));
  EXPECT_THAT(error_of("c.toml", replaced(anipose, "size = [ 1280, 720,]", "size = [ 1280, 720"), mm),
              HasSubstr("c.toml:"));
  EXPECT_THAT(error_of("d.toml", replaced(anipose, "size = [ 1280, 720,]\n", ""), mm),
              AllOf(HasSubstr("d.toml:1"), HasSubstr("--size")));
  EXPECT_THAT(error_of("e.toml", replaced(anipose, "name = \"B\"", "name = \"A\""), mm),
              AllOf(HasSubstr("e.toml:9"), HasSubstr("second camera A")));
  EXPECT_THAT(error_of("f.toml", replaced(anipose, "[ 900.5, 0.0", "[ \"wide\", 0.0"), mm), HasSubstr("f.toml:4"));
  EXPECT_THAT(error_of("g.toml", "[other]\na = 1\n"), HasSubstr("--from"));
}

TEST_F(Exchange, RealCaliscopeFile) {
  const std::filesystem::path folder =
      std::filesystem::path(HUETRACK_SHARED_DATA) / "caliscope_charuco_4cam/post_optimization";
  if (!std::filesystem::exists(folder / "camera_array.toml")) GTEST_SKIP() << "no " << folder;
  const Imported in = import(folder / "camera_array.toml");
  ASSERT_EQ(in.rig.cameras.size(), 4u);
  EXPECT_EQ(in.rig.cameras[2].name, "cam_2");
  EXPECT_EQ(in.rig.cameras[2].image_size, (calib::ImageSize{1280, 720}));
  // The numbers of the file, through OpenCV.
  cv::Mat r;
  const cv::Mat of_file =
      (cv::Mat_<double>(3, 3) << -0.23474520574867236, 0.8701987696136831, -0.43318447541531985, 0.39180150339004355,
       -0.32313146123239816, -0.861439284397407, -0.8895989379036572, -0.3719410707688081, -0.26509162483193865);
  cv::Rodrigues(of_file, r);
  expect_projects_like_opencv(
      in.rig.cameras[2], {650.801908585405, 0, 647.3391995946636, 0, 654.4652152401134, 392.19105369229516, 0, 0, 1},
      {0.18039827881295703, -0.25603810782846814, 0.003209768150056599, 0.0022377311012611876, 0.12402327219756225}, r,
      {-0.23847883889454596, 0.18461082840729343, 1.1682943900670697});
  EXPECT_THAT(in.notes, Contains(AllOf(HasSubstr("cam_1: not taken over"), HasSubstr("exposure"),
                                       HasSubstr("verified_resolutions"))));
  expect_same(in.rig, and_back(in.rig, {.format = ExchangeFormat::caliscope}).rig);
  // Its older form says the same.
  expect_same(in.rig, import(folder / "config.toml").rig);
}

TEST_F(Exchange, CaliscopeReportsMissingPosesAndIgnoredCameras) {
  const std::string camera =
      "matrix = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]\ndistortions = [0.0, 0.0, 0.0, 0.0, "
      "0.0]\nsize = [640, 480]\n";
  const std::string pose = "rotation = [0.1, 0.2, 0.3]\ntranslation = [0.0, 0.0, 2.0]\n",
                    no_pose = "rotation = \"null\"\ntranslation = \"null\"\n";
  const std::string other = "rotation = [0.1, 0.3, 0.3]\ntranslation = [0.5, 0.0, 2.0]\n";
  EXPECT_THAT(
      error_of("a.toml", "[cameras.1]\ncam_id = 1\n" + camera + pose + "[cameras.2]\ncam_id = 2\n" + camera + no_pose),
      AllOf(HasSubstr("cam_2"), HasSubstr("no rotation and translation")));
  const Imported in = import_text("b.toml", "[cameras.1]\ncam_id = 1\nrotation_count = 1\n" + camera + pose +
                                                "[cameras.2]\ncam_id = 2\nignore = true\n" + camera +
                                                "[cameras.10]\ncam_id = 10\n" + camera + other);
  ASSERT_EQ(in.rig.cameras.size(), 2u);
  EXPECT_EQ(in.rig.cameras[1].name, "cam_10");
  EXPECT_THAT(in.notes, Contains(AllOf(HasSubstr("cam_1"), HasSubstr("turned by 90"), HasSubstr("do not turn them"))));
  EXPECT_THAT(in.notes, Contains(AllOf(HasSubstr("cam_2"), HasSubstr("ignore"))));
}

TEST_F(Exchange, OpenCvSampleFile) {
  const std::filesystem::path folder = std::filesystem::path(HUETRACK_SHARED_DATA) / "opencv_chessboard_stereo";
  if (!std::filesystem::exists(folder / "left_intrinsics.yml")) GTEST_SKIP() << "no " << folder;
  const Imported in = import(folder / "left_intrinsics.yml");
  ASSERT_EQ(in.rig.cameras.size(), 1u);
  EXPECT_EQ(in.rig.cameras[0].image_size, (calib::ImageSize{640, 480}));
  expect_projects_like_opencv(
      in.rig.cameras[0],
      {535.91573396163199, 0, 342.28315473308373, 0, 535.91573396163199, 235.57082909788173, 0, 0, 1},
      {-0.26637260909660682, -0.038588898922304653, 0.0017831947042852964, -0.00028122100441115472,
       0.23839153080878486},
      cv::Mat::zeros(3, 1, CV_64F), {0, 0, 0});
  EXPECT_THAT(in.notes, Contains(AllOf(HasSubstr("not taken over"), HasSubstr("avg_reprojection_error"))));
  // Two lenses, but not their relative pose; and no size.
  EXPECT_THAT([&] { import(folder / "intrinsics.yml"); },
              testing::Throws<files::ConfigError>(testing::Property(&files::ConfigError::what, HasSubstr("--size"))));
  EXPECT_THAT(
      [&] {
        import(folder / "intrinsics.yml", {.image_size = calib::ImageSize { 640, 480 }});
      },
      testing::Throws<files::ConfigError>(testing::Property(&files::ConfigError::what, HasSubstr("extrinsics.yml"))));
}

TEST_F(Exchange, OpenCvRoundTrips) {
  for (const char* extension : {"yml", "xml", "json"}) {
    for (const bool fisheye : {false, true}) {
      SCOPED_TRACE(std::string(extension) + (fisheye ? ", fisheye" : ""));
      const calib::CameraRig rig = some_rig(fisheye);
      expect_same(rig, and_back(rig, {.format = ExchangeFormat::opencv, .extension = extension}).rig);
      const calib::CameraRig pair{{rig.cameras[0], rig.cameras[1]}, {}};
      const ExportOptions stereo{.format = ExchangeFormat::opencv, .extension = extension, .stereo = true};
      EXPECT_THAT(export_rig(pair, stereo).notes, Contains(HasSubstr("the world becomes cam0's frame")));
      expect_same(from_first(pair), and_back(pair, stereo).rig);
    }
  }
}

// As samples/cpp/stereo_calib.cpp writes them: two files.
TEST_F(Exchange, OpenCvStereoFiles) {
  const auto matrix = [](const char* name, int rows, int cols, const char* data) {
    return std::string(name) + ": !!opencv-matrix\n   rows: " + std::to_string(rows) +
           "\n   cols: " + std::to_string(cols) + "\n   dt: d\n   data: [ " + data + " ]\n";
  };
  const std::string lens =
      matrix("M1", 3, 3, "534., 0., 335., 0., 534., 240., 0., 0., 1.") + matrix("D1", 1, 5, "0.29, -1.03, 0., 0., 0.") +
      matrix("M2", 3, 3, "535., 0., 334., 0., 535., 242., 0., 0., 1.") + matrix("D2", 1, 5, "-0.16, -0.11, 0., 0., 0.");
  const std::string rotation =
      "0.99998854, 0.00216014, 0.00427195, -0.00221074, 0.99992702, 0.01187697, -0.00424598, -0.01188627, 0.99992034";
  const auto intrinsics = file("intrinsics.yml", "%YAML:1.0\n---\n" + lens);
  const std::vector<std::filesystem::path> both{
      intrinsics, file("extrinsics.yml", "%YAML:1.0\n---\n" + matrix("R", 3, 3, rotation.c_str()) +
                                             matrix("T", 3, 1, "-3.3, 0.04, 0.01") + matrix("Q", 1, 1, "1."))};
  const ImportOptions options{.image_size = calib::ImageSize{640, 480},
                              .metres_per_unit = 0.025};  // in squares of 25 mm
  const Imported in = import_rig(both, options);
  ASSERT_EQ(in.rig.cameras.size(), 2u);
  EXPECT_NEAR(in.rig.cameras[1].cam_from_world.translation.x(), -0.0825, 1e-12);
  EXPECT_THAT(in.notes, Contains(AllOf(HasSubstr("extrinsics.yml"), HasSubstr("Q"))));
  const std::vector<std::filesystem::path> mirrored{
      intrinsics, file("mirrored.yml", "%YAML:1.0\n---\n" + matrix("R", 3, 3, "1., 0., 0., 0., 1., 0., 0., 0., -1.") +
                                           matrix("T", 3, 1, "-3.3, 0.04, 0.01"))};
  EXPECT_THAT([&] { import_rig(mirrored, options); },
              testing::Throws<files::ConfigError>(testing::Property(
                  &files::ConfigError::what, AllOf(HasSubstr("mirrored.yml:3"), HasSubstr("mirrored (determinant")))));
}

TEST_F(Exchange, OpenCvErrors) {
  EXPECT_THAT(error_of("a.yml", "%YAML:1.0\n---\ncamera_matrix: [1, 2\nfoo: }"), HasSubstr("a.yml"));
  EXPECT_THAT(error_of("b.xml",
                       "<?xml version=\"1.0\"?>\n<opencv_storage>\n<K "
                       "type_id=\"opencv-matrix\"><rows>2</rows><cols>2</cols><dt>d</dt><data>1. 2. 3. 4.</data></K>\n"
                       "<D>0. 0. 0. 0.</D>\n</opencv_storage>\n"),
              AllOf(HasSubstr("b.xml:3"), HasSubstr("3x3")));
  EXPECT_THAT(error_of("c.xml", "<?xml n="), AllOf(HasSubstr("c.xml:1"), HasSubstr("is not valid XML")));
  EXPECT_THAT(error_of("d.xml", "<?xml version=  image\xff?>\n<opencv_storage></opencv_storage>\n"),
              HasSubstr("no camera matrix"));
  EXPECT_THAT(error_of("e.xml", "<?xml version=\"1.0\"?>\n<opencv_storage\n<K>"),
              AllOf(HasSubstr("e.xml:2"), HasSubstr("is not valid XML")));
  EXPECT_THAT(error_of("f.xml", "<?xml version=\"1.0\"?>\n<!-- a > b = c"), HasSubstr("is not valid XML"));
}

TEST_F(Exchange, CaliscopeAndAnipose) {
  for (const bool fisheye : {false, true}) {
    const calib::CameraRig rig = some_rig(fisheye);
    expect_same(rig, and_back(rig, {.format = ExchangeFormat::aniposelib}).rig);
    const Imported back = and_back(rig, {.format = ExchangeFormat::caliscope});
    expect_same(rig, back.rig, false);
    EXPECT_THAT(export_rig(rig, {.format = ExchangeFormat::caliscope}).notes, Contains(HasSubstr("cam1 is cam_1")));
  }
}

TEST_F(Exchange, DetectsTheFormatByItsKeys) {
  const auto format_of = [&](const std::string& name, const std::string& text) {
    return detect_format(file(name, text));
  };
  EXPECT_EQ(format_of("a.toml", "\n  [cameras.0]\ncam_id = 0\nmatrix = []\n"), ExchangeFormat::caliscope);
  EXPECT_EQ(format_of("b.toml", "[cam_0]\nport\t= 0\nmatrix = []"), ExchangeFormat::caliscope);
  EXPECT_EQ(format_of("c.toml", "[left]\nname = \"report = port\"\nmatrix = []\n"), ExchangeFormat::aniposelib);
  EXPECT_EQ(format_of("d.yaml", "cam0 :\r\n  camera_model: pinhole\r\n  intrinsics: []\r\n"), ExchangeFormat::kalibr);
  // The syntax and the first line say nothing of the tool.
  EXPECT_EQ(format_of("e.yml", "%YAML:1.0\n---\ncamera_matrix: {}\ndistortion_model: x\n"), ExchangeFormat::ros);
  EXPECT_EQ(format_of("f.yaml", "camera_matrix: {}\n"), ExchangeFormat::opencv);
  EXPECT_THROW(format_of("g.yaml", "cam0:\n  x: 1 camera_model: pinhole\n"), files::ConfigError);
  const std::string blanks(2'000'000, ' ');
  EXPECT_THROW(format_of("h.toml", "x = \"" + blanks + "[cam\"\n"), files::ConfigError);
}

// Each of these overflows the stack of a recursive parser.
TEST_F(Exchange, RejectsDeepNestingBeforeParsing) {
  const auto repeated = [](const std::string& text, int times) {
    std::string out;
    for (int i = 0; i < times; ++i) out += text;
    return out;
  };
  const std::pair<std::string, std::string> files[] = {
      {"lists.json", "{\"camera_matrix\":" + repeated("[", 40'000)},
      {"lists.yml", "%YAML:1.0\n---\ncamera_matrix: " + repeated("[", 400'000)},
      {"sequences.yml", "%YAML:1.0\n---\nK:\n   " + repeated("- ", 300'000) + "1\n"},
      {"tags.xml", "<?xml version=\"1.0\"?>\n<opencv_storage>" + repeated("<a>", 200'000)},
      {"dotted.toml", "[cam_0]\n" + repeated("a.", 200'000) + "a = 1\n"},
      {"binary.yml", "%YAML:1.0\n---\nK: !!binary |\n  " + repeated("A", 40) + "\n"},
      {"tagged.yml", "%YAML:1.0\n---\nK: !<tag:yaml.org,2002:binary> |\n  " + repeated("A", 40) + "\n"},
      {"binary.json", "{\"K\": \"$base64$" + repeated("A", 40) + "\"}"},
      {"blank.yaml", repeated("\n", 40'000)},
      {"blank.toml", std::string(1'000'000, ' ')},
  };
  for (const auto& [name, text] : files) {
    std::ofstream(folder_ / name) << text;
    const std::filesystem::path file[] = {folder_ / name};
    EXPECT_THROW(import_rig(file), files::ConfigError) << name;
    for (const ExchangeFormat format : {ExchangeFormat::ros, ExchangeFormat::opencv, ExchangeFormat::kalibr,
                                        ExchangeFormat::aniposelib, ExchangeFormat::caliscope})
      EXPECT_THROW(import_rig(file, {.format = format}), files::ConfigError) << name;
  }
}

// ---- ROS bags

recordings::WrittenMessage bag_picture(const std::string& camera) {
  return {"/" + camera + "/image_raw", "sensor_msgs/msg/Image", 1,
          recordings::raw_image({}, 1, 2, 2, "mono8", 2, "abcd")};
}

recordings::WrittenMessage bag_info(const std::string& camera, const std::string& model, const std::vector<double>& d,
                                    double fx = 500) {
  recordings::MessageBytes bytes({});
  bytes.header(1, camera + "_optical").number(std::uint32_t{480}).number(std::uint32_t{640}).text(model);
  bytes.number(static_cast<std::uint32_t>(d.size())).numbers(d);
  bytes.numbers(std::array{fx, 0.0, 320.0, 0.0, fx, 240.0, 0.0, 0.0, fx == 0 ? 0.0 : 1.0});
  bytes.numbers(std::array<double, 21>{}).number(std::uint32_t{0}).number(std::uint32_t{0});
  bytes.numbers(std::array<std::uint32_t, 4>{}).number(std::uint8_t{0});
  return {"/" + camera + "/camera_info", "sensor_msgs/msg/CameraInfo", 1, bytes.done()};
}

// parent, child, x: without a rotation
recordings::WrittenMessage bag_tf(const std::vector<std::tuple<std::string, std::string, double>>& transforms) {
  recordings::MessageBytes bytes({});
  bytes.number(static_cast<std::uint32_t>(transforms.size()));
  for (const auto& [parent, child, x] : transforms)
    bytes.header(1, parent).text(child).numbers(std::array{x, 0.0, 0.0}).numbers(std::array{0.0, 0.0, 0.0, 1.0});
  return {"/tf_static", "tf2_msgs/msg/TFMessage", 1, bytes.done()};
}

TEST_F(Exchange, BagGivesLensesAndPoses) {
  const auto bag = file("run.mcap", recordings::mcap_of({bag_picture("left"), bag_picture("right"),
                                                         bag_info("left", "plumb_bob", {0.1, 0.2, 0.3, 0.4, 0.5}),
                                                         bag_info("right", "equidistant", {0.1, 0.2, 0.3, 0.4}, 400),
                                                         bag_tf({{"base", "mount", 1}, {"mount", "left_optical", 2}}),
                                                         bag_tf({{"mount", "right_optical", 5}})}));
  const Imported imported = import(bag);
  ASSERT_EQ(imported.rig.cameras.size(), 2u);
  const calib::Camera &left = imported.rig.cameras[0], &right = imported.rig.cameras[1];
  EXPECT_EQ(left.name, "left");
  EXPECT_EQ(left.image_size, (calib::ImageSize{640, 480}));
  EXPECT_EQ(left.model.fx(), 500);
  EXPECT_EQ(right.model.name(), "fisheye_kb");
  EXPECT_NEAR(left.centre().x(), 3, 1e-12);
  EXPECT_NEAR(right.centre().x(), 6, 1e-12);
  EXPECT_THAT(imported.notes, Contains(HasSubstr("the world is its frame base")));
}

TEST_F(Exchange, BagWithoutPosesNamesThem) {
  const auto bag =
      file("run.mcap", recordings::mcap_of({bag_picture("left"), bag_picture("right"), bag_picture("third"),
                                            bag_info("left", "plumb_bob", {}), bag_info("right", "plumb_bob", {}),
                                            bag_tf({{"a", "left_optical", 2}, {"b", "right_optical", 1}})}));
  const auto error_of_import = [&](const ImportOptions& options) {
    try {
      import(bag, options);
    } catch (const files::ConfigError& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(error_of_import({}), AllOf(HasSubstr("run.mcap: has lenses, but no poses"), HasSubstr("--cameras NAME")));
  EXPECT_EQ(error_of_import({.cameras = {"left"}}), "no error");
  EXPECT_THAT(error_of_import({.cameras = {"third"}}),
              HasSubstr("camera third has no CameraInfo beside /third/image_raw"));
}

TEST_F(Exchange, BagWithAnUncalibratedCameraSaysSo) {
  const auto bag = file("run.mcap", recordings::mcap_of({bag_picture("cam"), bag_info("cam", "plumb_bob", {}, 0)}));
  EXPECT_THAT([&] { import(bag); }, testing::ThrowsMessage<files::ConfigError>(
                                        AllOf(HasSubstr("holds no lens of a camera"),
                                              HasSubstr("not calibrated (K is 0)"), HasSubstr("intrinsics"))));
  const auto odd = file("odd.mcap", recordings::mcap_of({bag_picture("cam"), bag_info("cam", "kannala", {1, 2})}));
  EXPECT_THAT([&] { import(odd); },
              testing::ThrowsMessage<files::ConfigError>(HasSubstr("distortion_model is \"kannala\"")));
}

// Three cameras 3 m around a place near the world's origin, which they look at.
std::string three_cameras(const std::string& pose_key, bool is_inverted, const Eigen::Vector3d& at = {0.2, -0.1, 0.3},
                          double step_rad = 0.8, const Eigen::Vector3d& axes = {1, 1, 1}) {
  std::string text = "{";
  for (int c = 0; c < 3; ++c) {
    const Eigen::Vector3d centre(3 * std::cos(step_rad * c), 3 * std::sin(step_rad * c), 1.5);
    const Eigen::Vector3d z = (at - centre).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose.block<1, 3>(0, 0) = x.transpose();
    pose.block<1, 3>(1, 0) = z.cross(x).transpose();
    pose.block<1, 3>(2, 0) = z.transpose();
    pose.topLeftCorner<3, 3>() = axes.asDiagonal() * pose.topLeftCorner<3, 3>();
    pose.block<3, 1>(0, 3) = -pose.block<3, 3>(0, 0) * centre;
    if (is_inverted) pose = pose.inverse().eval();
    std::ostringstream rows;
    rows << pose.format(Eigen::IOFormat(15, Eigen::DontAlignCols, ", ", ", ", "[", "]", "[", "]"));
    text += fmt::format(
        R"({}"cam{}": {{"K": [[500,0,320],[0,500,240],[0,0,1]], "D": [0.1,0,0,0,0], "size": [640,480], "{}": {}}})",
        c == 0 ? "" : ",", c, pose_key, rows.str());
  }
  return text + "}";
}

void expect_three(const Imported& in) {
  ASSERT_EQ(in.rig.cameras.size(), 3u);
  EXPECT_NEAR(in.rig.cameras[1].centre().x(), 3 * std::cos(0.8), 1e-9);
  EXPECT_NEAR(in.rig.cameras[2].centre().z(), 1.5, 1e-9);
}

std::string all_replaced(std::string text, const std::string& what, const std::string& by) {
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
  return text;
}

TEST_F(Exchange, MatricesOfPosesByTheirNames) {
  const Imported in = import_text("a.json", three_cameras("cam_from_world", false));
  expect_three(in);
  EXPECT_THAT(in.notes, testing::Not(Contains(HasSubstr("--inverted-poses"))));
  expect_three(import_text("b.json", three_cameras("T_world_cam", true)));
  expect_three(import_text("c.json", three_cameras("T", false)));
}

// 0.15 m apart, though they would look at one place.
TEST_F(Exchange, InvertedPosesAreShownBesideTheOthers) {
  const std::string wrong = three_cameras("extrinsics", true);
  const Imported either = import_text("a.json", wrong);
  EXPECT_TRUE(either.is_doubtful);
  EXPECT_THAT(either.notes,
              Contains(AllOf(HasSubstr("up to 0.150 m apart"),
                             HasSubstr("--inverted-poses), they are up to 4.304 m apart"), HasSubstr("a place 3.1"))));
  const Imported in = import_text("b.json", wrong, {.inverts_poses = true});
  EXPECT_FALSE(in.is_doubtful);
  expect_three(in);
  EXPECT_THAT(in.notes, testing::Not(Contains(HasSubstr("--inverted-poses"))));
}

// If the world is the frame of one camera, inverting right poses spreads the cameras, but not by much.
TEST_F(Exchange, ARigInACamerasFrameIsNotDoubtful) {
  Imported in = import_text("a.json", three_cameras("extrinsics", false, {0.6, -0.5, 0.3}, 2.1));
  const calib::Rigid3d world_from_first = calib::inverse(in.rig.cameras[0].cam_from_world);
  for (calib::Camera& camera : in.rig.cameras) camera.cam_from_world = camera.cam_from_world * world_from_first;
  EXPECT_FALSE(and_back(in.rig, {.format = ExchangeFormat::opencv}).is_doubtful);
}

// On a ring around the world's z axis, inverted poses are all at one place.
TEST_F(Exchange, InvertedPosesOfARingNameTheOption) {
  const std::string ring = three_cameras("extrinsics", true, {0, 0, 0.3});
  EXPECT_THAT([&] { import_text("ring.json", ring); },
              testing::ThrowsMessage<files::ConfigError>(
                  AllOf(HasSubstr("ring.json"), HasSubstr("are up to 4."), HasSubstr("give --inverted-poses"))));
  EXPECT_EQ(import_text("ring.json", ring, {.inverts_poses = true}).rig.cameras.size(), 3u);
}

TEST_F(Exchange, PosesThatOnlyInvertedLookAtOnePlaceAreDoubtful) {
  const std::string wrong = three_cameras("extrinsics", true, {0.6, -0.5, 0.3}, 2.1);
  const Imported doubtful = import_text("a.json", wrong);
  EXPECT_TRUE(doubtful.is_doubtful);
  EXPECT_THAT(doubtful.notes, Contains(HasSubstr("the file is probably of that kind")));
  EXPECT_FALSE(import_text("b.json", wrong, {.inverts_poses = true}).is_doubtful);
  EXPECT_FALSE(import_text("c.json", three_cameras("extrinsics", false, {0.6, -0.5, 0.3}, 2.1)).is_doubtful);
}

// As NeRF's transforms.json, Blender and OpenGL write them.
TEST_F(Exchange, OpenGlAxesAreRecognised) {
  const auto opengl = [&](bool is_inverted, double step_rad) {
    return three_cameras(is_inverted ? "T_world_cam" : "extrinsics", is_inverted, {0.6, -0.5, 0.3}, step_rad,
                         Eigen::Vector3d(1, -1, -1));
  };
  const Imported doubtful = import_text("a.json", opengl(true, 2.1));
  EXPECT_TRUE(doubtful.is_doubtful);
  EXPECT_THAT(doubtful.notes, Contains(AllOf(HasSubstr("--camera-axes opengl)"), HasSubstr("probably of that kind"))));
  const Imported in = import_text("b.json", opengl(true, 0.8), {.has_opengl_axes = true});
  EXPECT_FALSE(in.is_doubtful);
  expect_three(in);
  expect_three(import_text("c.json", opengl(false, 0.8), {.has_opengl_axes = true}));
  EXPECT_FALSE(import_text("d.json", three_cameras("extrinsics", false, {0.6, -0.5, 0.3}, 2.1)).is_doubtful);
}

TEST_F(Exchange, KeysOfOnesOwn) {
  const std::string text = all_replaced(three_cameras("where", false), "\"K\"", "\"lens_matrix\"");
  EXPECT_THAT(error_of("a.json", text), HasSubstr("camera matrix: is missing"));
  const Imported in = import_text("b.json", text, {.keys = {{"lens_matrix", "K"}, {"where", "cam_from_world"}}});
  expect_three(in);
  EXPECT_EQ(in.rig.cameras[0].model.fx(), 500);
  EXPECT_THAT(error_of("c.json", text, {.keys = {{"lens_matrix", "K"}, {"pose", "cam_from_world"}}}),
              HasSubstr("has no key pose, which was given for cam_from_world"));
}

TEST_F(Exchange, TheDistortionModelMayBeGiven) {
  const std::string text = all_replaced(three_cameras("cam_from_world", false), "[0.1,0,0,0,0]", "[0.1,0,0,0]");
  const Imported fisheye = import_text("a.json", text, {.distortion_model = "equidistant"});
  EXPECT_EQ(fisheye.rig.cameras[0].model.name(), "fisheye_kb");
  EXPECT_THAT(error_of("b.json", text, {.distortion_model = "ds"}), HasSubstr("is ds, which a rig cannot hold"));
}

TEST_F(Exchange, AStereoPairWithSidesInItsKeys) {
  const std::string text =
      "{\"KR\": [[510,0,320],[0,510,240],[0,0,1]], \"DR\": [0.1,0,0,0,0], \"KL\": [[500,0,320],[0,500,240],[0,0,1]], "
      "\"DL\": [0.2,0,0,0,0], \"R\": [[1,0,0],[0,1,0],[0,0,1]], \"T\": [-0.12,0,0], \"size\": [640,480]}";
  const Imported in = import_text("stereo.json", text);
  ASSERT_EQ(in.rig.cameras.size(), 2u);
  EXPECT_EQ(in.rig.cameras[0].name, "left");
  EXPECT_EQ(in.rig.cameras[0].model.fx(), 500);
  EXPECT_NEAR(in.rig.cameras[1].centre().x(), 0.12, 1e-9);
}

}  // namespace
}  // namespace huetrack::exchange
