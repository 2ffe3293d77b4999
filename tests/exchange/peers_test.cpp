// What users of other tools bring, written as those tools write it, from one rig: imported exactly.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>

#include "calib/exchange/exchange.h"
#include "calib/files/config_error.h"

namespace huetrack::exchange {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

// Two cameras, in metres, with OpenCV's five coefficients (the last one is 0: Kalibr has four).
calib::CameraRig truth() {
  calib::CameraRig rig;
  for (int c = 0; c < 2; ++c) {
    calib::Camera camera;
    camera.name = c == 0 ? "left" : "right";
    camera.image_size = {320, 240};
    camera.model =
        calib::CameraModel(calib::PinholeRadtan{241.734 + c, 241.5, 157.3, 122.4 - c, {-0.145, 0.033, -4e-4, 5e-4}});
    camera.cam_from_world = {
        Eigen::Quaterniond(Eigen::AngleAxisd(0.7 + c, Eigen::Vector3d(1, 0.2 - c, 0.3).normalized())),
        {0.1 - c, 0.4, 2.5 + 0.5 * c}};
    rig.cameras.push_back(camera);
  }
  return rig;
}

std::string numbers(const std::vector<double>& values) {
  return fmt::format("{}", fmt::join(values, ", "));
}
std::vector<double> k_of(const calib::Camera& c) {
  return {c.model.fx(), 0, c.model.cx(), 0, c.model.fy(), c.model.cy(), 0, 0, 1};
}
std::vector<double> d_of(const calib::Camera& c, std::size_t count = 5) {
  const auto& d = std::get<calib::PinholeRadtan>(c.model.lens()).distortion;
  std::vector<double> out(d.begin(), d.end());
  out.resize(count);
  return out;
}
std::vector<double> rotation_of(const calib::Rigid3d& pose) {
  const Eigen::Matrix3d r = pose.rotation.toRotationMatrix();
  std::vector<double> out;
  for (int i = 0; i < 3; ++i) out.insert(out.end(), {r(i, 0), r(i, 1), r(i, 2)});
  return out;
}
std::vector<double> vector_of(const calib::Rigid3d& pose) {
  const Eigen::AngleAxisd turn(pose.rotation);
  const Eigen::Vector3d v = turn.angle() * turn.axis();
  return {v.x(), v.y(), v.z()};
}
std::vector<double> translation_of(const calib::Rigid3d& pose, double unit = 1) {
  return {pose.translation.x() / unit, pose.translation.y() / unit, pose.translation.z() / unit};
}
std::vector<double> matrix_of(const calib::Rigid3d& pose) {
  const auto r = rotation_of(pose), t = translation_of(pose);
  return {r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2], 0, 0, 0, 1};
}
std::string rows_of(const std::vector<double>& m, std::size_t columns) {
  std::string out;
  for (std::size_t i = 0; i < m.size(); i += columns)
    out += "  - [" + numbers({m.begin() + long(i), m.begin() + long(i + columns)}) + "]\n";
  return out;
}
std::string opencv_matrix(const std::string& key, int rows, const std::vector<double>& values,
                          const std::string& indent = "") {
  return fmt::format("{0}{1}: !!opencv-matrix\n{0}   rows: {2}\n{0}   cols: {3}\n{0}   dt: d\n{0}   data: [ {4} ]\n",
                     indent, key, rows, int(values.size()) / rows, numbers(values));
}

