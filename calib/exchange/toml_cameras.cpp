// Anipose's and Caliscope's TOML. Both store cam_from_world as OpenCV does: a rotation vector (Caliscope's older files:
// a matrix) and a translation, p_cam = R p_world + t.
#include <fmt/format.h>
#include <toml++/toml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "calib/exchange/exchanged_camera.h"
#include "calib/files/config_error.h"
#include "calib/files/text_file.h"

namespace huetrack::exchange {
namespace {

toml::table parsed(const std::filesystem::path& file) {
  try {
    return toml::parse(text_of(file, files::Keys::dotted), file.string());
  } catch (const toml::parse_error& error) {
    throw files::ConfigError(file, static_cast<int>(error.source().begin.line), std::string(error.description()));
  }
}

// Strict reader of one table: left_out() lists the keys that were not read.
class TomlReader {
 public:
  TomlReader(const toml::table& table, std::string path, const std::filesystem::path& file)
      : table_(table), path_(std::move(path)), file_(file) {}

  // rtoml writes "null" for an absent value.
  bool has(std::string_view key) const {
    asked_.emplace(key);
    const toml::node* node = table_.get(key);
    return node != nullptr && !(node->is_string() && node->as_string()->get() == "null");
  }
  [[noreturn]] void fail(std::string_view key, const std::string& message) const {
    const toml::node* node = table_.get(key);
    const auto line = node != nullptr ? node->source().begin.line : table_.source().begin.line;
    throw files::ConfigError(file_, static_cast<int>(line), path_ + "." + std::string(key) + ": " + message);
  }
  Fail failing() const {
    return [this](std::string_view key, const std::string& message) { fail(key, message); };
  }
  const toml::node& node(std::string_view key) const {
    if (!has(key)) fail(key, "is missing");
    return *table_.get(key);
  }
  // Nested lists are flattened.
  std::vector<double> numbers(std::string_view key) const {
    std::vector<double> out;
    append(key, node(key), out);
    return out;
  }
  std::string string(std::string_view key) const {
    const toml::node& n = node(key);
    if (const auto text = n.value<std::string>(); n.is_string() && text && !text->empty()) return *text;
    fail(key, "must be a text");
  }
  bool boolean(std::string_view key, bool otherwise) const {
    if (!has(key)) return otherwise;
    const toml::node& n = node(key);
    if (!n.is_boolean()) fail(key, "must be true or false");
    return n.as_boolean()->get();
  }
  calib::ImageSize size(std::string_view key, const std::optional<calib::ImageSize>& otherwise) const {
    if (!has(key)) {
      if (otherwise) return *otherwise;
      fail(key, "is missing: give --size WIDTHxHEIGHT");
    }
    const auto s = numbers(key);
    if (s.size() != 2 || !(s[0] >= 1) || !(s[1] >= 1) || s[0] != std::trunc(s[0]) || s[1] != std::trunc(s[1]) ||
        s[0] > 32768 || s[1] > 32768) {
      fail(key, "must be two whole numbers, [width, height]");
    }
    return {static_cast<int>(s[0]), static_cast<int>(s[1])};
  }
  std::vector<std::string> left_out() const {
    std::vector<std::string> keys;
    for (const auto& [key, value] : table_) {
      if (!asked_.contains(std::string(key.str()))) keys.emplace_back(key.str());
    }
    return keys;
  }
  int line() const { return static_cast<int>(table_.source().begin.line); }
  const std::string& path() const { return path_; }

 private:
  void append(std::string_view key, const toml::node& n, std::vector<double>& out) const {
    if (const toml::array* list = n.as_array()) {
      for (const toml::node& item : *list) append(key, item, out);
    } else if (const auto value = n.value<double>(); n.is_number() && value && std::isfinite(*value)) {
      out.push_back(*value);
    } else {
      fail(key, "must be numbers");
    }
  }

