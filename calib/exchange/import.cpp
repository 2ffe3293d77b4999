// Calibrations of other tools. They differ in where a file has its cameras (Layout), in the words for the same thing,
// and in what a pose means; a lens is read by one function, whoever wrote it. Recognised by the keys and where they
// are.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "calib/exchange/exchanged_camera.h"
#include "calib/exchange/section.h"
#include "calib/files/config_error.h"
#include "calib/files/document_path.h"
#include "calib/files/file_order.h"

namespace huetrack::exchange {
namespace {

using std::string_view;

template <std::size_t n>
using List = std::array<string_view, n>;
template <typename... T>
constexpr List<sizeof...(T)> words(T... all) {
  return {all...};
}

constexpr auto k_words = words("camera_matrix", "cameraMatrix", "Camera_Matrix", "CameraMatrix", "intrinsic_matrix",
                               "cameraIntrinsics", "intrinsics", "matrix", "mtx", "K", "k");
constexpr auto d_words = words("distortion_coefficients", "Distortion_Coefficients", "distortionCoefficients",
                               "distCoeffs", "dist_coeffs", "dist_coeff", "distCoef", "distortion_coeffs",
                               "distortion_vector", "distortions", "cameraExtrinsics", "dist", "D",
                               "d");  // cameraExtrinsics: PhotonVision before 2023
constexpr auto width_words = words("image_width", "image_Width", "imageWidth", "img_width", "width", "W");
constexpr auto height_words = words("image_height", "image_Height", "imageHeight", "img_height", "height", "H");
constexpr auto size_words = words("imageSize", "image_size", "img_size", "cameraResolution", "resolution", "size");
constexpr auto model_words = words("distortion_model", "camera_model", "lensmodel");
constexpr auto fisheye_words = words("fisheye_model", "fisheye", "distortion_type");  // the last one: MC-Calib
// 4x4 or 3x4, by what they are called.
constexpr auto cam_from_world_words = words("cam_from_world", "T_cam_world", "T_cw", "Tcw", "world_to_cam", "w2c",
                                            "extrinsic", "extrinsics", "extrinsic_matrix", "pose");
constexpr auto world_from_cam_words =
    words("world_from_cam", "T_world_cam", "T_wc", "Twc", "cam_to_world", "c2w", "T_BS");
// p_cam = R p_world + t: a vector, or 3x3
constexpr auto rotation_words = words("rotation", "Rot", "R", "rvec", "rotation_matrix", "rotation_vector");
constexpr auto translation_words = words("translation", "T", "t", "tvec", "translation_vector");

enum class Layout {
  one,       // one camera per file: its keys are at the root
  suffixes,  // several at the root, their keys with a suffix: K_1, M2; in one file or several
  sections,  // a mapping per camera
};

struct Tool {
  ExchangeFormat format;
  string_view name, label;
  Layout layout;
  List<3> marks{};  // a file that has one of these, beside its lenses, is this tool's; none: any of this layout
};

// The first one that fits is the file's.
constexpr std::array<Tool, 13> tools{{
    {ExchangeFormat::openvins, "openvins", "OpenVINS", Layout::sections, {"T_imu_cam"}},
    {ExchangeFormat::kalibr, "kalibr", "Kalibr", Layout::sections, {"T_cn_cnm1", "rostopic", "camera_model"}},
    {ExchangeFormat::mccalib, "mccalib", "MC-Calib", Layout::sections, {"camera_pose_matrix", "distortion_vector"}},
    {ExchangeFormat::caliscope, "caliscope", "Caliscope", Layout::sections, {"cam_id", "port", "rotation_count"}},
    {ExchangeFormat::freemocap, "freemocap", "freemocap", Layout::sections, {"world_position", "world_orientation"}},
    {ExchangeFormat::panoptic, "panoptic", "CMU Panoptic", Layout::sections, {"distCoef", "calibDataSource"}},
    {ExchangeFormat::aniposelib, "aniposelib", "aniposelib or Pose2Sim", Layout::sections},
    {ExchangeFormat::easymocap, "easymocap", "EasyMocap", Layout::suffixes, {"names"}},
    {ExchangeFormat::opencv, "opencv", "OpenCV", Layout::suffixes},
    {ExchangeFormat::photonvision, "photonvision", "PhotonVision", Layout::one, {"cameraIntrinsics"}},
    {ExchangeFormat::ros, "ros", "ROS", Layout::one, {"distortion_model", "projection_matrix", "binning_x"}},
    {ExchangeFormat::opencv, "opencv", "OpenCV", Layout::one},
    {ExchangeFormat::opencv, "opencv", "OpenCV", Layout::sections},
}};

// Files of tools that are recognised, to say so, but not read.
struct Unread {
  string_view mark, label;
  bool looks_readable = false;  // some of its keys are those of calibrations that are read
};
constexpr string_view transforms =
    "transforms.json of nerfstudio or instant-ngp, the poses of a camera that was carried around,";
constexpr std::array<Unread, 19> unread{{{"Camera.fx", "ORB-SLAM's settings"},
                                         {"Camera1.fx", "ORB-SLAM's settings"},
                                         {"projection_parameters", "camodocal's or VINS-Fusion's camera"},
                                         {"mirror_parameters", "camodocal's or VINS-Fusion's camera"},
                                         {"camera_angle_x", transforms},
                                         {"fl_x", transforms},
                                         {"value0", "Basalt's calibration"},
                                         {"Calibration", "calib.io's calibration"},
                                         {"calibration", "Qualisys' calibration"},
                                         {"calibration.projection", "Metashape's or Agisoft Lens' calibration"},
                                         {"document.chunk", "Metashape's project"},
                                         {"Cameras.Camera", "Vicon's calibration"},
                                         {"frames", transforms},
                                         {"cameraData", "DepthAI's calibration"},
                                         {"sfm_data_version", "OpenMVG's scene", true},
                                         {"featuresFolders", "Meshroom's scene", true},
                                         {"imagersize", "mrcal's camera model", true},
                                         {"intrinsicMatrix", "JARVIS' calibration (its matrices are transposed)", true},
                                         {"target_type", "Kalibr's target file, which is given as --board,"}}};

// The file, as it is arranged.
struct Found {
  Layout layout = Layout::one;
  std::vector<std::pair<std::string, Section>> cameras;  // name (suffix), keys
};

bool has_lens(const Section& section) {
  return section.first_of(k_words) || section.first_of(d_words);
}

void sort_by_number(std::vector<std::pair<std::string, Section>>& cameras) {
  const auto stem = [](const std::string& name) { return name.substr(0, name.find_last_not_of("0123456789") + 1); };
  const bool alike =
      std::ranges::all_of(cameras, [&](const auto& c) { return stem(c.first) == stem(cameras.front().first); });
  if (alike) std::ranges::stable_sort(cameras, files::numbers_ascend, &std::pair<std::string, Section>::first);
}

// The suffixes of K: of EasyMocap's `names`, numbers, left and right.
std::vector<std::string> suffixes_of(const Section& root) {
  std::vector<std::string> names, found;
  if (root.has("names")) names = root.texts("names");
  constexpr auto of_k = words("K", "M", "cameraMatrix", "camera_matrix");
  for (const std::string& key : root.keys()) {
    for (const string_view word : of_k) {
      if (!key.starts_with(word)) continue;
      std::string rest = key.substr(word.size());
      if (rest.starts_with('_')) rest.erase(0, 1);
      const bool is_number = !rest.empty() && rest.find_first_not_of("0123456789") == std::string::npos;
      const bool is_side = rest == "left" || rest == "right" || (word == "K" && (rest == "L" || rest == "R"));
      if ((is_number || is_side || std::ranges::find(names, rest) != names.end()) &&
          std::ranges::find(found, rest) == found.end())
        found.push_back(rest);
    }
  }
  const auto right = std::ranges::find(found, "R");
  if (right == found.begin() && found.size() == 2 && found[1] == "L") std::swap(found[0], found[1]);
  return found;
}

// Mappings with a lens at the root, or one level below it ("cameras").
std::vector<std::pair<std::string, Section>> sections_of(const Section& root) {
  std::vector<std::pair<std::string, Section>> found;
  for (auto& [name, section] : root.maps()) {
    if (name == "value0") continue;  // Basalt's root, with a layout of its own
    if (has_lens(section)) {
      found.emplace_back(name, section);
      continue;
    }
    for (auto& [inner_name, inner] : section.maps()) {
      if (has_lens(inner)) found.emplace_back(inner_name, inner);
    }
  }
  sort_by_number(found);
  return found;
}

// The last of the tools with a key in the file; nullptr: none.
const Unread* unread_in(const Section& root) {
  const Unread* found = nullptr;
  for (const Unread& known : unread) {
    const std::size_t dot = known.mark.find('.');
    const auto inner = dot == string_view::npos ? std::nullopt : root.map(known.mark.substr(0, dot));
    if (root.has(known.mark) || (inner && inner->has(known.mark.substr(dot + 1)))) found = &known;
  }
  return found;
}

[[noreturn]] void refuse(const Section& root) {
  std::vector<std::string> seen = root.keys();
  if (root.has("names") && std::ranges::any_of(seen, [](const auto& key) { return key.starts_with("Rot_"); }))
    throw files::ConfigError(root.file(), 0, "is EasyMocap's extri.yml, which has poses only: give its intri.yml, too");
  constexpr std::size_t most = 12;
  const bool more = seen.size() > most;
  if (more) seen.resize(most);
  const Unread* const known = unread_in(root);
  const std::string is =
      known ? fmt::format("is {} and cannot be imported", known->label) : "is no calibration that import knows";
  if (known && known->looks_readable)
    throw files::ConfigError(
        root.file(), 0,
        fmt::format("{}: write its cameras as one of the files that are read "
                    "({}), as OpenCV's YAML. Its keys: {}{}",
                    is, files::document_path("calib/reference.md"), joined(seen), more ? ", ..." : ""));
  throw files::ConfigError(
      root.file(), 0,
      fmt::format(
          "{}: it has no camera matrix (camera_matrix, matrix, intrinsics, K, ...) and no distortion coefficients, at "
          "the root or in a section per camera. Its keys: {}{}. What is read, also with --from: {}",
          is, joined(seen), more ? ", ..." : "", files::document_path("calib/reference.md")));
}

Found arranged(const std::vector<Section>& roots) {
  for (const Section& root : roots)
    if (std::ranges::any_of(unread, [&](const Unread& known) { return known.looks_readable && root.has(known.mark); }))
      refuse(root);
  Found found;
  const bool plain = std::ranges::any_of(roots, has_lens);
  if (!plain) {
    const Section all = Section::joined(roots);
    for (const std::string& suffix : suffixes_of(all)) found.cameras.emplace_back(suffix, all);
    found.layout = Layout::suffixes;
    if (found.cameras.empty()) {
      found.cameras = sections_of(roots.front());
      found.layout = Layout::sections;
    }
    if (found.cameras.empty()) refuse(roots.front());
    return found;
  }
  for (const Section& root : roots) {
    if (has_lens(root)) found.cameras.emplace_back(root.file().stem().string(), root);
  }
  return found;
}

const Tool& tool_of(const Found& found, const Section& root) {
  return *std::ranges::find_if(tools, [&](const Tool& tool) {
    if (tool.layout != found.layout) return false;
    return tool.marks[0].empty() || std::ranges::any_of(tool.marks, [&](string_view mark) {
             const auto has = [&](const Section& section) {
               const auto keys = section.keys();
               return !mark.empty() && std::ranges::find(keys, mark) != keys.end();
             };
             return has(root) || std::ranges::any_of(found.cameras, [&](const auto& c) { return has(c.second); });
           });
  });
}

// K row by row: of 9 numbers, of fx fy cx cy, or of a mapping of these.
std::array<double, 9> k_of(const Section& section, const std::string& key) {
  if (const auto map = section.map(key); map && map->has("fx")) {
    const auto either = [&](string_view a, string_view b) { return map->number(map->has(a) ? a : b); };
    return {map->number("fx"), 0, either("cx", "ppx"), 0, map->number("fy"), either("cy", "ppy"), 0, 0, 1};
  }
  const auto k = section.numbers(key);
  if (k.size() == 4 && key == "intrinsics") return {k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1};
  if (k.size() != 9) section.fail(key, "must be a 3x3 matrix, got " + std::to_string(k.size()) + " numbers");
  std::array<double, 9> out;
  std::ranges::copy(k, out.begin());
  return out;
}

calib::ImageSize size_of(const Section& section, string_view suffix, const std::optional<calib::ImageSize>& given) {
  const auto whole = [&](const std::string& key, double value) {
    if (!(value >= 1) || value > 32768 || value != std::trunc(value))
      section.fail(key, "must be a whole number of pixels");
    return static_cast<int>(value);
  };
  for (const string_view of : {suffix, string_view()}) {
    const auto w = section.first_of(width_words, of), h = section.first_of(height_words, of);
    if (w && h) return {whole(*w, section.number(*w)), whole(*h, section.number(*h))};
    if (const auto key = section.first_of(size_words, of)) {
      if (const auto map = section.map(*key); map && map->has("width") && map->has("height"))
        return {whole(*key, map->number("width")), whole(*key, map->number("height"))};
      const auto wh = section.numbers(*key);
      if (wh.size() != 2) section.fail(*key, "must be two numbers, width and height");
      return {whole(*key, wh[0]), whole(*key, wh[1])};
    }
  }
  if (given) return *given;
  section.fail("image size", "is missing (image_width and image_height, size, resolution): give --size WIDTHxHEIGHT");
}

struct LensKind {
  bool fisheye = false, undistorted = false;
  int most = 14;  // coefficients
};

LensKind lens_kind_of(const Section& section, const std::string& given) {
  LensKind kind;
  constexpr auto pinhole = words("pinhole", "rational_polynomial", "radtan", "radial_tangential", "opencv", "brown",
                                 "brown_conrady", "standard", "perspective");
  constexpr auto fisheye =
      words("equidistant", "equi", "fisheye", "kannala_brandt", "kannala_brandt4", "opencv_fisheye");
  for (const string_view key : model_words) {
    if (!section.has(key) && (given.empty() || key != model_words.front())) continue;
    std::string word = given.empty() ? section.text(key) : given;
    if (!given.empty()) section.ignore(key);
    std::ranges::transform(word, word.begin(), [](unsigned char c) { return c == '-' ? '_' : std::tolower(c); });
    if (word == "none") {
      kind.undistorted = true;
    } else if (word == "plumb_bob") {
      kind.most = 5;
    } else if (std::ranges::find(fisheye, word) != fisheye.end()) {
      kind.fisheye = true;
    } else if (std::ranges::find(pinhole, word) == pinhole.end() && !word.starts_with("lensmodel_opencv")) {
      section.fail(key, "is " + (given.empty() ? section.text(key) : given) +
                            ", which a rig cannot hold: calibrate with a pinhole (plumb_bob, rational_polynomial, "
                            "radtan) or a fisheye lens (equidistant)");
    }
  }
  if (const auto key = section.first_of(fisheye_words)) {
    if (*key == "distortion_type" && section.number(*key) > 1)
      section.fail(*key, "is neither 0 (Brown) nor 1 (Kannala), and a rig has no other lens");
    kind.fisheye = section.boolean(*key);
  }
  return kind;
}

void read_lens(const Section& section, string_view suffix, const ImportOptions& options, calib::Camera& camera) {
  const auto k_key = section.first_of(k_words, suffix), m_key = section.first_of(words("M"), suffix);
  const auto d_key = section.first_of(d_words, suffix);
  const std::string of = suffix.empty() ? "" : " of " + std::string(suffix);
  if (!k_key && (suffix.empty() || !m_key))
    section.fail("camera matrix" + of, "is missing (looked for " + joined(k_words) + ")");
  const LensKind kind = lens_kind_of(section, options.distortion_model);
  if (!d_key && !kind.undistorted)
    section.fail("distortion coefficients" + of, "are missing (looked for " + joined(d_words) + ")");
  const std::string matrix_key = k_key ? *k_key : *m_key;
  const auto k = k_of(section, matrix_key);
  std::vector<double> d;
  if (d_key) d = section.numbers(*d_key);
  const auto used = std::ranges::find_if(d.rbegin(), d.rend(), [](double c) { return c != 0; }).base() - d.begin();
  if (kind.undistorted && used > 0) section.fail(*d_key, "has coefficients, but distortion_model is none");
  if (!kind.fisheye && used > kind.most)
    section.fail(*d_key, fmt::format("plumb_bob has 5 coefficients, got {} that are not 0", used));
  camera.model = opencv_lens(k, matrix_key, kind.undistorted ? std::vector<double>() : d, d_key.value_or(""),
                             kind.fisheye, section.failing());
  camera.image_size = size_of(section, suffix, options.image_size);
}

// Of two words: both or none.
std::optional<calib::Rigid3d> pose_of(const Section& section, Words rotations, Words translations,
                                      string_view suffix = {}) {
  const auto r_key = section.first_of(rotations, suffix), t_key = section.first_of(translations, suffix);
  if (!r_key || !t_key) {
    if (suffix.empty() && (r_key || t_key))
      section.fail(r_key ? *r_key : *t_key, "rotation and translation must both be given");
    return std::nullopt;
  }
  const auto r = section.numbers(*r_key), t = section.numbers(*t_key);
  if (r.size() != 9 && r.size() != 3) section.fail(*r_key, "must be a rotation vector (3 numbers) or a 3x3 matrix");
  if (t.size() != 3) section.fail(*t_key, "must be 3 numbers");
  return calib::Rigid3d{r.size() == 3 ? rotation_of_vector(r) : rotation_of(r, *r_key, section.failing()),
                        {t[0], t[1], t[2]}};
}

calib::Rigid3d matrix_pose(const Section& section, string_view key) {
  auto m = section.numbers(key);
  if (m.size() == 12) m.insert(m.end(), {0, 0, 0, 1});
  if (m.size() != 16) section.fail(key, "must be a 4x4 matrix, got " + std::to_string(m.size()) + " numbers");
  if (m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1) section.fail(key, "must end in the row 0 0 0 1");
  const std::array<double, 9> r{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]};
  return {rotation_of(r, key, section.failing()), {m[3], m[7], m[11]}};
}

// Of a pose matrix with one of our names for it.
std::optional<calib::Rigid3d> named_matrix_pose(const Section& section) {
  const auto is_matrix = [&](string_view key) {  // OpenCV's is a mapping with `data`
    const auto map = section.map(key);
    return !map || map->has("data");
  };
  if (const auto key = section.first_of(world_from_cam_words)) return calib::inverse(matrix_pose(section, *key));
  if (const auto key = section.first_of(cam_from_world_words); key && is_matrix(*key))
    return matrix_pose(section, *key);
  // T is the translation of others.
  if (section.has("T") && is_matrix("T") && section.numbers("T").size() >= 12) return matrix_pose(section, "T");
  return std::nullopt;
}

// Kalibr's time model, equivalent to calib::CameraTiming: row r is exposed at stamp + timeshift_cam_imu + r * line
// delay, on the clock of the IMU, which becomes the rig's reference clock. line_delay_nanoseconds is of the
// rolling-shutter branch (github.com/JzHuai0108/kalibr); line_delay, in seconds, is read, too.
calib::CameraTiming timing_of(const Section& cam, int height) {
  constexpr string_view shift = "timeshift_cam_imu", seconds = "line_delay", nanoseconds = "line_delay_nanoseconds";
  calib::CameraTiming timing;
  if (cam.has(seconds) && cam.has(nanoseconds))
    cam.fail(seconds, "is given together with line_delay_nanoseconds: give one of them");
  for (const auto& [key, unit_s] : {std::pair(seconds, 1.0), std::pair(nanoseconds, 1e-9)}) {
    if (!cam.has(key)) continue;
    timing.readout_s = unit_s * cam.number(key) * (height - 1);
    if (std::abs(*timing.readout_s) > 1 || (key == nanoseconds && *timing.readout_s < 0))
      cam.fail(key, "must be a line's, of an image that is read within a second");
  }
  if (cam.has(shift)) {
    timing.latency_s = -cam.number(shift) - timing.readout_s.value_or(0) / 2;
    if (std::abs(*timing.latency_s) > 1)
      cam.fail(shift, "is more than a second: the clocks are not related; remove it");
  }
  return timing;
}

// ROS: what describes another image than the camera's is named, or refused.
void check_camera_info(const Section& info, const calib::CameraModel& model, std::vector<std::string>& notes) {
  if (info.has("rectification_matrix")) {
    constexpr std::array<double, 9> identity{1, 0, 0, 0, 1, 0, 0, 0, 1};
    if (!std::ranges::equal(info.numbers("rectification_matrix"), identity))
      notes.emplace_back("rectification_matrix is not taken over: huetrack uses the unrectified image");
  }
  for (const string_view key : {"projection_matrix", "p", "P"}) {
    if (!info.has(key)) continue;
    const auto p = info.numbers(key);
    if (p.size() != 12) continue;
    if (p[3] != 0) {
      notes.push_back(
          fmt::format("projection_matrix is not taken over; this is the second camera of a rectified pair, {:.4g} m "
                      "from the first: estimate its pose anew with extrinsics or wave",
                      -p[3] / p[0]));
    } else if (p[0] != model.fx() || p[2] != model.cx() || p[5] != model.fy() || p[6] != model.cy() || p[7] != 0) {
      notes.emplace_back("projection_matrix is not taken over: it belongs to a rectified image");
    }
  }
  for (const string_view key : {"binning_x", "binning_y"}) {
    if (info.has(key) && info.number(key) > 1)
      info.fail(key, "is not 1: a rig needs the calibration of the image that the camera delivers");
  }
  if (const auto roi = info.map("roi")) {
    for (const string_view key : {"x_offset", "y_offset", "height", "width"}) {
      if (roi->has(key) && roi->number(key) != 0)
        info.fail("roi", "is a part of the image: a rig needs the calibration of the image that the camera delivers");
    }
  }
  for (const string_view key : {"r", "R", "header", "projection_matrix"}) info.ignore(key);
}

// renamed: of theirs, those that were there.
void rename_keys(yaml::Value& value, const std::vector<std::pair<std::string, std::string>>& names,
                 std::set<std::string>& renamed) {
  for (std::string& key : value.keys)
    for (const auto& [theirs, ours] : names)
      if (key == theirs) {
        renamed.insert(theirs);
        key = ours;
        break;
      }
  for (yaml::Value& item : value.items) rename_keys(item, names, renamed);
}

class Importer {
 public:
  explicit Importer(const ImportOptions& options) : options_(options) {}