class Peers : public testing::Test {
 protected:
  Peers()
      : folder_(std::filesystem::path(testing::TempDir()) /
                ("peers_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~Peers() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path file(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  Imported import(const std::string& name, const std::string& text, const ImportOptions& options = {}) const {
    const std::filesystem::path files[] = {file(name, text)};
    return import_rig(files, options);
  }
  std::string error_of(const std::string& name, const std::string& text, const ImportOptions& options = {}) const {
    try {
      import(name, text, options);
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path folder_;
};

void expect_lens(const calib::Camera& is, const calib::Camera& should) {
  EXPECT_EQ(is.image_size, should.image_size);
  EXPECT_EQ(is.model.fx(), should.model.fx());
  EXPECT_EQ(is.model.fy(), should.model.fy());
  EXPECT_EQ(is.model.cx(), should.model.cx());
  EXPECT_EQ(is.model.cy(), should.model.cy());
  ASSERT_TRUE(std::holds_alternative<calib::PinholeRadtan>(is.model.lens()));
  EXPECT_EQ(std::get<calib::PinholeRadtan>(is.model.lens()).distortion,
            std::get<calib::PinholeRadtan>(should.model.lens()).distortion);
}
// world: the truth's in the rig's.
void expect_rig(const calib::CameraRig& is, const calib::Rigid3d& world = {}) {
  const calib::CameraRig should = truth();
  ASSERT_EQ(is.cameras.size(), should.cameras.size());
  for (std::size_t c = 0; c < is.cameras.size(); ++c) {
    expect_lens(is.cameras[c], should.cameras[c]);
    const calib::Rigid3d pose = is.cameras[c].cam_from_world * world, true_pose = should.cameras[c].cam_from_world;
    EXPECT_LT((pose.translation - true_pose.translation).norm(), 1e-9) << c;
    EXPECT_LT((pose.rotation.toRotationMatrix() - true_pose.rotation.toRotationMatrix()).norm(), 1e-9) << c;
  }
}

std::string toml_section(const std::string& name, const calib::Camera& camera, double unit, bool posed = true) {
  const auto k = k_of(camera);
  std::string out = fmt::format(
      "[{}]\nname = \"{}\"\nsize = [ 320.0, 240.0]\nmatrix = [ [ {}, 0.0, {}], [ 0.0, {}, {}], [ 0.0, 0.0, 1.0]]\n"
      "distortions = [ {}]\n",
      name, camera.name, k[0], k[2], k[4], k[5], numbers(d_of(camera, 4)));
  if (posed)
    out += fmt::format("rotation = [ {}]\ntranslation = [ {}]\n", numbers(vector_of(camera.cam_from_world)),
                       numbers(translation_of(camera.cam_from_world, unit)));
  return out;
}

TEST_F(Peers, Pose2Sim) {
  std::string text;
  for (const auto& camera : truth().cameras)
    text += toml_section("int_" + camera.name + "_img", camera, 1) + "fisheye = false\n\n";
  const Imported in = import("Calib_scene.toml", text + "[metadata]\nadjusted = false\nerror = 0.0\n");
  expect_rig(in.rig);
  EXPECT_EQ(in.rig.cameras[1].name, "right");
}

TEST_F(Peers, Freemocap2IsInMillimetres) {
  std::string text;
  for (const auto& camera : truth().cameras) {
    const auto r = rotation_of(camera.cam_from_world);
    text += toml_section("Camera_00_" + camera.name, camera, 1e-3) + "world_position = [1.0, 2.0, 3.0]\n" +
            "world_orientation = [[" + numbers({r[0], r[1], r[2]}) + "]]\n\n";
  }
  text += "[metadata]\nreprojection_error_px = 0.41\n[metadata.board]\nsquares_x = 5\n";
  EXPECT_THAT(error_of("freemocap.toml", text), HasSubstr("--unit mm"));
  const Imported in = import("freemocap.toml", text, {.metres_per_unit = 1e-3});
  expect_rig(in.rig);
  EXPECT_THAT(in.rig.made_by, Contains(testing::Pair("reprojection_error_px", "0.41")));
  EXPECT_THAT(in.notes, Contains(AllOf(HasSubstr("not taken over"), HasSubstr("world_position"))));
}

TEST_F(Peers, NamesThatACameraCannotHaveAreCleaned) {
  calib::CameraRig rig = truth();
  rig.cameras[0].name = "GoPro 1 (left)";
  const Imported in = import("a.toml", toml_section("cam_0", rig.cameras[0], 1));
  EXPECT_EQ(in.rig.cameras[0].name, "GoPro_1__left_");
  EXPECT_THAT(in.notes, Contains(HasSubstr("GoPro 1 (left) is named GoPro_1__left_")));
}

// After Caliscope's intrinsic stage there are no poses: one camera can be taken, and nothing is asked of the others.
TEST_F(Peers, CaliscopeBeforeItsExtrinsicStage) {
  std::string text;
  for (const int c : {0, 1}) {
    text += toml_section(fmt::format("cameras.{}", c), truth().cameras[std::size_t(c)], 1, false) +
            fmt::format("cam_id = {}\nrotation_count = 0\n", c);
    text.erase(text.find("name = "), text.find("size", text.find("name = ")) - text.find("name = "));
  }
  EXPECT_THAT(error_of("camera_array.toml", text),
              AllOf(HasSubstr("no poses for cam_0, cam_1"), HasSubstr("--cameras cam_0")));
  const Imported in = import("camera_array.toml", text, {.cameras = {"cam_1"}});
  ASSERT_EQ(in.rig.cameras.size(), 1u);
  EXPECT_EQ(in.rig.cameras[0].name, "cam_1");
  expect_lens(in.rig.cameras[0], truth().cameras[1]);
  EXPECT_THAT(error_of("camera_array.toml", text, {.cameras = {"cam_7"}}),
              HasSubstr("has no camera cam_7; it has cam_0, cam_1"));
}

std::string kalibr_section(int c, const std::string& pose_key, const calib::Rigid3d& pose) {
  const calib::Camera camera = truth().cameras[std::size_t(c)];
  const auto k = k_of(camera);
  std::string rows = rows_of(matrix_of(pose), 4);
  return fmt::format(
      "cam{}:\n  camera_model: pinhole\n  distortion_coeffs: [{}]\n  distortion_model: radtan\n  intrinsics: [{}]\n"
      "  resolution: [320, 240]\n  rostopic: /cam{}/image_raw\n  cam_overlaps: [{}]\n{}",
      c, numbers(d_of(camera, 4)), numbers({k[0], k[4], k[2], k[5]}), c, 1 - c,
      pose_key.empty() ? "" : "  " + pose_key + ": #comment\n" + rows);
}

TEST_F(Peers, KalibrAndOpenVinsInTheFrameOfTheImu) {
  const calib::CameraRig rig = truth();
  std::string cam_imu, imu_cam;
  for (const int c : {0, 1}) {
    const calib::Rigid3d& pose = rig.cameras[std::size_t(c)].cam_from_world;
    cam_imu += kalibr_section(c, "T_cam_imu", pose);
    imu_cam += kalibr_section(c, "T_imu_cam", calib::inverse(pose));
  }
  const Imported kalibr = import("camchain-imucam.yaml", cam_imu);
  expect_rig(kalibr.rig);
  EXPECT_THAT(kalibr.notes, Contains(HasSubstr("the world is the IMU's frame")));
  expect_rig(import("kalibr_imucam_chain.yaml", "%YAML:1.0\n\n" + imu_cam).rig);
}

TEST_F(Peers, KalibrChainHasTheFirstCamerasFrame) {
  const calib::CameraRig rig = truth();
  const calib::Rigid3d first = rig.cameras[0].cam_from_world, second = rig.cameras[1].cam_from_world;
  const Imported in = import(
      "camchain.yaml", kalibr_section(0, "", {}) + kalibr_section(1, "T_cn_cnm1", second * calib::inverse(first)));
  expect_rig(in.rig, first);
  // One camera of the chain keeps its pose in it.
  const Imported one = import(
      "camchain.yaml", kalibr_section(0, "", {}) + kalibr_section(1, "T_cn_cnm1", second * calib::inverse(first)),
      {.cameras = {"cam1"}});
  ASSERT_EQ(one.rig.cameras.size(), 1u);
  EXPECT_LT((one.rig.cameras[0].centre() - in.rig.cameras[1].centre()).norm(), 1e-12);
}

TEST_F(Peers, MulticalKeepsPosesApart) {
  const calib::CameraRig rig = truth();
  const calib::Rigid3d first = rig.cameras[0].cam_from_world;
  std::string lenses, poses;
  for (const int c : {0, 1}) {
    const calib::Camera& camera = rig.cameras[std::size_t(c)];
    const calib::Rigid3d pose = camera.cam_from_world * calib::inverse(first);
    const std::string comma = c > 0 ? ", " : "";
    lenses += fmt::format(R"({}"cam{}": {{"image_size": [320, 240], "K": [{}], "dist": [{}]}})", comma, c,
                          numbers(k_of(camera)), numbers(d_of(camera)));
    poses += fmt::format(R"({}"cam{}": {{"R": [{}], "T": [{}]}})", comma, c == 0 ? "0" : "1_to_cam0",
                         numbers(rotation_of(pose)),
                         numbers({pose.translation.x(), pose.translation.y(), pose.translation.z()}));
  }
  expect_rig(import("calibration.json", "{\"cameras\": {" + lenses + "}, \"camera_poses\": {" + poses + "}}").rig,
             first);
}

TEST_F(Peers, EasyMocap) {
  std::string intri = "%YAML:1.0\n---\nnames:\n   - \"1\"\n   - \"2\"\n", extri = intri;
  for (const int c : {0, 1}) {
    const calib::Camera camera = truth().cameras[std::size_t(c)];
    const std::string id = std::to_string(c + 1);
    intri += opencv_matrix("K_" + id, 3, k_of(camera)) + opencv_matrix("dist_" + id, 1, d_of(camera));
    extri += opencv_matrix("R_" + id, 3, vector_of(camera.cam_from_world)) +
             opencv_matrix("Rot_" + id, 3, rotation_of(camera.cam_from_world)) +
             opencv_matrix("T_" + id, 3, translation_of(camera.cam_from_world));
  }
  const std::filesystem::path both[] = {file("intri.yml", intri), file("extri.yml", extri)};
  const ImportOptions size{.image_size = calib::ImageSize{320, 240}};
  const Imported in = import_rig(both, size);
  expect_rig(in.rig);
  EXPECT_EQ(in.rig.cameras[0].name, "1");
  // Either order; and what is missing is named.
  const std::filesystem::path swapped[] = {both[1], both[0]};
  expect_rig(import_rig(swapped, size).rig);
  EXPECT_THAT(error_of("intri.yml", intri, size), AllOf(HasSubstr("no poses for 1, 2"), HasSubstr("extri.yml")));
  EXPECT_THAT(error_of("intri.yml", intri), HasSubstr("--size"));
  EXPECT_THAT(error_of("extri.yml", extri), AllOf(HasSubstr("EasyMocap"), HasSubstr("intri.yml")));
}

TEST_F(Peers, McCalibsPosesAreTheCameras) {
  std::string text = "%YAML:1.0\n---\nnb_camera: 2\n";
  for (const int c : {0, 1}) {
    const calib::Camera camera = truth().cameras[std::size_t(c)];
    text += fmt::format("camera_{}:\n", c) + opencv_matrix("camera_matrix", 3, k_of(camera), "   ") +
            opencv_matrix("distortion_vector", 1, d_of(camera), "   ") +
            "   distortion_type: 0\n   camera_group: 0\n   img_width: 320\n   img_height: 240\n" +
            opencv_matrix("camera_pose_matrix", 4, matrix_of(calib::inverse(camera.cam_from_world)), "   ");
  }
  const Imported in = import("calibrated_cameras_data.yml", text);
  expect_rig(in.rig);
  EXPECT_EQ(in.rig.cameras[1].name, "camera_1");
  const auto at = text.rfind("camera_group: 0");
  EXPECT_THAT(error_of("groups.yml", text.substr(0, at) + "camera_group: 1" + text.substr(at + 15)),
              HasSubstr("the poses of groups are unrelated"));
}

std::string photonvision(const calib::Camera& camera, int width) {
  return fmt::format(
      R"({{"resolution":{{"width":{},"height":240.0}},"cameraIntrinsics":{{"rows":3,"cols":3,"type":6,"data":[{}]}},
"distCoeffs":{{"rows":1,"cols":8,"type":6,"data":[{}]}},"calobjectWarp":[0.0,0.0],"observations":[],
"calobjectSize":{{"width":7.0,"height":7.0}},"calobjectSpacing":0.0254,"lensmodel":"LENSMODEL_OPENCV"}})",
      width, numbers(k_of(camera)), numbers(d_of(camera, 8)));
}

