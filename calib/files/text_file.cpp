#include "calib/files/text_file.h"

#include <algorithm>
#include <cerrno>
#include <optional>
#include <system_error>

#include "calib/files/config_error.h"
#include "calib/files/files_beside.h"

namespace huetrack::files {
namespace {

constexpr std::string_view blanks = " \t";
constexpr int widest_indentation = 4 * deepest_nesting;  // capacity: columns

// The first character and its length; nullopt: not UTF-8.
struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 1;
};
std::optional<Character> first_character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return std::uint32_t(static_cast<unsigned char>(text[i])); };
  const std::uint32_t lead = byte(0);
  if (lead < 0x80) return Character{lead, 1};
  const std::size_t bytes = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < bytes) return std::nullopt;
  std::uint32_t code = lead & (0x7FU >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return std::nullopt;
    code = code << 6U | (byte(i) & 0x3FU);
  }
  constexpr std::uint32_t smallest[] = {0, 0, 0x80, 0x800, 0x10000};
  if (code < smallest[bytes] || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000)) return std::nullopt;
  return Character{code, bytes};
}

// C0, DEL, C1, line separators, changes of the writing direction.
bool is_control(std::uint32_t code) {
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || code == 0x2028 || code == 0x2029 || code == 0x200E ||
         code == 0x200F || (code >= 0x202A && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
}

// Number of lists that a line opens: 3 for "- - - 1".
int lists_begun(std::string_view line) {
  int lists = 0;
  for (std::size_t i = 0; i + 1 < line.size() && std::string_view("-?:").find(line[i]) != std::string_view::npos;) {
    const auto next = line.find_first_not_of(blanks, i + 1);
    if (next == i + 1 || next == std::string_view::npos) break;
    ++lists;
    i = next;
  }
  return lists;
}

// Control characters as `escape` and two hexadecimal digits.
std::string in_quotes(std::string_view text, std::string_view escape) {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') out += '\\';
    if (code < 0x20 || code == 0x7F)
      out.append(escape) += {digits[code >> 4U], digits[code & 15U]};
    else
      out += c;
  }
  return out + '"';
}

}  // namespace

std::ifstream open_text_file(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (std::filesystem::is_directory(status)) throw ConfigError(file, 0, "is a directory, not a file");
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    throw ConfigError(file, 0, "is a device, a pipe or a socket, not a file");
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    const int problem = errno != 0 ? errno : EIO;
    throw ConfigError(
        file, 0,
        "cannot be read: " + std::generic_category().message(problem) + (problem == ENOENT ? files_beside(file) : ""));
  }
  return stream;
}

std::string read_text_file(const std::filesystem::path& file, std::size_t most) {
  std::ifstream stream = open_text_file(file);
  std::error_code unknown;
  const auto size = std::filesystem::file_size(file, unknown);  // a first guess: 0 for files in /proc
  std::string text;
  std::size_t chunk = std::min<std::size_t>(unknown ? 0 : size, most) + 1;
  while (stream && text.size() <= most) {
    const std::size_t before = text.size();
    text.resize(std::min(before + std::max<std::size_t>(chunk, 4096), most + 1));
    stream.read(text.data() + before, static_cast<std::streamsize>(text.size() - before));
    text.resize(before + static_cast<std::size_t>(stream.gcount()));
    chunk = text.size();
  }
  if (stream.bad()) throw ConfigError(file, 0, "cannot be read to its end");
  if (text.size() > most)
    throw ConfigError(file, 0, "is larger than " + std::to_string(most >> 20U) + " MiB: not a file of this kind");
  return text;
}

void refuse_deep_nesting(std::string_view text, const std::filesystem::path& file, Keys keys) {
  int line = 1;
  const auto check = [&](int depth, int most = deepest_nesting) {
    if (depth > most)
      throw ConfigError(file, line, "is nested deeper than " + std::to_string(deepest_nesting) + " levels");
  };
  const auto begin = text.find_first_not_of(" \t\r\n");
  const bool is_xml = begin != std::string_view::npos && text[begin] == '<';
  int brackets = 0, tags = 0, dots = 0;
  bool is_at_line_start = true;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i], next = i + 1 < text.size() ? text[i + 1] : '\0';
    if (is_at_line_start) {
      is_at_line_start = false;
      const auto word = text.find_first_not_of(blanks, i);
      if (word != std::string_view::npos && text[word] != '\n' && text[word] != '\r' && !is_xml)
        check(static_cast<int>(std::min<std::size_t>(word - i, widest_indentation + 1)), widest_indentation);
      if (word != std::string_view::npos) check(lists_begun(text.substr(word, 4 * deepest_nesting)));
    }
    if (c == '[' || c == '{') {
      check(++brackets);
    } else if (c == ']' || c == '}') {
      brackets = std::max(brackets - 1, 0);
    } else if (is_xml && c == '<') {
      if (next == '/') {
        tags = std::max(tags - 1, 0);
      } else if (next != '?' && next != '!') {
        check(++tags);
      }
    } else if (is_xml && c == '/' && next == '>') {
      tags = std::max(tags - 1, 0);
    }
    if (keys == Keys::dotted) {
      if (std::string_view(",=[]{}\n").find(c) != std::string_view::npos) dots = 0;
      if (c == '.' && next != '.') check(++dots);
    }
    if (c == '\n') {
      ++line;
      is_at_line_start = true;
    }
  }
}

std::string printable(std::string_view text, std::size_t most) {
  std::string out;
  for (std::size_t count = 0; !text.empty(); ++count) {
    if (count == most) return out + "...";
    const auto character = first_character(text);
    const std::size_t bytes = character ? character->bytes : 1;
    if (!character)
      out += '?';
    else if (is_control(character->code))
      out += ' ';
    else
      out += text.substr(0, bytes);
    text.remove_prefix(bytes);
  }
  return out;
}

std::string in_yaml_quotes(std::string_view text) {
  return in_quotes(text, "\\x");
}

std::string in_json_quotes(std::string_view text) {
  return in_quotes(text, "\\u00");
}

bool has_control_characters(std::string_view text) {
  while (!text.empty()) {
    const auto character = first_character(text);
    if (character && character->code != '\t' && is_control(character->code)) return true;
    text.remove_prefix(character ? character->bytes : 1);
  }
  return false;
}

}  // namespace huetrack::files