  Imported read(std::span<const std::filesystem::path> files) {
    std::vector<std::vector<yaml::Value>> documents;
    for (const auto& file : files) documents.push_back(documents_of(file));
    std::set<std::string> renamed;
    for (auto& of_file : documents)
      for (yaml::Value& document : of_file) rename_keys(document, options_.keys, renamed);
    for (const auto& [theirs, ours] : options_.keys)
      if (!renamed.contains(theirs))
        throw files::ConfigError(files.front(), 0, "has no key " + theirs + ", which was given for " + ours);
    std::vector<Section> roots;
    for (std::size_t f = 0; f < files.size(); ++f) roots.emplace_back(documents[f].front(), files[f]);
    for (std::size_t f = 0; f < files.size(); ++f) require_same(documents[f], roots[f]);
    Found found = arranged(roots);
    const Tool& tool = tool_of(found, roots.front());
    check_layout(tool, roots.front());
    if (found.layout == Layout::sections && files.size() > 1)
      throw ExchangeError(std::string(tool.label) + "'s file holds all cameras: give only one");
    choose_resolution(found);
    for (const auto& [name, section] : found.cameras) names_.push_back(name_of(name, section, tool));
    if (found.layout == Layout::one) {
      read_single(found, roots);
    } else if (found.layout == Layout::suffixes) {
      read_suffixes(found);
      for (const Section& root : roots) note_left_out(root.file().filename().string(), root);
    } else {
      read_sections(roots.front(), found, tool);
      note_rest(roots.front(), found);
    }
    for (const std::string& wanted : options_.cameras) {
      if (std::ranges::find(names_, wanted) == names_.end())
        throw files::ConfigError(files.front(), 0, "has no camera " + wanted + "; it has " + joined(names_));
    }
    require_poses(files.front());
    if (out_.rig.made_by.empty()) {
      out_.rig.made_by.emplace_back("imported_from", files.front().filename().string());
      out_.rig.made_by.emplace_back("format", std::string(tool.name));
    }
    return std::move(out_);
  }