TEST_F(Peers, PhotonVision) {
  const calib::Camera camera = truth().cameras[0];
  const Imported in = import("front.json", photonvision(camera, 320));
  ASSERT_EQ(in.rig.cameras.size(), 1u);
  EXPECT_EQ(in.rig.cameras[0].name, "front");
  expect_lens(in.rig.cameras[0], camera);
  // Its settings have a calibration per resolution.
  const std::string settings = R"({"nickname":"front","FOV":70.0,"calibrations":[)" +
                               photonvision(truth().cameras[1], 640) + "," + photonvision(camera, 320) + "]}";
  EXPECT_THAT(error_of("config.json", settings), AllOf(HasSubstr("640x240, 320x240"), HasSubstr("--size")));
  const Imported one = import("config.json", settings, {.image_size = calib::ImageSize{320, 240}});
  ASSERT_EQ(one.rig.cameras.size(), 1u);
  expect_lens(one.rig.cameras[0], camera);
  EXPECT_THAT(error_of("splined.json",
                       [&] {
                         std::string text = photonvision(camera, 320);
                         return text.replace(text.find("LENSMODEL_OPENCV"), 16, "LENSMODEL_SPLINED");
                       }()),
              HasSubstr("LENSMODEL_SPLINED"));
}

TEST_F(Peers, OpenCvsInteractiveCalibration) {
  const calib::Camera camera = truth().cameras[0];
  const auto words = [](const std::vector<double>& values) { return fmt::format("{}", fmt::join(values, "\n    ")); };
  const auto matrix = [&](const char* key, int rows, int cols, const std::vector<double>& values) {
    return fmt::format(
        "<{0} type_id=\"opencv-matrix\">\n  <rows>{1}</rows>\n  <cols>{2}</cols>\n  <dt>d</dt>\n  <data>\n    "
        "{3}</data></{0}>\n",
        key, rows, cols, words(values));
  };
  const Imported in =
      import("params.xml",
             "<?xml version=\"1.0\"?>\n<opencv_storage>\n<calibrationDate>\"Thu Feb  5\"</calibrationDate>\n"
             "<cameraResolution>\n  320 240</cameraResolution>\n" +
                 matrix("cameraMatrix", 3, 3, k_of(camera)) + matrix("cameraMatrix_std_dev", 4, 1, {1, 1, 1, 1}) +
                 matrix("dist_coeffs", 1, 5, d_of(camera)) + "</opencv_storage>\n");
  expect_lens(in.rig.cameras[0], camera);
  const Imported yaml = import("params.yml", "%YAML:1.0\n---\ncameraResolution: [ 320, 240 ]\n" +
                                                 opencv_matrix("cameraMatrix", 3, k_of(camera)) +
                                                 opencv_matrix("dist_coeffs", 1, d_of(camera)));
  expect_lens(yaml.rig.cameras[0], camera);
}

