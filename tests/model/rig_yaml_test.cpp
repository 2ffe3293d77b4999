#include "calib/model/rig_yaml.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>
#include <system_error>

#include "calib/files/config_error.h"

namespace huetrack::calib {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class RigYaml : public testing::Test {
 protected:
  RigYaml() : folder_(testing::TempDir() + "rig_yaml_test." + std::to_string(::getpid())) {
    fs::create_directories(folder_);
  }
  ~RigYaml() override { fs::remove_all(folder_); }

  fs::path file() const { return folder_ / "rig.yaml"; }

  CameraRig read(const std::string& yaml) const {
    std::ofstream(file(), std::ios::binary) << yaml;
    return read_rig(file());
  }

  // The message without the name of the temporary folder.
  std::string error_of(const std::string& yaml) const {
    try {
      read(yaml);
    } catch (const files::ConfigError& error) {
      const std::string what = error.what();
      EXPECT_EQ(what.find(file().string()), 0u);
      return what.substr(folder_.string().size() + 1);
    }
    return "no error";
  }

  fs::path folder_;
};

const std::string valid =
    "version: 1\n"                                                      // 1
    "cameras:\n"                                                        // 2
    "  left:\n"                                                         // 3
    "    image_size: [320, 240]\n"                                      // 4
    "    model: pinhole_radtan\n"                                       // 5
    "    intrinsics: {fx: 241.734, fy: 241.5, cx: 157.3, cy: 122.4}\n"  // 6
    "    distortion: [-0.145, 0.033, -0.0004, 0.0005, 0]\n"             // 7
    "    cam_from_world:\n"                                             // 8
    "      rotation: [[0, -1, 0], [0, 0, -1], [1, 0, 0]]\n"             // 9
    "      translation: [0.1, 0.2, 3]\n"                                // 10
    "  right:\n"                                                        // 11
    "    image_size: [640, 480]\n"                                      // 12
    "    model: fisheye_kb\n"                                           // 13
    "    intrinsics: {fx: 285, fy: 286, cx: 317, cy: 241}\n"            // 14
    "    distortion: [-0.01, 0.002, -0.0003, 0.00004]\n"                // 15
    "    cam_from_world:\n"                                             // 16
    "      quaternion_xyzw: [0, 0.6, 0, 0.8]\n"                         // 17
    "      translation: [-1, 0, 2.5]\n"                                 // 18
    "made_by:\n"                                                        // 19
    "  tool: huetrack-calibrate 0.1\n";                                 // 20

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = valid;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST_F(RigYaml, ReadsAllFields) {
  const CameraRig rig = read(valid);
  ASSERT_EQ(rig.cameras.size(), 2u);
  const Camera& left = rig.cameras[0];
  EXPECT_EQ(left.name, "left");
  EXPECT_EQ(left.image_size, (ImageSize{320, 240}));
  const auto& pinhole = std::get<PinholeRadtan>(left.model.lens());
  EXPECT_EQ(pinhole.fx, 241.734);
  EXPECT_EQ(pinhole.fy, 241.5);
  EXPECT_EQ(pinhole.cx, 157.3);
  EXPECT_EQ(pinhole.cy, 122.4);
  EXPECT_EQ(pinhole.distortion, (std::array<double, 8>{-0.145, 0.033, -0.0004, 0.0005}));
  EXPECT_LT((left.cam_from_world * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(-1.9, -2.8, 4)).norm(), 1e-15);
  const Camera& right = rig.cameras[1];
  EXPECT_EQ(std::get<FisheyeKannalaBrandt>(right.model.lens()).distortion,
            (std::array<double, 4>{-0.01, 0.002, -0.0003, 0.00004}));
  EXPECT_EQ(right.cam_from_world.rotation.y(), 0.6);
  EXPECT_EQ(right.cam_from_world.rotation.w(), 0.8);
  ASSERT_EQ(rig.made_by.size(), 1u);
  EXPECT_EQ(rig.made_by[0], (std::pair<std::string, std::string>("tool", "huetrack-calibrate 0.1")));
}

TEST_F(RigYaml, ACalibrationOfAnotherProgramIsToBeImported) {
  EXPECT_THAT(error_of("%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                       "   data: [600., 0., 320., 0., 600., 240., 0., 0., 1.]\n"),
              HasSubstr("this is no rig: it has no cameras; huetrack-calibrate import"));
}

TEST_F(RigYaml, PinholesHaveFourFiveOrEightCoefficients) {
  const auto distortion = [&](const std::string& list) {
    return std::get<PinholeRadtan>(read(replaced("[-0.145, 0.033, -0.0004, 0.0005, 0]", list)).cameras[0].model.lens())
        .distortion;
  };
  EXPECT_EQ(distortion("[1, 2, 3, 4]"), (std::array<double, 8>{1, 2, 3, 4}));
  EXPECT_EQ(distortion("[1, 2, 3, 4, 5]"), (std::array<double, 8>{1, 2, 3, 4, 5}));
  EXPECT_EQ(distortion("[1, 2, 3, 4, 5, 6, 7, 8]"), (std::array<double, 8>{1, 2, 3, 4, 5, 6, 7, 8}));
}

TEST_F(RigYaml, ARoundedMatrixBecomesARotation) {
  const CameraRig rig = read(replaced("[[0, -1, 0], [0, 0, -1], [1, 0, 0]]",
                                      "[[0.36, 0.48, -0.80003], [-0.8, 0.60002, 0], [0.48, 0.64, 0.6]]"));
  const Eigen::Matrix3d r = rig.cameras[0].cam_from_world.rotation.toRotationMatrix();
  EXPECT_LT((r * r.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-15);
  Eigen::Matrix3d exact;
  exact << 0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6;
  EXPECT_LT((r - exact).norm(), 5e-5);
}

TEST_F(RigYaml, ASingleCameraNeedsNoPose) {
  const std::string pose =
      valid.substr(valid.find("    cam_from_world"), valid.find("  right") - valid.find("    cam"));
  std::string one = valid.substr(0, valid.find("  right"));
  one.erase(one.find("    cam_from_world"));
  const CameraRig rig = read(one);
  EXPECT_TRUE(rig.cameras[0].cam_from_world.rotation.isApprox(Eigen::Quaterniond::Identity(), 0));
  EXPECT_EQ(rig.cameras[0].cam_from_world.translation, Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(error_of(replaced(pose, "")), "rig.yaml:3: cameras.left.cam_from_world is missing");
}

// As programs hold them. The text in the message is valid.
TEST_F(RigYaml, MatricesOfPosesAreShownAsTheyAreWritten) {
  const auto begin = valid.find("    cam_from_world"), end = valid.find("  right");
  const std::string pose = valid.substr(begin, end - begin);
  const std::string matrix = "[[0, -1, 0, 0.1], [0, 0, -1, 0.2], [1, 0, 0, 3], [0, 0, 0, 1]]";
  const std::string inverse = "[[0, 0, 1, -3], [-1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, 0, 1]]";
  const std::string text = "{rotation: [[0, -1, 0], [0, 0, -1], [1, 0, 0]], translation: [0.1, 0.2, 3]}";
  EXPECT_EQ(error_of(replaced(pose, "    cam_from_world: " + matrix + "\n")),
            "rig.yaml:8: cameras.left.cam_from_world: is a matrix; write " + text);
  EXPECT_THAT(error_of(replaced(pose, "    world_from_cam: " + inverse + "\n")),
              testing::AllOf(testing::StartsWith("rig.yaml:8: cameras.left.world_from_cam: a rig has the inverse pose"),
                             testing::EndsWith("write cam_from_world: " + text)));
  EXPECT_EQ(error_of(replaced(pose, "    pose: " + matrix + "\n")),
            "rig.yaml:3: cameras.left.cam_from_world is missing (other keys here: pose)");
  EXPECT_EQ(read(replaced(pose, "    cam_from_world: " + text + "\n")).cameras[0].cam_from_world.translation,
            Eigen::Vector3d(0.1, 0.2, 3));
}

struct Mutation {
  std::string from, to, message;
};

TEST_F(RigYaml, EveryMistakeHasItsOwnMessage) {
  const std::string matrix = "[[0, -1, 0], [0, 0, -1], [1, 0, 0]]";
  const std::vector<Mutation> mutations{
      {"version: 1", "version: 2",
       "rig.yaml:1: version must be 1, got \"2\": it is the version of the file format, and this program reads only "
       "this one. It is neither the program's version nor a count of your changes"},
      {"version: 1\n", "", "rig.yaml:1: version is missing: write version: 1, the version of the file format"},
      {"cameras:", "camera:", "rig.yaml:1: cameras is missing (is camera in line 2 a misspelling of it?)"},
      {"made_by", "mad_by", "rig.yaml:19: mad_by is not a known key (did you mean made_by?)"},
      {"huetrack-calibrate 0.1", "[a]", "rig.yaml:20: made_by.tool must be a text, got a list of 1"},
      {"[320, 240]", "abc", "rig.yaml:4: cameras.left.image_size must be a list of 2 numbers, got \"abc\""},
      {"[320, 240]", "[320]", "rig.yaml:4: cameras.left.image_size must be a list of 2 numbers, got a list of 1"},
      {"[320, 240]", "[320, 0]", "rig.yaml:4: cameras.left.image_size[1] must be from 1 to 32768 (is 0)"},
      {"[320, 240]", "[320, 240.5]", "rig.yaml:4: cameras.left.image_size: must be whole pixels, [width, height]"},
      {"image_size", "image_siz",
       "rig.yaml:3: cameras.left.image_size is missing (is image_siz in line 4 a misspelling of it?)"},
      {"pinhole_radtan", "pinhole_radtn",
       "rig.yaml:5: cameras.left.model must be one of pinhole_radtan, fisheye_kb, stereographic, got \"pinhole_radtn\" "
       "(did you mean "
       "pinhole_radtan?)"},
      {"fx: 241.734", "fx: -3", "rig.yaml:6: cameras.left.intrinsics.fx must be > 0 (is -3)"},
      {"fx: 241.734", "fx: .nan", "rig.yaml:6: cameras.left.intrinsics.fx must be a number, got \".nan\""},
      {"fy: 241.5, ", "", "rig.yaml:6: cameras.left.intrinsics.fy is missing (other keys here: cx, cy)"},
      {"cy: 122.4", "cy: 122.4, skew: 0",
       "rig.yaml:6: cameras.left.intrinsics.skew is not a known key; known here: fx, fy, cx, cy"},
      {"fx: 241.734", "fx: 0.755",
       "rig.yaml:3: cameras.left: fx and fy do not fit the image size: are they in pixels of this image?"},
      {"cx: 157.3", "cx: 1573",
       "rig.yaml:3: cameras.left: the principal point (cx, cy) is far outside the image: is it in pixels of this "
       "image?"},
      {"    distortion: [-0.145, 0.033, -0.0004, 0.0005, 0]\n", "",
       "rig.yaml:3: cameras.left.distortion: is missing; a lens without distortion has [0, 0, 0, 0, 0]"},
      {"-0.0004, 0.0005, 0]", "-0.0004]",
       "rig.yaml:7: cameras.left.distortion must be a list of 4 to 8 numbers, got a list of 3"},
      {"-0.0004, 0.0005, 0]", "-0.0004, 0.0005, 0, 1]",
       "rig.yaml:7: cameras.left.distortion: pinhole_radtan has 4 (k1 k2 p1 p2), 5 (k3) or 8 (k4 k5 k6) coefficients, "
       "got 6"},
      {"0.00004]", "0.00004, 0]", "rig.yaml:15: cameras.right.distortion must be a list of 4 numbers, got a list of 5"},
      {matrix, "[[0, 1, 0], [0, 0, -1], [1, 0, 0]]",
       "rig.yaml:9: cameras.left.cam_from_world.rotation: is mirrored (determinant -1): a camera is right-handed, x "
       "right, y down, z forward"},
      {matrix, "[[0, -1, 0], [0, 0, -1], [1.01, 0, 0]]",
       "rig.yaml:9: cameras.left.cam_from_world.rotation: is not a rotation: its rows must be orthogonal and of length "
       "1 (off by 0.02)"},
      {matrix, "[[0, -1, 0], [0, 0, -1]]",
       "rig.yaml:9: cameras.left.cam_from_world.rotation must be a list of 3 rows of 3 numbers, got a list of 2"},
      {matrix, "[[0, -1, 0], [0, 0, -1], [1, 0]]",
       "rig.yaml:9: cameras.left.cam_from_world.rotation[2] must be a list of 3 numbers, got a list of 2"},
      {"[0, 0.6, 0, 0.8]", "[0, 0.6, 0, 0.9]",
       "rig.yaml:17: cameras.right.cam_from_world.quaternion_xyzw: must have length 1"},
      {"[0, 0.6, 0, 0.8]", "[0, 0.6, 0, 0.8]\n      rotation: " + matrix,
       "rig.yaml:17: cameras.right.cam_from_world.quaternion_xyzw: is given together with rotation: give one of them"},
      {"      rotation: " + matrix + "\n", "",
       "rig.yaml:8: cameras.left.cam_from_world.rotation is missing (other keys here: translation)"},
      {"[0.1, 0.2, 3]", "[0.1, 0.2]",
       "rig.yaml:10: cameras.left.cam_from_world.translation must be a list of 3 numbers, got a list of 2"},
      {"translation: [-1, 0, 2.5]", "translation: [-1, 0, 2.5]\n      scale: 2",
       "rig.yaml:19: cameras.right.cam_from_world.scale is not a known key; known here: rotation, quaternion_xyzw, "
       "translation"},
      {"  right:", "  left:",
       "rig.yaml:11: cameras.left is given twice, first in line 3: take one of them out, or write both as one"},
      {"  right:", "  \"ri ght\":",
       "rig.yaml:11: cameras.ri ght: a camera's name has 1 to 64 letters, digits, '_', '-' or '.', and starts with a "
       "letter, a digit or '_'"},
      {valid.substr(valid.find("  left"), valid.find("made_by") - valid.find("  left")), "  {}\n",
       "rig.yaml:2: cameras: a rig has at least one camera"},
      {"[0, 0.6, 0, 0.8]\n      translation: [-1, 0, 2.5]", "[0.5, -0.5, 0.5, 0.5]\n      translation: [0.1, 0.2, 3]",
       "rig.yaml:2: cameras: cameras left and right are at the same place in the world: one pose is copied, or not "
       "calibrated"},
  };
  for (const Mutation& m : mutations) EXPECT_EQ(error_of(replaced(m.from, m.to)), m.message) << m.to;
}

void expect_same_bits(double a, double b) {
  EXPECT_EQ(std::bit_cast<std::uint64_t>(a), std::bit_cast<std::uint64_t>(b)) << a << " " << b;
}

void expect_same_bits(const CameraRig& a, const CameraRig& b) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t i = 0; i < a.cameras.size(); ++i) {
    const Camera &c = a.cameras[i], &d = b.cameras[i];
    EXPECT_EQ(c.name, d.name);
    EXPECT_EQ(c.image_size, d.image_size);
    ASSERT_EQ(c.model.lens().index(), d.model.lens().index());
    expect_same_bits(c.model.fx(), d.model.fx());
    expect_same_bits(c.model.fy(), d.model.fy());
    expect_same_bits(c.model.cx(), d.model.cx());
    expect_same_bits(c.model.cy(), d.model.cy());
    std::visit(
        [&](const auto& lens) {
          const auto& other = std::get<std::decay_t<decltype(lens)>>(d.model.lens());
          for (std::size_t k = 0; k < lens.distortion.size(); ++k) {
            expect_same_bits(lens.distortion[k], other.distortion[k]);
          }
        },
        c.model.lens());
    for (int k = 0; k < 4; ++k) {
      expect_same_bits(c.cam_from_world.rotation.coeffs()[k], d.cam_from_world.rotation.coeffs()[k]);
    }
    for (int k = 0; k < 3; ++k) expect_same_bits(c.cam_from_world.translation[k], d.cam_from_world.translation[k]);
    EXPECT_EQ(c.timing, d.timing);
  }
  EXPECT_EQ(a.made_by, b.made_by);
}

double uniform(std::mt19937_64& rng) {
  return static_cast<double>(rng() >> 11) * 0x1p-53 * 2 - 1;
}

TEST_F(RigYaml, WrittenFilesReadBackToTheSameBits) {
  std::mt19937_64 rng(5);
  for (int i = 0; i < 200; ++i) {
    CameraRig rig;
    for (const std::string name : {"cam0", "null", "1e3", "a-b.c", "_x"}) {
      Camera camera;
      camera.name = name;
      camera.image_size = {640, 480};
      const double fx = 500 + 100 * uniform(rng), fy = 500 + 100 * uniform(rng);
      const double cx = 320 + uniform(rng), cy = 240 + uniform(rng);
      if (rng() % 3 == 0) {
        FisheyeKannalaBrandt lens{fx, fy, cx, cy, {}};
        for (double& k : lens.distortion) k = uniform(rng) * 1e-3;
        camera.model = CameraModel(lens);
      } else {
        PinholeRadtan lens{fx, fy, cx, cy, {}};
        const std::size_t count = std::array{0u, 2u, 5u, 8u}[rng() % 4];
        for (std::size_t k = 0; k < count; ++k) lens.distortion[k] = uniform(rng) * std::pow(10, 8 * uniform(rng) - 8);
        camera.model = CameraModel(lens);
      }
      camera.cam_from_world.rotation =
          Eigen::Quaterniond(uniform(rng), uniform(rng), uniform(rng), uniform(rng)).normalized();
      camera.cam_from_world.translation = {3 * uniform(rng), -0.0, 1e-9 * uniform(rng)};
      if (rng() % 2 == 0) camera.timing.latency_s = 0.05 * uniform(rng);
      if (rng() % 2 == 0) camera.timing.readout_s = 0.03 * uniform(rng);
      if (camera.timing.latency_s && rng() % 2 == 0) camera.timing.latency_sigma_s = 1e-3 * (1 + uniform(rng));
      if (camera.timing.readout_s && rng() % 2 == 0) camera.timing.readout_sigma_s = 1e-3 * (1 + uniform(rng));
      rig.cameras.push_back(camera);
    }
    rig.made_by = {{"tool", "huetrack-calibrate"},
                   {"a key: with # everything", "quotes \" and \\ and\nlines\tand and \xC3\xA9 {[*&!%@`"},
                   {"null", "null"},
                   {"rms_px", "0.21"},
                   {"~", " spaces around "}};
    write_rig(rig, file());
    const CameraRig back = read_rig(file());
    expect_same_bits(rig, back);
    EXPECT_EQ(rig_identity(rig), rig_identity(back));
    rig.made_by = {{"note\x1b[2J", "what\x07"}};
    write_rig(rig, file());
    EXPECT_EQ(read_rig(file()).made_by[0], (std::pair<std::string, std::string>("note [2J", "what ")));
  }
}

TEST_F(RigYaml, ComposedPosesReadBackToTheSameBits) {
  // Products of rotations are normalised with rounding; the reader must not normalise once more.
  std::mt19937_64 rng(6);
  CameraRig rig = read(valid);
  for (int i = 0; i < 2000; ++i) {
    Tangent6d step;
    for (int k = 0; k < 6; ++k) step[k] = uniform(rng);
    rig.cameras[0].cam_from_world = exp(step) * rig.cameras[0].cam_from_world;
    rig.cameras[0].cam_from_world.translation *= 0.5;
    if (i % 50 == 0) expect_same_bits(rig, read(to_yaml(rig)));
  }
}

TEST_F(RigYaml, WritesTheDocumentedFormat) {
  EXPECT_EQ(to_yaml(read(valid)),
            "# huetrack rig: see calib/README.md. Pixel (0,0) is the centre of the top-left pixel; metres;\n"
            "# p_cam = R(quaternion) * p_world + translation.\n"
            "version: 1\n"
            "cameras:\n"
            "  left:\n"
            "    image_size: [320, 240]\n"
            "    model: pinhole_radtan\n"
            "    intrinsics: {fx: 241.734, fy: 241.5, cx: 157.3, cy: 122.4}\n"
            "    distortion: [-0.145, 0.033, -4e-04, 5e-04, 0]   # k1 k2 p1 p2 k3\n"
            "    cam_from_world:\n"
            "      quaternion_xyzw: [0.5, -0.5, 0.5, 0.5]\n"
            "      translation: [0.1, 0.2, 3]\n"
            "  right:\n"
            "    image_size: [640, 480]\n"
            "    model: fisheye_kb\n"
            "    intrinsics: {fx: 285, fy: 286, cx: 317, cy: 241}\n"
            "    distortion: [-0.01, 0.002, -3e-04, 4e-05]   # k1 k2 k3 k4\n"
            "    cam_from_world:\n"
            "      quaternion_xyzw: [0, 0.6, 0, 0.8]\n"
            "      translation: [-1, 0, 2.5]\n"
            "made_by:\n"
            "  tool: \"huetrack-calibrate 0.1\"\n");
}

const std::string with_uncertainty =
    valid +
    "made:\n"
    "  at: 2026-11-22T16:04:08Z\n"
    "  temperature_c: 21.5\n"
    "  checks:\n"
    "    - {at: 2026-11-23T10:00:00Z, verdict: \"usable\", text: \"it fits: 0.3 px\"}\n"
    "uncertainty:   # the cameras' joint covariance; see calib/formats.md\n"
    "  sigma:\n"
    "    left: {lens: [0.4, 0.41, 0.5, 0.52, 0.001, 0.002, 3e-05, 4e-05]}\n"
    "    right: {pose: [1e-04, 2e-04, 3e-04, 0.001, 0.002, 0]}\n"
    "  root: [\n"
    "    1,\n"
    "    0.6, 0.8,\n"
    "    0, 0, 1,\n"
    "    0, 0, 0, 1,\n"
    "    0, 0, 0, 0, 1,\n"
    "    0, 0, 0, 0, 0, 1,\n"
    "    0, 0, 0, 0, 0, 0, 1,\n"
    "    0, 0, 0, 0, 0, 0, 0, 1,\n"
    "    0, 0, 0, 0, 0, 0, 0, 0, 1,\n"
    "    0, 0, 0, 0, 0, 0, 0, 0, 0, 1,\n"
    "    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1,\n"
    "    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1,\n"
    "    -0.6, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.8,\n"
    "    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n";

TEST_F(RigYaml, UncertaintyAndHistoryReadBackAsTheyAreWritten) {
  const CameraRig rig = read(with_uncertainty);
  ASSERT_TRUE(rig.uncertainty);
  EXPECT_EQ(rig.uncertainty->cameras[0], (RigUncertainty::CameraParameters{0, 8, false}));
  EXPECT_EQ(rig.uncertainty->cameras[1], (RigUncertainty::CameraParameters{8, 0, true}));
  const Eigen::MatrixXd covariance = rig.uncertainty->covariance();
  EXPECT_NEAR(covariance(1, 0), 0.6 * 0.4 * 0.41, 1e-12);
  EXPECT_NEAR(covariance(12, 0), -0.6 * 0.4 * 0.002, 1e-12);
  EXPECT_EQ(covariance(13, 13), 0);
  ASSERT_EQ(rig.made.checks.size(), 1u);
  EXPECT_EQ(rig.made.temperature_c, 21.5);
  const std::string text = to_yaml(rig);
  EXPECT_EQ(text.substr(text.find("made:")), with_uncertainty.substr(with_uncertainty.find("made:")));
  EXPECT_EQ(to_yaml(read(text)), text);
  CameraRig later = rig;
  later.made = {};
  EXPECT_EQ(rig_identity(later), rig_identity(rig));  // a check changes no position
  later.uncertainty.reset();
  EXPECT_NE(rig_identity(later), rig_identity(rig));
}

TEST_F(RigYaml, UncertaintyIsReadStrictly) {
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = with_uncertainty;
    return text.replace(text.find(from), from.size(), to);
  };
  const auto complains = [&](const std::string& text, const std::string& what) {
    try {
      read(text);
      ADD_FAILURE() << what;
    } catch (const files::ConfigError& e) {
      EXPECT_NE(std::string(e.what()).find(what), std::string::npos) << e.what();
    }
  };
  complains(with("0.6, 0.8,", "0.6, 0.5,"), "row 2 of root has the length 0.781 and not 1");
  complains(with("    1,\n", ""), "uncertainty.root");
  complains(with("    right: {pose", "    wrong: {pose"), "is no camera of this rig");
  complains(with("0.4, 0.41", "-0.4, 0.41"), "uncertainty.sigma.left.lens");
  complains(with("3e-05, 4e-05]", "3e-05, 4e-05, 1, 1]"), "uncertainty");
  complains(with("2026-11-23T10", "2026-11-23 10"), "must be a time like");
  complains(with("  temperature_c", "  temperatur_c"), "did you mean temperature_c?");
}

// The pose of the left camera ends in this line.
const std::string end_of_left = "      translation: [0.1, 0.2, 3]\n";

TEST_F(RigYaml, TimingIsOptionalInAllItsParts) {
  const auto timing = [&](const std::string& map) {
    const CameraRig rig = read(replaced(end_of_left, end_of_left + "    timing: " + map + "\n"));
    EXPECT_EQ(rig.cameras[1].timing, CameraTiming{});
    return rig.cameras[0].timing;
  };
  EXPECT_EQ(timing("{latency_s: 0.0316, readout_s: -0.029, latency_sigma_s: 0.0003, readout_sigma_s: 0.0008}"),
            (CameraTiming{0.0316, 0.0003, -0.029, 0.0008}));
  EXPECT_EQ(timing("{latency_s: -1, latency_sigma_s: 0}"), (CameraTiming{-1.0, 0.0, {}, {}}));
  EXPECT_EQ(timing("{readout_s: 0}"), (CameraTiming{{}, {}, 0.0, {}}));
  EXPECT_EQ(timing("{}"), CameraTiming{});
  EXPECT_FALSE(timing("{}").is_known());
}

TEST_F(RigYaml, TimingIsWrittenWhereItIsKnown) {
  CameraRig rig = read(valid);
  EXPECT_EQ(to_yaml(rig).find("timing"), std::string::npos);
  rig.cameras[1].timing = {0.0316, 0.0003, -0.029, 0.0008};
  EXPECT_THAT(to_yaml(rig), HasSubstr("      translation: [-1, 0, 2.5]\n"
                                      "    timing: {latency_s: 0.0316, readout_s: -0.029, latency_sigma_s: 3e-04, "
                                      "readout_sigma_s: 8e-04}\n"));
  rig.cameras[1].timing = {{}, {}, 0.02, {}};
  EXPECT_THAT(to_yaml(rig), HasSubstr("    timing: {readout_s: 0.02}\n"));
  EXPECT_NE(rig_identity(rig), rig_identity(read(valid)));
}

TEST_F(RigYaml, EveryMistakeInTimingHasItsOwnMessage) {
  const std::vector<std::pair<std::string, std::string>> mistakes{
      {"{latncy_s: 0.01}", "rig.yaml:11: cameras.left.timing.latncy_s is not a known key (did you mean latency_s?)"},
      {"{readout: 0.01}", "rig.yaml:11: cameras.left.timing.readout is not a known key (did you mean readout_s?)"},
      {"{latency_s: 31.6}", "rig.yaml:11: cameras.left.timing.latency_s must be from -1 to 1 (is 31.6)"},
      {"{readout_s: -2}", "rig.yaml:11: cameras.left.timing.readout_s must be from -1 to 1 (is -2)"},
      {"{readout_s: .nan}", "rig.yaml:11: cameras.left.timing.readout_s must be a number, got \".nan\""},
      {"{latency_s: 0, latency_sigma_s: -0.001}",
       "rig.yaml:11: cameras.left.timing.latency_sigma_s must be from 0 to 1 (is -0.001)"},
      {"{readout_s: 0, readout_sigma_s: 2}",
       "rig.yaml:11: cameras.left.timing.readout_sigma_s must be from 0 to 1 (is 2)"},
      {"{latency_sigma_s: 0.001}", "rig.yaml:3: cameras.left: timing: latency_sigma_s needs latency_s"},
      {"{latency_s: 0.01, readout_sigma_s: 0.001}",
       "rig.yaml:3: cameras.left: timing: readout_sigma_s needs readout_s"},
      {"0.03", "rig.yaml:11: cameras.left.timing must be a mapping (key: value), got \"0.03\""},
  };
  for (const auto& [map, message] : mistakes)
    EXPECT_EQ(error_of(replaced(end_of_left, end_of_left + "    timing: " + map + "\n")), message) << map;
}

TEST_F(RigYaml, TheIdentityChangesWithAnyNumber) {
  const CameraRig rig = read(valid);
  EXPECT_EQ(rig_identity(rig).size(), 16u);
  EXPECT_EQ(rig_identity(rig), rig_identity(read("# another comment\n" + valid)));
  CameraRig other = rig;
  other.cameras[1].cam_from_world.translation.x() = std::nextafter(-1.0, 0);
  EXPECT_NE(rig_identity(rig), rig_identity(other));
}

TEST_F(RigYaml, WritingIsAtomic) {
  const CameraRig rig = read(valid);
  write_rig(rig, file());
  CameraRig other = rig;
  other.cameras[0].name = "another";
  write_rig(other, file());
  expect_same_bits(other, read_rig(file()));
  write_rig(rig, file());
  expect_same_bits(rig, read_rig(file()));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);  // no temporary file is left
  EXPECT_EQ(fs::status(file()).permissions(), fs::perms{0644});
  try {
    write_rig(rig, folder_ / "no such folder" / "rig.yaml");
    FAIL();
  } catch (const std::system_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no such folder/rig.yaml"));
    EXPECT_THAT(error.what(), HasSubstr("No such file or directory"));
  }
  std::ofstream(folder_ / "notes.yaml") << "something else that is there";
  EXPECT_THROW(write_rig(rig, folder_ / "notes.yaml"), std::exception);  // not a rig file: must not be replaced
  EXPECT_EQ(fs::file_size(folder_ / "notes.yaml"), 28u);
  fs::remove(folder_ / "notes.yaml");
  fs::create_directory(folder_ / "taken");
  EXPECT_THROW(write_rig(rig, folder_ / "taken"), std::system_error);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 2);
}