 private:
  bool is_wanted(const std::string& name) const {
    return options_.cameras.empty() || std::ranges::find(options_.cameras, name) != options_.cameras.end();
  }

  // `ros2 topic echo` repeats the message: all of one camera.
  void require_same(const std::vector<yaml::Value>& documents, const Section& root) {
    if (documents.size() == 1) return;
    for (std::size_t d = 1; d < documents.size(); ++d) {
      const Section other(documents[d], root.file());
      for (const Words either : {Words(k_words), Words(d_words)}) {
        const auto key = root.first_of(either), same = other.first_of(either);
        if (!key != !same || (!key && either.data() == k_words.data()))
          throw files::ConfigError(root.file(), documents[d].line, "a second document begins here, of other keys");
        if (key && root.numbers(*key) != other.numbers(*same))
          other.fail(*same, "differs from the first document's: the file has several cameras; give each its own file");
      }
    }
    out_.notes.push_back(
        fmt::format("the first of {} documents is read; the others repeat its lens", documents.size()));
  }

  void check_layout(const Tool& tool, const Section& root) const {
    if (!options_.format) return;
    const bool fits = std::ranges::any_of(
        tools, [&](const Tool& t) { return t.format == *options_.format && t.layout == tool.layout; });
    if (!fits)
      throw files::ConfigError(root.file(), 0,
                               fmt::format("is not of the tool given with --from, {}: it looks like {}'s (keys: {})",
                                           name(*options_.format), tool.label, joined(root.keys())));
  }

