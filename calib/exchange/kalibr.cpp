// Kalibr's camchain YAML (github.com/ethz-asl/kalibr/wiki/yaml-formats): T_cn_cnm1 maps points from the previous
// camera to this one; the first camera is the world.
//
// Time model, equivalent to calib::CameraTiming: row r is exposed at
//   stamp + timeshift_cam_imu + r * line delay
// on the clock of the IMU, which becomes the rig's reference clock. line_delay_nanoseconds (whole, >= 0) is from the
// rolling-shutter branch (github.com/JzHuai0108/kalibr); line_delay, in seconds, is read, too.
#include <algorithm>
#include <array>
#include <cmath>

#include "calib/exchange/exchanged_camera.h"
#include "calib/yaml/yaml_reader.h"

namespace huetrack::exchange {
namespace {

calib::CameraTiming read_timing(const yaml::YamlReader& cam, int height) {
  constexpr std::string_view shift = "timeshift_cam_imu", seconds = "line_delay",
                             nanoseconds = "line_delay_nanoseconds";
  calib::CameraTiming timing;
  if (cam.has(seconds) && cam.has(nanoseconds))
    cam.fail(seconds, "is given together with line_delay_nanoseconds: give one of them");
  const double longest = 1.0 / std::max(1, height - 1);  // a line's, of a readout of a second
  if (cam.has(nanoseconds))
    timing.readout_s = 1e-9 * cam.number(nanoseconds, {.min = 0, .max = 1e9 * longest}) * (height - 1);
  if (cam.has(seconds)) timing.readout_s = cam.number(seconds, {.min = -longest, .max = longest}) * (height - 1);
  if (cam.has(shift)) {
    const double shift_s = cam.number(shift, yaml::any_number), latency_s = -shift_s - timing.readout_s.value_or(0) / 2;
    if (std::abs(latency_s) > 1) cam.fail(shift, "is more than a second: the clocks are not related; remove it");
    timing.latency_s = latency_s;
  }
  return timing;
}

// Adds notes on what the format cannot hold.
std::string timing_text(const calib::Camera& camera, std::vector<std::string>& notes) {
  const calib::CameraTiming& timing = camera.timing;
  std::string text;
  const double readout_s = timing.readout_s.value_or(0);
  if (timing.readout_s && readout_s >= 0 && camera.image_size.height > 1)
    text +=
        "  line_delay_nanoseconds: " + std::to_string(std::llround(1e9 * readout_s / (camera.image_size.height - 1))) +
        "\n";
  if (timing.latency_s) text += "  timeshift_cam_imu: " + exact(-*timing.latency_s - readout_s / 2) + "\n";
  if (readout_s < 0)
    notes.push_back(camera.name + ": Kalibr has no place for a sensor that reads upwards: no line delay");
  if (timing.latency_sigma_s || timing.readout_sigma_s)
    notes.push_back(camera.name + ": Kalibr has no place for the standard deviations of timing");
  return text;
}

}  // namespace

Imported import_kalibr(const std::filesystem::path& file, const ImportOptions& options) {
  const yaml::YamlReader reader = yaml::YamlReader::file(file);
  Imported out;
  for (const std::string& name : reader.keys()) {
    const std::size_t n = out.rig.cameras.size();
    if (name != "cam" + std::to_string(n))
      reader.fail(name, "is not a camera of a camchain, or out of order: expected cam" + std::to_string(n));
    const yaml::YamlReader cam = reader.map(name);
    const Fail fail = [&](std::string_view key, const std::string& message) { cam.fail(key, message); };
    calib::Camera camera;
    camera.name = name;
    const std::string projection = cam.string("camera_model");
    if (projection != "pinhole") {
      cam.fail("camera_model",
               "is " + projection + ", which a rig cannot hold: calibrate with pinhole-radtan or pinhole-equi");
    }
    constexpr std::array<std::string_view, 4> models{"radtan", "equidistant", "none", "fov"};
    const std::string model = cam.choice("distortion_model", models);
    if (model == "fov")
      cam.fail("distortion_model", "is fov, which a rig cannot hold: calibrate with radtan or equidistant");
    const auto i = cam.numbers("intrinsics", 4, 4, yaml::any_number);
    std::vector<double> d;
    if (model != "none")
      d = cam.numbers("distortion_coeffs", 4, 4, yaml::any_number);
    else if (cam.has("distortion_coeffs"))
      cam.numbers("distortion_coeffs", 0, 0, yaml::any_number);
    const std::array<double, 9> k{i[0], 0, i[2], 0, i[1], i[3], 0, 0, 1};
    camera.model = opencv_lens(k, "intrinsics", d, "distortion_coeffs", model == "equidistant", fail);
    if (!cam.has("resolution") && options.image_size) {
      camera.image_size = *options.image_size;
    } else {
      const auto size = cam.numbers("resolution", 2, 2, {.min = 1, .max = 32768});
      camera.image_size = {static_cast<int>(size[0]), static_cast<int>(size[1])};
    }
    if (n > 0) {
      const auto rows = cam.rows("T_cn_cnm1", 4, 4);
      std::array<double, 9> r;
      for (std::size_t a = 0; a < 3; ++a) {
        for (std::size_t b = 0; b < 3; ++b) r[3 * a + b] = rows[a][b];
      }
      if (rows[3] != std::vector<double>{0, 0, 0, 1}) cam.fail("T_cn_cnm1", "must end in the row 0 0 0 1");
      const calib::Rigid3d this_from_before{rotation_of(r, "T_cn_cnm1", fail), {rows[0][3], rows[1][3], rows[2][3]}};
      camera.cam_from_world = this_from_before * out.rig.cameras.back().cam_from_world;
    } else if (cam.has("T_cn_cnm1")) {
      cam.fail("T_cn_cnm1", "is not allowed for the first camera");
    }
    camera.timing = read_timing(cam, camera.image_size.height);
    if (camera.timing.latency_s) out.notes.push_back(name + ": its latency is relative to the IMU's clock");
    std::vector<std::string> left_out;
    for (const std::string key : {"rostopic", "cam_overlaps", "T_cam_imu"}) {
      if (cam.has(key)) left_out.push_back(key);
    }
    if (!left_out.empty()) out.notes.push_back(name + ": not taken over: " + joined(left_out));
    cam.finish();
    out.rig.cameras.push_back(std::move(camera));
  }
  if (out.rig.cameras.empty()) throw files::ConfigError(file, 0, "has no camera");
  out.notes.emplace_back("the world is cam0's frame (z forward, y down): set it with huetrack-calibrate world");
  return out;
}

Exported export_kalibr(const calib::CameraRig& rig) {
  Exported out;
  std::string text;
  for (std::size_t n = 0; n < rig.cameras.size(); ++n) {
    const calib::Camera& camera = rig.cameras[n];
    const bool fisheye = is_fisheye(camera.model);
    auto d = coefficients_of(camera.model);
    if (!fisheye) {
      for (std::size_t i = 4; i < d.size(); ++i) {
        if (d[i] == 0) continue;
        throw ExchangeError(camera.name + ": Kalibr's radtan has k1 k2 p1 p2 only, and this lens has " +
                            (i == 4 ? "k3 = " : "k" + std::to_string(i - 1) + " = ") + exact(d[i]) +
                            ": calibrate it with radtan4 for Kalibr");
      }
      d.resize(4);
    }
    const std::array<double, 4> k{camera.model.fx(), camera.model.fy(), camera.model.cx(), camera.model.cy()};
    text += "cam" + std::to_string(n) + ":\n";
    if (n > 0) {
      const calib::Rigid3d pose = camera.cam_from_world * calib::inverse(rig.cameras[n - 1].cam_from_world);
      const Eigen::Matrix3d r = pose.rotation.toRotationMatrix();
      text += "  T_cn_cnm1:\n";
      for (int i = 0; i < 3; ++i) {
        const std::array<double, 4> row{r(i, 0), r(i, 1), r(i, 2), pose.translation[i]};
        text += "  - " + exact_list(row) + "\n";
      }
      text += "  - [0.0, 0.0, 0.0, 1.0]\n";
    }
    text += "  camera_model: pinhole\n  distortion_coeffs: " + exact_list(d) +
            "\n  distortion_model: " + (fisheye ? "equidistant" : "radtan") + "\n  intrinsics: " + exact_list(k) +
            "\n  resolution: [" + std::to_string(camera.image_size.width) + ", " +
            std::to_string(camera.image_size.height) + "]\n  rostopic: /" + camera.name + "/image_raw\n" +
            timing_text(camera, out.notes);
    if (camera.name != "cam" + std::to_string(n))
      out.notes.push_back("Kalibr numbers its cameras: " + camera.name + " is cam" + std::to_string(n));
  }
  out.files.emplace_back("camchain.yaml", text);
  const calib::Rigid3d& first = rig.cameras.front().cam_from_world;
  if (first.translation.norm() > 0 || std::abs(first.rotation.w()) < 1)
    out.notes.push_back("Kalibr holds poses between cameras only: the world becomes " + rig.cameras.front().name +
                        "'s frame");
  if (!rig.made_by.empty()) out.notes.emplace_back("Kalibr has no place for made_by");
  return out;
}

}  // namespace huetrack::exchange
