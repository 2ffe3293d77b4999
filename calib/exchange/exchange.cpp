#include "calib/exchange/exchange.h"

#include <fmt/format.h>

#include "calib/exchange/exchanged_camera.h"
#include "calib/files/config_error.h"
#include "calib/model/placement.h"
#include "recordings/bags/bag.h"

namespace huetrack::exchange {

namespace {

// What a file may mean by its poses instead of cam_from_world in our axes; or inverted ones.
void turn_opengl_axes(std::vector<calib::Camera>& cameras) {
  const calib::Rigid3d about_x{Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero()};
  for (calib::Camera& camera : cameras) camera.cam_from_world = about_x * camera.cam_from_world;
}

// Cameras that see no place in common, but do with OpenGL's axes, perhaps of inverted poses: the file is of that kind.
void check_axes(const std::vector<calib::Camera>& cameras, const ImportOptions& options, Imported& out) {
  if (options.has_opengl_axes || calib::see_a_place(cameras)) return;
  for (const bool inverts : {false, true}) {
    std::vector<calib::Camera> other = cameras;
    if (inverts) calib::invert_poses(other);
    turn_opengl_axes(other);
    const calib::Middle middle = calib::middle_of(other);
    if (!middle.is_in_all_pictures || (inverts && options.inverts_poses)) continue;
    out.is_doubtful = true;
    out.notes.push_back(
        fmt::format("the cameras see no place in common; with the axes of OpenGL, Blender or NeRF (y up, z backwards; "
                    "--camera-axes opengl{}) they are up to {:.3f} m apart and look at a place {:.2f} m away: the file "
                    "is probably of that kind",
                    inverts ? " --inverted-poses" : "", middle.widest, middle.distance));
    return;
  }
}

// Where the cameras are, for a person to recognise a wrong unit and inverted poses: world_from_cam where cam_from_world
// is expected, the commonest mistake. Neither can be known from the poses alone, since the world's origin may be
// anywhere.
void check_placement(const std::vector<calib::Camera>& cameras, bool is_inverted, Imported& out) {
  const calib::Middle as_it_is = calib::middle_of(cameras);
  std::string note = fmt::format("the cameras are up to {:.3f} m apart", as_it_is.widest);
  if (as_it_is.is_in_all_pictures) note += fmt::format(" and look at a place {:.2f} m away", as_it_is.distance);
  note += ": if that is wrong, give --unit";
  const auto other = is_inverted ? std::nullopt : calib::better_inverted(cameras);
  if (other) {
    const std::string what = fmt::format(
        "the poses inverted (world_from_cam; --inverted-poses), they are up to {:.3f} m apart and look at a place "
        "{:.2f} m away",
        other->widest, other->distance);
    out.is_doubtful = calib::are_probably_inverted(cameras, *other);
    if (!as_it_is.is_in_all_pictures) note += ". They do not look at one place";
    note += "; with " + what;
    if (out.is_doubtful) note += ": the file is probably of that kind";
  }
  out.notes.push_back(std::move(note));
}

// Cameras on a ring around the world's origin: inverted, all poses are one place, of which no rig can be made.
void refuse_one_place(std::vector<calib::Camera> cameras, const std::filesystem::path& file) {
  constexpr double apart_m = 1e-6;
  if (cameras.size() < 2 || calib::middle_of(cameras).widest > apart_m) return;
  calib::invert_poses(cameras);
  const double widest = calib::middle_of(cameras).widest;
  if (widest > apart_m)
    throw files::ConfigError(file, 0,
                             fmt::format("all cameras are at one place; with the poses inverted (world_from_cam), they "
                                         "are up to {:.3f} m apart: give --inverted-poses",
                                         widest));
}

}  // namespace

Imported import_rig(std::span<const std::filesystem::path> files, const ImportOptions& options) {
  if (files.empty()) throw ExchangeError("no file to import");
  const std::filesystem::path& file = files.front();
  if (const std::string problem = bags::problem_of_beginning(file); !problem.empty())
    throw files::ConfigError(file, 0, problem);
  Imported out = files.size() == 1 && bags::is_bag(file) ? import_bag(file, options) : imported_from(files, options);
  for (calib::Camera& camera : out.rig.cameras) camera.cam_from_world.translation *= options.metres_per_unit;
  if (options.inverts_poses) calib::invert_poses(out.rig.cameras);
  if (options.has_opengl_axes) turn_opengl_axes(out.rig.cameras);
  if (!options.inverts_poses) refuse_one_place(out.rig.cameras, file);
  const double widest = calib::middle_of(out.rig.cameras).widest;
  constexpr double widest_rig_m = 50;  // a wider rig is probably in millimetres
  if (widest > widest_rig_m) {
    throw files::ConfigError(file, 0,
                             fmt::format("the cameras are up to {:.0f} m apart: if the file is in centimetres ({:.3g} "
                                         "m), give --unit cm, if in millimetres ({:.3g} m), --unit mm",
                                         widest, widest / 100, widest / 1000));
  }
  if (out.rig.cameras.size() > 1) check_placement(out.rig.cameras, options.inverts_poses, out);
  if (out.rig.cameras.size() > 1 && !out.is_doubtful) check_axes(out.rig.cameras, options, out);
  require_valid(out.rig, file);
  return out;
}

}  // namespace huetrack::exchange