  // PhotonVision's settings have a list of calibrations of one camera, one per resolution.
  void choose_resolution(Found& found) const {
    const bool listed = found.layout == Layout::sections && std::ranges::all_of(found.cameras, [](const auto& c) {
                          return c.second.has("cameraIntrinsics");
                        });
    if (!listed) return;
    std::vector<std::string> sizes;
    std::erase_if(found.cameras, [&](const auto& camera) {
      const calib::ImageSize size = size_of(camera.second, {}, {});
      sizes.push_back(fmt::format("{}x{}", size.width, size.height));
      return options_.image_size && size != *options_.image_size;
    });
    if (found.cameras.size() != 1) {
      throw files::ConfigError(
          found.cameras.empty() ? std::filesystem::path() : found.cameras.front().second.file(), 0,
          "has calibrations of one camera for " + joined(sizes) + ": give one of these with --size");
    }
    found.cameras.front().first = found.cameras.front().second.file().stem().string();
  }

  std::string name_of(const std::string& key, const Section& section, const Tool& tool) {
    const bool is_number = !key.empty() && key.find_first_not_of("0123456789") == std::string::npos;
    std::string name = is_number && tool.layout == Layout::sections ? "cam_" + key : key;
    if (tool.layout != Layout::suffixes) {
      for (const string_view word : {"name", "camera_name"}) {
        if (section.has(word)) name = section.text(word);
      }
    }
    const std::string clean = clean_name(name);
    if (clean != name) out_.notes.push_back("camera " + name + " is named " + clean + ": " + calib::camera_name_rule);
    return clean;
  }

