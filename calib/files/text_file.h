// Limits for every reader of text files, and safe quoting of their content. Input may be wrong or hostile: /dev/zero, a
// pipe without a writer, a megabyte of brackets, escape sequences for the terminal. Pure functions; thread-safe.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace huetrack::files {

inline constexpr std::size_t largest_text_file = 4U << 20;  // capacity: bytes
inline constexpr std::size_t longest_line = 64U << 10;      // capacity: bytes of a table row, thousands of columns
inline constexpr int deepest_nesting = 64;  // capacity: parsers recurse once per level; a calibration has four levels
inline constexpr std::size_t longest_quote = 40;      // capacity: characters of a quotation in a message
inline constexpr std::size_t longest_message = 1000;  // capacity: characters

// Opens for reading. throws ConfigError: not a regular file (a device, a pipe, a folder), or unreadable.
std::ifstream open_text_file(const std::filesystem::path& file);

// The whole file. throws ConfigError as open_text_file(), and if it is larger than `most` bytes.
std::string read_text_file(const std::filesystem::path& file, std::size_t most = largest_text_file);

enum class Keys { plain, dotted };  // dotted: "a.b.c = 1" nests, as in TOML

// For use before a recursive parser: throws ConfigError at the line where YAML, JSON, XML or TOML nests deeper than
// deepest_nesting. Counts brackets, tags and indentation only; does not check the syntax.
void refuse_deep_nesting(std::string_view text, const std::filesystem::path& file, Keys keys = Keys::plain);

// Text that is safe on a terminal: one line of UTF-8 without control characters or changes of the writing direction,
// cut to `most` characters ("..." marks the cut).
std::string printable(std::string_view text, std::size_t most = longest_quote);

// As a quoted YAML string on one line.
std::string in_yaml_quotes(std::string_view text);
// As a quoted JSON or TOML string.
std::string in_json_quotes(std::string_view text);

// Whether a terminal could interpret something in it; a tab is harmless.
bool has_control_characters(std::string_view text);

}  // namespace huetrack::files
