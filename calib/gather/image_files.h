// Groups image files of several cameras into frame sets. Private to this module.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace huetrack::gather {

bool is_image_file(const std::filesystem::path& file);  // by its extension
bool is_video_file(const std::filesystem::path& file);

// The images of a folder or a pattern (*.jpg, %06d.png), or the file itself; in natural order (2 before 10). May be
// empty.
std::vector<std::filesystem::path> image_files(const std::filesystem::path& given);

// files: per camera. Files with the same last number in their names form a set; without common numbers, and if all
// cameras have the same number of images, those at the same position.
struct ImageSet {
  long number = 0;  // from the names, or counted
  std::vector<std::optional<std::filesystem::path>> files;
};
// throws InputError: the grouping is ambiguous.
std::vector<ImageSet> paired_images(const std::vector<std::string>& cameras,
                                    const std::vector<std::vector<std::filesystem::path>>& files);

}  // namespace huetrack::gather
