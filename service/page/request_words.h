// Parses words of requests, from DDS or the command line.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::page {

// The parts between separators, including empty ones; at least one.
std::vector<std::string> split(std::string_view text, char separator);

// A finite number; nullopt: not one.
std::optional<double> finite_number(std::string_view text);

// throw std::runtime_error with the expected form
double real_of(std::string_view text);  // as finite_number()
std::uint64_t whole_number_of(std::string_view text);

// Thrown for an unknown request.
class UnknownRequest : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};
UnknownRequest unknown_request();

// A sentence, without full stop, that lists the known requests with these first words, or all first words.
std::string known_requests(std::span<const std::string> words);

}  // namespace huetrack::page
