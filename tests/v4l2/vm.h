// The VM that tests/v4l2/run.sh boots, for the tests that run in it.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "capture/frames/pixel_format.h"
#include "capture/v4l2/v4l2_device.h"

namespace huetrack::v4l2 {

inline bool is_in_vm() {
  return std::getenv("V4L2VM") != nullptr;
}
#define SKIP_OUTSIDE_VM() \
  if (!is_in_vm()) GTEST_SKIP() << "needs the VM: run tests/v4l2/run.sh"

// A program of the VM's tools, killed when this goes.
class Program {
 public:
  explicit Program(std::vector<std::string> words) {
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    pid_ = ::fork();
    if (pid_ == 0) {
      ::execv(arguments[0], arguments.data());
      ::_exit(127);
    }
  }
  ~Program() { end(); }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  void end() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_ = -1;
};

inline std::string tool(const std::string& name) {
  return std::string(std::getenv("HUETRACK_V4L2_TOOLS")) + "/" + name;
}

template <typename Condition>
bool comes_true(Condition condition, std::chrono::milliseconds patience = std::chrono::seconds(20)) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

// The pixels of a YUYV camera.
inline std::string yuyv_of(const capture::Image& image) {
  std::string bytes;
  for (int v = 0; v < image.height; ++v)
    for (int u = 0; u < image.width; u += 2) {
      const capture::Yuv left = capture::yuv_at(image, u, v), right = capture::yuv_at(image, u + 1, v);
      for (const auto byte : {left.y, left.u, right.y, left.v}) bytes += static_cast<char>(byte);
    }
  return bytes;
}

inline std::filesystem::path node_of(const std::string& driver, int number = 0) {
  for (const auto& node : capture::list_v4l2_nodes())
    if (node.identity.driver == driver && (node.is_capture || driver == "v4l2 loopback") && number-- == 0)
      return node.identity.node;
  return {};
}

}  // namespace huetrack::v4l2
