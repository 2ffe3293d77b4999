// Another program that works for the service, beside it: at a lower priority, with none of its files, sockets or
// signals, and never longer than it.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "capture/frames/file_descriptor.h"

namespace huetrack::page {

// Where a program of ours is: beside this one, or where PATH says. nullopt: nowhere.
std::optional<std::filesystem::path> find_program(const std::string& name);

// thread-compatible. What it prints, on standard output and on the other one, is read by take_lines(): it waits, if
// nobody does.
class ChildProcess {
 public:
  // throws std::runtime_error of one readable line: it cannot be started.
  ChildProcess(const std::filesystem::path& program, const std::vector<std::string>& arguments);
  ~ChildProcess();  // asks it to end, and half a second later does not ask
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  // The whole lines that have come since the last call, each of a bounded length. Does not wait.
  std::vector<std::string> take_lines();

  struct Ended {
    int status = 0;  // that it gave
    int signal = 0;  // that ended it; 0: it ended by itself
  };
  std::optional<Ended> ended();  // does not wait; take_lines() has its last words once more
  void ask_to_end();             // SIGTERM; does not wait
  void kill();                   // SIGKILL, which it cannot refuse; does not wait

 private:
  capture::FileDescriptor output_;
  std::string begun_;  // of the line that is not whole yet
  pid_t pid_ = -1;     // -1: it has ended
  Ended ended_;
};

}  // namespace huetrack::page
