// The order of numbered files. Pure functions but for the folder that is read; thread-safe.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::files {

// Numbers in names compare as numbers: img2 before img10, and 1700000000.5 before 1700000000.75, t0.1s before t0.133s.
// Names compare without their extensions: pic.jpg before "pic (1).jpg".
bool numbers_ascend(std::string_view a, std::string_view b);

// The names of one series in that order. A - before a number is a sign where other names have the number without it
// (frame-60 ... frame89), else a separator (img-1 ... img-60). Numbers with a point are fractions where they are all
// different and in even steps then (0.9, 0.9333, 1). Upper and lower case are the same. Counters may be
// hexadecimal.
// throws ConfigError: it may be either
void sort_by_numbers(std::vector<std::filesystem::path>& files);

// False: most names differ in letters, and no number at a place that all have tells them apart, as in UUIDs and hashes;
// or the one number that varies is as irregular as random ones are.
bool hold_an_order(const std::vector<std::filesystem::path>& files);

// Of names in two or more series that count the same, as left_0001.jpg ... and right_0001.jpg ...: the first file of
// the two largest. Empty: one series.
std::vector<std::filesystem::path> several_series(const std::vector<std::filesystem::path>& files);

// Of names most of which consist of the same text and numbers, as frame_0001.jpg ...: the others, as background.jpg,
// which are probably no pictures of the series. Not those that count on in it, as b_4.jpg after a_3.jpg.
// files: as sort_by_numbers() orders them
std::vector<std::filesystem::path> stray_files(const std::vector<std::filesystem::path>& files);

// A name with digits only and one with a letter a to f before a digit, as 010 and 0a5, where names differ in nothing
// else: parts of hexadecimal numbers. Empty: there are none, or the numbers are hexadecimal.
std::vector<std::filesystem::path> letters_in_numbers(const std::vector<std::filesystem::path>& files);

// all: the files of a wider pattern. One of them without which the numbers of the given files are decimal, and with
// which they are hexadecimal; nullopt: none.
std::optional<std::filesystem::path> hexadecimal_left_out(const std::vector<std::filesystem::path>& files,
                                                          std::vector<std::filesystem::path> all);

// Orders that names of one kind may have, too, where several of their numbers vary: another one of these leads
// (frame_0_1.png). files: as sort_by_numbers() orders them. Each one as indices of files; empty: there is no other.
std::vector<std::vector<std::size_t>> other_orders(const std::vector<std::filesystem::path>& files);

// The last number in each name, as it is read there; empty: a name has none. throws as sort_by_numbers()
std::vector<double> last_numbers(const std::vector<std::filesystem::path>& files);

// The files that match a glob (*, ?, [...]), in the order of sort_by_numbers(); empty: none. throws ConfigError
std::vector<std::filesystem::path> files_of_glob(const std::string& pattern);

}  // namespace huetrack::files
