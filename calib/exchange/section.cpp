#include "calib/exchange/section.h"

#include <tinyxml2.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>

#include "calib/exchange/ost_ini.h"
#include "calib/files/config_error.h"
#include "calib/files/number_text.h"

namespace huetrack::exchange {
namespace {

using yaml::Value;
using Kind = yaml::Value::Kind;

Value value_of(const toml::node& node) {
  Value value{.line = static_cast<int>(node.source().begin.line)};
  if (const toml::table* table = node.as_table()) {
    value.kind = Kind::map;
    for (const auto& [key, item] : *table) {
      value.keys.emplace_back(key.str());
      value.items.push_back(value_of(item));
    }
    // toml++ sorts them.
    std::vector<std::size_t> order(value.keys.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::ranges::stable_sort(order, {}, [&](std::size_t k) { return value.items[k].line; });
    Value sorted{.kind = Kind::map, .line = value.line};
    for (const std::size_t k : order) {
      sorted.keys.push_back(std::move(value.keys[k]));
      sorted.items.push_back(std::move(value.items[k]));
    }
    return sorted;
  }
  if (const toml::array* list = node.as_array()) {
    value.kind = Kind::list;
    for (const toml::node& item : *list) value.items.push_back(value_of(item));
    return value;
  }
  value.kind = Kind::text;
  if (const auto* text = node.as_string()) value.text = text->get();
  if (const auto* number = node.as_floating_point()) value.text = files::shortest_text(number->get());
  if (const auto* number = node.as_integer()) value.text = std::to_string(number->get());
  if (const auto* flag = node.as_boolean()) value.text = flag->get() ? "true" : "false";
  if (value.text == "null") value.kind = Kind::null;  // rtoml's absent value
  return value;
}

// Words of an element's text; those in quotes may have blanks.
std::vector<std::string> words_of(std::string_view text) {
  std::vector<std::string> words;
  for (std::size_t i = text.find_first_not_of(" \t\r\n"); i < text.size(); i = text.find_first_not_of(" \t\r\n", i)) {
    const bool quoted = text[i] == '"';
    const std::size_t end = std::min(text.size(), quoted ? text.find('"', i + 1) : text.find_first_of(" \t\r\n", i));
    words.emplace_back(text.substr(i + (quoted ? 1 : 0), end - i - (quoted ? 1 : 0)));
    i = end + (quoted ? 1 : 0);
    if (i >= text.size()) break;
  }
  return words;
}

// As OpenCV's FileStorage writes: elements are keys, list items are elements "_", or words of a text.
Value value_of(const tinyxml2::XMLElement& element) {
  Value value{.line = element.GetLineNum()};
  for (const auto* child = element.FirstChildElement(); child != nullptr; child = child->NextSiblingElement()) {
    value.keys.emplace_back(child->Name());
    value.items.push_back(value_of(*child));
  }
  if (!value.items.empty()) {
    value.kind =
        std::ranges::all_of(value.keys, [](const std::string& key) { return key == "_"; }) ? Kind::list : Kind::map;
    if (value.kind == Kind::list) value.keys.clear();
    return value;
  }
  const char* text = element.GetText();
  std::vector<std::string> words = words_of(text == nullptr ? "" : text);
  if (words.size() == 1) return {.kind = Kind::text, .text = std::move(words[0]), .line = value.line};
  value.kind = words.empty() ? Kind::null : Kind::list;
  for (std::string& word : words)
    value.items.push_back({.kind = Kind::text, .text = std::move(word), .line = value.line});
  return value;
}

Value xml_of(const std::string& text, const std::filesystem::path& file) {
  tinyxml2::XMLDocument document;
  document.Parse(text.data(), text.size());
  const tinyxml2::XMLElement* root = document.RootElement();
  if (document.Error() || root == nullptr)
    throw files::ConfigError(file, std::max(0, document.ErrorLineNum()),
                             std::string("is not valid XML: ") + document.ErrorName());
  if (std::string_view(root->Name()) == "opencv_storage") {
    Value value = value_of(*root);
    value.kind = Kind::map;  // also if it is empty
    return value;
  }
  return {.kind = Kind::map, .keys = {root->Name()}, .items = {value_of(*root)}, .line = root->GetLineNum()};
}

Value toml_of(const std::string& text, const std::filesystem::path& file) {
  try {
    return value_of(static_cast<const toml::node&>(toml::parse(text, file.string())));
  } catch (const toml::parse_error& error) {
    throw files::ConfigError(file, static_cast<int>(error.source().begin.line), std::string(error.description()));
  }
}

// nullopt: not numbers.
bool append_numbers(const Value& value, std::vector<double>& out) {
  if (value.kind == Kind::list)
    return std::ranges::all_of(value.items, [&](const Value& item) { return append_numbers(item, out); });
  std::string_view text = value.text;
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto number = files::number_of<double>(text);
  if (value.kind != Kind::text || !number || !std::isfinite(*number)) return false;
  out.push_back(*number);
  return true;
}

}  // namespace

std::vector<Value> documents_of(const std::filesystem::path& file) {
  const bool is_toml = file.extension() == ".toml";
  const std::string text = text_of(file, is_toml ? files::Keys::dotted : files::Keys::plain);
  if (text.find('\0') != std::string::npos)
    throw files::ConfigError(file, 0,
                             "is a binary file (of MATLAB, NumPy, pickle or the like): write its camera matrix, "
                             "distortion and image size as YAML or JSON");
  for (const std::string_view list : {"# Camera list with one line of data per camera", "# Image list with two lines"})
    if (text.starts_with(list))
      throw files::ConfigError(file, 0,
                               "is a table of COLMAP (cameras.txt, images.txt), which is not read: write its cameras "
                               "as OpenCV's YAML or JSON: K1, K2, ... with fx, fy, cx - 0.5, cy - 0.5 (COLMAP counts "
                               "pixels from the corner of the first one), D1, ... with k1, k2, p1, p2, image_size, and "
                               "R1, T1, ... of images.txt (quaternion w, x, y, z; the lengths have no unit)");
  const auto first = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  if (first != std::string::npos && text.compare(first, 19, "Calibration results") == 0)
    throw files::ConfigError(file, 0,
                             "is Kalibr's report for people (results-cam.txt), without the image size: give the file "
                             "camchain.yaml that Kalibr wrote beside it");
  std::vector<Value> documents;
  if (auto ini = ost_ini_of(text, file))
    documents.push_back(std::move(*ini));
  else if (is_toml)
    documents.push_back(toml_of(text, file));
  else if (first != std::string::npos && text[first] == '<')
    documents.push_back(xml_of(text, file));
  else
    documents = yaml::values_of(text, file);
  if (documents.empty() || documents.front().kind != Kind::map) {
    throw files::ConfigError(
        file, 0,
        "has no keys and values, in YAML, JSON, TOML, XML or ROS' INI: it is no calibration file that can be read");
  }
  return documents;
}

Section::Section(const Value& map, std::filesystem::path file, std::string path) {
  parts_.push_back({&map, std::move(file), std::move(path), std::make_shared<std::set<std::string, std::less<>>>()});
}

Section Section::joined(std::span<const Section> parts) {
  Section all;
  for (const Section& part : parts) all.parts_.insert(all.parts_.end(), part.parts_.begin(), part.parts_.end());
  return all;
}

const Value* Section::find(std::string_view key) const {
  ignore(key);
  for (const Part& part : parts_) {
    if (const Value* value = part.map->find(key); value != nullptr && value->kind != Kind::null) return value;
  }
  return nullptr;
}

const Value& Section::value(std::string_view key) const {
  const Value* value = find(key);
  if (value == nullptr) fail(key, "is missing");
  return *value;
}

std::optional<std::string> Section::first_of(Words words, std::string_view suffix) const {
  for (const std::string_view word : words) {
    for (const std::string_view between : {"", "_"}) {
      std::string key(word);
      if (!suffix.empty()) key.append(between).append(suffix);
      const bool is_there = std::ranges::any_of(parts_, [&](const Part& part) {
        const Value* value = part.map->find(key);
        return value != nullptr && value->kind != Kind::null;
      });
      if (is_there) return key;
    }
  }
  return std::nullopt;
}

std::vector<double> Section::numbers(std::string_view key) const {
  const Value& given = value(key);
  const Value* data = given.kind == Kind::map ? given.find("data") : &given;
  std::vector<double> out;
  if (data == nullptr || !append_numbers(*data, out)) fail(key, "must be numbers");
  if (given.kind != Kind::map) return out;
  std::vector<double> size;
  for (const char* of : {"rows", "cols"}) {
    if (const Value* n = given.find(of); n == nullptr || !append_numbers(*n, size)) fail(key, "has no rows and cols");
  }
  if (size.size() != 2 || size[0] * size[1] != static_cast<double>(out.size()))
    fail(key, "has " + std::to_string(out.size()) + " numbers, which is not rows times cols");
  return out;
}

double Section::number(std::string_view key) const {
  const auto all = numbers(key);
  if (all.size() != 1) fail(key, "must be a number");
  return all.front();
}

bool Section::is_text(std::string_view key) const {
  const Value* given = find(key);
  return given != nullptr && given->kind == Kind::text && !given->text.empty();
}

std::string Section::text(std::string_view key) const {
  const Value& given = value(key);
  if (given.kind != Kind::text || given.text.empty()) fail(key, "must be a text");
  return given.text;
}

std::vector<std::string> Section::texts(std::string_view key) const {
  const Value& given = value(key);
  std::vector<std::string> out;
  for (const Value& item : given.items) out.push_back(item.text);
  return out;
}

bool Section::boolean(std::string_view key) const {
  const std::string word = text(key);
  if (word == "true" || word == "True" || word == "1") return true;
  if (word != "false" && word != "False" && word != "0") fail(key, "must be true or false");
  return false;
}

std::optional<Section> Section::map(std::string_view key) const {
  for (const Part& part : parts_) {
    const Value* value = part.map->find(key);
    if (value == nullptr || value->kind != Kind::map) continue;
    part.asked->emplace(key);
    return Section(*value, part.file, part.path.empty() ? std::string(key) : part.path + "." + std::string(key));
  }
  return std::nullopt;
}

std::vector<std::pair<std::string, Section>> Section::maps() const {
  std::vector<std::pair<std::string, Section>> out;
  for (const Part& part : parts_) {
    const auto add = [&](const Value& value, const std::string& name, const std::string& path) {
      if (value.kind == Kind::map)
        out.emplace_back(name, Section(value, part.file, part.path.empty() ? path : part.path + "." + path));
    };
    for (std::size_t k = 0; k < part.map->items.size(); ++k) {
      const Value& item = part.map->items[k];
      const std::string& key = part.map->keys[k];
      add(item, key, key);
      if (item.kind != Kind::list) continue;
      for (std::size_t i = 0; i < item.items.size(); ++i)
        add(item.items[i], std::to_string(i), key + "." + std::to_string(i));
    }
  }
  return out;
}

std::vector<std::string> Section::keys() const {
  std::vector<std::string> out;
  for (const Part& part : parts_) out.insert(out.end(), part.map->keys.begin(), part.map->keys.end());
  return out;
}

void Section::ignore(std::string_view key) const {
  for (const Part& part : parts_) part.asked->emplace(key);
}

std::vector<std::string> Section::left_out() const {
  std::vector<std::string> out;
  for (const Part& part : parts_)
    std::ranges::remove_copy_if(part.map->keys, std::back_inserter(out),
                                [&](const std::string& key) { return part.asked->contains(key); });
  return out;
}

void Section::fail(std::string_view key, const std::string& message) const {
  for (const Part& part : parts_) {
    const Value* value = part.map->find(key);
    if (value == nullptr && &part != &parts_.back()) continue;
    const Part& where = value != nullptr ? part : parts_.front();
    throw files::ConfigError(where.file, value != nullptr ? value->line : where.map->line,
                             (where.path.empty() ? "" : where.path + ".") + std::string(key) + ": " + message);
  }
  throw files::ConfigError({}, 0, message);
}

}  // namespace huetrack::exchange
