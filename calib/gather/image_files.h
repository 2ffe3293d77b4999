// Which image files belong together. Private to this module.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace huetrack::gather {

bool is_image_file(const std::filesystem::path& file);  // by its extension
bool is_video_file(const std::filesystem::path& file);

// A folder's images, a pattern's (*.jpg, %06d.png), or the file itself; sorted by name, numbers as numbers (2 before
// 10). Empty: there are none.
std::vector<std::filesystem::path> image_files(const std::filesystem::path& given);

// Per set, per camera: the file. files: per camera. By the last number in the names where that tells; otherwise, when
// all cameras have as many images, by their order.
struct ImageSet {
  long number = 0;  // in the names, or counted
  std::vector<std::optional<std::filesystem::path>> files;
};
// throws InputError: it cannot be told which belong together.
std::vector<ImageSet> paired_images(const std::vector<std::string>& cameras,
                                    const std::vector<std::vector<std::filesystem::path>>& files);

}  // namespace huetrack::gather