  void add(const std::string& name, const Section& section, string_view suffix,
           const std::optional<calib::Rigid3d>& pose) {
    if (std::ranges::find(out_.rig.cameras, name, &calib::Camera::name) != out_.rig.cameras.end())
      throw files::ConfigError(section.file(), section.line(), section.path() + ": a second camera " + name);
    if (!is_wanted(name)) return;
    calib::Camera camera;
    camera.name = name;
    read_lens(section, suffix, options_, camera);
    camera.cam_from_world = pose.value_or(calib::Rigid3d{});
    if (!pose) unposed_.push_back(name);
    out_.rig.cameras.push_back(std::move(camera));
  }

  void note_left_out(const std::string& of, const Section& section) {
    if (const auto left = section.left_out(); !left.empty())
      out_.notes.push_back(of + ": not taken over: " + joined(left));
  }

  void read_single(const Found& found, const std::vector<Section>& roots) {
    for (std::size_t c = 0; c < found.cameras.size(); ++c) {
      const Section& root = found.cameras[c].second;
      auto pose = pose_of(root, words("cam_from_world_rotation"), words("cam_from_world_translation"));
      if (!pose) pose = named_matrix_pose(root);
      // R alone is ROS' rectification.
      if (!pose && root.first_of(rotation_words) && root.first_of(translation_words))
        pose = pose_of(root, rotation_words, translation_words);
      add(names_[c], root, {}, pose);
      if (!out_.rig.cameras.empty() && out_.rig.cameras.back().name == names_[c])
        check_camera_info(root, out_.rig.cameras.back().model, out_.notes);
    }
    // A stereo pair's third file has its relative pose: rtabmap's.
    if (found.cameras.size() == 2 && roots.size() > 2) {
      const Section rest = Section::joined(roots);
      read_pair_pose(rest);
    }
    for (const Section& root : roots) note_left_out(root.file().filename().string(), root);
  }

