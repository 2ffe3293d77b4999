// Under a sanitizer a program takes several times as long: what comes to it in real time is shown so many times slower
// there, and it has so many times as long to answer.
#pragma once

namespace huetrack {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr int slow_motion = 4;
#else
inline constexpr int slow_motion = 1;
#endif

}  // namespace huetrack