// `ros2 topic echo camera_info > info.yaml`, as long as it ran.
TEST_F(Peers, RosTopicEcho) {
  const calib::Camera camera = truth().cameras[0];
  const auto list = [](const std::string& key, const std::vector<double>& values) {
    return key + ":\n- " + fmt::format("{}", fmt::join(values, "\n- ")) + "\n";
  };
  const auto message = [&](int second, const calib::Camera& of) {
    return fmt::format(
               "header:\n  stamp:\n    sec: {}\n    nanosec: 5\n  frame_id: camera\nheight: 240\nwidth: "
               "320\ndistortion_model: plumb_bob\n",
               second) +
           list("d", d_of(of)) + list("k", k_of(of)) + list("r", {1, 0, 0, 0, 1, 0, 0, 0, 1}) +
           list("p", {1, 0, 2, 0, 0, 1, 2, 0, 0, 0, 1, 0}) +
           "binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: "
           "false\n---\n";
  };
  const Imported in = import("info.yaml", message(1, camera) + message(2, camera));
  expect_lens(in.rig.cameras[0], camera);
  EXPECT_THAT(in.notes, Contains(HasSubstr("first of 2 documents")));
  EXPECT_THAT(error_of("two.yaml", message(1, camera) + message(1, truth().cameras[1])), HasSubstr("several cameras"));
  // ROS 1 writes K, D, R, P, with the lists in brackets.
  const Imported ros1 = import(
      "info1.yaml",
      fmt::format("header: \n  seq: 1\nheight: 240\nwidth: 320\ndistortion_model: \"plumb_bob\"\nD: [{}]\nK: [{}]\n"
                  "R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n---\n",
                  numbers(d_of(camera)), numbers(k_of(camera))));
  expect_lens(ros1.rig.cameras[0], camera);
}

