#include "config/config_editor.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "capture/file_descriptor.h"

namespace huetrack::config {
namespace {

namespace fs = std::filesystem;

// Where an entry of a mapping lies in the text; positions are offsets.
struct Entry {
  std::string key;
  std::size_t begin = 0;        // of its line, or of the key in flow style
  std::size_t end = 0;          // after its last line, or after the value
  std::size_t value_begin = 0;  // equal: there is none on the key's line
  std::size_t value_end = 0;
  std::size_t indent = 0;  // block style
};

bool starts_comment(const std::string& text, std::size_t at) {
  return text[at] == '#' && (at == 0 || text[at - 1] == ' ' || text[at - 1] == '\t' || text[at - 1] == '\n');
}

std::size_t line_end(const std::string& text, std::size_t at) {
  return std::min(text.find('\n', at), text.size());
}

std::size_t after_quotes(const std::string& text, std::size_t at) {
  const char quote = text[at];
  for (std::size_t i = at + 1; i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;
    } else if (text[i] == quote) {
      if (quote == '\'' && i + 1 < text.size() && text[i + 1] == '\'') {
        ++i;
        continue;
      }
      return i + 1;
    }
  }
  throw std::runtime_error("a quote is not closed");
}

// After the bracket that closes the one at `at`.
std::size_t after_brackets(const std::string& text, std::size_t at) {
  int depth = 0;
  for (std::size_t i = at; i < text.size();) {
    if (text[i] == '"' || text[i] == '\'') {
      i = after_quotes(text, i);
      continue;
    }
    if (starts_comment(text, i)) {
      i = line_end(text, i);
      continue;
    }
    if (text[i] == '{' || text[i] == '[') ++depth;
    if ((text[i] == '}' || text[i] == ']') && --depth == 0) return i + 1;
    ++i;
  }
  throw std::runtime_error("a bracket is not closed");
}

std::string unquoted(const std::string& key) {
  if (key.size() >= 2 && (key.front() == '"' || key.front() == '\'') && key.back() == key.front())
    return key.substr(1, key.size() - 2);
  return key;
}

// The entries of a block mapping in [begin, end) of the text, and their common indentation.
std::vector<Entry> block_entries(const std::string& text, std::size_t begin, std::size_t end) {
  std::vector<Entry> entries;
  std::optional<std::size_t> indent;
  for (std::size_t at = begin; at < end;) {
    const std::size_t stop = line_end(text, at);
    const std::size_t next = std::min(stop + 1, text.size());
    const std::size_t first = text.find_first_not_of(' ', at);
    const bool is_empty = first >= stop || text[first] == '#' || text[first] == '\r';
    if (is_empty || text.compare(at, 3, "---") == 0) {
      at = next;
      continue;
    }
    if (!indent) indent = first - at;
    if (first - at > *indent) {  // inside the entry before
      if (!entries.empty()) entries.back().end = next;
      at = next;
      continue;
    }
    if (first - at < *indent || text[first] == '-' || text[first] == '&' || text[first] == '*' || text[first] == '?')
      throw std::runtime_error("it has a form that is not known here");
    Entry entry{.key = {}, .begin = at, .end = next, .indent = first - at};
    std::size_t colon = first;
    if (text[first] == '"' || text[first] == '\'') {
      colon = text.find(':', after_quotes(text, first));
    } else {
      while (colon < stop &&
             !(text[colon] == ':' && (colon + 1 >= stop || text[colon + 1] == ' ' || text[colon + 1] == '\r')))
        ++colon;
    }
    if (colon >= stop) throw std::runtime_error("there is a line that is no \"key: value\"");
    entry.key = unquoted(text.substr(first, text.find_last_not_of(' ', colon - 1) + 1 - first));
    std::size_t value = std::min(text.find_first_not_of(' ', colon + 1), stop);
    if (value < stop && (text[value] == '#' || text[value] == '\r')) value = stop;
    entry.value_begin = entry.value_end = value == stop ? colon + 1 : value;
    if (value < stop) {
      if (text[value] == '{' || text[value] == '[') {
        entry.value_end = after_brackets(text, value);
        entry.end = std::min(line_end(text, entry.value_end) + 1, text.size());
      } else if (text[value] == '"' || text[value] == '\'') {
        entry.value_end = after_quotes(text, value);
      } else {
        std::size_t last = value;
        while (last < stop && !starts_comment(text, last)) ++last;
        entry.value_end = text.find_last_not_of(" \r", last - 1) + 1;
      }
    }
    entries.push_back(entry);
    at = entry.end;
  }
  return entries;
}

// The entries of the flow mapping whose '{' is at `open`.
std::vector<Entry> flow_entries(const std::string& text, std::size_t open) {
  const std::size_t close = after_brackets(text, open) - 1;
  std::vector<Entry> entries;
  const auto skip = [&](std::size_t at, const char* what) {
    while (at < close) {
      if (starts_comment(text, at)) {
        at = line_end(text, at);
      } else if (std::strchr(what, text[at]) != nullptr) {
        ++at;
      } else {
        break;
      }
    }
    return at;
  };
  for (std::size_t at = skip(open + 1, " ,\n\r\t"); at < close; at = skip(at, " ,\n\r\t")) {
    Entry entry{.key = {}, .begin = at};
    std::size_t colon = text[at] == '"' || text[at] == '\'' ? after_quotes(text, at) : at;
    colon = text.find(':', colon);
    if (colon >= close) throw std::runtime_error("a flow mapping has an entry without a value");
    entry.key = unquoted(text.substr(at, text.find_last_not_of(' ', colon - 1) + 1 - at));
    const std::size_t value = skip(colon + 1, " \n\r\t");
    std::size_t end = value;
    if (value < close && (text[value] == '{' || text[value] == '[')) {
      end = after_brackets(text, value);
    } else if (value < close && (text[value] == '"' || text[value] == '\'')) {
      end = after_quotes(text, value);
    } else {
      while (end < close && text[end] != ',' && text[end] != '\n') ++end;
      end = text.find_last_not_of(' ', end - 1) + 1;
    }
    entry.value_begin = value;
    entry.value_end = entry.end = end;
    entries.push_back(entry);
    at = end;
  }
  return entries;
}

bool is_plain(const std::string& key) {
  return !key.empty() && std::isalpha(static_cast<unsigned char>(key.front())) != 0 &&
         std::ranges::all_of(key, [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; });
}

std::string key_text(const std::string& key) {
  return is_plain(key) ? key : "\"" + key + "\"";
}

std::string flow_text(const YamlValue& value) {
  if (!value.is_map) return value.text;
  std::string text = "{";
  for (const auto& [key, inner] : value.entries)
    text += (text.size() > 1 ? ", " : "") + key_text(key) + ": " + flow_text(inner);
  return text + "}";
}

const Entry* find(const std::vector<Entry>& entries, const std::string& key) {
  const auto it = std::ranges::find(entries, key, &Entry::key);
  return it == entries.end() ? nullptr : &*it;
}

void set_in_block(std::string& text, std::size_t begin, std::size_t end, const YamlValue& map, std::size_t indent);

void set_in_flow(std::string& text, std::size_t open, const YamlValue& map) {
  if (map.removes_others) {
    const std::size_t close = after_brackets(text, open);
    text.replace(open, close - open, flow_text(map));
    return;
  }
  for (const auto& [key, value] : map.entries) {
    const auto entries = flow_entries(text, open);
    const Entry* entry = find(entries, key);
    if (entry != nullptr && value.is_map && text[entry->value_begin] == '{') {
      set_in_flow(text, entry->value_begin, value);
    } else if (entry != nullptr) {
      text.replace(entry->value_begin, entry->value_end - entry->value_begin, flow_text(value));
    } else if (entries.empty()) {
      text.insert(open + 1, key_text(key) + ": " + flow_text(value));
    } else {
      text.insert(entries.back().end, ", " + key_text(key) + ": " + flow_text(value));
    }
  }
}

void set_entry(std::string& text, const Entry& entry, const YamlValue& value) {
  const bool has_inline = entry.value_end > entry.value_begin;
  const std::size_t block_begin = std::min(line_end(text, entry.value_begin) + 1, text.size());
  const bool has_block = !has_inline && entry.end > block_begin && !block_entries(text, block_begin, entry.end).empty();
  if (value.is_map && has_inline && text[entry.value_begin] == '{') {
    set_in_flow(text, entry.value_begin, value);
  } else if (value.is_map && has_block) {
    set_in_block(text, block_begin, entry.end, value, entry.indent + 2);
  } else if (has_block) {
    throw std::runtime_error(entry.key + " has lines below it where a single value was expected");
  } else if (has_inline) {
    if (text[entry.value_begin] == '&' || text[entry.value_begin] == '*' || text[entry.value_begin] == '|' ||
        text[entry.value_begin] == '>')
      throw std::runtime_error(entry.key + " has a form that is not known here");
    text.replace(entry.value_begin, entry.value_end - entry.value_begin, flow_text(value));
  } else {
    text.insert(entry.value_begin, " " + flow_text(value));
  }
}

void set_in_block(std::string& text, std::size_t begin, std::size_t end, const YamlValue& map, std::size_t indent) {
  // From the last entry to the first, so that positions before it stay.
  std::vector<Entry> entries = block_entries(text, begin, end);
  if (!entries.empty()) indent = entries.front().indent;
  std::string added;
  for (const auto& [key, value] : map.entries) {
    if (find(entries, key) == nullptr)
      added += std::string(indent, ' ') + key_text(key) + ": " + flow_text(value) + "\n";
  }
  if (!added.empty()) {
    std::size_t at = entries.empty() ? end : entries.back().end;
    if (at > 0 && at == text.size() && text[at - 1] != '\n') added.insert(0, "\n");
    text.insert(at, added);
  }
  for (auto entry = entries.rbegin(); entry != entries.rend(); ++entry) {
    const auto wanted = std::ranges::find(map.entries, entry->key, &std::pair<std::string, YamlValue>::first);
    if (wanted != map.entries.end()) {
      set_entry(text, *entry, wanted->second);
    } else if (map.removes_others) {
      text.erase(entry->begin, entry->end - entry->begin);
    }
  }
}

std::string shortest(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

std::string interval(double min, double max) {
  return "[" + shortest(min) + ", " + shortest(max) + "]";
}

YamlValue yaml_of(const object_tracking::HsiRange& range) {
  return YamlValue::map({{"hue_deg", YamlValue::of(interval(range.hue_min_deg, range.hue_max_deg))},
                         {"saturation", YamlValue::of(interval(range.saturation_min, range.saturation_max))},
                         {"intensity", YamlValue::of(interval(range.intensity_min, range.intensity_max))}});
}

YamlValue yaml_of(const object_tracking::TargetOptions& target) {
  YamlValue cameras = YamlValue::map({}, true);
  for (const auto& [camera, range] : target.camera_colors) cameras.entries.emplace_back(camera, yaml_of(range));
  YamlValue entry = YamlValue::map({{"color", yaml_of(target.color)}});
  entry.entries.emplace_back("camera_colors", std::move(cameras));
  return YamlValue::map({{target.name, std::move(entry)}});
}

YamlValue yaml_of(const object_tracking::IgnoredRegions& ignored) {
  YamlValue cameras = YamlValue::map({}, true);
  for (const auto& [camera, boxes] : ignored) {
    if (boxes.empty()) continue;
    std::string list;
    for (const object_tracking::PixelBox& b : boxes) {
      list += list.empty() ? "[" : ", ";
      list += std::to_string(b.u_min) + ", " + std::to_string(b.v_min) + ", " + std::to_string(b.u_max) + ", " +
              std::to_string(b.v_max);
    }
    cameras.entries.emplace_back(camera, YamlValue::of(list + "]"));
  }
  return cameras;
}

std::runtime_error cannot_write(const fs::path& file, int error) {
  return std::runtime_error("cannot write " + file.string() + ": " + std::strerror(error));
}

// Beside the real file (behind links), with its rights.
void replace_file(const fs::path& file, const fs::path& fresh) {
  if (::rename(fresh.c_str(), file.c_str()) != 0) {
    const int error = errno;
    fs::remove(fresh);
    throw cannot_write(file, error);
  }
}

fs::path write_beside(const fs::path& file, const std::string& text) {
  const fs::path fresh = file.parent_path() / ("." + file.stem().string() + "-" + std::to_string(::getpid()) + ".yaml");
  struct stat old {};
  if (::stat(file.c_str(), &old) != 0) throw cannot_write(file, errno);
  const capture::FileDescriptor to(
      ::open(fresh.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, old.st_mode & 07777));
  if (to.get() < 0) throw cannot_write(file, errno);
  std::size_t written = 0;
  while (written < text.size()) {
    const auto n = ::write(to.get(), text.data() + written, text.size() - written);
    if (n <= 0) {
      const int error = errno;
      fs::remove(fresh);
      throw cannot_write(file, error);
    }
    written += static_cast<std::size_t>(n);
  }
  ::fchmod(to.get(), old.st_mode & 07777);
  // Only root may give files away; who may not keeps the file as its own.
  if (::geteuid() == 0 && ::fchown(to.get(), old.st_uid, old.st_gid) != 0) throw cannot_write(file, errno);
  ::fsync(to.get());
  return fresh;
}

void save(const ServiceConfig& config, const YamlValue& root, const auto& says_what_was_meant) {
  const fs::path file = fs::canonical(config.file);
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw std::runtime_error("cannot read " + file.string() + ": " + std::strerror(errno));
  std::ostringstream text;
  text << stream.rdbuf();
  std::string why_not, edited;
  try {
    edited = with_value(text.str(), root);
  } catch (const std::runtime_error& error) {
    why_not = error.what();
  }
  if (why_not.empty()) {
    const ServiceConfig before = load_service_config(file);
    const fs::path fresh = write_beside(file, edited);
    try {
      ServiceConfig after = load_service_config(fresh);
      after.file = before.file;
      const auto differing = differing_keys(before, after);
      const bool only_ours =
          std::ranges::all_of(differing, [](const std::string& key) { return key == "targets" || key == "ignore"; });
      if (only_ours && says_what_was_meant(after)) {
        replace_file(file, fresh);
        return;
      }
      why_not = "the file would not say what was meant";
    } catch (const std::runtime_error& error) {
      why_not = error.what();
    }
    std::error_code gone_already;
    fs::remove(fresh, gone_already);
  }
  throw std::runtime_error(file.string() + " was left as it is (" + why_not +
                           "); write into it by hand: " + flow_text(root));
}

}  // namespace

std::string with_value(const std::string& yaml, const YamlValue& root) {
  std::string text = yaml;
  const std::size_t first = text.find_first_not_of(" \n\r\t");
  if (first != std::string::npos && text[first] == '{') {
    set_in_flow(text, first, root);
  } else {
    set_in_block(text, 0, text.size(), root, 0);
  }
  return text;
}

void save_taught(const ServiceConfig& config, const object_tracking::TargetOptions& target,
                 const std::optional<object_tracking::IgnoredRegions>& ignored) {
  YamlValue root = YamlValue::map({{"targets", yaml_of(target)}});
  if (ignored) root.entries.emplace_back("ignore", yaml_of(*ignored));
  save(config, root, [&](const ServiceConfig& after) {
    const auto it = std::ranges::find(after.targets, target.name, &object_tracking::TargetOptions::name);
    return it != after.targets.end() && it->color == target.color && it->camera_colors == target.camera_colors;
  });
}

void save_ignored(const ServiceConfig& config, const object_tracking::IgnoredRegions& ignored) {
  save(config, YamlValue::map({{"ignore", yaml_of(ignored)}}),
       [&](const ServiceConfig& after) { return after.ignored == ignored; });
}

}  // namespace huetrack::config
