// The words in which something is asked for, on the bus or on the command line, taken apart.
#pragma once

#include <cstdint>
#include <optional>
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
std::runtime_error unknown_request();

}  // namespace huetrack::page