  const toml::table& table_;
  std::string path_;
  const std::filesystem::path& file_;
  mutable std::set<std::string, std::less<>> asked_;
};

// Reads the lens and, if present, the pose; returns whether it was.
bool read_camera(const TomlReader& reader, const ImportOptions& options, calib::Camera& camera) {
  const Fail fail = reader.failing();
  camera.image_size = reader.size("size", options.image_size);
  const bool fisheye = reader.boolean("fisheye", false);
  const auto k = reader.numbers("matrix");
  const auto d = reader.numbers("distortions");
  camera.model = opencv_lens(k, "matrix", d, "distortions", fisheye, fail);
  if (reader.has("rotation") != reader.has("translation"))
    fail("rotation", "rotation and translation must both be given");
  if (!reader.has("rotation")) return false;
  const auto r = reader.numbers("rotation"), t = reader.numbers("translation");
  if (r.size() != 3 && r.size() != 9) fail("rotation", "must be a rotation vector (3 numbers) or a 3x3 matrix");
  if (t.size() != 3) fail("translation", "must be 3 numbers");
  camera.cam_from_world.rotation = r.size() == 3 ? rotation_of_vector(r) : rotation_of(r, "rotation", fail);
  camera.cam_from_world.translation = {t[0], t[1], t[2]};
  return true;
}

void add(const TomlReader& reader, const std::filesystem::path& file, bool posed, calib::Camera camera,
         calib::CameraRig& rig, std::vector<std::string>& unposed) {
  for (const calib::Camera& other : rig.cameras) {
    if (other.name == camera.name)
      throw files::ConfigError(file, reader.line(), reader.path() + ": a second camera " + camera.name);
  }
  if (!posed) unposed.push_back(camera.name);
  rig.cameras.push_back(std::move(camera));
}

void require_poses(const std::filesystem::path& file, const calib::CameraRig& rig,
                   const std::vector<std::string>& unposed, std::vector<std::string>& notes) {
  if (rig.cameras.empty()) throw files::ConfigError(file, 0, "has no camera");
  if (unposed.empty()) return;
  if (rig.cameras.size() > 1)
    throw files::ConfigError(
        file, 0,
        "these cameras have no rotation and translation: " + joined(unposed) + ": calibrate them, or remove them");
  notes.push_back(rig.cameras.front().name + " has no pose: the world is the camera's own frame");
}

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

}  // namespace

Imported import_aniposelib(const std::filesystem::path& file, const ImportOptions& options) {
  const toml::table root = parsed(file);
  Imported out;
  std::vector<std::string> unposed;
  for (const auto& [key, value] : root) {
    const std::string name(key.str());
    const toml::table* table = value.as_table();
    if (name == "metadata" && table != nullptr) {  // free texts, like made_by
      for (const auto& [what, said] : *table) {
        std::string text;
        if (const auto s = said.value<std::string>())
          text = *s;
        else if (const auto b = said.as_boolean())
          text = b->get() ? "true" : "false";
        else if (const auto i = said.as_integer())
          text = std::to_string(i->get());
        else if (const auto d = said.as_floating_point(); d != nullptr && std::isfinite(d->get()))
          text = exact(d->get());
        if (text.empty())
          out.notes.push_back("not taken over: metadata." + std::string(what.str()));
        else
          out.rig.made_by.emplace_back(std::string(what.str()), text);
      }
      continue;
    }
    if (table == nullptr || !name.starts_with("cam"))
      throw files::ConfigError(file, static_cast<int>(value.source().begin.line),
                               name + " is not a camera: expected [cam_0], [cam_1], ... and [metadata]");
    const TomlReader reader(*table, name, file);
    calib::Camera camera;
    camera.name = reader.has("name") ? reader.string("name") : name;
    const bool posed = read_camera(reader, options, camera);
    if (reader.has("extra_dist")) reader.boolean("extra_dist", false);  // redundant with the number of coefficients
    if (const auto left = reader.left_out(); !left.empty())
      out.notes.push_back(camera.name + ": not taken over: " + joined(left));
    add(reader, file, posed, std::move(camera), out.rig, unposed);
  }
  require_poses(file, out.rig, unposed, out.notes);
  return out;
}

Imported import_caliscope(const std::filesystem::path& file, const ImportOptions& options) {
  const toml::table root = parsed(file);
  Imported out;
  std::vector<std::pair<std::string, const toml::table*>> tables;
  std::vector<std::string> left_out;
  for (const auto& [key, value] : root) {
    const std::string name(key.str());
    const toml::table* table = value.as_table();
    if (name == "cameras" && table != nullptr) {
      for (const auto& [number, camera] : *table) {
        if (camera.as_table() == nullptr)
          throw files::ConfigError(file, static_cast<int>(camera.source().begin.line),
                                   "cameras." + std::string(number.str()) + " is not a table");
        tables.emplace_back("cam_" + std::string(number.str()), camera.as_table());
      }
    } else if (name.starts_with("cam_") && table != nullptr) {
      tables.emplace_back(name, table);
    } else {
      left_out.push_back(name);
    }
  }
  if (!left_out.empty()) out.notes.push_back("not taken over: " + joined(left_out));
  // By number; the file's order is alphabetical, 10 before 2.
  std::ranges::stable_sort(tables, [](const auto& a, const auto& b) {
    return std::pair(a.first.size(), a.first) < std::pair(b.first.size(), b.first);
  });
  std::vector<std::string> unposed;
  for (const auto& [name, table] : tables) {
    const TomlReader reader(*table, name, file);
    if (reader.boolean("ignore", false)) {
      out.notes.push_back(name + " is left out: the file says ignore = true");
      continue;
    }
    calib::Camera camera;
    camera.name = name;
    const bool posed = read_camera(reader, options, camera);
    if (reader.has("rotation_count")) {
      const auto turns = reader.numbers("rotation_count");
      if (turns.size() != 1) reader.fail("rotation_count", "must be a number");
      if (turns[0] != 0)
        out.notes.push_back(name + ": Caliscope shows its images turned by " + exact(90 * turns[0]) +
                            " degrees, but calibrates them as recorded: do not turn them");
    }
    for (const std::string_view key : {"cam_id", "port"}) {
      if (reader.has(key)) reader.numbers(key);
    }
    if (const auto left = reader.left_out(); !left.empty())
      out.notes.push_back(name + ": not taken over: " + joined(left));
    add(reader, file, posed, std::move(camera), out.rig, unposed);
  }
  require_poses(file, out.rig, unposed, out.notes);
  return out;
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

}  // namespace huetrack::exchange