  // stereoCalibrate: p_2 = R p_1 + T.
  void read_pair_pose(const Section& root) {
    const auto pose = pose_of(root, words("rotation_matrix", "R", "Rot"), words("translation_matrix", "T", "t"));
    if (!pose || out_.rig.cameras.size() != 2) return;
    unposed_.clear();
    out_.rig.cameras[1].cam_from_world = *pose;
    out_.notes.emplace_back(
        "the world is the first camera's frame (z forward, y down): set it with huetrack-calibrate world");
  }

  void read_suffixes(const Found& found) {
    const Section& root = found.cameras.front().second;
    const bool own_poses = std::ranges::any_of(found.cameras, [&](const auto& camera) {
      return pose_of(root, rotation_words, translation_words, camera.first).has_value();
    });
    const bool is_pair = !own_poses && found.cameras.size() == 2 && !root.has("names");
    for (std::size_t c = 0; c < found.cameras.size(); ++c) {
      const std::string& suffix = found.cameras[c].first;
      if (is_pair) {
        names_[c] = c == 0 ? "left" : "right";
        if (const std::string key = "camera_name" + suffix; root.has(key)) names_[c] = clean_name(root.text(key));
      }
    }
    for (std::size_t c = 0; c < found.cameras.size(); ++c)
      add(names_[c], root, found.cameras[c].first,
          pose_of(root, rotation_words, translation_words, found.cameras[c].first));
    if (is_pair) read_pair_pose(root);
    for (const auto& camera : found.cameras) {  // EasyMocap has the rotation twice, as matrix and vector
      if (const auto key = root.first_of(words("R"), camera.first); own_poses && key) root.ignore(*key);
    }
  }

