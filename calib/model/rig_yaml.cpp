#include "calib/model/rig_yaml.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <stdexcept>

#include "calib/files/number_text.h"
#include "calib/files/output_file.h"
#include "calib/files/text_file.h"
#include "calib/model/index.h"
#include "calib/yaml/yaml_reader.h"

namespace huetrack::calib {
namespace {

constexpr std::array<std::string_view, 3> model_names{"pinhole_radtan", "fisheye_kb", "stereographic"};
constexpr double rotation_tolerance = 1e-4;  // for rotations printed with few digits

template <typename Lens>
Lens lens_of(const yaml::YamlReader& intrinsics, const std::vector<double>& distortion) {
  Lens lens;
  lens.fx = intrinsics.number("fx", yaml::positive);
  lens.fy = intrinsics.number("fy", yaml::positive);
  lens.cx = intrinsics.number("cx", yaml::any_number);
  lens.cy = intrinsics.number("cy", yaml::any_number);
  intrinsics.finish();
  std::ranges::copy(distortion, lens.distortion.begin());
  return lens;
}

CameraModel read_model(const yaml::YamlReader& camera) {
  const std::string model = camera.choice("model", model_names);
  const bool fisheye = model == "fisheye_kb", stereographic = model == "stereographic";
  const yaml::YamlReader intrinsics = camera.map("intrinsics");
  if (!camera.has("distortion")) {
    camera.fail("distortion", std::string("is missing; a lens without distortion has ") +
                                  (fisheye         ? "[0, 0, 0, 0]"
                                   : stereographic ? "[0, 0, 0, 0, 0, 0, 0, 0]"
                                                   : "[0, 0, 0, 0, 0]"));
  }
  if (fisheye) {
    return CameraModel(lens_of<FisheyeKannalaBrandt>(intrinsics, camera.numbers("distortion", 4, 4, yaml::any_number)));
  }
  if (stereographic)
    return CameraModel(lens_of<Stereographic>(intrinsics, camera.numbers("distortion", 8, 8, yaml::any_number)));
  const auto distortion = camera.numbers("distortion", 4, 8, yaml::any_number);
  if (distortion.size() == 6 || distortion.size() == 7) {
    camera.fail("distortion", "pinhole_radtan has 4 (k1 k2 p1 p2), 5 (k3) or 8 (k4 k5 k6) coefficients, got " +
                                  std::to_string(distortion.size()));
  }
  return CameraModel(lens_of<PinholeRadtan>(intrinsics, distortion));
}

Eigen::MatrixXd matrix_of(const std::vector<std::vector<double>>& rows) {
  Eigen::MatrixXd m(rows.size(), rows.front().size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    m.row(Eigen::Index(i)) = Eigen::Map<const Eigen::RowVectorXd>(rows[i].data(), m.cols());
  return m;
}

// The mapping that a rig has for a 4x4 matrix, for an error message.
std::string pose_text(const Eigen::Matrix4d& pose) {
  std::vector<std::string> rows;
  const auto add = [&](double a, double b, double c) {
    rows.push_back(fmt::format("[{:.7g}, {:.7g}, {:.7g}]", a, b, c));
  };
  for (int i = 0; i < 3; ++i) add(pose(i, 0), pose(i, 1), pose(i, 2));
  add(pose(0, 3), pose(1, 3), pose(2, 3));
  return fmt::format("{{rotation: [{}, {}, {}], translation: {}}}", rows[0], rows[1], rows[2], rows[3]);
}

// Poses as programs hold them: 4x4, or of the other direction.
void refuse_other_poses(const yaml::YamlReader& camera) {
  if (camera.is_list("cam_from_world"))
    camera.fail("cam_from_world", "is a matrix; write " + pose_text(matrix_of(camera.rows("cam_from_world", 4, 4))));
  if (camera.has("cam_from_world") || !camera.has("world_from_cam")) return;
  const std::string message = "a rig has the inverse pose, cam_from_world (p_cam = R p_world + t)";
  if (!camera.is_list("world_from_cam")) camera.fail("world_from_cam", message);
  const Eigen::Matrix4d pose = matrix_of(camera.rows("world_from_cam", 4, 4));
  if (!pose.fullPivLu().isInvertible()) camera.fail("world_from_cam", message + ", and this matrix has no inverse");
  camera.fail("world_from_cam", message + ": write cam_from_world: " + pose_text(pose.inverse()));
}

Eigen::Quaterniond read_rotation_matrix(const yaml::YamlReader& pose) {
  const Eigen::Matrix3d m = matrix_of(pose.rows("rotation", 3, 3));
  if (const double off = (m * m.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
      !(off <= rotation_tolerance)) {
    pose.fail("rotation",
              fmt::format("is not a rotation: its rows must be orthogonal and of length 1 (off by {:.2g})", off));
  }
  if (m.determinant() < 0) {
    pose.fail("rotation", "is mirrored (determinant -1): a camera is right-handed, x right, y down, z forward");
  }
  return Eigen::Quaterniond(m).normalized();  // the file's digits are rounded
}

Eigen::Quaterniond read_quaternion(const yaml::YamlReader& pose) {
  const auto xyzw = pose.numbers("quaternion_xyzw", 4, 4, yaml::any_number);
  const Eigen::Quaterniond q(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
  const double off = std::abs(q.norm() - 1);
  if (!(off <= rotation_tolerance)) pose.fail("quaternion_xyzw", "must have length 1");
  return off < 1e-12 ? q : q.normalized();  // what we wrote reads back to the same bits
}

Rigid3d read_pose(const yaml::YamlReader& pose) {
  if (pose.has("rotation") && pose.has("quaternion_xyzw")) {
    pose.fail("quaternion_xyzw", "is given together with rotation: give one of them");
  }
  const Eigen::Quaterniond rotation = pose.has("quaternion_xyzw") ? read_quaternion(pose) : read_rotation_matrix(pose);
  const auto t = pose.numbers("translation", 3, 3, yaml::any_number);
  pose.finish();
  return {rotation, {t[0], t[1], t[2]}};
}

CameraTiming read_timing(const yaml::YamlReader& reader) {
  CameraTiming timing;
  const auto number = [&](const char* key, std::optional<double>& value, yaml::Range range) {
    if (reader.has(key)) value = reader.number(key, range);
  };
  number("latency_s", timing.latency_s, {.min = -1, .max = 1});
  number("latency_sigma_s", timing.latency_sigma_s, {.min = 0, .max = 1});
  number("readout_s", timing.readout_s, {.min = -1, .max = 1});
  number("readout_sigma_s", timing.readout_sigma_s, {.min = 0, .max = 1});
  reader.finish();
  return timing;
}

Camera read_camera(const std::string& name, const yaml::YamlReader& reader, bool pose_required) {
  Camera camera;
  camera.name = name;
  const auto size = reader.numbers("image_size", 2, 2, {.min = 1, .max = 32768});
  for (const double pixels : size) {
    if (pixels != std::trunc(pixels)) reader.fail("image_size", "must be whole pixels, [width, height]");
  }
  camera.image_size = {static_cast<int>(size[0]), static_cast<int>(size[1])};
  camera.model = read_model(reader);
  // A single camera may have no pose: the world is then its own frame.
  refuse_other_poses(reader);
  if (pose_required || reader.has("cam_from_world")) camera.cam_from_world = read_pose(reader.map("cam_from_world"));
  if (const auto timing = reader.optional_map("timing")) camera.timing = read_timing(*timing);
  reader.finish();
  for (const auto& problem : camera.problems()) reader.fail("", problem);
  return camera;
}

UtcTime read_time(const yaml::YamlReader& reader, const char* key) {
  const std::string text = reader.string(key);
  const auto time = utc_time(text);
  if (!time) reader.fail(key, "must be a time like 2026-11-22T16:04:08Z, in UTC, got " + text);
  return *time;
}

RigHistory read_history(const yaml::YamlReader& reader) {
  constexpr yaml::Range temperatures{.min = -90, .max = 150};
  RigHistory made;
  if (reader.has("at")) made.at = read_time(reader, "at");
  if (reader.has("temperature_c")) made.temperature_c = reader.number("temperature_c", temperatures);
  if (reader.has("checks")) {
    for (const yaml::YamlReader& check : reader.maps("checks")) {
      made.checks.push_back(
          {read_time(check, "at"), check.string("verdict"), check.has("text") ? check.string("text") : ""});
      check.finish();
    }
  }
  reader.finish();
  return made;
}

// The lower triangle, row by row.
RigUncertainty read_uncertainty(const yaml::YamlReader& reader, const CameraRig& rig) {
  RigUncertainty out;
  out.cameras.resize(rig.cameras.size());
  std::vector<double> sigma;
  int next = 0;
  for (const auto& [name, camera] : reader.named_maps("sigma")) {
    const auto c = rig.index_of(name);
    if (!c) camera.fail("", "is no camera of this rig");
    if (*c < next) camera.fail("", "is out of order: write the cameras in the order of `cameras`");
    next = *c + 1;
    RigUncertainty::CameraParameters& of = out.cameras[index(*c)];
    const auto take = [&, &from = camera](const char* key, std::size_t min, std::size_t max) {
      const auto values = from.has(key) ? from.numbers(key, min, max, yaml::non_negative) : std::vector<double>();
      sigma.insert(sigma.end(), values.begin(), values.end());
      return static_cast<int>(values.size());
    };
    of.lens_count = take("lens", 8, 12);
    of.has_pose = take("pose", 6, 6) > 0;
    camera.finish();
  }
  int at = 0;
  for (RigUncertainty::CameraParameters& of : out.cameras) {
    of.at = at;
    at += of.size();
  }
  const std::size_t n = sigma.size();
  out.sigma = Eigen::Map<const Eigen::VectorXd>(sigma.data(), static_cast<Eigen::Index>(n));
  const auto root = reader.numbers("root", n * (n + 1) / 2, n * (n + 1) / 2, {.min = -1, .max = 1});
  out.root = Eigen::MatrixXd::Zero(out.sigma.size(), out.sigma.size());
  auto value = root.begin();
  for (Eigen::Index row = 0; row < out.root.rows(); ++row) {
    for (Eigen::Index column = 0; column <= row; ++column) out.root(row, column) = *value++;
  }
  reader.finish();
  return out;
}

std::string list(std::span<const double> values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(files::shortest_text(value));
  return fmt::format("[{}]", fmt::join(texts, ", "));
}

// Text of another tool's file, without the control characters that our reader rejects.
std::string readable(const std::string& text) {
  std::string lines = text;
  std::ranges::replace(lines, '\n', ' ');
  return files::has_control_characters(lines) ? files::printable(text, files::longest_message) : text;
}

// A plain word needs no quotes in YAML.
std::string key_text(const std::string& key) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  const bool is_word = !key.empty() && is_letter(key.front()) &&
                       std::ranges::all_of(key, [&](char c) { return is_letter(c) || (c >= '0' && c <= '9'); });
  return is_word && key != "null" && key != "Null" && key != "NULL" ? key : files::in_yaml_quotes(key);
}

std::string distortion_text(const PinholeRadtan& lens) {
  const auto& k = lens.distortion;
  const bool rational = k[5] != 0 || k[6] != 0 || k[7] != 0;
  return list(std::span(k).first(rational ? 8 : 5)) +
         (rational ? "   # k1 k2 p1 p2 k3 k4 k5 k6" : "   # k1 k2 p1 p2 k3");
}

std::string distortion_text(const FisheyeKannalaBrandt& lens) {
  return list(lens.distortion) + "   # k1 k2 k3 k4";
}

std::string distortion_text(const Stereographic& lens) {
  return list(lens.distortion) + "   # k1 k2 p1 p2 k3 k4 s1 s2";
}

std::string timing_text(const CameraTiming& timing) {
  std::vector<std::string> entries;
  const auto add = [&](const char* key, const std::optional<double>& value) {
    if (value) entries.push_back(fmt::format("{}: {}", key, files::shortest_text(*value)));
  };
  add("latency_s", timing.latency_s);
  add("readout_s", timing.readout_s);
  add("latency_sigma_s", timing.latency_sigma_s);
  add("readout_sigma_s", timing.readout_sigma_s);
  return fmt::format("{{{}}}", fmt::join(entries, ", "));
}

std::string history_text(const RigHistory& made) {
  std::string out = "made:\n";
  if (made.at) out += "  at: " + utc_text(*made.at) + "\n";
  if (made.temperature_c) out += "  temperature_c: " + files::shortest_text(*made.temperature_c) + "\n";
  if (!made.checks.empty()) out += "  checks:\n";
  for (const RigCheckNote& check : made.checks) {
    out += "    - {at: " + utc_text(check.at) + ", verdict: " + files::in_yaml_quotes(check.verdict);
    if (!check.text.empty()) out += ", text: " + files::in_yaml_quotes(check.text);
    out += "}\n";
  }
  return out;
}

std::string uncertainty_text(const RigUncertainty& uncertainty, const CameraRig& rig) {
  std::string out = "uncertainty:   # the cameras' joint covariance; see calib/formats.md\n  sigma:\n";
  const std::span<const double> sigma(uncertainty.sigma.data(), static_cast<std::size_t>(uncertainty.sigma.size()));
  for (std::size_t c = 0; c < uncertainty.cameras.size(); ++c) {
    const RigUncertainty::CameraParameters& of = uncertainty.cameras[c];
    if (of.size() == 0) continue;
    std::vector<std::string> entries;
    if (of.lens_count > 0) entries.push_back("lens: " + list(sigma.subspan(index(of.at), index(of.lens_count))));
    if (of.has_pose) entries.push_back("pose: " + list(sigma.subspan(index(of.pose_at()), 6)));
    out += fmt::format("    {}: {{{}}}\n", key_text(rig.cameras[c].name), fmt::join(entries, ", "));
  }
  std::vector<std::string> rows;
  for (Eigen::Index row = 0; row < uncertainty.root.rows(); ++row) {
    const Eigen::RowVectorXd values = uncertainty.root.row(row).head(row + 1);
    const std::string text = list(std::span(values.data(), static_cast<std::size_t>(values.size())));
    rows.push_back("    " + text.substr(1, text.size() - 2));
  }
  return out + fmt::format("  root: [\n{}]\n", fmt::join(rows, ",\n"));
}

}  // namespace

CameraRig read_rig(const std::filesystem::path& file) {
  const yaml::YamlReader reader = yaml::YamlReader::file(file);
  if (!reader.has("cameras") && !reader.has("version"))
    reader.fail("",
                "this is no rig: it has no cameras; huetrack-calibrate import makes a rig of calibrations of other "
                "programs (OpenCV, ROS, Kalibr, ...)");
  reader.version(1);
  CameraRig rig;
  const auto cameras = reader.named_maps("cameras");
  if (cameras.size() > max_cameras)
    reader.fail("cameras", fmt::format("has {} cameras; a rig has at most {}", cameras.size(), max_cameras));
  for (const auto& [name, camera] : cameras) rig.cameras.push_back(read_camera(name, camera, cameras.size() > 1));
  if (const auto made_by = reader.optional_map("made_by")) {
    for (const auto& key : made_by->keys()) rig.made_by.emplace_back(key, made_by->string(key));
  }
  if (const auto made = reader.optional_map("made")) rig.made = read_history(*made);
  if (const auto uncertainty = reader.optional_map("uncertainty")) {
    rig.uncertainty = read_uncertainty(*uncertainty, rig);
    for (const auto& problem : rig.uncertainty->problems(rig)) uncertainty->fail("", problem);
  }
  reader.finish();
  for (const auto& problem : rig.problems()) reader.fail("cameras", problem);
  return rig;
}

std::string to_yaml(const CameraRig& rig) {
  std::string out =
      "# huetrack rig: see calib/README.md. Pixel (0,0) is the centre of the top-left pixel; metres;\n"
      "# p_cam = R(quaternion) * p_world + translation.\n"
      "version: 1\n"
      "cameras:\n";
  for (const Camera& camera : rig.cameras) {
    const CameraModel& model = camera.model;
    const Eigen::Quaterniond& q = camera.cam_from_world.rotation;
    const Eigen::Vector3d& t = camera.cam_from_world.translation;
    out += "  " + key_text(camera.name) + ":\n";
    out += "    image_size: [" + std::to_string(camera.image_size.width) + ", " +
           std::to_string(camera.image_size.height) + "]\n";
    out += "    model: " + std::string(model.name()) + "\n";
    out += "    intrinsics: {fx: " + files::shortest_text(model.fx()) + ", fy: " + files::shortest_text(model.fy()) +
           ", cx: " + files::shortest_text(model.cx()) + ", cy: " + files::shortest_text(model.cy()) + "}\n";
    out += "    distortion: " + std::visit([](const auto& lens) { return distortion_text(lens); }, model.lens()) + "\n";
    out += "    cam_from_world:\n";
    // A quaternion, because a matrix would have to be orthonormalised and would not read back to the same bits.
    out += "      quaternion_xyzw: " + list(std::array{q.x(), q.y(), q.z(), q.w()}) + "\n";
    out += "      translation: " + list(std::array{t.x(), t.y(), t.z()}) + "\n";
    if (camera.timing.is_known()) out += "    timing: " + timing_text(camera.timing) + "\n";
  }
  if (!rig.made_by.empty()) {
    out += "made_by:\n";
    for (const auto& [key, value] : rig.made_by)
      out += "  " + key_text(readable(key)) + ": " + files::in_yaml_quotes(readable(value)) + "\n";
  }
  if (!rig.made.is_empty()) out += history_text(rig.made);
  if (rig.uncertainty && rig.uncertainty->size() > 0) out += uncertainty_text(*rig.uncertainty, rig);
  return out;
}

void write_rig(const CameraRig& rig, const std::filesystem::path& file) {
  std::error_code none;
  if (std::filesystem::is_regular_file(file, none) && std::filesystem::file_size(file, none) > 0) {
    try {
      read_rig(file);
    } catch (const files::ConfigError&) {
      throw std::runtime_error(file.string() +
                               " exists and holds no rig: it is not replaced. Give another name, or remove it");
    }
  }
  files::write_whole_file(file, to_yaml(rig));
}

std::string rig_identity(const CameraRig& rig) {
  std::uint64_t hash = 0xcbf29ce484222325u;  // FNV-1a
  CameraRig same = rig;
  same.made = {};
  for (const char c : to_yaml(same)) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return fmt::format("{:016x}", hash);
}

}  // namespace huetrack::calib
