// The words in which something is asked for, on the bus or on the command line, taken apart.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace huetrack::page {

// What is between the separators; one part at least, and as many empty ones as there are.
std::vector<std::string> split(std::string_view text, char separator);

// A finite number and nothing else; nullopt: it is none.
std::optional<double> finite_number(std::string_view text);

// throw std::runtime_error, which says what is wanted
double real_of(std::string_view text);  // as finite_number()
std::uint64_t whole_number_of(std::string_view text);

// To be thrown: there is no such request.
class UnknownRequest : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};
UnknownRequest unknown_request();

// What is known instead, a sentence without its full stop: requests that begin as these words do; or with what they
// begin.
std::string known_requests(std::span<const std::string> words);

}  // namespace huetrack::page