std::string rtabmap(const calib::Camera& camera) {
  return fmt::format(
      "%YAML:1.0\n---\ncamera_name: {}\nimage_width: 320\nimage_height: 240\ncamera_matrix:\n   rows: 3\n   cols: 3\n"
      "   data: [ {} ]\ndistortion_coefficients:\n   rows: 1\n   cols: 5\n   data: [ {} ]\ndistortion_model: "
      "plumb_bob\n"
      "rectification_matrix:\n   rows: 3\n   cols: 3\n   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]\n",
      camera.name, numbers(k_of(camera)), numbers(d_of(camera)));
}

TEST_F(Peers, RtabmapIsRosInOpenCvsSyntax) {
  const calib::CameraRig rig = truth();
  const Imported in = import("rtabmap_left.yaml", rtabmap(rig.cameras[0]));
  EXPECT_EQ(in.rig.cameras[0].name, "left");
  expect_lens(in.rig.cameras[0], rig.cameras[0]);
  // A stereo pair: R and T as stereoCalibrate's.
  const calib::Rigid3d first = rig.cameras[0].cam_from_world;
  const calib::Rigid3d pair = rig.cameras[1].cam_from_world * calib::inverse(first);
  const std::filesystem::path three[] = {
      file("s_left.yaml", rtabmap(rig.cameras[0])), file("s_right.yaml", rtabmap(rig.cameras[1])),
      file("s_pose.yaml", fmt::format("%YAML:1.0\n---\nrotation_matrix:\n   rows: 3\n   cols: 3\n   data: [ {} "
                                      "]\ntranslation_matrix:\n   rows: 3\n"
                                      "   cols: 1\n   data: [ {} ]\n",
                                      numbers(rotation_of(pair)), numbers(translation_of(pair))))};
  expect_rig(import_rig(three).rig, first);
}

