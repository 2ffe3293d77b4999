// OpenCV FileStorage in YAML, XML and JSON. The keys are not standardised; these are those of OpenCV's samples
// (camera_calibration, calibration, stereo_calib) and common variants.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <set>

#include "calib/exchange/exchanged_camera.h"
#include "calib/files/config_error.h"

namespace huetrack::exchange {
namespace {

using Words = std::vector<std::string>;

// at: a character of it
int line_at(std::string_view text, std::size_t at) {
  return static_cast<int>(1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

// Rejects tags on which OpenCV's XML parser dereferences a null pointer: unquoted attributes, unclosed tags.
// throws files::ConfigError
void check_tags(const std::filesystem::path& path, std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos || text[first] != '<') return;
  const auto fail = [&](std::size_t at, const char* what) { throw files::ConfigError(path, line_at(text, at), what); };
  for (std::size_t i = text.find('<'); i != std::string_view::npos; i = text.find('<', i)) {
    const std::size_t from = i;
    if (text.substr(i).starts_with("<!--")) {
      i = text.find("-->", i);
      if (i == std::string_view::npos) fail(from, "this comment has no end");
      continue;
    }
    char quote = '\0';
    for (++i; i < text.size() && (quote != '\0' || text[i] != '>'); ++i) {
      if (quote != '\0') {
        if (text[i] == quote) quote = '\0';
      } else if (text[i] == '"' || text[i] == '\'') {
        quote = text[i];
      } else if (text[i] == '<') {
        fail(from, "this tag has no end");
      } else if (text[i] == '=') {
        const std::size_t value = text.find_first_not_of(" \t\r\n", i + 1);
        if (value == std::string_view::npos || (text[value] != '"' && text[value] != '\''))
          fail(i, "an attribute's value has no quotes");
      }
    }
    if (i >= text.size()) fail(from, "this tag has no end");
  }
}

// Rejects binary data: OpenCV's YAML and JSON parsers hang if it is truncated, and no calibration has any.
// throws files::ConfigError
void check_no_binary(const std::filesystem::path& path, std::string_view text) {
  for (const std::string_view mark : {"!!binary", "2002:binary", "$base64$"}) {
    const std::size_t at = text.find(mark);
    if (at == std::string_view::npos) continue;
    throw files::ConfigError(path, line_at(text, at),
                             fmt::format("has binary data ({}), which no calibration has", mark));
  }
}

class Storage {
 public:
  explicit Storage(std::filesystem::path path) : path_(std::move(path)), text_(text_of(path_)) {
    check_tags(path_, text_);
    check_no_binary(path_, text_);
    try {
      storage_.open(text_, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    } catch (const cv::Exception& error) {
      // "<string>(12): what"
      const std::string what = error.err;
      const auto bracket = what.find("(");
      const int line = bracket == std::string::npos ? 0 : std::atoi(what.c_str() + bracket + 1);
      const auto colon = what.find("): ");
      throw files::ConfigError(
          path_, line, "OpenCV cannot read it: " + (colon == std::string::npos ? what : what.substr(colon + 3)));
    } catch (const std::exception& error) {  // for example std::length_error of its parser
      throw files::ConfigError(path_, 0, std::string("OpenCV cannot read it: ") + error.what());
    }
    if (!storage_.isOpened() || !storage_.root().isMap())
      throw files::ConfigError(path_, 0, "is not an OpenCV FileStorage");
  }

  const std::filesystem::path& path() const { return path_; }

  // The first of these keys that exists.
  std::optional<std::string> find(const Words& keys) const {
    for (const std::string& key : keys) {
      if (storage_[key].empty()) continue;
      asked_.insert(key);
      return key;
    }
    return std::nullopt;
  }
  [[noreturn]] void fail(std::string_view key, const std::string& message) const {
    throw files::ConfigError(path_, line_of(key), std::string(key) + ": " + message);
  }
  Fail failing() const {
    return [this](std::string_view key, const std::string& message) { fail(key, message); };
  }
  std::vector<double> numbers(const std::string& key) const {
    const cv::FileNode node = storage_[key];
    std::vector<double> out;
    if (node.isMap()) {
      cv::Mat m;
      try {
        // OpenCV allocates rows x cols before it reads the data.
        constexpr int most = 100;
        const int rows = node["rows"], columns = node["cols"];
        if (rows < 1 || rows > most || columns < 1 || columns > most) fail(key, "is not a matrix of a usual size");
        node >> m;
      } catch (const cv::Exception&) {
        fail(key, "is not a matrix");
      }
      if (m.empty() || m.channels() != 1) fail(key, "is not a matrix");
      m.convertTo(m, CV_64F);
      for (int i = 0; i < m.rows; ++i) {
        for (int j = 0; j < m.cols; ++j) out.push_back(m.at<double>(i, j));
      }
    } else {
      append(key, node, out);
    }
    return out;
  }
  double number(const std::string& key) const {
    const auto n = numbers(key);
    if (n.size() != 1) fail(key, "must be a number");
    return n.front();
  }
  std::optional<std::string> word(const Words& keys) const {
    const auto key = find(keys);
    if (!key) return std::nullopt;
    if (!storage_[*key].isString()) fail(*key, "must be a text");
    return std::string(storage_[*key]);
  }
  Words left_out() const {
    Words keys;
    const cv::FileNode root = storage_.root();
    for (const std::string& key : root.keys()) {
      if (!asked_.contains(key)) keys.push_back(key);
    }
    return keys;
  }

 private:
  void append(const std::string& key, const cv::FileNode& node, std::vector<double>& out) const {
    if (node.isSeq()) {
      for (const cv::FileNode& item : node) append(key, item, out);
    } else if (node.isInt() || node.isReal()) {
      out.push_back(static_cast<double>(node));
    } else {
      fail(key, "must be numbers");
    }
  }
  int line_of(std::string_view key) const {
    for (const std::string& pattern :
         {"\"" + std::string(key) + "\"", "<" + std::string(key), std::string(key) + ":"}) {
      const auto at = text_.find(pattern);
      if (at != std::string::npos) return line_at(text_, at);
    }
    return 0;
  }

  std::filesystem::path path_;
  std::string text_;
  cv::FileStorage storage_;
  mutable std::set<std::string> asked_;
};

const Words k_keys{"camera_matrix", "cameraMatrix", "Camera_Matrix", "CameraMatrix", "intrinsic_matrix", "K", "mtx"};
const Words d_keys{"distortion_coefficients",
                   "Distortion_Coefficients",
                   "distortionCoefficients",
                   "distCoeffs",
                   "dist_coeffs",
                   "dist_coeff",
                   "D",
                   "dist"};

// The first file that has one of the keys.
std::pair<const Storage*, std::string> in_any(const std::vector<const Storage*>& files, const Words& keys) {
  for (const Storage* file : files) {
    if (const auto key = file->find(keys)) return {file, *key};
  }
  return {nullptr, ""};
}

calib::ImageSize size_of(const std::vector<const Storage*>& files, const ImportOptions& options) {
  const auto whole = [](const Storage& file, const std::string& key, double value) {
    if (!(value >= 1) || value > 32768 || value != std::trunc(value))
      file.fail(key, "must be a whole number of pixels");
    return static_cast<int>(value);
  };
  const auto [w, w_key] = in_any(files, {"image_width", "image_Width", "imageWidth", "width"});
  const auto [h, h_key] = in_any(files, {"image_height", "image_Height", "imageHeight", "height"});
  if (w != nullptr && h != nullptr) return {whole(*w, w_key, w->number(w_key)), whole(*h, h_key, h->number(h_key))};
  const auto [s, s_key] = in_any(files, {"imageSize", "image_size", "img_size", "size"});
  if (s != nullptr) {
    const auto wh = s->numbers(s_key);
    if (wh.size() != 2) s->fail(s_key, "must be two numbers, width and height");
    return {whole(*s, s_key, wh[0]), whole(*s, s_key, wh[1])};
  }
  if (options.image_size) return *options.image_size;
  throw files::ConfigError(files.front()->path(), 0,
                           "has no image size (image_width, image_height): give --size WIDTHxHEIGHT");
}

calib::Camera read_lens(const std::vector<const Storage*>& files, const Words& k, const Words& d,
                        const ImportOptions& options) {
  calib::Camera camera;
  const auto [in_k, k_key] = in_any(files, k);
  if (in_k == nullptr)
    throw files::ConfigError(files.front()->path(), 0, "has no camera matrix (looked for " + joined(k) + ")");
  const auto [in_d, d_key] = in_any(files, d);
  if (in_d == nullptr)
    throw files::ConfigError(files.front()->path(), 0, "has no distortion coefficients (looked for " + joined(d) + ")");
  const auto [in_f, f_key] = in_any(files, {"fisheye_model", "fisheye"});
  const bool fisheye = in_f != nullptr && in_f->number(f_key) != 0;
  const Storage* where = in_d;
  const auto matrix = in_k->numbers(k_key);
  const auto coefficients = in_d->numbers(d_key);
  const Fail fail = [&, matrix_file = in_k, matrix_key = k_key](std::string_view key, const std::string& message) {
    (key == matrix_key ? matrix_file : where)->fail(key, message);
  };
  camera.model = opencv_lens(matrix, k_key, coefficients, d_key, fisheye, fail);
  camera.image_size = size_of(files, options);
  return camera;
}

// nullopt: absent.
std::optional<calib::Rigid3d> read_pose(const std::vector<const Storage*>& files, const Words& r_keys,
                                        const Words& t_keys) {
  const auto [in_r, r_key] = in_any(files, r_keys);
  const auto [in_t, t_key] = in_any(files, t_keys);
  if (in_r == nullptr || in_t == nullptr) return std::nullopt;
  const auto r = in_r->numbers(r_key), t = in_t->numbers(t_key);
  if (r.size() != 9 && r.size() != 3) in_r->fail(r_key, "must be a 3x3 matrix or a rotation vector");
  if (t.size() != 3) in_t->fail(t_key, "must be 3 numbers");
  return calib::Rigid3d{r.size() == 3 ? rotation_of_vector(r) : rotation_of(r, r_key, in_r->failing()),
                        {t[0], t[1], t[2]}};
}

const Words world_r{"cam_from_world_rotation"}, world_t{"cam_from_world_translation"};

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

}  // namespace

Imported import_opencv(std::span<const std::filesystem::path> paths, const ImportOptions& options) {
  std::vector<std::unique_ptr<Storage>> storages;
  std::vector<const Storage*> files;
  for (const auto& path : paths) {
    storages.push_back(std::make_unique<Storage>(path));
    files.push_back(storages.back().get());
  }
  Imported out;
  const Words k1{"M1", "K1", "cameraMatrix1", "camera_matrix_1", "camera_matrix1"},
      d1{"D1", "distCoeffs1", "dist_coeffs_1", "distortion_coefficients1"};
  const Words k2{"M2", "K2", "cameraMatrix2", "camera_matrix_2", "camera_matrix2"},
      d2{"D2", "distCoeffs2", "dist_coeffs_2", "distortion_coefficients2"};
  if (in_any(files, k1).first != nullptr) {
    calib::Camera left = read_lens(files, k1, d1, options), right = read_lens(files, k2, d2, options);
    const auto [in_l, l_key] = in_any(files, {"camera_name1"});
    const auto [in_r, r_key] = in_any(files, {"camera_name2"});
    left.name = in_l ? clean_name(*in_l->word({l_key})) : "left";
    right.name = in_r ? clean_name(*in_r->word({r_key})) : "right";
    const auto pose = read_pose(files, {"R"}, {"T"});
    if (!pose) {
      throw files::ConfigError(files.front()->path(), 0,
                               "has two cameras, but not their relative pose (R and T): also give the file with it "
                               "(extrinsics.yml)");
    }
    right.cam_from_world = *pose;  // stereoCalibrate: p_2 = R p_1 + T
    out.rig.cameras = {std::move(left), std::move(right)};
    out.notes.emplace_back(
        "the world is the first camera's frame (z forward, y down): set it with huetrack-calibrate world");
  } else {
    std::vector<std::string> unposed;
    for (const Storage* file : files) {
      calib::Camera camera = read_lens({file}, k_keys, d_keys, options);
      camera.name = clean_name(file->word({"camera_name"}).value_or(file->path().stem().string()));
      if (const auto pose = read_pose({file}, world_r, world_t))
        camera.cam_from_world = *pose;
      else
        unposed.push_back(camera.name);
      out.rig.cameras.push_back(std::move(camera));
    }
    if (!unposed.empty() && files.size() > 1) {
      throw files::ConfigError(files.front()->path(), 0,
                               "no poses for " + joined(unposed) +
                                   ": import each camera into its own file, then find the "
                                   "poses with extrinsics or wave");
    }
    if (!unposed.empty()) out.notes.emplace_back("the file holds no pose: the world is the camera's own frame");
  }
  for (const Storage* file : files) {
    if (const Words left = file->left_out(); !left.empty())
      out.notes.push_back(file->path().filename().string() + ": not taken over: " + joined(left));
  }
  return out;
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

}  // namespace huetrack::exchange
