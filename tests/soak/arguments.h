// The command lines of the test programs here: options with one value each, and words. CLI11 costs each of them five
// seconds of compiling.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace huetrack::soak {

class Arguments {
 public:
  // known: options, with their dashes. Ends the program with 2 where the line is none of `usage`.
  Arguments(int argc, char** argv, const std::vector<std::string>& known, std::size_t least_words, std::string usage)
      : usage_(std::move(usage)) {
    for (int i = 1; i < argc; ++i) {
      const std::string word = argv[i];
      if (!word.starts_with("--")) {
        words_.push_back(word);
      } else if (std::find(known.begin(), known.end(), word) == known.end() || i + 1 == argc) {
        end(word);
      } else {
        values_[word] = argv[++i];
      }
    }
    if (words_.size() < least_words) end("too few words");
  }

  bool has(const std::string& option) const { return values_.contains(option); }
  std::string text(const std::string& option, const std::string& otherwise = "") const {
    const auto found = values_.find(option);
    return found == values_.end() ? otherwise : found->second;
  }
  double number(const std::string& option, double otherwise) const {
    if (!has(option)) return otherwise;
    std::size_t read = 0;
    const std::string value = text(option);
    double number = 0;
    try {
      number = std::stod(value, &read);
    } catch (const std::exception&) {
    }
    if (read == 0 || read != value.size()) end(option + " " + value);
    return number;
  }
  std::uint64_t count(const std::string& option, std::uint64_t otherwise) const {
    const double value = number(option, static_cast<double>(otherwise));
    if (!(value >= 0) || value != static_cast<double>(static_cast<std::uint64_t>(value))) end(option);
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