// camera_calibration's ost.txt and camera_calibration_parsers' INI.
std::string ost(const std::string& name, const calib::Camera& camera) {
  const auto rows = [](const std::vector<double>& m, std::size_t columns) {
    std::string out;
    for (std::size_t i = 0; i < m.size(); i += columns)
      out += fmt::format("{}\n", fmt::join(m.begin() + long(i), m.begin() + long(i + columns), " "));
    return out;
  };
  const auto k = k_of(camera);
  return fmt::format(
      "# oST version 5.0 parameters\r\n\n\n[image]\n\nwidth\n320\n\nheight\n240\n\n[{}]\n\ncamera "
      "matrix\n{}\ndistortion\n"
      "{}\nrectification\n1 0 0\n0 1 0\n0 0 1\n\nprojection\n{} 0 {} 0\n0 {} {} 0\n0 0 1 0\n\n",
      name, rows(k, 3), rows(d_of(camera), 5), k[0], k[2], k[4], k[5]);
}

TEST_F(Peers, RosIni) {
  const calib::CameraRig rig = truth();
  for (const std::string name : {"ost.ini", "ost.txt"}) {
    const Imported in = import(name, ost("left", rig.cameras[0]));
    ASSERT_EQ(in.rig.cameras.size(), 1u);
    EXPECT_EQ(in.rig.cameras[0].name, "left");
    expect_lens(in.rig.cameras[0], rig.cameras[0]);
  }
  EXPECT_EQ(detect_format(folder_ / "ost.ini"), ExchangeFormat::ros);
  const std::string pair = ost("stereo/left", rig.cameras[0]) + ost("stereo/right", rig.cameras[1]);
  EXPECT_THAT(error_of("stereo.ini", pair), HasSubstr("no poses for stereo_left, stereo_right"));
  const Imported right = import("stereo.ini", pair, {.cameras = {"stereo_right"}});
  ASSERT_EQ(right.rig.cameras.size(), 1u);
  expect_lens(right.rig.cameras[0], rig.cameras[1]);
  EXPECT_THAT(error_of("a.ini", "[image]\nwidth\n320\nheight\n240\n[c]\n1 2 3\ncamera matrix\n"),
              HasSubstr("a.ini:7: has numbers without a name"));
}

// Its lengths are centimetres.
TEST_F(Peers, Panoptic) {
  const calib::CameraRig rig = truth();
  std::string list;
  for (const calib::Camera& camera : rig.cameras) {
    const auto k = k_of(camera), r = rotation_of(camera.cam_from_world),
               t = translation_of(camera.cam_from_world, 0.01);
    list += fmt::format(
        "{}{{\"name\": \"{}\", \"type\": \"hd\", \"resolution\": [320, 240], \"panel\": 0, \"node\": 1, \"K\": "
        "[[{}, 0, {}], [0, {}, {}], [0, 0, 1]], \"distCoef\": [{}], \"R\": [[{}, {}, {}], [{}, {}, {}], [{}, {}, "
        "{}]], \"t\": [[{}], [{}], [{}]]}}",
        list.empty() ? "" : ", ", camera.name, k[0], k[2], k[4], k[5], numbers(d_of(camera)), r[0], r[1], r[2], r[3],
        r[4], r[5], r[6], r[7], r[8], t[0], t[1], t[2]);
  }
  const std::string text = "{\"calibDataSource\": \"160906_calib_norm\", \"cameras\": [" + list + "]}";
  expect_rig(import("calibration.json", text, {.metres_per_unit = 0.01}).rig);
  EXPECT_EQ(detect_format(folder_ / "calibration.json"), ExchangeFormat::panoptic);
  EXPECT_THAT(error_of("calibration.json", text), AllOf(HasSubstr("give --unit cm"), HasSubstr("--unit mm")));
}

