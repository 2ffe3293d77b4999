// The web page's program, `huetrack view`, as a child process of a command.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "page/child_process.h"

namespace huetrack::daemon {

// Runs the page while this exists, and prints its output: first its address.
class PageProcess {
 public:
  // options: of `huetrack view`. throws std::runtime_error with one readable line if it cannot be started.
  PageProcess(const std::filesystem::path& program, std::vector<std::string> options);

 private:
  page::ChildProcess child_;
  std::jthread thread_;  // last: joined first
};

// The page, or nullptr after a sentence that its program was not found.
std::unique_ptr<PageProcess> start_page(const std::vector<std::string>& options);

}  // namespace huetrack::daemon
