// The files of a series of images that `frames` names, by a printf pattern or a glob. Private to this module.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "recordings/recording.h"

namespace huetrack::recordings {

struct ImageFile {
  std::int64_t number = 0;  // in the stream
  std::int64_t named = 0;   // in its name, where the names count pictures; else as number
  std::filesystem::path path;
};

// In the order of capture. Empty: `frames` is one file. throws ConfigError: no file matches, or the order is not known
std::vector<ImageFile> image_files_of(const RecordedCamera& camera);

}  // namespace huetrack::recordings