TEST_F(Peers, CoefficientsThatAreZeroAreNone) {
  const calib::Camera camera = truth().cameras[0];
  for (const std::size_t count : {4, 5, 8, 12, 14}) {
    const Imported in = import("a.yaml", fmt::format("image_width: 320\nimage_height: 240\ndistortion_model: "
                                                     "plumb_bob\ncamera_matrix: {{rows: 3, cols: 3, data: [{}]}}\n"
                                                     "distortion_coefficients: {{rows: 1, cols: {}, data: [{}]}}\n",
                                                     numbers(k_of(camera)), count, numbers(d_of(camera, count))));
    expect_lens(in.rig.cameras[0], camera);
  }
  EXPECT_THAT(error_of("b.yaml", fmt::format("image_width: 320\nimage_height: 240\ndistortion_model: plumb_bob\nK: "
                                             "[{}]\nD: [0.1, 0, 0, 0, 0, 0.2, 0, 0]\n",
                                             numbers(k_of(camera)))),
              AllOf(HasSubstr("b.yaml:5"), HasSubstr("plumb_bob has 5 coefficients, got 6 that are not 0")));
  EXPECT_THAT(
      error_of(
          "c.yaml",
          fmt::format("image_width: 320\nimage_height: 240\nK: [{}]\nD: [0.1, 0, 0, 0, 0, 0, 0, 0, 0.1, 0, 0, 0]\n",
                      numbers(k_of(camera)))),
      HasSubstr("thin prism"));
}

// EuRoC's sensor.yaml, one per camera: poses in the body's frame.
TEST_F(Peers, Euroc) {
  std::vector<std::filesystem::path> files;
  for (const calib::Camera& camera : truth().cameras) {
    const auto k = k_of(camera);
    files.push_back(file(
        camera.name + ".yaml",
        fmt::format("#Default camera sensor yaml file\nsensor_type: camera\ncomment: VI-Sensor cam0 (MT9M034)\n"
                    "T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\nrate_hz: 20\nresolution: [320, 240]\n"
                    "camera_model: pinhole\nintrinsics: [{}] #fu, fv, cu, cv\ndistortion_model: radial-tangential\n"
                    "distortion_coefficients: [{}]\n",
                    numbers(matrix_of(calib::inverse(camera.cam_from_world))), numbers({k[0], k[4], k[2], k[5]}),
                    numbers(d_of(camera, 4)))));
  }
  expect_rig(import_rig(files, {}).rig);
}

