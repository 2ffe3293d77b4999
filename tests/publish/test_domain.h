#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <stdexcept>
#include <string>

namespace huetrack::publish {

// One test process, one domain, which no other one has meanwhile, so that tests run side by side: it is locked until
// the process ends. 70 to 79 are those of the browser's tests, the soak and the benchmarks. Below 100: the UDP ports of
// higher domains are those that the kernel hands out to others.
inline int test_domain() {
  static const int domain = [] {
    constexpr int domains = 69;
    for (int k = 0; k < domains; ++k) {
      const int candidate = 1 + (static_cast<int>(::getpid()) + k) % domains;
      const std::string file = "/tmp/huetrack_test_domain." + std::to_string(candidate);
      const int lock = ::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
      if (lock < 0) continue;  // another user's
      if (::flock(lock, LOCK_EX | LOCK_NB) == 0) return candidate;
      ::close(lock);
    }
    throw std::runtime_error("all DDS domains for tests are taken: /tmp/huetrack_test_domain.*");
  }();
  return domain;
}

}  // namespace huetrack::publish