  // What a section says of its pose; chain: of the camera before.
  std::optional<calib::Rigid3d> section_pose(const Section& section, bool chain, const calib::Rigid3d& before) {
    if (chain) return section.has("T_cn_cnm1") ? matrix_pose(section, "T_cn_cnm1") * before : calib::Rigid3d{};
    if (section.has("T_cam_imu")) return matrix_pose(section, "T_cam_imu");
    for (const string_view inverse_key : {"T_imu_cam", "camera_pose_matrix"}) {  // world from camera
      if (section.has(inverse_key)) return calib::inverse(matrix_pose(section, inverse_key));
    }
    if (const auto pose = named_matrix_pose(section)) return pose;
    return pose_of(section, rotation_words, translation_words);
  }

  // Of multical, which keeps the poses apart from the lenses: cam0, cam1_to_cam0, of which the latter is cam1 from
  // cam0.
  static std::optional<calib::Rigid3d> pose_apart(const Section& root, const std::string& camera) {
    const auto poses = root.map("camera_poses");
    if (!poses) return std::nullopt;
    for (const auto& [name, section] : poses->maps())
      if (name == camera || name.starts_with(camera + "_to_"))
        return pose_of(section, rotation_words, translation_words);
    return std::nullopt;
  }

  void read_sections(const Section& root, const Found& found, const Tool& tool) {
    const bool chain = std::ranges::any_of(found.cameras, [](const auto& c) { return c.second.has("T_cn_cnm1"); });
    calib::Rigid3d before;
    std::set<double> groups;
    for (std::size_t c = 0; c < found.cameras.size(); ++c) {
      const auto& [key, section] = found.cameras[c];
      if (section.has("ignore") && section.boolean("ignore")) {
        if (is_wanted(names_[c])) out_.notes.push_back(names_[c] + " is left out: the file says ignore = true");
        continue;
      }
      if (chain) require_chained(key, section, c);
      std::optional<calib::Rigid3d> pose;
      if (chain || is_wanted(names_[c])) pose = section_pose(section, chain, before);
      if (!pose && is_wanted(names_[c])) pose = pose_apart(root, key);
      if (chain) before = *pose;
      add(names_[c], section, {}, pose);
      if (!is_wanted(names_[c])) continue;
      calib::Camera& camera = out_.rig.cameras.back();
      camera.timing = timing_of(section, camera.image_size.height);
      if (camera.timing.latency_s) out_.notes.push_back(camera.name + ": its latency is relative to the IMU's clock");
      if (section.has("camera_group")) groups.insert(section.number("camera_group"));
      if (groups.size() > 1)
        section.fail("camera_group",
                     "differs from the other cameras': the poses of groups are unrelated; import each group alone, "
                     "with --cameras");
      note_turn(camera.name, section);
      for (const string_view redundant : {"cam_id", "port", "extra_dist", "name"}) section.ignore(redundant);
      note_left_out(camera.name, section);
    }
    note_world(chain, found, tool);
  }

