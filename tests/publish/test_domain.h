#pragma once

#include <unistd.h>

namespace huetrack::publish {

// One test process, one domain, so that tests run side by side. Below 100: the UDP ports of higher domains are those
// that the kernel hands out to others.
inline int test_domain() {
  return 1 + static_cast<int>(::getpid() % 99);
}

}  // namespace huetrack::publish
