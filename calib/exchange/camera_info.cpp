// ROS camera_info, as camera_calibration_parsers writes it. K, D and the size are imported; rectification and
// projection matrix describe a rectified image, which huetrack does not use.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "calib/exchange/exchanged_camera.h"
#include "calib/yaml/yaml_reader.h"

namespace huetrack::exchange {
namespace {

std::vector<double> matrix(const yaml::YamlReader& reader, std::string_view key, std::int64_t rows,
                           std::int64_t max_columns) {
  const yaml::YamlReader m = reader.map(key);
  const auto r = m.integer("rows", {.min = 0, .max = 64}), c = m.integer("cols", {.min = 0, .max = 64});
  if (r != rows || c > max_columns)
    m.fail("rows",
           "is " + std::to_string(r) + " x " + std::to_string(c) + ", expected " + std::to_string(rows) + " rows");
  const auto n = static_cast<std::size_t>(r * c);
  const auto data = m.numbers("data", n, n, yaml::any_number);
  m.finish();
  return data;
}

}  // namespace

Imported import_camera_info(const std::filesystem::path& file, const ImportOptions& options) {
  const yaml::YamlReader reader = yaml::YamlReader::file(file);
  Imported out;
  calib::Camera camera;
  camera.name = clean_name(reader.string("camera_name", file.stem().string()));
  camera.image_size = {static_cast<int>(reader.integer("image_width", {.min = 1, .max = 32768},
                                                       options.image_size ? options.image_size->width : 0)),
                       static_cast<int>(reader.integer("image_height", {.min = 1, .max = 32768},
                                                       options.image_size ? options.image_size->height : 0))};
  if (camera.image_size.width == 0 || camera.image_size.height == 0)
    reader.fail("image_width", "is missing: give --size WIDTHxHEIGHT");
  constexpr std::array<std::string_view, 3> models{"plumb_bob", "rational_polynomial", "equidistant"};
  const std::string model = reader.choice("distortion_model", models);
  const auto k = matrix(reader, "camera_matrix", 3, 3);
  const auto d = matrix(reader, "distortion_coefficients", 1, 14);
  const Fail fail = [&](std::string_view key, const std::string& message) { reader.fail(key, message); };
  if (model == "plumb_bob" && d.size() != 4 && d.size() != 5 && !d.empty())
    reader.fail("distortion_coefficients", "plumb_bob has 5 coefficients, got " + std::to_string(d.size()));
  camera.model = opencv_lens(k, "camera_matrix", d, "distortion_coefficients", model == "equidistant", fail);

  if (reader.has("rectification_matrix")) {
    const auto r = matrix(reader, "rectification_matrix", 3, 3);
    constexpr std::array<double, 9> identity{1, 0, 0, 0, 1, 0, 0, 0, 1};
    if (!std::ranges::equal(r, identity))
      out.notes.emplace_back("rectification_matrix is not taken over: huetrack uses the unrectified image");
  }
  if (reader.has("projection_matrix")) {
    const auto p = matrix(reader, "projection_matrix", 3, 4);
    const bool same =
        p.size() == 12 && p[0] == k[0] && p[2] == k[2] && p[5] == k[4] && p[6] == k[5] && p[3] == 0 && p[7] == 0;
    if (!same && p.size() == 12 && p[3] != 0) {
      out.notes.push_back(
          fmt::format("projection_matrix is not taken over; this is the second camera of a rectified pair, "
                      "{:.4g} m from the first: estimate its pose anew with extrinsics or wave",
                      -p[3] / p[0]));
    } else if (!same) {
      out.notes.emplace_back("projection_matrix is not taken over: it belongs to a rectified image");
    }
  }
  for (const std::string_view key : {"binning_x", "binning_y"}) {
    if (reader.has(key) && reader.integer(key, {.min = 0, .max = 64}) > 1)
      reader.fail(key, "is not 1: a rig needs the calibration of the image that the camera delivers");
  }
  if (const auto roi = reader.optional_map("roi")) {
    bool whole = true;
    for (const std::string_view key : {"x_offset", "y_offset", "height", "width"})
      whole = roi->integer(key, yaml::any_number, 0) == 0 && whole;
    if (roi->has("do_rectify")) roi->boolean("do_rectify");
    roi->finish();
    if (!whole)
      reader.fail("roi", "is a part of the image: a rig needs the calibration of the image that the camera delivers");
  }
  reader.finish();
  out.notes.emplace_back("camera_info holds no pose: the world is the camera's own frame");
  out.rig.cameras.push_back(std::move(camera));
  return out;
}

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

}  // namespace huetrack::exchange