  static void require_chained(const std::string& key, const Section& section, std::size_t place) {
    if (key != "cam" + std::to_string(place))
      section.fail("T_cn_cnm1", key + " is out of order: expected cam" + std::to_string(place));
    if (place == 0 && section.has("T_cn_cnm1")) section.fail("T_cn_cnm1", "is not allowed for the first camera");
    if (place > 0 && !section.has("T_cn_cnm1")) section.fail("T_cn_cnm1", "is missing");
  }

  void note_turn(const std::string& name, const Section& section) {
    if (!section.has("rotation_count")) return;
    if (const double turns = section.number("rotation_count"); turns != 0)
      out_.notes.push_back(fmt::format(
          "{}: Caliscope shows its images turned by {} degrees, but calibrates them as recorded: do not turn them",
          name, 90 * turns));
  }

  void note_world(bool chain, const Found& found, const Tool& tool) {
    const Section& first = found.cameras.front().second;
    const char* frame = chain                                              ? "cam0's frame (z forward, y down)"
                        : first.has("T_cam_imu") || first.has("T_imu_cam") ? "the IMU's frame"
                        : tool.format == ExchangeFormat::mccalib           ? "the reference camera's frame"
                                                                           : nullptr;
    if (frame != nullptr)
      out_.notes.push_back(fmt::format("the world is {}: set it with huetrack-calibrate world", frame));
  }

  // Of the root: free texts of [metadata] become made_by; the rest is named.
  void note_rest(const Section& root, const Found& found) {
    if (const auto metadata = root.map("metadata")) {
      for (const std::string& key : metadata->keys()) {
        if (!metadata->has(key)) continue;
        if (metadata->is_text(key))
          out_.rig.made_by.emplace_back(key, metadata->text(key));
        else
          out_.notes.push_back("not taken over: metadata." + key);
      }
    }
    for (const auto& [name, section] : found.cameras) root.ignore(section.path().substr(0, section.path().find('.')));
    if (const auto left = root.left_out(); !left.empty()) out_.notes.push_back("not taken over: " + joined(left));
  }

  void require_poses(const std::filesystem::path& file) {
    if (out_.rig.cameras.empty()) throw files::ConfigError(file, 0, "has no camera");
    if (unposed_.empty()) return;
    if (out_.rig.cameras.size() > 1)
      throw files::ConfigError(
          file, 0,
          fmt::format("no poses for {}: these cameras have no rotation and translation. Also give the file that has "
                      "them (extri.yml, extrinsics.yml), or import each lens into its own file (--cameras {} --rig "
                      "{}.yaml) and find the poses with extrinsics or wave",
                      joined(unposed_), unposed_.front(), unposed_.front()));
    out_.notes.push_back(unposed_.front() + " has no pose in this file: the world is the camera's own frame");
  }

  const ImportOptions& options_;
  Imported out_;
  std::vector<std::string> names_;  // of all cameras in the file
  std::vector<std::string> unposed_;
};

}  // namespace

std::string_view name(ExchangeFormat format) {
  return std::ranges::find(tools, format, &Tool::format)->name;
}

std::optional<ExchangeFormat> exchange_format_of(std::string_view word) {
  const auto tool = std::ranges::find(tools, word, &Tool::name);
  return tool == tools.end() ? std::nullopt : std::optional(tool->format);
}

std::vector<std::string> exchange_format_names(bool for_export) {
  std::vector<std::string> names;
  for (const Tool& tool : tools) {
    const bool is_exported = tool.format <= ExchangeFormat::caliscope;
    if ((is_exported || !for_export) && std::ranges::find(names, tool.name) == names.end())
      names.emplace_back(tool.name);
  }
  return names;
}

ExchangeFormat detect_format(const std::filesystem::path& file) {
  const auto documents = documents_of(file);
  const std::vector<Section> roots{Section(documents.front(), file)};
  return tool_of(arranged(roots), roots.front()).format;
}

Imported imported_from(std::span<const std::filesystem::path> files, const ImportOptions& options) {
  return Importer(options).read(files);
}

}  // namespace huetrack::exchange
