#include "page/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

namespace huetrack::page {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr int child_niceness = 10;             // of 19
constexpr auto child_patience = 500ms;         // at the end
constexpr std::size_t longest_line = 4000;     // longer lines are cut
constexpr std::size_t most_read = 256 * 1024;  // per call

bool is_program(const fs::path& file) {
  std::error_code none;
  return fs::is_regular_file(file, none) && ::access(file.c_str(), X_OK) == 0;
}

// posix_spawn() copies no page tables, which for a large process takes milliseconds with page faults in all threads.
pid_t spawned(const fs::path& program, const std::vector<std::string>& arguments, int output) {
  std::vector<char*> words{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&files, output, STDERR_FILENO);
  // Close cameras and DDS sockets, which are not all close-on-exec.
  posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  // Default signals. If this program is killed, the child's next output into the broken pipe ends it.
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setpgroup(&attributes, 0);  // Ctrl-C is for the service, which ends the child
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  pid_t pid = -1;
  const int error = ::posix_spawn(&pid, program.c_str(), &files, &attributes, words.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) throw std::runtime_error(fmt::format("cannot start {}: {}", program.string(), std::strerror(error)));
  ::setpriority(PRIO_PROCESS, id_t(pid), child_niceness);  // ignored if refused
  return pid;
}

}  // namespace

std::optional<fs::path> find_program(const std::string& name) {
  std::error_code none;
  if (const fs::path sibling = fs::read_symlink("/proc/self/exe", none).parent_path() / name; is_program(sibling))
    return sibling;
  const char* const path = std::getenv("PATH");
  std::string_view rest = path != nullptr ? path : "/usr/local/bin:/usr/bin:/bin";
  while (!rest.empty()) {
    const std::size_t end = rest.find(':');
    const fs::path folder(rest.substr(0, end));
    if (folder.is_absolute() && is_program(folder / name)) return folder / name;
    rest = end == std::string_view::npos ? "" : rest.substr(end + 1);
  }
  return std::nullopt;
}

ChildProcess::ChildProcess(const fs::path& program, const std::vector<std::string>& arguments) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw std::runtime_error(fmt::format("cannot start {}: {}", program.string(), std::strerror(errno)));
  output_ = capture::FileDescriptor(ends[0]);
  const capture::FileDescriptor its(ends[1]);
  ::fcntl(output_.get(), F_SETFL, O_NONBLOCK);
  pid_ = spawned(program, arguments, its.get());
}

ChildProcess::~ChildProcess() {
  if (pid_ < 0) return;
  ask_to_end();
  for (const auto end = std::chrono::steady_clock::now() + child_patience;
       !ended() && std::chrono::steady_clock::now() < end;) {
    take_lines();  // it may be blocked in a write
    std::this_thread::sleep_for(5ms);
  }
  if (pid_ < 0) return;
  kill();
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

std::vector<std::string> ChildProcess::take_lines() {
  std::vector<std::string> lines;
  std::array<char, 4096> part{};
  for (std::size_t got = 0; got < most_read;) {
    const ssize_t n = ::read(output_.get(), part.data(), part.size());
    if (n < 0 && errno == EINTR) continue;
    if (n == 0 && !begun_.empty()) lines.push_back(std::exchange(begun_, {}));  // incomplete last line
    if (n <= 0) break;
    got += std::size_t(n);
    for (const char c : std::string_view(part.data(), std::size_t(n))) {
      if (c == '\n') {
        lines.push_back(std::exchange(begun_, {}));
      } else if (begun_.size() < longest_line) {
        begun_ += c;
      }
    }
  }
  return lines;
}

std::optional<ChildProcess::Ended> ChildProcess::ended() {
  if (pid_ < 0) return ended_;
  int status = 0;
  if (::waitpid(pid_, &status, WNOHANG) != pid_) return std::nullopt;
  pid_ = -1;
  ended_ = {.status = WIFEXITED(status) ? WEXITSTATUS(status) : 0,
            .signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0};
  return ended_;
}

void ChildProcess::ask_to_end() {
  if (pid_ > 0) ::kill(pid_, SIGTERM);
}

void ChildProcess::kill() {
  if (pid_ > 0) ::kill(pid_, SIGKILL);
}

}  // namespace huetrack::page
