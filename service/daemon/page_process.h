// The web page's program, `huetrack view`, as a child process of a command.
#pragma once

#include <filesystem>
#include <functional>
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
  // options: of `huetrack view`. on_end: called by another thread if the page ends by itself; it has printed why.
  // throws std::runtime_error with one readable line if it cannot be started.
  PageProcess(const std::filesystem::path& program, std::vector<std::string> options, std::function<void()> on_end);

 private:
  page::ChildProcess child_;
  std::jthread thread_;  // last: joined first
};

// The page; nullptr: its program, huetrack, is neither next to this one nor on the PATH. port: where it must listen;
// nullopt: at its default port, or, where that is in use, at any free one.
std::unique_ptr<PageProcess> start_page(std::optional<int> port, std::function<void()> on_end);

}  // namespace huetrack::daemon