TEST_F(RigYaml, DamagedFilesAreReadOrRejected) {
  std::mt19937_64 rng(7);
  const std::string alphabet = "{}[]:,-?&*!|>'\"%@#\n 0123456789.e+x~";
  int refused = 0, read_through = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string damaged = valid;
    if (i % 4 == 0) damaged.resize(rng() % damaged.size());
    for (std::size_t n = rng() % 4; n > 0 && !damaged.empty(); --n) {
      damaged[rng() % damaged.size()] = i % 2 == 0 ? static_cast<char>(rng()) : alphabet[rng() % alphabet.size()];
    }
    std::ofstream(file(), std::ios::binary) << damaged;
    try {
      const CameraRig rig = read_rig(file());
      EXPECT_TRUE(rig.problems().empty());
      ++read_through;
    } catch (const files::ConfigError&) {
      ++refused;
    }  // anything else fails the test
  }
  EXPECT_GT(refused, 200);
  EXPECT_GT(read_through, 200);
}

TEST_F(RigYaml, TheExampleInFormatsMdIsRead) {
  std::ifstream stream(HUETRACK_SOURCE_DIR "/calib/formats.md");
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  const std::size_t begin = text.find("```yaml\nversion: 1\ncameras:") + 8, end = text.find("```", begin);
  ASSERT_LT(end, text.size());
  std::string example = text.substr(begin, end - begin);
  const CameraRig rig = read(example);
  EXPECT_EQ(rig.cameras.at(0).name, "left");
  EXPECT_EQ(rig.made_by.size(), 2u);
  // The alternative form of the rotation, commented out in the example, is the same rotation.
  const std::size_t matrix = example.find("rotation:");
  example.erase(matrix, example.find('\n', matrix) - matrix);
  const std::size_t comment = example.find("# quaternion");
  example.erase(comment, 2);
  const Eigen::Quaterniond q = read(example).cameras.at(0).cam_from_world.rotation;
  EXPECT_LT(q.angularDistance(rig.cameras.at(0).cam_from_world.rotation), 1e-15);
}

TEST(SharedRigs, AllOfThemAreReadAsTheyAre) {
  const fs::path data = HUETRACK_SHARED_DATA;
  if (!fs::exists(data)) GTEST_SKIP() << data << " is not there";
  int count = 0;
  for (const auto& entry : fs::recursive_directory_iterator(data)) {
    if (entry.path().filename() != "rig.yaml") continue;
    SCOPED_TRACE(entry.path().string());
    const CameraRig rig = read_rig(entry.path());
    ++count;
    for (const Camera& camera : rig.cameras) {
      const RawPixel middle{{camera.image_size.width / 2.0, camera.image_size.height / 2.0}};
      const auto ray = camera.model.ray(middle);
      ASSERT_TRUE(ray);
      EXPECT_LT((camera.model.project(*ray)->px - middle.px).norm(), 1e-9);
      EXPECT_LT(camera.centre().norm(), 10);
    }
  }
  EXPECT_GE(count, 8);
}

}  // namespace
}  // namespace huetrack::calib
