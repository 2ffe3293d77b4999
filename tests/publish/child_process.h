// A program that a test starts, with its stdout and stderr in files, so that nothing can block.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace huetrack::publish {

// thread-compatible. Killed on destruction.
class ChildProcess {
 public:
  explicit ChildProcess(const std::vector<std::string>& arguments) {
    std::string pattern = (std::filesystem::temp_directory_path() / "huetrack-test-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("mkdtemp");
    directory_ = pattern;
    std::vector<char*> argv;
    for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    ::posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    const int flags = O_WRONLY | O_CREAT | O_TRUNC;
    ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, (directory_ / "out").c_str(), flags, 0600);
    ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, (directory_ / "err").c_str(), flags, 0600);
    const int error = ::posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), ::environ);
    ::posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error("cannot start " + arguments[0]);
  }
  ~ChildProcess() {
    if (!status_) {
      send(SIGKILL);
      exit_status(std::chrono::seconds(10));
    }
    std::error_code ignored;
    std::filesystem::remove_all(directory_, ignored);
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  void send(int signal) { ::kill(pid_, signal); }
  ::pid_t pid() const { return pid_; }
  std::string out() const { return read("out"); }
  std::string err() const { return read("err"); }

  // Waits until stderr contains the text.
  bool says(const std::string& text, std::chrono::milliseconds at_most) const {
    return wait([&] { return err().find(text) != std::string::npos; }, at_most);
  }

  // The exit status, 128 + signal if it was killed; nullopt: it still runs.
  std::optional<int> exit_status(std::chrono::milliseconds at_most) {
    wait(
        [&] {
          int status = 0;
          if (!status_ && ::waitpid(pid_, &status, WNOHANG) == pid_)
            status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
          return status_.has_value();
        },
        at_most);
    return status_;
  }

  static bool wait(const std::function<bool()>& condition, std::chrono::milliseconds at_most) {
    const auto until = std::chrono::steady_clock::now() + at_most;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > until) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return true;
  }

 private:
  std::string read(const char* name) const {
    std::ifstream file(directory_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  std::filesystem::path directory_;
  ::pid_t pid_ = -1;
  std::optional<int> status_;
};

}  // namespace huetrack::publish
