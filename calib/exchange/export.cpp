// Files of other tools, from a rig. What is read of each is in import.cpp.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <set>

#include "calib/exchange/exchanged_camera.h"
#include "calib/model/nearest_lens.h"

namespace huetrack::exchange {
namespace {

// ROS camera_info, as camera_calibration_parsers writes it.
Exported export_camera_info(const calib::CameraRig& rig) {
  Exported out;
  for (const calib::Camera& camera : rig.cameras) {
    const auto d = coefficients_of(camera.model);
    const auto k = intrinsics_of(camera.model);
    const std::string model = is_fisheye(camera.model) ? "equidistant"
                              : d.size() == 8          ? "rational_polynomial"
                                                       : "plumb_bob";
    const auto block = [](const char* key, int rows, std::size_t columns, std::span<const double> data) {
      return std::string(key) + ":\n  rows: " + std::to_string(rows) + "\n  cols: " + std::to_string(columns) +
             "\n  data: " + exact_list(data) + "\n";
    };
    const std::array<double, 9> identity{1, 0, 0, 0, 1, 0, 0, 0, 1};
    const std::array<double, 12> projection{k[0], 0, k[2], 0, 0, k[4], k[5], 0, 0, 0, 1, 0};
    out.files.emplace_back(camera.name + ".yaml", "image_width: " + std::to_string(camera.image_size.width) +
                                                      "\nimage_height: " + std::to_string(camera.image_size.height) +
                                                      "\ncamera_name: " + camera.name + "\n" +
                                                      block("camera_matrix", 3, 3, k) + "distortion_model: " + model +
                                                      "\n" + block("distortion_coefficients", 1, d.size(), d) +
                                                      block("rectification_matrix", 3, 3, identity) +
                                                      block("projection_matrix", 3, 4, projection));
  }
  const bool posed = rig.cameras.size() > 1 || rig.cameras.front().cam_from_world.translation.norm() > 0 ||
                     std::abs(rig.cameras.front().cam_from_world.rotation.w()) < 1;
  if (posed) out.notes.emplace_back("camera_info holds no poses: cam_from_world is not in these files");
  if (!rig.made_by.empty()) out.notes.emplace_back("camera_info has no place for made_by");
  return out;
}

// Kalibr's camchain. line_delay_nanoseconds (whole, >= 0) is of the rolling-shutter branch
// (github.com/JzHuai0108/kalibr). Adds notes on what the format cannot hold.
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

// OpenCV's FileStorage, with the keys of OpenCV's samples.
cv::Mat matrix_of(const std::vector<double>& values, int rows) {
  cv::Mat m(rows, static_cast<int>(values.size()) / rows, CV_64F);
  std::ranges::copy(values, m.ptr<double>());
  return m;
}
cv::Mat rotation_matrix(const calib::Rigid3d& pose) {
  const Eigen::Matrix3d r = pose.rotation.toRotationMatrix();
  std::vector<double> values;
  for (int i = 0; i < 3; ++i) values.insert(values.end(), {r(i, 0), r(i, 1), r(i, 2)});
  return matrix_of(values, 3);
}
cv::Mat translation_matrix(const calib::Rigid3d& pose) {
  return matrix_of({pose.translation.x(), pose.translation.y(), pose.translation.z()}, 3);
}

Exported export_opencv(const calib::CameraRig& rig, const ExportOptions& options) {
  if (options.extension != "yml" && options.extension != "yaml" && options.extension != "xml" &&
      options.extension != "json")
    throw ExchangeError("OpenCV's FileStorage writes yml, xml or json, not " + options.extension);
  Exported out;
  const auto write = [&](const std::string& stem, const auto& fill) {
    const std::string file = stem + "." + options.extension;
    cv::FileStorage storage(file, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
    fill(storage);
    out.files.emplace_back(file, storage.releaseAndGetString());
  };
  if (options.stereo) {
    if (rig.cameras.size() != 2)
      throw ExchangeError("a stereo file holds two cameras, the rig has " + std::to_string(rig.cameras.size()));
    const calib::Camera &a = rig.cameras[0], &b = rig.cameras[1];
    if (a.image_size != b.image_size)
      throw ExchangeError("a stereo file holds one image size, but the cameras have two");
    if (is_fisheye(a.model) != is_fisheye(b.model))
      throw ExchangeError("a stereo file holds one kind of lens, but only one of the two is a fisheye");
    write("stereo", [&](cv::FileStorage& s) {
      s << "image_width" << a.image_size.width << "image_height" << a.image_size.height;
      s << "camera_name1" << a.name << "camera_name2" << b.name;
      if (is_fisheye(a.model)) s << "fisheye_model" << 1;
      s << "M1" << matrix_of(intrinsics_of(a.model), 3) << "D1" << matrix_of(coefficients_of(a.model), 1);
      s << "M2" << matrix_of(intrinsics_of(b.model), 3) << "D2" << matrix_of(coefficients_of(b.model), 1);
      const calib::Rigid3d pose = b.cam_from_world * calib::inverse(a.cam_from_world);
      s << "R" << rotation_matrix(pose) << "T" << translation_matrix(pose);
    });
    if (a.cam_from_world.translation.norm() > 0 || std::abs(a.cam_from_world.rotation.w()) < 1)
      out.notes.push_back("a stereo file holds the pose between the cameras only: the world becomes " + a.name +
                          "'s frame");
  } else {
    for (const calib::Camera& camera : rig.cameras) {
      write(camera.name, [&](cv::FileStorage& s) {
        s << "camera_name" << camera.name << "image_width" << camera.image_size.width << "image_height"
          << camera.image_size.height;
        if (is_fisheye(camera.model)) s << "fisheye_model" << 1;
        s << "camera_matrix" << matrix_of(intrinsics_of(camera.model), 3);
        s << "distortion_coefficients" << matrix_of(coefficients_of(camera.model), 1);
        s << "cam_from_world_rotation" << rotation_matrix(camera.cam_from_world);
        s << "cam_from_world_translation" << translation_matrix(camera.cam_from_world);
      });
    }
    if (rig.cameras.size() > 1)
      out.notes.emplace_back(
          "cam_from_world_rotation and _translation are keys of huetrack: OpenCV has none for a rig's poses");
  }
  if (!rig.made_by.empty()) out.notes.emplace_back("these files have no place for made_by");
  return out;
}

// Anipose's and Caliscope's TOML.
std::string camera_text(const calib::Camera& camera, bool fisheye_always) {
  const auto k = intrinsics_of(camera.model);
  const std::span<const double> m(k);
  const Eigen::Vector3d r = vector_of(camera.cam_from_world.rotation), &t = camera.cam_from_world.translation;
  std::string out =
      "size = [" + std::to_string(camera.image_size.width) + ", " + std::to_string(camera.image_size.height) + "]\n";
  out += "matrix = [" + exact_list(m.subspan(0, 3)) + ", " + exact_list(m.subspan(3, 3)) + ", " +
         exact_list(m.subspan(6, 3)) + "]\n";
  out += "distortions = " + exact_list(coefficients_of(camera.model)) + "\n";
  out += "rotation = " + exact_list(std::array{r.x(), r.y(), r.z()}) + "\n";
  out += "translation = " + exact_list(std::array{t.x(), t.y(), t.z()}) + "\n";
  if (is_fisheye(camera.model) || fisheye_always)
    out += std::string("fisheye = ") + (is_fisheye(camera.model) ? "true\n" : "false\n");
  return out;
}

void note_rational(const calib::Camera& camera, std::string_view tool, std::vector<std::string>& notes) {
  if (!is_fisheye(camera.model) && coefficients_of(camera.model).size() == 8) {
    notes.push_back(camera.name + " has 8 distortion coefficients: " + std::string(tool) +
                    " passes them to OpenCV, which applies them, but refines and shows only 5");
  }
}

Exported export_aniposelib(const calib::CameraRig& rig) {
  Exported out;
  std::string text;
  for (std::size_t n = 0; n < rig.cameras.size(); ++n) {
    const calib::Camera& camera = rig.cameras[n];
    text += "[cam_" + std::to_string(n) + "]\nname = " + files::in_json_quotes(camera.name) + "\n" +
            camera_text(camera, false) + "\n";
    note_rational(camera, "aniposelib", out.notes);
  }
  text += "[metadata]\n";
  for (const auto& [key, value] : rig.made_by)
    text += files::in_json_quotes(key) + " = " + files::in_json_quotes(value) + "\n";
  out.files.emplace_back("calibration.toml", text);
  return out;
}

Exported export_caliscope(const calib::CameraRig& rig) {
  Exported out;
  std::string text;
  // Caliscope numbers its cameras: by the digits at the ends of the names, if they are unique.
  std::vector<std::string> numbers;
  for (const calib::Camera& camera : rig.cameras) {
    const auto digits = camera.name.find_last_not_of("0123456789");
    const std::string tail = digits == std::string::npos ? camera.name : camera.name.substr(digits + 1);
    if (!tail.empty() && tail.size() <= 6) numbers.push_back(std::to_string(std::stoi(tail)));
  }
  if (numbers.size() != rig.cameras.size() ||
      std::set<std::string>(numbers.begin(), numbers.end()).size() != numbers.size()) {
    numbers.clear();
    for (std::size_t n = 0; n < rig.cameras.size(); ++n) numbers.push_back(std::to_string(n));
  }
  for (std::size_t n = 0; n < rig.cameras.size(); ++n) {
    const calib::Camera& camera = rig.cameras[n];
    text += "[cameras." + numbers[n] + "]\ncam_id = " + numbers[n] + "\nrotation_count = 0\nignore = false\n" +
            camera_text(camera, true) + "\n";
    if (camera.name != "cam_" + numbers[n])
      out.notes.push_back("Caliscope numbers its cameras: " + camera.name + " is cam_" + numbers[n]);
    note_rational(camera, "Caliscope", out.notes);
  }
  out.files.emplace_back("camera_array.toml", text);
  if (!rig.made_by.empty()) out.notes.emplace_back("Caliscope has no place for made_by");
  return out;
}

Exported exported_as(const calib::CameraRig& rig, const ExportOptions& options) {
  switch (options.format) {
    case ExchangeFormat::ros:
      return export_camera_info(rig);
    case ExchangeFormat::opencv:
      return export_opencv(rig, options);
    case ExchangeFormat::kalibr:
      return export_kalibr(rig);
    case ExchangeFormat::aniposelib:
      return export_aniposelib(rig);
    case ExchangeFormat::caliscope:
      return export_caliscope(rig);
    default:
      throw ExchangeError(std::string(name(options.format)) + " can be imported only");
  }
}

// Other tools have pinhole and fisheye lenses only: approximates any other by the nearest of these.
calib::CameraRig with_their_lenses(calib::CameraRig rig, ExchangeFormat format, std::vector<std::string>& notes) {
  // kalibr reads four coefficients, the TOML formats five.
  const bool reads_rational = format == ExchangeFormat::ros || format == ExchangeFormat::opencv;
  const int radtan = format == ExchangeFormat::kalibr ? 8 : reads_rational ? 12 : 9;
  for (calib::Camera& camera : rig.cameras) {
    if (!std::holds_alternative<calib::Stereographic>(camera.model.lens())) continue;
    const calib::NearestLens pinhole =
        calib::nearest_lens(camera.model, camera.image_size, calib::CameraModel(calib::PinholeRadtan{}), radtan);
    const calib::NearestLens fisheye =
        calib::nearest_lens(camera.model, camera.image_size, calib::CameraModel(calib::FisheyeKannalaBrandt{}), 8);
    const bool use_fisheye = !pinhole.covers_image || (fisheye.covers_image && fisheye.p95_px < pinhole.p95_px);
    const calib::NearestLens& nearest = use_fisheye ? fisheye : pinhole;
    notes.push_back(
        fmt::format("{}: {} has no stereographic lens: written as the nearest {}, with an error of {:.2g} px (95 % of "
                    "the image), at most {:.2g} px",
                    camera.name, name(format), use_fisheye ? "fisheye" : "pinhole", nearest.p95_px, nearest.worst_px));
    camera.model = nearest.model;
  }
  return rig;
}

}  // namespace

Exported export_rig(const calib::CameraRig& given, const ExportOptions& options) {
  std::vector<std::string> notes;
  const calib::CameraRig rig = with_their_lenses(given, options.format, notes);
  Exported out = exported_as(rig, options);
  out.notes.insert(out.notes.begin(), notes.begin(), notes.end());
  const bool is_timed = std::ranges::any_of(rig.cameras, [](const calib::Camera& c) { return c.timing.is_known(); });
  if (is_timed && options.format != ExchangeFormat::kalibr)
    out.notes.push_back(
        fmt::format("{} has no place for the cameras' timing (latency, readout)", name(options.format)));
  if (rig.uncertainty)
    out.notes.push_back(fmt::format("{} has no place for the calibration's uncertainty", name(options.format)));
  return out;
}

}  // namespace huetrack::exchange
