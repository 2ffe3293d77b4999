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
