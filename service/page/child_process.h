// A child process of the service: with lower priority, without inherited files, sockets or signal masks; it never
// outlives the service.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "capture/frames/file_descriptor.h"

namespace huetrack::page {

// Finds a program next to this one or on PATH. nullopt: not found.
std::optional<std::filesystem::path> find_program(const std::string& name);

// thread-compatible. Read its standard output and error by take_lines(); otherwise it blocks when the pipe is full.
class ChildProcess {
 public:
  // throws std::runtime_error with one readable line if it cannot be started.
  ChildProcess(const std::filesystem::path& program, const std::vector<std::string>& arguments);
  ~ChildProcess();  // SIGTERM, and half a second later SIGKILL
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  // Complete lines since the last call, of bounded length. Does not wait.
  std::vector<std::string> take_lines();

  struct Ended {
    int status = 0;  // exit status
    int signal = 0;  // that ended it; 0: none
  };
  std::optional<Ended> ended();  // does not wait; then call take_lines() once more
  void ask_to_end();             // SIGTERM; does not wait
  void kill();                   // SIGKILL; does not wait

 private:
  capture::FileDescriptor output_;
  std::string begun_;  // incomplete line
  pid_t pid_ = -1;     // -1: ended
  Ended ended_;
};

}  // namespace huetrack::page
