#include "daemon/page_process.h"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <utility>

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;

constexpr const char* program_name = "huetrack";

std::vector<std::string> view_words(std::vector<std::string> options) {
  options.insert(options.begin(), "view");
  return options;
}

}  // namespace

PageProcess::PageProcess(const std::filesystem::path& program, std::vector<std::string> options,
                         std::function<void()> on_end)
    : child_(program, view_words(std::move(options))),
      thread_([this, on_end = std::move(on_end)](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          const auto ended = child_.ended();
          for (const std::string& line : child_.take_lines()) fmt::print("{}\n", line);
          std::fflush(stdout);
          if (ended) return on_end();
          std::this_thread::sleep_for(50ms);
        }
      }) {}

std::unique_ptr<PageProcess> start_page(std::optional<int> port, std::function<void()> on_end) {
  const std::vector<std::string> options =
      port ? std::vector<std::string>{"--port", std::to_string(*port)} : std::vector<std::string>{"--any-free-port"};
  if (const auto program = page::find_program(program_name))
    return std::make_unique<PageProcess>(*program, options, std::move(on_end));
  return nullptr;
}

}  // namespace huetrack::daemon