TEST_F(Peers, ARefusalNamesTheToolAndTheKeys) {
  for (const auto& [text, tool] :
       {std::pair{R"({"lensmodel": "LENSMODEL_OPENCV5", "intrinsics": [1, 2, 3, 4], "imagersize": [320, 240]})",
                  "mrcal's camera model"},
        {R"({"sfm_data_version": "0.3", "intrinsics": [], "extrinsics": []})", "OpenMVG's scene"},
        {R"({"version": ["1", "2", "0"], "featuresFolders": [], "intrinsics": [], "poses": []})", "Meshroom's scene"},
        {R"({"intrinsicMatrix": [], "distortionCoefficients": [], "R": [], "T": []})", "JARVIS' calibration"},
        {R"({"batchName": "", "cameraData": []})", "DepthAI's calibration"},
        {R"({"camera_model": "OPENCV", "frames": [{"fl_x": 900}]})", "transforms.json of nerfstudio"}})
    EXPECT_THAT(error_of("tool.json", text), AllOf(HasSubstr(tool), HasSubstr("Its keys: ")));
  EXPECT_THAT(error_of("chunk.xml",
                       "<?xml version='1.0'?><document><chunk label='a'><sensors next_id='1'/></chunk></document>"),
              HasSubstr("Metashape's project"));
  EXPECT_THAT(error_of("vicon.xcp", "<?xml version='1.0'?><Cameras><Camera NAME='a'><KeyFrames/></Camera></Cameras>"),
              HasSubstr("Vicon's calibration"));
  EXPECT_THAT(error_of("orb.yaml", "%YAML:1.0\nCamera.type: \"PinHole\"\nCamera.fx: 535.4\nCamera.fy: 539.2\n"),
              AllOf(HasSubstr("ORB-SLAM"), HasSubstr("Camera.type, Camera.fx"), HasSubstr("camera matrix")));
  EXPECT_THAT(error_of("basalt.json", R"({"value0": {"T_imu_cam": [], "intrinsics": []}})"), HasSubstr("Basalt"));
  EXPECT_THAT(error_of("any.json", R"({"a": 1, "b": [2]})"), AllOf(HasSubstr("no calibration"), HasSubstr("a, b")));
  EXPECT_THAT(error_of("qualisys.xml", "<?xml version='1.0'?><calibration created='x'><cameras/></calibration>"),
              HasSubstr("Qualisys"));
  EXPECT_THAT(
      error_of("lens.xml", "<?xml version='1.0'?><calibration><projection>frame</projection><f>1.5</f></calibration>"),
      HasSubstr("Metashape"));
  EXPECT_THAT(error_of("list.json", "[1, 2]"), HasSubstr("no keys"));
  EXPECT_THAT(
      error_of("transforms.json", R"({"camera_angle_x": 0.7, "fl_x": 900, "frames": [{"file_path": "a.png"}]})"),
      AllOf(HasSubstr("transforms.json of nerfstudio or instant-ngp"), HasSubstr("camera_angle_x, fl_x, frames")));
  EXPECT_THAT(error_of("results-cam.txt",
                       "Calibration results \n====================\nCamera-system parameters:\n"
                       "\tcam0 (/cam0/image_raw):\n\t    type: <class 'x'>\n"),
              AllOf(HasSubstr("Kalibr's report"), HasSubstr("camchain.yaml")));
  EXPECT_THAT(error_of("wrong.toml", toml_section("cam_0", truth().cameras[0], 1), {.format = ExchangeFormat::ros}),
              AllOf(HasSubstr("--from, ros"), HasSubstr("looks like aniposelib")));
  EXPECT_THAT(error_of("anchors.yaml", "a: &x [1]\nb: *x\n"), HasSubstr("anchors.yaml:2"));
  EXPECT_THAT(error_of("cameras.txt",
                       "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, "
                       "HEIGHT, PARAMS[]\n1 OPENCV 640 480 500 500 320 240 0 0 0 0\n"),
              AllOf(HasSubstr("is a table of COLMAP"), HasSubstr("cx - 0.5")));
  EXPECT_THAT(error_of("calib.mat", std::string("MATLAB 5.0 MAT-file\0\1", 21)), HasSubstr("is a binary file"));
}

// The same files as users have them (shared/data/field_cases), from a rig that is beside them.
TEST_F(Peers, FieldCases) {
  const std::filesystem::path folder = std::filesystem::path(HUETRACK_SHARED_DATA) / "field_cases/imports";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  // The positions of the two cameras, metres.
  const Eigen::Vector3d first(1.8, 1.7, 1.7), second(-1.75, 1.6, 2.05);
  const auto expect_centres = [&](const std::vector<std::string>& names, const ImportOptions& options,
                                  bool world = true) {
    std::vector<std::filesystem::path> files;
    for (const std::string& name : names) files.push_back(folder / name);
    SCOPED_TRACE(names.front());
    const Imported in = import_rig(files, options);
    ASSERT_EQ(in.rig.cameras.size(), 2u);
    const auto& cameras = in.rig.cameras;
    EXPECT_EQ(cameras[1].model.fy(), 223.863);
    EXPECT_NEAR((cameras[0].centre() - cameras[1].centre()).norm(), (first - second).norm(), 1e-6);
    if (world) {
      EXPECT_LT((cameras[0].centre() - first).norm(), 1e-6);
      EXPECT_LT((cameras[1].centre() - second).norm(), 1e-6);
    }
  };
  expect_centres({"anipose_names_with_spaces.toml"}, {});
  expect_centres({"freemocap2_calibration.toml"}, {.metres_per_unit = 1e-3});
  expect_centres({"easymocap_intri.yml", "easymocap_extri.yml"}, {.image_size = calib::ImageSize{320, 240}});
  expect_centres({"openvins_kalibr_imucam_chain.yaml"}, {});
  expect_centres({"kalibr_camchain_imucam.yaml"}, {}, false);
  for (const char* one : {"interactive_calibration.xml", "caliscope_intrinsics_only.toml"}) {
    const std::filesystem::path file[] = {folder / one};
    const Imported in =
        import_rig(file, {.cameras = {std::string(one).starts_with("c") ? "cam_0" : "interactive_calibration"}});
    ASSERT_EQ(in.rig.cameras.size(), 1u);
    EXPECT_EQ(in.rig.cameras[0].model.cx(), 157.3);
  }
}

}  // namespace
}  // namespace huetrack::exchange
