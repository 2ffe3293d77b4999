#include "calib/exchange/exchange.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/exchange/exchanged_camera.h"
#include "calib/files/config_error.h"
#include "recordings/bags/bag.h"

namespace huetrack::exchange {

Imported import_rig(std::span<const std::filesystem::path> files, const ImportOptions& options) {
  if (files.empty()) throw ExchangeError("no file to import");
  const std::filesystem::path& file = files.front();
  if (const std::string problem = bags::problem_of_beginning(file); !problem.empty())
    throw files::ConfigError(file, 0, problem);
  Imported out = files.size() == 1 && bags::is_bag(file) ? import_bag(file, options) : imported_from(files, options);
  for (calib::Camera& camera : out.rig.cameras) camera.cam_from_world.translation *= options.metres_per_unit;
  double widest = 0;
  for (const calib::Camera& a : out.rig.cameras) {
    for (const calib::Camera& b : out.rig.cameras) widest = std::max(widest, (a.centre() - b.centre()).norm());
  }
  constexpr double widest_rig_m = 50;  // a wider rig is probably in millimetres
  if (widest > widest_rig_m) {
    throw files::ConfigError(
        file, 0,
        fmt::format("the cameras are up to {:.0f} m apart: if the file is in millimetres, give --unit mm", widest));
  }
  if (out.rig.cameras.size() > 1)
    out.notes.push_back(fmt::format("the cameras are up to {:.3f} m apart: if that is wrong, give --unit", widest));
  require_valid(out.rig, file);
  return out;
}

}  // namespace huetrack::exchange
