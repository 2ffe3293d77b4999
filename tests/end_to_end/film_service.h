// `huetrackd run` on films in the place of cameras, in a process of its own, and `huetrack` asking it.
#pragma once

#include <gtest/gtest.h>

#include "end_to_end/process.h"
#include "publish/test_domain.h"
#include "soak/films.h"

namespace huetrack::end_to_end {

// A folder for the films, which a test makes, c.yaml and what the programs say; gone with the test.
class FilmService : public testing::Test {
 protected:
  explicit FilmService(const std::string& folder_name)
      : folder(std::filesystem::path(testing::TempDir()) / (folder_name + "_" + std::to_string(::getpid()))) {}
  ~FilmService() override {
    service.reset();
    std::filesystem::remove_all(folder);
  }

  // more: lines of the configuration besides films and bus.
  void configure(const std::string& more) const {
    std::ofstream(config) << soak::film_config(
        folder, 300, more + "dds: {domain: " + std::to_string(publish::test_domain()) + ", interfaces: [lo]}\n");
  }
  void start(const std::map<std::string, std::string>& environment = {}) {
    service.emplace(std::vector<std::string>{FILM_SERVICE, config.string(), folder.string(), "--phases", "together"},
                    folder / "service.out", folder / "service.err", environment);
  }

  struct Result {
    int status;
    std::string out, err;
  };
  Result huetrack(std::vector<std::string> words) const {
    words.insert(words.begin(), HUETRACK);
    words.insert(words.end(), {"--domain", std::to_string(publish::test_domain()), "--interface", "lo"});
    Process process(words, folder / "out", folder / "err");
    const int status = process.wait();
    return {status, process.out(), process.err()};
  }

  const std::filesystem::path folder;
  const std::filesystem::path config = folder / "c.yaml";
  std::optional<Process> service;
};

}  // namespace huetrack::end_to_end
