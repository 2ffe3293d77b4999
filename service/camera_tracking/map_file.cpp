#include "camera_tracking/map_file.h"

#include "calib/files/output_file.h"

namespace huetrack::camera_tracking {

void refuse_other_than_map(const std::filesystem::path& file) {
  static_assert(map_magic.size() == map_magic_1.size());
  files::refuse_other_kind(file, {"camera map", [](std::string_view begin) {
                                    return begin.starts_with(map_magic.substr(0, map_magic.size() - 2));
                                  }});
}

}  // namespace huetrack::camera_tracking
