// How much of a file is read, and how much of it is shown: the limits of size, depth, line and quotation, for every
// reader of text. A file may be a mistake, or somebody's attempt: /dev/zero, a pipe that nobody writes, a megabyte of
// brackets, escape sequences for the terminal. Pure functions; thread-safe.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace huetrack::yaml {

inline constexpr std::size_t largest_text_file = 4U << 20;  // bytes: written by hand or by a tool, none is larger
inline constexpr std::size_t longest_line = 64U << 10;      // bytes of a table's row: some thousands of columns
// Lists in lists, tables in tables: a calibration has four. Parsers call themselves for each, and the stack ends.
inline constexpr int deepest_nesting = 64;
inline constexpr std::size_t longest_quote = 40;      // characters that a message shows of a text
inline constexpr std::size_t longest_message = 1000;  // characters: a path may be long, but not endless

// For reading. throws ConfigError: it is no file (a device, a pipe, a folder), or cannot be read.
std::ifstream open_text_file(const std::filesystem::path& file);

// All of it. throws ConfigError as open_text_file(), and when it is larger than `most` bytes.
std::string read_text_file(const std::filesystem::path& file, std::size_t most = largest_text_file);

enum class Keys { plain, dotted };  // dotted: "a.b.c = 1" is a table in a table, as in TOML

// Before a parser that calls itself: throws ConfigError at the line where YAML, JSON, XML or TOML goes deeper than
// deepest_nesting. It counts without understanding: what it lets through may be wrong, and is not deep.
void refuse_deep_nesting(std::string_view text, const std::filesystem::path& file, Keys keys = Keys::plain);

// As people's terminals may have it: one line of UTF-8, without control characters or changes of the writing direction,
// and without what is beyond `most` characters ("..." says so).
std::string printable(std::string_view text, std::size_t most = longest_quote);

// As a string of YAML, between quotes: any text, on one line.
std::string in_yaml_quotes(std::string_view text);
// As one of JSON, or of TOML.
std::string in_json_quotes(std::string_view text);

// Whether a terminal could obey something in it; a tab is harmless.
bool has_control_characters(std::string_view text);

}  // namespace huetrack::yaml
