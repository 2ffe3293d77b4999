// What a reader of ours does with bytes from a file or from the network. Each file of targets/ is one such reader,
// built twice: by clang as a libFuzzer program (run.sh), and by the tests' compiler into fuzz_test, which replays the
// corpus. A target catches what its reader's contract says that it throws; anything else that leaves it is a finding.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <string_view>

namespace huetrack::fuzz {

using Target = void (*)(std::string_view input);

inline std::map<std::string, Target>& targets() {  // by name
  static std::map<std::string, Target> all;
  return all;
}

struct Registered {
  Registered(const char* name, Target target) { targets()[name] = target; }
};

// Where a target's files lie: in memory, and of this process alone.
inline const std::filesystem::path& folder() {
  struct Folder {
    std::filesystem::path path = std::filesystem::path("/dev/shm") / ("huetrack_fuzz_" + std::to_string(::getpid()));
    Folder() { std::filesystem::create_directories(path); }
    ~Folder() { std::filesystem::remove_all(path); }
  };
  static const Folder folder;
  return folder.path;
}

inline std::filesystem::path file_with(const std::string& name, std::string_view text) {
  std::filesystem::path file = folder() / name;
  std::ofstream(file, std::ios::binary).write(text.data(), static_cast<std::streamsize>(text.size()));
  return file;
}

// Whether bytes hold, or may hold, a JPEG whose header says a picture of more than a megapixel that our decoder takes:
// a few bytes then cost half a second, and the fuzzer has tried a picture of a thousandth of that size a thousand
// times. What the decoder refuses to begin with is quick.
inline bool is_long_to_decode(std::string_view bytes) {
  const auto word = [&](std::size_t at) {
    return std::size_t(static_cast<unsigned char>(bytes[at])) << 8U | static_cast<unsigned char>(bytes[at + 1]);
  };
  for (std::size_t at = bytes.find('\xff'); at != std::string_view::npos && at + 9 <= bytes.size();
       at = bytes.find('\xff', at + 1)) {
    const std::size_t marker = word(at);
    if (marker < 0xFFC0 || marker > 0xFFCF) continue;
    const std::size_t pixels = word(at + 5) * word(at + 7);
    if (pixels > (std::size_t{1} << 20U) && pixels <= (std::size_t{1} << 26U)) return true;
  }
  return false;
}

}  // namespace huetrack::fuzz

#ifdef HUETRACK_LIBFUZZER
#define HUETRACK_FUZZ_TARGET(name)                                                    \
  static void fuzz_##name(std::string_view input);                                    \
  extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) { \
    fuzz_##name({reinterpret_cast<const char*>(data), size});                         \
    return 0;                                                                         \
  }                                                                                   \
  static void fuzz_##name(std::string_view input)
#else
#define HUETRACK_FUZZ_TARGET(name)                                               \
  static void fuzz_##name(std::string_view input);                               \
  static const huetrack::fuzz::Registered registered_##name(#name, fuzz_##name); \
  static void fuzz_##name(std::string_view input)
#endif
