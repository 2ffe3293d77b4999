// The command lines of the test programs here: options with one value each, and words. By getopt_long: CLI11 costs each
// of them five seconds of compiling.
#pragma once

#include <getopt.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

namespace huetrack::soak {

class Arguments {
 public:
  // known: options, without their dashes. Ends the program with 2 where the line is none of `usage`.
  Arguments(int argc, char** argv, const std::vector<std::string>& known, std::size_t least_words, std::string usage)
      : usage_(std::move(usage)) {
    std::vector<option> options;
    for (const auto& name : known) options.push_back({name.c_str(), required_argument, nullptr, 0});
    options.push_back({});
    int which = 0;
    for (int got; (got = ::getopt_long(argc, argv, "", options.data(), &which)) != -1;) {
      if (got != 0) end("that is not understood");  // after what getopt_long has said of it
      values_[known[static_cast<std::size_t>(which)]] = optarg;
    }
    words_.assign(argv + optind, argv + argc);
    if (words_.size() < least_words) end("too few words");
  }

  bool has(const std::string& option) const { return values_.contains(option); }
  std::string text(const std::string& option, const std::string& otherwise = "") const {
    return has(option) ? values_.at(option) : otherwise;
  }
  double number(const std::string& option, double otherwise) const {
    if (!has(option)) return otherwise;
    char* rest = nullptr;
    const std::string& value = values_.at(option);
    const double number = std::strtod(value.c_str(), &rest);
    if (value.empty() || *rest != '\0') end("--" + option + " " + value);
    return number;
  }
  std::uint64_t count(const std::string& option, std::uint64_t otherwise) const {
    const double value = number(option, static_cast<double>(otherwise));
    if (!(value >= 0) || value != static_cast<double>(static_cast<std::uint64_t>(value))) end("--" + option);
    return static_cast<std::uint64_t>(value);
  }
  // "" if there are fewer.
  std::string word(std::size_t i) const { return i < words_.size() ? words_[i] : ""; }

  [[noreturn]] void end(const std::string& fault) const {
    std::fprintf(stderr, "%s\nusage: %s\n", fault.c_str(), usage_.c_str());
    std::exit(2);
  }

 private:
  std::string usage_;
  std::map<std::string, std::string> values_;
  std::vector<std::string> words_;
};

}  // namespace huetrack::soak
